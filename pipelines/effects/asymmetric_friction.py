"""Friction that is larger in one direction than in the other."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.functions import Functions
from pipelines.effects.base import (
    LARGE,
    SHARPNESSES,
    ArmModel,
    Effect,
    OwnLoad,
    Parameters,
    Quantity,
    Values,
)

__all__ = ["AsymmetricFriction"]


@dataclass(frozen=True)
class AsymmetricFriction(Effect):
    """τ = ½ s (ΔFc tanh(w v) + ΔFv v).

    Δ is the positive direction's minus the negative one's, and s the direction.

    Beside Fc tanh(w v) + Fv v these are Fc ± ½ ΔFc and Fv ± ½ ΔFv in the two directions: s = sign
    v, each to the last; or they go over into each other as gradually as friction changes its sign,
    s = tanh(w v), for a lip does not lift at once. A joint that creeps about standstill, |v| < 1/w,
    tells the two apart.
    """

    sharpness: float = 100.0  # w [s/rad]
    gradual: float = 0.0  # 1: s = tanh(w v)

    name = "asymmetric_friction"
    parameters = Parameters(
        Quantity("coulomb_difference", "N m", -LARGE, LARGE,
                 "Coulomb friction of the positive minus the negative direction"),
        Quantity("viscous_difference", "N m s/rad", -LARGE, LARGE,
                 "viscous friction of the positive minus the negative direction"),
        Quantity("sharpness", "s/rad", 5.0, 2000.0,
                 "inverse of the speed over which it changes sign", shape=True, shared=True,
                 grid=SHARPNESSES),
        Quantity(
            "gradual", "1", 0.0, 1.0,
            "1: the directions go over into each other as friction changes its sign, 0: at once",
            shape=True, discrete=True, unsaid=0.0))
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        v = self.own(motion.dq)
        turned = np.tanh(self.sharpness * v)
        half = 0.5 * (turned if self.gradual else np.sign(v))
        return self.on_own_row(arm, half * turned, half * v)

    def forms(self) -> tuple[Self, ...]:
        return self, replace(self, gradual=1.0)

    def own_load(self, values: Values) -> OwnLoad:
        (coulomb, viscous), sharpness = map(float,
                                            0.5 * self.amplitudes(values)), values["sharpness"]
        gradual = bool(values["gradual"])

        def load(q: Any, v: Any, m: Functions) -> Any:
            turned = m.tanh(sharpness * v)
            return turned * (coulomb * turned
                             + viscous * v) if gradual else coulomb * abs(turned) + viscous * abs(v)

        return load
