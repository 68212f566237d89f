"""The machine as bodies and joints, plain data before MuJoCo sees it, which faults change.

A joint's *body frame* lies on its axis and moves with it; the link's own frame (DH: distal) is
fixed in it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from bench.config import CONFIG
from pipelines.errors import UsageError
from pipelines.io.log import Array
from pipelines.io.robot import Joint, LinkParameters, RobotDescription
from pipelines.io.urdf import chain_from_urdf


def axis_rotation(axis: Array, angle: float) -> Array:
    """Return R = 1 + sin(angle) [a]× + (1 - cos(angle)) [a]×² (3, 3) about a unit vector (3,)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)


@dataclass(frozen=True, eq=False)
class Solid:
    """A rigid body: mass, centre of mass and inertia about it."""

    mass: float  # [kg]
    com: Array  # (3,) [m]
    inertia: (
        Array  # (3, 3) [kg m^2] tensor about the centre of mass, products negative: I_xy = -∫ xy dm
    )

    @classmethod
    def of_link(cls, link: LinkParameters) -> Solid:
        """Convert from the origin: I_c = I_o - m (|c|² 1 - c cᵀ), products positive there."""
        xx, yy, zz, xy, xz, yz = link.inertia
        about_origin = np.array([[xx, -xy, -xz], [-xy, yy, -yz], [-xz, -yz, zz]])
        c = np.array(link.com)
        return cls(link.mass, c, about_origin - link.mass * (c @ c * np.eye(3) - np.outer(c, c)))

    def as_link(self) -> LinkParameters:
        """Invert `of_link`."""
        c = self.com
        tensor = self.inertia + self.mass * (c @ c * np.eye(3) - np.outer(c, c))
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = tensor.tolist()
        x, y, z = c.tolist()
        return LinkParameters(self.mass, (x, y, z), (xx, yy, zz, -xy, -xz, -yz))

    def seen_from(self, rotation: Array, position: Array) -> Solid:
        """Return the body where its frame has this rotation (3, 3) and position (3,) [m]."""
        return Solid(
            self.mass, rotation @ self.com + position, rotation @ self.inertia @ rotation.T
        )

    def about(self, axis: Array) -> float:
        """Return its inertia [kg m^2] about a line through the origin, a unit vector (3,)."""
        arm = np.cross(axis, self.com)
        return float(axis @ self.inertia @ axis + self.mass * arm @ arm)

    @property
    def second_moments(self) -> Array:
        """S = ∫ r rᵀ dm = ½ tr(I) 1 - I (3, 3) about the centre of mass."""
        return np.asarray(0.5 * np.trace(self.inertia) * np.eye(3) - self.inertia)

    @property
    def exists(self) -> bool:
        """True where mass can be spread so: m > 0, S positive definite (Traversaro et al. 2016)."""
        return self.mass > 0.0 and bool(np.linalg.eigvalsh(self.second_moments).min() > 0.0)

    def drawn(self, rng: np.random.Generator, share: float) -> Solid:
        """Draw a similar body: mass, centre and second moments each within ± `share` of its own.

        S is stretched as D S D with a diagonal D, which keeps it positive definite.
        """
        factor = 1.0 + rng.uniform(-share, share, 7)
        stretch = np.diag(np.sqrt(factor[4:]))
        moments = stretch @ self.second_moments @ stretch
        inertia = np.trace(moments) * np.eye(3) - moments
        return Solid(self.mass * factor[0], self.com * factor[1:4], inertia)

    def without_disc(self, axis: Array, inertia: float) -> Solid:
        """Return the rest of it when a thin disc about a unit vector (3,) turns by itself."""
        return replace(self, inertia=self.inertia - disc(axis, inertia))

    def largest_disc(self, axis: Array, wanted: float) -> float:
        """Return the inertia [kg m^2], at most `wanted`, of a disc that can be taken out of it."""
        inertia = wanted
        while not self.without_disc(axis, inertia).exists:
            inertia *= 0.8
        return inertia


def disc(axis: Array, inertia: float) -> Array:
    """Return J (½ 1 + ½ a aᵀ) (3, 3), the tensor of a thin disc about the unit vector `axis`."""
    return np.asarray(0.5 * inertia * (np.eye(3) + np.outer(axis, axis)))


def ball(mass: float, centre: Array, radius: float) -> Solid:
    """Return a solid ball of `mass` [kg] and `radius` [m]."""
    return Solid(mass, centre, 0.4 * mass * radius**2 * np.eye(3))


