"""A first-order lag, T dy/dt = x - y, exact for what x does between the samples.

lagging(x, t, T)        x goes straight from sample to sample
held_mean(u, h, T)      u is held over each sample; y is averaged over it
rate_of_change(x, t)    dx/dt by differences, not across gaps
continuous(T, h)        the lag of a filter computed once a sample, and how much sooner it acts
later(x, t, by)         x a little later
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import numpy.typing as npt

__all__ = ["continuous", "held_mean", "lagging", "later", "rate_of_change"]

Array = npt.NDArray[np.float64]

_NOTHING = 1e-22  # numerics: a start that has died out
_GAP = 1.5  # numerics: sample times
_MANY = 500.0  # numerics: time constants in a sample: no lag is left


def lagging(
    x: Array,
    t: Array,
    time_constant: float,
    start: Array | float | None = None,
    since: int = 0,
    digital: bool = False,
) -> Array:
    """Return y (…, samples) of x, settled at the start and behind every gap of t [s].

        y_{k+1} = a y_k + (m - a) x_k + (1 - m) x_{k+1},   a = exp(-h/T),   m = (1 - a) T/h

    Args:
        start: of y up to sample `since`, instead of a settled one.
        digital: m = a.
    """
    if time_constant <= 0.0 or len(t) <= 1:
        return np.array(x, dtype=np.float64)
    y = np.empty(x.shape)
    for part, h in _stretches(t):
        own = np.array(x[..., part].reshape(-1, part.stop - part.start), dtype=np.float64)
        a, m = _decay(h, time_constant)
        m = a if digital else m
        moved = (m - a) * own[:, :-1] + (1.0 - m) * own[:, 1:]
        drive = np.concatenate([own[:, :1], moved], axis=1)
        first = since if start is not None and part.start == 0 and since < own.shape[1] else 0
        if start is not None and part.start == 0:
            drive[:, first], own[:, :first] = start, start
        own[:, first:] = _recursion(a, drive[:, first:])
        y[..., part] = own.reshape(x[..., part].shape)
    return y


def held_mean(u: Array, h: float, time_constant: float) -> Array:
    """Mean of y over each sample of h [s] in which u (samples, …) is held; y starts at zero."""
    if time_constant <= 0.0:
        return np.array(u, dtype=np.float64)
    a, m = _decay(h, time_constant)
    flat = u.reshape(len(u), -1)
    drive = np.concatenate([np.zeros((flat.shape[1], 1)), (1.0 - a) * flat[:-1].T], axis=1)
    before = _recursion(a, drive).T.reshape(u.shape)
    return np.asarray(u + m * (before - u))


def rate_of_change(x: Array, t: Array) -> Array:
    """Return dx/dt (samples,) by central differences, one-sided at ends and gaps."""
    out = np.zeros(len(x))
    if len(x) <= 1:
        return out
    for part, _ in _stretches(t):
        if part.stop - part.start > 1:
            out[part] = np.gradient(x[part], t[part])
    return out


def continuous(time_constant: float, h: float) -> tuple[float, float]:
    """Return a continuous lag [s] and by how much [s] a digital one of T acts sooner: half of h.

    h / (e^(h/T) - 1) + h/2 = T (1 + (h/T)²/12 - …)
    """
    if h <= 0.0 or time_constant * _MANY <= h:
        return time_constant * float(h <= 0.0), 0.0
    return h / float(np.expm1(h / time_constant)) + 0.5 * h, 0.5 * h


def later(x: Array, t: Array, by: float) -> Array:
    """Return x(t + `by`) (samples,) by Taylor's series, of a time [s] in which x changes little."""
    if by == 0.0:
        return x
    once = rate_of_change(x, t)
    return np.asarray(x + by * once + 0.5 * by**2 * rate_of_change(once, t))


def _decay(h: float, time_constant: float) -> tuple[float, float]:
    """exp(-h/T), and its mean over the step."""
    ratio = h / time_constant
    return float(np.exp(-ratio)), float(-np.expm1(-ratio) / ratio)


def _recursion(a: float, drive: Array) -> Array:
    """y_0 = d_0, y_{k+1} = a y_k + d_{k+1} of `drive` (channels, samples), by doubling."""
    y, shift = np.array(drive), 1
    while shift < y.shape[1] and a > _NOTHING:
        y[:, shift:] += a * y[:, :-shift]
        a, shift = a * a, 2 * shift
    return y


def _stretches(t: Array) -> Iterator[tuple[slice, float]]:
    """Parts of t (samples,) without a gap, and the time of a sample [s]."""
    steps = np.diff(t)
    h = float(np.median(steps))
    ends = [0, *(np.flatnonzero((steps > _GAP * h) | (steps <= 0.0)) + 1).tolist(), len(t)]
    return ((slice(a, b), h) for a, b in pairwise(ends))
