"""Average the periods of a periodic signal; estimate the noise from what differs between them.

found = average_periods(x, rate, period)
found.mean, found.noise_variance          one period, and the noise of one sample of one period
passed_std(found.rest, amplitude)         the same noise after a filter
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
