"""Average the periods of a periodic signal, and learn the noise from what differs between them.

    found = average_periods(x, rate, period)
    found.mean, found.noise_variance                 one period, and the noise of one sample of one period
    passed_std(found.rest, amplitude)                the same noise after a filter
    found.repeats(amplitude)                         whether the periods differ by noise alone
    found.settling(amplitude, least)                 how long the first of them takes to become like the others
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected, UsageError

__all__ = ["Periods", "Repeats", "average_periods", "mean_of_periods", "passed_std"]

Array = npt.NDArray[np.float64]

_ON_SAMPLE = 1e-3  # of a sample: nearer than this, a phase is taken to lie on a sample
_OUTLIER = 3.0  # times the usual deviation of a period from the middle one
_POINTS = 6  # samples that interpolate one between them
_WINDOWS = 100  # of a period, in which its start is compared with the rest
_SHORTEST = 8  # samples of a window
_LULL = 3  # windows in a row that are like the rest: what swings passes through zero within one of them; a filter smears as far
_QUIET = (0.6, 0.9)  # of a period: what is like the later ones, if anything is; a filter has the start beside the very end
_UNSETTLED = 2.0  # times the largest of the rest, and of the other periods there
_ENDED = 3.0  # times the power of the rest: less, and a start is over before that
_NEAR = 10  # windows to either side in which the other periods show how large the noise is at a phase
_FALLS = 6.0  # times less power at the end of a start than at its beginning: what dies away, and noise of one level does not
_LEAST = 1e-200  # of a power: where nothing differs


@dataclass(frozen=True)
class Repeats:
    """How far the periods in the mean are the same signal, in what a filter passes. Each (channels)."""

    scatter: Array  # standard deviation of one period
    signal: Array  # of the mean period about its own mean
    white: Array  # what the sample-to-sample noise alone would leave of the scatter
    order: Array  # successive differences over scatter: 1 where the periods differ at random, less where they drift
    order_std: Array  # of `order`, where they do differ at random


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
    rest: Array  # (used periods, samples of a period, channels) what each has beside the mean; 0 where it is missing

    @property
    def count(self) -> int:
        return len(self.used)

    def repeats(self, amplitude: Array) -> Repeats:
        """Scatter, drift and noise after a filter that passes `amplitude` of each harmonic; see `passed_std`.

        Where periods drift, neighbours are more alike than others: half the mean square of successive differences is less
        than the variance (von Neumann 1941, Ann. Math. Stat. 12, p. 367). Two periods cannot show it: `order` is 1.
        """
        passed = _filtered(self.rest, amplitude)
        power, steps = (passed**2).sum(axis=(0, 1)), (np.diff(passed, axis=0) ** 2).sum(axis=(0, 1))
        order = np.where(power > 0.0, 0.5 * steps / np.where(power > 0.0, power, 1.0), 1.0)
        spectrum = (np.abs(np.fft.fft(passed, axis=1)) ** 2).sum(axis=0)
        free = spectrum.sum(axis=0) ** 2 / np.maximum((spectrum**2).sum(axis=0), 1e-300)  # independent samples of a period
        spread = np.sqrt((self.count - 2) / (self.count**2 - 1) / np.maximum(free, 1.0))
        signal = _filtered((self.mean - self.mean.mean(axis=0))[None], amplitude)[0]
        # the second difference takes off what moves slowly; of white noise it leaves six times the variance
        rough = np.sqrt((np.diff(self.rest, 2, axis=1) ** 2).mean(axis=(0, 1)) / 6.0 * self.count / (self.count - 1))
        return Repeats(passed_std(self.rest, amplitude), np.sqrt((signal**2).mean(axis=0)),
                       rough * _white_gain(amplitude, len(self.mean)), order, spread)

    def settling(self, amplitude: Array, least: Array) -> int:
        """Samples at the start of the first period used that differ from the others by more than the rest of it does.

        0: none; all of them: it goes on dying away to the end.
        A mean over the whole period hides a start of a fiftieth of it. What noise allows is therefore read window by window: from
        the same period later on, in proportion to how rough the noise is at each phase, for it need not be the same all along a
        period, and from what the other periods scatter there, where there are two or more. And a start dies away.

        Args:
            amplitude: of a filter, as in `passed_std`; a start may stand out in what it passes alone.
            least: (channels) as in `average_periods`.
        """
        if self.count < 2:
            return 0
        return max(_settling(self.rest, self.rest, 1.0, least),
                   _settling(_filtered(self.rest, amplitude), self.rest, _white_gain(amplitude, self.rest.shape[1]), least))


def average_periods(x: Array, rate: float, period: float, lags: int = 100, amplitude: Array | None = None,
                    least: Array | None = None, without: tuple[int, ...] = ()) -> Periods:
    """Fold `x` (samples, channels...), NaN where missing, at `period` [s].

    A period that is no whole number of samples is interpolated by polynomials through six samples, good to 1e-6 of what
    moves slower than a tenth of the rate; what that takes off white noise is allowed for.
    A period that deviates three times as much as the others do is left out and named (three periods or more needed): the
    first, where the motion starts from rest, or one in which somebody touched the arm.

    Args:
        amplitude: of a filter (samples of a period // 2 + 1,), as in `passed_std`; a period may then stand out in what it
            passes alone, where the noise does not hide it.
        least: (channels) deviation of a sample that is never odd: what counting leaves. Periods that are equal but for one
            step of an encoder have no odd one among them.
        without: periods, counted from 0, to leave out whatever they are like.

    Raises:
        UsageError: C02, a period of fewer than two samples.
        InputRejected: T07, fewer than two periods; D02, a part of the period that was never measured; T08, too few samples.
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
    odd = _outliers(folded, amplitude, np.zeros(flat.shape[1]) if least is None else least.ravel())
    outliers = tuple(sorted({*odd, *without}))
    used = tuple(k for k in range(count) if k not in outliers)
    good = folded[list(used)]
    if np.isnan(good).all(axis=0).any():  # an odd period is the only one that was measured there
        outliers, used, good = (), tuple(range(count)), folded
    mean = _mean(good)
    rest = good - mean
    present = np.isfinite(rest)
    # every sample of the mean costs one degree of freedom where two periods or more were measured
    freedom = np.maximum((present.sum(axis=0) - 1).clip(0).sum(axis=0), 1)
    rest = np.where(present, rest, 0.0)
    variance = (rest**2).sum(axis=(0, 1)) / freedom / gain
    shape = x.shape[1:]
    return Periods(mean.reshape(-1, *shape), np.sqrt(variance / len(used)).reshape(shape), variance.reshape(shape),
                   _autocorrelation(rest, min(lags, mean.shape[0] - 1)).reshape(-1, *shape), used, outliers, interpolated,
                   rest.reshape(*rest.shape[:2], *shape))


def mean_of_periods(x: Array, rate: float, period: float, used: tuple[int, ...]) -> Array:
    """The mean (samples of a period, channels) of the periods `used` of `x` (samples, channels), NaN where missing."""
    size = rate * period
    folded, _, _ = _fold(x, size, int((len(x) + _ON_SAMPLE) / size))
    return _mean(folded[list(used)])


def passed_std(rest: Array, amplitude: Array) -> Array:
    """Standard deviation of one period (channels) of `rest`, which has been averaged out of its periods, after a filter.

    Args:
        rest: (periods, samples, channels), of `Periods`.
        amplitude: (samples // 2 + 1,) what the filter passes of each harmonic of the period, a real gain.
    """
    passed = _filtered(rest, amplitude)
    return np.asarray(np.sqrt((passed**2).mean(axis=(0, 1)) * len(rest) / (len(rest) - 1)))


def _filtered(rest: Array, amplitude: Array) -> Array:
    """Each period through the filter, its end beside its beginning."""
    bins = np.fft.rfft(rest, axis=1)
    return np.asarray(np.fft.irfft(bins * _beside(amplitude, bins[0]), rest.shape[1], axis=1))


def _beside(amplitude: Array, bins: npt.NDArray[np.complex128]) -> Array:
    return amplitude.reshape(-1, *(1,) * (bins.ndim - 1))


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


def _outliers(folded: Array, amplitude: Array | None, least: Array) -> tuple[int, ...]:
    """Periods whose deviation from the middle one, in any channel, is far above that of the others."""
    if len(folded) < 3:
        return ()
    away = folded - np.nanmedian(folded, axis=0)
    odd = _apart(away, least)
    if amplitude is not None:
        odd |= _apart(_filtered(np.nan_to_num(away), amplitude), least * _white_gain(amplitude, away.shape[1]))
    return tuple(np.flatnonzero(odd).tolist())


def _apart(away: Array, least: Array) -> npt.NDArray[np.bool_]:
    """(periods,) which of `away` (periods, samples, channels) are far larger than the rest."""
    spread = np.sqrt(np.nansum(away**2, axis=1) / np.maximum(np.isfinite(away).sum(axis=1), 1))
    usual = np.maximum(np.median(spread, axis=0), least)
    return np.asarray((spread > _OUTLIER * usual + 1e-300).any(axis=1))


def _settling(rest: Array, raw: Array, gain: float, least: Array) -> int:
    """Samples at the start of the first of `rest` (periods, samples, channels), less their mean, that stand out in any channel.

    Args:
        raw: the same, unfiltered.
        gain: of the filter, for white noise.
    """
    periods, samples = rest.shape[:2]
    window = max(_SHORTEST, samples // _WINDOWS)
    count = samples // window
    low, high = (int(share * count) for share in _QUIET)
    if high - low < _LULL:
        return 0

    def powers(x: Array) -> Array:
        return np.asarray((x[:, :count * window].reshape(len(x), count, window, -1) ** 2).mean(axis=2))

    # less the mean of the others, the first has M / (M-1) of the variance of a sample; they about that mean (M-2) / (M-1)
    power = powers(rest[:1])[0] * (periods / (periods - 1))
    near = np.arange(count)[:, None]
    # noise that is larger at a phase is rougher there, and what dies away is smooth
    bends = np.pad(np.diff(raw, 2, axis=1), ((0, 0), (0, 2), (0, 0)))
    bends[:, :-2][(raw[:, :-2] == 0.0) | (raw[:, 1:-1] == 0.0) | (raw[:, 2:] == 0.0)] = 0.0  # beside what was not measured
    rough = powers(bends).sum(axis=0) * gain**2 / (6.0 * (periods - 1))
    usual = rough[(near + np.arange(-_LULL + 1, _LULL)) % count].mean(axis=1)
    if periods > 2:
        others = powers(rest[1:] + rest[0] / (periods - 1)).sum(axis=0) / (periods - 2)
        usual = np.maximum(usual, others[(near + np.arange(-_NEAR, _NEAR + 1)) % count].max(axis=1))
    times = power / np.maximum(usual, np.maximum((gain * least)**2, _LEAST))
    odd = times > _UNSETTLED**2 * np.maximum(times[low:high].max(axis=0), 1.0)
    longest = max(_start(odd[:, c], times[:, c], (low, high), power[:, c]) for c in range(odd.shape[1]))
    return int(samples if longest == count else longest * window)


def _start(odd: npt.NDArray[np.bool_], times: Array, quiet: tuple[int, int], power: Array) -> int:
    """Windows until one channel has settled; all of them where it never does, none where it should fall and does not."""
    (low, high), last = quiet, -1  # window of those that differ from the start on
    for k in np.flatnonzero(odd).tolist():
        if k - last > _LULL:
            break
        last = k
    if last < 0:
        return 0
    # what is slow has not died away in the rest, and makes that look worse than noise is
    between = times[last + 1:low].mean() if last + 1 < low else np.inf
    ended = between <= _ENDED * max(float(times[low:high].mean()), 1.0)
    if not _dies_away(power[:last + 2 if ended else low], power[high:-_LULL]):
        return 0
    return last + 1 if ended else len(times)


def _dies_away(start: Array, before: Array) -> bool:
    """Whether the power of `start`, window by window, is largest where it begins, above what is `before` it, and falls to its end.

    Noise that follows the motion is as large at the end of one period as at the beginning of the next.
    """
    peak = int(start.argmax())  # what precedes it may not have been measured
    falling = start[peak:]
    third = max(1, len(falling) // 3)
    return bool(peak < _LULL and start[peak] > _FALLS * before.max(initial=0.0)
                and falling[:third].mean() > _FALLS * falling[-third:].mean())


def _white_gain(amplitude: Array, samples: int) -> float:
    """Standard deviation of white noise after the filter, over that before: all harmonics, negative ones too."""
    twice = np.full(len(amplitude), 2.0)
    twice[0] = 1.0
    twice[-1] = 1.0 if samples % 2 == 0 else 2.0
    return float(np.sqrt(twice @ amplitude**2 / samples))


def _autocorrelation(rest: Array, lags: int) -> Array:
    """Σ r_k r_{k+lag} / Σ r_k² over all periods, lags 0 .. lags; each period is padded, so none runs into itself."""
    size = 1 << (2 * rest.shape[1] - 1).bit_length()
    power = np.abs(np.fft.rfft(rest, size, axis=1)) ** 2
    covariance = np.fft.irfft(power.sum(axis=0), size, axis=0)[:lags + 1]
    return np.asarray(covariance / np.where(covariance[0] > 0.0, covariance[0], 1.0))
