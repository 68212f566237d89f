"""Where every link is and how it moves: frames of a serial chain, kinematics, motion of the links.

Every convention becomes the same three steps from the frame of link i-1 to the frame of link i:

    before_i   a fixed placement, after which the joint's axis is z
    joint i    a turn about z (revolute) or a shift along z (prismatic) by q + offset
    after_i    a fixed placement into the frame in which the parameters of link i are given

    dh    T_i = Rz(q) Tz(d) Tx(a) Rx(alpha)   Denavit & Hartenberg; its frame lies at the distal end
    mdh   T_i = Rx(alpha) Tx(a) Rz(q) Tz(d)   Khalil & Kleinfinger 1986, Craig 1989
    urdf  T_i = origin_i · motion about axis_i     the frame of link i is the joint's own

Inside, samples are the last and fastest axis, (…, samples), so that every operation runs over
contiguous rows; the public functions take and give (samples, …).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipelines.errors import InputRejected
from pipelines.io.log import Array
from pipelines.io.robot import Joint, RobotDescription

__all__ = ["Frames", "LinkMotion", "Placement", "SerialChain", "Turn", "cross",
           "forward_kinematics", "jacobian", "link_motions", "rows", "serial_chain",
           "tip_position", "turns", "walking_memory"]


@dataclass(frozen=True, eq=False)
class Placement:
    """Where one frame lies in another: a point x of it is rotation x + position there."""

    rotation: Array  # (3, 3)
    position: Array  # (3,) [m]

    def __matmul__(self, inner: Placement) -> Placement:
        return Placement(self.rotation @ inner.rotation,
                         self.rotation @ inner.position + self.position)

    @cached_property
    def moves(self) -> bool:
        """Return whether the new frame differs from the old one at all."""
        return bool(np.any(self.rotation != np.eye(3)) or np.any(self.position))

    @cached_property
    def twist_matrix(self) -> Array:
        """X (6, 6) with [w'; v'] = X [w; v]: a twist about the old origin, about the new one in its
        axes.

        w' = Rᵀ w,  v' = Rᵀ (v + w × p).  Featherstone 2008, ch. 2 (Plücker transform).
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
    """Return the frames of `robot`.

    Raises:
        InputRejected: the embedded URDF is malformed, or disagrees with the description's joints.
    """
    tip = np.array(robot.tool, dtype=float)
    if robot.convention == "urdf":
        before, after, end = _urdf(robot)
        tip = end.rotation @ tip + end.position
    else:
        pairs = [(_distal if robot.convention == "dh" else _modified)(joint)
                 for joint in robot.joints]
        before, after = tuple(b for b, _ in pairs), tuple(a for _, a in pairs)
    return SerialChain(robot.revolute, np.array([joint.offset for joint in robot.joints]), before,
                       after, tip, np.array(robot.gravity, dtype=float))


def _about_x(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def _distal(joint: Joint) -> tuple[Placement, Placement]:
    """Tz(d) Tx(a) Rx(alpha) behind the joint; for a prismatic joint q adds to d."""
    return _NOWHERE, Placement(_about_x(joint.alpha), np.array([joint.a, 0.0, joint.d]))


def _modified(joint: Joint) -> tuple[Placement, Placement]:
    """Rx(alpha) Tx(a) Tz(d) before the joint: Tz(d) commutes with a motion about z."""
    rotation = _about_x(joint.alpha)
    return Placement(rotation, rotation @ np.array([joint.a, 0.0, joint.d])), _NOWHERE


def _urdf(robot: RobotDescription
          ) -> tuple[tuple[Placement, ...], tuple[Placement, ...], Placement]:
    from pipelines.io.urdf import chain_from_urdf

    arm = chain_from_urdf(robot.urdf_text or "", robot.tip_link)
    if len(arm.joints) != robot.n_joints:
        raise InputRejected(
            "S02", f"the robot description lists {robot.n_joints} joints, its URDF moves "
            f"{len(arm.joints)}", where=robot.name, remedy="describe each moving joint once")
    before, after = [], []
    for mine, joint in zip(robot.joints, arm.joints, strict=True):
        if mine.revolute == joint.prismatic:
            raise InputRejected("C02",
                                f"joint '{mine.name}' is {mine.type}, but its URDF says otherwise",
                                where=robot.name, remedy="let [[joint]] type agree with the URDF")
        aligned = _z_onto(joint.axis)
        before.append(Placement(joint.rotation @ aligned, joint.position))
        after.append(Placement(aligned.T, np.zeros(3)))
    return tuple(before), tuple(after), Placement(arm.tip_rotation, arm.tip_position)


def _z_onto(axis: Array) -> Array:
    """Return a rotation (3, 3) whose third column is `axis`, exact along ±x, ±y, ±z."""
    if axis[2] == 1.0 and not axis[:2].any():
        return np.eye(3)
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    first = np.cross(helper, axis)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first), axis])


