"""Validate a model on held-out logs: torque, the six control cases, the simulation of the task, and the gates.

    checked = validate(logs, arm, Effort(...))
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pipelines.errors import Check, RrridError
from pipelines.io.log import ExperimentLog, recording
from pipelines.io.output import slug
from pipelines.model.arm import Arm, ArmTorque
from pipelines.model.estimation.outcome import torques
from pipelines.model.motion import Reconstructed, Reconstruction, reconstruct
from pipelines.model.simulation.imitate import How, Imitation, imitate
from pipelines.model.writing.cases import Case, case_of, measured_cases, one_task
from pipelines.model.writing.first_validation import (
    FirstValidation,
    first_validation,
    online_validation,
    residual,
)
from pipelines.model.writing.result import Gates, TorqueError, pooled
from pipelines.model.writing.simulated_cases import Draws, possible, simulated_cases, why_not
from pipelines.quality.checks import Subject, accepted

__all__ = ["Effort", "Validated", "validate"]

Pairs = list[tuple[ExperimentLog, Reconstructed]]

_DRAWN = 4  # logs whose torques are kept for figures
_CASES = range(1, 7)


@dataclass(frozen=True)
class Effort:
    """How strict, and what is simulated."""

    torque_gate: float = 0.1  # relative torque error of a joint
    draws: int = 5  # of the controller's model, where control cases are simulated
    seed: int = 1  # of those draws
    simulate: bool = True  # the task, and control cases that nobody recorded


@dataclass(frozen=True, eq=False)
class Validated:
    """What held-out logs say of a model."""

    pairs: Pairs
    parts: list[ArmTorque]  # the model's torque on each of them
    firsts: tuple[FirstValidation, ...]
    seconds: tuple[float, ...]  # [s] of one sample of the model online, log by log
    torque: TorqueError | None
    cases: tuple[Case, ...]
    cases_left_out: str
    cases_apart: tuple[str, ...]  # writing logs that do not compare with those in the table
    imitation: Imitation | None
    simulation_left_out: str
    gates: Gates
    checks: tuple[Check, ...]  # of the doctor and of the gates


def validate(judges: Sequence[ExperimentLog], arm: Arm, effort: Effort) -> Validated:
    """Both validations and the simulation; writing logs before all others.

    Raises:
        InputRejected: the doctor rejects a log: its first reason.
    """
    pairs, doctor = _examined(sorted(judges, key=lambda log: log.experiment != "writing"))
    parts = [torques(arm, log, motion) for log, motion in pairs]
    firsts, seconds = _first(pairs, parts, arm)
    torque = pooled(firsts)
    cases, left_out, apart = _cases(pairs, parts, arm, effort)
    imitation, not_simulated = _simulated(pairs, arm, effort)
    gates = Gates(effort.torque_gate, None if torque is None else bool((torque.relative_error < effort.torque_gate).all()),
                  _better(cases))
    return Validated(pairs, parts, firsts, seconds, torque, cases, left_out, apart, imitation, not_simulated,
                     gates, (*doctor, *_said(torque, gates, arm.robot.name)))


def _examined(logs: list[ExperimentLog]) -> tuple[Pairs, tuple[Check, ...]]:
    """The motion of every log, and what the doctor says of it; how rich a held-out motion is does not matter."""
    pairs, said = [], []
    for log in logs:
        subject = Subject(recording(log))
        checks = accepted(subject)
        pairs.append((log, reconstruct(log, Reconstruction(), subject.good)))
        said += checks
    return pairs, tuple(said)


def _first(pairs: Pairs, parts: list[ArmTorque], arm: Arm) -> tuple[tuple[FirstValidation, ...], tuple[float, ...]]:
    """The first validation of every log, and how long the model took for one sample online [s]."""
    found, seconds = [], []
    for place, ((log, motion), own) in enumerate(zip(pairs, parts, strict=True)):
        online, took = online_validation(log, motion, arm)
        seconds.append(took)
        found.append(first_validation(log, motion, arm, own, online, place < _DRAWN))
    return tuple(found), tuple(seconds)


def _cases(pairs: Pairs, parts: list[ArmTorque], arm: Arm, effort: Effort) -> tuple[tuple[Case, ...], str, tuple[str, ...]]:
    """Table IV: measured where logs show a case, else simulated; why some are missing; which writing logs do not compare."""
    writing = [k for k, (log, _) in enumerate(pairs) if log.experiment == "writing" and "q_ref" in log]
    if not writing:
        return (), "no log of experiment writing with a reference is among the held-out ones", ()
    first = min(writing, key=lambda k: case_of(pairs[k][0]) or 7)
    base = pairs[first][0]
    task = one_task([pairs[k][0] for k in writing], base)
    cases = measured_cases([pairs[k] for k in writing if pairs[k][0] in task])
    shown = {name for case in cases.values() for name in case.logs}
    apart = tuple(pairs[k][0].name for k in writing if pairs[k][0].name not in shown)
    missing = [case for case in _CASES if case not in cases]
    reason = ""
    if missing and not effort.simulate:
        reason = "it was not asked to simulate those that were not recorded"
    elif missing and not (reason := why_not(recording(base))):
        some, reason = possible(base, missing)
        try:
            cases |= simulated_cases(recording(base), arm, residual(*pairs[first], parts[first]), some,
                                     Draws(effort.draws, effort.seed)) if some else {}
        except RrridError as problem:  # a model that cannot be simulated is worth saying, and no reason to lose the rest
            reason = problem.message
    return tuple(cases[case] for case in sorted(cases)), reason, apart


def _better(cases: tuple[Case, ...]) -> bool | None:
    """Gate 2: the complete model ahead beats feedback alone on every axis."""
    by = {one.case: one.tip_error_std.values for one in cases}
    return all(full < alone for full, alone in zip(by[6], by[1], strict=True)) if {1, 6} <= set(by) else None


def _simulated(pairs: Pairs, arm: Arm, effort: Effort) -> tuple[Imitation | None, str]:
    """One task simulated with the model: in closed loop where the log of one says what its controller did."""
    if not effort.simulate:
        return None, "it was not asked for"
    log = min((log for log, _ in pairs), key=lambda log: (log.experiment != "writing", bool(why_not(recording(log)))))
    try:
        return imitate(log, arm, How(), f"logs/{slug(log.name)}-simulated", {"model": arm.name}), ""
    except RrridError as problem:
        return None, problem.message


def _said(torque: TorqueError | None, gates: Gates, robot: str) -> tuple[Check, ...]:
    """The gates that failed."""
    found = []
    if torque is not None and gates.torque is False:
        words = ", ".join(f"joint {j + 1} {100 * error:.3g} %" for j, error in enumerate(torque.relative_error)
                          if not error < gates.torque_limit)
        found.append(Check.of("D19", "warn", f"the model misses the torque of held-out logs by more than "
                              f"{100 * gates.torque_limit:.3g} %: {words}", where=robot, gate=True,
                              remedy=f"{'see in which letters; then ' if torque.of == 'writing' else ''}let 'rrrid diagnose' say "
                                     "what is missed, or fit to richer logs"))
    if gates.cases is False:
        found.append(Check.of("D20", "warn", "with the complete model ahead of the feedback the tip strays no less than without, "
                              "on some axis", where=robot, gate=True, remedy="look at the split of the torque, and at its signs"))
    return tuple(found)
