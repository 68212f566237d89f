"""Estimate when the samples of a log were taken, and put them on an even grid.

    found = instants(stamps, q, step)           when each sample was taken, with what remains unknown
    even = resample(found.t, q, at)             a sampled signal, at even times
    even = average_held(found.t, u, at, step)   a command that is held from sample to sample

A clock ticks at g_k, a sample is taken at t_k = g_k + a_k and stamped s_k = t_k + b_k. Of the
deviation e_k = s_k - g_k of a stamp from its tick the share

    w = var a / (var a + var b),    E[t_k | s_k] = g_k + w e_k

is a deviation of the sampling, the rest is one of the stamp (linear regression). Positions tell
w: to first order y_k = q(g_k) + w dq(g_k) e_k + noise, and what a local polynomial leaves of y
is free of the smooth q. So w is the coefficient of a regression of the polynomial residual of y
on that of dq e, all joints together, each weighted by its noise R_j + (dq_j σ_t)², where σ_t is
the jitter that remains. w = 1: the stamps are right; w = 0: the ticks are.

The ticks are a random walk with a white deviation (local level model, Harvey 1989, sec. 2.2): a
timer has ticks on a straight line, a loop that sleeps between samples walks. The variogram of
the stamps, E(x_{k+m} - x_k)² = m σ_walk² + 2 σ_e², tells one from the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.signal.derivatives import apply_kernel, half_width, kernel

__all__ = ["ClockConfig", "Instants", "average_held", "instants", "merge_close", "ticks"]

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ClockConfig:
    """Numbers of the estimate."""

    smooth_hz: float = 40.0  # above the motion of an arm: what a local polynomial leaves is noise
    order: int = 4  # of the local polynomial (Savitzky & Golay 1964)
    lag: int = 64  # steps of the variogram: long against one sample, short against a log
    sure: float = 3.0  # standard deviations, from which on a walk is none by chance
    around: int = 16  # samples before and after a long interval that tell whether one is lost
    passes: int = 3  # of the weights: they are known to a per cent then
    closest: float = 0.25  # of a step: nearer samples count as one, their mean


@dataclass(frozen=True, eq=False)
class Instants:
    """When samples were taken."""

    t: Array  # [s] (samples,)
    share: float  # w of the deviations that is of the sampling; 1 where the clock has none
    share_std: float
    deviation: float  # [s] rms of the stamps from their ticks
    jitter: float  # [s] σ_t that remains between t and the true instants


def instants(stamps: Array, q: Array, step: float,
             config: ClockConfig | None = None) -> Instants:
    """Return when the samples of one unbroken stretch were taken.

    Args:
        stamps: [s] (samples,), increasing.
        q: positions [rad or m] (samples, joints), finite.
        step: [s] nominal sample time.
    """
    config = config or ClockConfig()
    tick, deviation = ticks(stamps, config)
    e = stamps - tick
    regressed = _residuals(stamps, e, q, step, config)
    if regressed is None or deviation == 0.0:
        return Instants(stamps, 1.0, 0.0, deviation, 0.0)
    left, moved, speed = regressed
    noise, jitter, share, std = np.ones(left.shape[1]), 0.0, 1.0, np.inf
    for _ in range(config.passes):
        weight = 1.0 / (noise + (speed * jitter) ** 2)
        power = float(np.sum(weight * moved**2))
        if power <= 0.0:
            return Instants(stamps, 1.0, 0.0, deviation, 0.0)
        share = float(np.sum(weight * moved * left)) / power
        noise, jitter = _spread(left - share * moved, speed, config, step)
        std = 1.0 / np.sqrt(power)
    share = float(np.clip(share, 0.0, 1.0))
    t = tick + share * e
    return Instants(t, share, float(std), deviation, float(jitter))


def ticks(stamps: Array, config: ClockConfig | None = None) -> tuple[Array, float]:
    """Return the ticks [s] (samples,) of a clock, and the rms [s] of the stamps from them.

    The smoothed level of a local level model is (I + (σ_e²/σ_walk²) DᵀD)⁻¹ x, D the first
    difference (Harvey 1989, sec. 4.6); without a walk it is the straight line itself.
    """
    config = config or ClockConfig()
    count = _numbers(stamps, config)
    lag = min(config.lag, len(stamps) // 4)
    line = np.polyfit(count, stamps, 1)
    x = stamps - np.polyval(line, count)
    if lag < 2:
        return stamps, 0.0
    near, far = (float(np.mean((x[m:] - x[:-m]) ** 2)) for m in (1, lag))
    chance = near * np.sqrt(2.0 / len(x))  # standard deviation of far - near without a walk
    walk = (far - near) / (lag - 1) if far - near > config.sure * chance else 0.0
    white = 0.5 * (near - walk)
    if white <= 0.0:
        return stamps, 0.0
    level = _level(x, white / walk) if walk > 0.0 else np.zeros_like(x)
    e = x - level
    return stamps - e, float(np.sqrt(np.mean(e**2)))


def merge_close(t: Array, values: Array, step: float,
                config: ClockConfig | None = None) -> tuple[Array, Array]:
    """Return times (n,) and values (n, k) in order of time, close ones as their mean."""
    config = config or ClockConfig()
    order = np.argsort(t, kind="stable")
    t, values = t[order], values[order]
    if np.diff(t).min(initial=np.inf) >= config.closest * step:
        return t, values
    place = np.floor((t - t[0]) / (config.closest * step))
    first = np.flatnonzero(np.diff(place, prepend=-1.0) > 0.0)
    size = np.diff(np.append(first, len(t)))
    return (np.add.reduceat(t, first) / size,
            np.add.reduceat(values, first, axis=0) / size[:, None])


def average_held(t: Array, u: Array, at: Array, step: float) -> Array:
    """Return the means (n, k) over [at, at + step] of `u` (samples, k), held from sample on.

    u acts from t_k to t_{k+1}: its integral U is piecewise linear, the mean (U(b) - U(a)) / step.
    """
    hold = np.diff(t, append=t[-1] + step)
    total = np.vstack([np.zeros((1, u.shape[1])), np.cumsum(hold[:, None] * u, axis=0)])
    edge = np.append(t, t[-1] + step)
    ends = (np.stack([np.interp(x, edge, column) for column in total.T], axis=1)
            for x in (at, at + step))
    first, last = ends
    return np.asarray((last - first) / step)


def _numbers(stamps: Array, config: ClockConfig) -> Array:
    """Return the numbers of the samples: one more each, and one for every sample lost.

    A loss puts all later stamps off; a late stamp does so to itself alone. A long interval is
    a loss of as many samples as the medians of the stamps before and after it lie apart.
    """
    typical = float(np.median(np.diff(stamps)))
    excess = np.diff(stamps) / typical - 1.0
    near = np.pad(excess, 1)
    least = np.minimum(excess, np.minimum(excess + near[:-2], excess + near[2:]))
    long, lost = np.flatnonzero(excess > 0.5), np.zeros(len(stamps))
    lost[1:] = np.maximum(0.0, np.rint(least))  # a late stamp is followed by a short interval
    for _ in range(config.passes):  # losses nearby, as the pass before has them, are taken out
        early = stamps / typical - np.arange(len(stamps)) - np.cumsum(lost)
        early = np.pad(early, config.around, mode="edge")
        windows = np.lib.stride_tricks.sliding_window_view(early, config.around)
        before, after = (np.median(windows[long + 1 + k], axis=1) for k in (0, config.around))
        lost[long + 1] = np.maximum(0.0, np.rint(after - before + lost[long + 1]))
    return np.asarray(np.arange(len(stamps)) + np.cumsum(lost))


def _level(x: Array, ratio: float) -> Array:
    from scipy.linalg import solveh_banded

    band = np.zeros((2, len(x)))
    band[1] = 1.0 + 2.0 * ratio
    band[1, [0, -1]] = 1.0 + ratio
    band[0, 1:] = -ratio
    return np.asarray(solveh_banded(band, x))


def _residuals(stamps: Array, e: Array, q: Array, step: float,
               config: ClockConfig) -> tuple[Array, Array, Array] | None:
    """Return what a local polynomial leaves of q and of dq e, and dq; of windows without a loss."""
    half = half_width(step, config.smooth_hz, config.order)
    if len(q) < 6 * half + 1:
        return None
    passed = kernel(half, config.order, 0)
    slope = apply_kernel(q, kernel(half, config.order, 1)) / step
    inner = slice(half, len(q) - half)

    def rest(x: Array) -> Array:
        return np.asarray(x[half:-half] - apply_kernel(x, passed))

    moved = rest(slope * e[inner, None])
    left = rest(q[inner])
    lost = np.flatnonzero(np.diff(stamps) > 2.5 * step)
    near = np.zeros(len(q), dtype=bool)
    for k in lost.tolist():
        near[max(0, k - 2 * half):k + 2 * half + 1] = True
    keep = ~near[2 * half:-2 * half]
    return (left[keep], moved[keep], slope[half:-half][keep]) if keep.any() else None


def _spread(rest: Array, speed: Array, config: ClockConfig, step: float) -> tuple[Array, float]:
    """Return the noise R (joints,) [rad²] and the jitter σ_t [s] behind residuals (n, joints).

    E r² = (1 - h) (R_j + dq² σ_t²) with h the weight of the polynomial at its middle: one
    straight line over dq² for all joints, each with its own level; slope not negative.
    """
    half = half_width(step, config.smooth_hz, config.order)
    free = 1.0 - float(kernel(half, config.order, 0)[half])
    power, square = rest**2 / free, speed**2
    base = np.maximum(power.mean(axis=0), 1e-300)
    centred = (square - square.mean(axis=0)) / base
    slope = float(np.sum(centred * power / base)) / max(float(np.sum(centred**2)), 1e-300)
    slope = min(max(slope, 0.0), float(np.min(base / np.maximum(square.mean(axis=0), 1e-300))))
    noise = np.maximum(base - slope * square.mean(axis=0), 1e-3 * base)
    return noise, float(np.sqrt(slope))
