"""Accelerations of many serial arms of one kind at once, from the trace form of the equations of motion.

Kostić et al. 2004, eq. (5)-(7), after Paul 1981, ch. 6, with all links and replicas in one array operation. With T_i the frame
of link i, P_i its 4 × 4 matrix of moments ∫[x; 1][x; 1]ᵀ dm, and S_j the matrix of joint j's twist, all in the base frame,

    ∂T_i/∂q_j = S_j T_i,      V_i = Σ_{j≤i} S_j q̇_j,      A_i = Σ_{j≤i} (V_j S_j - S_j V_j) q̇_j
    D_jk = tr(S_j Σ_{i≥k} P_i S_kᵀ), j ≤ k,      bias_j = tr(S_j Σ_{i≥j} P_i (A_i + V_i² - g)ᵀ)

the sums over links being cumulative. Replicas are the last axis, links the one before it.
"""

from __future__ import annotations

import numpy as np

from pipelines.model.rigid.base import BaseArm
from pipelines.model.rigid.body import Array

__all__ = ["ManyChains"]


class ManyChains:
    """D(q) a = τ - c(q, dq) - h(q), solved for a, for every replica."""

    def __init__(self, body: BaseArm, p: Array, added: Array, replicas: int) -> None:
        """`p` (parameters,), or (replicas, parameters); `added` (joints, joints) [kg m^2] goes to D."""
        chain = body.chain
        n = chain.n_joints
        self._replicas, self._added, self._gravity = replicas, added[..., None], chain.gravity[:, None, None]
        self._offset, self._turning = chain.offset[:, None], np.array(chain.revolute)[:, None]
        before = np.array([np.column_stack([place.rotation, place.position]) for place in chain.before])  # (n, 3, 4)
        after = np.array([np.column_stack([place.rotation, place.position]) for place in chain.after])
        self._before = np.moveaxis(before, 0, -1)[..., None]  # (3, 4, n, 1)
        still, sine, cosine = np.moveaxis(_local(before, after, np.array(chain.revolute)), (0, 1), (0, -1))
        self._local = tuple(np.ascontiguousarray(part)[..., None] for part in (still, sine, cosine))  # each (3, 4, n, 1)
        moments = np.array([[_moments(link) for link in body.standard(own).reshape(n, 10)] for own in np.atleast_2d(p)])
        self._moments = np.ascontiguousarray(np.transpose(moments, (2, 3, 1, 0)))  # (4, 4, n, 1 or replicas)
        self._upper = np.triu(np.ones((n, n), dtype=bool))

    def acceleration(self, q: Array, dq: Array, torque: Array, out: Array) -> None:
        """a (joints, replicas) [rad/s^2] into `out`, for q, dq and the torque that is left for motion, all of that shape."""
        mass, bias = self.equations(q, dq)
        rest = np.moveaxis(torque - bias, 0, -1)[..., None]
        out[:] = np.linalg.solve(np.moveaxis(mass, -1, 0), rest)[..., 0].T

    def equations(self, q: Array, dq: Array) -> tuple[Array, Array]:
        """D (joints, joints, replicas) and c + h (joints, replicas)."""
        frames, twists = self._frames(q)
        moving = twists * dq
        velocity = np.cumsum(moving, axis=2)
        spin, turning = velocity[:, :3], twists[:, :3] * dq
        # of matrices whose last row is zero, only the first three rows and columns of the left factor act
        change = np.einsum("abnr,bcnr->acnr", spin, moving)
        change -= np.einsum("abnr,bcnr->acnr", turning, velocity)
        acceleration = np.cumsum(change, axis=2)
        acceleration += np.einsum("abnr,bcnr->acnr", spin, velocity)
        acceleration[:, 3] -= self._gravity
        moments = np.einsum("abnr,bcnr->acnr", frames, np.broadcast_to(self._moments, (*self._moments.shape[:3], q.shape[1])))
        moments = np.einsum("abnr,cbnr->acnr", moments, frames)
        wrenches = _beyond(np.einsum("abnr,bcnr->acnr", acceleration, moments))
        bias = np.einsum("abnr,abnr->nr", twists, wrenches)
        carried = np.einsum("abnr,bcnr->acnr", twists, _beyond(moments))
        mass = np.einsum("abjr,abkr->jkr", twists, carried)
        mass = np.where(self._upper[..., None], mass, mass.transpose(1, 0, 2))
        mass += self._added
        return mass, bias

    def _frames(self, q: Array) -> tuple[Array, Array]:
        """T (4, 4, joints, replicas), and the joints' unit twists S (3, 4, joints, replicas) in the base frame."""
        angle = q + self._offset
        still, sine, cosine = self._local
        local = sine * np.where(self._turning, np.sin(angle), angle)
        local += cosine * np.cos(angle)
        local += still
        n, replicas = q.shape
        frames = np.zeros((4, 4, n + 1, replicas))
        frames[[0, 1, 2, 3], [0, 1, 2, 3], 0], frames[3, 3] = 1.0, 1.0
        for i in range(n):
            here = frames[:3, :, i]
            np.einsum("abr,bcr->acr", here[:, :3], local[:, :, i], out=frames[:3, :, i + 1])
            frames[:3, 3, i + 1] += here[:, 3]
        axis = np.einsum("abnr,bnr->anr", frames[:3, :3, :n], np.broadcast_to(self._before[:, 2], (3, n, replicas)))
        anchor = np.einsum("abnr,bnr->anr", frames[:3, :3, :n], np.broadcast_to(self._before[:, 3], (3, n, replicas)))
        anchor += frames[:3, 3, :n]
        return frames[:, :, 1:], _twists(axis, anchor, self._turning)


