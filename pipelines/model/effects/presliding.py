"""Presliding: before a joint slides, its contacts bend like bristles."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.bristles import ONE, Breaking, Bristles, Slips, sliding_level
from pipelines.model.effects.base import (
    LARGE,
    ArmModel,
    Hooks,
    OwnMemory,
    Parameters,
    Quantity,
    Values,
    Words,
)
from pipelines.model.effects.fast import Fast

__all__ = ["Presliding"]

_HALFWAY = 0.0  # elastic share from which a refit finds Dahl's -1 as well as Dupont's 0.5
_OTHER = 0.8  # exponent from which a refit finds others than 1
_BREAKAWAY = 0.3  # from which a refit finds others, and none
_STRIBECK = 0.1  # of the fastest speed: where it looks for the speed over which friction falls


@dataclass(frozen=True)
class Presliding(Fast):
    """τ = A (u + T_d du/dt): friction that turns over with travel, not with speed. It takes the place of as much Coulomb friction.

    Along a stroke in direction s, y = s u bends with travel x = |q|/d by

        dy/dx = 1 up to y = e,  ((1 - y)/(1 - e))^n beyond

    so that nothing slides up to e (Dupont, Hayward, Armstrong & Altpeter 2002, eq. (9)-(12), who take e from 0 to 1). e = -1 is
    Dahl 1968 with his exponent n; with n = 1 and T_d = σ1/σ0 LuGre of constant sliding friction (Canudas de Wit et al. 1995,
    eq. (1)-(3)). d is such that u is zero x_c ln 2 after a reversal while sliding, as with Dahl's n = 1 and distance x_c.

    Bristles know no more than how far they bend. Where inner loops close, elements that slip one after the other stand in their
    place (Iwan 1966; Al-Bender, Lampaert & Swevers 2005): u = Σ w_i z_i, dz_i = 2 dx/X_i within ±1, w_i and X_i such that a
    reversal while sliding goes as above.

    With a breakaway b more friction at standstill than at speed, which falls over v_s (Canudas de Wit et al. 1995, eq. (4)),

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
        Quantity("amplitude", "N m", 0.0, LARGE, "friction that turns over with travel", healthy=math.inf),
        Quantity("distance", "rad", 1e-6, 0.2, "travel over which it turns over", shape=True),
        Quantity("elastic", "1", -1.0, 0.9, "share of the largest bending up to which nothing slides", shape=True, unsaid=-1.0),
        Quantity("damping_time", "s", 0.0, 0.1, "damping of the bristles over their stiffness", shape=True),
        Quantity("exponent", "1", 0.0, 3.0, "how gradually it begins to slide", shape=True, unsaid=1.0, held=1.0),
        Quantity("inner_loops", "1", 0.0, 1.0, "1 where a small loop inside a large one closes", shape=True, discrete=True,
                 unsaid=0.0),
        Quantity("breakaway", "1", 0.0, 5.0, "how much larger friction is at standstill than at speed", shape=True, unsaid=0.0),
        Quantity("breakaway_speed", "rad/s", 1e-3, 5.0, "speed over which it falls to that", shape=True, unsaid=0.1),
    )
    words = Words("Presliding",
        signature="After each reversal friction turns over along a loop against position, at any speed.",
        explanation="Contacts, seals and gears bend before they slide, and bend back after a reversal.",
        remedy="Every bearing has it, and nothing need be broken: simulate it where slow "
               "reversals matter; friction compensation by the sign of speed alone pushes too "
               "early.",
        experiment="Reverse the joint slowly and often, with strokes from a tenth of the distance to many times it.")
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
        slow = float(np.clip(_STRIBECK * np.abs(self.own(motion.dq)).max(initial=0.0), 1e-3, 5.0))
        for distance in np.geomspace(1e-3 * travel, 0.1 * travel, 9).tolist():
            yield replace(self, distance=float(np.clip(distance, 1e-6, 0.2)), breakaway_speed=slow)

    def forms(self) -> tuple[Self, ...]:
        return (replace(self, elastic=_HALFWAY), replace(self, exponent=_OTHER),
                replace(self, exponent=_OTHER, inner_loops=1.0),
                replace(self, elastic=-1.0, breakaway=_BREAKAWAY))

    @property
    def free(self) -> tuple[str, ...]:
        held = {"elastic", "exponent"} if self.breakaway else {"breakaway", "breakaway_speed"}
        return tuple(name for name in super().free if name not in held)

    def reported(self, values: Values) -> dict[str, float | tuple[float, ...]]:
        """Without a speed over which nothing falls."""
        said = super().reported(values)
        return said if values["breakaway"] else {name: x for name, x in said.items() if not name.startswith("breakaway")}

    def curve(self, dq: Array, arm: ArmModel, values: Values) -> Array:
        """What is left of it at constant speed: Coulomb friction, and its breakaway."""
        shaped = self.at(values)
        return np.asarray(values["amplitude"] * np.sign(dq) * sliding_level(dq, shaped.breakaway, shaped.breakaway_speed))

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
        return OwnMemory(lambda u, v, m: contact.rate_of(u, v / unit, m), lambda u, du: amplitude * (u + time * du))

    @property
    def _contact(self) -> Bristles | Slips | Breaking:
        if self.breakaway:
            return Breaking(self.breakaway, self.breakaway_speed / self._unit)
        return Slips(self.elastic, self.exponent) if self.inner_loops else Bristles(self.elastic, self.exponent)

    @property
    def _unit(self) -> float:
        """d [rad]: y(x) from -1 is zero at x = 1, or where e < 0 at 1 + e + (1 - e) ln(1 - e), for n = 1."""
        if self.breakaway:
            return self.distance
        e, n = self.elastic, self.exponent
        one = (1.0 - e) * math.log(1.0 - e) if abs(n - 1.0) < ONE else ((1.0 - e) - (1.0 - e) ** n) / (1.0 - n)
        return self.distance * math.log(2.0) / (1.0 if e >= 0.0 else 1.0 + e + one)