@dataclass(frozen=True)
class Twist:
    """A motor apart from its link: torque, friction and encoder on it, a spring drives the link."""

    motor_inertia: float  # [kg m^2], taken out of the link
    stiffness: float = 0.0  # [N m/rad]
    damping: float = 0.0  # [N m s/rad]


@dataclass(frozen=True)
class Mobility:
    """One degree of freedom of an attached body, with a linear spring and damper."""

    name: str
    axis: Array  # (3,) unit vector in the body frame it is attached to
    revolute: bool = True
    stiffness: float = 0.0  # [N m/rad]
    damping: float = 0.0  # [N m s/rad]


@dataclass(frozen=True)
class Attached:
    """A further body on one of the arm's, fixed or with one degree of freedom of its own."""

    joint: int  # 0-based: the moving body it hangs on
    solid: Solid  # in that joint's body frame
    mobility: Mobility | None = None
    pivot: Array | None = None  # (3,) [m] of a revolute mobility, in the same frame


@dataclass(frozen=True)
class Base:
    """A base that turns about `axis` on a spring."""

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
    """A joint and the body it moves, placed in the body frame before it."""

    rotation: Array  # (3, 3)
    position: Array  # (3,) [m]
    axis: Array  # (3,) unit vector in its own frame
    revolute: bool
    link_rotation: Array  # (3, 3) of the link's own frame in the body frame
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
    inner_step: float = CONFIG.inner_step  # [s] no longer than this

    def with_joint(self, index: int, joint: PlannedJoint) -> Plan:
        """Return the plan with joint `index` (0-based) replaced."""
        return replace(self, joints=(*self.joints[:index], joint, *self.joints[index + 1 :]))

    def with_twist(self, index: int, twist: Twist) -> Plan:
        """Return the plan with the motor of joint `index` (0-based) apart from its link.

        Raises:
            UsageError: C02, it is apart already: a spring and a gap at one joint are one mechanism,
                not two faults.
        """
        joint = self.joints[index]
        if joint.twist is not None:
            remedy = "one of joint_elasticity and backlash a joint"
            raise UsageError("C02", f"joint {index + 1} gives way twice", remedy=remedy)
        return self.with_joint(index, replace(joint, twist=twist))

    def with_tip_load(
        self, solid: Solid, mobility: Mobility | None = None, pivot: Array | None = None
    ) -> Plan:
        """Return the plan with a further body on the last link, in its body frame."""
        extra = Attached(len(self.joints) - 1, solid, mobility, pivot)
        return replace(self, attached=(*self.attached, extra))

    def fast_enough_for(self, rate: float) -> Plan:
        """Return the plan with an inner step that follows a motion of this rate [1/s]."""
        return replace(self, inner_step=min(self.inner_step, CONFIG.largest_phase / rate))

    def substeps(self, sample_time: float) -> int:
        """Return the number of inner steps in `sample_time` [s]."""
        return max(1, math.ceil(sample_time / self.inner_step - 1e-9))


def plan_of(robot: RobotDescription) -> Plan:
    """Return the plan of a robot whose joints all have a link.

    Raises:
        ValueError: a link is missing.
    """
    if robot.convention == "urdf":
        chain = chain_from_urdf(robot.urdf_text or "", robot.tip_link)
        still = np.eye(3), np.zeros(3)
        steps = [(place.rotation, place.position, place.axis, *still) for place in chain.joints]
    else:
        steps = [_table_step(joint, robot.convention) for joint in robot.joints]
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
        joints.append(PlannedJoint(r, p, axis, joint.revolute, link_r, solid))
        before_r, before_p = link_r, link_p
    return Plan(np.array(robot.gravity), tuple(joints), before_p + before_r @ np.array(robot.tool))


def _table_step(joint: Joint, convention: str) -> tuple[Array, Array, Array, Array, Array]:
    """Return rotation and position of a joint in the last link frame, its axis, and its link frame.

    dh:  Rz(q) Tz(d) Tx(a) Rx(α), all but Rz(q) behind the joint;  mdh:  Rx(α) Tx(a) Rz(q) Tz(d),
    all before it, for turns about z and shifts along z commute.
    """
    turn, z = axis_rotation(np.array([1.0, 0.0, 0.0]), joint.alpha), np.array([0.0, 0.0, 1.0])
    if convention == "dh":
        return np.eye(3), np.zeros(3), z, turn, np.array([joint.a, 0.0, joint.d])
    position = np.array([joint.a, 0.0, 0.0]) + turn @ np.array([0.0, 0.0, joint.d])
    return turn, position, z, np.eye(3), np.zeros(3)
