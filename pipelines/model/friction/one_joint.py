"""A joint on its own, the others locked: J ddq + c sin q + c' cos q + friction = τ. Kostić et al. 2004, eq. (11).

The printed equation has c sin q with q from the hanging position; c' cos q lets the equilibrium lie anywhere. A prismatic
joint has its weight along the axis instead, a constant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NoReturn

import numpy as np

from pipelines.log.robot import Joint, RobotDescription
from pipelines.model.effects.base import SpeedCurve
from pipelines.model.rigid.body import Array, Motion, RigidBody
from pipelines.model.rigid.choose import rigid_body

__all__ = ["OneJoint", "gravity_acts", "gravity_columns", "gravity_names"]

_PLACES = 8  # of the driven joint
_PARALLEL = 1e-6  # [rad] between axis and gravity: rounding of a description


@dataclass(frozen=True)
class OneJoint:
    """The arm that a friction law sees when one joint moves: an arm of one joint."""

    robot: RobotDescription  # of this joint alone
    inertia: float  # J [kg m^2]
    gravity: tuple[float, ...]  # c, c' [N m] of sin q and cos q; prismatic: the weight along the axis [N]

    @classmethod
    def of(cls, whole: RobotDescription, joint: int, inertia: float = 0.0, gravity: tuple[float, ...] = ()) -> OneJoint:
        """Joint `joint`, counted from 1, of a robot."""
        own = whole.joints[joint - 1]
        alone = RobotDescription(whole.name, whole.gravity, "dh", (Joint(own.name, own.type),))
        return cls(alone, inertia, gravity or (0.0,) * len(gravity_names(own.revolute)))

    @property
    def n_joints(self) -> int:
        return 1

    @property
    def revolute(self) -> bool:
        return self.robot.joints[0].revolute

    @property
    def body(self) -> RigidBody:
        raise TypeError("a joint on its own has no links")

    @property
    def p(self) -> Array:
        return np.array([self.inertia, *self.gravity])

    def torque(self, motion: Motion) -> Array:
        """J ddq + c sin q + c' cos q, (samples, 1) [N m]."""
        return np.asarray(self.inertia * motion.ddq + (gravity_columns(motion.q[:, 0], self.revolute) @ self.p[1:])[:, None])

    def friction_torque(self, motion: Motion) -> Array:
        """None: its law of friction is what is fitted."""
        return np.zeros_like(motion.dq)

    def friction_curves(self, joint: int) -> tuple[SpeedCurve, ...]:
        return ()

    def with_body(self, body: RigidBody, p: Array) -> NoReturn:
        raise TypeError("a joint on its own has no links")

    def carrying(self, inertia: float, gravity: tuple[float, ...]) -> OneJoint:
        return replace(self, inertia=inertia, gravity=gravity)


def gravity_columns(q: Array, revolute: bool) -> Array:
    """(samples, 2) sin q, cos q; of a prismatic joint (samples, 1) ones."""
    return np.stack([np.sin(q), np.cos(q)]).T if revolute else np.ones((len(q), 1))


def gravity_names(revolute: bool) -> tuple[str, ...]:
    return ("sine", "cosine") if revolute else ("constant",)


def gravity_acts(robot: RobotDescription, joint: int, others: Sequence[float]) -> bool:
    """Return whether gravity has a moment about the axis of `joint`, counted from 1, or a part along it where that slides.

    Args:
        others: (joints - 1,) positions of the other joints [rad].
    """
    q = np.insert(np.tile(np.asarray(others, dtype=np.float64), (_PLACES, 1)), joint - 1, np.linspace(-3.0, 3.0, _PLACES), axis=1)
    row = rigid_body(robot).regressor(q, 0.0 * q, 0.0 * q)[:, joint - 1]
    return bool(np.abs(row).max(initial=0.0) > _PARALLEL * float(np.linalg.norm(robot.gravity)))
