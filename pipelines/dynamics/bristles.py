"""Contacts that bend before they slide.

What their bending makes of a motion, and at which rate they bend.

    contact = Bristles(elastic, exponent)        or Slips(elastic, exponent), or Breaking(breakaway,
    speed) contact.along(q, v)                          (samples, states) over a motion
    contact.rate(states, v)                      d(states)/dt, for a simulation contact.bent(states)
    u, from -1 to 1: friction as a share of that of sliding

Positions and speeds are in units of the travel d (Dahl 1968; Dupont, Hayward, Armstrong & Altpeter
2002; Iwan 1966).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Array
from pipelines.dynamics.functions import ARRAYS, Functions

__all__ = ["ONE", "Breaking", "Bristles", "Slips", "sliding_level"]

ONE = 1e-6  # numerics: from an exponent of 1, within which it is 1
_SLIDES = 1e-12  # numerics: of the largest bending
_LEAST = 0.05  # numerics: exponent of elements: below, all slip as one
_ELEMENTS = 12  # numerics: that slip one after the other
_FAST = 20.0  # numerics: times the speed over which a breakaway falls: nothing of it is left
_SIDE_BY_SIDE = 256  # numerics: stretches of a motion


@dataclass(frozen=True)
class Bristles:
    """One state u. Positions and speeds are in units of d."""

    elastic: float
    exponent: float
    states = 1

    def along(self, q: Array, v: Array) -> Array:
        """Return (samples, states), relaxed at the start.

        Exact between the samples where they keep direction.
        """
        begin, side, which, travel = _strokes(q)
        at, first = 0.0, np.empty(len(begin))
        for k, (s, x) in enumerate(zip(side.tolist(), travel.tolist(), strict=True)):
            first[k] = s * at
            at = s * self._after(s * at, x)
        room, rest = np.maximum(self.elastic - first,
                                0.0), np.maximum(1.0 - np.maximum(self.elastic, first), _SLIDES)
        x = np.abs(q - q[begin[which]])
        rest = self._rest(rest[which], np.maximum(x - room[which], 0.0))
        bends = x < room[which]
        return np.asarray(side[which] * np.where(bends, first[which] + x, 1.0 - rest))[:, None]

    def _after(self, y: float, x: float) -> float:
        room = max(self.elastic - y, 0.0)
        return y + x if x < room else float(1.0
                                            - self._rest(max(1.0 - max(y, self.elastic), _SLIDES), x
                                                         - room))

    def _rest(self, rest: Any, x: Any) -> Any:
        """1 - y after sliding by `x`, a number or an array, from where it was `rest`."""
        n, e = self.exponent, self.elastic
        if abs(n - 1.0) < ONE:
            return rest * (math.exp(-x / (1.0 - e)) if isinstance(x, float) else np.exp(-x /
                                                                                        (1.0 - e)))
        power = rest ** (1.0 - n) - (1.0 - n) * x / (1.0 - e) ** n
        return (max(power, 0.0) if isinstance(x, float) else np.maximum(power, 0.0))**(1.0 /
                                                                                       (1.0 - n))

    def rate(self, states: Array, v: Array) -> Array:
        return np.asarray(self.rate_of(states[:, 0], v, ARRAYS))[:, None]

    def rate_of(self, u: Any, v: Any, m: Functions) -> Any:
        """du/dt of one state, a number or an array."""
        e = self.elastic
        y = m.where(v > 0.0, u, -u)
        slides = m.larger(1.0 - y, _SLIDES) / (1.0 - e)
        slides = slides if self.exponent == 1.0 else slides**self.exponent
        return v * m.where(y < e, 1.0, m.where(y < 1.0, slides, 1.0 - y))

    def bent(self, states: Array) -> Array:
        return np.asarray(states[:, 0])


@dataclass(frozen=True)
class Slips:
    """u = Σ w_i z_i, one state z_i an element.

    y(x) = -1 + 2 Σ w_i min(x/X_i, 1) has the curvature of the bristles' y(x) if w(X) dX = -½ X
    y″(X) dX = ½ X dg, where the slope g = y' falls from 1 to 0 along X = 1 + e + (1 - e)(1 - g^(1/n
    - 1))/(1 - n): one element for each of equal parts of g, at their means of X.
    """

    elastic: float
    exponent: float
    states = _ELEMENTS

    @property
    def _travels(self) -> Array:
        """X: from a reversal while sliding until it slides again."""
        g, n = np.linspace(1.0, 0.0, _ELEMENTS + 1), max(self.exponent, _LEAST)
        if abs(n - 1.0) < ONE:
            mean = -_ELEMENTS * np.diff(g * (1.0 - np.log(np.maximum(g, _SLIDES))))
        else:
            mean = (1.0 + _ELEMENTS * n * np.diff(g ** (1.0 / n))) / (1.0 - n)
        return np.asarray(1.0 + self.elastic + (1.0 - self.elastic) * mean)

    def along(self, q: Array, v: Array) -> Array:
        """Return (samples, states), relaxed at the start.

        Exact between the samples where they keep direction.
        """
        begin, side, which, travel = _strokes(q)
        half = 0.5 * self._travels
        at, first = np.zeros(_ELEMENTS), np.empty((len(begin), _ELEMENTS))
        steps = (side * travel)[:, None] / half
        for k, step in enumerate(steps):
            first[k] = at
            at = np.minimum(np.maximum(at + step, -1.0), 1.0)
        return np.asarray(np.clip(first[which] + (q - q[begin[which]])[:, None] / half, -1.0, 1.0))

    @property
    def _weights(self) -> Array:
        return 0.5 * self._travels / _ELEMENTS

    def rate(self, states: Array, v: Array) -> Array:
        """Return what a step went too far comes back with travel."""
        s = np.sign(v)[:, None]
        return np.asarray(
            np.abs(v)[:, None] * np.where(s * states < 1.0, s, s - states) * 2.0 / self._travels)

    def bent(self, states: Array) -> Array:
        return np.asarray(states @ self._weights)


@dataclass(frozen=True)
class Breaking:
    """One state u.

    It slides at the less the faster it goes, and forgets over a travel that hangs on the speed.
    """

    breakaway: float
    speed: float
    states = 1

    def along(self, q: Array, v: Array) -> Array:
        """Return (samples, states), relaxed at the start.

        Exact between the samples where they keep speed and direction.
        """
        step = np.diff(q)
        level = sliding_level(0.5 * (v[1:] + v[:-1]), self.breakaway, self.speed)
        kept = np.exp(-np.abs(step) / level)
        return _recursion(kept, np.sign(step) * level * (1.0 - kept))[:, None]

    def rate(self, states: Array, v: Array) -> Array:
        return np.asarray(self.rate_of(states[:, 0], v, ARRAYS))[:, None]

    def rate_of(self, u: Any, v: Any, m: Functions) -> Any:
        """du/dt of one state, a number or an array."""
        level = sliding_level(v, self.breakaway, self.speed, m)
        return v * (1.0 - m.sign(v) * u / level)

    def bent(self, states: Array) -> Array:
        return np.asarray(states[:, 0])


def sliding_level(v: Any, breakaway: float, speed: float, m: Functions = ARRAYS) -> Any:
    """h(v)"""
    over = m.smaller(abs(v), _FAST * speed) / speed
    return 1.0 + breakaway * m.exp(-over * over)


def _recursion(kept: Array, added: Array) -> Array:
    """Return (steps + 1,) x_(k+1) = kept_k x_k + added_k from 0.

    Worked out in many stretches side by side that are then joined.
    """
    long = max(1, -(-len(kept) // _SIDE_BY_SIDE))
    a, b = np.ones(_SIDE_BY_SIDE * long), np.zeros(_SIDE_BY_SIDE * long)
    a[:len(kept)], b[:len(kept)] = kept, added
    a, b = (np.ascontiguousarray(x.reshape(_SIDE_BY_SIDE, long).T) for x in (a, b))
    for k in range(1, long):
        b[k] += a[k] * b[k - 1]
        a[k] *= a[k - 1]
    first = [0.0]
    for factor, more in zip(a[-1, :-1].tolist(), b[-1, :-1].tolist(), strict=True):
        first.append(factor * first[-1] + more)
    return np.append(0.0, (a * np.array(first) + b).T.ravel()[:len(kept)])


def _strokes(q: Array) -> tuple[npt.NDArray[np.intp], Array, npt.NDArray[np.intp], Array]:
    """Of every stroke its first sample, direction and length; of every sample its stroke.

    One of length 0 where nothing moves.
    """
    step = np.diff(q)
    moved = np.flatnonzero(step)
    if not moved.size:
        return np.zeros(1, dtype=np.intp), np.ones(1), np.zeros(len(q), dtype=np.intp), np.zeros(1)
    side = np.sign(step[moved])
    # where in `moved` a direction begins
    turns = np.concatenate(([0], np.flatnonzero(np.diff(side)) + 1))
    begin = moved[turns]
    which = np.maximum(np.searchsorted(begin, np.arange(len(q)), side="right") - 1, 0)
    return begin, side[turns], which, np.abs(np.diff(q[np.append(begin, len(q) - 1)]))
