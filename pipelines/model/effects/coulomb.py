"""Coulomb friction: a constant torque against the direction of motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from pipelines.model.effects.base import ArmModel, Effect, Quantity, SpeedCurve, Values
from pipelines.model.rigid.body import Array, Motion

__all__ = ["Coulomb"]


@dataclass(frozen=True)
class Coulomb(Effect):
    """τ = Fc tanh(w v).

    tanh(w v) stands for sign(v) in fits and in simulation alike. In a fit, a reconstructed speed passes zero a little
    early or late, and a jump there leaves spikes that look like presliding. In a simulation, sign(v) chatters at every
    step, where tanh is stable as long as the step h keeps w Fc h / J below 2. One law in both means that what the fit
    explains, the simulation shows. The width 1/w is itself fitted, over the grid of `shapes`; by default it is 0.01
    rad/s, far below the speeds at which Coulomb and viscous friction are told apart.
    """

    sharpness: float = 100.0  # w [s/rad]

    name = "coulomb"
    title = "Coulomb friction"
    parameters = (
        Quantity("level", "N m", 0.0, 50.0, "friction torque while moving"),
        Quantity("sharpness", "s/rad", 5.0, 2000.0, "inverse of the speed over which it changes sign", shape=True),
    )
    signature = "A torque of constant size that changes sign with the direction of motion."
    explanation = "Dry friction in bearings, seals and gears: its size does not depend on speed."
    remedy = "If it has grown, check lubrication, preload and seals; compensate it in the feed-forward."
    experiment = "Move the joint in both directions at seven or more constant speeds over two decades."
    evidence = "none"
    twins = ("viscous", "three_sigmoid", "asymmetric_friction", "presliding")
    friction = True
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm, np.tanh(self.sharpness * self.own(motion.dq)))

    def speed_curve(self, values: Values) -> SpeedCurve:
        return SpeedCurve(heights=(values["level"],), sharpnesses=(values["sharpness"],))

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        for sharpness in (10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0):
            yield replace(self, sharpness=sharpness)
