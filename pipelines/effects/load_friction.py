"""Friction that grows with the torque that the joint carries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.functions import ARRAYS, Functions
from pipelines.effects.base import (
    SHARPNESSES,
    ArmModel,
    Hooks,
    Parameters,
    Predict,
    Quantity,
    Values,
    predicted,
)
from pipelines.effects.config import EFFECTS
from pipelines.effects.kinds import FrictionLaw

__all__ = ["LoadFriction"]


@dataclass(frozen=True)
class LoadFriction(FrictionLaw):
    """τ = µ |τ_l| tanh(w v), τ_l what the joint transmits: its torque without friction.

    Coulomb friction is Fc + µ |τ_l| then.

    What rubs behind a gear is part of its load: τ_l has the share s of the joint's other friction
    too. Lifting a weight then rubs more than lowering it, which is no friction that differs by
    direction. And a gear may lose a part of what goes in, not of what comes out: the share i of the
    loss is part of the load as well,

        τ = µ |τ_l| tanh(w v) / (1 - i µ c),   c = sign(τ_l) tanh(w v).
    """

    sharpness: float = 100.0  # w [s/rad]
    behind: float = 0.0  # s, held where it is 0
    input_side: float = 0.0  # i, held where it is 0

    name = "load_friction"
    parameters = Parameters(
        Quantity("mu", "1", 0.0, 0.5, "friction per unit of transmitted torque"),
        Quantity("sharpness", "s/rad", 5.0, 2000.0,
                 "inverse of the speed over which it changes sign", shape=True, shared=True,
                 grid=SHARPNESSES),
        Quantity("behind", "1", 0.0, 1.0, "share of the joint's other friction that loads it too",
                 shape=True, unsaid=0.0, held=0.0),
        Quantity("input_side", "1", 0.0, 1.0,
                 "how far it goes by what goes in, not by what comes out", shape=True, unsaid=0.0,
                 held=0.0))

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        load = self.own(predicted(
            arm, motion)) - (1.0 - self.behind) * self.own(arm.friction_torque(motion))
        return self.on_own_row(arm, np.abs(load) * np.tanh(self.sharpness * self.own(motion.dq)))

    def forms(self) -> tuple[Self, ...]:
        behind = replace(self, behind=EFFECTS.half)
        return self, behind, replace(behind, input_side=EFFECTS.half)

    def curve(self, dq: Array, arm: ArmModel, values: Values) -> Array:
        """Under the load that the joint carries at rest, and what rubs behind it."""
        still = np.zeros((len(dq), arm.n_joints))
        resting = Motion(np.zeros(len(dq)), still, still, still)
        moving = replace(resting, dq=self.on_own_row(arm, dq)[..., 0])
        load = self.own(
            arm.torque(resting)) + values.get("behind", 0.0) * self.own(arm.friction_torque(moving))
        return _lost(load, np.tanh(values["sharpness"] * dq), values)

    def apply(self, motion: Motion, arm: ArmModel, values: Values,
              predict: Predict | None = None) -> Array:
        """Return the torque; the load is that of all inside it but for friction before it."""
        tau = predict(motion, arm) if predict is not None else arm.torque(motion)
        own, side = self.own(tau), np.tanh(values["sharpness"] * self.own(motion.dq))
        load = own - (1.0 - values.get("behind", 0.0)) * self.own(arm.friction_torque(motion))
        tau[:, self._index] = own + _lost(load, side, values)
        return tau

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Return the load of the drive's torque τ: τ is friction before it f, τ_l and its friction.

            τ_l = (τ - f)(1 - i µ c)/(1 + (1 - i) µ c),   c = sign(τ - f) tanh(w v)

        Solved for the load, because the load holds the acceleration that is being computed.
        """
        curves, index, behind = arm.friction_curves(self._index
                                                    + 1), self._index, values.get("behind", 0.0)
        mu, into, w = values["mu"], values.get("input_side", 0.0), values["sharpness"]

        def reached(asked: Any, before: Any, v: Any, m: Functions) -> Any:
            friction = (1.0 - behind) * before
            passed = asked - friction
            lost = mu * m.sign(passed) * m.tanh(w * v)
            return friction + passed * (1.0 - into * lost) / (1.0 + (1.0 - into) * lost)

        def drive(command: Sequence[Any], speed: Sequence[Any], m: Functions) -> Any:
            v = speed[index]
            return reached(command[index], sum(curve.of(v, m) for curve in curves or ()), v, m)

        def actuator(command: Array, motion: Motion, _: Array) -> Array:
            left = command.copy()
            left[..., index] = reached(self.own(command), self.own(arm.friction_torque(motion)),
                                       self.own(motion.dq), ARRAYS)
            return left

        return Hooks(actuator=actuator) if curves is None else Hooks(drive=(index, drive))


def _lost(load: Array, side: Array, values: Values) -> Array:
    """Return what a load (…) costs where the joint moves to one `side` (…) [-1, 1]."""
    into = values.get("input_side", 0.0) * values["mu"] * np.sign(load) * side
    return np.asarray(values["mu"] * np.abs(load) * side / (1.0 - into))
