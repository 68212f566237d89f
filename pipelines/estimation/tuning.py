"""Tune observer and smoother to samples, or to a bandwidth.

    for_observer, for_smoother = tune(y, sample_time, resolution, order)

With w = 4 sin²(ω T / 2), N = |numerator|² of the held chain and Λ = σ T^n / √R, the n-th difference
d of a measured chain has the spectrum R (w^n + Λ² N), and the smoother leaves 1 - G = w^n / (w^n +
Λ² N) of a position. An observer takes the Λ of the largest likelihood (Whittle 1953): the
prediction error decomposition (Schweppe 1965) in frequency. A smoother needs another one: on a
smooth excitation the likelihood looks one sample ahead and selects 20 to 50 times more jerk than is
best for a filter that sees both sides, which cross-validation finds (Craven & Wahba 1979).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipelines.errors import InputRejected, UsageError
from pipelines.estimation.chain import ORDERS, Array, stationary
from pipelines.estimation.config import MotionConfig
from pipelines.estimation.state_estimation import BLOCK, Mask, Observer, bisected, observe

_CONFIG = MotionConfig()
# Λ of filters -> what they cost, and the R that goes with each
_Criterion = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True)
class Tuned:
    """Jerk level and measurement noise of each channel."""

    jerk_std: Array  # σ (channels,); the slowest one tried of a channel that stood still
    noise_variance: Array  # R (channels,)


def smoother_bandwidth(observer: Observer, twice: bool = False) -> Array:
    """Return the frequency [Hz] (channels,) to which the smoother passes the position with -3 dB.

    G = Λ² N / (w^n + Λ² N) = 1/√2.

    Args:
        twice: where it goes over its residual once more: 1 - (1 - G)² = 1/√2.
    """
    f, root = observer.filter, np.sqrt(0.5)
    rest = np.sqrt(1.0 - root) if twice else 1.0 - root  # 1 - G
    limit = rest / (1.0 - rest) * f.tracking_index**2
    low, _ = bisected(
        lambda x: np.exp(x) ** f.order <= limit * f.numerator(np.exp(x)),
        np.full(len(limit), np.log(1e-12)),
        np.full(len(limit), np.log(4.0)),
        60,
    )
    half = np.minimum(np.exp(low / 2.0) / 2.0, 1.0)
    return np.asarray(np.arcsin(half) / (np.pi * observer.sample_time))


def sigma_for_bandwidth(
    bandwidth_hz: Array | float, sample_time: float, noise_variance: Array | float, order: int = 3
) -> Array:
    """Return the jerk level whose observer passes -3 dB at `bandwidth_hz`.

    Raises:
        UsageError: C02, a bandwidth out of reach.
    """
    hz, variance = np.broadcast_arrays(
        np.atleast_1d(np.asarray(bandwidth_hz, dtype=np.float64)), noise_variance
    )
    if not np.all((hz > 0.0) & (hz < 0.5 / sample_time)):
        remedy = f"choose one between 0 and half the rate, {0.5 / sample_time:g} Hz"
        raise UsageError("C02", "the bandwidth of an observer", remedy=remedy)

    def slow(log_index: Array) -> Mask:
        gain = stationary(order, np.exp(log_index)).position_gain(2.0 * np.pi * hz * sample_time)
        return np.asarray(gain < np.sqrt(0.5))

    low, high = np.full(hz.shape, np.log(1e-14)), np.full(hz.shape, np.log(1e6))
    if slow(high).any():
        words = f"no observer of order {order} is that fast"
        raise UsageError("C02", words, remedy="choose a smaller bandwidth")
    high = bisected(slow, low, high, 40)[1]
    return np.asarray(np.exp(high) * np.sqrt(variance) / sample_time**order)


def innovations(y: Array, observer: Observer) -> Array:
    """Return what each measurement adds to its prediction, over its expected deviation.

    NaN at missing samples and while settling.
    """
    f, track, index = observer.filter, observe(y, observer), np.arange(len(y))[:, None]
    ahead = np.full(y.shape, np.nan)
    row = f.transition[:, 0] / observer.rate
    ahead[1:] = np.einsum("ni,ikn->kn", row, track.states[:, :-1])
    surprise = (y - ahead) / np.sqrt(observer.noise_variance / f.remainder)
    # the covariance settles twice as fast as the states, and 1e-8 will do
    wait = min(observer.settled // 4 + observer.order, len(y) // 2)
    since = index - np.maximum.accumulate(np.where(np.isfinite(y), -1, index), axis=0)
    surprise[since <= wait] = np.nan
    return np.asarray(surprise)


def whiteness(innovation: Array, lags: int = 30) -> tuple[Array, Array]:
    """Return how far (samples, channels) is from white noise, and its autocorrelation (lags, …).

    Portmanteau statistic Q = N (N + 2) Σ r_k² / (N - k). Ljung & Box 1978, Biometrika 65, p. 297.
    Q is χ² with `lags` degrees of freedom for white noise, here made standard: (Q - lags) / √(2
    lags). Missing samples (NaN) drop out of the sums.
    """
    present = np.isfinite(innovation)
    count = present.sum(axis=0)
    mean = np.where(present, innovation, 0.0).sum(axis=0) / np.maximum(count, 1)
    rest = np.where(present, innovation - mean, 0.0)
    steps = range(1, min(lags, len(rest) - 1) + 1)
    pairs = np.stack([np.count_nonzero(present[k:] & present[:-k], axis=0) for k in steps])
    product = np.stack([np.einsum("kn,kn->n", rest[k:], rest[:-k]) for k in steps])
    correlation = product / np.maximum((rest**2).sum(axis=0), 1e-300)
    q = count * (count + 2.0) * (correlation**2 / np.maximum(pairs, 1)).sum(axis=0)
    return (q - len(steps)) / np.sqrt(2.0 * len(steps)), correlation


def tune(
    y: Array, sample_time: float, resolution: Array | float, order: int = 3
) -> tuple[Tuned, Tuned]:
    """Return σ and R of every channel of `y` (samples, channels) for an observer and a smoother.

    R is Δθ²/12 (Kostić et al. 2004, sec. IV-C.2) unless the data show more than twice as much: an
    encoder that counts more coarsely than described, or a noisy one. It is never set below Δθ²/12:
    the quantisation of slow motion is no white noise and would feign less. Spikes must have been
    marked missing (NaN).

    Raises:
        UsageError: C02, an order or a resolution out of bounds.
        InputRejected: T04, no stretch without gaps is long enough.
    """
    if order not in ORDERS:
        words = f"an observer of order {order} is not known"
        raise UsageError("C02", words, remedy="choose order 2, 3 or 4")
    steps = np.broadcast_to(np.asarray(resolution, dtype=np.float64), y.shape[1:])
    if not np.all(steps > 0.0):
        words = "the resolution of an encoder must be a positive number"
        raise UsageError("C02", words, remedy="give its smallest step")
    found: tuple[list[tuple[float, float]], ...] = ([], [])
    for column, step in zip(y.T, steps.tolist(), strict=True):
        values, moves = _window(column, step)
        slowest = min((8.0 * 37.0 / len(values)) ** order, 1e-2)  # settles within the window
        for kept, criterion in zip(found, _criteria(values, step**2 / 12.0, order), strict=True):
            kept.append(_least(criterion, slowest) if moves else (slowest, step**2 / 12.0))
    both = [np.array(kept).T for kept in found]
    sigmas = [index * np.sqrt(variance) / sample_time**order for index, variance in both]
    return Tuned(sigmas[0], both[0][1]), Tuned(sigmas[1], both[1][1])


def _criteria(values: Array, given: float, order: int) -> tuple[_Criterion, _Criterion]:
    """Return -2 log likelihood a sample and the cross-validation of one channel.

    -2 log L / n = log(R / remainder) + mean(|d|² / (w^n + Λ² N)) / R: the mean of log(w^n + Λ² N)
    over all frequencies is -log remainder. V = mean(w^n |d|² / (w^n + Λ² N)²) / mean(1 - G)².

    Args:
        given: R that counting in steps leaves.
    """
    d = np.diff(values, n=order)
    taper = np.sin(np.pi * (np.arange(len(d)) + 0.5) / len(d)) ** 2
    power = np.abs(np.fft.rfft(d * taper)) ** 2 / (taper**2).sum()
    # at zero frequency the smoother leaves nothing
    w = 4.0 * np.sin(np.pi * np.fft.rfftfreq(len(d))[1:]) ** 2
    passed = stationary(order, np.ones(1)).numerator(w) / w**order
    weight, bins = power[1:] / w**order, len(power)
    most = _CONFIG.noise_cap * given

    def rest(grid: Array) -> Array:
        """1 - G (filters, bins)"""
        x = np.multiply.outer(grid**2, passed)
        x += 1.0
        return np.asarray(np.divide(1.0, x, out=x))

    def likelihood(grid: Array) -> tuple[Array, Array]:
        square = rest(grid) @ weight / bins
        level = -np.log(stationary(order, grid).remainder)
        noise = np.clip(square, given, most)
        free = level + np.log(noise) + square / noise
        fixed = level + np.log(given) + square / given
        best = int(np.argmin(free))
        clearly = free[best] < fixed.min() - 20.0 / len(values)
        if clearly and noise[best] > _CONFIG.noisier * given:
            return free, noise
        return fixed, np.full(len(grid), given)

    def cross_validation(grid: Array) -> tuple[Array, Array]:
        x = rest(grid)
        share = x.sum(axis=1) / bins
        square = np.square(x, out=x) @ weight / bins
        noise = np.clip(square / share, given, most)
        return square / share**2, np.where(noise > _CONFIG.noisier * given, noise, given)

    return likelihood, cross_validation


def _least(criterion: _Criterion, slowest: float) -> tuple[float, float]:
    """Return the Λ of least cost and its R, by ever finer grids."""
    grid = np.geomspace(slowest, 1e4, 30)
    for _ in range(3):
        cost, variance = criterion(grid)
        best = int(np.argmin(cost))
        found, ratio = (float(grid[best]), float(variance[best])), grid[1] / grid[0]
        grid = np.geomspace(found[0] / ratio, found[0] * ratio, 13)
    return found


def _window(y: Array, step: float) -> tuple[Array, bool]:
    """Return the liveliest unbroken stretch of a channel without rests at its ends, and whether it
    moves.
    """
    edges = np.flatnonzero(np.diff(np.isfinite(y).astype(np.int8), prepend=0, append=0))
    lengths = edges[1::2] - edges[::2]
    if not lengths.size or lengths.max() < 3 * BLOCK:
        words = "no stretch without gaps is long enough to tune an observer on"
        remedy = f"record {3 * BLOCK} samples without a gap, or give the bandwidth"
        raise InputRejected("T04", words, remedy=remedy)
    first = int(edges[2 * int(np.argmax(lengths))])
    run, window = y[first : first + int(lengths.max())], _CONFIG.window
    if len(run) > window:
        travel = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(run)))])
        begin = int(np.argmax(travel[window - 1 :] - travel[: len(run) - window + 1]))
        run = run[begin : begin + window]
    starts = np.arange(0, len(run), _CONFIG.still)
    travelled = np.maximum.reduceat(run, starts) - np.minimum.reduceat(run, starts)
    lively = np.flatnonzero(travelled > 2.5 * step)
    if not lively.size:
        return run, False
    moving = run[starts[lively[0]] : starts[lively[-1]] + _CONFIG.still]
    if len(moving) < len(run):  # where a rest begins, the arm may have been stopped
        moving = moving[_CONFIG.still : -_CONFIG.still]
    return (moving if len(moving) >= 3 * BLOCK else run), True
