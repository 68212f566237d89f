"""A drive that gives more or less torque than its command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

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

__all__ = ["TorqueGain"]

_LEAST = 1e-6  # numerics: of the torque that arrives


@dataclass(frozen=True)
class TorqueGain(Effect):
    """Applied torque = (1 + ε) logged torque, so that the log shows τ/(1 + ε).

    The column is τ, the model's torque, its amplitude c = 1/(1 + ε) - 1.
    """

    name = "torque_gain"
    parameters = Parameters(
        Quantity("gain_error", "1", -0.7, 2.0, "applied torque = (1 + gain_error) logged torque",
                 # a current sensor that is exact to a hundredth of its range may be off by so much
                 healthy=0.0075))
    acts_on = "drive"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm, self.own(predicted(arm, motion)))

    def amplitudes(self, values: Values) -> Array:
        return np.array([1.0 / (1.0 + values["gain_error"]) - 1.0])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        return {"gain_error": 1.0 / max(1.0 + float(amplitudes[0]), _LEAST) - 1.0}

    def apply(self, motion: Motion, arm: ArmModel, values: Values,
              predict: Predict | None = None) -> Array:
        """Return the torque, all of which is scaled, other effects included."""
        tau = predict(motion, arm) if predict is not None else arm.torque(motion)
        tau[:, self._index] /= 1.0 + values["gain_error"]
        return tau

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        own, gain = self._index, 1.0 + values["gain_error"]
        return Hooks(drive=(own, lambda command, _, m: command[own] * gain))
