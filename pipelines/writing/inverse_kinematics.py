"""Compute the joint motion of a motion of the tip: in closed form, or by Newton's method.

    inverse = ClosedForm(geometry, "up")           the RRR arm
    inverse = Numerical(chain, posture)            any other serial arm
    inverse.motion(tip, velocity, acceleration)    q, dq, ddq, or the first Obstacle
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipelines.dynamics import kinematics
from pipelines.dynamics.body import Array
from pipelines.dynamics.kinematics import SerialChain, jacobian, tip_position
from pipelines.dynamics.rrr_kinematics import BRANCHES, Geometry, Reach, inverse, joint_rates
from pipelines.writing.config import CONFIG

__all__ = ["ClosedForm", "Elbow", "Numerical", "Obstacle"]

Elbow = Literal["up", "down"]

STEPS = 8  # numerics: of Newton's method, which doubles the digits in each
SOLVED = 1e-13  # numerics: [m] two orders above the rounding of positions of about a metre
TOLERANCE = 1e-12  # numerics: of a start of Newton's method


@dataclass(frozen=True)
class Obstacle:
    """The first sample of a motion that the arm cannot follow, and why."""

    sample: int
    why: str
    remedy: str = "move the text, make it smaller, or start from another posture"


@dataclass(frozen=True)
class ClosedForm:
    """The RRR arm facing the tip, its elbow up or down: one branch of eq. (A3) throughout.

    Branches meet only at singular postures, and the path keeps `CONFIG.border` away from those.
    """

    geometry: Geometry
    elbow: Elbow = "up"

    def motion(
        self, tip: Array, velocity: Array, acceleration: Array
    ) -> tuple[Array, Array, Array] | Obstacle:
        """Return q, dq, ddq (samples, joints) for tip [m], its velocity and acceleration."""
        if (obstacle := self._obstacle(tip)) is not None:
            return obstacle
        branch = BRANCHES.index((1, -1 if self.elbow == "up" else 1))
        q = np.unwrap(inverse(self.geometry, tip).q[branch], axis=0)
        return q, *joint_rates(self.geometry, q, velocity, acceleration)

    def _obstacle(self, tip: Array) -> Obstacle | None:
        """Return the first tip out of reach, else the first too near to the border."""
        arm, remedy = self.geometry, "move the text, or make it smaller"
        status = inverse(arm, tip).status
        if (out := np.flatnonzero(status >= Reach.INSIDE_CYLINDER)).size:
            return Obstacle(int(out[0]), Reach(int(status[out[0]])).words, remedy)
        beyond = np.hypot(tip[:, 0], tip[:, 1]) - abs(arm.d)
        height = tip[:, 2] - arm.d1
        r = np.sqrt(np.maximum(beyond, 0.0) * (beyond + 2 * abs(arm.d)) + height**2)
        room = {Reach.SHOULDER: beyond,
                Reach.ELBOW: np.minimum(r - abs(arm.a3 - arm.a2), arm.a2 + arm.a3 - r)}
        near = np.flatnonzero(np.minimum(*room.values()) < CONFIG.border)
        if near.size == 0:
            return None
        k = int(near[0])
        kind = min(room, key=lambda reach: float(room[reach][k]))
        why = f"within {CONFIG.border * 1e3:g} mm of a posture that is {kind.words}"
        return Obstacle(k, why, remedy)


@dataclass(frozen=True, eq=False)
class Numerical:
    """Any serial arm, from a posture near the task.

    An arm of more than three joints moves along the three directions of joint space that move its
    tip most in that posture, q = posture + V y, V orthonormal (joints, 3): y is a function of the
    tip, and has derivatives.

        J V dy = dx;     ẏ = (J V)⁻¹ ẋ;     ÿ = (J V)⁻¹ (ẍ - J̇ q̇)
    """

    chain: SerialChain
    posture: Array  # (joints,) [rad]

    def motion(
        self, tip: Array, velocity: Array, acceleration: Array
    ) -> tuple[Array, Array, Array] | Obstacle:
        """Return q, dq, ddq (samples, joints) for tip [m], its velocity and acceleration."""
        V = np.linalg.svd(jacobian(self.chain, self.posture[None])[0, :3])[2][:3].T
        y = self._coarse(tip, V)
        if isinstance(y, Obstacle):
            return y
        for _ in range(STEPS):
            q = self.posture + y @ V.T
            error = tip - tip_position(self.chain, q)
            if np.abs(error).max() <= SOLVED:
                break
            JV = jacobian(self.chain, q)[:, :3] @ V
            damped = np.swapaxes(JV, 1, 2) @ JV + 1e-20 * np.eye(3)
            y = y + np.linalg.solve(damped, np.swapaxes(JV, 1, 2) @ error[..., None])[..., 0]
        q = self.posture + y @ V.T
        error = np.linalg.norm(tip_position(self.chain, q) - tip, axis=1)
        JV = jacobian(self.chain, q)[:, :3] @ V
        size = np.linalg.svd(JV, compute_uv=False)
        bad = np.flatnonzero((error > CONFIG.solved) | (size[:, 2] < CONFIG.flattest * size[:, 0]))
        if bad.size:
            return Obstacle(int(bad[0]), "singular or nearly so: some direction of the tip needs "
                            "unbounded joint speeds")
        dq = np.linalg.solve(JV, velocity[..., None])[..., 0] @ V.T
        bias = _tip_acceleration(self.chain, q, dq)
        return q, dq, np.linalg.solve(JV, (acceleration - bias)[..., None])[..., 0] @ V.T

    def _coarse(self, tip: Array, V: Array) -> Array | Obstacle:
        """Return y (samples, 3): solved at some tips, each from the one before, interpolated."""
        from scipy.optimize import least_squares

        def error(y: Array, wanted: Array) -> Array:
            return np.asarray(tip_position(self.chain, (self.posture + V @ y)[None])[0] - wanted)

        def slope(y: Array, wanted: Array) -> Array:
            del wanted
            return np.asarray(jacobian(self.chain, (self.posture + V @ y)[None])[0, :3] @ V)

        at = np.unique(np.append(np.arange(0, len(tip), CONFIG.every), len(tip) - 1))
        y, nodes = np.zeros(3), []
        for k in at.tolist():
            y = least_squares(error, y, slope, method="lm", ftol=TOLERANCE, xtol=TOLERANCE,
                              gtol=TOLERANCE, args=(tip[k],)).x
            if np.linalg.norm(error(y, tip[k])) > CONFIG.reached:
                return Obstacle(k, "out of reach, or too far from the posture to start from")
            nodes.append(y)
        samples = np.arange(len(tip))
        return np.stack([np.interp(samples, at, column) for column in np.array(nodes).T], axis=-1)


def _tip_acceleration(chain: SerialChain, q: Array, dq: Array) -> Array:
    """Return J̇ q̇ (samples, 3) [m/s^2], the acceleration of the tip when no joint accelerates.

        a_tip = a + ω × (ω × r) + α × r,    r from the last frame's origin to the tip
    """
    rows = kinematics.rows
    memory = kinematics.walking_memory(chain, len(q), with_twists=False)
    *_, last = kinematics.link_motions(chain, kinematics.turns(chain, rows(q)), rows(dq),
                                       np.zeros_like(rows(q)), np.zeros(3), memory)
    lever = np.broadcast_to(chain.tip, (len(q), 3))
    omega, alpha = last.omega.T, last.alpha.T
    a = last.acceleration().T + np.cross(omega, np.cross(omega, lever)) + np.cross(alpha, lever)
    rotation = kinematics.forward_kinematics(chain, q).rotation[:, -1]
    return np.asarray(np.einsum("sab,sb->sa", rotation, a))
