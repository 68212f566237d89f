"""Presliding: before a joint slides, its contacts bend like bristles."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.functions import ARRAYS, Functions
from pipelines.effects.base import (
    LARGE,
    ArmModel,
    Effect,
    Hooks,
    OwnMemory,
    Parameters,
    Quantity,
    Values,
)
from pipelines.effects.config import EFFECTS

__all__ = ["Presliding"]

_ONE = 1e-6  # numerics: from an exponent of 1, within which it is 1
_SLIDES = 1e-12  # numerics: of the largest bending
_LEAST = 0.05  # numerics: exponent of elements: below, all slip as one
_ELEMENTS = 12  # numerics: that slip one after the other
_FAST = 20.0  # numerics: times the speed over which a breakaway falls: nothing of it is left
_SIDE_BY_SIDE = 256  # numerics: stretches of a motion


@dataclass(frozen=True)
class Presliding(Effect):
    """τ = A (u + T_d du/dt): friction that turns over with travel, not with speed.

    It takes the place of as much Coulomb friction.

    Along a stroke in direction s, y = s u bends with travel x = |q|/d by

        dy/dx = 1 up to y = e,  ((1 - y)/(1 - e))^n beyond

    so that nothing slides up to e (Dupont, Hayward, Armstrong & Altpeter 2002, eq. (9)-(12), who
    take e from 0 to 1). e = -1 is Dahl 1968 with his exponent n; with n = 1 and T_d = σ1/σ0 LuGre
    of constant sliding friction (Canudas de Wit et al. 1995, eq. (1)-(3)). d is such that u is zero
    x_c ln 2 after a reversal while sliding, as with Dahl's n = 1 and distance x_c.

    Bristles know no more than how far they bend. Where inner loops close, elements that slip one
    after the other stand in their place (Iwan 1966; Al-Bender, Lampaert & Swevers 2005): u = Σ w_i
    z_i, dz_i = 2 dx/X_i within ±1, w_i and X_i such that a reversal while sliding goes as above.

    With a breakaway b more friction at standstill than at speed, which falls over v_s (Canudas de
    Wit et al. 1995, eq. (4)),

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
    parameters = Parameters(
        Quantity("amplitude", "N m", 0.0, LARGE, "friction that turns over with travel",
                 healthy=math.inf),
        Quantity("distance", "rad", 1e-6, 0.2, "travel over which it turns over", shape=True),
        Quantity("elastic", "1", -1.0, 0.9,
                 "share of the largest bending up to which nothing slides", shape=True,
                 unsaid=-1.0),
        Quantity("damping_time", "s", 0.0, 0.1, "damping of the bristles over their stiffness",
                 shape=True),
        Quantity("exponent", "1", 0.0, 3.0, "how gradually it begins to slide", shape=True,
                 unsaid=1.0, held=1.0),
        Quantity("inner_loops", "1", 0.0, 1.0, "1 where a small loop inside a large one closes",
                 shape=True, discrete=True, unsaid=0.0),
        Quantity("breakaway", "1", 0.0, 5.0,
                 "how much larger friction is at standstill than at speed", shape=True, unsaid=0.0),
        Quantity("breakaway_speed", "rad/s", 1e-3, 5.0, "speed over which it falls to that",
                 shape=True, unsaid=0.1))
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
        """From a thousandth to a tenth of the travel."""
        travel = float(np.ptp(self.own(motion.q))) or 1.0
        fast = float(np.abs(self.own(motion.dq)).max(initial=0.0))
        slow = float(np.clip(EFFECTS.falling * fast, 1e-3, 5.0))
        for distance in np.geomspace(1e-3 * travel, 0.1 * travel, 9).tolist():
            yield replace(self, distance=float(np.clip(distance, 1e-6, 0.2)), breakaway_speed=slow)

    def forms(self) -> tuple[Self, ...]:
        other = replace(self, exponent=EFFECTS.other_exponent)
        falling = replace(self, elastic=-1.0, breakaway=EFFECTS.breakaway)
        halfway, loops = replace(self, elastic=EFFECTS.halfway), replace(other, inner_loops=1.0)
        return halfway, other, loops, falling

    @property
    def free(self) -> tuple[str, ...]:
        held = {"elastic", "exponent"} if self.breakaway else {"breakaway", "breakaway_speed"}
        return tuple(name for name in super().free if name not in held)

    def reported(self, values: Values) -> dict[str, float | tuple[float, ...]]:
        """Without a speed over which nothing falls."""
        said = super().reported(values)
        return said if values["breakaway"] else {
            name: x
            for name, x in said.items() if not name.startswith("breakaway")
        }

    def curve(self, dq: Array, arm: ArmModel, values: Values) -> Array:
        """Return what is left of it at constant speed: Coulomb friction, and its breakaway."""
        shaped = self.at(values)
        return np.asarray(values["amplitude"] * np.sign(dq)
                          * sliding_level(dq, shaped.breakaway, shaped.breakaway_speed))

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
        if isinstance(contact, Slips):
            return None
        return OwnMemory(lambda u, v, m: contact.rate_of(u, v / unit, m), lambda u, du: amplitude *
                         (u + time * du))

    @property
    def _contact(self) -> Bristles | Slips | Breaking:
        if self.breakaway:
            return Breaking(self.breakaway, self.breakaway_speed / self._unit)
        return Slips(self.elastic, self.exponent) if self.inner_loops else Bristles(
            self.elastic, self.exponent)

    @property
    def _unit(self) -> float:
        """d [rad].

        Y(x) from -1 is zero at x = 1, or where e < 0 at 1 + e + (1 - e) ln(1 - e), for n = 1.
        """
        if self.breakaway:
            return self.distance
        e, n = self.elastic, self.exponent
        one = (1.0 - e) * math.log(1.0 - e) if abs(n - 1.0) < _ONE else ((1.0 - e) -
                                                                         (1.0 - e)**n) / (1.0 - n)
        return self.distance * math.log(2.0) / (1.0 if e >= 0.0 else 1.0 + e + one)


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
        if abs(n - 1.0) < _ONE:
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
        if abs(n - 1.0) < _ONE:
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
        """Return d(states)/dt; what a step went too far comes back with travel."""
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
