"""Validate a model on held-out logs: torque, control cases, simulation.

    found = torque_validation(log, motion, parts)
    found.relative_error            ‖τ - τ̂‖/‖τ‖, joint by joint

Kostić et al. 2004, Section IV.C.5, Figs. 13 and 14: the torque that the controller commanded
against the torque of the model on the realised motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.arm import Arm, ArmTorque
from pipelines.errors import Check, RrridError
from pipelines.estimation.filters import zero_phase
from pipelines.estimation.motion import Reconstructed
from pipelines.estimation.regression import cutoff_at, wanted_cutoff
from pipelines.importers.controller import ControllerTable
from pipelines.io.log import Array, ExperimentLog, recording
from pipelines.io.output import slug
from pipelines.io.results import NOT_STORED
from pipelines.io.schema import joint_unit
from pipelines.simulation.imitate import How, Imitation, imitate
from pipelines.writing.config import CONFIG
from pipelines.writing.control_cases import (
    CASES,
    Case,
    case_of,
    measured_cases,
    one_task,
    possible,
    simulated_cases,
    why_not,
)
from pipelines.writing.task import Designed

__all__ = [
    "Course",
    "Gates",
    "Result",
    "TorqueError",
    "TorqueValidation",
    "control_cases",
    "gates_of",
    "pooled",
    "residual",
    "simulated_task",
    "torque_validation",
]

PARTS = ("inertia", "coriolis", "gravity", "friction", "effects")


@dataclass(frozen=True)
class Course:
    """Torques for the figures, thinned; (points, joints) [N m]."""

    t: Array  # [s] (points,)
    measured: Array
    model: Array
    inertia: Array
    coriolis: Array
    gravity: Array
    friction: Array
    effects: Array
    residual: Array  # measured - model


@dataclass(frozen=True)
class TorqueValidation:
    """One log. Arrays are per joint."""

    name: str
    experiment: str
    role: str
    law: str  # of its controller
    samples: int  # compared
    torque_units: tuple[str, ...]
    rms: Array  # [N m] measured minus model
    signal_rms: Array  # [N m] measured
    relative_error: Array
    low_pass_hz: float | None
    relative_error_low_pass: Array  # after one low-pass over both: without noise of the command
    parts_rms: dict[str, Array]  # [N m] of inertia, coriolis, gravity, friction, effects
    course: Course | None


def residual(log: ExperimentLog, motion: Reconstructed, parts: ArmTorque) -> Array:
    """Return measured minus modelled torque (samples, joints) [N m] after a zero-phase low-pass."""
    return _low_passed(log, motion, log.tau - parts.total)[0]


def _low_passed(
    log: ExperimentLog, motion: Reconstructed, torque: Array
) -> tuple[Array, float | None]:
    """Return `torque` in the band of motion and dry friction, and that cut-off [Hz]."""
    torque = np.where(_known(log, motion)[:, None], torque, 0.0)
    rate = 1.0 / log.sample_time
    cutoff_hz = cutoff_at(wanted_cutoff(motion.motion, rate), rate)
    if cutoff_hz is None:
        return torque, None
    return zero_phase(torque, cutoff_hz, rate), cutoff_hz


def torque_validation(
    log: ExperimentLog, motion: Reconstructed, parts: ArmTorque, draw: bool = True
) -> TorqueValidation:
    """Compare the model's torque, `parts`, with the measured one."""
    known = _known(log, motion)
    error, measured = _rms((log.tau - parts.total)[known]), _rms(log.tau[known])
    smooth, cutoff = _low_passed(log, motion, log.tau - parts.total)
    whole = _rms(_low_passed(log, motion, log.tau)[0][known])
    course = None
    if draw:
        rows = slice(None, None, max(1, -(-log.n_samples // CONFIG.points)))
        shown, model = np.where(known[:, None], log.tau, np.nan)[rows], parts.total[rows]
        each = {name: getattr(parts, name)[rows] for name in PARTS}
        course = Course(log.t[rows] - log.t[0], shown, model, residual=shown - model, **each)
    return TorqueValidation(
        log.name,
        log.experiment,
        log.role,
        "unknown" if log.controller is None else log.controller.law,
        int(known.sum()),
        tuple(joint_unit("tau", revolute) for revolute in log.robot.revolute),
        error,
        measured,
        _ratio(error, measured),
        cutoff,
        _ratio(_rms(smooth[known]), whole),
        {name: _rms(getattr(parts, name)[known]) for name in PARTS},
        course,
    )


def _known(log: ExperimentLog, motion: Reconstructed) -> npt.NDArray[np.bool_]:
    """Return (samples,) where torque and motion are measured and fit to be compared."""
    good = np.zeros(log.n_samples, dtype=bool)
    good[motion.good.kept] = motion.good.fit
    return np.asarray(good & np.isfinite(log.tau).all(axis=1))


def _rms(x: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(x**2, axis=0))) if len(x) else np.full(x.shape[1], np.nan)


def _ratio(error: Array, whole: Array) -> Array:
    """Return ‖τ - τ̂‖/‖τ‖; infinite where a joint had no torque at all."""
    return np.divide(error, whole, out=np.full_like(error, np.inf), where=whole > 0.0)


@dataclass(frozen=True)
class TorqueError:
    """Measured against model, over all logs that count; per joint."""

    rms: Array  # [N m]
    signal_rms: Array  # [N m] measured
    relative_error: Array  # rms over signal_rms
    of: str  # "writing" | "validate": which logs count


def pooled(logs: Sequence[TorqueValidation]) -> TorqueError | None:
    """Pool the writing logs, else those that move: at rest friction is undetermined."""
    writing = [log for log in logs if log.experiment == "writing"]
    some = writing or [log for log in logs if log.experiment != "hold"] or list(logs)
    if not some:
        return None
    counts = np.array([log.samples for log in some], dtype=float)[:, None]
    error, whole = (
        np.sqrt((counts * np.array(x) ** 2).sum(axis=0) / counts.sum())
        for x in ([log.rms for log in some], [log.signal_rms for log in some])
    )
    return TorqueError(error, whole, _ratio(error, whole), "writing" if writing else "validate")


Pair = tuple[ExperimentLog, Reconstructed]


def control_cases(
    pairs: Sequence[Pair],
    parts: Sequence[ArmTorque],
    arm: Arm,
    simulate: bool,
    draws: int,
    seed: int,
) -> tuple[tuple[Case, ...], str, tuple[str, ...]]:
    """Return Table IV, why cases are missing, and the writing logs that do not compare."""
    writing = [
        k for k, (log, _) in enumerate(pairs) if log.experiment == "writing" and "q_ref" in log
    ]
    if not writing:
        return (), "no log of experiment writing with a reference is among the held-out ones", ()
    first = min(writing, key=lambda k: case_of(pairs[k][0]) or len(CASES) + 1)
    base = pairs[first][0]
    task = one_task([pairs[k][0] for k in writing], base)
    cases = measured_cases([pairs[k] for k in writing if pairs[k][0] in task])
    compared = {name for case in cases.values() for name in case.logs}
    apart = tuple(pairs[k][0].name for k in writing if pairs[k][0].name not in compared)
    missing = [case for case in range(1, len(CASES) + 1) if case not in cases]
    reason = ""
    if missing and not simulate:
        reason = "it was not asked to simulate those that were not recorded"
    elif missing and not (reason := why_not(recording(base))):
        some, reason = possible(base, missing)
        try:
            if some:
                error = residual(*pairs[first], parts[first])
                cases |= simulated_cases(recording(base), arm, error, some, draws, seed)
        except RrridError as problem:  # the rest of the validation stays
            reason = problem.message
    return tuple(cases[case] for case in sorted(cases)), reason, apart


def simulated_task(pairs: Sequence[Pair], arm: Arm) -> tuple[Imitation | None, str]:
    """Simulate one task with the model, in closed loop where its log describes the controller."""
    log = min(
        (log for log, _ in pairs),
        key=lambda log: (log.experiment != "writing", bool(why_not(recording(log)))),
    )
    try:
        file = f"logs/{slug(log.name)}-simulated"
        return imitate(log, arm, How(), file, {"model": arm.name}), ""
    except RrridError as problem:
        return None, problem.message


@dataclass(frozen=True)
class Gates:
    """Passed or not; null where it could not be judged."""

    torque_limit: float  # relative error
    torque: bool | None  # 1: every joint's relative torque error is below the limit
    cases: bool | None  # 2: case 6 is below case 1 in x, y and z


def gates_of(
    torque: TorqueError | None, cases: Sequence[Case], limit: float, robot: str
) -> tuple[Gates, tuple[Check, ...]]:
    """Judge the torque and the control cases; a warning for each gate that failed."""
    std = {one.case: one.tip_error_std.values for one in cases}
    better = None
    if {1, len(CASES)} <= set(std):
        better = all(full < alone for full, alone in zip(std[len(CASES)], std[1], strict=True))
    gates = Gates(
        limit, None if torque is None else bool((torque.relative_error < limit).all()), better
    )
    checks = []
    if torque is not None and gates.torque is False:
        missed = [
            f"joint {j + 1} {100 * error:.3g} %"
            for j, error in enumerate(torque.relative_error)
            if not error < limit
        ]
        words = f"the model misses the torque of held-out logs by more than {100 * limit:.3g} %: "
        remedy = "let 'rrrid diagnose' say what is missed, or fit to richer logs"
        words += ", ".join(missed)
        checks.append(Check.of("D19", "warn", words, where=robot, gate=True, remedy=remedy))
    if gates.cases is False:
        words = "with the complete model ahead of the feedback the tip strays no less than "
        words += "without, on some axis"
        remedy = "look at the split of the torque, and at its signs"
        checks.append(Check.of("D20", "warn", words, where=robot, gate=True, remedy=remedy))
    return gates, tuple(checks)


@dataclass(frozen=True)
class Result:
    """Everything computed. `design` alone is set of a task that was designed."""

    robot: str
    joints: tuple[str, ...]
    model: str  # in words, where it comes from
    torque: TorqueError | None
    gates: Gates
    logs: tuple[TorqueValidation, ...] = ()
    cases: tuple[Case, ...] = ()
    cases_left_out: str = ""  # why some or all of them are missing, in words
    cases_apart: tuple[str, ...] = ()  # writing logs of another controller, gains or reference
    drawn: str = ""  # what the controllers' models were drawn from, in words; empty: nothing
    draws: int = 0
    simulation: Imitation | None = None
    simulation_left_out: str = ""
    design: Designed | None = None
    data_quality: tuple[Check, ...] = field(default=(), metadata=NOT_STORED, repr=False)
    derived: tuple[tuple[str, ExperimentLog], ...] = field(
        default=(), metadata=NOT_STORED, repr=False
    )
    table: ControllerTable | None = field(default=None, metadata=NOT_STORED, repr=False)
