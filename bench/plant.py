"""Run a machine and record its logs: encoders, observer and law at 1 kHz, MuJoCo between.

    logs = record(machine, faults, experiments, seed)
    recording = run(machine, law, reference, faults, seed)

The law's torque is rounded to the bits of the command and clipped to the limit; that is `tau`. What
faults, noise and drives make of it on its way is what acts, held over an inner step. Friction and
loads are evaluated at every stage of RK4.

MuJoCo has one callback for the whole process: no two runs at once in one process.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

from bench.config import CONFIG, SAMPLE_TIME
from bench.control import Law, Observer, OpenLoop, Step
from bench.dynamics import build
from bench.experiments import Experiment
from bench.machine import Fault, Floats, Hooks, Machine, Run
from bench.motions import Reference
from bench.plan import Plan, plan_of
from pipelines.errors import UsageError
from pipelines.io import schema
from pipelines.io.log import Array, Controller, ExperimentLog, Signal
from pipelines.io.robot import format_robot


@dataclass(frozen=True, eq=False)
class Recording:
    """The record of a run. Each signal (samples, n)."""

    t: Array  # (samples,) [s]
    q: Array  # [rad] as the encoders gave it
    tau: Array  # [N m] as logged
    reference: Reference
    observed: tuple[Array, Array, Array]  # q_obs, dq_obs, ddq_obs
    extras: dict[str, Array]  # r, v, tau_friction, tau_feedforward, where the law has them
    controller: Controller
    true_q: Array  # [rad] at the motors; for tests, no log has it
    true_dq: Array  # [rad/s]


def record(
    machine: Machine, faults: Sequence[Fault], experiments: Iterable[Experiment], seed: int = 0
) -> list[ExperimentLog]:
    """Return the log of each experiment on the machine with these faults."""
    return [
        as_log(machine, one, run(machine, one.law, one.reference, faults, seed=1000 * seed + place))
        for place, one in enumerate(experiments)
    ]


def as_log(machine: Machine, experiment: Experiment, recording: Recording) -> ExperimentLog:
    """Return what the recorder of the machine would have written: nothing of it tells a fault."""
    reference = recording.reference
    observed = dict(zip(("q_obs", "dq_obs", "ddq_obs"), recording.observed, strict=True))
    values = {"t": recording.t, "q": recording.q, "tau": recording.tau}
    values |= recording.extras | observed
    if not isinstance(experiment.law, OpenLoop):
        values |= {"q_ref": reference.q, "dq_ref": reference.dq, "ddq_ref": reference.ddq}
    law, robot = recording.controller.law, machine.described
    return ExperimentLog(
        name=experiment.name,
        experiment=experiment.kind,
        role=experiment.role,
        origin="simulated",
        robot_name=robot.name,
        sample_time=SAMPLE_TIME,
        robot_text=format_robot(robot),
        signals={
            name: Signal(array, schema.unit_of(name, law), schema.SIGNALS[name][1])
            for name, array in values.items()
        },
        joint=experiment.joint,
        posture=experiment.posture,
        period=experiment.period,
        controller=recording.controller,
    )


def peak_torque(logs: Iterable[ExperimentLog]) -> tuple[float, ...]:
    """Return the largest torque (n,) [N m] of each joint over `logs`, for saturations."""
    return tuple(np.max([np.abs(log.tau).max(axis=0) for log in logs], axis=0).tolist())


def answer(faults: Iterable[Fault]) -> list[dict[str, object]]:
    """Return cause, joint and parameters of each fault as findings name them; or "unknown"."""
    return [
        {
            "cause": fault.name if fault.known else "unknown",
            "kind": fault.name,
            "joint": fault.joint,
            "parameters": fault.parameters(),
        }
        for fault in faults
    ]


def plan_with(machine: Machine, faults: Sequence[Fault]) -> Plan:
    """Return the machine's plan as changed by its own and by these faults."""
    plan = plan_of(machine.robot)
    for fault in (*machine.standing, *faults):
        plan = fault.build(plan, machine)
    return plan


def run(
    machine: Machine,
    law: Law,
    reference: Reference,
    faults: Sequence[Fault] = (),
    seed: int = 0,
    inner_step: float | None = None,
) -> Recording:
    """Let `machine` follow `reference` under `law`, from rest at its first sample.

    Args:
        machine: with what it has had from its first day.
        law: of its controller.
        reference: what it is to follow.
        faults: further ones.
        seed: of the noise; the same seed gives the same noise with any faults.
        inner_step: [s] at most; default: what the plan asks for.

    Raises:
        UsageError: C02, the loop runs away: gains, reference or strength do not fit the machine.
    """
    plan = plan_with(machine, faults)
    substeps = plan.substeps(SAMPLE_TIME)
    if inner_step:
        substeps = max(substeps, round(SAMPLE_TIME / inner_step))
    built = build(plan, SAMPLE_TIME / substeps)
    data = mujoco.MjData(built.model)
    data.qpos[list(built.joints)] = reference.q[0]
    x, y, z = built.tip.tolist()
    plant = Run(
        machine=machine,
        model=built.model,
        data=data,
        names=built.dofs,
        dofs=built.joints,
        tip_body=built.tip_body,
        tip=(x, y, z),
        substeps=substeps,
        inner_step=SAMPLE_TIME / substeps,
        applied=[0.0] * machine.n,
        samples=reference.samples,
        rng=np.random.default_rng([1, seed]),
    )
    # Each fault draws from a source of its own, so that a further one does not change the others.
    hooks = [
        fault.start(replace(plant, rng=np.random.default_rng([2, seed, group, place])))
        for group, members in enumerate((machine.standing, faults))
        for place, fault in enumerate(members)
    ]
    noise = np.array(machine.amplifier_noise) * plant.rng.standard_normal(
        (plant.samples, machine.n)
    )
    step, extras = law.start(machine, reference)
    with _forces(plant, hooks):
        mujoco.mj_forward(plant.model, data)
        rows = _loop(plant, hooks, step, reference, noise.tolist())
    q, tau, true_q, true_dq, e, de, nu = (np.array(row) for row in rows)
    observed = (reference.q + e, reference.dq + de, reference.ddq + nu)
    controller = law.describe(machine)
    return Recording(reference.t, q, tau, reference, observed, extras, controller, true_q, true_dq)


