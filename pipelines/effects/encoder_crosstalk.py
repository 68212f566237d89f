"""An encoder whose reading follows another joint."""

from __future__ import annotations

from dataclasses import dataclass

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.perturbation import arm_slopes, perturbed_by, shifted
from pipelines.effects.base import ArmModel, Effect, Hooks, Parameters, Predict, Quantity, Values

__all__ = ["EncoderCrosstalk"]


@dataclass(frozen=True)
class EncoderCrosstalk(Effect):
    """q_measured,j = q_j + c q_i.

    Joint j, where this effect sits, is read with a part of joint i, which is read well.

    To first order τ = c P_j(-q_i). Exactly: c q_i taken off q_j, and so with speed and
    acceleration.
    """

    from_joint: float = 0.0  # i, 1-based

    name = "encoder_crosstalk"
    parameters = Parameters(
        Quantity("coefficient", "1", -0.5, 0.5,
                 "part of the other joint's angle in this one's reading"),
        Quantity("from_joint", "1", 1.0, 64.0, "the other joint", shape=True, discrete=True,
                 joint=True))
    acts_on = "encoder"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return perturbed_by(arm_slopes(arm, motion, self._index), *self._error(motion))[..., None]

    def apply(self, motion: Motion, arm: ArmModel, values: Values,
              predict: Predict | None = None) -> Array:
        true = self._corrected(motion, values) if values["coefficient"] else motion
        return predict(true, arm) if predict is not None else arm.torque(true)

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        c, other = values["coefficient"], int(values["from_joint"]) - 1

        def sensor(q: Array, _: Array) -> Array:
            seen = q.copy()
            seen[:, self._index] += c * q[:, other]
            return seen

        return Hooks(sensor=sensor, settled=lambda motion, _: self._corrected(motion, values))

    def _corrected(self, motion: Motion, values: Values) -> Motion:
        c = values["coefficient"]
        d, rate, second = self.at(values)._error(motion)
        return shifted(motion, self._index, c * d, c * rate, c * second)

    def _error(self, motion: Motion) -> tuple[Array, Array, Array]:
        """-q_i and its derivatives."""
        other = int(self.from_joint) - 1
        return -motion.q[:, other], -motion.dq[:, other], -motion.ddq[:, other]
