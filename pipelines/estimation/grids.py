"""Lay the samples of a log on even grids, as filters need them, and read states off them.

    even = evened(log, good)       on an even grid, for a log whose clock is uneven; else None
    seen = measured(log)           positions on the grids of an even clock
    for grid in seen.grids:
        states, std = on_grid(seen.y[grid.first:grid.last], grid, seen.step, track)

On a grid nothing is interpolated: a place that holds no sample is missing.

A clock that is uneven ticks at g_k, a sample is taken at t_k = g_k + a_k and stamped s_k = t_k +
b_k. Of the deviation e_k = s_k - g_k of a stamp from its tick the share

    w = var a / (var a + var b),    E[t_k | s_k] = g_k + w e_k

is a deviation of the sampling, the rest is one of the stamp (linear regression). Positions show w:
to first order y_k = q(g_k) + w dq(g_k) e_k + noise, and the residual of a local polynomial of y is
free of the smooth q. So w is the coefficient of a
regression of that residual on the residual of dq e, all joints together, each weighted by its
noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected
from pipelines.estimation.config import MotionConfig
from pipelines.estimation.filters import apply_kernel, half_width, kernel
from pipelines.io.limits import SHORTEST, recorded_span
from pipelines.io.log import Array, ExperimentLog
from pipelines.quality.segments import Usable, usable

Indices = npt.NDArray[np.intp]
# samples of a grid -> states and deviations (order, samples, joints)
Tracker = Callable[[Array], tuple[Array, Array]]

_CONFIG = MotionConfig()
_EVEN = "record with an even clock, or resample with 'rrrid import'"


@dataclass(frozen=True)
class Grid:
    """Rows first .. last - 1 of a log, and where each lies on a grid of even steps."""

    first: int
    last: int
    step: float  # [s] of this clock
    place: Indices  # (rows,) from 0 upwards

    @property
    def size(self) -> int:
        return int(self.place[-1]) + 1


@dataclass(frozen=True, eq=False)
class Measured:
    """The positions of a log as the filters see them."""

    good: Usable
    y: Array  # (kept samples, joints) [rad], unwrapped, NaN where missing or a glitch
    step: float  # [s] nominal
    grids: tuple[Grid, ...]  # stretches of an unbroken clock

    @property
    def longest(self) -> Grid:
        return max(self.grids, key=lambda grid: grid.last - grid.first)


def measured(log: ExperimentLog, good: Usable | None = None) -> Measured:
    """Return the positions of `log` on even grids.

    Raises:
        InputRejected: T08, too few samples; T04, no stretch is long enough; T05, the clock is too
            uneven; D02, a joint without any measurement.
    """
    good = usable(log) if good is None else good
    where = log.source or log.name
    if log.n_samples < SHORTEST:
        span = recorded_span(log.signals["t"].values, log.sample_time)
        words = f"{log.n_samples} samples, {span:.3g} s: at least {SHORTEST} are needed to "
        words += f"reconstruct motion, {SHORTEST * log.sample_time:.3g} s at this rate"
        remedy = "record longer, some seconds of the motion at least"
        raise InputRejected("T08", words, where=where, remedy=remedy)
    if not good.runs:
        words = "no stretch without a gap is long enough to reconstruct motion from"
        remedy = "'rrrid inspect' shows what is missing; record again"
        raise InputRejected("T04", words, where=where, remedy=remedy)
    y = np.where(good.position_spikes, np.nan, good.log.q)
    lost = np.isnan(y)
    if lost.all(axis=0).any():
        words = f"joint {int(np.argmax(lost.all(axis=0))) + 1} has no measurement at all"
        remedy = "leave the joint out, or record it again"
        raise InputRejected("D02", words, where=where, remedy=remedy)
    edges = np.flatnonzero(np.diff(lost.any(axis=1).astype(np.int8), prepend=0, append=0))
    long = [(a, b) for a, b in edges.reshape(-1, 2).tolist() if b - a > _CONFIG.long]
    ends = [place for a, b in long for place in (a + _CONFIG.predicted, b)]
    jumps = np.flatnonzero(good.jumped.any(axis=1))
    cuts = np.concatenate([jumps, [good.end], ends]).astype(np.intp)
    step = log.sample_time if good.time.known else good.time.median
    return Measured(good, y, step, tuple(grids(good.log.t, step, cuts)))


def grids(
    t: Array, sample_time: float, cuts: Indices | None = None, longest: int = _CONFIG.bridged
) -> list[Grid]:
    """Return the grids of the stamps `t` [s].

    A new one begins where time steps back, after more than `longest` missing samples, and at
    `cuts`.

    Raises:
        InputRejected: T05, the clock wanders so far that samples fall on each other's places.
    """
    step = np.diff(t) / sample_time
    new = (step <= 0.0) | (step > longest + 1.5)
    if cuts is not None:
        new[cuts[(cuts > 0) & (cuts < len(t))] - 1] = True
    borders = np.concatenate([[0], np.flatnonzero(new) + 1, [len(t)]])
    found, crowded = [], 0
    for first, last in pairwise(borders.tolist()):
        since = t[first:last] - t[first]
        count = np.diff(since) / sample_time
        whole, unit = np.rint(count), sample_time
        if len(count) and np.abs(count - whole).max() < 0.25 and whole.min() >= 1:
            unit = float(since[-1] / whole.sum())  # the clock's own step: it may run a little fast
        place = np.rint(since / unit).astype(np.intp)
        crowded += int(np.count_nonzero(np.diff(place) == 0))
        found.append(Grid(first, last, unit, place))
    if crowded > _CONFIG.crowded * len(t):
        words = f"the clock is too uneven: {crowded} of {len(t)} samples lie on another's place"
        raise InputRejected("T05", words, remedy=_EVEN)
    return found


def lay_on(y: Array, grid: Grid) -> Array:
    """Return `y` (rows, joints) of one grid at its places, NaN where nothing was measured."""
    out = np.full((grid.size, *y.shape[1:]), np.nan)
    out[grid.place] = y
    return out


def on_grid(y: Array, grid: Grid, sample_time: float, track: Tracker) -> tuple[Array, Array]:
    """Return states and deviations (order, rows, joints) of `y` (rows, joints).

    `track` counts in `sample_time`: a derivative of order i grows by (nominal / own)^i.
    """
    states, std = track(lay_on(y, grid))
    ratio = sample_time / grid.step
    if abs(ratio - 1.0) < 1e-9:
        return states[:, grid.place], std[:, grid.place]
    scale = (ratio ** np.arange(len(states)))[:, None, None]
    return states[:, grid.place] * scale, std[:, grid.place] * scale


def grid(start: float, end: float, rate: float) -> Array:
    """Return even time stamps [s] from `start` on, `rate` a second, none after `end`."""
    # a millionth of a step of slack: 10 s at 400 Hz are 4001 samples in spite of rounding
    count = int(np.floor((end - start) * rate + 1e-6)) + 1
    return start + np.arange(max(0, count)) / rate


def resample(
    t: Array, values: Array, at: Array, method: Literal["spline", "linear"] = "spline"
) -> Array:
    """Return `values` (samples,) or (samples, k), taken at increasing `t`, at the times `at`.

    The natural cubic spline is the noise-free limit of the smoother of an integrated Wiener process
    (Wahba 1978, eq. (1.4)): it adds nothing but the smoothest motion between the samples.
    """
    if method == "linear" or t.size < 4:
        columns = np.atleast_2d(values.T)
        laid = np.stack([np.interp(at, t, column) for column in columns], axis=-1)
        return laid.reshape(at.shape + values.shape[1:])
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(t, values, axis=0, bc_type="natural")
    return np.asarray(spline(at), dtype=np.float64)


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

    Positions and measured torques are splines through the instants, a held command is its average
    over each step. Lost samples within a stretch are bridged by the spline; a gap remains a gap,
    and missing or spoilt samples remain so.

    Raises:
        InputRejected: T05, samples lie on each other.
    """
    if good.time.jitter <= _CONFIG.even or not good.runs:
        return None
    step = log.sample_time if good.time.known else good.time.median
    parts, stretches, done = [], [], 0
    for run in good.runs:
        stamps = good.log.t[run]
        q = np.where(good.position_spikes[run], np.nan, good.log.q[run])
        t, _ = instants(stamps, _filled(stamps, q), step)
        at = grid(float(t.min()), float(t.max()), 1.0 / step)
        parts.append((at, *_sampled(good, run, q, t, at, step)))
        stretches.append((run, slice(done, done + len(at)), t))
        done += len(at)
    t, q, tau, saturated = (np.concatenate(part) for part in zip(*parts, strict=True))
    values = {"t": t, "q": q, "tau": tau}
    signals = {name: replace(good.log.signals[name], values=x) for name, x in values.items()}
    even = replace(log, signals=signals, sample_time=step, derived=None)
    return Evened(even, replace(usable(even), saturated=saturated > 0.0), tuple(stretches))


