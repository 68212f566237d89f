"""The first validation: the torque that the controller commanded beside the torque of the model on the realised motion.

    found = first_validation(log, motion, arm, parts)
    found.relative_error            ‖τ - τ̂‖/‖τ‖, joint by joint
    found.letters                   the same, letter by letter

Kostić et al. 2004, Section IV.C.5, Figs. 13 and 14. The motion is that of the smoother; as it would run while the arm moves, it is
the controller's observer whose motion is fed into the model, sample by sample (`online_validation`).
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.io.log import Array, ExperimentLog
from pipelines.io.schema import joint_unit
from pipelines.model.arm import Arm, ArmTorque
from pipelines.model.estimation.conditioning import condition
from pipelines.model.motion import Reconstructed, Reconstruction, reconstruct
from pipelines.model.online import OnlineModel
from pipelines.model.rigid.body import Motion
from pipelines.model.rigid.geometry import serial_chain
from pipelines.model.rigid.kinematics import tip_position
from pipelines.model.writing.marks import Marks, marks_of, reference_tip
from pipelines.model.writing.recognise import pen_down
from pipelines.signal.filters import zero_phase

__all__ = ["Course", "FirstValidation", "Largest", "LetterError", "Online", "first_validation", "online_validation", "residual"]

_POINTS = 3000  # of a figure
_OBSERVED = ("q_obs", "dq_obs", "ddq_obs")
_ONLINE = 1000  # samples that are evaluated one by one, where the others follow
_ROUNDED = 1e-9  # of the largest torque: rounding
_PARTS = ("inertia", "coriolis", "gravity", "friction", "effects")


@dataclass(frozen=True)
class LetterError:
    """One letter, or another stretch of a log."""

    label: str
    start: float  # [s] since the log began
    end: float
    rms: tuple[float, ...]  # [N m] of what the model leaves, per joint
    relative_error: tuple[float, ...]  # over the torque of the whole log: letters compare


@dataclass(frozen=True)
class Largest:
    """Where the model of one joint's torque is worst, after the low-pass."""

    joint: int  # counted from 1
    label: str  # the letter with the largest rms
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
    left: Array  # measured - model
    tip: Array  # [m] (points, 3) as executed
    drawn: Array | None = None  # (points,) 1 where it writes, 0 on the way between strokes; null: the reference is no text
    missed: Array | None = None  # left after the low-pass, as `Largest` judges it; NaN where it does not


@dataclass(frozen=True)
class Online:
    """The model sample by sample, on the motion that an observer sees while the arm moves."""

    observer: str  # whose motion: "the controller's" | "a Kalman observer after the fact"
    rms: Array  # [N m] (joints,)
    relative_error: Array  # (joints,)
    relative_error_low_pass: Array  # after the low-pass of the first validation: an observer's acceleration is noisy
    differs: float  # [N m] largest difference from the same model on arrays


@dataclass(frozen=True)
class FirstValidation:
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
    relative_error_low_pass: Array  # after the same low-pass over both: without what noise puts into a command
    parts_rms: dict[str, Array]  # [N m] of inertia, coriolis, gravity, friction, effects
    marks: str  # "letters" | "strokes" | "time"
    text: str  # what is written, read from the reference
    letters: tuple[LetterError, ...]
    largest: tuple[Largest, ...]
    online: Online | None
    course: Course | None


def residual(log: ExperimentLog, motion: Reconstructed, parts: ArmTorque) -> Array:
    """Measured minus modelled torque (samples, joints) [N m] after a zero-phase low-pass, zero where nothing is known."""
    return _low_passed(log, motion, log.tau - parts.total)[0]


def _low_passed(log: ExperimentLog, motion: Reconstructed, torque: Array) -> tuple[Array, float | None]:
    """`torque`, zero where nothing is known, in the band of motion and dry friction, and that cut-off [Hz]."""
    left = np.where(_known(log, motion)[:, None], torque, 0.0)
    how = condition(motion.motion, 1.0 / log.sample_time, None, None, np.zeros(log.n_joints))
    if how.low_pass is None or len(left) <= how.low_pass.padding:
        return left, None
    return zero_phase(left, how.low_pass), how.cutoff_hz


def first_validation(log: ExperimentLog, motion: Reconstructed, arm: Arm, parts: ArmTorque, online: Online | None = None,
                     draw: bool = True) -> FirstValidation:
    """How far the model's torque is from the measured one, and where; `parts` are the model's (`outcome.torques`)."""
    known = _known(log, motion)
    left, measured = (log.tau - parts.total)[known], log.tau[known]
    smooth, cutoff = _low_passed(log, motion, log.tau - parts.total)
    whole, _ = _low_passed(log, motion, log.tau)
    wanted = reference_tip(log)
    marks, tip = marks_of(log, wanted), _tip(motion, arm)
    size, judged = _rms(measured), _seen_from_both_sides(log, known, cutoff)
    return FirstValidation(
        log.name, log.experiment, log.role, "unknown" if log.controller is None else log.controller.law,
        int(known.sum()), tuple(joint_unit("tau", joint.revolute) for joint in log.robot.joints),
        _rms(left), size, _ratio(_rms(left), size), cutoff, _ratio(_rms(smooth[known]), _rms(whole[known])),
        {name: _rms(getattr(parts, name)[known]) for name in _PARTS}, marks.kind, marks.text,
        _letters(log, smooth, known, marks, _rms(whole[known])),
        _largest(log, smooth, judged, marks, tip), online,
        _course(log, parts, tip, known, wanted, np.where(judged[:, None], smooth, np.nan)) if draw else None)


