"""Run a machine: encoders, observer and control law at 1 kHz, drives, and the true motion between by MuJoCo.

    recording = run(machine, law, reference, faults, seed)

The law's torque is rounded to the bits of the command and clipped to the limit; that is `tau`. What faults, noise and
drives make of it on its way is what acts, held over an inner step. Friction and loads are asked at every stage of RK4.

MuJoCo has one callback for the whole process: no two runs at once in one process.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from bench.controllers import Law
from bench.fault import Fault, Hooks, Run
from bench.machine import SAMPLE_TIME, Machine
from bench.observer import Observer
from bench.plan import Plan, plan_of
from bench.reference import Reference
from bench.spec import Built, build
from pipelines.errors import UsageError
from pipelines.io.experiment import Array, Controller

__all__ = ["Recording", "plan_with", "run"]

Floats = list[float]
_RUNAWAY = 1000.0  # [rad/s] no joint turns as fast


@dataclass(frozen=True, eq=False)
class Recording:
    """What a run left behind. Each signal (samples, n)."""

    t: Array  # (samples,) [s]
    q: Array  # [rad] as the encoders gave it
    tau: Array  # [N m] as logged
    reference: Reference
    observed: tuple[Array, Array, Array]  # q_obs, dq_obs, ddq_obs
    extras: dict[str, Array]  # r, v, tau_friction, tau_feedforward, where the law has them
    controller: Controller
    true_q: Array  # [rad] at the motors; for tests, no log tells it
    true_dq: Array  # [rad/s]


def plan_with(machine: Machine, faults: Sequence[Fault]) -> Plan:
    """The machine's plan after every fault has had its way with it."""
    plan = plan_of(machine.robot)
    for fault in (*machine.standing, *faults):
        plan = fault.build(plan, machine)
    return plan


def run(machine: Machine, law: Law, reference: Reference, faults: Sequence[Fault] = (), seed: int = 0,
        inner_step: float | None = None) -> Recording:
    """Let `machine` follow `reference` under `law`, from rest at its first sample.

    Args:
        faults: what ails it, on top of what it has always had.
        seed: of the noise; the same seed gives the same noise whatever the faults.
        inner_step: [s] at most; default: what the plan asks for.

    Raises:
        UsageError: C02, the loop runs away: gains, reference or strength do not fit the machine.
    """
    plan = plan_with(machine, faults)
    substeps = max(plan.substeps(SAMPLE_TIME), round(SAMPLE_TIME / inner_step) if inner_step else 1)
    built = build(plan, SAMPLE_TIME / substeps)
    data = mujoco.MjData(built.model)
    dofs = list(built.joints)
    data.qpos[dofs] = reference.q[0]
    applied = [0.0] * machine.n
    hooks = _started(machine, faults, built, data, applied, reference, substeps, seed)
    with _forces(machine, built, data, [hook.load for hook in hooks if hook.load]):
        mujoco.mj_forward(built.model, data)
        return _loop(machine, law, reference, built, data, applied, hooks, substeps, _noise(machine, reference.samples, seed))


def _noise(machine: Machine, samples: int, seed: int) -> list[Floats]:
    rng = np.random.default_rng([1, seed])
    noise: list[Floats] = (np.array(machine.amplifier_noise) * rng.standard_normal((samples, machine.n))).tolist()
    return noise


def _started(machine: Machine, faults: Sequence[Fault], built: Built, data: Any, applied: Floats, reference: Reference,
             substeps: int, seed: int) -> list[Hooks]:
    """Standing faults draw from sources of their own, so that a further fault does not change them."""
    x, y, z = built.tip.tolist()
    hooks = []
    for group, members in enumerate((machine.standing, faults)):
        for place, fault in enumerate(members):
            hooks.append(fault.start(Run(
                machine, built.model, data, built.dofs, built.joints, built.tip_body, (x, y, z), SAMPLE_TIME,
                SAMPLE_TIME / substeps, applied, reference.samples * SAMPLE_TIME, np.random.default_rng([2, seed, group, place]))))
    return hooks


