"""A logged torque that went through a low-pass."""

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
from pipelines.effects.config import EFFECTS
from pipelines.signal.first_order import continuous, held_mean, lagging, later, rate_of_change

__all__ = ["TorqueLag"]

_LONG = 4.0  # numerics: samples


@dataclass(frozen=True)
class TorqueLag(Effect):
    """T dy/dt = τ - y, y the logged torque: y = τ - T dτ/dt to first order.

    The arm feels τ at once.

    A filter that is computed once a sample h acts half a sample earlier: y_k = a y_{k-1} + (1 - a)
    τ_k, a = exp(-h/T).
    """

    sample_time: float = 0.0  # h [s]; 0: not computed once a sample
    step: float = 0.0  # [s] of the logs
    # [s] the lag whose columns a search compares; 0: their limit for a small one
    looked_for: float = 0.0

    name = "torque_lag"
    parameters = Parameters(
        Quantity("time_constant", "s", 0.0, 1.0, "of the logged torque behind the true one",
                 healthy=2e-4),  # a current that is measured within 800 Hz
        SAMPLED)
    acts_on = "record"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        """(H_T τ - τ) / T, at T = 0 -dτ/dt."""
        tau, time = self.own(predicted(arm, motion)), self.looked_for
        change = -rate_of_change(tau, motion.t)
        if time > 0.0:
            change = (lagging(tau, motion.t, time, self._start(motion), motion.since) - tau) / time
        return self.on_own_row(arm, change)

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """Return the limit, and lags in which a torque turns: it is no longer its Taylor series."""
        for time in EFFECTS.lags:
            yield replace(self, looked_for=time, step=motion.sample_time)

    def forms(self) -> tuple[Self, ...]:
        """Return the lag of any length."""
        any_length = replace(self, looked_for=0.0, sample_time=0.0)
        return any_length, replace(any_length, sample_time=self.step)

    def _start(self, motion: Motion) -> float | None:
        """Return the torque [N m] that the log shows first, where it was measured."""
        return None if motion.logged is None else float(self.own(motion.logged))

    def apply(self, motion: Motion, arm: ArmModel, values: Values,
              predict: Predict | None = None) -> Array:
        """Return y = H τ = τ - T H dτ/dt: all torque goes through the low-pass H.

        The first form where the lag is longer than some samples, whatever the torque does between
        them, from the torque that the log shows first, where it was measured; the second keeps its
        slope at T = 0 and is exact to the differences' error.
        """
        tau = predict(motion, arm) if predict is not None else arm.torque(motion)
        own, t = self.own(tau), motion.t
        time, sooner = continuous(values["time_constant"], values.get("sample_time", 0.0))
        if len(t) > 1 and time > _LONG * float(np.median(np.diff(t))):
            lagged = lagging(own, t, time, self._start(motion), motion.since)
        else:
            lagged = own - time * lagging(rate_of_change(own, t), t, time)
        tau[:, self._index] = later(lagged, t, sooner)
        return tau

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Return a change of the log alone: the arm moves as without it."""
        def record(t: Array, command: Array) -> Array:
            logged, own = command.copy(), self.own(command)
            if values.get("sample_time", 0.0) > 0.0:
                logged[:, self._index] = lagging(own, t, values["time_constant"], digital=True)
            else:
                logged[:, self._index] = held_mean(own, float(np.median(np.diff(t))),
                                                   values["time_constant"])
            return logged

        return Hooks(record=record)
