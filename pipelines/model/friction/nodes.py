"""Where the integrals of a joint's motion are summed: few nodes where its speed runs on, several where friction may turn over.

One node a sample's interval; eight where speed passes zero in it, for friction jumps there; two for several samples whose speed
keeps its sign and most of its size. Those two stand at the samples' mean speed ± its standard deviation, the rule of Gauss
for a speed that runs straight, and right in the mean however it runs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.model.rigid.body import Array, Motion

__all__ = ["Nodes", "lay_nodes"]

_PARTS = 8  # of an interval in which speed passes zero
_NEAR = 2.0  # changes of speed within a sample: nearer to zero, the sign of friction may turn over inside
_LITTLE = 1e-4  # of the fastest speed: what creeps more slowly does not need its every sample
_STEADY = 8.0  # times its standard deviation: so large is the mean of a speed that keeps its sign and most of its size
_GAUSS = 0.5 / np.sqrt(3.0)  # of their time, from its middle: where the two nodes lie
_COARSEST = 1e-2  # [s] of the samples that two nodes stand for


@dataclass(frozen=True, eq=False)
class Nodes:
    """Nodes in the order of time, and what each stands for."""

    motion: Motion  # (nodes, 1)
    ends: Array  # [s] (nodes + 1,) from where to where
    sample: npt.NDArray[np.intp]  # (nodes,) the sample before


def lay_nodes(t: Array, q: Array, dq: Array, window: int) -> Nodes:
    """Lay nodes along a motion; none stands for samples on both sides of a multiple of `window`.

    Args:
        t, q, dq: (samples,) time, position and speed; speed runs straight from sample to sample.
    """
    change, middle = np.diff(dq), 0.5 * (dq[1:] + dq[:-1])
    size = _group(t, window)
    parts, span = np.ones(len(change), dtype=np.int8), np.ones(len(change), dtype=np.int8)
    little = _LITTLE * float(np.abs(dq).max())
    mean, spread = np.zeros(0), np.zeros(0)
    if size > 2:
        whole = len(change) // size * size
        steady, mean, spread = _steady(middle[:whole].reshape(-1, size), change[:whole].reshape(-1, size), little)
        parts[:whole].reshape(-1, size)[steady] = 0
        parts[:whole:size][steady], span[:whole:size][steady] = 2, size
    alone = np.flatnonzero(parts == 1)
    size_of, there = np.abs(change[alone]), middle[alone]
    turning = (np.abs(there) < (_NEAR + 0.5) * size_of) & (size_of > little)
    parts[alone[turning]] = _PARTS
    first = np.flatnonzero(parts > 0)
    count = parts[first].astype(np.intp)
    at = np.repeat(first, count)
    step = np.arange(len(at)) - np.repeat(np.cumsum(count) - count, count)
    reach, pair = span[at], span[at] > 1
    part = 1.0 / np.repeat(count, count)
    share = step * part
    place = np.where(pair, 0.5 + _GAUSS * (2.0 * step - 1.0), share + 0.5 * part) * reach  # in samples after `at`
    begin, length = t[at], t[at + reach] - t[at]
    below = place.astype(np.intp)
    beyond, below = place - below, at + below
    v = dq[at] + place * change[at]
    run = np.flatnonzero(pair)
    group = at[run] // size
    away = np.copysign(spread[group], dq[at[run] + size] - dq[at[run]])
    v[run] = mean[group] + np.where(step[run] == 0, -away, away)
    ddq = (dq[at + reach] - dq[at]) / length
    return Nodes(Motion(begin + place / reach * length, (q[below] + beyond * (q[below + 1] - q[below]))[:, None], v[:, None],
                        ddq[:, None]), np.append(begin + share * length, t[-1]), at)


def _group(t: Array, window: int) -> int:
    """Samples that two nodes may stand for: a divisor of the window."""
    most = min(window, int(_COARSEST * (len(t) - 1) / float(t[-1] - t[0]) + 1e-9))
    return max(size for size in range(1, max(most, 1) + 1) if window % size == 0)


def _steady(middle: Array, change: Array, little: float) -> tuple[npt.NDArray[np.bool_], Array, Array]:
    """Return whether the speed of each group of intervals keeps its sign, its mean and its standard deviation in time (groups,)."""
    each = np.full(middle.shape[1], 1.0 / middle.shape[1])
    mean = middle @ each
    square = np.square(middle - mean[:, None]) @ each + np.square(change) @ each / 12.0
    size = np.square(mean)
    return (size > _STEADY**2 * square) | (size + square < little**2 / 4.0), mean, np.sqrt(square)