def _twists(axis: Array, anchor: Array, turning: Array) -> Array:
    """S: [z]× and anchor × z where the joint turns, z as its last column where it shifts."""
    twists = np.zeros((3, 4, *axis.shape[1:]))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        turn = np.where(turning, axis[i], 0.0)
        twists[k, j], twists[j, k] = turn, -turn
        twists[i, 3] = np.where(turning, anchor[j] * axis[k] - anchor[k] * axis[j], axis[i])
    return twists


def _beyond(values: Array) -> Array:
    """Sums over each link and all links behind it; the third axis counts links."""
    return np.cumsum(values[:, :, ::-1], axis=2)[:, :, ::-1]


def _local(before: Array, after: Array, turning: Array) -> Array:
    """From link i-1 to link i, before · joint · after, as constant + sine sin q + cosine cos q: (3, joints, 3, 4).

    A prismatic joint has q itself for the sine, and no cosine.
    """
    parts = np.zeros((3, len(turning), 3, 4))
    for i, (a, b) in enumerate(zip(before, after, strict=True)):
        rotation, position = a[:, :3], a[:, 3]
        if turning[i]:
            parts[0, i] = np.outer(rotation[:, 2], b[2])
            parts[1, i] = np.outer(rotation[:, 1], b[0]) - np.outer(rotation[:, 0], b[1])
            parts[2, i] = np.outer(rotation[:, 0], b[0]) + np.outer(rotation[:, 1], b[1])
        else:
            parts[0, i] = rotation @ b
            parts[1, i, :, 3] = rotation[:, 2]
        parts[0, i, :, 3] += position
    return parts


def _moments(values: Array) -> Array:
    """∫[x; 1][x; 1]ᵀ dm (4, 4) of m, mx … Iyz: eq. (7)."""
    mass, (x, y, z), (ixx, iyy, izz, ixy, ixz, iyz) = values[0], values[1:4], values[4:]
    half = (ixx + iyy + izz) / 2
    return np.array([[half - ixx, ixy, ixz, x], [ixy, half - iyy, iyz, y], [ixz, iyz, half - izz, z], [x, y, z, mass]])
