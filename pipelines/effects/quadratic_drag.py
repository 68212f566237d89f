"""Quadratic drag: a torque that grows with the square of speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.effects.base import LARGE, ArmModel, OwnLoad, Parameters, Quantity, Values
from pipelines.effects.kinds import FrictionLaw

__all__ = ["QuadraticDrag"]


@dataclass(frozen=True)
class QuadraticDrag(FrictionLaw):
    """τ = c v |v|."""

    name = "quadratic_drag"
    parameters = Parameters(
        Quantity("coefficient", "N m s^2/rad^2", 0.0, LARGE, "torque at unit speed"))
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        v = self.own(motion.dq)
        return self.on_own_row(arm, v * np.abs(v))

    def own_load(self, values: Values) -> OwnLoad:
        coefficient = self.amplitudes(values).item()
        return lambda q, v, m: coefficient * v * abs(v)
