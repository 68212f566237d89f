"""Friction as three sigmoids and a viscous term.

Coulomb, Stribeck and viscous friction in one smooth curve.
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

__all__ = ["ThreeSigmoid"]


@dataclass(frozen=True)
class ThreeSigmoid(FrictionLaw):
    """τ = Σ_k f_k (1 - 2/(exp(2 w_k v) + 1)) + b v = Σ_k f_k tanh(w_k v) + b v.

    Kostić et al. 2004, eq. (10); the two forms are equal, and tanh never overflows. For given w it
    is linear in f and b. A set is one of 48 equal ones, 3! orders times 2³ signs (f, w) -> (-f,
    -w); w1 > w2 > w3 > 0 names it. A dip at low speed needs f of both signs. Compare curves, not
    parameters: as w -> 0 a sigmoid becomes part of b.
    """

    w1: float = 100.0  # [s/rad]
    w2: float = 30.0  # [s/rad]
    w3: float = 10.0  # [s/rad]

    name = "three_sigmoid"
    parameters = Parameters(
        *(Quantity(f"f{k}", "N m", -LARGE, LARGE, f"height of sigmoid {k}") for k in (1, 2, 3)),
        *(Quantity(f"w{k}", "s/rad", 0.1, 2000.0, f"sharpness of sigmoid {k}", shape=True)
          for k in (1, 2, 3)), Quantity("b", "N m s/rad", 0.0, LARGE, "viscous coefficient"))
    evidence = "none"
    plainer = (("two_sigmoid",), ("coulomb", "viscous"))
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        v = self.own(motion.dq)
        return self.on_own_row(arm, np.tanh(self.w1 * v), np.tanh(self.w2 * v),
                               np.tanh(self.w3 * v), v)

    def shape_slopes(self, motion: Motion, amplitudes: Array) -> Array:
        """∂τ/∂ln w_k = f_k w_k v (1 - tanh²(w_k v))."""
        reach = np.multiply.outer([self.w1, self.w2, self.w3], self.own(motion.dq))  # (3, samples)
        bend = np.tanh(reach)
        np.square(bend, out=bend)
        np.subtract(1.0, bend, out=bend)
        bend *= reach
        bend *= amplitudes[:3, None]
        return bend.T

    def speed_curve(self, values: Values) -> SpeedCurve:
        return SpeedCurve(viscous=values["b"], heights=tuple(values[f"f{k}"] for k in (1, 2, 3)),
                          sharpnesses=tuple(values[f"w{k}"] for k in (1, 2, 3)))

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """w1 > w2 > w3 on their grid."""
        for w1, w2, w3 in combinations(self.sharpnesses(motion, EFFECTS.sharpnesses), 3):
            yield replace(self, w1=w1, w2=w2, w3=w3)

    @staticmethod
    def canonical(values: Values) -> dict[str, float]:
        """Return the one of the 48 equal sets that has w1 > w2 > w3 > 0."""
        pairs = [(values[f"f{k}"], values[f"w{k}"]) for k in (1, 2, 3)]
        positive = [(f, w) if w >= 0 else (-f, -w) for f, w in pairs]
        ordered = sorted(positive, key=lambda pair: -pair[1])
        heights = {f"f{k}": f for k, (f, _) in enumerate(ordered, start=1)}
        return heights | {f"w{k}": w
                          for k, (_, w) in enumerate(ordered, start=1)} | {"b": values["b"]}
