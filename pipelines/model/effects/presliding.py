"""Presliding: before a joint slides, its contacts bend like bristles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from pipelines.model.effects.base import ArmModel, Effect, Hooks, Quantity, Values
from pipelines.model.rigid.body import Array, Motion

__all__ = ["Presliding"]


@dataclass(frozen=True)
class Presliding(Effect):
    """τ = A (u + T_d du/dt), du/dt = (v - |v| u)/x_c: friction that turns over with travel, not with speed.

    T_d = 0 is Dahl 1968; T_d = σ1/σ0 is LuGre with constant sliding friction (Canudas de Wit et al. 1995, eq. (1)-(3)), u its
    bristles' bending in units of x_c, A = σ0 x_c. It takes the place of as much Coulomb friction. Between two reversals
    u = s + (u_r - s) exp(-|q - q_r|/x_c) with s the direction: exact, and no speed is integrated.
    """

    distance: float = 1e-2  # x_c [rad]
    damping_time: float = 0.0  # T_d [s]

    name = "presliding"
    title = "Presliding"
    parameters = (
        Quantity("amplitude", "N m", 0.0, 50.0, "friction that turns over with travel"),
        Quantity("distance", "rad", 1e-6, 0.2, "travel over which it turns over", shape=True),
        Quantity("damping_time", "s", 0.0, 0.1, "damping of the bristles over their stiffness", shape=True),
    )
    signature = "After each reversal friction turns over along a loop against position, whatever the speed."
    explanation = "Contacts, seals and gears bend before they slide, and bend back after a reversal."
    remedy = "Simulate it where slow reversals matter; friction compensation by the sign of speed alone pushes too early."
    experiment = "Reverse the joint slowly and often, with strokes from a tenth of the distance to many times it."
    twins = ("backlash", "coulomb", "stribeck")
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        v = self.own(motion.dq)
        u = _bristles(self.own(motion.q), self.distance)
        if self.damping_time:
            u = u + self.damping_time * (v - np.abs(v) * u) / self.distance
        return self.on_own_row(arm, u)

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """From a thousandth to a tenth of the travel."""
        travel = float(np.ptp(self.own(motion.q))) or 1.0
        for distance in np.geomspace(1e-3 * travel, 0.1 * travel, 9).tolist():
            yield replace(self, distance=float(np.clip(distance, 1e-6, 0.2)))

    def curve(self, dq: Array, arm: ArmModel, values: Values) -> Array:
        """What is left of it at constant speed: Coulomb friction."""
        return np.asarray(values["amplitude"] * np.sign(dq))

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        amplitude, distance, time = (values[name] for name in ("amplitude", "distance", "damping_time"))

        def rate(motion: Motion, _: Array, states: Array) -> Array:
            v = self.own(motion.dq)
            return np.asarray((v - np.abs(v) * states[:, 0])[:, None] / distance)

        def load(motion: Motion, states: Array) -> Array:
            u = states[:, 0]
            if time:
                u = u + time * rate(motion, u, states)[:, 0]
            return self.on_own_row(arm, amplitude * u)[..., 0]

        return Hooks(load=load, states=1, rate=rate)


def _bristles(q: Array, distance: float) -> Array:
    """u (samples,) along the travel `q` (samples,), relaxed at the start; exact between the samples where they keep direction."""
    step = np.diff(q)
    moved = np.flatnonzero(step)
    if not moved.size:
        return np.zeros(len(q))
    side = np.sign(step[moved])
    turns = np.concatenate(([0], np.flatnonzero(np.diff(side)) + 1))  # where in `moved` a direction begins
    begin, s = moved[turns], side[turns]  # samples of the reversals
    keep = np.exp(-np.abs(np.diff(q[np.append(begin, len(q) - 1)])) / distance)
    at, bent = 0.0, np.empty(len(turns))
    for k in range(len(turns)):
        bent[k] = at
        at = s[k] + (at - s[k]) * keep[k]
    which = np.maximum(np.searchsorted(begin, np.arange(len(q)), side="right") - 1, 0)
    u = s[which] + (bent[which] - s[which]) * np.exp(-np.abs(q - q[begin[which]]) / distance)
    u[:begin[0] + 1] = 0.0
    return np.asarray(u)
