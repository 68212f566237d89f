"""A drive that gives more or less torque than it is told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.model.effects.base import (
    ArmModel,
    Effect,
    Hooks,
    Parameters,
    Predict,
    Quantity,
    Values,
    Words,
    predicted,
)

__all__ = ["TorqueGain"]

_LEAST = 1e-6  # of the torque that arrives


@dataclass(frozen=True)
class TorqueGain(Effect):
    """Applied torque = (1 + ε) logged torque, so that the log shows τ/(1 + ε), τ the model's torque.

    The column is τ, its amplitude c = 1/(1 + ε) - 1.
    """

    name = "torque_gain"
    parameters = Parameters(
        Quantity("gain_error", "1", -0.7, 2.0, "applied torque = (1 + gain_error) logged torque",
                 healthy=0.0075))  # a current sensor that is exact to a hundredth of its range may be off by so much
    words = Words("Wrong torque scale", size="gain_error",
        signature="A residual in proportion to the joint's own torque, at all speeds and in all postures.",
        explanation="Torque constant, current measurement or gear ratio is not what the log assumes; magnets lose strength.",
        remedy="Where it fell, look at the motor's magnets and the amplifier; correct the torque constant.",
        experiment="Hold a known load in several postures, or repeat an experiment with a known payload.")
    acts_on = "drive"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm, self.own(predicted(arm, motion)))

    def amplitudes(self, values: Values) -> Array:
        return np.array([1.0 / (1.0 + values["gain_error"]) - 1.0])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        return {"gain_error": 1.0 / max(1.0 + float(amplitudes[0]), _LEAST) - 1.0}

    def apply(self, motion: Motion, arm: ArmModel, values: Values, predict: Predict | None = None) -> Array:
        """The whole torque is scaled, other effects included."""
        tau = predict(motion, arm) if predict is not None else arm.torque(motion)
        tau[:, self._index] /= 1.0 + values["gain_error"]
        return tau

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        own, gain = self._index, 1.0 + values["gain_error"]
        return Hooks(drive=(own, lambda command, _, m: command[own] * gain))
