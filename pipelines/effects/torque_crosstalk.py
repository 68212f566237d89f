"""A joint that gets part of another joint's torque."""

from __future__ import annotations

from dataclasses import dataclass

from pipelines.dynamics.body import Array, Motion
from pipelines.effects.base import (
    ArmModel,
    Effect,
    Hooks,
    Parameters,
    Predict,
    Quantity,
    Values,
    predicted,
)

__all__ = ["TorqueCrosstalk"]


@dataclass(frozen=True)
class TorqueCrosstalk(Effect):
    """Applied torque of joint j = u_j - c u_i, so that the log shows u_j = τ_j + c τ_i.

    Joint i is the joint before, if none is given.
    """

    from_joint: float = 0.0  # i, 1-based

    name = "torque_crosstalk"
    parameters = Parameters(
        Quantity(
            "coefficient",
            "1",
            -1.0,
            1.0,
            "share of the other joint's torque that this joint has to give more",
            # amplifiers that are in order lead over as much; between a turn and a slide it is
            # one per metre
            healthy=0.002),
        Quantity("from_joint", "1", 1.0, 100.0, "the other joint", shape=True, discrete=True,
                 joint=True))
    acts_on = "drive"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm, predicted(arm, motion)[:, int(self.from_joint) - 1])

    def apply(self, motion: Motion, arm: ArmModel, values: Values,
              predict: Predict | None = None) -> Array:
        """Other effects on both joints included."""
        tau = predict(motion, arm) if predict is not None else arm.torque(motion)
        tau[:, self._index] += values["coefficient"] * tau[:, int(values["from_joint"]) - 1]
        return tau

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        own, other, share = self._index, int(values["from_joint"]) - 1, values["coefficient"]
        return Hooks(drive=(own, lambda command, _, m: command[own] - share * command[other]))
