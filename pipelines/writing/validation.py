"""Validate a model on held-out logs: torque, control cases, simulation.

    found = torque_validation(log, motion, arm, parts)
    found.relative_error            ‖τ - τ̂‖/‖τ‖, joint by joint
    found.stretches                 the same, from one standstill of the tip to the next

Kostić et al. 2004, Section IV.C.5, Figs. 13 and 14: the torque that the controller commanded
against the torque of the model on the realised motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.arm import Arm, ArmTorque
from pipelines.dynamics.kinematics import serial_chain, tip_position
from pipelines.errors import Check, RrridError
from pipelines.estimation.filters import zero_phase
from pipelines.estimation.motion import Reconstructed
from pipelines.estimation.regression import condition
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
    "Largest",
    "Result",
    "Stretch",
    "TorqueError",
    "TorqueValidation",
    "control_cases",
    "gates_of",
    "pooled",
    "residual",
    "simulated_task",
    "torque_validation",
]

Mask = npt.NDArray[np.bool_]

PARTS = ("inertia", "coriolis", "gravity", "friction", "effects")


@dataclass(frozen=True)
class Stretch:
    """A stretch of a log and the model's error in it."""

    label: str
    start: float  # [s] since the log began
    end: float
    rms: tuple[float, ...]  # [N m] of the residual, per joint
    relative_error: tuple[float, ...]  # over the torque of the whole log: stretches compare


@dataclass(frozen=True)
class Largest:
    """Where the model of one joint's torque is worst, after the low-pass."""

    joint: int  # counted from 1
    label: str  # the stretch with the largest rms
    rms: float  # [N m] in it
    t: float  # [s] of its largest sample
    error: float  # [N m] there
    tip: tuple[float, ...]  # [m] there


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
    tip: Array  # [m] (points, 3) as executed
    low_passed: Array  # the residual as `Largest` judges it; NaN where it does not


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
    split: str  # "standstills" | "time": what divides the stretches
    stretches: tuple[Stretch, ...]
    largest: tuple[Largest, ...]
    course: Course | None


def residual(log: ExperimentLog, motion: Reconstructed, parts: ArmTorque) -> Array:
    """Return measured minus modelled torque (samples, joints) [N m] after a zero-phase low-pass."""
    return _low_passed(log, motion, log.tau - parts.total)[0]


def _low_passed(
    log: ExperimentLog, motion: Reconstructed, torque: Array
) -> tuple[Array, float | None]:
    """Return `torque` in the band of motion and dry friction, and that cut-off [Hz]."""
    torque = np.where(_known(log, motion)[:, None], torque, 0.0)
    how = condition(motion.motion, 1.0 / log.sample_time, None, None, np.zeros(log.n_joints))
    if how.low_pass is None or len(torque) <= how.low_pass.padding:
        return torque, None
    return zero_phase(torque, how.low_pass), how.cutoff_hz


