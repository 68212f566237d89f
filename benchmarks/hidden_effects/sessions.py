"""Record a case: 52 s of logs at 1 kHz, in a mixture of experiments, with what else
the case has.

session = record_case(case)        its logs, of role "identify", "validate" and "reference", and
what was hidden

mixed      two excitations, slow sweeps, at rest              judged by an excitation and slow
sweeps periodic   two excitations of two periods each                judged by one of two periods
friction   an excitation, each joint open loop, at rest       judged by an excitation and slow
sweeps long       an excitation of 20 s and slow sweeps              judged by an excitation of 20 s
short      two excitations of 6 s                             judged by one of 6 s fast       two
excitations                                    judged by one slow       slow sweeps, twice
judged by slow sweeps
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

import numpy as np

from bench import experiments
from bench.control import Decentralised, FeedForward
from bench.draw import draw_machine, machine_of, with_links
from bench.experiments import Experiment
from bench.faults import make
from bench.machine import Fault, Machine
from bench.plan import Solid
from bench.plant import peak_torque
from benchmarks.hidden_effects.cases import Hidden, SealedCase
from benchmarks.hidden_effects.robots import ROBOTS
from pipelines.dynamics.arm import Acting, Arm
from pipelines.effects.friction import Coulomb, Viscous
from pipelines.errors import UsageError
from pipelines.io.log import Array, ExperimentLog
from sample_logs.bench_session import ControllerModel, controller_model, recorded

_BEFORE, _NOW = datetime(2026, 3, 2, 9, 0), datetime(2026, 5, 18, 9, 0)  # UTC
_BETWEEN = timedelta(seconds=90)  # from the start of one log to that of the next
_LINK_ERROR, _FRICTION_ERROR = 0.05, 0.08  # of each number of the controllers' model
_FRF_SECONDS, _REVERSAL_SECONDS = 20.0, 6.0
_SHORTEST = {
    False: 8.0,
    True: 6.0,
}  # [s] of the logs in which a contact finds its time; of a short session

Plans = list[Experiment]


@dataclass(frozen=True)
class Session:
    """The logs of a case, and the truth about them."""

    logs: tuple[ExperimentLog, ...]
    hidden: tuple[Fault, ...]
    standing: tuple[Fault, ...]


def record_case(case: SealedCase) -> Session:
    """Record the logs of a case, with other experiments where a fault lets an open loop run
    away.
    """
    try:
        return _record(case, case.session)
    except UsageError:
        if case.session != "friction":
            raise
        return _record(case, "mixed")


def _record(case: SealedCase, session: str) -> Session:
    machine = machine_of_case(case)
    plans = _plans(case, machine, session)
    standing, hidden = (
        tuple(_fault(one, case, machine, plans) for one in group)
        for group in (case.standing, case.hidden)
    )
    logs: list[ExperimentLog] = []
    if case.reference:
        others = _plans(case, machine, case.before) if case.before else plans
        before = [
            plan.before()
            for plan in others
            if plan.kind in ("excitation", "free") and plan.role == "identify"
        ]
        logs += _recorded(machine, before, standing, 2 * case.seed, _BEFORE)
    for place, plan in enumerate(plans):
        here = [
            fault
            for one, fault in zip(case.hidden, hidden, strict=True)
            if not one.once or place == 0
        ]
        logs += _recorded(
            machine,
            [plan],
            (*standing, *here),
            100 * (2 * case.seed + 1) + place,
            _NOW + place * _BETWEEN,
        )
    if not case.held:
        logs = [replace(log, torque="measured") for log in logs]
    return Session(tuple(logs), hidden, standing)


def machine_of_case(case: SealedCase) -> Machine:
    """Return the machine as on its first day; its gains are drawn anew for each case."""
    if case.robot in ROBOTS:
        machine = machine_of(ROBOTS[case.robot], case.machine)
    else:
        machine = draw_machine(case.machine, "paper" if case.robot == "paper" else "fault")
    stiffness = float(np.random.default_rng([93, case.seed]).uniform(0.7, 1.4))
    return replace(
        machine,
        delay=int(case.loop == "delayed"),
        amplifier_noise=tuple(case.amplifier * rms for rms in machine.amplifier_noise),
        kp=tuple(stiffness * gain for gain in machine.kp),
        kd=tuple(stiffness**0.5 * gain for gain in machine.kd),
    )


def _fault(one: Hidden, case: SealedCase, machine: Machine, plans: Plans) -> Fault:
    """Return the fault; a drive's limit is relative to the largest torque of the healthy
    machine.
    """
    peak = None
    if one.cause == "torque_saturation":
        peak = peak_torque(
            _recorded(
                machine,
                [plan for plan in plans if plan.kind in ("excitation", "free")],
                (),
                case.seed,
                _NOW,
            )
        )
    return make(
        one.cause,
        machine,
        one.joint,
        one.seed,
        one.strength,
        peak,
        _SHORTEST[case.session == "short"],
    )


def _recorded(
    machine: Machine, plans: Plans, faults: Sequence[Fault], seed: int, begun: datetime
) -> Iterator[ExperimentLog]:
    for _, log in recorded(machine, plans, begun, faults, seed):
        yield log


def _plans(case: SealedCase, machine: Machine, session: str) -> Plans:
    rng = np.random.default_rng([94, case.seed])
    plans = _SETS[session](machine, [int(seed) for seed in rng.integers(1, 100_000, 4)])
    plans = [
        replace(plan, name=f"{plan.kind}-{number}") for number, plan in enumerate(plans, start=1)
    ]
    if case.loop == "backward-difference":
        return [
            replace(plan, law=Decentralised("backward-difference"))
            if isinstance(plan.law, Decentralised)
            else plan
            for plan in plans
        ]
    if case.frf or rng.uniform() < 0.25:
        model = _controllers_model(machine, case.seed)
        if case.frf:
            return [*plans, *_compliance_plans(machine, model, case.seed)]
        plans = [
            replace(plan, law=FeedForward(model))
            if isinstance(plan.law, Decentralised) and plan.kind != "hold"
            else plan
            for plan in plans
        ]
    return plans


def _mixed(machine: Machine, seeds: list[int]) -> Plans:
    one, two, three, four = seeds
    return [
        experiments.excitation(machine, one, 12.0, 1),
        experiments.excitation(machine, two, 10.0, 1),
        experiments.free(machine, three, 10.0),
        experiments.hold(_somewhere(machine, one), 1, 2.0),
        experiments.excitation(machine, three, 10.0, 1).judging(),
        experiments.free(machine, four, 8.0).judging(),
    ]


def _friction(machine: Machine, seeds: list[int]) -> Plans:
    one, two, three, _ = seeds
    alone = [
        experiments.friction(machine, joint, two, 15.0 / machine.n)
        for joint in range(1, machine.n + 1)
    ]
    return [
        experiments.excitation(machine, one, 6.0, 2),
        *alone,
        experiments.hold(_somewhere(machine, one), 1, 3.0),
        experiments.excitation(machine, three, 12.0, 1).judging(),
        experiments.free(machine, two, 10.0).judging(),
    ]


def _long(machine: Machine, seeds: list[int]) -> Plans:
    one, two, three, _ = seeds
    return [
        experiments.excitation(machine, one, 10.0, 2),
        experiments.free(machine, two, 12.0),
        experiments.excitation(machine, three, 10.0, 2).judging(),
    ]


def _slow(machine: Machine, seeds: list[int]) -> Plans:
    one, two, three, _ = seeds
    return [
        experiments.free(machine, one, 22.0),
        experiments.free(machine, two, 18.0),
        experiments.free(machine, three, 12.0).judging(),
    ]


def _excited(*lengths: tuple[float, int]) -> Callable[[Machine, list[int]], Plans]:
    """Excitations of these periods [s] and so many of them, of which the last judges."""

    def plans(machine: Machine, seeds: list[int]) -> Plans:
        *made, last = [
            experiments.excitation(machine, seed, *of)
            for seed, of in zip(seeds, lengths, strict=False)
        ]
        return [*made, last.judging()]

    return plans


_SETS: dict[str, Callable[[Machine, list[int]], Plans]] = {
    "mixed": _mixed,
    "periodic": _excited((8.0, 2), (8.0, 2), (10.0, 2)),
    "friction": _friction,
    "long": _long,
    "short": _excited((6.0, 1), (6.0, 1), (6.0, 1)),
    "fast": _excited((10.0, 2), (10.0, 2), (12.0, 1)),
    "slow": _slow,
}


def _compliance_plans(machine: Machine, model: ControllerModel, seed: int) -> Iterator[Experiment]:
    """Each joint excited in two postures, and to and fro."""
    for number, posture in enumerate(experiments.frf_postures(machine)[:2], start=1):
        for joint in (1, 2, 3):
            plan = experiments.frf(machine, joint, posture, model, seed, _FRF_SECONDS)
            yield replace(plan, name=f"frf-{joint}-{number}")
    for joint in (1, 2, 3):
        yield experiments.reversal(machine, joint, _REVERSAL_SECONDS)


def _somewhere(machine: Machine, seed: int) -> Array:
    """Draw a posture (n,) [rad] to rest in."""
    joints, share = (
        machine.robot.joints,
        np.random.default_rng([95, seed]).uniform(-1.2, 1.2, machine.n),
    )
    return np.array(
        [
            round(float(np.clip(x if joint.revolute else 0.15 + 0.1 * x, *joint.position)), 3)
            for x, joint in zip(share, joints, strict=True)
        ]
    )


def _controllers_model(machine: Machine, seed: int) -> ControllerModel:
    """Return an earlier identification: links within 5 % and friction within 8 % of the truth."""
    rng = np.random.default_rng([96, seed])
    links = [
        Solid.of_link(joint.link).drawn(rng, _LINK_ERROR).as_link()
        for joint in machine.robot.joints
        if joint.link
    ]
    arm = Arm.from_links(with_links(machine.described, links))
    acting = []
    for joint, true in enumerate(machine.friction, start=1):
        law = true.drawn(rng, _FRICTION_ERROR)
        acting += [
            Acting.of(Coulomb(joint), {"level": law.coulomb, "sharpness": 100.0}, origin="known"),
            Acting.of(Viscous(joint), {"coefficient": law.viscous}, origin="known"),
        ]
    return controller_model(replace(arm, name="rrr-earlier", friction=tuple(acting)))
