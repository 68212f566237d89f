"""Put a log whose clock is uneven on an even grid, so that every later filter has even samples.

    even = evened(log, good)        None where the clock is even already

A clock ticks at g_k, a sample is taken at t_k = g_k + a_k and stamped s_k = t_k + b_k. Of the
deviation e_k = s_k - g_k of a stamp from its tick the share

    w = var a / (var a + var b),    E[t_k | s_k] = g_k + w e_k

is a deviation of the sampling, the rest is one of the stamp (linear regression). Positions show w:
to first order y_k = q(g_k) + w dq(g_k) e_k + noise, and the residual of a local polynomial of y is
free of the smooth q. So w is the coefficient of a regression of that residual on the residual of
dq e, all joints together, each weighted by its noise R_j + (dq_j σ_t)², where σ_t is the jitter
that remains. w = 1: the stamps are right; w = 0: the ticks are.

The ticks are a random walk with a white deviation (local level model, Harvey 1989, sec. 2.2): a
timer has ticks on a straight line, a loop that sleeps between samples walks. The variogram of the
stamps, E(x_{k+m} - x_k)² = m σ_walk² + 2 σ_e², tells one from the other.

Positions and measured torques are splines through the instants, a held command is its average over
each step. Lost samples within a stretch are bridged by the spline; a gap remains a gap, and missing
or spoilt samples remain so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipelines.errors import InputRejected
from pipelines.estimation.config import ClockConfig
from pipelines.estimation.filters import apply_kernel, half_width, kernel
from pipelines.estimation.grids import grid, resample
from pipelines.io.log import Array, ExperimentLog
from pipelines.quality.segments import Mask, Usable, usable

_CONFIG = ClockConfig()


@dataclass(frozen=True, eq=False)
class Instants:
    """When samples were taken."""

    t: Array  # [s] (samples,)
    share: float = 1.0  # w of the deviations that is of the sampling; 1 where the clock has none
    jitter: float = 0.0  # [s] σ_t that remains between t and the true instants


@dataclass(frozen=True, eq=False)
class Evened:
    """A log on an even grid."""

    log: ExperimentLog
    good: Usable  # of `log`
    # kept samples of the recording, samples of `log`, instants
    stretches: tuple[tuple[slice, slice, Array], ...]

    def at_recording(self, values: Array, samples: int, spline: bool) -> Array:
        """Return signals (k, n, joints) at the kept samples of the recording, NaN outside runs."""
        out = np.full((len(values), samples, values.shape[2]), np.nan)
        flat = np.moveaxis(values, 1, 0).reshape(values.shape[1], -1)
        for recorded, even, t in self.stretches:
            at = resample(self.log.t[even], flat[even], t, "spline" if spline else "linear")
            out[:, recorded] = np.moveaxis(at.reshape(-1, *out.shape[::2]), 0, 1)
        return out


def evened(log: ExperimentLog, good: Usable) -> Evened | None:
    """Return `log` on an even grid of its nominal sample time; None where its clock is even.

    Raises:
        InputRejected: T05, samples lie on each other.
    """
    if good.time.jitter <= _CONFIG.even or not good.runs:
        return None
    step = log.sample_time if good.time.known else good.time.median
    parts, stretches, done = [], [], 0
    for run in good.runs:
        stamps = good.log.t[run]
        t = instants(stamps, _filled(stamps, good.log.q[run], good.position_spikes[run]), step).t
        at = grid(float(t.min()), float(t.max()), 1.0 / step)
        parts.append((at, *_sampled(good, run, t, at, step)))
        stretches.append((run, slice(done, done + len(at)), t))
        done += len(at)
    t, q, tau, saturated = (np.concatenate(part) for part in zip(*parts, strict=True))
    values = {"t": t, "q": q, "tau": tau}
    signals = {name: replace(good.log.signals[name], values=x) for name, x in values.items()}
    even = replace(log, signals=signals, sample_time=step, derived=None)
    return Evened(even, replace(usable(even), saturated=saturated > 0.0), tuple(stretches))


def _sampled(
    good: Usable, run: slice, instant: Array, at: Array, step: float
) -> tuple[Array, Array, Array]:
    """Return position, torque and saturation (n, joints) of one stretch at even times."""
    q = np.where(good.position_spikes[run], np.nan, good.log.q[run])
    tau = np.where(good.torque_spikes[run], np.nan, good.log.tau[run])
    lost = np.hstack([np.isnan(q), np.isnan(tau), good.saturated[run]]).astype(np.float64)
    q, tau = (_filled(instant, x, np.isnan(x)) for x in (q, tau))
    t, both = _merge_close(instant, np.hstack([q, tau, lost]), step)
    if len(t) < (1.0 - _CONFIG.merged) * len(instant):
        words = f"{len(instant) - len(t)} of {len(instant)} samples lie on another's place"
        raise InputRejected(
            "T05",
            f"the clock is too uneven: {words}",
            where=good.log.source or good.log.name,
            remedy="record with an even clock, or resample with 'rrrid import'",
        )
    joints = good.log.n_joints
    q, tau = resample(t, both[:, :joints], at), both[:, joints : 2 * joints]
    if good.log.torque == "measured":
        tau = resample(t, tau, at)
    else:
        tau = average_held(t, tau, at, step)
    no_q, no_tau, saturated = np.split(resample(t, both[:, 2 * joints :], at, "linear"), 3, axis=1)
    return np.where(no_q > 0.0, np.nan, q), np.where(no_tau > 0.0, np.nan, tau), saturated


def _filled(t: Array, x: Array, spoilt: Mask) -> Array:
    """Return `x` (samples, joints) with straight lines where it is spoilt or not a number."""
    bad = spoilt | ~np.isfinite(x)
    out = np.array(x)
    for column, ill in zip(out.T, bad.T, strict=True):
        column[ill] = 0.0 if ill.all() else np.interp(t[ill], t[~ill], column[~ill])
    return out


def _merge_close(t: Array, values: Array, step: float) -> tuple[Array, Array]:
    """Return times (n,) and values (n, k) in order of time, close ones as their mean."""
    order = np.argsort(t, kind="stable")
    t, values = t[order], values[order]
    if np.diff(t).min(initial=np.inf) >= _CONFIG.closest * step:
        return t, values
    place = np.floor((t - t[0]) / (_CONFIG.closest * step))
    first = np.flatnonzero(np.diff(place, prepend=-1.0) > 0.0)
    size = np.diff(np.append(first, len(t)))
    mean = np.add.reduceat(values, first, axis=0) / size[:, None]
    return np.add.reduceat(t, first) / size, mean


def average_held(t: Array, u: Array, at: Array, step: float) -> Array:
    """Return the means (n, k) over [at, at + step] of `u` (samples, k), held from sample on.

    u acts from t_k to t_{k+1}: its integral U is piecewise linear, the mean (U(b) - U(a)) / step.
    """
    hold = np.diff(t, append=t[-1] + step)
    total = np.vstack([np.zeros((1, u.shape[1])), np.cumsum(hold[:, None] * u, axis=0)])
    edge = np.append(t, t[-1] + step)
    moved = [np.interp(at + step, edge, x) - np.interp(at, edge, x) for x in total.T]
    return np.asarray(np.stack(moved, axis=1) / step)


def instants(stamps: Array, q: Array, step: float) -> Instants:
    """Return when the samples of one unbroken stretch were taken.

    Args:
        stamps: [s] (samples,), increasing.
        q: positions [rad or m] (samples, joints), finite.
        step: [s] nominal sample time.
    """
    tick = _ticks(stamps)
    half = half_width(step, _CONFIG.smooth_hz, _CONFIG.order)
    regressed = _residuals(stamps, stamps - tick, q, step, half)
    if regressed is None or np.array_equal(tick, stamps):
        return Instants(stamps)
    left, moved, speed = regressed
    noise, jitter, share = np.ones(left.shape[1]), 0.0, 1.0
    for _ in range(_CONFIG.passes):
        weight = 1.0 / (noise + (speed * jitter) ** 2)
        power = float(np.sum(weight * moved**2))
        if power <= 0.0:
            return Instants(stamps)
        share = float(np.sum(weight * moved * left)) / power
        noise, jitter = _spread(left - share * moved, speed, half)
    share = float(np.clip(share, 0.0, 1.0))
    return Instants(tick + share * (stamps - tick), share, float(jitter))


def _ticks(stamps: Array) -> Array:
    """Return the ticks [s] (samples,) of a clock.

    The smoothed level of a local level model is (I + (σ_e²/σ_walk²) DᵀD)⁻¹ x, D the first
    difference (Harvey 1989, sec. 4.6); without a walk it is the straight line itself.
    """
    count = _numbers(stamps)
    lag = min(_CONFIG.lag, len(stamps) // 4)
    x = stamps - np.polyval(np.polyfit(count, stamps, 1), count)
    if lag < 2:
        return stamps
    near, far = (float(np.mean((x[m:] - x[:-m]) ** 2)) for m in (1, lag))
    chance = near * np.sqrt(2.0 / len(x))  # standard deviation of far - near without a walk
    walk = (far - near) / (lag - 1) if far - near > _CONFIG.sure * chance else 0.0
    white = 0.5 * (near - walk)
    if white <= 0.0:
        return stamps
    if walk <= 0.0:
        return stamps - x
    from scipy.linalg import solveh_banded

    ratio, band = white / walk, np.zeros((2, len(x)))
    band[1] = 1.0 + 2.0 * ratio
    band[1, [0, -1]] = 1.0 + ratio
    band[0, 1:] = -ratio
    return np.asarray(stamps - (x - solveh_banded(band, x)))


def _numbers(stamps: Array) -> Array:
    """Return the numbers of the samples: one more each, and one for every sample lost.

    A loss puts all later stamps off; a late stamp does so to itself alone. A long interval is a
    loss of as many samples as the medians of the stamps before and after it lie apart.
    """
    typical, around = float(np.median(np.diff(stamps))), _CONFIG.around
    excess = np.diff(stamps) / typical - 1.0
    near = np.pad(excess, 1)
    least = np.minimum(excess, np.minimum(excess + near[:-2], excess + near[2:]))
    long, lost = np.flatnonzero(excess > 0.5), np.zeros(len(stamps))
    lost[1:] = np.maximum(0.0, np.rint(least))  # a late stamp is followed by a short interval
    for _ in range(_CONFIG.passes):  # losses nearby, as the pass before has them, are taken out
        early = stamps / typical - np.arange(len(stamps)) - np.cumsum(lost)
        early = np.pad(early, around, mode="edge")
        windows = np.lib.stride_tricks.sliding_window_view(early, around)
        before, after = (np.median(windows[long + 1 + k], axis=1) for k in (0, around))
        lost[long + 1] = np.maximum(0.0, np.rint(after - before + lost[long + 1]))
    return np.asarray(np.arange(len(stamps)) + np.cumsum(lost))


def _residuals(
    stamps: Array, e: Array, q: Array, step: float, half: int
) -> tuple[Array, Array, Array] | None:
    """Return the polynomial residuals of q and of dq e, and dq, of windows without a loss."""
    if len(q) < 6 * half + 1:
        return None
    passed = kernel(half, _CONFIG.order, 0)
    slope = apply_kernel(q, kernel(half, _CONFIG.order, 1)) / step
    inner = slice(half, len(q) - half)
    left, moved = (
        x[half:-half] - apply_kernel(x, passed) for x in (q[inner], slope * e[inner, None])
    )
    near = np.zeros(len(q), dtype=bool)
    for k in np.flatnonzero(np.diff(stamps) > 2.5 * step).tolist():
        near[max(0, k - 2 * half) : k + 2 * half + 1] = True
    keep = ~near[2 * half : -2 * half]
    return (left[keep], moved[keep], slope[half:-half][keep]) if keep.any() else None


def _spread(rest: Array, speed: Array, half: int) -> tuple[Array, float]:
    """Return the noise R (joints,) [rad²] and the jitter σ_t [s] behind residuals (n, joints).

    E r² = (1 - h) (R_j + dq² σ_t²) with h the weight of the polynomial at its middle: one straight
    line over dq² for all joints, each with its own level; slope not negative.
    """
    free = 1.0 - float(kernel(half, _CONFIG.order, 0)[half])
    power, square = rest**2 / free, speed**2
    base = np.maximum(power.mean(axis=0), 1e-300)
    centred = (square - square.mean(axis=0)) / base
    slope = float(np.sum(centred * power / base)) / max(float(np.sum(centred**2)), 1e-300)
    most = float(np.min(base / np.maximum(square.mean(axis=0), 1e-300)))
    slope = min(max(slope, 0.0), most)
    noise = np.maximum(base - slope * square.mean(axis=0), 1e-3 * base)
    return noise, float(np.sqrt(slope))
