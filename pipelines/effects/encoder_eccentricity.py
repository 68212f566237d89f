"""An encoder's disc that sits off its axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.perturbation import arm_slopes, perturbed_by, shifted
from pipelines.effects.base import ArmModel, Effect, Hooks, Parameters, Predict, Quantity, Values

__all__ = ["EncoderEccentricity"]

_ROUNDS = 6  # numerics: each leaves A times the error before


@dataclass(frozen=True)
class EncoderEccentricity(Effect):
    """q_measured = q + A sin(q + φ), once a turn.

    To first order τ = A cos φ P_j(-sin q_j) + A sin φ P_j(-cos q_j). Exactly: q_j, its speed and
    its acceleration corrected.
    """

    name = "encoder_eccentricity"
    parameters = Parameters(
        Quantity("amplitude", "rad", 0.0, 0.1, "largest error of the angle", revolute=True),
        Quantity("phase", "rad", -np.pi, np.pi, "of the error at zero angle", period=2.0 * np.pi))
    acts_on = "encoder"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        q, v, u = (self.own(x) for x in (motion.q, motion.dq, motion.ddq))
        s, c = np.sin(q), np.cos(q)
        errors = ((-s, -c * v, s * v * v - c * u), (-c, s * v, c * v * v + s * u))
        slopes = arm_slopes(arm, motion, self._index)
        return np.stack([perturbed_by(slopes, *error) for error in errors], axis=-1)

    def amplitudes(self, values: Values) -> Array:
        return values["amplitude"] * np.array([np.cos(values["phase"]), np.sin(values["phase"])])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        sine, cosine = amplitudes
        return {
            "amplitude": float(np.hypot(sine, cosine)), "phase": float(np.arctan2(cosine, sine))
        }

    def apply(self, motion: Motion, arm: ArmModel, values: Values,
              predict: Predict | None = None) -> Array:
        """Return the torque of the corrected motion.

            q̇ = q̇_m/(1 + e'),  q̈ = (q̈_m + e q̇²)/(1 + e'),  e = A sin(q + φ), e' = A cos(q + φ)
        """
        true = self._corrected(motion, values) if values["amplitude"] else motion
        return predict(true, arm) if predict is not None else arm.torque(true)

    def _corrected(self, motion: Motion, values: Values) -> Motion:
        q, v, u = (self.own(x) for x in (motion.q, motion.dq, motion.ddq))
        at = _settled(q, values)
        error, slope = values["amplitude"] * np.sin(
            at + values["phase"]), values["amplitude"] * np.cos(at + values["phase"])
        speed = v / (1.0 + slope)
        return shifted(motion, self._index, at - q, speed - v, (u + error * speed * speed) /
                       (1.0 + slope) - u)

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        def sensor(q: Array, _: Array) -> Array:
            seen = q.copy()
            seen[:, self._index] += values["amplitude"] * np.sin(self.own(q) + values["phase"])
            return seen

        return Hooks(sensor=sensor, settled=lambda motion, _: self._corrected(motion, values))


def _settled(measured: Array, values: Values) -> Array:
    """q that is read as `measured`."""
    q = measured
    for _ in range(_ROUNDS):
        q = measured - values["amplitude"] * np.sin(q + values["phase"])
    return q
