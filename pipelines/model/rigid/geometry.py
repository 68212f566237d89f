"""Turn a robot description into the frames of a serial chain.

Every convention becomes the same three steps from the frame of link i-1 to the frame of link i:

    before_i   a fixed placement, after which the joint's axis is z
    joint i    a turn about z (revolute) or a shift along z (prismatic) by q + offset
    after_i    a fixed placement into the frame in which the parameters of link i are given

    dh    T_i = Rz(q) Tz(d) Tx(a) Rx(alpha)      Denavit & Hartenberg; the frame of link i lies at its distal end
    mdh   T_i = Rx(alpha) Tx(a) Rz(q) Tz(d)      Khalil & Kleinfinger 1986, Craig 1989: alpha and a come before joint i
    urdf  T_i = origin_i · motion about axis_i   the frame of link i is the joint's own
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected
from pipelines.io.robot import Joint, RobotDescription

__all__ = ["Placement", "SerialChain", "serial_chain"]

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Placement:
    """Where one frame lies in another: a point x of the new frame is rotation x + position in the old one."""

    rotation: Array  # (3, 3)
    position: Array  # (3,) [m]

    def __matmul__(self, inner: Placement) -> Placement:
        return Placement(self.rotation @ inner.rotation, self.rotation @ inner.position + self.position)

    @cached_property
    def moves(self) -> bool:
        """Return whether the new frame differs from the old one at all."""
        return bool(np.any(self.rotation != np.eye(3)) or np.any(self.position))

    @cached_property
    def twist_matrix(self) -> Array:
        """X (6, 6) with [w'; v'] = X [w; v]: a twist about the old origin, seen about the new one in the new axes.

        w' = Rᵀ w,  v' = Rᵀ (v + w × p).  Featherstone 2008, ch. 2 (Plücker transform, angular part first).
        """
        x, y, z = self.position
        lever = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])  # w × p = lever w
        matrix = np.zeros((6, 6))
        matrix[:3, :3] = matrix[3:, 3:] = self.rotation.T
        matrix[3:, :3] = self.rotation.T @ lever
        return matrix


@dataclass(frozen=True, eq=False)
class SerialChain:
    """A serial arm as fixed placements between moving axes."""

    revolute: tuple[bool, ...]
    offset: Array  # (joints,) [rad]; [m] where prismatic
    before: tuple[Placement, ...]  # of joint i (axis z) in the frame of link i-1
    after: tuple[Placement, ...]  # of link i's frame in joint i's moved frame
    tip: Array  # (3,) [m] in the last link's frame
    gravity: Array  # (3,) [m/s^2] in the base frame

    @property
    def n_joints(self) -> int:
        return len(self.revolute)


_NOWHERE = Placement(np.eye(3), np.zeros(3))


def serial_chain(robot: RobotDescription) -> SerialChain:
    """The frames of `robot`.

    Raises:
        InputRejected: the embedded URDF is malformed, or disagrees with the description's joints.
    """
    tip = np.array(robot.tool, dtype=float)
    if robot.convention == "urdf":
        before, after, end = _urdf(robot)
        tip = end.rotation @ tip + end.position
    else:
        pairs = [(_distal if robot.convention == "dh" else _modified)(joint) for joint in robot.joints]
        before, after = tuple(b for b, _ in pairs), tuple(a for _, a in pairs)
    return SerialChain(robot.revolute, np.array([joint.offset for joint in robot.joints]), before, after, tip,
                       np.array(robot.gravity, dtype=float))


def _about_x(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def _distal(joint: Joint) -> tuple[Placement, Placement]:
    """Tz(d) Tx(a) Rx(alpha) behind the joint; for a prismatic joint q adds to d."""
    return _NOWHERE, Placement(_about_x(joint.alpha), np.array([joint.a, 0.0, joint.d]))


def _modified(joint: Joint) -> tuple[Placement, Placement]:
    """Rx(alpha) Tx(a) Tz(d) before the joint: Tz(d) may stand on either side of a turn about, or shift along, z."""
    rotation = _about_x(joint.alpha)
    return Placement(rotation, rotation @ np.array([joint.a, 0.0, joint.d])), _NOWHERE


def _urdf(robot: RobotDescription) -> tuple[tuple[Placement, ...], tuple[Placement, ...], Placement]:
    from pipelines.io.urdf import chain_from_urdf

    arm = chain_from_urdf(robot.urdf_text or "", robot.tip_link)
    if len(arm.joints) != robot.n_joints:
        raise InputRejected("S02", f"the robot description lists {robot.n_joints} joints, its URDF moves "
                                   f"{len(arm.joints)}", where=robot.name, remedy="describe each moving joint once")
    before, after = [], []
    for mine, joint in zip(robot.joints, arm.joints, strict=True):
        if mine.revolute == joint.prismatic:
            raise InputRejected("C02", f"joint '{mine.name}' is {mine.type}, but its URDF says otherwise",
                                where=robot.name, remedy="let [[joint]] type agree with the URDF")
        aligned = _z_onto(joint.axis)
        before.append(Placement(joint.rotation @ aligned, joint.position))
        after.append(Placement(aligned.T, np.zeros(3)))
    return tuple(before), tuple(after), Placement(arm.tip_rotation, arm.tip_position)


def _z_onto(axis: Array) -> Array:
    """A rotation (3, 3) whose third column is `axis`; exact where the axis is one of ±x, ±y, ±z."""
    if axis[2] == 1.0 and not axis[:2].any():
        return np.eye(3)
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    first = np.cross(helper, axis)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first), axis])
