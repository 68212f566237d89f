"""Average the periods of a periodic signal, and learn the noise from what differs between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected, UsageError

__all__ = ["Periods", "average_periods"]

Array = npt.NDArray[np.float64]

_ON_SAMPLE = 1e-3  # of a sample: nearer than this, a phase is taken to lie on a sample
_OUTLIER = 3.0  # times the usual deviation of a period from the middle one
_POINTS = 6  # samples that interpolate one between them


@dataclass(frozen=True)
class Periods:
    """The mean period and its noise floor. `channels` stands for every axis of the signal but the first."""

    mean: Array  # (samples of a period, channels)
    std_of_mean: Array  # of one sample of the mean, from the pooled noise (channels)
    noise_variance: Array  # of one sample of one period (channels)
    autocorrelation: Array  # of the noise, lags 0 .. (lags, channels)
    used: tuple[int, ...]  # periods in the mean, counted from 0
    outliers: tuple[int, ...]  # periods left out
    interpolated: bool  # the period is no whole number of samples

    @property
    def count(self) -> int:
        return len(self.used)


def average_periods(x: Array, rate: float, period: float, lags: int = 100) -> Periods:
    """Fold `x` (samples, channels...), NaN where missing, at `period` [s].

    A period that is no whole number of samples is interpolated by polynomials through six samples, good to 1e-6 of what
    moves slower than a tenth of the rate; what that takes off white noise is allowed for.
    A period that deviates three times as much as the others do is left out and named (three periods or more needed).
    """
    flat = np.asarray(x, dtype=np.float64).reshape(len(x), -1)
    size = rate * period
    if not size >= 2.0:
        raise UsageError("C02", f"a period of {period:g} s at {rate:g} samples a second",
                         remedy="give the period of the excitation")
    count = int((len(x) + _ON_SAMPLE) / size)
    if count < 2:
        raise InputRejected("T07", f"{len(x) / rate:.3g} s hold fewer than two periods of {period:g} s",
                            remedy="record more periods, or do without the noise floor between them")
    folded, gain, interpolated = _fold(flat, size, count)
    if np.isnan(folded).all(axis=0).any():
        raise InputRejected("D02", "a part of the period was measured in no period at all", remedy="record more periods")
    outliers = _outliers(folded)
    used = tuple(k for k in range(count) if k not in outliers)
    good = folded[list(used)]
    mean = _mean(good)
    rest = good - mean
    present = np.isfinite(rest)
    # every sample of the mean costs one degree of freedom where two periods or more were measured
    freedom = np.maximum((present.sum(axis=0) - 1).clip(0).sum(axis=0), 1)
    rest = np.where(present, rest, 0.0)
    variance = (rest**2).sum(axis=(0, 1)) / freedom / gain
    shape = x.shape[1:]
    return Periods(mean.reshape(-1, *shape), np.sqrt(variance / len(used)).reshape(shape), variance.reshape(shape),
                   _autocorrelation(rest, min(lags, mean.shape[0] - 1)).reshape(-1, *shape), used, outliers, interpolated)


def _fold(flat: Array, size: float, count: int) -> tuple[Array, float, bool]:
    """(periods, phases, channels); what interpolation does to white noise; whether it was needed."""
    phases = round(size)
    at = np.arange(count)[:, None] * size + np.arange(phases) * (size / phases)
    near = np.rint(at).astype(np.intp)
    if np.abs(at - near).max() <= _ON_SAMPLE and near.max() < len(flat):
        return flat[near], 1.0, False
    if len(flat) < _POINTS:
        raise InputRejected("T08", f"{len(flat)} samples are too few to fold", remedy="record more")
    base = np.clip(np.floor(at).astype(np.intp) - (_POINTS // 2 - 1), 0, len(flat) - _POINTS)
    offset = at - base
    weight = np.ones((_POINTS, count, phases))
    for i in range(_POINTS):
        for j in range(_POINTS):
            if i != j:
                weight[i] *= (offset - j) / (i - j)  # Lagrange
    folded = sum(weight[i][..., None] * flat[base + i] for i in range(_POINTS))
    return np.asarray(folded), float((weight**2).sum(axis=0).mean()), True


def _mean(folded: Array) -> Array:
    """Mean over the periods that were measured. A phase measured in none of them is refused before."""
    present = np.isfinite(folded)
    return np.asarray(np.where(present, folded, 0.0).sum(axis=0) / np.maximum(present.sum(axis=0), 1))


def _outliers(folded: Array) -> tuple[int, ...]:
    """Periods whose deviation from the middle one, in any channel, is far above that of the others."""
    if len(folded) < 3:
        return ()
    away = folded - np.nanmedian(folded, axis=0)
    spread = np.sqrt(np.nanmean(away**2, axis=1))  # (periods, channels)
    usual = np.median(spread, axis=0)
    return tuple(np.flatnonzero((spread > _OUTLIER * usual + 1e-300).any(axis=1)).tolist())


def _autocorrelation(rest: Array, lags: int) -> Array:
    """Σ r_k r_{k+lag} / Σ r_k² over all periods, lags 0 .. lags; each period is padded, so none runs into itself."""
    size = 1 << (2 * rest.shape[1] - 1).bit_length()
    power = np.abs(np.fft.rfft(rest, size, axis=1)) ** 2
    covariance = np.fft.irfft(power.sum(axis=0), size, axis=0)[:lags + 1]
    return np.asarray(covariance / np.where(covariance[0] > 0.0, covariance[0], 1.0))
