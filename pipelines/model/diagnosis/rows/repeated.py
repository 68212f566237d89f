"""What differs from one period to the next of a motion that comes again: nothing else of a residual can be noise.

    power = unrepeated(data, left)        (joints,) [N m^2] mean square; NaN where no log repeats its motion

Friction that bends before it slides, where no law has that, leaves a residual without a quiet moment, whose spectrum passes for
that of a drive; but in each period it leaves the same. Of noise r with r(t + T) independent of r(t)

    ½ mean (r(t + T) - r(t))² = mean r²

and what repeats is not in it, whatever it is. An arm that starts from rest has not settled at first: then there is more.
"""

from __future__ import annotations

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.rows.data import Data, LogData

__all__ = ["unrepeated"]

_FEWEST = 100  # pairs of rows of a joint: fewer say little
_OFF = 0.1  # of the spacing of rows, by which four of them may be unevenly apart
_SHORTEST = 1.0  # [s] of a period: after less, what wanders is still where it was


def unrepeated(data: Data, left: Array) -> Array:
    """Of a residual `left` (rows,) [N m]."""
    square, count = np.zeros(data.n_joints), np.zeros(data.n_joints)
    for one, x in zip(data.logs, data.split(left), strict=True):
        if one.log.period is None or one.log.period < _SHORTEST:
            continue
        here, there = _a_period_later(one, x, one.log.period)
        square += 0.5 * np.square(here - there).sum(axis=1, where=np.isfinite(here - there))
        count += np.isfinite(here - there).sum(axis=1)
    return np.where(count >= _FEWEST, square / np.maximum(count, 1.0), np.nan)


def _a_period_later(one: LogData, x: Array, period: float) -> tuple[Array, Array]:
    """(joints, pairs) of `x` (joints, rows), and of the cubic through four rows a period [s] later; NaN of what does not count."""
    known = np.where(one.weighed, x, np.nan)
    if len(one.t) < 4:
        return known[:, :0], known[:, :0]
    step = float(np.median(np.diff(one.t)))
    at = np.searchsorted(one.t, one.t + period + _OFF * step, side="right") - 1  # the row before, or at that time
    inside = (at >= 1) & (at <= len(one.t) - 3)
    at = np.clip(at, 1, len(one.t) - 3)
    inside &= np.abs(one.t[at + 2] - one.t[at - 1] - 3.0 * step) < _OFF * step
    part = np.maximum((one.t + period - one.t[at]) / step, 0.0)
    inside &= part < 1.0
    four = (-part * (part - 1.0) * (part - 2.0) / 6.0, (part + 1.0) * (part - 1.0) * (part - 2.0) / 2.0,
            -(part + 1.0) * part * (part - 2.0) / 2.0, (part + 1.0) * part * (part - 1.0) / 6.0)
    there = sum((weight * known[:, at + k] for k, weight in enumerate(four, -1)), np.zeros_like(known))
    return known[:, inside], np.asarray(there[:, inside])