@contextmanager
def _forces(machine: Machine, built: Built, data: Any,
            loads: list[Callable[[float, Floats, Floats, Floats], None]]) -> Iterator[None]:
    """Friction and loads as MuJoCo's passive force while the context lasts.

    MuJoCo's warnings, which would go to a file in the working directory, are left out: `_loop` sees a runaway itself.
    """
    laws = [(dof, law.law()) for dof, law in zip(built.joints, machine.friction, strict=True)]
    position, speed, passive, nothing = data.qpos, data.qvel, data.qfrc_passive, [0.0] * built.model.nv

    def friction_and_loads(model: Any, now: Any) -> None:
        v = speed.tolist()
        force = nothing.copy()
        for dof, law in laws:
            force[dof] = -law(v[dof])
        if loads:
            t, q = data.time, position.tolist()
            for load in loads:
                load(t, q, v, force)
        passive[:] += force

    told = mujoco.get_mju_user_warning()
    mujoco.set_mjcb_passive(friction_and_loads)
    mujoco.set_mju_user_warning(lambda text: None)
    try:
        yield
    finally:
        mujoco.set_mjcb_passive(None)
        mujoco.set_mju_user_warning(told)


def _mover(built: Built, data: Any, applied: Floats, hooks: list[Hooks], substeps: int) -> Callable[[Floats], None]:
    """A function that lets a torque (n,) act for one sample."""
    drives = [hook.drive for hook in hooks if hook.drive]
    steps = [hook.step for hook in hooks if hook.step]
    model, dofs, force, position, speed = built.model, list(built.joints), data.qfrc_applied, data.qpos, data.qvel

    def at_once(torque: Floats) -> None:
        applied[:] = torque
        force[dofs] = torque
        mujoco.mj_step(model, data, substeps)

    def step_by_step(torque: Floats) -> None:
        q = position.tolist()
        for _ in range(substeps):
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


def _loop(machine: Machine, law: Law, reference: Reference, built: Built, data: Any, applied: Floats, hooks: list[Hooks],
          substeps: int, noise: list[Floats]) -> Recording:
    n, samples = machine.n, reference.samples
    observer = Observer(machine.observer_gain, SAMPLE_TIME)
    control = law.start(machine, reference, SAMPLE_TIME)
    move = _mover(built, data, applied, hooks, substeps)
    senses, writes = [hook.sense for hook in hooks if hook.sense], [hook.write for hook in hooks if hook.write]
    dofs, resolution, q_ref = built.joints, machine.encoder_resolution, reference.q.tolist()
    command = _quantiser(machine)
    rows: list[list[Floats]] = [[], [], [], [], [], [], []]
    waiting = [[0.0] * n] * machine.delay
    for k in range(samples):
        t, every, speeds = k * SAMPLE_TIME, data.qpos.tolist(), data.qvel.tolist()
        truth, speed = [every[dof] for dof in dofs], [speeds[dof] for dof in dofs]
        measured = truth.copy()
        for sense in senses:
            sense(t, measured)
        q = [round(x / step) * step if step else x for x, step in zip(measured, resolution, strict=True)]
        observer.update([a - b for a, b in zip(q, q_ref[k], strict=True)])
        waiting.append(command(control(k, q, observer)))
        tau = waiting.pop(0)
        logged = tau.copy()
        if writes:
            for write in writes:
                write(t, logged)
            logged = command(logged)  # the recorder's words have as many bits, whatever it was given
        for row, values in zip(rows, (q, logged, truth, speed, observer.e, observer.de, observer.nu), strict=True):
            row.append(values.copy())
        move([a + b for a, b in zip(tau, noise[k], strict=True)])
        if not all(abs(x) < _RUNAWAY for x in speed):  # nor what is not a number
            raise UsageError("C02", f"the loop runs away at {t:.3f} s", remedy="lower the gains, the reference or the strength")
    q_all, tau_all, true_q, true_dq, e, de, nu = (np.array(row) for row in rows)
    observed = (reference.q + e, reference.dq + de, reference.ddq + nu)
    return Recording(reference.t, q_all, tau_all, reference, observed, control.extras, law.describe(machine), true_q, true_dq)


def _quantiser(machine: Machine) -> Callable[[Floats], Floats]:
    """Round to the bits of the command and clip to its limit."""
    pairs = list(zip(machine.torque_limit, machine.torque_resolution, strict=True))
    if not machine.quantised_torque:
        return lambda tau: [min(max(u, -limit), limit) for u, (limit, _) in zip(tau, pairs, strict=True)]
    return lambda tau: [min(max(round(u / bit) * bit, -limit), limit) for u, (limit, bit) in zip(tau, pairs, strict=True)]
