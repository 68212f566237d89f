"""Stribeck friction: more friction at the lowest speeds, where no lubricant film has built up."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from pipelines.model.effects.base import ArmModel, Effect, OwnLoad, Quantity, Values
from pipelines.model.rigid.body import Array, Motion

__all__ = ["Stribeck"]


@dataclass(frozen=True)
class Stribeck(Effect):
    """τ = A exp(-(v/v_s)²) tanh(w v), beside Coulomb and viscous friction.

    Armstrong-Hélouvry, Dupont & Canudas de Wit 1994, eq. (7), with exponent 2. Three sigmoids of mixed signs have the same
    hump, `three_sigmoid`.
    """

    speed: float = 0.1  # v_s [rad/s]
    sharpness: float = 100.0  # w [s/rad]

    name = "stribeck"
    title = "Stribeck friction"
    parameters = (
        Quantity("amplitude", "N m", 0.0, 20.0, "friction at standstill above that at speed"),
        Quantity("speed", "rad/s", 1e-3, 5.0, "speed over which it falls", shape=True),
        Quantity("sharpness", "s/rad", 5.0, 2000.0, "inverse of the speed over which it changes sign", shape=True),
    )
    signature = "A hump of the friction curve at low speed, the same in both directions."
    explanation = "Below a certain speed the surfaces touch; above it a film of lubricant carries them."
    remedy = "Compensate it in the feed-forward, and avoid slow motion; another lubricant moves the hump."
    experiment = "Move the joint in both directions at seven to ten constant speeds over two decades."
    twins = ("quadratic_drag", "three_sigmoid", "concave_friction", "presliding")
    friction = True
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        v = self.own(motion.dq)
        return self.on_own_row(arm, np.exp(-np.square(v / self.speed)) * np.tanh(self.sharpness * v))

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """v_s from the slowest speeds of the motion to a third of the fastest, always slower than where the sign has changed."""
        fast = float(np.abs(self.own(motion.dq)).max(initial=0.0)) or 1.0
        for speed in np.geomspace(2.0 / self.sharpness, max(fast / 3.0, 4.0 / self.sharpness), 8).tolist():
            yield replace(self, speed=float(np.clip(speed, 1e-3, 5.0)))

    def own_load(self, values: Values) -> OwnLoad:
        amplitude, sharpness, narrow = self.amplitudes(values).item(), values["sharpness"], 1.0 / values["speed"] ** 2
        return lambda angle, speed: amplitude * math.exp(-narrow * speed * speed) * math.tanh(sharpness * speed)
