"""A drive that turns apart from its link, in simulations of elastic and of loose joints.

    J_m θ̈ = τ - τ_friction(θ̇) - τ_passed(θ - q, θ̇ - q̇)

The arm that is simulated is the links, q; the angle θ - q by which the drive is ahead and its speed
θ̇ are two memories. Encoder and friction sit on the drive. Its inertia is that of a geared rotor:
it feels its own joint's acceleration, not that of the joints before it, which a disc of J_m on a
parallel axis would feel too. All arrays have replicas first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.effects.base import ArmModel, Hooks

__all__ = ["DriveApart", "rigid_torque_of"]


@dataclass(frozen=True)
class DriveApart:
    """The drive of one joint."""

    index: int  # joint, from 0
    inertia: float  # J_m [kg m^2], which the rigid arm counts with the link
    # motion and speed of the drive -> its friction [N m]
    friction: Callable[[Motion, Array], Array]
    # angle and speed of the drive ahead of its link -> torque on the link [N m]
    passed: Callable[[Array, Array], Array]
    ahead: Callable[[Array], Array]  # that torque -> angle by which the drive then rests ahead

    def taken_out(self, n_joints: int) -> Array:
        """Return what has to be added to the rigid arm's inertia matrix to make it the links'."""
        less = np.zeros((n_joints, n_joints))
        less[self.index, self.index] = -self.inertia
        return less

    def hooks(self, n_joints: int) -> Hooks:
        """Return how it enters the simulation of an arm of `n_joints` joints."""
        return Hooks(actuator=self.actuator, sensor=self.sensor, inertia=self.taken_out(n_joints),
                     states=2, settled=self.settled, start=self.start, rate=self.rate)

    def actuator(self, command: Array, motion: Motion, states: Array) -> Array:
        """Return what reaches the link.

        Friction is given back that the plant will take off at the link's speed.
        """
        reached, speed = command.copy(), motion.dq[:, self.index]
        reached[:, self.index] = self.passed(states[:, 0], states[:, 1] - speed) + self.friction(
            motion, speed)
        return reached

    def rate(self, motion: Motion, command: Array, states: Array) -> Array:
        ahead = states[:, 1] - motion.dq[:, self.index]
        left = command[:, self.index] - self.friction(motion, states[:, 1]) - self.passed(
            states[:, 0], ahead)
        return np.stack([ahead, left / self.inertia], axis=-1)

    def sensor(self, q: Array, states: Array) -> Array:
        seen = q.copy()
        seen[:, self.index] += states[:, 0]
        return seen

    def settled(self, motion: Motion, tau: Array) -> Motion:
        """Where the links are when the drive rests at the first position under `tau`."""
        q = motion.q.copy()
        q[:, self.index] -= self._rests(motion, tau)
        return replace(motion, q=q)

    def start(self, motion: Motion, tau: Array) -> Array:
        return np.stack([self._rests(motion, tau), motion.dq[:, self.index]], axis=-1)

    def _rests(self, motion: Motion, tau: Array) -> Array:
        """Angle ahead under what of `tau` reaches the link, as if that did not change."""
        speed, acceleration = motion.dq[:, self.index], motion.ddq[:, self.index]
        return self.ahead(tau[:, self.index] - self.friction(motion, speed)
                          - self.inertia * acceleration)


def rigid_torque_of(arm: ArmModel) -> Callable[[Motion], Array]:
    """Return the torque (samples, joints) [N m] of the rigid arm alone, as a function of motion."""
    return lambda motion: arm.body.torque(motion.q, motion.dq, motion.ddq, arm.p)
