"""Friction that depends on the angle of the joint."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from pipelines.model.effects.base import ArmModel, Effect, OwnLoad, Quantity, Values
from pipelines.model.rigid.body import Array, Motion

__all__ = ["PositionFriction"]


@dataclass(frozen=True)
class PositionFriction(Effect):
    """τ = A sin(k q + φ) tanh(w v): Coulomb friction that varies along the turn.

    The columns are sin(k q) tanh(w v) and cos(k q) tanh(w v); their amplitudes A cos φ and A sin φ. A turn tells k on a
    robot's joint; on a prismatic one k counts waves in 2π metres.
    """

    order: float = 1.0  # k [1/rev of the joint]
    sharpness: float = 100.0  # w [s/rad]

    name = "position_friction"
    title = "Friction that depends on position"
    parameters = (
        Quantity("amplitude", "N m", 0.0, 20.0, "by how much friction rises and falls along the turn"),
        Quantity("order", "1/rev", 0.25, 100.0, "waves in one turn of the joint", shape=True),
        Quantity("phase", "rad", -math.pi, math.pi, "angle of the wave at the joint's zero"),
        Quantity("sharpness", "s/rad", 5.0, 2000.0, "inverse of the speed over which it changes sign", shape=True),
    )
    signature = "Friction whose size changes with the angle of the joint, always against the motion."
    explanation = "A bent shaft, an uneven seal or bearing, cables that press in some postures."
    remedy = "Look for wear, a bent shaft or cables that rub; compensate it with the angle."
    experiment = "Turn the joint slowly through its whole range in both directions, at two speeds."
    twins = ("cogging", "load_friction", "viscous_drift")
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        side, angle = np.tanh(self.sharpness * self.own(motion.dq)), self.order * self.own(motion.q)
        return self.on_own_row(arm, side * np.sin(angle), side * np.cos(angle))

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """Whole orders; also halves where the joint moves over more than a turn."""
        step = 1.0 if np.ptp(self.own(motion.q)) < 2.0 * math.pi else 0.5
        for order in np.arange(1.0, 8.0 + step, step).tolist():
            yield replace(self, order=order)

    def own_load(self, values: Values) -> OwnLoad:
        amplitude, order, phase, sharpness = (values[name] for name in ("amplitude", "order", "phase", "sharpness"))
        return lambda angle, speed: amplitude * math.tanh(sharpness * speed) * math.sin(order * angle + phase)

    def amplitudes(self, values: Values) -> Array:
        return values["amplitude"] * np.array([math.cos(values["phase"]), math.sin(values["phase"])])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        sine, cosine = map(float, amplitudes)
        return {"amplitude": math.hypot(sine, cosine), "order": self.order, "phase": math.atan2(cosine, sine),
                "sharpness": self.sharpness}
