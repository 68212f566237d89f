"""Where the tip is and how fast, along a motion, with the adjoint of both.

    x = tip(q),   v = J q̇,   ∂x/∂q_m = J_m,   ∂v/∂q_m = Σ_i (z_min(i,m) × J_max(i,m)) q̇_i

J_i is joint i's column of the Jacobian, linear part; z_i its axis, zero where it is prismatic: the joint nearer to the base
turns the column of the one behind it. Siciliano et al. 2009, eq. (3.30), differentiated once more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.model.rigid.body import Array
from pipelines.model.rigid.geometry import SerialChain
from pipelines.model.rigid.kinematics import forward_kinematics

__all__ = ["TipMotion", "tip_motion"]


@dataclass(frozen=True, eq=False)
class TipMotion:
    """The tip along a motion."""

    position: Array  # (3, samples) [m] base frame
    velocity: Array  # (3, samples) [m/s]
    jacobian: Array  # (joints, 3, samples) [m]
    turning: Array  # (joints, 3, samples) joint axes; zero where prismatic

    def adjoint(self, dq: Array, on_position: Array, on_velocity: Array) -> tuple[Array, Array]:
        """Derivatives by q and dq (joints, samples) from those by tip position and velocity (3, samples)."""
        n = len(dq)
        by_q = np.einsum("jas,as->js", self.jacobian, on_position)
        for m in range(n):
            for i in range(n):
                first, last = min(i, m), max(i, m)
                bent = np.cross(self.turning[first], self.jacobian[last], axis=0)
                by_q[m] += np.einsum("as,as->s", bent, on_velocity) * dq[i]
        return by_q, np.einsum("jas,as->js", self.jacobian, on_velocity)


def tip_motion(chain: SerialChain, q: Array, dq: Array) -> TipMotion:
    """Position and velocity of the tip for q, dq (joints, samples)."""
    frames = forward_kinematics(chain, q.T)
    axis, lever = np.moveaxis(frames.axis, 0, -1), np.moveaxis(frames.tip[:, None] - frames.anchor, 0, -1)
    revolute = np.array(chain.revolute)[:, None, None]
    jacobian = np.where(revolute, np.cross(axis, lever, axis=1), axis)
    return TipMotion(frames.tip.T, np.einsum("jas,js->as", jacobian, dq), jacobian, np.where(revolute, axis, 0.0))
