"""Choose the speed of the tip: fast within a piece, slow between pieces, at rest in corners.

Kostić et al. 2004, eq. (9) and Fig. 2(b): v(t) is continuous with fast and slow phases.

    fast     the speed within a piece that is long enough
    slow     the speed in a bend, from a line into its tangent arc: ẍ jumps there by slow²/radius
    corners  where the direction jumps the tip stops, else the acceleration would be infinite. The
             paper's tip does not stop, and its joint speeds jump (Fig. 3)

A change of speed is v = v0 + (v1 - v0)(10 r³ - 15 r⁴ + 6 r⁵), r = t/T: acceleration and jerk are
continuous.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Array
from pipelines.errors import UsageError
from pipelines.writing.path import TipPath

__all__ = ["Pace", "TimeLaw", "largest", "time_law"]

STEEPEST = 1.875  # numerics: largest slope of 10 r³ - 15 r⁴ + 6 r⁵
MOST_BENT = 10.0 / 3.0**0.5  # numerics: largest second derivative of it
HALVINGS = 60  # numerics: nothing is left of an interval of doubles
SHORTEST = 1e-12  # numerics: [s] a shorter phase is rounding


@dataclass(frozen=True)
class Pace:
    """How fast a text is written."""

    fast: float = 0.6  # [m/s]
    slow: float = 0.05  # [m/s]
    acceleration: float = 6.0  # [m/s^2] largest along the path, and across it in an arc
    jerk: float = 300.0  # [m/s^3] largest along the path

    def __post_init__(self) -> None:
        rates = (self.fast, self.acceleration, self.jerk)
        positive = all(math.isfinite(rate) and rate > 0.0 for rate in rates)
        if not positive or not 0.0 <= self.slow <= self.fast:
            raise UsageError(
                "C02",
                f"a pace of {self.fast:g} m/s, {self.slow:g} m/s in slow phases, "
                f"{self.acceleration:g} m/s^2 and {self.jerk:g} m/s^3",
                where="pace",
                remedy="give a speed, acceleration and jerk above 0, and slow phases from 0 to "
                "the speed",
            )

    def slowed(self, factor: float) -> Pace:
        """Return the pace that follows the same path in 1/factor of the time."""
        return Pace(
            self.fast * factor,
            self.slow * factor,
            self.acceleration * factor**2,
            self.jerk * factor**3,
        )

    def seconds(self, v0: float, v1: float) -> float:
        """Return how long a change of speed takes [s] at the largest acceleration and jerk."""
        change = abs(v1 - v0)
        return max(STEEPEST * change / self.acceleration, math.sqrt(MOST_BENT * change / self.jerk))

    def distance(self, v0: float, v1: float) -> float:
        """Return how far the tip goes meanwhile [m], by its mean speed."""
        return 0.5 * (v0 + v1) * self.seconds(v0, v1)


@dataclass(frozen=True, eq=False)
class TimeLaw:
    """Arc length over time: phases of constant or smoothly changing speed."""

    start: Array  # (phases + 1,) [s] when each phase starts, and when the last one ends
    s: Array  # (phases,) [m] where each phase starts
    before: Array  # (phases,) [m/s] speed at its start
    after: Array  # (phases,) [m/s] speed at its end
    piece: npt.NDArray[np.intp]  # (phases,) the piece of the path it is on

    @property
    def duration(self) -> float:  # [s]
        return float(self.start[-1])

    def phase(self, t: Array) -> npt.NDArray[np.intp]:
        """Return the phase (samples,) at each time, the first before and the last after."""
        return np.clip(np.searchsorted(self.start, t, side="right") - 1, 0, len(self.s) - 1)

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Return arc length [m], speed [m/s] and acceleration [m/s^2] along the path, (samples,).

        s = s0 + T (v0 r + (v1 - v0)(2.5 r⁴ - 3 r⁵ + r⁶));  s̈ = (v1 - v0) 30 r² (1 - r)² / T
        """
        k = self.phase(t)
        length = np.diff(self.start)[k]  # [s]
        r = np.clip((t - self.start[k]) / length, 0.0, 1.0)
        v0, rise = self.before[k], self.after[k] - self.before[k]
        s = self.s[k] + length * (v0 * r + rise * r**4 * (2.5 - 3.0 * r + r * r))
        speed = v0 + rise * r**3 * (10.0 - 15.0 * r + 6.0 * r * r)
        return s, speed, rise * 30.0 * (r * (1.0 - r)) ** 2 / length


def time_law(path: TipPath, pace: Pace) -> TimeLaw:
    """Return the time law: each piece as fast as the pace, its length and curvature allow."""
    caps = [min(pace.fast, math.sqrt(pace.acceleration * piece.radius)) for piece in path.pieces]
    lengths = [piece.length for piece in path.pieces]
    speeds = [
        0.0,
        *(
            0.0 if joint == "corner" else min(pace.slow, one, two)
            for joint, (one, two) in zip(path.joints, pairwise(caps), strict=True)
        ),
        0.0,
    ]
    for k, length in enumerate(lengths):  # not faster than can be reached from the joint before
        speeds[k + 1] = _reachable(pace, speeds[k], speeds[k + 1], length)
    for k in reversed(range(len(lengths))):  # nor than can still be slowed down
        speeds[k] = _reachable(pace, speeds[k + 1], speeds[k], lengths[k])
    times, phases = [0.0], []
    for k, (v0, v1) in enumerate(pairwise(speeds)):
        top = _top(pace, v0, v1, caps[k], lengths[k])
        rest = lengths[k] - pace.distance(v0, top) - pace.distance(top, v1)
        s = float(path.starts[k])
        for one, two, seconds in (
            (v0, top, pace.seconds(v0, top)),
            (top, top, max(rest, 0.0) / top),
            (top, v1, pace.seconds(top, v1)),
        ):
            if seconds > SHORTEST:
                phases.append((s, one, two, k))
                times.append(times[-1] + seconds)
                s += 0.5 * (one + two) * seconds
    where, before, after, pieces = map(np.array, zip(*phases, strict=True))
    return TimeLaw(np.array(times), where, before, after, pieces)


def _reachable(pace: Pace, start: float, wish: float, length: float) -> float:
    """Return the largest speed up to `wish` that is reached from `start` over `length`."""
    if wish <= start:
        return wish
    return largest(lambda v: pace.distance(start, v) <= length, start, wish)


def _top(pace: Pace, v0: float, v1: float, cap: float, length: float) -> float:
    """Return the largest speed up to `cap` between v0 and v1 on a piece of this length."""
    return largest(
        lambda v: pace.distance(v0, v) + pace.distance(v, v1) <= length, max(v0, v1), cap
    )


def largest(fits: Callable[[float], bool], low: float, high: float) -> float:
    """Return the largest number from `low` to `high` that fits, where all below it fit too."""
    if fits(high):
        return high
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low
