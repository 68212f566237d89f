"""Friction as two sigmoids and a viscous term.

What is left of three where logs do not tell these apart.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.effects.base import LARGE, ArmModel, Parameters, Quantity, SpeedCurve, Values
from pipelines.effects.config import EFFECTS
from pipelines.effects.kinds import FrictionLaw

__all__ = ["TwoSigmoid"]


@dataclass(frozen=True)
class TwoSigmoid(FrictionLaw):
    """τ = f_1 tanh(w_1 v) + f_2 tanh(w_2 v) + b v.

    Kostić et al. 2004, eq. (10), with two terms of its three: a jump at zero speed, and a dip (f_2
    < 0) or a slower rise (f_2 > 0) behind it. Two of three sigmoids that are nearly as sharp as
    each other, against noise, are one of the sum of their heights: only that sum is seen.
    """

    w1: float = 60.0  # [s/rad]
    w2: float = 12.0  # [s/rad]

    name = "two_sigmoid"
    parameters = Parameters(
        *(Quantity(f"f{k}", "N m", -LARGE, LARGE, f"height of sigmoid {k}") for k in (1, 2)),
        *(Quantity(f"w{k}", "s/rad", 0.1, 2000.0, f"sharpness of sigmoid {k}", shape=True)
          for k in (1, 2)), Quantity("b", "N m s/rad", 0.0, LARGE, "viscous coefficient"))
    evidence = "none"
    plainer = (("coulomb", "viscous"),)
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        v = self.own(motion.dq)
        return self.on_own_row(arm, np.tanh(self.w1 * v), np.tanh(self.w2 * v), v)

    def speed_curve(self, values: Values) -> SpeedCurve:
        return SpeedCurve(viscous=values["b"], heights=(values["f1"], values["f2"]),
                          sharpnesses=(values["w1"], values["w2"]))

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """w1 > w2 on their grid."""
        for w1, w2 in combinations(self.sharpnesses(motion, EFFECTS.sharpnesses), 2):
            yield replace(self, w1=w1, w2=w2)
