"""A spring between a motor and its link."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from math import inf, isfinite, pi, sqrt
from typing import Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.perturbation import (
    deflection,
    perturbed_by,
    rate_of,
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
from pipelines.effects.drive_apart import DriveApart, rigid_torque_of

__all__ = ["JointElasticity"]


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
    parameters = Parameters(
        Quantity("stiffness", "N m/rad", 1.0, 1e7, "of the spring between motor and link"),
        Quantity("damping", "N m s/rad", 0.0, 1e3, "beside the spring", shape=True),
        Quantity("frequency", "Hz", 0.1, 1e4, "of the link on its spring, the motor locked",
                 derived=True),
        Quantity("motor_inertia", "kg m^2", 0.0, 10.0, "of what turns with the motor", shape=True))
    evidence = "frequency responses"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.several([self], motion, arm)[0]

    def several(self, shapes: Sequence[Self], motion: Motion, arm: ArmModel) -> list[Array]:
        """All springs feel the same torque, which has the same slopes for all; d = x k [N m]."""
        force, found = self.own(rigid_torque_of(arm)(motion)), []
        slopes = rigid_slopes(arm.body, arm.p, motion, self._index)
        for shape in shapes:
            d = shape.motor_inertia * self.own(motion.ddq) - force
            rate = rate_of(d, motion.t)
            second = rate_of(rate, motion.t)
            tau = perturbed_by(slopes, d, rate, second)
            tau[:, self._index] -= shape.motor_inertia * second
            found.append(tau[..., None])
        return found

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """No motor, a light one and one of a third of what the joint feels; lightly damped."""
        felt = _felt(arm, motion.q, self._index)
        for share in (0.0, 0.1, 0.3):
            yield replace(self, motor_inertia=share * felt, link_inertia=(1.0 - share) * felt)

    def amplitudes(self, values: Values) -> Array:
        return np.array([1.0 / values["stiffness"]])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        compliance = float(amplitudes[0])
        stiffness = 1.0 / compliance if compliance else inf
        frequency = sqrt(max(stiffness / self.link_inertia, 0.0)) / (2.0 * pi)
        return {
            "stiffness": stiffness, "damping": self.damping, "frequency": frequency,
            "motor_inertia": self.motor_inertia
        }

    def at(self, values: Values) -> Self:
        k, f = values["stiffness"], values["frequency"]
        link = k / (2.0 * pi * f) ** 2 if 0.0 < k < inf and 0.0 < f < inf else self.link_inertia
        return replace(self, damping=values["damping"], motor_inertia=values["motor_inertia"],
                       link_inertia=link)

    def apply(self, motion: Motion, arm: ArmModel, values: Values,
              predict: Predict | None = None) -> Array:
        """Return the torque with τ(q + x) - τ(q) of the rigid arm; the motor does not follow x."""
        without = predict(motion, arm) if predict is not None else arm.torque(motion)
        if not isfinite(values["stiffness"]):
            return without
        motor, spring = values["motor_inertia"], (values["stiffness"], values["damping"])
        x, rate, second = deflection(arm.body, arm.p, motion, self._index, *spring, -motor)
        bent = rigid_torque_of(arm)(shifted(motion, self._index, x, rate, second))
        more = bent - rigid_torque(arm.body, arm.p, motion)
        more[:, self._index] -= motor * second
        return np.asarray(without + more)

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Return the hooks of an arm that is the links; the motor is two states, with friction."""
        k, d = values["stiffness"], values["damping"]
        # of a motor without inertia nothing can be integrated
        light = 0.01 * _felt(arm, np.zeros((1, arm.n_joints)), self._index)
        drive = DriveApart(self._index, max(values["motor_inertia"], light),
                           friction_at(arm, self._index + 1),
                           lambda angle, speed: k * angle + d * speed, lambda tau: tau / k)
        return drive.hooks(arm.n_joints)


def _felt(arm: ArmModel, q: Array, index: int) -> float:
    """Inertia [kg m^2] that the joint feels, the others held, averaged over q (samples, joints)."""
    some = q[::max(1, len(q) // 200)]
    return float(np.mean(arm.body.mass_matrix(some, arm.p)[:, index, index]))
