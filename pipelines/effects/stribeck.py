"""Stribeck friction: more friction at the lowest speeds, where no lubricant film has built up."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.functions import Functions
from pipelines.effects.base import LARGE, ArmModel, OwnLoad, Parameters, Quantity, Values
from pipelines.effects.config import EFFECTS
from pipelines.effects.kinds import FrictionLaw

__all__ = ["Stribeck"]

_GAUSSIAN = 2.0  # numerics: exponent
_NONE = 1e-6  # numerics: of a tail


@dataclass(frozen=True)
class Stribeck(FrictionLaw):
    """τ = A (1 + (e^p - 1) |v/v_s|^n)^(-1/p) tanh(w v), beside Coulomb and viscous friction.

    1/e of it is left at v_s.

    As p goes to 0 it is A exp(-|v/v_s|^n) tanh(w v): Armstrong-Hélouvry, Dupont & Canudas de Wit
    1994, eq. (7); n = 1 is Tustin 1947. p = 1, n = 2 is Hess & Soom 1990. Three sigmoids of mixed
    signs have the same hump, `three_sigmoid`.
    """

    speed: float = 0.1  # v_s [rad/s]
    sharpness: float = 100.0  # w [s/rad]
    tail: float = 0.0  # p, held where it is 0
    exponent: float = 2.0  # n, held where it is 2

    name = "stribeck"
    parameters = Parameters(
        Quantity("amplitude", "N m", 0.0, LARGE, "friction at standstill above that at speed",
                 healthy=math.inf),
        Quantity("speed", "rad/s", 1e-3, 5.0, "speed over which it falls", shape=True),
        Quantity("sharpness", "s/rad", 5.0, 2000.0,
                 "inverse of the speed over which it changes sign", shape=True, shared=True),
        Quantity("tail", "1", 0.0, 3.0,
                 "how long it lasts beyond its speed: not at all, or as a power of speed",
                 shape=True, unsaid=0.0, held=0.0),
        Quantity("exponent", "1", 0.0, 4.0, "how abruptly it falls at its speed", shape=True,
                 unsaid=2.0, held=_GAUSSIAN),
    )
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        v = self.own(motion.dq)
        over = np.abs(v / self.speed) ** self.exponent
        left = np.exp(-over) if self.tail < _NONE else (1.0 + math.expm1(self.tail) * over)**(
            -1.0 / self.tail)
        return self.on_own_row(arm, left * np.tanh(self.sharpness * v))

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """v_s from the slowest speeds of the motion to a third of the fastest.

        Always slower than where the sign has changed.
        """
        fast = float(np.abs(self.own(motion.dq)).max(initial=0.0)) or 1.0
        slowest, fastest = EFFECTS.over / self.sharpness, max(fast / 3.0, 4.0 / self.sharpness)
        for speed in np.geomspace(slowest, fastest, 8).tolist():
            yield replace(self, speed=float(np.clip(speed, 1e-3, 5.0)))

    def possible(self, values: Values) -> bool:
        """Return whether the hump lasts until friction has changed its sign: else it is no hump."""
        lasts = values["speed"] * values["sharpness"] >= EFFECTS.over - _NONE
        return super().possible(values) and lasts

    def forms(self) -> tuple[Self, ...]:
        return self, replace(self, tail=0.5), replace(self, exponent=1.5)

    def own_load(self, values: Values) -> OwnLoad:
        amplitude, sharpness = self.amplitudes(values).item(), values["sharpness"]
        slow = 1.0 / values["speed"]
        p, n = values["tail"], values["exponent"]

        def load(q: Any, v: Any, m: Functions) -> Any:
            over = slow * v * slow * v if n == _GAUSSIAN else abs(slow * v) ** n
            left = m.exp(-over) if p < _NONE else (1.0 + math.expm1(p) * over) ** (-1.0 / p)
            return amplitude * left * m.tanh(sharpness * v)

        return load