def _sampled(
    good: Usable, run: slice, q: Array, t: Array, at: Array, step: float
) -> tuple[Array, Array, Array]:
    """Return position, torque and saturation (n, joints) of one stretch at even times."""
    tau = np.where(good.torque_spikes[run], np.nan, good.log.tau[run])
    lost = np.hstack([np.isnan(q), np.isnan(tau), good.saturated[run]]).astype(np.float64)
    order = np.argsort(t, kind="stable")
    order = order[np.diff(t[order], prepend=-np.inf) >= _CONFIG.closest * step]
    if len(order) < (1.0 - _CONFIG.merged) * len(t):
        words = f"the clock is too uneven: {len(t) - len(order)} of {len(t)} samples lie on "
        where = good.log.source or good.log.name
        raise InputRejected("T05", f"{words}another's place", where=where, remedy=_EVEN)
    instant = t[order]
    q, tau = (_filled(t, x)[order] for x in (q, tau))
    if good.log.torque == "measured":
        tau = resample(instant, tau, at)
    else:
        tau = average_held(instant, tau, at, step)
    q = resample(instant, q, at)
    no_q, no_tau, saturated = np.split(resample(instant, lost[order], at, "linear"), 3, axis=1)
    return np.where(no_q > 0.0, np.nan, q), np.where(no_tau > 0.0, np.nan, tau), saturated


