"""Average the periods of a periodic log; estimate the noise from what differs between them.

    found = average_periods(x, rate, period)             one period, and the noise of one sample
    floor, mean = mean_period(log, found, cutoff_hz)     scatter; a log of one period, its motion
    means, scatter = averaged(motions, cutoff_hz)        mean periods instead of their logs
    floors = residuals(scatter, fitted, judged, logs)    residual, noise floor and their ratio

The motion is averaged, not the equations: the regressor is not linear in it, and noise in its
columns biases the estimate (errors in variables). The mean period lies between copies of itself, so
that no filter feels an end; only the samples between them make equations, and each of them counts
for as many as were averaged. Noise is what differs from one period to the next: an error of the
model is the same in every period, noise falls with the root of their number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.dynamics.body import Motion
from pipelines.errors import Check, InputRejected, Level, UsageError
from pipelines.estimation.config import PeriodConfig
from pipelines.estimation.estimate import Fitted, Judged
from pipelines.estimation.filters import passed_both_ways
from pipelines.estimation.grids import Grid, grids, lay_on, measured
from pipelines.estimation.least_squares import errors, gather
from pipelines.estimation.motion import (
    Mean,
    Motions,
    Reconstructed,
    encoder_resolution,
    noise_response,
)
from pipelines.estimation.regression import LogEquations, cutoff_at
from pipelines.io.limits import shorter_than_period
from pipelines.io.log import Array, ExperimentLog, recording
from pipelines.quality.segments import quantum, usable

_CONFIG = PeriodConfig()
_POINTS = 6  # numerics: samples that interpolate one between them


@dataclass(frozen=True)
class Periods:
    """The mean period and its noise floor. `channels` are all axes of the signal but the first."""

    mean: Array  # (samples of a period, channels)
    noise_variance: Array  # of one sample of one period (channels)
    used: tuple[int, ...]  # periods in the mean, counted from 0
    outliers: tuple[int, ...]  # periods left out
    rest: Array  # (used, samples, channels) what each has beyond the mean; 0 where it is missing

    @property
    def count(self) -> int:
        return len(self.used)

    def white_std(self, amplitude: Array) -> Array:
        """Return the part (channels) of `passed_std` that the noise from sample to sample makes.

        The second difference removes what moves slowly; white noise has six times the variance.
        """
        bends = (np.diff(self.rest, 2, axis=1) ** 2).mean(axis=(0, 1)) / 6.0
        free = self.count / (self.count - 1)
        return np.asarray(np.sqrt(bends * free) * _white_gain(amplitude, len(self.mean)))

    def begins_apart(self, amplitude: Array, least: Array) -> bool:
        """Return whether the first period starts unlike the others, as an arm from rest does.

        Its first tenth is held against that of the others, or of two periods against its own rest.

        Args:
            amplitude: of a filter, as in `passed_std`.
            least: (channels) as in `average_periods`.
        """
        if self.count < 2 or self.used[0] != 0:
            return False
        rest, begin = filtered(self.rest, amplitude), max(1, self.rest.shape[1] // 10)
        first, usual = (rest[0, part] ** 2 for part in (slice(begin), slice(begin, None)))
        usual = usual.mean(axis=0)
        if self.count > 2:
            others = rest[1:, :begin] + rest[0, :begin] / (self.count - 1)
            usual = (others**2).mean(axis=(0, 1))
        floor = _white_gain(amplitude, rest.shape[1]) * least
        bound = np.maximum(usual, np.maximum(floor**2, 1e-200))
        return bool((first.mean(axis=0) > _CONFIG.start * bound).any())


def average_periods(
    x: Array,
    rate: float,
    period: float,
    amplitude: Array | None = None,
    least: Array | None = None,
    without: tuple[int, ...] = (),
) -> Periods:
    """Fold `x` (samples, channels...), NaN where missing, at `period` [s].

    A period that is no whole number of samples is interpolated by polynomials through six samples,
    good to 1e-6 of what moves slower than a tenth of the rate. A period that deviates three times
    as much as the others do is left out (three periods or more needed).

    Args:
        amplitude: of a filter, as in `passed_std`, after which periods are compared.
        least: (channels) deviation of a sample that is never odd: what counting leaves.
        without: periods, counted from 0, to leave out.

    Raises:
        UsageError: C02, a period of fewer than two samples.
        InputRejected: T07, fewer than two periods; D02, a part of the period that was never
            measured; T08, too few samples.
    """
    flat = np.asarray(x, dtype=np.float64).reshape(len(x), -1)
    size = rate * period
    if not size >= 2.0:
        words = f"a period of {period:g} s at {rate:g} samples a second"
        raise UsageError("C02", words, remedy="give the period of the excitation")
    if int((len(x) + _CONFIG.on_sample) / size) < 2:
        words = f"{len(x) / rate:.3g} s hold fewer than two periods of {period:g} s"
        remedy = "record more periods, or do without the noise floor between them"
        raise InputRejected("T07", words, remedy=remedy)
    folded, gain = _fold(flat, size)
    if np.isnan(folded).all(axis=0).any():
        words = "a part of the period was measured in no period at all"
        raise InputRejected("D02", words, remedy="record more periods")
    odd = _outliers(folded, amplitude, np.zeros(flat.shape[1]) if least is None else least.ravel())
    outliers = tuple(sorted({*odd, *without}))
    used = tuple(k for k in range(len(folded)) if k not in outliers)
    if np.isnan(folded[list(used)]).all(axis=0).any():  # an odd period alone was measured there
        outliers, used = (), tuple(range(len(folded)))
    good = folded[list(used)]
    mean = _mean(good)
    present = np.isfinite(good)
    # each sample of the mean costs a degree of freedom where two periods or more were measured
    freedom = np.maximum((present.sum(axis=0) - 1).clip(0).sum(axis=0), 1)
    rest = np.where(present, good - mean, 0.0)
    variance = ((rest**2).sum(axis=(0, 1)) / freedom / gain).reshape(x.shape[1:])
    rest = rest.reshape(*rest.shape[:2], *x.shape[1:])
    return Periods(mean.reshape(-1, *x.shape[1:]), variance, used, outliers, rest)


def mean_of_periods(x: Array, rate: float, period: float, used: tuple[int, ...]) -> Array:
    """Return the mean (samples of a period, channels) of the periods `used` of `x`."""
    return _mean(_fold(x, rate * period)[0][list(used)])


def passed_std(rest: Array, amplitude: Array) -> Array:
    """Return the standard deviation of one period (channels) of `rest` after a filter.

    Args:
        rest: (periods, samples, channels), of `Periods`.
        amplitude: (samples // 2 + 1,) what the filter passes of each harmonic, a real gain.
    """
    power = (filtered(rest, amplitude) ** 2).mean(axis=(0, 1))
    return np.asarray(np.sqrt(power * len(rest) / (len(rest) - 1)))


def filtered(x: Array, amplitude: Array) -> Array:
    """Filter each period of `x` (periods, samples, channels), its end next to its beginning."""
    bins = np.fft.rfft(x, axis=1)
    gain = amplitude.reshape(-1, *(1,) * (bins.ndim - 2))
    return np.asarray(np.fft.irfft(bins * gain, x.shape[1], axis=1))


def _fold(flat: Array, size: float) -> tuple[Array, float]:
    """Return (periods, phases, channels), and what interpolation does to white noise."""
    count, phases = int((len(flat) + _CONFIG.on_sample) / size), round(size)
    at = np.arange(count)[:, None] * size + np.arange(phases) * (size / phases)
    near = np.rint(at).astype(np.intp)
    if np.abs(at - near).max() <= _CONFIG.on_sample and near.max() < len(flat):
        return flat[near], 1.0
    if len(flat) < _POINTS:
        words = f"{len(flat)} samples are too few to fold"
        raise InputRejected("T08", words, remedy="record more")
    base = np.clip(np.floor(at).astype(np.intp) - (_POINTS // 2 - 1), 0, len(flat) - _POINTS)
    weight = np.ones((_POINTS, count, phases))  # Lagrange
    for i in range(_POINTS):
        for j in range(_POINTS):
            if i != j:
                weight[i] *= (at - base - j) / (i - j)
    folded = sum(weight[i][..., None] * flat[base + i] for i in range(_POINTS))
    return np.asarray(folded), float((weight**2).sum(axis=0).mean())


def _mean(folded: Array) -> Array:
    """Return the mean over the periods that were measured; 0 where none was."""
    present = np.isfinite(folded)
    total = np.where(present, folded, 0.0).sum(axis=0)
    return np.asarray(total / np.maximum(present.sum(axis=0), 1))


def _outliers(folded: Array, amplitude: Array | None, least: Array) -> list[int]:
    """Return periods that deviate from the middle one far more, in any channel, than others."""
    if len(folded) < 3:
        return []
    away = folded - np.nanmedian(folded, axis=0)
    if amplitude is not None:
        away = filtered(np.nan_to_num(away), amplitude)
        least = least * _white_gain(amplitude, away.shape[1])
    measured = np.maximum(np.isfinite(away).sum(axis=1), 1)
    spread = np.sqrt(np.nansum(away**2, axis=1) / measured)
    usual = np.maximum(np.median(spread, axis=0), least)
    odd = (spread > _CONFIG.outlier * usual + 1e-300).any(axis=1)
    return np.flatnonzero(odd).tolist()


def _white_gain(amplitude: Array, samples: int) -> float:
    """Return the deviation of white noise after the filter, over that before."""
    twice = np.full(len(amplitude), 2.0)  # negative harmonics too
    twice[0] = 1.0
    twice[-1] = 1.0 if samples % 2 == 0 else 2.0
    return float(np.sqrt(twice @ amplitude**2 / samples))


_SEED = 20040509  # numerics
_DRAWS = 3  # numerics: of the noise of positions: their mean power is known to a few per cent


@dataclass(frozen=True)
class NoiseFloor:
    """Noise as the difference between periods, without anything that repeats. Arrays per joint."""

    periods: int  # compared
    left_out: tuple[int, ...]  # periods that differ from the others, counted from 1
    position: Array  # [rad] standard deviation of one sample of one period
    torque: Array  # [N m]
    cutoff_hz: float | None  # of the low-pass of equations; None: none
    torque_low_pass: Array  # [N m] the same behind the low-pass
    unlike: str  # why the periods are not averaged, in words; empty where they are


MeanLog = tuple[ExperimentLog, Reconstructed]
Scatter = tuple[NoiseFloor, MeanLog | None]  # None: the periods are not alike


def mean_period(
    log: ExperimentLog, found: Reconstructed, cutoff_hz: float | None
) -> tuple[NoiseFloor | None, MeanLog | None]:
    """Return the scatter between the periods of `log`, and its mean period as a log with a motion.

    A log with fewer than two whole periods has no scatter, one whose periods cannot be averaged
    no mean.

    Args:
        cutoff_hz: of the zero-phase low-pass over equations; None: none.
    """
    if found.even is not None:
        log, found = found.even
    period, joints = log.period, log.n_joints
    if period is None or shorter_than_period(found.good.log.t, log.sample_time, 2.0 * period):
        return None, None
    torque = [quantum(column) or 0.0 for column in found.good.log.tau.T]
    least = np.append(encoder_resolution(found.good), torque) / np.sqrt(12.0)
    try:
        grid, x = _on_one_grid(log, found)
        least = np.maximum(least, 1e-12 * np.nanstd(x, axis=0))
        rate, phases = 1.0 / grid.step, round(period / grid.step)
        hz = np.arange(phases // 2 + 1) / period
        passed = np.ones(len(hz))
        if cutoff_hz is not None:
            passed = passed_both_ways(hz, cutoff_hz, rate)
        periods = average_periods(x, rate, period, passed, least)
        if periods.count > 2 and periods.begins_apart(passed, least):
            periods = average_periods(x, rate, period, passed, least, (0,))
    except InputRejected as problem:
        none = np.full(joints, np.nan)
        return NoiseFloor(0, (), none, none, cutoff_hz, none, problem.message), None
    # ½ (τ_k + τ_{k-1}) of a command
    centred = passed if log.torque == "measured" else passed * np.cos(np.pi * hz / rate)
    sample = np.sqrt(periods.noise_variance)
    floor = NoiseFloor(
        periods.count,
        tuple(k + 1 for k in periods.outliers),
        sample[:joints],
        sample[joints:],
        cutoff_hz,
        passed_std(periods.rest[..., joints:], centred),
        _unlike(periods, passed, least, joints),
    )
    return floor, None if floor.unlike else _between_copies(log, found, periods, grid)


def doubts(floor: NoiseFloor | None, where: object) -> list[Check]:
    """T10: periods that are not averaged, and periods outside the mean."""
    if floor is None or not (floor.unlike or floor.left_out):
        return []
    if floor.unlike:
        words = f"its periods are not averaged: {floor.unlike}"
        remedy = "check the attribute period; look for a drift, a touch or a changed load"
        return [Check.of("T10", "warn", words, where=where, remedy=remedy)]
    odd = ", ".join(map(str, floor.left_out))
    words = f"period {odd} differs from the {floor.periods} others and is left out of their mean"
    remedy = "the first one often starts from rest; or somebody touched the arm"
    level: Level = "ok" if floor.left_out == (1,) else "warn"
    return [Check.of("T10", level, words, where=where, remedy=remedy)]


def _on_one_grid(log: ExperimentLog, found: Reconstructed) -> tuple[Grid, Array]:
    """Return the grid of a log, and position and torque (places, 2 joints) from the first good
    sample on, NaN where they are not known.

    Raises:
        InputRejected: its clock has no single grid.
    """
    seen, good = measured(log, found.good), found.good
    most = _CONFIG.sparse * len(good.log.t)
    grid, *more = grids(good.log.t, seen.step, longest=max(10, int(most)))
    if more or grid.size > most:
        words = "its clock steps back or stands still"
        raise InputRejected("T05", words, remedy="record with an even clock")
    x = np.hstack([seen.y, np.where(good.torque_spikes, np.nan, good.log.tau)])
    x = lay_on(np.where(_known(found)[:, None], x, np.nan), grid)
    return grid, x[_first(found, grid) :]


def _known(found: Reconstructed) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return the kept samples (samples,) that are averaged."""
    good, inside = found.good, np.zeros(len(found.good.kept), dtype=bool)
    for run in good.runs:
        inside[run] = True
    bad = good.position_spikes | good.torque_spikes | ~np.isfinite(good.log.q + good.log.tau)
    return np.asarray(inside & ~(bad | found.vague[good.kept]).any(axis=1))


def _first(found: Reconstructed, grid: Grid) -> int:
    """Return the place where the first period begins: the first good sample of a stretch."""
    return int(grid.place[found.good.runs[0].start])


def _unlike(periods: Periods, passed: Array, least: Array, joints: int) -> str:
    """Return which joint's periods differ by more than noise, and how; empty where none do."""
    if periods.begins_apart(passed, least):
        return f"the first of its {periods.count} periods begins unlike the others, as from rest"
    varies = filtered((periods.mean - periods.mean.mean(axis=0))[None], passed)[0]
    size = np.sqrt((varies**2).mean(axis=0))
    size[joints:] = np.hypot(size, periods.mean.mean(axis=0))[joints:]
    share = np.repeat([_CONFIG.alike_motion, _CONFIG.alike_torque], joints)
    floor = np.append(np.full(joints, _CONFIG.still), least[joints:])
    allowed = np.max([_CONFIG.noise * periods.white_std(passed), share * size, floor], axis=0)
    scatter = passed_std(periods.rest, passed)
    worst = int(np.argmax(scatter / np.maximum(allowed, 1e-300)))
    if scatter[worst] <= allowed[worst]:
        return ""
    name = f"the {'motion' if worst < joints else 'torque'} of joint {worst % joints + 1}"
    percent = 100 * scatter[worst] / max(size[worst], 1e-300)
    return f"{name} differs from one period to the next by {percent:.2g} % of itself"


def _between_copies(
    log: ExperimentLog, found: Reconstructed, periods: Periods, grid: Grid
) -> MeanLog:
    """Return the mean period with copies of itself before and behind, and its motion."""
    joints, period = log.n_joints, log.period or np.inf
    phases, good, rows, first = len(periods.mean), found.good, _known(found), _first(found, grid)
    step, copies = period / phases, max(1, int(np.ceil(_CONFIG.margin / period)))
    place = np.arange((2 * copies + 1) * phases)
    start = float(good.log.t[0]) + first * grid.step
    t = np.asarray(start + (place - copies * phases) * step, dtype=np.float64)

    def fold(x: Array) -> Array:
        laid = lay_on(np.where(rows[:, None], x, np.nan), grid)[first:]
        return mean_of_periods(laid, 1.0 / grid.step, period, periods.used)[place % phases]

    average = periods.mean[place % phases]
    values = {"t": t, "q": average[:, :joints], "tau": average[:, joints:]}
    signals = {name: replace(log.signals[name], values=x) for name, x in values.items()}
    mean = replace(log, signals=signals, sample_time=step, derived=None)
    of_mean = replace(usable(mean), saturated=fold(good.saturated.astype(np.float64)) > 0.0)
    states = (found.motion.q, found.motion.dq, found.motion.ddq)
    motion = Motion(t, *(fold(x[good.kept]) for x in states))
    varies = periods.noise_variance[:joints]
    differing = varies / np.maximum(varies, encoder_resolution(good) ** 2 / 12.0)
    shrink = np.sqrt(1.0 - differing * (1.0 - 1.0 / periods.count))
    q, dq, ddq = (np.median(std, axis=0) * shrink + np.zeros_like(motion.q) for std in found.std)
    how = Mean(copies * phases, (copies + 1) * phases, periods.count, recording(log), found)
    return mean, Reconstructed(motion, (q, dq, ddq), found.observers, of_mean, False, how)


def averaged(
    motions: Motions, cutoff_hz: float | None
) -> tuple[Motions, tuple[Scatter | None, ...]]:
    """Return the logs and motions that equations come from, and the scatter of periodic logs."""
    means, scatter = [], list[Scatter | None]()
    for log, found in motions:
        floor, mean = mean_period(log, found, cutoff_at(cutoff_hz, 1.0 / log.sample_time))
        scatter.append(None if floor is None else (floor, mean))
        means.append((log, found) if mean is None else mean)
    return tuple(means), tuple(scatter)


@dataclass(frozen=True)
class PeriodicLog:
    """Noise of one periodic log, and the residual torque of the estimate. Arrays per joint."""

    log: str
    role: str
    periods: int  # compared
    averaged: bool
    why_not: str  # the periods are not averaged, in words
    left_out: tuple[int, ...]  # periods that differ from the others, counted from 1
    position: Array  # [rad] standard deviation of one sample of one period
    torque: Array  # [N m]
    torque_low_pass: Array  # [N m] the same behind the low-pass of equations
    motion: Array  # [N m] what the noise of positions does to the model's torque, in the mean
    noise_floor: Array  # [N m] noise in the mean period: torque's over √ their number, and motion's
    residual: Array  # [N m] rms that the estimate leaves in the mean period; else in every sample
    ratio: Array  # residual over noise floor: 1 where the model explains all that repeats


def residuals(
    scatter: Sequence[Scatter | None], fitted: Fitted, judged: Judged, logs: Sequence[ExperimentLog]
) -> tuple[PeriodicLog, ...]:
    """Return every periodic log's noise with the residual of its mean.

    Args:
        scatter: of `logs`, those fitted before those that judge.
    """
    sources = [log for log, _ in (*fitted.motions, *judged.motions)]
    found = []
    for both, one, log, source in zip(
        scatter, (*fitted.estimate.equations.logs, *judged.equations), logs, sources, strict=True
    ):
        if both is None:
            continue
        noise, root = both[0], np.sqrt(one.repeats)
        residual = errors(gather(one), fitted.estimate.beta).rms / root
        motion = _of_motion(one, noise, source, fitted)
        floor = np.hypot(noise.torque_low_pass / root, motion)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = residual / floor
        names = (log.name, log.role, noise.periods, both[1] is not None, noise.unlike)
        deviations = (noise.position, noise.torque, noise.torque_low_pass)
        found.append(
            PeriodicLog(*names, noise.left_out, *deviations, motion, floor, residual, ratio)
        )
    return tuple(found)


def _of_motion(one: LogEquations, noise: NoiseFloor, log: ExperimentLog, fitted: Fitted) -> Array:
    """Return the rms [N m] (joints,) by which equations change with new noise of the positions.

    Of a mean over M periods, what differs between them is left to 1/M; of what counting in steps
    leaves, the rest repeats.
    """
    found, mean, rng = one.found, one.found.mean, np.random.default_rng(_SEED)
    source, whole = (log, found) if mean is None else (mean.source, mean.whole)
    power, beta, own = np.zeros(log.n_joints), fitted.estimate.beta, found.motion
    for _ in range(_DRAWS):
        response, variance = noise_response(source, whole, fitted.recipe.how, len(own.t), rng)
        differs = np.minimum(noise.position**2, variance) / variance
        q, dq, ddq = response * np.sqrt(1.0 - differs * (1.0 - 1.0 / one.repeats))
        motion = replace(own, q=own.q + q, dq=own.dq + dq, ddq=own.ddq + ddq)
        shaken = replace(one, found=replace(found, motion=motion), chosen=one.rows)
        for block, moved in zip(one, shaken, strict=True):
            power += np.sum((moved.residual(beta) - block.residual(beta)) ** 2, axis=1)
    return np.asarray(np.sqrt(power / np.maximum(_DRAWS * one.repeats * one.counts, 1)))
