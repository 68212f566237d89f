"""Coulomb friction: a constant torque against the direction of motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

from pipelines.dynamics.body import Array, Motion
from pipelines.effects.base import (
    LARGE,
    SHARPNESSES,
    ArmModel,
    Parameters,
    Quantity,
    SpeedCurve,
    Values,
)
from pipelines.effects.config import EFFECTS
from pipelines.effects.kinds import FrictionLaw, sign_curve

__all__ = ["Coulomb"]


@dataclass(frozen=True)
class Coulomb(FrictionLaw):
    """τ = Fc ((2 - r) tanh(x) + (r - 1) x/√(1 + x²)), x = w v.

    From r = 2 on it is Fc ((3 - r) x/√(1 + x²) + (r - 2) (2/π) arctan x).

    tanh(w v) stands for sign(v) in fits and in simulation alike. In a fit, a reconstructed speed
    passes zero a little early or late, and a jump there leaves spikes that look like presliding. In
    a simulation, sign(v) chatters at every step, where tanh is stable as long as the step h keeps w
    Fc h / J below 2. One law in both means that what the fit explains, the simulation shows. The
    width 1/w is itself fitted, over the grid of `shapes`; by default it is 0.01 rad/s, far below
    the speeds at which Coulomb and viscous friction are told apart.

    By which curve the friction of a real joint changes its sign nobody knows: tanh (r = 1), v/√(v²
    + ε²) (r = 2), the arc tangent (r = 3) and others are in use (Pennestrì, Rossi, Salvini &
    Valentini 2016), and none is a fault. They differ in how slowly the torque comes to its level:
    what is missing falls with speed as an exponential, as 1/v², as 1/v. A diagnosis fits the
    roundness r beside the width, so that no cause is found in the difference; where r is 1 it is
    held. Root and arc tangent are laid as sigmoids, which a simulation takes at once.
    """

    sharpness: float = 100.0  # w [s/rad]
    roundness: float = 1.0  # r

    name = "coulomb"
    parameters = Parameters(
        Quantity("level", "N m", 0.0, LARGE, "friction torque while moving"),
        Quantity("sharpness", "s/rad", 5.0, 2000.0,
                 "inverse of the speed over which it changes sign", shape=True, grid=SHARPNESSES),
        Quantity("roundness", "1", 0.4, 3.5,
                 "how gradually it changes sign; 1: as tanh, 3: as arctan", shape=True, unsaid=1.0,
                 held=1.0))
    evidence = "none"
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(
            arm,
            sign_curve(1.0, self.sharpness, self.roundness).torque(self.own(motion.dq)))

    def speed_curve(self, values: Values) -> SpeedCurve:
        return sign_curve(values["level"], values["sharpness"], values.get("roundness", 1.0))

    def forms(self) -> tuple[Self, ...]:
        return self, replace(self, roundness=EFFECTS.roundness)

    def plain(self) -> Self:
        """Return the law by tanh, whose roundness is not fitted."""
        return replace(self, roundness=1.0)
