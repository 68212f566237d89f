"""Friction that grows with the torque that the joint carries."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from pipelines.model.effects.base import ArmModel, Effect, Hooks, Predict, Quantity, Values
from pipelines.model.rigid.body import Array, Motion

__all__ = ["LoadFriction"]

_HALF = 0.5  # from which the share of what rubs behind it is refitted


@dataclass(frozen=True)
class LoadFriction(Effect):
    """τ = µ |τ_l| tanh(w v), τ_l what the joint transmits: its torque without friction. Coulomb friction is Fc + µ |τ_l| then.

    What rubs behind a gear is part of its load: τ_l has the share s of the joint's other friction too. Lifting a weight then rubs
    more than lowering it, which is no friction that differs by direction.
    """

    sharpness: float = 100.0  # w [s/rad]
    behind: float = 0.0  # s, held where it is 0

    name = "load_friction"
    title = "Friction that grows with load"
    parameters = (
        Quantity("mu", "1", 0.0, 0.5, "friction per unit of transmitted torque"),
        Quantity("sharpness", "s/rad", 5.0, 2000.0, "inverse of the speed over which it changes sign", shape=True),
        Quantity("behind", "1", 0.0, 1.0, "share of the joint's other friction that loads it too", shape=True, unsaid=0.0),
    )
    signature = "Friction that grows with the torque the joint carries and changes sign with the direction of motion."
    explanation = "Teeth and bearings are pressed together by the torque that passes them, and rub in proportion."
    remedy = "Check the lubrication of the gear; compensate it with the predicted torque."
    experiment = "Move the joint at one speed in both directions under three loads: three postures, or payloads."
    twins = ("torque_gain", "position_friction")
    shared = ("sharpness",)
    friction = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        load = self.own(self.predicted(motion, arm)) - (1.0 - self.behind) * self.own(arm.friction_torque(motion))
        return self.on_own_row(arm, np.abs(load) * np.tanh(self.sharpness * self.own(motion.dq)))

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        for sharpness in (10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0):
            yield replace(self, sharpness=sharpness)

    @property
    def free(self) -> tuple[str, ...]:
        return tuple(name for name in super().free if name != "behind" or self.behind > 0.0)

    def forms(self) -> tuple[Self, ...]:
        return (replace(self, behind=_HALF),)

    def curve(self, dq: Array, arm: ArmModel, values: Values) -> Array:
        """Under the load that the joint carries at rest, and what rubs behind it."""
        still = np.zeros((len(dq), arm.n_joints))
        resting = Motion(np.zeros(len(dq)), still, still, still)
        moving = replace(resting, dq=self.on_own_row(arm, dq)[..., 0])
        load = self.own(arm.torque(resting)) + values.get("behind", 0.0) * self.own(arm.friction_torque(moving))
        return np.asarray(values["mu"] * np.abs(load) * np.tanh(values["sharpness"] * dq))

    def apply(self, motion: Motion, arm: ArmModel, values: Values, predict: Predict | None = None) -> Array:
        """The load is the torque of everything inside it, friction before it apart and other effects included."""
        tau = predict(motion, arm) if predict is not None else arm.torque(motion)
        own, side = self.own(tau), np.tanh(values["sharpness"] * self.own(motion.dq))
        load = own - (1.0 - values.get("behind", 0.0)) * self.own(arm.friction_torque(motion))
        tau[:, self._index] = own + values["mu"] * np.abs(load) * side
        return tau

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """What the drive applies, τ, is friction before it f, the load τ_l and what that causes:

            τ_l = (τ - f)/(1 + µ sign(τ - f) tanh(w v))

        Solved for the load, because the load holds the acceleration that is being computed.
        """
        def applied(command: Array, motion: Motion, _: Array) -> Array:
            left, friction = command.copy(), (1.0 - values.get("behind", 0.0)) * self.own(arm.friction_torque(motion))
            passed = self.own(command) - friction
            side = np.sign(passed) * np.tanh(values["sharpness"] * self.own(motion.dq))
            left[..., self._index] = friction + passed / (1.0 + values["mu"] * side)
            return left

        return Hooks(actuator=applied)
