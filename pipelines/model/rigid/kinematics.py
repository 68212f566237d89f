"""Where every link is and how it moves: forward kinematics, Jacobian, and the motion of each link frame.

Inside, samples are the last and fastest axis, (…, samples), so that every operation runs over contiguous rows; the
public functions take and give (samples, …).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.model.rigid.geometry import Placement, SerialChain

__all__ = ["Frames", "LinkMotion", "Turn", "cross", "forward_kinematics", "jacobian", "link_motions", "rows",
           "tip_position", "turns", "walking_memory"]

Array = npt.NDArray[np.float64]


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
        """Twists (6, count, samples) from before the joint to behind it, in place: Rz(q)ᵀ v, or v + w × z s.

        `scratch`, of the same shape, is overwritten; without it new memory is taken.
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
        """A wrench (6, samples) from behind the joint to before it, in place: the transpose of `carry`."""
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
    twists: Array  # (6, i + 1, samples) of joints 0 … i at unit speed: angular w, then linear v of the frame's origin
    own_axis_is_z: bool  # twists[:, i] is the unit twist about (revolute) or along (prismatic) z

    @property
    def omega(self) -> Array:
        return self.velocity[:3]

    @property
    def alpha(self) -> Array:
        return self.spatial_acceleration[:3]

    def acceleration(self) -> Array:
        """a (3, samples) [m/s^2] of the frame's origin, what an accelerometer there would show."""
        return self.spatial_acceleration[3:] + cross(self.omega, self.velocity[3:])


@dataclass(frozen=True, eq=False)
class WalkingMemory:
    """What `link_motions` works in. Taking it anew for every block would cost more than the arithmetic."""

    state: Array  # (6, columns, samples)
    other: Array
    with_twists: bool


def cross(a: Array, b: Array) -> Array:
    """a × b for (3, samples)."""
    out = np.empty_like(b)
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        np.multiply(a[i], b[j], out=out[k])
        out[k] -= a[j] * b[i]
    return out


def rows(values: Array) -> Array:
    """(samples, joints) as contiguous (joints, samples)."""
    return np.ascontiguousarray(np.asarray(values, dtype=np.float64).T)


def turns(chain: SerialChain, q: Array) -> list[Turn]:
    """The joint movements for q (joints, samples)."""
    angle = q + chain.offset[:, None]
    return [Turn(True, np.cos(a), np.sin(a), a) if r else Turn(False, a, a, a)
            for a, r in zip(angle, chain.revolute, strict=True)]


def walking_memory(chain: SerialChain, samples: int, with_twists: bool = True) -> WalkingMemory:
    """Memory for `link_motions` over this many samples at once."""
    columns = 2 + (chain.n_joints if with_twists else 0)
    return WalkingMemory(np.empty((6, columns, samples)), np.empty((6, columns, samples)), with_twists)


def link_motions(chain: SerialChain, moves: list[Turn], dq: Array, ddq: Array, gravity: Array,
                 memory: WalkingMemory) -> Iterator[LinkMotion]:
    """Walk out along the chain; dq, ddq (joints, samples).

        V_i = X V + s q̇,   A_i = X A + s q̈ + V_i × s q̇        Featherstone 2008, ch. 5 (recursive Newton-Euler)

    with X the change of frame and s the joint's twist. Acceleration, velocity and the twists of all joints so far are
    the columns of one array, so that every change of frame is one small matrix on many samples.
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
    """The first `used` columns carried through a fixed placement: (where they are now, memory that is free)."""
    if not place.moves:
        return state, other
    samples = state.shape[2]
    np.matmul(place.twist_matrix, state[:, :used].reshape(6, used * samples),
              out=other[:, :used].reshape(6, used * samples))
    return other, state


def _drive(acceleration: Array, velocity: Array, revolute: bool, dq: Array, ddq: Array) -> None:
    """Add the joint's own speed and acceleration to A and V (6, samples), in place: s q̇, s q̈ and V × s q̇."""
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
    return Frames(np.moveaxis(rotation, (3, 2), (0, 1)), np.moveaxis(position, (2, 1), (0, 1)), tip.T,
                  np.moveaxis(axis, (2, 1), (0, 1)), np.moveaxis(anchor, (2, 1), (0, 1)))


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
    """Geometric Jacobian (samples, 6, joints) of the tip in base axes: rows 0-2 velocity [m], 3-5 angular velocity.

    Revolute: [z × (tip - anchor); z]; prismatic: [z; 0]. Siciliano et al. 2009, eq. (3.30).
    """
    frames = forward_kinematics(chain, q)
    turning = np.array(chain.revolute)[None, :, None]
    linear = np.where(turning, np.cross(frames.axis, frames.tip[:, None] - frames.anchor), frames.axis)
    return np.moveaxis(np.concatenate([linear, np.where(turning, frames.axis, 0.0)], axis=2), 2, 1)
