"""Coulomb friction: a constant torque against the direction of motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

from pipelines.model.effects.base import LARGE, SHARPNESSES, ArmModel, Parameters, Quantity, SpeedCurve, Values, Words
from pipelines.model.effects.fast import Fast
from pipelines.model.effects.kinds import FrictionLaw
from pipelines.model.rigid.body import Array, Motion

__all__ = ["Coulomb", "sign_curve"]

# x/√(1 + x²) and (2/π) arctan x as sigmoids, within 0.0012 of them at every x: sharpnesses, as parts of w, and heights.
_TANH = ((1.0, 1.0),)
_ROOT = ((1.307, 0.608), (0.563, 0.344), (0.1505, 0.048))
_ARCTAN = ((1.1537, 0.3622), (0.4719, 0.4021), (0.1463, 0.1731), (0.0335, 0.052), (0.004, 0.0106))
_BETWEEN = 1.5  # tanh and the root: a roundness that is fitted begins there


def sign_curve(level: float, sharpness: float, roundness: float = 1.0) -> SpeedCurve:
    """Return the torque of `Coulomb` as sigmoids of the speed."""
    w, more = sharpness, roundness - 1.0
    if more == 0.0:
        return SpeedCurve(heights=(level,), sharpnesses=(w,))
    sharper, rounder = (_TANH, _ROOT) if more <= 1.0 else (_ROOT, _ARCTAN)
    share = more if more <= 1.0 else more - 1.0
    return SpeedCurve(heights=tuple(level * part * height for part, curve in ((1.0 - share, sharper), (share, rounder))
                                    for _, height in curve),
                      sharpnesses=tuple(w * part for part, _ in (*sharper, *rounder)))


@dataclass(frozen=True)
class Coulomb(FrictionLaw, Fast):
    """τ = Fc ((2 - r) tanh(x) + (r - 1) x/√(1 + x²)), x = w v; from r = 2 on Fc ((3 - r) x/√(1 + x²) + (r - 2) (2/π) arctan x).

    tanh(w v) stands for sign(v) in fits and in simulation alike. In a fit, a reconstructed speed passes zero a little
    early or late, and a jump there leaves spikes that look like presliding. In a simulation, sign(v) chatters at every
    step, where tanh is stable as long as the step h keeps w Fc h / J below 2. One law in both means that what the fit
    explains, the simulation shows. The width 1/w is itself fitted, over the grid of `shapes`; by default it is 0.01
    rad/s, far below the speeds at which Coulomb and viscous friction are told apart.

    By which curve the friction of a real joint changes its sign nobody knows: tanh (r = 1), v/√(v² + ε²) (r = 2), the arc tangent
    (r = 3) and others are in use (Pennestrì, Rossi, Salvini & Valentini 2016), and none is a fault. They differ in how slowly the
    torque comes to its level: what is missing falls with speed as an exponential, as 1/v², as 1/v. A diagnosis fits the
    roundness r beside the width, so that no cause is found in the difference; where r is 1 it is held. Root and arc tangent are
    laid as sigmoids, which a simulation takes at once.
    """

    sharpness: float = 100.0  # w [s/rad]
    roundness: float = 1.0  # r

    name = "coulomb"
    parameters = Parameters(
        Quantity("level", "N m", 0.0, LARGE, "friction torque while moving"),
        Quantity("sharpness", "s/rad", 5.0, 2000.0, "inverse of the speed over which it changes sign", shape=True,
                 grid=SHARPNESSES),
        Quantity("roundness", "1", 0.4, 3.5, "how gradually it changes sign; 1: as tanh, 3: as arctan", shape=True, unsaid=1.0,
                 held=1.0),
    )
    words = Words("Coulomb friction",
        signature="A torque of constant size that changes sign with the direction of motion.",
        explanation="Dry friction in bearings, seals and gears: its size does not depend on speed.",
        remedy="If it has grown, check lubrication, preload and seals; compensate it in the feed-forward.",
        experiment="Move the joint in both directions at seven or more constant speeds over two decades.")
    evidence = "none"
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm, sign_curve(1.0, self.sharpness, self.roundness).torque(self.own(motion.dq)))

    def speed_curve(self, values: Values) -> SpeedCurve:
        return sign_curve(values["level"], values["sharpness"], values.get("roundness", 1.0))

    def forms(self) -> tuple[Self, ...]:
        return self, replace(self, roundness=_BETWEEN)

    def plain(self) -> Self:
        """Return the law by tanh, whose roundness is not fitted."""
        return replace(self, roundness=1.0)
