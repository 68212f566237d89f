"""A drive whose torque follows its command late."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.effects.base import (
    SAMPLED,
    ArmModel,
    Effect,
    Hooks,
    Parameters,
    Predict,
    Quantity,
    Values,
    predicted,
)
from pipelines.signal.first_order import continuous, later, rate_of_change

__all__ = ["DriveLag"]


@dataclass(frozen=True)
class DriveLag(Effect):
    """T dτ/dt = u - τ, so that the log, which holds the command, shows u = τ + T dτ/dt.

    The log shows it earlier than the arm feels it. A filter that is computed once a sample h acts
    at once, half a sample earlier: τ_k = a τ_{k-1} + (1 - a) u_k, a = exp(-h/T).
    """

    sample_time: float = 0.0  # h [s]; 0: not computed once a sample
    step: float = 0.0  # [s] of the logs

    name = "drive_lag"
    parameters = Parameters(
        # a current loop of 800 Hz
        Quantity("time_constant", "s", 0.0, 0.2, "of the torque behind its command", healthy=2e-4),
        SAMPLED)
    acts_on = "drive"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm, rate_of_change(self.own(predicted(arm, motion)), motion.t))

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        yield replace(self, step=motion.sample_time)

    def forms(self) -> tuple[Self, ...]:
        return replace(self, sample_time=0.0), replace(self, sample_time=self.step)

    def apply(self, motion: Motion, arm: ArmModel, values: Values,
              predict: Predict | None = None) -> Array:
        """Return the torque, all of which lags, other effects included."""
        tau = predict(motion, arm) if predict is not None else arm.torque(motion)
        own, (time, sooner) = self.own(tau), continuous(values["time_constant"],
                                                        values.get("sample_time", 0.0))
        tau[:, self._index] = later(own + time * rate_of_change(own, motion.t), motion.t, -sooner)
        return tau

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Exact while a command is held: τ = u + (τ_k - u) e^(-(t - t_k)/T).

        The memory is τ_k, t_k and u; the drive has settled at the first command; before that there
        is none. The torque of a digital filter is constant over a sample.
        """
        time, digital = max(values["time_constant"], 1e-9), values.get("sample_time", 0.0) > 0.0

        def update(motion: Motion, command: Array, states: Array) -> Array:
            now = self.own(command)
            towards = now if digital else states[:, 2]
            reached = np.where(np.isnan(states[:, 0]), now, _reached(states, motion.t, towards,
                                                                     time))
            return np.stack([reached, motion.t, now], axis=1)

        def applied(command: Array, motion: Motion, states: Array) -> Array:
            late = command.copy()
            late[..., self._index] = states[:, 0] if digital else _reached(
                states, motion.t, self.own(command), time)
            return late

        return Hooks(actuator=applied, states=3, start=lambda motion, _: np.full(
            (len(motion.t), 3), np.nan), update=update)


def _reached(states: Array, t: Array, command: Array, time: float) -> Array:
    return np.asarray(command + (states[:, 0] - command)
                      * np.exp(-np.maximum(t - states[:, 1], 0.0) / time))
