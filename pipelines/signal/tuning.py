"""Tune an observer: from a rule, from an asked bandwidth, or from the data themselves.

The paper's rule (largest jerk of the reference) hardly filters and is only a first guess (Kostić et al. 2004, sec. IV-C.2). What
the data say is the likelihood of the innovations (prediction error decomposition, Schweppe 1965); whether they agree with
the observer is seen in the whiteness of the innovations. A smoother needs another jerk level: on a smooth excitation the
likelihood looks one sample ahead and asks for 20 to 50 times more jerk than is best for a filter that sees both sides, which
cross-validation finds (Craven & Wahba 1979).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected, UsageError
from pipelines.signal import blocks
from pipelines.signal.chain import ORDERS, Stationary, stationary
from pipelines.signal.observer import BLOCK, Observer, observe

__all__ = ["Tuned", "Whiteness", "innovations", "observer_bandwidth", "paper_rule", "sigma_for_bandwidth",
           "smoother_bandwidth", "tune_jerk", "tune_smoother", "whiteness"]

Array = npt.NDArray[np.float64]

_WINDOW = 32768  # samples a channel is tuned on: the liveliest stretch of this length
_STILL = 64  # samples: a stretch this long whose values span two steps of the encoder or less is standing still
_NOISIER = 2.0  # times Δθ²/12: measurement noise above this is believed rather than the resolution
_NOISE_CAP = 1e8  # times Δθ²/12: no more than this is ever believed


@dataclass(frozen=True)
class Whiteness:
    """How far innovations are from white noise: about standard normal for white ones, large for coloured ones."""

    statistic: Array  # (Q - lags) / √(2 lags) (channels,)
    autocorrelation: Array  # lags 1 .. lags (lags, channels)


@dataclass(frozen=True)
class Tuned:
    """Jerk level and measurement noise that the data of each channel ask for."""

    jerk_std: Array  # σ (channels,)
    noise_variance: Array  # R (channels,)
    noise_from_data: npt.NDArray[np.bool_]  # R contradicts the resolution and was taken from the data
    moved: npt.NDArray[np.bool_]  # False: the channel stood still, its jerk level cannot be told and is the slowest one tried
    whiteness: Array  # statistic of the innovations at the optimum


def paper_rule(reference: Array, sample_time: float, order: int = 3) -> Array:
    """σ = largest highest derivative of the reference (samples, channels). Kostić et al. 2004, sec. IV-C.2, after its [34]."""
    if len(reference) <= order:
        raise InputRejected("T08", f"{len(reference)} samples of a reference have no derivative of order {order}",
                            remedy="give a longer reference")
    return np.asarray(np.nanmax(np.abs(np.diff(reference, n=order, axis=0)), axis=0) / sample_time**order)


def observer_bandwidth(observer: Observer) -> Array:
    """Highest frequency [Hz] at which the position passes with 1/√2; half the rate where nothing is held back. (channels,)"""
    f = observer.filter
    angle = np.pi * np.geomspace(1e-7, 1.0, 1500)
    passed = _position_gain(f, angle[:, None]) >= np.sqrt(0.5)
    last = len(angle) - 1 - np.argmax(passed[::-1], axis=0)
    low, high = np.log(angle[last]), np.log(angle[np.minimum(last + 1, len(angle) - 1)])
    for _ in range(45):
        middle = 0.5 * (low + high)
        through = _position_gain(f, np.exp(middle)) >= np.sqrt(0.5)
        low, high = np.where(through, middle, low), np.where(through, high, middle)
    return np.asarray(np.exp(low) / (2.0 * np.pi * observer.sample_time))


def smoother_bandwidth(observer: Observer, twice: bool = False) -> Array:
    """The same of the smoother that goes with it: G = Λ² N / (w^n + Λ² N) = 1/√2, see `sigma_for_bandwidth`. (channels,)

    Args:
        twice: where it goes over what it left once more: 1 - (1 - G)² = 1/√2.
    """
    f = observer.filter
    left = np.sqrt(1.0 - np.sqrt(0.5)) if twice else 1.0 - np.sqrt(0.5)  # 1 - G
    low, high = np.full(len(f.tracking_index), np.log(1e-12)), np.full(len(f.tracking_index), np.log(4.0))
    for _ in range(60):
        w = np.exp(0.5 * (low + high))
        through = w**f.order <= left / (1.0 - left) * f.tracking_index**2 * f.numerator(w)
        low, high = np.where(through, np.log(w), low), np.where(through, high, np.log(w))
    return np.asarray(np.arcsin(np.minimum(np.exp(low / 2.0) / 2.0, 1.0)) / (np.pi * observer.sample_time))


def sigma_for_bandwidth(bandwidth_hz: Array | float, sample_time: float, noise_variance: Array | float, order: int = 3,
                        smoother: bool = False) -> Array:
    """The jerk level whose observer (or smoother) passes the position with -3 dB at `bandwidth_hz`.

    The smoother passes Λ² N / (w^n + Λ² N) with N = |numerator|², w = 4 sin²(π f T): solved for Λ in closed form.
    """
    hz, variance = np.broadcast_arrays(np.atleast_1d(np.asarray(bandwidth_hz, dtype=np.float64)), noise_variance)
    if not np.all((hz > 0.0) & (hz < 0.5 / sample_time)):
        raise UsageError("C02", "the bandwidth of an observer",
                         remedy=f"choose one between 0 and half the rate, {0.5 / sample_time:g} Hz")
    angle = 2.0 * np.pi * hz * sample_time
    if smoother:
        w = 4.0 * np.sin(angle / 2.0) ** 2
        index = np.sqrt(w**order / ((np.sqrt(2.0) - 1.0) * stationary(order, np.ones(1)).numerator(w)))
        return np.asarray(index * np.sqrt(variance) / sample_time**order)
    low, high = np.full(hz.shape, np.log(1e-14)), np.full(hz.shape, np.log(1e6))
    if not np.all(_position_gain(stationary(order, np.exp(high)), angle) >= np.sqrt(0.5)):
        raise UsageError("C02", f"no observer of order {order} is that fast", remedy="choose a smaller bandwidth")
    for _ in range(40):
        middle = 0.5 * (low + high)
        fast = _position_gain(stationary(order, np.exp(middle)), angle) >= np.sqrt(0.5)
        low, high = np.where(fast, low, middle), np.where(fast, middle, high)
    return np.asarray(np.exp(high) * np.sqrt(variance) / sample_time**order)


def _position_gain(f: Stationary, angle: Array) -> Array:
    """|1 - (1 - k_1) Π (z - 1) / (z - p_i)| at z = e^{j angle}; `angle` broadcasts against the channels."""
    ahead = 2j * np.sin(angle / 2.0) * np.exp(0.5j * angle)  # z - 1, exact near zero
    ratio = np.prod(ahead[..., None] / (ahead[..., None] + 1.0 - f.poles), axis=-1)
    return np.asarray(np.abs(1.0 - f.remainder * ratio))


def innovations(y: Array, observer: Observer) -> Array:
    """What each measurement adds to its prediction, over its expected deviation; NaN at missing samples and while settling."""
    f, track = observer.filter, observe(y, observer)
    ahead = np.full(y.shape, np.nan)
    ahead[1:] = np.einsum("ni,ikn->kn", f.transition[:, 0] / observer.rate, track.states[:, :-1])
    surprise = (y - ahead) / np.sqrt(observer.noise_variance / f.remainder)
    wait = observer.settled // 4 + observer.order  # the covariance settles twice as fast as the states, and 1e-8 will do
    missing = ~np.isfinite(y)
    since = np.arange(len(y))[:, None] - np.maximum.accumulate(np.where(missing, np.arange(len(y))[:, None], -1), axis=0)
    surprise[since <= min(wait, len(y) // 2)] = np.nan
    return np.asarray(surprise)


def whiteness(innovation: Array, lags: int = 30) -> Whiteness:
    """Portmanteau statistic Q = N (N + 2) Σ r_k² / (N - k) of (samples, channels). Ljung & Box 1978, Biometrika 65, p. 297.

    Q is χ² with `lags` degrees of freedom for white noise, here made standard. Missing samples (NaN) drop out of the sums.
    """
    present = np.isfinite(innovation)
    mean = np.where(present, innovation, 0.0).sum(axis=0) / np.maximum(present.sum(axis=0), 1)
    rest = np.where(present, innovation - mean, 0.0)
    lags = min(lags, len(rest) - 1)
    pairs = np.stack([np.count_nonzero(present[k:] & present[:-k], axis=0) for k in range(1, lags + 1)])
    product = np.stack([np.einsum("kn,kn->n", rest[k:], rest[:-k]) for k in range(1, lags + 1)])
    power = np.maximum((rest**2).sum(axis=0), 1e-300)
    count = present.sum(axis=0)
    autocorrelation = product / power
    q = count * (count + 2.0) * (autocorrelation**2 / np.maximum(pairs, 1)).sum(axis=0)
    return Whiteness((q - lags) / np.sqrt(2.0 * lags), autocorrelation)


def tune_jerk(y: Array, sample_time: float, resolution: Array | float, order: int = 3) -> Tuned:
    """σ of every channel of `y` (samples, channels), NaN where missing, by the likelihood of its innovations.

    R is Δθ²/12 (Kostić et al. 2004, sec. IV-C.2) unless the data show more than twice as much: an encoder that counts more coarsely
    than it is said to, or a noisy one. It is never set below Δθ²/12: the quantisation of slow motion is no white noise and
    would feign less. A channel that stands still for a while is judged by the rest. Spikes must have been marked missing.
    """
    if order not in ORDERS:
        raise UsageError("C02", f"an observer of order {order} is not known", remedy="choose order 2, 3 or 4")
    step = np.broadcast_to(np.asarray(resolution, dtype=np.float64), y.shape[1:])
    if not np.all(step > 0.0):
        raise UsageError("C02", "the resolution of an encoder must be a positive number", remedy="give its smallest step")
    found = [_tune_channel(y[:, j], order, float(step[j])) for j in range(y.shape[1])]
    index, variance, believed, moved, white = (np.array(column) for column in zip(*found, strict=True))
    return Tuned(index * np.sqrt(variance) / sample_time**order, variance, believed.astype(bool), moved.astype(bool), white)


def tune_smoother(y: Array, sample_time: float, resolution: Array | float, order: int = 3) -> Tuned:
    """σ of the smoother of every channel by generalised cross-validation, which needs no R. Craven & Wahba 1979.

    The smoother leaves (1 - G) y, 1 - G = w^n / (w^n + Λ² |numerator|²), so from the n-th difference d of the signal alone

        V(Λ) = mean [w^n / (w^n + Λ² |numerator|²)² |d|²] / (mean [1 - G])²,   R = that sum / mean [1 - G].
    """
    step = np.broadcast_to(np.asarray(resolution, dtype=np.float64), y.shape[1:])
    found = []
    for j in range(y.shape[1]):
        values, lively = _window(y[:, j], float(step[j]))
        d = np.diff(values, n=order)
        taper = np.sin(np.pi * (np.arange(len(d)) + 0.5) / len(d)) ** 2
        power = np.abs(np.fft.rfft(d * taper)) ** 2 / (taper**2).sum()
        w = 4.0 * np.sin(np.pi * np.fft.rfftfreq(len(d))[1:]) ** 2  # at zero frequency the smoother leaves nothing
        passed, weight = _unit(order).numerator(w) / w**order, power[1:] / w**order
        grid = np.geomspace(min((8.0 * 37.0 / len(values)) ** order, 1e-2), 1e4, 30)
        for _ in range(3):
            left = np.multiply.outer(grid**2, passed)
            left += 1.0
            np.divide(1.0, left, out=left)  # 1 - G
            free, rest = left.sum(axis=1) / len(power), np.square(left, out=left) @ weight / len(power)
            best = int(np.argmin(rest / free**2))
            index, ratio = float(grid[best]), grid[1] / grid[0]
            grid = np.geomspace(index / ratio, index * ratio, 13)
        given = float(step[j]) ** 2 / 12.0
        variance = float(np.clip(rest[best] / free[best], given, _NOISE_CAP * given))
        believed = variance > _NOISIER * given
        found.append((index, variance if believed else given, believed, lively.any(), np.nan))
    index_, variance_, believed_, moved, white = (np.array(column) for column in zip(*found, strict=True))
    return Tuned(index_ * np.sqrt(variance_) / sample_time**order, variance_, believed_.astype(bool), moved.astype(bool), white)


def _tune_channel(y: Array, order: int, step: float) -> tuple[float, float, bool, bool, float]:
    """Λ, R, whether R is the data's, whether the channel moved, and the whiteness of its innovations."""
    values, lively = _window(y, step)
    given = step**2 / 12.0
    slowest = (8.0 * 37.0 / len(values)) ** order  # settles within a part of the window
    bank = _first_bank(order, min(slowest, 1e-2))
    grid = bank.filter.tracking_index
    if not lively.any():
        return float(grid[0]), given, False, False, np.nan
    index = 0.0
    for finer in range(3):  # twice finer around the best of either criterion
        if finer:
            ratio = grid[1] / grid[0]
            grid = np.geomspace(index / ratio, index * ratio, 13)
            bank = _Bank(order, grid)
        mean_square, remainder = _mean_square(values, lively, bank), bank.filter.remainder
        expected = given / remainder
        fixed = np.log(expected) + mean_square / expected  # -2 log likelihood a sample, R given
        noise = np.clip(mean_square * remainder, given, _NOISE_CAP * given)
        free = np.log(noise / remainder) + mean_square * remainder / noise  # R the data's
        best = int(np.argmin(free))
        believed = bool(noise[best] > _NOISIER * given and free[best] < fixed.min() - 20.0 / np.count_nonzero(lively))
        best = best if believed else int(np.argmin(fixed))
        index, variance = float(grid[best]), float(noise[best] if believed else given)
    white = np.where(lively, bank.surprise(values, slice(best, best + 1))[0], np.nan)
    return index, variance, believed, True, float(whiteness(white[len(white) // 4:, None]).statistic[0])


def _window(y: Array, step: float) -> tuple[Array, npt.NDArray[np.bool_]]:
    """The liveliest unbroken stretch of a channel, and which of its samples belong to motion."""
    valid = np.isfinite(y)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], valid.view(np.int8), [0]])))
    lengths = edges[1::2] - edges[::2]
    if not lengths.size or lengths.max() < 3 * BLOCK:
        raise InputRejected("T04", "no stretch without gaps is long enough to tune an observer on",
                            remedy=f"record {3 * BLOCK} samples without a gap, or give the bandwidth")
    first = int(edges[2 * int(np.argmax(lengths))])
    run = y[first:first + int(lengths.max())]
    if len(run) > _WINDOW:
        travel = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(run)))])
        begin = int(np.argmax(travel[_WINDOW - 1:] - travel[:len(run) - _WINDOW + 1]))
        run = run[begin:begin + _WINDOW]
    run = run[:len(run) // BLOCK * BLOCK]
    size, longer = divmod(len(run), max(1, len(run) // _STILL))
    sizes = np.full(max(1, len(run) // _STILL), size)
    sizes[:longer] += 1
    starts = np.cumsum(sizes) - sizes
    travelled = np.maximum.reduceat(run, starts) - np.minimum.reduceat(run, starts)
    return run, np.repeat(travelled > 2.5 * step, sizes)


class _Bank:
    """Many stationary filters and what a block of each does; those first tried are the same for every channel and log."""

    def __init__(self, order: int, index: Array) -> None:
        f = self.filter = stationary(order, index)
        self.power = blocks.powers(f.predictor, BLOCK)
        self.entry = (self.power[:, :BLOCK] @ (f.transition @ f.gain[..., None])[:, None])[..., 0]  # A^i E k
        late = np.concatenate([np.zeros((len(index), 1)), self.entry[:, :-1, 0]], axis=1)
        self.inside = np.eye(BLOCK) - blocks.impulse_toeplitz(late)
        self.free = -self.power[:, :BLOCK, 0].swapaxes(1, 2)

    def surprise(self, values: Array, which: slice = slice(None)) -> Array:
        """Innovations (filters, samples) of one channel by the filters `which`; whole blocks only."""
        y, entry, step = (values - values[0]).reshape(1, -1, BLOCK), self.entry[which], self.filter.step[which]
        drive = np.zeros((len(entry), y.shape[1], self.filter.order))
        away = np.arange(BLOCK) - (BLOCK - 1) / 2.0
        slope = float(away @ y[0, 0] / (away @ away))  # the filters start on the straight line through the first block
        drive[:, 0, 0], drive[:, 0, 1] = y[0, 0].mean() + slope * away[0], slope / step
        drive[:, 1:] = y[:, :-1] @ entry[:, ::-1]
        blocks.scan(self.power[which, BLOCK], drive)
        found = y @ self.inside[which]
        found += drive @ self.free[which]
        return np.asarray(found).reshape(len(entry), -1)


@lru_cache(maxsize=len(ORDERS))
def _unit(order: int) -> Stationary:
    """The filter of tracking index 1: for what depends on the order alone."""
    return stationary(order, np.ones(1))


@lru_cache(maxsize=16)
def _first_bank(order: int, slowest: float) -> _Bank:
    return _Bank(order, np.geomspace(slowest, 1e4, 30))


def _mean_square(values: Array, lively: npt.NDArray[np.bool_], bank: _Bank) -> Array:
    """Mean squared innovation of every filter, over motion and after a quarter of the window."""
    counted = lively.copy()
    if np.count_nonzero(lively[len(values) // 4:]) > len(values) // 16:
        counted[:len(values) // 4] = False  # long enough for the slowest filter to settle
    surprise = bank.surprise(values)
    total = np.square(surprise, out=surprise) @ counted.astype(np.float64)
    return np.asarray(np.maximum(total / np.count_nonzero(counted), 1e-300))
