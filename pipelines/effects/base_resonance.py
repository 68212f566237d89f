"""A base resonance under the first joint's torque."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite, pi
from typing import Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.perturbation import (
    deflection,
    oscillation,
    perturbed_by,
    rigid_slopes,
    rigid_torque,
    shifted,
)
from pipelines.effects.base import (
    ArmModel,
    Effect,
    Hooks,
    Parameters,
    Predict,
    Quantity,
    Values,
    friction_at,
)
from pipelines.effects.drive_apart import rigid_torque_of

__all__ = ["BaseResonance"]

_FIRST = 0  # numerics: the joint whose axis the base turns about


@dataclass(frozen=True)
class BaseResonance(Effect):
    """I (ẍ + 2 ζ w ẋ + w² x) = -τ_1, w = 2πf.

    The base turns by x about the first joint's axis, and the arm with it.

    τ_1 is the rigid arm's torque on that joint; its encoder and its friction turn with the base. To
    first order τ = 1/I P_1(x I) with τ_1 of the arm on a firm base; exactly, of the arm as it then
    moves.
    """

    frequency: float = 28.0  # f [Hz]
    damping_ratio: float = 0.05  # ζ

    name = "base_resonance"
    scope = "arm"
    parameters = Parameters(
        Quantity("frequency", "Hz", 1.0, 200.0, "of the base alone: the pole", shape=True,
                 grid=(8.0, 12.0, 17.0, 24.0, 28.0, 34.0, 48.0)),
        Quantity("damping_ratio", "1", 0.001, 1.0, "of the base", shape=True),
        Quantity("inertia", "kg m^2", 1e-3, 1e5, "of the base about the first joint's axis"))
    evidence = "frequency responses"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.several([self], motion, arm)[0]

    def several(self, shapes: Sequence[Self], motion: Motion, arm: ArmModel) -> list[Array]:
        """All bases are swung by the same torque, which has the same slopes for all."""
        force, one, found = -rigid_torque_of(arm)(motion)[:, _FIRST], np.ones(len(motion.t)), []
        slopes = rigid_slopes(arm.body, arm.p, motion, _FIRST)
        for shape in shapes:
            w = 2.0 * pi * shape.frequency
            x = oscillation(motion.t, one, 2.0 * shape.damping_ratio * w * one, w * w * one, force)
            found.append(perturbed_by(slopes, *x)[..., None])
        return found

    def amplitudes(self, values: Values) -> Array:
        return np.array([1.0 / values["inertia"]])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        mobility = float(amplitudes[0])
        return {
            "frequency": self.frequency, "damping_ratio": self.damping_ratio,
            "inertia": 1.0 / mobility if mobility else inf
        }

    def apply(self, motion: Motion, arm: ArmModel, values: Values,
              predict: Predict | None = None) -> Array:
        without = predict(motion, arm) if predict is not None else arm.torque(motion)
        inertia, w = values["inertia"], 2.0 * pi * values["frequency"]
        if not isfinite(inertia):
            return without
        damping = 2.0 * values["damping_ratio"] * w * inertia
        x = deflection(arm.body, arm.p, motion, _FIRST, inertia * w * w, damping, inertia)
        swung = rigid_torque_of(arm)(shifted(motion, _FIRST, *x))
        return np.asarray(without + (swung - rigid_torque(arm.body, arm.p, motion)))

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Return the hooks: the arm's first angle is against the ground, the base two states."""
        inertia, ratio = values["inertia"], values["damping_ratio"]
        w = 2.0 * pi * values["frequency"]
        friction = friction_at(arm, _FIRST + 1)

        def actuator(command: Array, motion: Motion, states: Array) -> Array:
            """Friction is that of the speed against the base."""
            passed, speed = command.copy(), motion.dq[:, _FIRST]
            passed[:, _FIRST] += friction(motion, speed) - friction(motion, speed - states[:, 1])
            return passed

        def rate(motion: Motion, command: Array, states: Array) -> Array:
            x, v = states.T
            reaction = command[:, _FIRST] - friction(motion, motion.dq[:, _FIRST] - v)
            return np.stack([v, -w * w * x - 2.0 * ratio * w * v - reaction / inertia], axis=-1)

        def sensor(q: Array, states: Array) -> Array:
            seen = q.copy()
            seen[:, _FIRST] -= states[:, 0]
            return seen

        def rests(motion: Motion, tau: Array) -> Array:
            return np.asarray((friction(motion, motion.dq[:, _FIRST]) - tau[:, _FIRST]) /
                              (inertia * w * w))

        def settled(motion: Motion, tau: Array) -> Motion:
            q = motion.q.copy()
            q[:, _FIRST] += rests(motion, tau)
            return replace(motion, q=q)

        def start(motion: Motion, tau: Array) -> Array:
            return np.stack([rests(motion, tau), np.zeros(len(tau))], axis=-1)

        return Hooks(actuator=actuator, sensor=sensor, states=2, settled=settled, start=start,
                     rate=rate)