def online_validation(log: ExperimentLog, motion: Reconstructed, arm: Arm) -> tuple[Online, float]:
    """The model as a controller evaluates it, sample by sample, and how long one sample took [s].

    The motion is what the log says the controller observed; without that, what a Kalman observer would have.
    """
    logged = all(name in log and np.isfinite(log[name]).all() for name in _OBSERVED)
    if logged:
        q, dq, ddq = (log[name] for name in _OBSERVED)
    else:
        seen = reconstruct(log, Reconstruction(method="observer")).motion
        q, dq, ddq = seen.q, seen.dq, seen.ddq
    q, dq, ddq = (np.asarray(x) for x in (q, dq, ddq))
    arrays = arm.torque(Motion(log.t, q, dq, ddq))
    torque, every, model = np.array(arrays), max(1, len(q) // _ONLINE), OnlineModel(arm)
    begun = time.perf_counter()
    _one_by_one(model, q, dq, ddq, torque, every)
    seconds = (time.perf_counter() - begun) / len(q[::every])
    if not np.allclose(torque, arrays, rtol=0.0, atol=_ROUNDED * np.abs(arrays).max(initial=1.0)):
        _one_by_one(model, q, dq, ddq, torque)  # an effect needs more than the moment
    known = _known(log, motion)
    left, smooth, whole = (log.tau - torque)[known], *(_low_passed(log, motion, x)[0][known] for x in (log.tau - torque, log.tau))
    return Online("the controller's" if logged else "a Kalman observer after the fact", _rms(left),
                  _ratio(_rms(left), _rms(log.tau[known])), _ratio(_rms(smooth), _rms(whole)),
                  float(np.abs(torque - arrays).max())), seconds


def _one_by_one(model: OnlineModel, q: Array, dq: Array, ddq: Array, torque: Array, every: int = 1) -> None:
    """Write the torque of every so-manieth sample, evaluated on its own, into `torque` (samples, joints) [N m]."""
    rows = zip(q[::every].tolist(), dq[::every].tolist(), ddq[::every].tolist(), strict=True)
    torque[::every] = [model.torque(*row) for row in rows]


def _known(log: ExperimentLog, motion: Reconstructed) -> npt.NDArray[np.bool_]:
    """(samples,) where torque and motion are measured and fit to be compared."""
    good: npt.NDArray[np.bool_] = np.zeros(log.n_samples, dtype=bool)
    good[motion.good.kept] = motion.good.fit
    return np.asarray(good & np.isfinite(log.tau).all(axis=1))


def _tip(motion: Reconstructed, arm: Arm) -> Array:
    return tip_position(serial_chain(arm.robot), motion.motion.q)


def _rms(x: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(x**2, axis=0))) if len(x) else np.full(x.shape[1], np.nan)


def _ratio(left: Array, whole: Array) -> Array:
    """‖τ - τ̂‖/‖τ‖; infinite where a joint had no torque at all."""
    return np.divide(left, whole, out=np.full_like(left, np.inf), where=whole > 0.0)


def _letters(log: ExperimentLog, left: Array, known: npt.NDArray[np.bool_], marks: Marks, whole: Array) -> tuple[LetterError, ...]:
    found = []
    for k, label in enumerate(marks.labels):
        here = np.flatnonzero((marks.at == k) & known)
        if here.size:
            rms = _rms(left[here])
            found.append(LetterError(label, float(log.t[here[0]] - log.t[0]), float(log.t[here[-1]] - log.t[0]),
                                     tuple(rms.tolist()), tuple(_ratio(rms, whole).tolist())))
    return tuple(found)


def _seen_from_both_sides(log: ExperimentLog, known: npt.NDArray[np.bool_], cutoff: float | None) -> npt.NDArray[np.bool_]:
    """Of the `known` samples those that stand a period of the low-pass or more from both ends of the log; all where none does.

    Nearer to an end a zero-phase filter and a smoother see one side only: what is left there is theirs, not the model's.
    """
    if cutoff is None or not known.any():
        return known
    t = log.t[known]
    inner = known & (log.t - t[0] >= 1.0 / cutoff) & (t[-1] - log.t >= 1.0 / cutoff)
    return inner if inner.any() else known


def _largest(log: ExperimentLog, left: Array, known: npt.NDArray[np.bool_], marks: Marks, tip: Array) -> tuple[Largest, ...]:
    found = []
    for j in range(log.n_joints):
        each = [float(np.sqrt(np.mean(left[here, j]**2))) if (here := (marks.at == k) & known).any() else 0.0
                for k in range(len(marks.labels))]
        worst = int(np.argmax(each))
        inside = np.where((marks.at == worst) & known, np.abs(left[:, j]), -1.0)
        k = int(np.argmax(inside))
        found.append(Largest(j + 1, marks.labels[worst], each[worst], float(log.t[k] - log.t[0]), float(left[k, j]),
                             tuple(tip[k].tolist())))
    return tuple(found)


def _course(log: ExperimentLog, parts: ArmTorque, tip: Array, known: npt.NDArray[np.bool_], wanted: Array | None,
            missed: Array) -> Course:
    """Every so-manieth sample: the torque of a task is smooth over milliseconds."""
    rows = slice(None, None, max(1, -(-log.n_samples // _POINTS)))
    shown = np.where(known[:, None], log.tau, np.nan)[rows]
    split = {name: getattr(parts, name)[rows] for name in _PARTS}
    model = parts.total[rows]
    down = None if wanted is None else pen_down(wanted)
    return Course((log.t - log.t[0])[rows], shown, model, left=shown - model, tip=tip[rows],
                  drawn=None if down is None else down[rows].astype(np.float64), missed=missed[rows], **split)
