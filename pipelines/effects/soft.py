"""What gives way like a spring: a joint between its motor and its link, and the base of the arm."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from math import inf, isfinite, pi, sqrt
from typing import Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.perturbation import (
    deflection,
    oscillation,
    perturbed_by,
    rate_of,
    rigid_slopes,
    rigid_torque,
    shifted,
)
from pipelines.effects.base import ArmModel, Effect, Hooks, Values, friction_at
from pipelines.effects.hooks import DriveApart

__all__ = ["BaseResonance", "JointElasticity"]

_FIRST = 0  # numerics: the joint whose axis the base turns about


@dataclass(frozen=True)
class JointElasticity(Effect):
    """k x + d ẋ + τ_link(q + x) = 0, x = q_link - q.

    Torque, friction and encoder sit on the motor's side. τ_link is the rigid torque of the joint
    without its motor, τ_j - J_m q̈_j. To first order

        x = -(τ_j - J_m q̈_j)/k,    τ = 1/k (P_j(-τ_j) + J_m P_j(q̈_j) - J_m ẍ k)

    with P_j of the rigid arm, for friction does not feel the link. Exactly: x is solved from sample
    to sample. The frequency is √(k/J)/2π, the motor locked, J the link's inertia averaged over the
    motion.
    """

    damping: float = 0.0  # d [N m s/rad]
    motor_inertia: float = 0.0  # J_m [kg m^2]
    # J [kg m^2]; what the frequency follows from
    link_inertia: float = field(default=1.0, compare=False)

    name = "joint_elasticity"
    evidence = "frequency responses"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.several([self], motion, arm)[0]

    def several(self, shapes: Sequence[Self], motion: Motion, arm: ArmModel) -> list[Array]:
        """All springs feel the same torque, which has the same slopes for all; d = x k [N m]."""
        force, found = self.own(rigid_torque(arm.body, arm.p, motion)), []
        slopes = rigid_slopes(arm.body, arm.p, motion, self.index)
        for shape in shapes:
            d = shape.motor_inertia * self.own(motion.ddq) - force
            rate = rate_of(d, motion.t)
            second = rate_of(rate, motion.t)
            tau = perturbed_by(slopes, d, rate, second)
            tau[:, self.index] -= shape.motor_inertia * second
            found.append(tau[..., None])
        return found

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """No motor, a light one and one of a third of what the joint feels; lightly damped."""
        felt = _felt(arm, motion.q, self.index)
        for share in (0.0, 0.1, 0.3):
            yield replace(self, motor_inertia=share * felt, link_inertia=(1.0 - share) * felt)

    def amplitudes(self, values: Values) -> Array:
        return np.array([1.0 / values["stiffness"]])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        compliance = float(amplitudes[0])
        stiffness = 1.0 / compliance if compliance else inf
        frequency = sqrt(max(stiffness / self.link_inertia, 0.0)) / (2.0 * pi)
        return {
            "stiffness": stiffness,
            "damping": self.damping,
            "frequency": frequency,
            "motor_inertia": self.motor_inertia,
        }

    def at(self, values: Values) -> Self:
        k, f = values["stiffness"], values["frequency"]
        known = 0.0 < k < inf and 0.0 < f < inf
        link = k / (2.0 * pi * f) ** 2 if known else self.link_inertia
        return replace(
            self,
            damping=values["damping"],
            motor_inertia=values["motor_inertia"],
            link_inertia=link,
        )

    def torque(self, motion: Motion, arm: ArmModel, values: Values) -> Array:
        """Return τ(q + x) - τ(q) of the rigid arm; the motor does not follow x."""
        if not isfinite(values["stiffness"]):
            return np.zeros_like(motion.q)
        motor, spring = values["motor_inertia"], (values["stiffness"], values["damping"])
        x = deflection(arm.body, arm.p, motion, self.index, *spring, -motor)
        more = _moved_by(arm, motion, self.index, x)
        more[:, self.index] -= motor * x[2]
        return more

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Return the hooks of an arm that is the links; the motor is two states, with friction."""
        k, d = values["stiffness"], values["damping"]
        # of a motor without inertia nothing can be integrated
        light = 0.01 * _felt(arm, np.zeros((1, arm.n_joints)), self.index)
        drive = DriveApart(
            self.index,
            max(values["motor_inertia"], light),
            friction_at(arm, self.index + 1),
            lambda angle, speed: k * angle + d * speed,
            lambda tau: tau / k,
        )
        return drive.hooks(arm.n_joints)


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
    evidence = "frequency responses"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.several([self], motion, arm)[0]

    def several(self, shapes: Sequence[Self], motion: Motion, arm: ArmModel) -> list[Array]:
        """All bases are swung by the same torque, which has the same slopes for all."""
        force = -rigid_torque(arm.body, arm.p, motion)[:, _FIRST]
        slopes, one, found = rigid_slopes(arm.body, arm.p, motion, _FIRST), np.ones_like(force), []
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
            "frequency": self.frequency,
            "damping_ratio": self.damping_ratio,
            "inertia": 1.0 / mobility if mobility else inf,
        }

    def torque(self, motion: Motion, arm: ArmModel, values: Values) -> Array:
        inertia, w = values["inertia"], 2.0 * pi * values["frequency"]
        if not isfinite(inertia):
            return np.zeros_like(motion.q)
        damping = 2.0 * values["damping_ratio"] * w * inertia
        x = deflection(arm.body, arm.p, motion, _FIRST, inertia * w * w, damping, inertia)
        return _moved_by(arm, motion, _FIRST, x)

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
            lost = friction(motion, motion.dq[:, _FIRST])
            return np.asarray((lost - tau[:, _FIRST]) / (inertia * w * w))

        def settled(motion: Motion, tau: Array) -> Motion:
            q = motion.q.copy()
            q[:, _FIRST] += rests(motion, tau)
            return replace(motion, q=q)

        def start(motion: Motion, tau: Array) -> Array:
            return np.stack([rests(motion, tau), np.zeros(len(tau))], axis=-1)

        return Hooks(
            actuator=actuator, sensor=sensor, states=2, settled=settled, start=start, rate=rate
        )


def _moved_by(arm: ArmModel, motion: Motion, index: int, x: tuple[Array, Array, Array]) -> Array:
    """Return τ(q + x) - τ(q) of the rigid arm (samples, joints), of x, ẋ, ẍ at one joint."""
    there = rigid_torque(arm.body, arm.p, shifted(motion, index, *x))
    return np.asarray(there - rigid_torque(arm.body, arm.p, motion))


def _felt(arm: ArmModel, q: Array, index: int) -> float:
    """Inertia [kg m^2] that the joint feels, the others held, averaged over q (samples, joints)."""
    some = q[:: max(1, len(q) // 200)]
    return float(np.mean(arm.body.mass_matrix(some, arm.p)[:, index, index]))