@dataclass(frozen=True, eq=False)
class Frames:
    """Placements of all link frames in the base frame, the tip's behind them."""

    rotation: Array  # (samples, joints, 3, 3)
    position: Array  # (samples, joints, 3) [m]
    tip: Array  # (samples, 3) [m]
    axis: Array  # (samples, joints, 3) joint axes in the base frame
    anchor: Array  # (samples, joints, 3) [m] a point on each joint axis


@dataclass(frozen=True, eq=False)
class Turn:
    """The movement of one joint: cosine and sine of its angle, or its shift."""

    revolute: bool
    cosine: Array  # (samples,), revolute only
    sine: Array
    shift: Array  # (samples,) [m], prismatic only

    def carry(self, twists: Array, scratch: Array | None = None) -> None:
        """Twists (6, count, samples) from before the joint to behind it, in place.

        Rz(q)ᵀ v, or v + w × z s. `scratch`, of the same shape, is overwritten.
        """
        if not self.revolute:
            twists[3] += twists[1] * self.shift
            twists[4] -= twists[0] * self.shift
            return
        parts = twists.reshape(2, 3, *twists.shape[1:])
        x, y = parts[:, 0], parts[:, 1]
        spare = np.empty_like(twists) if scratch is None else scratch
        xs, ys = spare[:2], spare[2:4]
        np.multiply(x, self.sine, out=xs)
        np.multiply(y, self.sine, out=ys)
        x *= self.cosine
        x += ys
        y *= self.cosine
        y -= xs

    def carry_wrench_back(self, wrench: Array) -> None:
        """Carry a wrench (6, samples) from behind the joint to before it, in place."""
        if self.revolute:
            Turn(True, self.cosine, -self.sine, self.shift).carry(wrench[:, None])
        else:  # moment + z s × force
            wrench[0] -= self.shift * wrench[4]
            wrench[1] += self.shift * wrench[3]


@dataclass(frozen=True, eq=False)
class LinkMotion:
    """The motion of link frame i, in its own axes. Gravity is the base accelerating upwards.

    Views of working memory: the next link overwrites them.
    """

    velocity: Array  # (6, samples) ω [rad/s], then v [m/s] of the frame's origin
    spatial_acceleration: Array  # (6, samples) α [rad/s^2], then a - ω × v [m/s^2]
    # (6, i + 1, samples) of joints 0 … i at unit speed: angular w, then linear v of the frame's
    # origin
    twists: Array
    own_axis_is_z: bool  # twists[:, i] is the unit twist about (revolute) or along (prismatic) z

    @property
    def omega(self) -> Array:
        return self.velocity[:3]

    @property
    def alpha(self) -> Array:
        return self.spatial_acceleration[:3]

    def acceleration(self) -> Array:
        """Return a (3, samples) [m/s^2] of the frame's origin, as an accelerometer shows it."""
        return self.spatial_acceleration[3:] + cross(self.omega, self.velocity[3:])


@dataclass(frozen=True, eq=False)
class WalkingMemory:
    """The working memory of `link_motions`: taken anew it would cost more than the arithmetic."""

    state: Array  # (6, columns, samples)
    other: Array
    with_twists: bool


def cross(a: Array, b: Array) -> Array:
    """Return a × b for (3, samples)."""
    out = np.empty_like(b)
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        np.multiply(a[i], b[j], out=out[k])
        out[k] -= a[j] * b[i]
    return out


def rows(values: Array) -> Array:
    """Return (samples, joints) as contiguous (joints, samples)."""
    return np.ascontiguousarray(np.asarray(values, dtype=np.float64).T)


def turns(chain: SerialChain, q: Array) -> list[Turn]:
    """Return the joint movements for q (joints, samples)."""
    angle = q + chain.offset[:, None]
    return [Turn(True, np.cos(a), np.sin(a), a) if r else Turn(False, a, a, a)
            for a, r in zip(angle, chain.revolute, strict=True)]


def walking_memory(chain: SerialChain, samples: int, with_twists: bool = True) -> WalkingMemory:
    """Memory for `link_motions` over this many samples at once."""
    columns = 2 + (chain.n_joints if with_twists else 0)
    return WalkingMemory(np.empty((6, columns, samples)), np.empty((6, columns, samples)),
                         with_twists)