def _filled(t: Array, x: Array) -> Array:
    """Return `x` (samples, joints) with straight lines where it is not a number."""
    out = np.array(x)
    for column in out.T:
        ill = ~np.isfinite(column)
        column[ill] = 0.0 if ill.all() else np.interp(t[ill], t[~ill], column[~ill])
    return out


def average_held(t: Array, u: Array, at: Array, step: float) -> Array:
    """Return the means (n, k) over [at, at + step] of `u` (samples, k), held from sample on.

    u acts from t_k to t_{k+1}: its integral U is piecewise linear, the mean (U(b) - U(a)) / step.
    """
    edge = np.append(t, t[-1] + step)
    total = np.vstack([np.zeros((1, u.shape[1])), np.cumsum(np.diff(edge)[:, None] * u, axis=0)])
    moved = [np.interp(at + step, edge, x) - np.interp(at, edge, x) for x in total.T]
    return np.asarray(np.stack(moved, axis=1) / step)


def instants(stamps: Array, q: Array, step: float) -> tuple[Array, float]:
    """Return when the samples of one unbroken stretch were taken [s], and the share w.

    Args:
        stamps: [s] (samples,), increasing.
        q: positions [rad or m] (samples, joints), finite.
        step: [s] nominal sample time.
    """
    half = half_width(step, _CONFIG.smooth_hz, _CONFIG.order)
    tick = _ticks(stamps)
    near = np.zeros(len(q), dtype=bool)  # a lost sample
    for k in np.flatnonzero(np.diff(stamps) > 2.5 * step).tolist():
        near[max(0, k - 2 * half) : k + 2 * half + 1] = True
    keep = ~near[2 * half : -2 * half]
    if len(q) < 6 * half + 1 or not keep.any():
        return stamps, 1.0
    level = kernel(half, _CONFIG.order, 0)
    speed = apply_kernel(q, kernel(half, _CONFIG.order, 1)) / step
    inner = q[half:-half], speed * (stamps - tick)[half:-half, None]
    rest, moved = ((x[half:-half] - apply_kernel(x, level))[keep] for x in inner)
    weight, share = np.ones(rest.shape[1]), 1.0
    for _ in range(_CONFIG.passes):
        power = float(np.sum(weight * moved**2))
        if power <= 0.0:
            return stamps, 1.0
        share = float(np.clip(np.sum(weight * moved * rest) / power, 0.0, 1.0))
        weight = 1.0 / np.maximum(np.mean((rest - share * moved) ** 2, axis=0), 1e-300)
    return tick + share * (stamps - tick), share


def _ticks(stamps: Array) -> Array:
    """Return a straight line through the stamps [s], over the numbers of the samples.

    A late stamp is followed by a short interval; one long by itself is a loss of samples. A clock
    that strays from the line, as a loop that sleeps between samples, is believed.
    """
    steps = np.diff(stamps)
    excess = np.pad(steps / float(np.median(steps)) - 1.0, 1)
    either = np.minimum(np.roll(excess, 1), np.roll(excess, -1))
    least = excess + np.minimum(either, 0.0)
    count = np.arange(len(stamps)) + np.cumsum(np.maximum(0.0, np.rint(least[:-1])))
    slope, start = np.polyfit(count, stamps, 1)
    if float(np.std(stamps - start - slope * count)) > _CONFIG.closest * slope:
        return stamps
    slope, start = np.polyfit(np.rint((stamps - start) / slope), stamps, 1)
    return np.asarray(start + slope * np.rint((stamps - start) / slope))
