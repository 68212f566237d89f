"""Average a periodic log to its mean period; measure what differs from one period to the next.

    floor, mean = mean_period(log, found, cutoff_hz)     scatter; a log of one period and its motion
    other = alike(mean, how)                             its motion by another method

The motion is averaged, not the equations: the regressor is not linear in it, and noise in its
columns biases the estimate (errors in variables). Torque is averaged alike, over the same samples.
The smoother being linear, the mean of the motions is the motion of the mean positions. It is not
tuned anew to their smaller noise, which would let more of it through (of five periods with 3e-5 rad
of noise the residual would be 3 to 16 % larger) to save a bias that is next to none (`Observers`).

An arm that starts from rest takes a while until its loop has settled and the motion is periodic:
its first period is left out where two others remain; of two, what had not settled of the first is,
so that the mean there is the second one alone.

The mean period lies between copies of itself, so that no filter feels an end; only the samples
between them make equations, and each of them counts for as many as were averaged. The noise of an
encoder falls with the number of periods only as far as it differs between them: where an arm
repeats its motion to less than a step, the steps repeat as well.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipelines.dynamics.body import Motion
from pipelines.errors import Check, InputRejected, Level
from pipelines.estimation.config import MeanPeriodConfig
from pipelines.estimation.filters import passed_both_ways
from pipelines.estimation.grids import Grid, grids, lay_on, measured
from pipelines.estimation.motion import (
    Mean,
    Reconstructed,
    Reconstruction,
    encoder_resolution,
    reconstruct,
)
from pipelines.estimation.periods import Periods, average_periods, mean_of_periods, passed_std
from pipelines.io.limits import shorter_than_period
from pipelines.io.log import Array, ExperimentLog, Signal, recording
from pipelines.quality.segments import Mask, Usable, quantum, usable

_CONFIG = MeanPeriodConfig()


@dataclass(frozen=True)
class NoiseFloor:
    """What differs from period to period: nothing that repeats is in it. Arrays per joint."""

    periods: int  # compared
    left_out: tuple[int, ...]  # periods that differ from the others, counted from 1
    position: Array  # [rad] standard deviation of one sample of one period
    torque: Array  # [N m]
    cutoff_hz: float | None  # of the low-pass of equations; None: none
    position_low_pass: Array  # [rad] what the low-pass leaves of it
    torque_low_pass: Array  # [N m]
    unlike: str  # why the periods are not to be averaged, in words; empty where they may be
    settling_time: float | None = None  # [s] left out at the start of the first; None: not known


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


def mean_period(
    log: ExperimentLog, found: Reconstructed, cutoff_hz: float | None
) -> tuple[NoiseFloor | None, tuple[ExperimentLog, Reconstructed] | None]:
    """Return the scatter between the periods of `log`, and its mean period as a log with a motion.

    The first is None where it has no period, or fewer than two are whole; the second where its
    periods cannot be averaged.

    Args:
        cutoff_hz: of the zero-phase low-pass over equations; None: none.
    """
    stamps = found.good.log.t
    if log.period is None or shorter_than_period(stamps, log.sample_time, 2.0 * log.period):
        return None, None
    folded, joints = _fold(log, found, cutoff_hz), log.n_joints
    if isinstance(folded, str):
        none = np.full(joints, np.nan)
        return NoiseFloor(0, (), none, none, cutoff_hz, none, none, folded, 0.0), None
    periods = folded.periods
    passed, centred = _passed(log, folded.step, cutoff_hz)
    least = _least(found, periods.mean)
    # where one period alone was left, it differs from nothing
    compared = np.sqrt((periods.count - 1) / max(folded.repeats - 1.0, 1e-300))
    sample = np.sqrt(periods.noise_variance)
    floor = NoiseFloor(
        periods.count,
        tuple(k + 1 for k in periods.outliers),
        sample[:joints],
        sample[joints:],
        cutoff_hz,
        compared * passed_std(periods.rest[..., :joints], passed),
        compared * passed_std(periods.rest[..., joints:], centred),
        folded.unsettled or _unlike(periods, passed, least, joints),
        folded.settling_time,
    )
    return floor, None if floor.unlike else _between_copies(log, found, folded)


def alike(mean: Reconstructed, how: Reconstruction) -> Reconstructed:
    """Return the same mean of the same periods, their motion reconstructed in another way."""
    if mean.mean is None:
        raise ValueError("not the mean of periods")
    whole = reconstruct(mean.mean.source, how, mean.mean.whole.good)
    return _averaged(replace(mean.mean, whole=whole), mean.good, mean.motion.t)


def doubts(floor: NoiseFloor | None, where: object, averaged: bool = True) -> list[Check]:
    """T10: periods that are not averaged, and what is left out of the mean, or kept without one.

    A start is motion like any other, and its equations hold: that it is left out of the mean is a
    remark. Somebody's hand on the arm is in no model: a warning.
    """
    if floor is None:
        return []
    mean = averaged and not floor.unlike
    found: list[tuple[Level, str, str]] = []
    if averaged and floor.unlike:
        remedy = "check the attribute period; look for a drift, a touch or a changed load; "
        remedy += "or say --no-average"
        found.append(("warn", f"its periods are not averaged: {floor.unlike}", remedy))
    fate = "left out of their mean" if mean else "kept, for its periods are not averaged"
    if floor.left_out:
        odd = ", ".join(map(str, floor.left_out))
        words = f"period {odd} differs from the {floor.periods} others and is {fate}"
        remedy = "the first one often starts from rest; or somebody touched the arm"
        if not mean:
            remedy = "a start from rest does no harm there; "
            remedy += "if somebody touched the arm, cut that period out"
        found.append(("ok" if mean and floor.left_out == (1,) else "warn", words, remedy))
    if floor.settling_time:
        words = f"the first {floor.settling_time:.2g} s of its periods, in which the motion "
        words += f"settled, are {fate}"
        remedy = "record a period more: the first then is left out"
        if not mean:
            remedy = "they do no harm to a fit of every sample"
        found.append(("ok", words, remedy))
    return [Check.of("T10", *one[:2], where=where, remedy=one[2]) for one in found]


def _fold(log: ExperimentLog, found: Reconstructed, cutoff_hz: float | None) -> _Folded | str:
    """Return the periods of `log`; in words why it cannot be folded."""
    seen, good, period = measured(log, found.good), found.good, log.period or np.inf
    most = _CONFIG.sparse * len(good.log.t)
    try:
        grid, *more = grids(good.log.t, seen.step, longest=max(10, int(most)))
    except InputRejected as problem:
        return problem.message
    if more or grid.size > most:
        return "its clock steps back or stands still for too long"
    if grid.wanders:
        return "its clock wanders"
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
        periods = average_periods(laid, 1.0 / grid.step, period, passed, least, without)
        return _Folded(periods, grid, kept, begin, period / len(periods.mean), periods.count)

    try:
        return _settled(average(first, rows), average, passed, least)
    except InputRejected as problem:
        return problem.message


def _settled(
    folded: _Folded, average: Callable[..., _Folded], passed: Array, least: Array
) -> _Folded:
    """Return `folded` without a start unlike the later periods: without the first period where two
    others remain, else without that start alone.

    Args:
        average: from the place where the first period begins, of these samples, without those.
    """
    out: tuple[int, ...] = ()
    late = folded.periods.settling(passed, least)
    if late and folded.periods.count > 2 and folded.periods.used[0] == 0:
        out = (0,)
        # one that alone measured a part of the period is kept for it
        folded = average(folded.first, folded.rows, out)
        late = folded.periods.settling(passed, least)
    if late == 0:
        return folded
    phases, grid, used = len(folded.periods.mean), folded.grid, folded.periods.used
    size = phases * folded.step / grid.step
    begin, places = folded.first + round(used[0] * size), int(np.ceil(late * size / phases))
    if late > _CONFIG.latest * phases:
        words = f"the first of its {folded.periods.count} periods has not settled by its middle"
        return replace(folded, unsettled=words)
    time = places * grid.step
    if grid.size - begin - places >= (used[-1] - used[0] + 1) * size:  # a run-in came before them
        return replace(average(begin + places, folded.rows), settling_time=time)
    rest = folded.rows & ~((grid.place >= begin) & (grid.place < begin + places))
    repeats = folded.periods.count - late / phases
    return replace(average(folded.first, rest, out), settling_time=time, repeats=repeats)


def _passed(log: ExperimentLog, step: float, cutoff_hz: float | None) -> tuple[Array, Array]:
    """Return what the low-pass leaves of each harmonic of positions, and of centred torques."""
    period = log.period or 0.0
    hz = np.arange(round(period / step) // 2 + 1) / period
    passed = np.ones(len(hz))
    if cutoff_hz is not None:
        passed = passed_both_ways(hz, cutoff_hz, 1.0 / step)
    # ½ (τ_k + τ_{k-1}) of a command
    return passed, passed if log.torque == "measured" else passed * np.cos(np.pi * hz * step)


def _least(found: Reconstructed, x: Array) -> Array:
    """Return (2 joints,) what counting in steps leaves of one sample."""
    torque = [quantum(column) or 0.0 for column in found.good.log.tau.T]
    steps = np.append(encoder_resolution(found.good), torque)
    return np.asarray(np.maximum(steps / np.sqrt(12.0), 1e-12 * np.nanstd(x, axis=0)))


def _unlike(periods: Periods, passed: Array, least: Array, joints: int) -> str:
    """Return which joint's periods differ by more than noise, and how; empty where none do."""
    alike = periods.repeats(passed)
    level = np.hypot(alike.signal, periods.mean.mean(axis=0))
    size = np.append(alike.signal[:joints], level[joints:])
    share = np.repeat([_CONFIG.alike_motion, _CONFIG.alike_torque], joints)
    floor = np.append(np.full(joints, _CONFIG.still), least[joints:])
    allowed = np.max([_CONFIG.noise * alike.white, share * size, floor], axis=0)
    worst = int(np.argmax(alike.scatter / np.maximum(allowed, 1e-300)))
    names = [f"the {what} of joint {j + 1}" for what in ("motion", "torque") for j in range(joints)]
    if alike.scatter[worst] > allowed[worst]:
        percent = 100 * alike.scatter[worst] / max(size[worst], 1e-300)
        return f"{names[worst]} differs from one period to the next by {percent:.2g} % of itself"
    drift = np.where(alike.scatter > least, 1.0 - alike.order, 0.0)
    beyond = drift - np.maximum(_CONFIG.drift, _CONFIG.sure * alike.order_std)
    worst = int(np.argmax(beyond))
    return f"{names[worst]} drifts over the periods" if beyond[worst] > 0.0 else ""


