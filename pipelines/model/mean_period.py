"""The mean period of a periodic log, and what differs from one period to the next.

    floor = noise_floor(log, found, cutoff_hz)       the scatter between periods; why they may not be averaged, if so
    mean = mean_period(log, found, cutoff_hz)        a log of one period and its motion, where they may
    other = alike(mean, how)                         its motion by another method

The motion is averaged, not the equations: the regressor is not linear in it, and noise in its columns biases the estimate
(errors in variables). Torque is averaged alike, over the same samples. The smoother being linear, the mean of the motions is
the motion of the mean positions. It is not tuned anew to their smaller noise, which would let more of it through (of five
periods with 3e-5 rad of noise the residual would be 3 to 16 % larger) to save a bias that is next to none (`Observers`).

An arm that starts from rest takes a while until its loop has settled and the motion is periodic: its first period is left
out where two others remain; of two, what had not settled of the first is, so that the mean there is the second one alone.

The mean period lies between copies of itself, so that no filter feels an end; only the samples between them make
equations, and each of them counts for as many as were averaged. The noise of an encoder falls with the number of periods
only as far as it differs between them: where an arm repeats its motion to less than a step, the steps repeat as well.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipelines.dynamics.body import Motion
from pipelines.errors import Check, InputRejected, Level
from pipelines.io.limits import shorter_than_period
from pipelines.io.log import Array, ExperimentLog, Signal, recording
from pipelines.model.measured import Measured, measured
from pipelines.model.motion import (
    Mean,
    Reconstructed,
    Reconstruction,
    encoder_resolution,
    reconstruct,
)
from pipelines.quality.segments import Mask, Usable, quantum, usable
from pipelines.signal.filters import passed_both_ways
from pipelines.signal.grid import Grid, grids, lay_on
from pipelines.signal.periods import Periods, Repeats, average_periods, mean_of_periods, passed_std

__all__ = ["NoiseFloor", "alike", "doubts", "mean_period", "noise_floor"]

_MARGIN = 2.0  # [s] of copies on either side, at least: one period or several
_SPARSE = 2.0  # times the samples: a clock that leaves more of its places empty is not folded
_ALIKE_MOTION = 0.01  # of the motion, from period to period: the curvature of the regressor leaves 1e-4 of it
_STILL = 1e-3  # [rad or m] that matters to no regressor
_ALIKE_TORQUE = 0.1  # of the torque
_NOISE = 3.0  # times what the noise from sample to sample explains: less is no difference
_DRIFT = 0.25  # of the scatter that goes one way from the first period to the last
_SURE = 5.0  # standard deviations of that share
_FEWEST = 2  # periods of a mean
_LATEST = 0.5  # of the first of two periods that it may take to settle: with more, too little is left to compare


@dataclass(frozen=True)
class NoiseFloor:
    """What differs from period to period: nothing that repeats, be it modelled or not, is in it. Arrays are per joint."""

    periods: int  # compared
    left_out: tuple[int, ...]  # periods that differ from the others, counted from 1
    position: Array  # [rad] standard deviation of one sample of one period
    torque: Array  # [N m]
    cutoff_hz: float | None  # of the low-pass of equations; None: none
    position_low_pass: Array  # [rad] what the low-pass leaves of it
    torque_low_pass: Array  # [N m]
    unlike: str  # why the periods are not to be averaged, in words; empty where they may be
    settling_time: float | None = None  # [s] left out at the start of the first period compared; None: not known


@dataclass(frozen=True, eq=False)
class _Folded:
    """The periods of a log, position and torque side by side (samples of a period, 2 joints)."""

    periods: Periods
    grid: Grid
    rows: Mask  # (kept samples,) that are averaged
    first: int  # place on the grid where the first period begins
    step: float  # [s] between samples of the mean
    repeats: float  # periods of which a sample of the mean is made, on average
    settling_time: float = 0.0  # [s] left out at the start
    unsettled: str = ""  # why that start cannot be left out, in words


def noise_floor(log: ExperimentLog, found: Reconstructed, cutoff_hz: float | None) -> NoiseFloor | None:
    """Scatter between the periods of a periodic log; None where it has none, or fewer than two are whole.

    Args:
        cutoff_hz: of the zero-phase low-pass over equations; None: none.
    """
    if not _two_periods(log, found):
        return None
    folded = _fold(log, found, cutoff_hz)
    return _unknown(log, cutoff_hz, folded) if isinstance(folded, str) else _floor(log, found, folded, cutoff_hz)


def mean_period(log: ExperimentLog, found: Reconstructed,
                cutoff_hz: float | None) -> tuple[NoiseFloor | None, tuple[ExperimentLog, Reconstructed] | None]:
    """The noise floor of `log`, and its mean period as a log with a motion; None where its periods cannot be averaged."""
    if not _two_periods(log, found):
        return None, None
    folded = _fold(log, found, cutoff_hz)
    if isinstance(folded, str):
        return _unknown(log, cutoff_hz, folded), None
    floor = _floor(log, found, folded, cutoff_hz)
    return floor, None if floor.unlike else _between_copies(log, found, folded)


def alike(mean: Reconstructed, how: Reconstruction) -> Reconstructed:
    """The same mean of the same periods, their motion reconstructed in another way."""
    if mean.mean is None:
        raise ValueError("not the mean of periods")
    whole = reconstruct(mean.mean.source, how, mean.mean.whole.good)
    return _averaged(replace(mean.mean, whole=whole), mean.good, mean.motion.t)


def doubts(floor: NoiseFloor | None, where: object, averaged: bool = True) -> list[Check]:
    """T10: periods that are not averaged though it was asked for, and what is left out of the mean, or kept without one.

    A start is motion like any other, and its equations hold: that it is left out of the mean is a remark. Somebody's hand on the
    arm is in no model: a warning.
    """
    if floor is None:
        return []
    found, mean = [], averaged and not floor.unlike
    if averaged and floor.unlike:
        found.append(Check.of("T10", "warn", f"its periods are not averaged: {floor.unlike}", where=where, remedy="check the "
                              "attribute period; look for a drift, a touch or a changed load; or say --no-average"))
    fate = "left out of their mean" if mean else "kept, for its periods are not averaged"
    if floor.left_out:
        left_out = ", ".join(map(str, floor.left_out))
        level: Level = "ok" if mean and floor.left_out == (1,) else "warn"
        found.append(Check.of("T10", level, f"period {left_out} differs from the {floor.periods} others and is {fate}",
                              where=where, remedy="the first one often starts from rest; or somebody touched the arm" if mean else
                              "a start from rest does no harm there; if somebody touched the arm, cut that period out"))
    if floor.settling_time:
        found.append(Check.of("T10", "ok", f"the first {floor.settling_time:.2g} s of its periods, in which the motion settled, "
                              f"are {fate}", where=where, remedy="record a period more: the first then is left out" if mean else
                              "they do no harm to a fit of every sample"))
    return found


def _two_periods(log: ExperimentLog, found: Reconstructed) -> bool:
    return log.period is not None and not shorter_than_period(found.good.log.t, log.sample_time, 2.0 * log.period)


def _fold(log: ExperimentLog, found: Reconstructed, cutoff_hz: float | None) -> _Folded | str:
    """The periods of `log`; in words why it cannot be folded."""
    seen, good, period = measured(log, found.good), found.good, log.period or np.inf
    grid = _one_grid(seen)
    if isinstance(grid, str):
        return grid
    rows = np.zeros(len(seen.y), dtype=bool)
    for run in good.runs:
        rows[run] = True
    x = np.hstack([seen.y, np.where(good.torque_spikes, np.nan, good.log.tau)])
    rows &= np.isfinite(x).all(axis=1)
    if not rows.any():
        return "no sample has both position and torque"
    first = int(grid.place[np.argmax(rows)])
    rows &= ~found.vague[good.kept].any(axis=1)
    x[~rows] = np.nan
    passed, least = _passed(log, grid.step, cutoff_hz)[0], _least(found, x)

    def average(begin: int, kept: Mask, without: tuple[int, ...] = ()) -> _Folded:
        laid = lay_on(np.where(kept[:, None], x, np.nan), grid)[begin:]
        periods = average_periods(laid, 1.0 / grid.step, period, amplitude=passed, least=least, without=without)
        return _Folded(periods, grid, kept, begin, period / len(periods.mean), periods.count)

    try:
        return _settled(average(first, rows), average, passed, least)
    except InputRejected as problem:
        return problem.message


def _settled(folded: _Folded, average: Callable[..., _Folded], passed: Array, least: Array) -> _Folded:
    """`folded` without a start unlike the later periods: without the first period where two others remain, else without it alone.

    Args:
        average: from the place where the first period begins, of these samples, without those periods.
    """
    out: tuple[int, ...] = ()
    late = folded.periods.settling(passed, least)
    if late and folded.periods.count > _FEWEST and folded.periods.used[0] == 0:
        out = (0,)
        folded = average(folded.first, folded.rows, out)  # one that alone measured a part of the period is kept for it
        late = folded.periods.settling(passed, least)
    if late == 0:
        return folded
    phases, grid, used = len(folded.periods.mean), folded.grid, folded.periods.used
    size = phases * folded.step / grid.step
    begin, places = folded.first + round(used[0] * size), int(np.ceil(late * size / phases))
    if late > _LATEST * phases:
        return replace(folded, unsettled=f"the first of its {folded.periods.count} periods has not settled by its middle")
    if grid.size - begin - places >= (used[-1] - used[0] + 1) * size:  # a run-in came before them
        return replace(average(begin + places, folded.rows), settling_time=places * grid.step)
    rest = folded.rows & ~((grid.place >= begin) & (grid.place < begin + places))
    return replace(average(folded.first, rest, out), settling_time=places * grid.step,
                   repeats=folded.periods.count - late / phases)


def _one_grid(seen: Measured) -> Grid | str:
    """All samples on one clock, gaps left empty; in words why they are not."""
    t = seen.good.log.t
    try:
        found = grids(t, seen.step, longest=max(10, int(_SPARSE * len(t))))
    except InputRejected as problem:
        return problem.message
    if len(found) > 1 or found[0].size > _SPARSE * len(t):
        return "its clock steps back or stands still for too long"
    return "its clock wanders" if found[0].lateness(seen.step).any() else found[0]


def _passed(log: ExperimentLog, step: float, cutoff_hz: float | None) -> tuple[Array, Array]:
    """What the low-pass leaves of each harmonic of a period, of positions and of torques, which are centred as well."""
    period = log.period or 0.0
    hz = np.arange(round(period / step) // 2 + 1) / period
    passed = np.ones(len(hz)) if cutoff_hz is None else passed_both_ways(hz, cutoff_hz, 1.0 / step)
    return passed, passed if log.torque == "measured" else passed * np.cos(np.pi * hz * step)  # ½ (τ_k + τ_{k-1})


def _least(found: Reconstructed, x: Array) -> Array:
    """(2 joints,) what counting in steps leaves of one sample."""
    torque = [quantum(column) or 0.0 for column in found.good.log.tau.T]
    return np.asarray(np.maximum(np.append(encoder_resolution(found.good), torque) / np.sqrt(12.0), 1e-12 * np.nanstd(x, axis=0)))


def _floor(log: ExperimentLog, motion: Reconstructed, folded: _Folded, cutoff_hz: float | None) -> NoiseFloor:
    found, joints = folded.periods, log.n_joints
    passed, centred = _passed(log, folded.step, cutoff_hz)
    sample = np.sqrt(found.noise_variance)
    unlike = folded.unsettled or _unlike(found.repeats(passed), found, _least(motion, found.mean), joints)
    # where one period alone was left, it differs from nothing
    compared = np.sqrt((found.count - 1) / max(folded.repeats - 1.0, 1e-300))
    return NoiseFloor(found.count, tuple(k + 1 for k in found.outliers), sample[:joints], sample[joints:],
                      cutoff_hz, compared * passed_std(found.rest[..., :joints], passed),
                      compared * passed_std(found.rest[..., joints:], centred), unlike, folded.settling_time)


def _unknown(log: ExperimentLog, cutoff_hz: float | None, why: str) -> NoiseFloor:
    none = np.full(log.n_joints, np.nan)
    return NoiseFloor(0, (), none, none, cutoff_hz, none, none, why, 0.0)


def _unlike(alike: Repeats, found: Periods, least: Array, joints: int) -> str:
    """Which joint's periods differ by more than noise, and how; empty where none do."""
    size = np.append(alike.signal[:joints], np.hypot(alike.signal, found.mean.mean(axis=0))[joints:])
    share = np.repeat([_ALIKE_MOTION, _ALIKE_TORQUE], joints)
    allowed = np.max([_NOISE * alike.white, share * size, np.append(np.full(joints, _STILL), least[joints:])], axis=0)
    worst = int(np.argmax(alike.scatter / np.maximum(allowed, 1e-300)))
    what, joint = ("motion", "torque")[worst // joints], worst % joints + 1
    if alike.scatter[worst] > allowed[worst]:
        return (f"the {what} of joint {joint} differs from one period to the next by "
                f"{100 * alike.scatter[worst] / max(size[worst], 1e-300):.2g} % of itself")
    drift = np.where(alike.scatter > least, 1.0 - alike.order, 0.0)
    beyond = drift - np.maximum(_DRIFT, _SURE * alike.order_std)
    worst = int(np.argmax(beyond))
    what, joint = ("motion", "torque")[worst // joints], worst % joints + 1
    return f"the {what} of joint {joint} drifts over the periods" if beyond[worst] > 0.0 else ""


def _between_copies(log: ExperimentLog, found: Reconstructed, folded: _Folded) -> tuple[ExperimentLog, Reconstructed]:
    """The mean period with copies of itself before and behind, and its motion."""
    phases, joints, period = len(folded.periods.mean), log.n_joints, log.period or np.inf
    copies = max(1, int(np.ceil(_MARGIN / period)))
    start = float(found.good.log.t[0]) + folded.first * folded.grid.step
    place = np.arange((2 * copies + 1) * phases)
    t: Array = np.asarray(start + (place - copies * phases) * folded.step, dtype=np.float64)

    def fold(x: Array) -> Array:
        laid = lay_on(np.where(folded.rows[:, None], x, np.nan), folded.grid)[folded.first:]
        return mean_of_periods(laid, 1.0 / folded.grid.step, period, folded.periods.used)[place % phases]

    average = folded.periods.mean[place % phases]
    values = {"t": t, "q": average[:, :joints], "tau": average[:, joints:]}
    signals = {name: Signal(values[name], log.signals[name].units, log.signals[name].long_name) for name in values}
    mean = replace(log, signals=signals, sample_time=folded.step, derived=None)
    good = replace(usable(mean), saturated=fold(found.good.saturated.astype(np.float64)) > 0.0)
    varies, counting = folded.periods.noise_variance[:joints], encoder_resolution(found.good) ** 2 / 12.0
    differing = np.asarray(varies / np.maximum(varies, counting))
    how = Mean(copies * phases, (copies + 1) * phases, folded.repeats, differing, recording(log), found, fold)
    return mean, _averaged(how, good, t)


def _averaged(how: Mean, good: Usable, t: Array) -> Reconstructed:
    """The mean motion of the periods, and how well it is known."""
    whole, kept = how.whole, how.whole.good.kept
    motion = Motion(t, *(how.fold(x[kept]) for x in (whole.motion.q, whole.motion.dq, whole.motion.ddq)))
    if whole.std is None:
        return Reconstructed(motion, None, None, good, False, how)
    shrink = np.sqrt(1.0 - how.differing * (1.0 - 1.0 / how.periods))
    q, dq, ddq = (np.median(std, axis=0) * shrink + np.zeros_like(motion.q) for std in whole.std)
    return Reconstructed(motion, (q, dq, ddq), whole.observers, good, False, how)
