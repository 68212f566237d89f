"""A constant torque, moving or at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.model.effects.base import (
    LARGE,
    ArmModel,
    Parameters,
    Quantity,
    SpeedCurve,
    Values,
    Words,
)
from pipelines.model.effects.fast import Fast

__all__ = ["TorqueOffset"]


@dataclass(frozen=True)
class TorqueOffset(Fast):
    """τ = τ0."""

    name = "torque_offset"
    parameters = Parameters(Quantity("offset", "N m", -LARGE, LARGE, "constant torque to add to the model"))
    words = Words("Torque offset",
        signature="A torque that is the same at any position, speed and time, also at rest.",
        explanation="The zero of the current sensor or of the amplifier is off, or a cable or spring pulls evenly.",
        remedy="Calibrate the zero of the current measurement; look for a cable under tension.",
        experiment="Hold still for two seconds, and cross the same position in both directions.")
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm, np.ones(len(motion.t)))

    def speed_curve(self, values: Values) -> SpeedCurve:
        return SpeedCurve(constant=values["offset"])