def _between_copies(
    log: ExperimentLog, found: Reconstructed, folded: _Folded
) -> tuple[ExperimentLog, Reconstructed]:
    """Return the mean period with copies of itself before and behind, and its motion."""
    phases, joints, period = len(folded.periods.mean), log.n_joints, log.period or np.inf
    copies = max(1, int(np.ceil(_CONFIG.margin / period)))
    start = float(found.good.log.t[0]) + folded.first * folded.grid.step
    place = np.arange((2 * copies + 1) * phases)
    t: Array = np.asarray(start + (place - copies * phases) * folded.step, dtype=np.float64)

    def fold(x: Array) -> Array:
        laid = lay_on(np.where(folded.rows[:, None], x, np.nan), folded.grid)[folded.first :]
        mean = mean_of_periods(laid, 1.0 / folded.grid.step, period, folded.periods.used)
        return mean[place % phases]

    average = folded.periods.mean[place % phases]
    values = {"t": t, "q": average[:, :joints], "tau": average[:, joints:]}
    signals = {
        name: Signal(values[name], log.signals[name].units, log.signals[name].long_name)
        for name in values
    }
    mean = replace(log, signals=signals, sample_time=folded.step, derived=None)
    saturated = fold(found.good.saturated.astype(np.float64)) > 0.0
    good = replace(usable(mean), saturated=saturated)
    varies = folded.periods.noise_variance[:joints]
    differing = varies / np.maximum(varies, encoder_resolution(found.good) ** 2 / 12.0)
    how = Mean(
        copies * phases,
        (copies + 1) * phases,
        folded.repeats,
        np.asarray(differing),
        recording(log),
        found,
        fold,
    )
    return mean, _averaged(how, good, t)


def _averaged(how: Mean, good: Usable, t: Array) -> Reconstructed:
    """Return the mean motion of the periods, and how well it is known."""
    whole, kept = how.whole, how.whole.good.kept
    parts = (whole.motion.q, whole.motion.dq, whole.motion.ddq)
    motion = Motion(t, *(how.fold(x[kept]) for x in parts))
    if whole.std is None:
        return Reconstructed(motion, None, None, good, False, how)
    shrink = np.sqrt(1.0 - how.differing * (1.0 - 1.0 / how.periods))
    q, dq, ddq = (np.median(std, axis=0) * shrink + np.zeros_like(motion.q) for std in whole.std)
    return Reconstructed(motion, (q, dq, ddq), whole.observers, good, False, how)
