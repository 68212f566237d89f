"""Friction that is larger in one direction than in the other."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from pipelines.model.effects.base import ArmModel, Effect, OwnLoad, Quantity, Values
from pipelines.model.rigid.body import Array, Motion

__all__ = ["AsymmetricFriction"]


@dataclass(frozen=True)
class AsymmetricFriction(Effect):
    """τ = ½ ΔFc |tanh(w v)| + ½ ΔFv |v|, with Δ the positive direction's minus the negative one's.

    Beside Fc tanh(w v) + Fv v these are Fc ± ½ ΔFc and Fv ± ½ ΔFv in the two directions.
    """

    sharpness: float = 100.0  # w [s/rad]

    name = "asymmetric_friction"
    title = "Asymmetric friction"
    parameters = (
        Quantity("coulomb_difference", "N m", -20.0, 20.0, "Coulomb friction of the positive minus the negative direction"),
        Quantity("viscous_difference", "N m s/rad", -10.0, 10.0, "viscous friction of the positive minus the negative direction"),
        Quantity("sharpness", "s/rad", 5.0, 2000.0, "inverse of the speed over which it changes sign", shape=True),
    )
    signature = "A part of the torque that is even in speed: larger friction one way than the other."
    explanation = "Preload, seal lips and worm or harmonic gears rub more in one direction of motion."
    remedy = "Look at preload and seals; what stays, compensate with coefficients of its own in each direction."
    experiment = "Hold still for two seconds in several positions, then move at several equal speeds in both directions."
    twins = ("torque_offset", "spring")
    shared = ("sharpness",)
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        v = self.own(motion.dq)
        return self.on_own_row(arm, 0.5 * np.abs(np.tanh(self.sharpness * v)), 0.5 * np.abs(v))

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        for sharpness in (10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0):
            yield replace(self, sharpness=sharpness)

    def own_load(self, values: Values) -> OwnLoad:
        (coulomb, viscous), sharpness = (0.5 * self.amplitudes(values)).tolist(), values["sharpness"]
        return lambda angle, speed: coulomb * abs(math.tanh(sharpness * speed)) + viscous * abs(speed)
