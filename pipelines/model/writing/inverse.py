"""From a motion of the tip to the motion of the joints: in closed form, or by Newton's method where there is none.

    inverse = ClosedForm(geometry, "up")           the RRR arm
    inverse = Numerical(chain, posture)            any other serial arm
    inverse.motion(tip, velocity, acceleration)    q, dq, ddq
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from pipelines.model.rigid.body import Array
from pipelines.model.rigid.geometry import SerialChain
from pipelines.model.rigid.kinematics import (
    forward_kinematics,
    jacobian,
    link_motions,
    rows,
    tip_position,
    turns,
    walking_memory,
)
from pipelines.model.rigid.rrr_kinematics import BRANCHES, Geometry, Reach, inverse
from pipelines.model.rigid.rrr_rates import joint_rates

__all__ = ["ClosedForm", "Elbow", "Inverse", "Numerical", "Obstacle"]

Elbow = Literal["up", "down"]

_NEAREST = 0.005  # [m] from the border of the workspace, where joint speeds grow without end
_FLATTEST = 0.02  # smallest to largest singular value of the tip's Jacobian in the directions that are used
_CLOSE = 1e-13  # [m] of an answer of Newton's method: two orders above rounding of positions of about a metre
_STEPS = 60  # of the damped method from one tip to the next
_COARSE = 40  # tips from one start of Newton's method to the next
_OTHER = "move the text, make it smaller, or start from another posture"


@dataclass(frozen=True)
class Obstacle:
    """The first sample of a motion that the arm cannot follow, and why."""

    sample: int
    why: str
    remedy: str = "move the text, or make it smaller"


class Inverse(Protocol):
    """Inverse kinematics along a path."""

    def motion(self, tip: Array, velocity: Array, acceleration: Array) -> tuple[Array, Array, Array] | Obstacle:
        """q, dq, ddq (samples, joints) for tip [m], velocity [m/s], acceleration [m/s^2] (samples, 3), in order of time."""
        ...


@dataclass(frozen=True)
class ClosedForm:
    """The RRR arm facing the tip, its elbow up or down: one branch of eq. (A3) throughout.

    Branches meet only at singular postures, and the path keeps `_NEAREST` away from those, so that none is ever left.
    """

    geometry: Geometry
    elbow: Elbow = "up"

    def motion(self, tip: Array, velocity: Array, acceleration: Array) -> tuple[Array, Array, Array] | Obstacle:
        if (obstacle := self._obstacle(tip)) is not None:
            return obstacle
        branch = BRANCHES.index((1, -1 if self.elbow == "up" else 1))
        q = np.unwrap(inverse(self.geometry, tip).q[branch], axis=0)
        return q, *joint_rates(self.geometry, q, velocity, acceleration)

    def _obstacle(self, tip: Array) -> Obstacle | None:
        """The first tip out of reach; else the first nearer than `_NEAREST` to the border of the workspace, which is singular."""
        arm = self.geometry
        status = inverse(arm, tip).status
        if (out := np.flatnonzero(status >= Reach.INSIDE_CYLINDER)).size:
            return Obstacle(int(out[0]), Reach(int(status[out[0]])).words)
        beyond = np.hypot(tip[:, 0], tip[:, 1]) - abs(arm.d)
        r = np.sqrt(np.maximum(beyond, 0.0) * (beyond + 2 * abs(arm.d)) + (tip[:, 2] - arm.d1)**2)
        room = {Reach.SHOULDER: beyond, Reach.ELBOW: np.minimum(r - abs(arm.a3 - arm.a2), arm.a2 + arm.a3 - r)}
        near = np.flatnonzero(np.minimum(*room.values()) < _NEAREST)
        if near.size == 0:
            return None
        k = int(near[0])
        kind = min(room, key=lambda reach: float(room[reach][k]))
        return Obstacle(k, f"within {_NEAREST * 1e3:g} mm of a posture that is {kind.words}")


@dataclass(frozen=True, eq=False)
class Numerical:
    """Any serial arm, from a posture of its own that is near the task.

    The tip has three coordinates. An arm with more joints moves along the three directions of joint space that move its tip
    most in that posture, q = posture + V y, V orthonormal (joints, 3): y then is a function of the tip, and has derivatives.

        J V dy = dx;     ẏ = (J V)⁻¹ ẋ;     ÿ = (J V)⁻¹ (ẍ - J̇ q̇)
    """

    chain: SerialChain
    posture: Array  # (joints,) [rad]

    def motion(self, tip: Array, velocity: Array, acceleration: Array) -> tuple[Array, Array, Array] | Obstacle:
        V = np.linalg.svd(_tip_jacobian(self.chain, self.posture[None])[0])[2][:3].T
        starts = self._coarse(tip, V)
        if isinstance(starts, Obstacle):
            return starts
        y = self._newton(tip, starts, V)
        q = self.posture + y @ V.T
        missed = np.linalg.norm(tip_position(self.chain, q) - tip, axis=1)
        JV = _tip_jacobian(self.chain, q) @ V
        flat = np.linalg.svd(JV, compute_uv=False)
        bad = np.flatnonzero((missed > 10 * _CLOSE) | (flat[:, 2] < _FLATTEST * flat[:, 0]))
        if bad.size:
            return _singular(int(bad[0]))
        dq = np.linalg.solve(JV, velocity[..., None])[..., 0] @ V.T
        bias = _tip_acceleration(self.chain, q, dq)
        return q, dq, np.linalg.solve(JV, (acceleration - bias)[..., None])[..., 0] @ V.T

    def _coarse(self, tip: Array, V: Array) -> Array | Obstacle:
        """y (samples, 3) near the answer: found at every `_COARSE`-th tip, each from the one before, and interpolated."""
        at = np.unique(np.append(np.arange(0, len(tip), _COARSE), len(tip) - 1))
        y, found = np.zeros(3), []
        for k in at.tolist():
            y = self._damped(tip[k], y, V)
            if np.linalg.norm(tip_position(self.chain, (self.posture + V @ y)[None])[0] - tip[k]) > 1e-9:
                return Obstacle(k, "out of reach, as far as the damped Newton method can tell from where it starts", _OTHER)
            found.append(y)
        nodes = np.array(found)
        return np.stack([np.interp(np.arange(len(tip)), at, column) for column in nodes.T], axis=-1)

    def _damped(self, tip: Array, y: Array, V: Array) -> Array:
        """Levenberg's method: steps damped until they get nearer, undamped at the end."""
        damping = 1e-3
        missed = tip - tip_position(self.chain, (self.posture + V @ y)[None])[0]
        for _ in range(_STEPS):
            if np.linalg.norm(missed) <= _CLOSE:
                break
            J = _tip_jacobian(self.chain, (self.posture + V @ y)[None])[0] @ V
            step = np.linalg.solve(J.T @ J + damping**2 * np.eye(3), J.T @ missed)
            left = tip - tip_position(self.chain, (self.posture + V @ (y + step))[None])[0]
            if np.linalg.norm(left) < np.linalg.norm(missed):
                y, missed, damping = y + step, left, 0.1 * damping
            else:
                damping = min(10.0 * damping, 1e3)
        return y

    def _newton(self, tip: Array, y: Array, V: Array) -> Array:
        """Newton's method on all samples at once; it has converged when a step no longer helps."""
        for _ in range(8):
            q = self.posture + y @ V.T
            missed = tip - tip_position(self.chain, q)
            if np.abs(missed).max() <= _CLOSE:
                break
            J = _tip_jacobian(self.chain, q) @ V
            damped = np.swapaxes(J, 1, 2) @ J + 1e-20 * np.eye(3)
            y = y + np.linalg.solve(damped, np.swapaxes(J, 1, 2) @ missed[..., None])[..., 0]
        return y


def _singular(sample: int) -> Obstacle:
    return Obstacle(sample, "singular or nearly so: some direction of the tip needs joint speeds without end", _OTHER)


def _tip_jacobian(chain: SerialChain, q: Array) -> Array:
    """(samples, 3, joints) [m/rad]."""
    return jacobian(chain, q)[:, :3]


def _tip_acceleration(chain: SerialChain, q: Array, dq: Array) -> Array:
    """J̇ q̇ (samples, 3) [m/s^2]: what the tip accelerates by when no joint does.

        a_tip = a + ω × (ω × r) + α × r,  r from the last frame's origin to the tip; that frame's own axes turned to the base's
    """
    still = np.zeros_like(rows(q))
    *_, last = link_motions(chain, turns(chain, rows(q)), rows(dq), still, np.zeros(3),
                            walking_memory(chain, len(q), with_twists=False))
    lever = np.broadcast_to(chain.tip, (len(q), 3))
    omega, alpha = last.omega.T, last.alpha.T
    own = last.acceleration().T + np.cross(omega, np.cross(omega, lever)) + np.cross(alpha, lever)
    return np.asarray(np.einsum("sab,sb->sa", forward_kinematics(chain, q).rotation[:, -1], own))
