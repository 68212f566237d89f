"""Presliding: before a joint slides, its contacts bend like bristles."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.functions import ARRAYS, Functions
from pipelines.effects.base import ArmModel, Effect, Hooks, OwnMemory, Values
from pipelines.effects.config import EFFECTS

__all__ = ["Presliding"]

_ONE = 1e-6  # numerics: from an exponent of 1, within which it is 1
_SLIDES = 1e-12  # numerics: of the largest bending
_LEAST = 0.05  # numerics: exponent of elements: below, all slip at once
_ELEMENTS = 12  # numerics: that slip one after the other
_FAST = 20.0  # numerics: times the speed over which a breakaway falls: nothing of it is left


@dataclass(frozen=True)
class Presliding(Effect):
    """τ = A (u + T_d du/dt): friction that turns over with travel, in the place of Coulomb
    friction.

    Along a stroke in direction s, y = s u bends with travel x = |q|/d by

        dy/dx = 1 up to y = e,  ((1 - y)/(1 - e))^n beyond

    Nothing slides up to e (Dupont, Hayward, Armstrong & Altpeter 2002, eq. (9)-(12)). e = -1 is
    Dahl 1968 with his exponent n; with n = 1 and T_d = σ1/σ0 LuGre of constant sliding friction
    (Canudas de Wit et al. 1995, eq. (1)-(3)). u is zero x_c ln 2 after a reversal while sliding.

    Where inner loops close, elements slip one after the other (Iwan 1966; Al-Bender, Lampaert &
    Swevers 2005): u = Σ w_i z_i, dz_i = 2 dx/X_i within ±1. With a breakaway b, falling over v_s
    (Canudas de Wit et al. 1995, eq. (4)),

        du/dt = v/x_c (1 - s u/h(v)),  h(v) = 1 + b exp(-(v/v_s)^2)
    """

    distance: float = 1e-2  # x_c [rad]
    elastic: float = -1.0  # e
    damping_time: float = 0.0  # T_d [s]
    exponent: float = 1.0  # n, held where it is 1
    inner_loops: float = 0.0
    breakaway: float = 0.0  # b, held where it is 0
    breakaway_speed: float = 0.1  # v_s [rad/s]

    name = "presliding"
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        contact, unit = self._contact, self._unit
        v = self.own(motion.dq) / unit
        states = contact.along(self.own(motion.q) / unit, v)
        u = contact.bent(states)
        if self.damping_time:
            u = u + self.damping_time * contact.bent(contact.rate(states, v))
        return self.on_own_row(arm, u)

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """From a ten-thousandth to a tenth of the travel."""
        travel = float(np.ptp(self.own(motion.q))) or 1.0
        fast = float(np.abs(self.own(motion.dq)).max(initial=0.0))
        slow = self.within("breakaway_speed", EFFECTS.falling * fast)
        for distance in np.geomspace(1e-4 * travel, 0.1 * travel, 13).tolist():
            yield replace(self, distance=self.within("distance", distance), breakaway_speed=slow)

    def forms(self) -> tuple[Self, ...]:
        plain = replace(self, exponent=1.0, inner_loops=0.0, breakaway=0.0)
        halfway = replace(plain, elastic=EFFECTS.halfway)
        other = replace(plain, exponent=EFFECTS.other_exponent)
        falling = replace(plain, elastic=-1.0, breakaway=EFFECTS.breakaway)
        return halfway, other, replace(other, inner_loops=1.0), falling

    @property
    def free(self) -> tuple[str, ...]:
        held = {"elastic", "exponent"} if self.breakaway else {"breakaway", "breakaway_speed"}
        return tuple(name for name in super().free if name not in held)

    def reported(self, values: Values) -> dict[str, float | tuple[float, ...]]:
        """Without a speed over which nothing falls."""
        said = super().reported(values)
        breaks = bool(values["breakaway"])
        return {name: x for name, x in said.items() if breaks or not name.startswith("breakaway")}

    def curve(self, dq: Array, arm: ArmModel, values: Values) -> Array:
        """Return its torque at constant speed: Coulomb friction, and its breakaway."""
        shaped = self.at(values)
        level = _sliding_level(dq, shaped.breakaway, shaped.breakaway_speed, ARRAYS)
        return np.asarray(values["amplitude"] * np.sign(dq) * level)

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        shaped, amplitude = self.at(values), values["amplitude"]
        contact, unit, time = shaped._contact, shaped._unit, shaped.damping_time

        def rate(motion: Motion, _: Array, states: Array) -> Array:
            return contact.rate(states, self.own(motion.dq) / unit)

        def load(motion: Motion, states: Array) -> Array:
            u = contact.bent(states) + time * contact.bent(rate(motion, states, states))
            return self.on_own_row(arm, amplitude * u)[..., 0]

        return Hooks(load=load, states=contact.states, rate=rate)

    def own_memory(self, values: Values) -> OwnMemory | None:
        shaped, amplitude = self.at(values), float(values["amplitude"])
        contact, unit, time = shaped._contact, shaped._unit, shaped.damping_time
        if not isinstance(contact, _OneState):
            return None
        return OwnMemory(
            lambda u, v, m: contact.rate_of(u, v / unit, m),
            lambda u, du: amplitude * (u + time * du),
        )

    @property
    def _contact(self) -> _OneState | _Slips:
        if self.breakaway:
            return _Breaking(self.breakaway, self.breakaway_speed / self._unit)
        kind = _Slips if self.inner_loops else _Bristles
        return kind(self.elastic, self.exponent)

    @property
    def _unit(self) -> float:
        """d [rad].

        y(x) from -1 is zero at x = 1, or where e < 0 at 1 + e + (1 - e) ln(1 - e), for n = 1.
        """
        e, n = self.elastic, self.exponent
        if self.breakaway:
            return self.distance
        if e >= 0.0:
            return self.distance * math.log(2.0)
        if abs(n - 1.0) < _ONE:
            one = (1.0 - e) * math.log(1.0 - e)
        else:
            one = ((1.0 - e) - (1.0 - e) ** n) / (1.0 - n)
        return self.distance * math.log(2.0) / (1.0 + e + one)


class _OneState(ABC):
    """A contact of one state u. Positions and speeds are in units of d."""

    states: ClassVar[int] = 1

    @abstractmethod
    def along(self, q: Array, v: Array) -> Array:
        """Return (samples, states), relaxed at the start; exact where samples keep direction."""

    @abstractmethod
    def rate_of(self, u: Any, v: Any, m: Functions) -> Any:
        """du/dt of one state, a number or an array."""

    def rate(self, states: Array, v: Array) -> Array:
        return np.asarray(self.rate_of(states[:, 0], v, ARRAYS))[:, None]

    def bent(self, states: Array) -> Array:
        return np.asarray(states[:, 0])


@dataclass(frozen=True)
class _Bristles(_OneState):
    """Y(x) of the law."""

    elastic: float
    exponent: float

    def along(self, q: Array, v: Array) -> Array:
        begin, side, which, travel = _strokes(q)
        at, first = 0.0, np.empty(len(begin))
        for k, (s, x) in enumerate(zip(side.tolist(), travel.tolist(), strict=True)):
            first[k] = s * at
            at = s * float(self._after(s * at, x))
        x = np.abs(q - q[begin[which]])
        return np.asarray(side[which] * self._after(first[which], x))[:, None]

    def _after(self, y: Any, x: Any) -> Any:
        """Return y after `x` more of travel, numbers or arrays."""
        n, e = self.exponent, self.elastic
        room = np.maximum(e - y, 0.0)
        rest, slid = np.maximum(1.0 - np.maximum(y, e), _SLIDES), np.maximum(x - room, 0.0)
        if abs(n - 1.0) < _ONE:
            rest = rest * np.exp(-slid / (1.0 - e))
        else:
            power = rest ** (1.0 - n) - (1.0 - n) * slid / (1.0 - e) ** n
            rest = np.maximum(power, 0.0) ** (1.0 / (1.0 - n))
        return np.where(x < room, y + x, 1.0 - rest)

    def rate_of(self, u: Any, v: Any, m: Functions) -> Any:
        e = self.elastic
        y = m.where(v > 0.0, u, -u)
        slides = m.larger(1.0 - y, _SLIDES) / (1.0 - e)
        slides = slides if self.exponent == 1.0 else slides**self.exponent
        return v * m.where(y < e, 1.0, m.where(y < 1.0, slides, 1.0 - y))


@dataclass(frozen=True)
class _Breaking(_OneState):
    """It slides at the less the faster it goes, and forgets over a travel by its speed."""

    breakaway: float
    speed: float

    def along(self, q: Array, v: Array) -> Array:
        step, between = np.diff(q), 0.5 * (v[1:] + v[:-1])
        level = _sliding_level(between, self.breakaway, self.speed, ARRAYS)
        kept = np.exp(-np.abs(step) / level)
        return _recursion(kept, np.sign(step) * level * (1.0 - kept))[:, None]

    def rate_of(self, u: Any, v: Any, m: Functions) -> Any:
        level = _sliding_level(v, self.breakaway, self.speed, m)
        return v * (1.0 - m.sign(v) * u / level)


@dataclass(frozen=True)
class _Slips:
    """u = Σ w_i z_i, one state z_i an element.

    y(x) = -1 + 2 Σ w_i min(x/X_i, 1) has the curvature of the bristles' y(x) if w(X) dX = -½ X
    y″(X) dX = ½ X dg, where the slope g = y' falls from 1 to 0 along X = 1 + e + (1 - e)(1 - g^(1/n
    - 1))/(1 - n): one element for each of equal parts of g, at their means of X.
    """

    elastic: float
    exponent: float

    states: ClassVar[int] = _ELEMENTS

    @property
    def _travels(self) -> Array:
        """X: from a reversal while sliding until it slides again."""
        g, n = np.linspace(1.0, 0.0, _ELEMENTS + 1), max(self.exponent, _LEAST)
        if abs(n - 1.0) < _ONE:
            mean = -_ELEMENTS * np.diff(g * (1.0 - np.log(np.maximum(g, _SLIDES))))
        else:
            mean = (1.0 + _ELEMENTS * n * np.diff(g ** (1.0 / n))) / (1.0 - n)
        return np.asarray(1.0 + self.elastic + (1.0 - self.elastic) * mean)

    def along(self, q: Array, v: Array) -> Array:
        """Return (samples, states), relaxed at the start; exact where samples keep direction."""
        begin, side, which, travel = _strokes(q)
        half = 0.5 * self._travels
        at, first = np.zeros(_ELEMENTS), np.empty((len(begin), _ELEMENTS))
        for k, step in enumerate((side * travel)[:, None] / half):
            first[k] = at
            at = np.minimum(np.maximum(at + step, -1.0), 1.0)
        return np.asarray(np.clip(first[which] + (q - q[begin[which]])[:, None] / half, -1.0, 1.0))

    def rate(self, states: Array, v: Array) -> Array:
        """Return d(states)/dt; what a step went too far comes back with travel."""
        s = np.sign(v)[:, None]
        moves = np.where(s * states < 1.0, s, s - states)
        return np.asarray(np.abs(v)[:, None] * moves * 2.0 / self._travels)

    def bent(self, states: Array) -> Array:
        return np.asarray(states @ (0.5 * self._travels / _ELEMENTS))


def _sliding_level(v: Any, breakaway: float, speed: float, m: Functions) -> Any:
    """h(v)"""
    over = m.smaller(abs(v), _FAST * speed) / speed
    return 1.0 + breakaway * m.exp(-over * over)


def _recursion(kept: Array, added: Array) -> Array:
    """Return (steps + 1,) x_(k+1) = kept_k x_k + added_k from 0: a banded triangular system."""
    from scipy.linalg.blas import dtbsv

    band = np.zeros((2, len(kept) + 1), order="F")
    band[1, :-1] = -kept
    return np.asarray(dtbsv(1, band, np.append(0.0, added), lower=1, diag=1))


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
