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

__all__ = ["Frames", "LinkMotion", "Turn", "forward_kinematics", "jacobian", "link_motions", "rows", "tip_position",
           "turns"]

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

    def rotate(self, vectors: Array) -> None:
        """`vectors` (3 or 6, …, samples) from the axes before the joint into those behind it, in place: Rz(q)ᵀ v."""
        for k in range(0, len(vectors), 3):
            x, y = vectors[k], vectors[k + 1]
            was = x * self.sine
            x *= self.cosine
            x += self.sine * y
            y *= self.cosine
            y -= was

    def move_twists(self, twists: Array) -> None:
        """Twists (6, count, samples) from before the joint to behind it, in place."""
        if self.revolute:
            self.rotate(twists)
        else:  # v + w × z s
            twists[3] += twists[1] * self.shift
            twists[4] -= twists[0] * self.shift


@dataclass(frozen=True, eq=False)
class LinkMotion:
    """The motion of link frame i, in its own axes. Gravity is the base accelerating upwards."""

    twists: Array  # (6, i + 1, samples) of joints 0 … i at unit speed: angular w, then linear v of the frame's origin
    omega: Array  # (3, samples) [rad/s]
    alpha: Array  # (3, samples) [rad/s^2]
    acceleration: Array  # (3, samples) [m/s^2] of the frame's origin


def rows(values: Array) -> Array:
    """(samples, joints) as contiguous (joints, samples)."""
    return np.ascontiguousarray(np.asarray(values, dtype=np.float64).T)


def turns(chain: SerialChain, q: Array) -> list[Turn]:
    """The joint movements for q (joints, samples)."""
    angle = q + chain.offset[:, None]
    return [Turn(True, np.cos(a), np.sin(a), a) if r else Turn(False, a, a, a)
            for a, r in zip(angle, chain.revolute, strict=True)]


def link_motions(chain: SerialChain, moves: list[Turn], dq: Array, ddq: Array, gravity: Array,
                 with_twists: bool = True) -> Iterator[LinkMotion]:
    """Walk out along the chain; dq, ddq (joints, samples). The Newton-Euler forward pass, Luh, Walker & Paul 1980.

        ω_i = Rᵀ ω + z q̇,   α_i = Rᵀ α + z q̈ + Rᵀω × z q̇,   a_i = Rᵀ (a + α × p + ω × (ω × p))
    """
    samples = dq.shape[1]
    motion = np.zeros((3, 3, samples))  # component, (ω, α, a), sample
    motion[:, 2] = -gravity[:, None]
    twists = np.zeros((6, 0, samples))
    for i, move in enumerate(moves):
        motion = _through(chain.before[i], motion)
        _move(motion, move, dq[i], ddq[i])
        motion = _through(chain.after[i], motion)
        if with_twists:
            twists = _extend(twists, chain.before[i], move, chain.after[i])
        yield LinkMotion(twists, motion[:, 0], motion[:, 1], motion[:, 2])


def _through(place: Placement, motion: Array) -> Array:
    """Carry ω, α, a (3, 3, samples) through a fixed placement; never in place."""
    if place.shifts:
        omega, alpha = motion[:, 0], motion[:, 1]
        x, y, z = place.position
        lever = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])  # α × p = lever α
        carried = motion.copy()
        linear = carried[:, 2]
        linear += lever @ alpha
        linear += omega * (place.position @ omega)  # ω × (ω × p) = ω (ω·p) - p |ω|²
        linear -= place.position[:, None] * np.einsum("ks,ks->s", omega, omega)
        motion = carried
    if place.turns:
        return (place.rotation.T @ motion.reshape(3, -1)).reshape(motion.shape)
    return motion if place.shifts else motion.copy()


def _move(motion: Array, move: Turn, dq: Array, ddq: Array) -> None:
    """Carry ω, α, a through a joint, in place."""
    if move.revolute:
        move.rotate(motion)
        (wx, wy, wz), alpha = motion[:, 0], motion[:, 1]
        alpha[0] += wy * dq  # Rᵀω × z q̇
        alpha[1] -= wx * dq
        alpha[2] += ddq
        wz += dq
        return
    (wx, wy, wz), (ax, ay, _), linear = motion[:, 0], motion[:, 1], motion[:, 2]
    linear[0] += (ay + wx * wz) * move.shift + 2.0 * wy * dq  # α × p + ω × (ω × p) + 2 ω × z ḋ, with p = z s
    linear[1] += (wy * wz - ax) * move.shift - 2.0 * wx * dq
    linear[2] += ddq - (wx * wx + wy * wy) * move.shift


def _extend(twists: Array, before: Placement, move: Turn, after: Placement) -> Array:
    """The twists of all joints so far, carried to the next link frame, and the new joint's own behind them."""
    count, samples = twists.shape[1:]
    extended = np.empty((6, count + 1, samples))
    if before.turns or before.shifts:
        extended[:, :count] = (before.twist_matrix() @ twists.reshape(6, -1)).reshape(twists.shape)
    else:
        extended[:, :count] = twists
    move.move_twists(extended[:, :count])
    extended[:, count] = 0.0
    extended[2 if move.revolute else 5, count] = 1.0
    if after.turns or after.shifts:
        return (after.twist_matrix() @ extended.reshape(6, -1)).reshape(extended.shape)
    return extended


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
    if place.shifts:
        p = p + np.einsum("abs,b->as", r, place.position)
    if place.turns:
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
