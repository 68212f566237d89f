"""Viscous friction: a torque in proportion to speed."""

from __future__ import annotations

from dataclasses import dataclass

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
from pipelines.model.effects.kinds import FrictionLaw

__all__ = ["Viscous"]


@dataclass(frozen=True)
class Viscous(FrictionLaw, Fast):
    """τ = b v."""

    name = "viscous"
    parameters = Parameters(Quantity("coefficient", "N m s/rad", 0.0, LARGE, "torque per unit of speed"))
    words = Words("Viscous friction",
        signature="A torque in proportion to speed, the same in both directions.",
        explanation="Sheared lubricant, and eddy currents in the motor.",
        remedy="Compensate it in the feed-forward; it falls as the joint warms up, so log the temperature.",
        experiment="Move the joint in both directions at seven or more constant speeds over two decades.")
    evidence = "none"
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm, self.own(motion.dq))

    def speed_curve(self, values: Values) -> SpeedCurve:
        return SpeedCurve(viscous=values["coefficient"])