def link_motions(chain: SerialChain, moves: list[Turn], dq: Array, ddq: Array, gravity: Array,
                 memory: WalkingMemory) -> Iterator[LinkMotion]:
    """Walk out along the chain; dq, ddq (joints, samples).

        V_i = X V + s q̇,   A_i = X A + s q̈ + V_i × s q̇        Featherstone 2008, ch. 5

    with X the change of frame and s the joint's twist. Acceleration, velocity and all twists so far
    are the columns of one array: every change of frame is one small matrix on many samples.
    """
    state, other = memory.state, memory.other
    state[:, :2] = 0.0
    state[3:, 0] = -gravity[:, None]
    for i, move in enumerate(moves):
        used = 2 + (i if memory.with_twists else 0)
        state, other = _through(chain.before[i], state, other, used)
        move.carry(state[:, :used], other[:, :used])
        _drive(state[:, 0], state[:, 1], move.revolute, dq[i], ddq[i])
        if memory.with_twists:
            state[:, used] = 0.0
            state[2 if move.revolute else 5, used] = 1.0
            used += 1
        state, other = _through(chain.after[i], state, other, used)
        yield LinkMotion(state[:, 1], state[:, 0], state[:, 2:used], not chain.after[i].moves)


def _through(place: Placement, state: Array, other: Array, used: int) -> tuple[Array, Array]:
    """Carry `used` columns through a fixed placement; return where they are, and free memory."""
    if not place.moves:
        return state, other
    samples = state.shape[2]
    np.matmul(place.twist_matrix, state[:, :used].reshape(6, used * samples),
              out=other[:, :used].reshape(6, used * samples))
    return other, state


def _drive(acceleration: Array, velocity: Array, revolute: bool, dq: Array, ddq: Array) -> None:
    """Add the joint's own s q̇ to V and s q̈, V × s q̇ to A (6, samples), in place."""
    axis, first = (2, 0) if revolute else (5, 3)
    acceleration[first] += velocity[1] * dq  # ω × z q̇
    acceleration[first + 1] -= velocity[0] * dq
    if revolute:
        acceleration[3] += velocity[4] * dq  # v × z q̇
        acceleration[4] -= velocity[3] * dq
    acceleration[axis] += ddq
    velocity[axis] += dq


def forward_kinematics(chain: SerialChain, q: Array) -> Frames:
    """All frames for q (samples, joints): ₀T_i = ₀T_{i-1} before_i joint_i(q_i) after_i."""
    moves = turns(chain, rows(q))
    samples = len(q)
    n = chain.n_joints
    rotation, position = np.empty((3, 3, n, samples)), np.empty((3, n, samples))
    axis, anchor = np.empty((3, n, samples)), np.empty((3, n, samples))
    r, p = np.repeat(np.eye(3)[:, :, None], samples, axis=2), np.zeros((3, samples))
    for i, move in enumerate(moves):
        r, p = _placed(chain.before[i], r, p)
        axis[:, i], anchor[:, i] = r[:, 2], p
        if move.revolute:
            r = np.stack([r[:, 0] * move.cosine + r[:, 1] * move.sine,
                          r[:, 1] * move.cosine - r[:, 0] * move.sine, r[:, 2]], axis=1)
        else:
            p = p + r[:, 2] * move.shift
        r, p = _placed(chain.after[i], r, p)
        rotation[:, :, i], position[:, i] = r, p
    tip = np.einsum("abs,b->as", r, chain.tip) + p
    return Frames(np.moveaxis(rotation, (3, 2), (0, 1)), np.moveaxis(position, (2, 1), (0, 1)),
                  tip.T, np.moveaxis(axis, (2, 1), (0, 1)), np.moveaxis(anchor, (2, 1), (0, 1)))


def _placed(place: Placement, r: Array, p: Array) -> tuple[Array, Array]:
    if place.position.any():
        p = p + np.einsum("abs,b->as", r, place.position)
    if place.moves:
        r = np.einsum("abs,bc->acs", r, place.rotation)
    return r, p


def tip_position(chain: SerialChain, q: Array) -> Array:
    """Tip (samples, 3) [m] in the base frame, for q (samples, joints)."""
    return forward_kinematics(chain, q).tip


def jacobian(chain: SerialChain, q: Array) -> Array:
    """Geometric Jacobian (samples, 6, joints) of the tip in base axes: velocity, angular velocity.

    Revolute: [z × (tip - anchor); z]; prismatic: [z; 0]. Siciliano et al. 2009, eq. (3.30).
    """
    frames = forward_kinematics(chain, q)
    turning = np.array(chain.revolute)[None, :, None]
    linear = np.where(turning, np.cross(frames.axis, frames.tip[:, None] - frames.anchor),
                      frames.axis)
    return np.moveaxis(np.concatenate([linear, np.where(turning, frames.axis, 0.0)], axis=2), 2, 1)
