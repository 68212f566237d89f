"""Average the periods of a periodic signal; estimate the noise from what differs between them.

found = average_periods(x, rate, period)
found.mean, found.noise_variance          one period, and the noise of one sample of one period
passed_std(found.rest, amplitude)         the same noise after a filter
found.repeats(amplitude)                  whether the periods differ by noise alone
found.begins_apart(amplitude, least)      whether the first one starts unlike the others
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.errors import InputRejected, UsageError
from pipelines.estimation.config import PeriodConfig
from pipelines.io.log import Array

_CONFIG = PeriodConfig()
_POINTS = 6  # numerics: samples that interpolate one between them


@dataclass(frozen=True)
class Repeats:
    """How far the periods in the mean are one signal, in what a filter passes. Each (channels)."""

    scatter: Array  # standard deviation of one period
    signal: Array  # of the mean period about its own mean
    white: Array  # what the sample-to-sample noise alone would leave of the scatter
    order: Array  # successive differences over scatter: 1 at random, less where periods drift
    order_std: Array  # of `order`, where they do differ at random


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

    def repeats(self, amplitude: Array) -> Repeats:
        """Return scatter, drift and noise after a filter, `amplitude` as in `passed_std`.

        Where periods drift, neighbours are more alike than others: half the mean square of
        successive differences is less than the variance (von Neumann 1941, Ann. Math. Stat. 12,
        p. 367). Two periods cannot show it: `order` is 1.
        """
        passed, m = _filtered(self.rest, amplitude), self.count
        power = (passed**2).sum(axis=(0, 1))
        steps = (np.diff(passed, axis=0) ** 2).sum(axis=(0, 1))
        order = np.where(power > 0.0, 0.5 * steps / np.where(power > 0.0, power, 1.0), 1.0)
        spectrum = (np.abs(np.fft.fft(passed, axis=1)) ** 2).sum(axis=0)
        # independent samples of a period
        free = spectrum.sum(axis=0) ** 2 / np.maximum((spectrum**2).sum(axis=0), 1e-300)
        spread = np.sqrt((m - 2) / (m**2 - 1) / np.maximum(free, 1.0))
        signal = _filtered((self.mean - self.mean.mean(axis=0))[None], amplitude)[0]
        # the second difference removes what moves slowly; white noise has six times the variance
        bends = (np.diff(self.rest, 2, axis=1) ** 2).mean(axis=(0, 1)) / 6.0
        white = np.sqrt(bends * m / (m - 1)) * _white_gain(amplitude, len(self.mean))
        rms = np.sqrt((signal**2).mean(axis=0))
        return Repeats(passed_std(self.rest, amplitude), rms, white, order, spread)

    def begins_apart(self, amplitude: Array, least: Array) -> bool:
        """Return whether the first period starts unlike the others, as an arm from rest does.

        Its first tenth is held against that of the others, or of two periods against its own rest.

        Args:
            amplitude: of a filter, as in `passed_std`: a start may show in what it passes alone.
            least: (channels) as in `average_periods`.
        """
        if self.count < 2 or self.used[0] != 0:
            return False
        begin = max(1, self.rest.shape[1] // 10)
        gain = _white_gain(amplitude, self.rest.shape[1])
        for rest, floor in ((self.rest, least), (_filtered(self.rest, amplitude), gain * least)):
            first = (rest[0, :begin] ** 2).mean(axis=0)
            usual = (rest[0, begin:] ** 2).mean(axis=0)
            if self.count > 2:
                others = rest[1:, :begin] + rest[0, :begin] / (self.count - 1)
                usual = (others**2).mean(axis=(0, 1))
            if (first > _CONFIG.start * np.maximum(usual, np.maximum(floor**2, 1e-200))).any():
                return True
        return False


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
        amplitude: of a filter, as in `passed_std`; a period may then be odd in what it passes
            alone, where the noise does not hide it.
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
    count = int((len(x) + _CONFIG.on_sample) / size)
    if count < 2:
        words = f"{len(x) / rate:.3g} s hold fewer than two periods of {period:g} s"
        remedy = "record more periods, or do without the noise floor between them"
        raise InputRejected("T07", words, remedy=remedy)
    folded, gain = _fold(flat, size, count)
    if np.isnan(folded).all(axis=0).any():
        words = "a part of the period was measured in no period at all"
        raise InputRejected("D02", words, remedy="record more periods")
    odd = _outliers(folded, amplitude, np.zeros(flat.shape[1]) if least is None else least.ravel())
    outliers = tuple(sorted({*odd, *without}))
    used = tuple(k for k in range(count) if k not in outliers)
    good = folded[list(used)]
    if np.isnan(good).all(axis=0).any():  # an odd period is the only one that was measured there
        outliers, used, good = (), tuple(range(count)), folded
    mean = _mean(good)
    rest = good - mean
    present = np.isfinite(rest)
    # each sample of the mean costs a degree of freedom where two periods or more were measured
    freedom = np.maximum((present.sum(axis=0) - 1).clip(0).sum(axis=0), 1)
    rest = np.where(present, rest, 0.0)
    variance = ((rest**2).sum(axis=(0, 1)) / freedom / gain).reshape(x.shape[1:])
    rest = rest.reshape(*rest.shape[:2], *x.shape[1:])
    return Periods(mean.reshape(-1, *x.shape[1:]), variance, used, outliers, rest)


def mean_of_periods(x: Array, rate: float, period: float, used: tuple[int, ...]) -> Array:
    """Return the mean (samples of a period, channels) of the periods `used` of `x`."""
    size = rate * period
    return _mean(_fold(x, size, int((len(x) + _CONFIG.on_sample) / size))[0][list(used)])


def passed_std(rest: Array, amplitude: Array) -> Array:
    """Return the standard deviation of one period (channels) of `rest` after a filter.

    Args:
        rest: (periods, samples, channels), of `Periods`.
        amplitude: (samples // 2 + 1,) what the filter passes of each harmonic, a real gain.
    """
    power = (_filtered(rest, amplitude) ** 2).mean(axis=(0, 1))
    return np.asarray(np.sqrt(power * len(rest) / (len(rest) - 1)))


def _filtered(rest: Array, amplitude: Array) -> Array:
    """Filter each period, its end next to its beginning."""
    bins = np.fft.rfft(rest, axis=1)
    gain = amplitude.reshape(-1, *(1,) * (bins.ndim - 2))
    return np.asarray(np.fft.irfft(bins * gain, rest.shape[1], axis=1))


def _fold(flat: Array, size: float, count: int) -> tuple[Array, float]:
    """Return (periods, phases, channels), and what interpolation does to white noise."""
    phases = round(size)
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
    """Return the mean over the periods that were measured."""
    present = np.isfinite(folded)
    total = np.where(present, folded, 0.0).sum(axis=0)
    return np.asarray(total / np.maximum(present.sum(axis=0), 1))


def _outliers(folded: Array, amplitude: Array | None, least: Array) -> tuple[int, ...]:
    """Return periods that deviate from the middle one far more, in any channel, than others."""
    if len(folded) < 3:
        return ()
    away = folded - np.nanmedian(folded, axis=0)
    signals = [(away, least)]
    if amplitude is not None:
        gain = _white_gain(amplitude, away.shape[1])
        signals.append((_filtered(np.nan_to_num(away), amplitude), least * gain))
    odd = np.zeros(len(folded), dtype=bool)
    for x, floor in signals:
        measured = np.maximum(np.isfinite(x).sum(axis=1), 1)
        spread = np.sqrt(np.nansum(x**2, axis=1) / measured)
        usual = np.maximum(np.median(spread, axis=0), floor)
        odd |= (spread > _CONFIG.outlier * usual + 1e-300).any(axis=1)
    return tuple(np.flatnonzero(odd).tolist())


def _white_gain(amplitude: Array, samples: int) -> float:
    """Return the deviation of white noise after the filter, over that before."""
    twice = np.full(len(amplitude), 2.0)  # negative harmonics too
    twice[0] = 1.0
    twice[-1] = 1.0 if samples % 2 == 0 else 2.0
    return float(np.sqrt(twice @ amplitude**2 / samples))