@contextmanager
def _forces(plant: Run, hooks: list[Hooks]) -> Iterator[None]:
    """Apply friction and loads as MuJoCo's passive force while the context lasts.

    MuJoCo's warnings, which would go to a file in the working directory, are left out: `_loop` sees
    a runaway itself.
    """
    laws = [(dof, law.law()) for dof, law in zip(plant.dofs, plant.machine.friction, strict=True)]
    loads = [hook.load for hook in hooks if hook.load]
    position, speed, passive = plant.data.qpos, plant.data.qvel, plant.data.qfrc_passive
    nothing = [0.0] * plant.model.nv

    def friction_and_loads(model: Any, now: Any) -> None:
        v = speed.tolist()
        force = nothing.copy()
        for dof, law in laws:
            force[dof] = -law(v[dof])
        if loads:
            t, q = plant.data.time, position.tolist()
            for load in loads:
                load(t, q, v, force)
        passive[:] += force

    warning = mujoco.get_mju_user_warning()
    mujoco.set_mjcb_passive(friction_and_loads)
    mujoco.set_mju_user_warning(lambda text: None)
    try:
        yield
    finally:
        mujoco.set_mjcb_passive(None)
        mujoco.set_mju_user_warning(warning)


def _mover(plant: Run, hooks: list[Hooks]) -> Callable[[Floats], None]:
    """Return a function that lets a torque (n,) [N m] act for one sample."""
    drives = [hook.drive for hook in hooks if hook.drive]
    steps = [hook.step for hook in hooks if hook.step]
    model, data, applied, dofs = plant.model, plant.data, plant.applied, list(plant.dofs)
    force, position, speed = data.qfrc_applied, data.qpos, data.qvel

    def at_once(torque: Floats) -> None:
        applied[:] = torque
        force[dofs] = torque
        mujoco.mj_step(model, data, plant.substeps)

    def step_by_step(torque: Floats) -> None:
        q = position.tolist()
        for _ in range(plant.substeps):
            applied[:] = torque
            for drive in drives:
                drive(data.time, applied, q)
            force[dofs] = applied
            mujoco.mj_step(model, data)
            q = position.tolist()
            if steps:
                t, v = data.time, speed.tolist()
                for step in steps:
                    step(t, q, v)

    return step_by_step if drives or steps else at_once


def _loop(
    plant: Run, hooks: list[Hooks], step: Step, reference: Reference, noise: list[Floats]
) -> list[list[Floats]]:
    """Return q, tau, true q and dq, and the observer's e, de and nu, samples of lists of n."""
    machine, dofs, q_ref = plant.machine, plant.dofs, reference.q.tolist()
    observer = Observer(machine.observer_gain, SAMPLE_TIME)
    move, command = _mover(plant, hooks), _quantiser(machine)
    senses = [hook.sense for hook in hooks if hook.sense]
    writes = [hook.write for hook in hooks if hook.write]
    rows: list[list[Floats]] = [[], [], [], [], [], [], []]
    waiting = [[0.0] * machine.n] * machine.delay
    for k in range(plant.samples):
        t, every, speeds = k * SAMPLE_TIME, plant.data.qpos.tolist(), plant.data.qvel.tolist()
        truth, speed = [every[dof] for dof in dofs], [speeds[dof] for dof in dofs]
        measured = truth.copy()
        for sense in senses:
            sense(t, measured)
        pairs = zip(measured, machine.encoder_resolution, strict=True)
        q = [round(x / width) * width if width else x for x, width in pairs]
        observer.update([a - b for a, b in zip(q, q_ref[k], strict=True)])
        waiting.append(command(step(k, q, observer)))
        tau = waiting.pop(0)
        logged = tau.copy()
        if writes:
            for write in writes:
                write(t, logged)
            logged = command(logged)  # the recorder's words have as many bits as the command's
        values = (q, logged, truth, speed, observer.e, observer.de, observer.nu)
        for row, value in zip(rows, values, strict=True):
            row.append(value.copy())
        move([a + b for a, b in zip(tau, noise[k], strict=True)])
        if not all(abs(v) < CONFIG.runaway_speed for v in speed):  # nor what is not a number
            raise UsageError(
                "C02",
                f"the loop runs away at {t:.3f} s",
                remedy="lower the gains, the reference or the strength",
            )
    return rows


def _quantiser(machine: Machine) -> Callable[[Floats], Floats]:
    """Return a function that rounds to the bits of the command and clips to its limit."""
    pairs = list(zip(machine.torque_limit, machine.torque_resolution, strict=True))

    def clipped(tau: Floats) -> Floats:
        return [min(max(u, -limit), limit) for u, (limit, _) in zip(tau, pairs, strict=True)]

    def rounded(tau: Floats) -> Floats:
        bits = zip(tau, pairs, strict=True)
        return [min(max(round(u / bit) * bit, -limit), limit) for u, (limit, bit) in bits]

    return rounded if machine.quantised_torque else clipped
