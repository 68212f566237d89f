"""The machine as bodies and joints, plain data, before MuJoCo sees it: where faults change its build.

A joint's *body frame* lies on its axis and moves with it; the link's own frame (DH: distal) is fixed in it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from bench.solid import Solid, axis_rotation
from pipelines.errors import UsageError
from pipelines.io.experiment import Array
from pipelines.io.robot import Joint, RobotDescription
from pipelines.io.urdf import chain_from_urdf

__all__ = ["Attached", "Base", "Mobility", "Plan", "PlannedJoint", "Twist", "plan_of"]

INNER_STEP = 2.5e-4  # [s] at most
_Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Twist:
    """The motor turns apart from its link: a disc carries torque, friction and encoder, a spring drives the link."""

    motor_inertia: float  # [kg m^2], taken out of the link
    stiffness: float = 0.0  # [N m/rad]
    damping: float = 0.0  # [N m s/rad]


@dataclass(frozen=True)
class Mobility:
    """One degree of freedom of an attached body, with a linear spring and damper."""

    name: str
    axis: Array  # (3,) unit vector in the body frame it is attached to
    revolute: bool = True
    stiffness: float = 0.0
    damping: float = 0.0


@dataclass(frozen=True)
class Attached:
    """A further body on one of the arm's, fixed or with one degree of freedom of its own."""

    joint: int  # 0-based: the moving body it hangs on
    solid: Solid  # in that joint's body frame
    mobility: Mobility | None = None
    pivot: Array | None = None  # (3,) [m] of a revolute mobility, in the same frame


@dataclass(frozen=True)
class Base:
    """The base turns about `axis` on a spring."""

    inertia: float  # [kg m^2]
    stiffness: float  # [N m/rad]
    damping: float  # [N m s/rad]
    axis: Array  # (3,) in the base frame


@dataclass(frozen=True)
class Shaft:
    """A rotor geared to the sum of two joints' angles."""

    joints: tuple[int, int]  # 0-based
    inertia: float  # [kg m^2]


@dataclass(frozen=True)
class PlannedJoint:
    """One joint and the body it moves. `rotation` and `position` place it in the body frame before it."""

    rotation: Array  # (3, 3)
    position: Array  # (3,) [m]
    axis: Array  # (3,) unit vector in its own frame
    revolute: bool
    link_rotation: Array  # (3, 3) of the link's own frame in the body frame
    link_position: Array  # (3,) [m]
    solid: Solid  # in the body frame
    armature: float = 0.0  # [kg m^2]
    twist: Twist | None = None


@dataclass(frozen=True)
class Plan:
    """All that MuJoCo has to know. Faults return a changed copy."""

    gravity: Array  # (3,) [m/s^2]
    joints: tuple[PlannedJoint, ...]
    tip: Array  # (3,) [m] in the last body frame
    attached: tuple[Attached, ...] = ()
    bases: tuple[Base, ...] = ()  # from the ground up, each on the one before
    shafts: tuple[Shaft, ...] = ()
    inner_step: float = INNER_STEP  # [s] no longer than this

    def with_twist(self, index: int, twist: Twist) -> Plan:
        """One joint's motor apart from its link.

        Raises:
            UsageError: C02, it is apart already: a spring and a gap at one joint are one mechanism, not two faults.
        """
        joint = self.joints[index]
        if joint.twist is not None:
            raise UsageError("C02", f"joint {index + 1} gives way twice", remedy="one of joint_elasticity and backlash a joint")
        return self.with_joint(index, replace(joint, twist=twist))

    def with_joint(self, index: int, joint: PlannedJoint) -> Plan:
        return replace(self, joints=(*self.joints[:index], joint, *self.joints[index + 1:]))

    def fast_enough_for(self, rate: float) -> Plan:
        """With an inner step h such that h · rate ≤ ½: RK4 then follows a motion of that rate [1/s] closely."""
        return replace(self, inner_step=min(self.inner_step, 0.5 / rate))

    def substeps(self, sample_time: float) -> int:
        return max(1, math.ceil(sample_time / self.inner_step - 1e-9))


def plan_of(robot: RobotDescription) -> Plan:
    """The plan of a robot whose joints all have a link.

    Raises:
        ValueError: a link is missing.
    """
    steps = _urdf_steps(robot) if robot.convention == "urdf" else [_table_step(joint, robot.convention) for joint in robot.joints]
    joints = []
    before_r, before_p = np.eye(3), np.zeros(3)  # of the last link frame in the last body frame
    for joint, (rotation, position, axis, link_r, link_p) in zip(robot.joints, steps, strict=True):
        if joint.link is None:
            raise ValueError(f"joint {joint.name} has no link")
        r, p = before_r @ rotation, before_p + before_r @ position
        if joint.revolute:
            r = r @ axis_rotation(axis, joint.offset)
        else:
            p = p + r @ axis * joint.offset
        solid = Solid.of_link(joint.link).seen_from(link_r, link_p)
        joints.append(PlannedJoint(r, p, axis, joint.revolute, link_r, link_p, solid))
        before_r, before_p = link_r, link_p
    return Plan(np.array(robot.gravity), tuple(joints), before_p + before_r @ np.array(robot.tool))


def _table_step(joint: Joint, convention: str) -> tuple[Array, Array, Array, Array, Array]:
    """Joint frame in the last link frame, its axis, and the link frame in the joint frame.

    dh:  Rz(q) Tz(d) Tx(a) Rx(α), all but Rz(q) behind the joint;  mdh:  Rx(α) Tx(a) Rz(q) Tz(d), all before it, for
    turns about z and shifts along z commute.
    """
    turn = axis_rotation(np.array([1.0, 0.0, 0.0]), joint.alpha)
    along = np.array([joint.a, 0.0, joint.d])
    if convention == "dh":
        return np.eye(3), np.zeros(3), _Z, turn, along
    return turn, np.array([joint.a, 0.0, 0.0]) + turn @ np.array([0.0, 0.0, joint.d]), _Z, np.eye(3), np.zeros(3)


def _urdf_steps(robot: RobotDescription) -> list[tuple[Array, Array, Array, Array, Array]]:
    chain = chain_from_urdf(robot.urdf_text or "", robot.tip_link)
    return [(place.rotation, place.position, place.axis, np.eye(3), np.zeros(3)) for place in chain.joints]
