"""The speed of the tip along its path: fast within a piece, slow from piece to piece, at rest in corners.

Kostić et al. 2004, eq. (9) and Fig. 2(b): v(t) = sqrt(ẋ² + ż²) is continuous, with fast and slow phases, and free to choose. Here

    fast     the speed that the tip reaches within a piece, where it is long enough
    slow     the speed at which it passes a bend, from a line into its tangent arc: there ẍ jumps by slow²/radius, the curvature
             being what it is, which stays small; with slow = 0 it stops, and nothing jumps anywhere
    corners  where the direction jumps the tip stops: at any other speed the acceleration would be infinite. The paper's tip does
             not stop there, and its joint speeds jump (Fig. 3); no drive can follow that, and what a controller then does says
             nothing of the model.

From one speed to another it goes by v = v0 + (v1 - v0)(10 r³ - 15 r⁴ + 6 r⁵), r = t/T: acceleration and jerk are continuous.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from pipelines.errors import UsageError
from pipelines.model.rigid.body import Array
from pipelines.model.writing.path import TipPath

__all__ = ["Pace", "TimeLaw", "time_law"]

_STEEPEST = 1.875  # largest slope of 10 r³ - 15 r⁴ + 6 r⁵
_BENT = 10.0 / math.sqrt(3.0)  # largest second derivative of it
_HALVINGS = 60  # each halves the interval: 60 leave nothing of it
_SHORTEST = 1e-12  # [s] a phase shorter than this is rounding


@dataclass(frozen=True)
class Pace:
    """How fast a text is written."""

    fast: float = 0.6  # [m/s]
    slow: float = 0.05  # [m/s]
    acceleration: float = 6.0  # [m/s^2] largest along the path, and largest across it, in an arc
    jerk: float = 300.0  # [m/s^3] largest along the path

    def __post_init__(self) -> None:
        rates = (self.fast, self.acceleration, self.jerk)
        if not all(math.isfinite(rate) and rate > 0.0 for rate in rates) or not 0.0 <= self.slow <= self.fast:
            raise UsageError("C02", f"a pace of {self.fast:g} m/s, {self.slow:g} m/s in slow phases, "
                             f"{self.acceleration:g} m/s^2 and {self.jerk:g} m/s^3", where="pace",
                             remedy="give a speed, acceleration and jerk above 0, and slow phases from 0 to the speed")

    def slowed(self, factor: float) -> Pace:
        """The pace at which everything happens at `factor` times the speed: the same path in 1/factor of the time."""
        return Pace(self.fast * factor, self.slow * factor, self.acceleration * factor**2, self.jerk * factor**3)


@dataclass(frozen=True, eq=False)
class TimeLaw:
    """Arc length as a function of time: phases of constant or smoothly changing speed."""

    start: Array  # (phases + 1,) [s] when each phase starts, and when the last one ends
    s: Array  # (phases,) [m] where each phase starts
    before: Array  # (phases,) [m/s] speed at its start
    after: Array  # (phases,) [m/s] speed at its end
    piece: npt.NDArray[np.intp]  # (phases,) the piece of the path it is on

    @property
    def duration(self) -> float:  # [s]
        return float(self.start[-1])

    def phase(self, t: Array) -> npt.NDArray[np.intp]:
        """The phase (samples,) at each time; before the start the first, after the end the last."""
        return np.clip(np.searchsorted(self.start, t, side="right") - 1, 0, len(self.s) - 1)

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Arc length [m], speed [m/s] and acceleration along the path [m/s^2], each (samples,); at rest before and after.

            s = s0 + T (v0 r + (v1 - v0)(2.5 r⁴ - 3 r⁵ + r⁶));  s̈ = (v1 - v0) 30 r² (1 - r)² / T
        """
        k = self.phase(t)
        length = np.diff(self.start)[k]  # [s]
        r = np.clip((t - self.start[k]) / length, 0.0, 1.0)
        v0, rise = self.before[k], self.after[k] - self.before[k]
        s = self.s[k] + length * (v0 * r + rise * r**4 * (2.5 - 3.0 * r + r * r))
        return s, v0 + rise * r**3 * (10.0 - 15.0 * r + 6.0 * r * r), rise * 30.0 * (r * (1.0 - r))**2 / length


def time_law(path: TipPath, pace: Pace) -> TimeLaw:
    """The time law of `path` at `pace`: each piece as fast as the pace and its own length and curvature allow."""
    lengths = [piece.length for piece in path.pieces]
    caps = [min(pace.fast, math.sqrt(pace.acceleration * piece.radius)) for piece in path.pieces]
    speeds = _passing(path, pace, lengths, caps)
    times, where, before, after, pieces = [0.0], [], [], [], []
    for k, (length, cap, (v0, v1)) in enumerate(zip(lengths, caps, pairwise(speeds), strict=True)):
        at = float(path.starts[k])
        top = _top(v0, v1, cap, length, pace)
        rest = length - _distance(v0, top, pace) - _distance(top, v1, pace)
        for one, two, seconds in ((v0, top, _seconds(v0, top, pace)), (top, top, max(rest, 0.0) / top),
                                  (top, v1, _seconds(top, v1, pace))):
            if seconds > _SHORTEST:
                where.append(at)
                before.append(one)
                after.append(two)
                pieces.append(k)
                times.append(times[-1] + seconds)
                at += 0.5 * (one + two) * seconds
    return TimeLaw(np.array(times), np.array(where), np.array(before), np.array(after), np.array(pieces, dtype=np.intp))


def _seconds(v0: float, v1: float, pace: Pace) -> float:
    """How long a change of speed takes [s] at the largest acceleration and jerk."""
    change = abs(v1 - v0)
    return max(_STEEPEST * change / pace.acceleration, math.sqrt(_BENT * change / pace.jerk))


def _distance(v0: float, v1: float, pace: Pace) -> float:
    """How far the tip goes meanwhile [m]: the change is symmetric about its mean speed."""
    return 0.5 * (v0 + v1) * _seconds(v0, v1, pace)


def _passing(path: TipPath, pace: Pace, lengths: list[float], caps: list[float]) -> list[float]:
    """The speed at the start, at each joint, and at the end, (pieces + 1,) [m/s]: such that every piece is long enough."""
    inner = [0.0 if joint == "corner" else min(pace.slow, one, two)
             for joint, (one, two) in zip(path.joints, pairwise(caps), strict=True)]
    speeds = [0.0, *inner, 0.0]
    for k in range(len(lengths)):  # not faster than can be reached from the joint before
        speeds[k + 1] = _reachable(speeds[k], speeds[k + 1], lengths[k], pace)
    for k in reversed(range(len(lengths))):  # not faster than what can still be slowed down to the joint behind
        speeds[k] = _reachable(speeds[k + 1], speeds[k], lengths[k], pace)
    return speeds


def _reachable(start: float, wish: float, length: float, pace: Pace) -> float:
    """The largest speed up to `wish` that is reached from `start` over `length`."""
    return wish if wish <= start else _largest(lambda v: _distance(start, v, pace) <= length, start, wish)


def _top(v0: float, v1: float, cap: float, length: float, pace: Pace) -> float:
    """The largest speed up to `cap` between v0 and v1 on a piece of this length."""
    return _largest(lambda v: _distance(v0, v, pace) + _distance(v, v1, pace) <= length, max(v0, v1), cap)


def _largest(fits: Callable[[float], bool], low: float, high: float) -> float:
    """The largest number from `low` to `high` that fits, where all below it fit too."""
    if fits(high):
        return high
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low