def torque_validation(
    log: ExperimentLog, motion: Reconstructed, arm: Arm, parts: ArmTorque, draw: bool = True
) -> TorqueValidation:
    """Compare the model's torque, `parts`, with the measured one; say where it is worst."""
    known = _known(log, motion)
    error, measured = (log.tau - parts.total)[known], log.tau[known]
    smooth, cutoff = _low_passed(log, motion, log.tau - parts.total)
    whole = _rms(_low_passed(log, motion, log.tau)[0][known])
    split, labels, at = stretches_of(log)
    tip = tip_position(serial_chain(arm.robot), motion.motion.q)
    judged = _inner(log, known, cutoff)
    t, stretches = log.t - log.t[0], []
    for k, label in enumerate(labels):
        here = np.flatnonzero((at == k) & known)
        if here.size:
            rms = _rms(smooth[here])
            stretches.append(
                Stretch(
                    label,
                    float(t[here[0]]),
                    float(t[here[-1]]),
                    tuple(rms.tolist()),
                    tuple(_ratio(rms, whole).tolist()),
                )
            )
    worst = []
    for j in range(log.n_joints):
        size = np.where(judged, np.abs(smooth[:, j]), 0.0)
        counts = np.maximum(np.bincount(at[judged], minlength=len(labels)), 1)
        each = np.sqrt(np.bincount(at, size**2, minlength=len(labels)) / counts)
        place = int(np.argmax(each))
        k = int(np.argmax(np.where((at == place) & judged, size, -1.0)))
        worst.append(
            Largest(
                j + 1,
                labels[place],
                float(each[place]),
                float(t[k]),
                float(smooth[k, j]),
                tuple(tip[k].tolist()),
            )
        )
    course = None
    if draw:
        rows = slice(None, None, max(1, -(-log.n_samples // CONFIG.points)))
        shown, model = np.where(known[:, None], log.tau, np.nan)[rows], parts.total[rows]
        course = Course(
            t[rows],
            shown,
            model,
            residual=shown - model,
            tip=tip[rows],
            low_passed=np.where(judged[:, None], smooth, np.nan)[rows],
            **{name: getattr(parts, name)[rows] for name in PARTS},
        )
    return TorqueValidation(
        log.name,
        log.experiment,
        log.role,
        "unknown" if log.controller is None else log.controller.law,
        int(known.sum()),
        tuple(joint_unit("tau", joint.revolute) for joint in log.robot.joints),
        _rms(error),
        _rms(measured),
        _ratio(_rms(error), _rms(measured)),
        cutoff,
        _ratio(_rms(smooth[known]), whole),
        {name: _rms(getattr(parts, name)[known]) for name in PARTS},
        split,
        tuple(stretches),
        tuple(worst),
        course,
    )


def _known(log: ExperimentLog, motion: Reconstructed) -> Mask:
    """Return (samples,) where torque and motion are measured and fit to be compared."""
    good: Mask = np.zeros(log.n_samples, dtype=bool)
    good[motion.good.kept] = motion.good.fit
    return np.asarray(good & np.isfinite(log.tau).all(axis=1))


def _inner(log: ExperimentLog, known: Mask, cutoff: float | None) -> Mask:
    """Return `known` without a period of the low-pass at both ends of the log, where not empty.

    Nearer to an end a zero-phase filter and a smoother see one side only.
    """
    if cutoff is None or not known.any():
        return known
    t = log.t[known]
    inner = known & (log.t - t[0] >= 1.0 / cutoff) & (t[-1] - log.t >= 1.0 / cutoff)
    return inner if inner.any() else known


def _rms(x: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(x**2, axis=0))) if len(x) else np.full(x.shape[1], np.nan)


def _ratio(error: Array, whole: Array) -> Array:
    """Return ‖τ - τ̂‖/‖τ‖; infinite where a joint had no torque at all."""
    return np.divide(error, whole, out=np.full_like(error, np.inf), where=whole > 0.0)


def stretches_of(log: ExperimentLog) -> tuple[str, tuple[str, ...], npt.NDArray[np.intp]]:
    """Return what divides a log, the names of its stretches and that of each sample (samples,).

    By the standstills of the tip's reference; without a reference that stops, by time.
    """
    if "q_ref" in log and np.isfinite(log["q_ref"]).all():
        tip = tip_position(serial_chain(log.robot), log["q_ref"])
        speed = np.linalg.norm(np.diff(tip, axis=0, append=tip[-1:]), axis=1)
        still = np.concatenate([[True], speed <= CONFIG.still * speed.max()])
        begins = np.flatnonzero(np.diff(still.astype(np.int8)) == -1)
        long = np.diff(begins, append=len(tip)) * log.sample_time >= CONFIG.briefest
        begins = begins[long]
        if speed.max() > 0.0 and 1 < len(begins) <= CONFIG.most_stretches:
            at = np.searchsorted(begins, np.arange(len(tip)), side="right") - 1
            labels = tuple(f"stretch {k + 1}" for k in range(len(begins)))
            return "standstills", labels, np.maximum(at, 0)
    edges = np.linspace(0.0, log.n_samples, CONFIG.stretches + 1).astype(int)
    ends = log.t[np.minimum(edges, log.n_samples - 1)] - log.t[0]
    labels = tuple(f"{a:.1f} to {b:.1f} s" for a, b in pairwise(ends))
    return "time", labels, np.repeat(np.arange(CONFIG.stretches), np.diff(edges))


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
        words = ", ".join(
            f"joint {j + 1} {100 * error:.3g} %"
            for j, error in enumerate(torque.relative_error)
            if not error < limit
        )
        where = "see in which stretches; then " if torque.of == "writing" else ""
        checks.append(
            Check.of(
                "D19",
                "warn",
                "the model misses the torque of held-out logs by more than "
                f"{100 * limit:.3g} %: {words}",
                where=robot,
                gate=True,
                remedy=f"{where}let 'rrrid diagnose' say what is missed, or fit to richer logs",
            )
        )
    if gates.cases is False:
        checks.append(
            Check.of(
                "D20",
                "warn",
                "with the complete model ahead of the feedback the tip strays no less "
                "than without, on some axis",
                where=robot,
                gate=True,
                remedy="look at the split of the torque, and at its signs",
            )
        )
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
