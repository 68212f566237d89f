"""A constant torque, moving or at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.effects.base import LARGE, ArmModel, Effect, Parameters, Quantity, SpeedCurve, Values

__all__ = ["TorqueOffset"]


@dataclass(frozen=True)
class TorqueOffset(Effect):
    """τ = τ0."""

    name = "torque_offset"
    parameters = Parameters(
        Quantity("offset", "N m", -LARGE, LARGE, "constant torque to add to the model"))
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm, np.ones(len(motion.t)))

    def speed_curve(self, values: Values) -> SpeedCurve:
        return SpeedCurve(constant=values["offset"])
