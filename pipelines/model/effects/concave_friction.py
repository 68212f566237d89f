"""Concave friction: it rises with speed and levels off."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from pipelines.model.effects.base import ArmModel, Effect, Quantity, SpeedCurve, Values
from pipelines.model.rigid.body import Array, Motion

__all__ = ["ConcaveFriction"]


@dataclass(frozen=True)
class ConcaveFriction(Effect):
    """τ = A tanh(v/v_0), beside Coulomb and viscous friction: v_0 lies well above the speeds at which Coulomb friction turns."""

    speed: float = 1.0  # v_0 [rad/s]

    name = "concave_friction"
    title = "Concave friction"
    parameters = (
        Quantity("amplitude", "N m", 0.0, 20.0, "torque at which it levels off"),
        Quantity("speed", "rad/s", 0.01, 20.0, "speed at which it levels off", shape=True),
    )
    signature = "Friction that rises with speed and then levels off, the same in both directions."
    explanation = "Lubricant that thins as it is sheared, and churning in gears: common in geared and lubricated joints."
    remedy = "Compensate it in the feed-forward; a single viscous coefficient is too large at speed and too small below it."
    experiment = "Move the joint in both directions at seven to ten constant speeds over two decades."
    twins = ("stribeck", "quadratic_drag", "viscous", "three_sigmoid")
    friction = True
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm, np.tanh(self.own(motion.dq) / self.speed))

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """v_0 over a decade and a half below the fastest speed: beyond it is viscous friction."""
        fast = float(np.abs(self.own(motion.dq)).max(initial=0.0)) or 1.0
        for speed in np.geomspace(fast / 30.0, fast, 8).tolist():
            yield replace(self, speed=float(np.clip(speed, 0.01, 20.0)))

    def speed_curve(self, values: Values) -> SpeedCurve:
        return SpeedCurve(heights=(self.amplitudes(values).item(),), sharpnesses=(1.0 / values["speed"],))
