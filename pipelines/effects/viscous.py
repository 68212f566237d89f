"""Viscous friction: a torque in proportion to speed."""

from __future__ import annotations

from dataclasses import dataclass

from pipelines.dynamics.body import Array, Motion
from pipelines.effects.base import LARGE, ArmModel, Parameters, Quantity, SpeedCurve, Values
from pipelines.effects.kinds import FrictionLaw

__all__ = ["Viscous"]


@dataclass(frozen=True)
class Viscous(FrictionLaw):
    """τ = b v."""

    name = "viscous"
    parameters = Parameters(
        Quantity("coefficient", "N m s/rad", 0.0, LARGE, "torque per unit of speed"))
    evidence = "none"
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm, self.own(motion.dq))

    def speed_curve(self, values: Values) -> SpeedCurve:
        return SpeedCurve(viscous=values["coefficient"])
