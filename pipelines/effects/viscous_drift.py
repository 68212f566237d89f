"""Viscous friction that drifts as the joint warms up."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.effects.base import ArmModel, Effect, Hooks, Parameters, Quantity, Values, predicted

__all__ = ["ViscousDrift"]

_FAST = 1e3  # numerics: [rad/s] where dry friction no longer changes


@dataclass(frozen=True)
class ViscousDrift(Effect):
    """τ = r Fv (1 - e^(-(t - t0)/T)) v.

    Viscous friction Fv at the start of the log, (1 + r) Fv in the end.
    """

    time_constant: float = 15.0  # T [s]
    # [s] clock time at which the session began, for a joint that is warm stays warm in the
    since: float | None = None
    # next log; None: each log for itself

    name = "viscous_drift"
    parameters = Parameters(
        Quantity("relative_change", "1", -1.0, 10.0,
                 "of viscous friction, from the start of the log to the end of the drift",
                 healthy=0.0),
        Quantity("time_constant", "s", 0.2, 1000.0, "of the drift", shape=True))
    clock = "session"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        start = motion.t[0] if self.since is None else self.since
        left = np.expm1(-np.maximum(motion.t - start, 0.0) / self.time_constant)
        return self.on_own_row(arm, -self._viscous(arm) * left * self.own(motion.dq))

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """From a fifth to five times the duration; beyond that it is a straight line."""
        duration = max(float(np.ptp(motion.t)), 1.0)
        for share in (0.2, 0.5, 1.5, 5.0):
            yield replace(self, time_constant=float(np.clip(share * duration, 0.2, 1000.0)))

    def curve(self, dq: Array, arm: ArmModel, values: Values) -> Array:
        """Return what is added when the drift has ended."""
        return np.asarray(values["relative_change"] * self._viscous(arm) * dq)

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Its memory is the time at which the log began."""
        change, time = values["relative_change"] * self._viscous(arm), values["time_constant"]

        def load(motion: Motion, states: Array) -> Array:
            grown = -np.expm1(-(motion.t - states[:, 0]) / time)
            return self.on_own_row(arm, change * grown * self.own(motion.dq))[..., 0]

        return Hooks(load=load, states=1, start=lambda motion, _: motion.t[:, None],
                     update=lambda motion, _, states: states)

    def _viscous(self, arm: ArmModel) -> float:
        """Fv [N m s/rad] of the model.

        What of the torque's odd part is linear in the joint's own speed, all else at rest.

        Far above the speeds where friction changes sign, f(v) = Fc + Fv v + c v |v|: from three
        speeds v, 2v, 3v.
        """
        still = np.zeros((6, arm.n_joints))
        speed = self.on_own_row(arm, _FAST * np.array([1.0, 2.0, 3.0, -1.0, -2.0, -3.0]))[..., 0]
        tau = self.own(predicted(arm, Motion(np.arange(6.0), still, speed, still)))
        one, two, three = 0.5 * (tau[:3] - tau[3:])
        bent = 0.5 * (three - 2.0 * two + one)
        return float((two - one - 3.0 * bent) / _FAST)
