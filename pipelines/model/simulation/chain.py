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
        self._added, self._gravity, self._offset = added[..., None], chain.gravity[:, None], chain.offset[:, None]
        before = np.array([np.column_stack([place.rotation, place.position]) for place in chain.before])  # (n, 3, 4)
        after = np.array([np.column_stack([place.rotation, place.position]) for place in chain.after])
        turning = np.array(chain.revolute)
        self._axis, self._anchor = before[:, :, 2:3], before[:, :, 3:]
        self._local = np.ascontiguousarray(np.moveaxis(_local(before, after, turning), 0, -1).reshape(n, 12, 3))
        self._shifting = np.flatnonzero(~turning)
        moments = np.array([[_moments(link) for link in body.standard(own).reshape(n, 10)] for own in np.atleast_2d(p)])
        self._moments = np.ascontiguousarray(np.broadcast_to(np.transpose(moments, (1, 2, 3, 0)), (n, 4, 4, replicas)))
        self._upper, self._before = np.triu(np.ones((n, n), dtype=bool))[..., None], np.tril(np.ones((n, n)))
        self._features = np.ones((n, 3, replicas))
        self._frames = np.zeros((n + 1, 4, 4, replicas))
        for k in range(4):
            self._frames[0, k, k] = self._frames[:, 3, 3] = 1.0
        self._twists = np.zeros((n, 3, 4, replicas))
        self._inverse: Array = np.zeros((replicas, n, n))  # of what is held
        self._bias: Array = np.zeros((n, replicas))

    def acceleration(self, q: Array, dq: Array, torque: Array, out: Array) -> None:
        """a (joints, replicas) [rad/s^2] into `out`, for q, dq and the torque that is left for motion, all of that shape."""
        mass, bias = self.equations(q, dq)
        rest = (torque - bias).T[..., None]
        try:
            out[:] = np.linalg.solve(mass.transpose(2, 0, 1), rest)[..., 0].T
        except np.linalg.LinAlgError:
            out[:] = np.nan  # whoever simulates refuses it as a runaway

    def hold(self, q: Array, dq: Array) -> None:
        """Keep D and c + h as they are at q and dq, for `held_acceleration`."""
        mass, self._bias = self.equations(q, dq)
        try:
            self._inverse = np.asarray(np.linalg.inv(mass.transpose(2, 0, 1)))
        except np.linalg.LinAlgError:
            self._inverse = np.full_like(self._inverse, np.nan)

    def take_held(self, other: ManyChains) -> None:
        """Keep what `other` holds, of these replicas and others behind them."""
        count = len(self._inverse)
        self._inverse, self._bias = other._inverse[:count].copy(), other._bias[:, :count].copy()

    def held_acceleration(self, torque: Array, out: Array) -> None:
        """`acceleration` with D, c and h as they were last held."""
        out[:] = self.gained(torque - self._bias)

    def gained(self, torque: Array) -> Array:
        """(joints, replicas) acceleration that a torque more of that shape gives what is held."""
        return np.asarray((self._inverse @ torque.T[..., None])[..., 0].T)

    def equations(self, q: Array, dq: Array) -> tuple[Array, Array]:
        """D (joints, joints, replicas) and c + h (joints, replicas)."""
        self._place(q)
        frames, twists = self._frames[1:], self._twists
        moving = twists * dq[:, None, None]
        velocity = self._up_to(moving)
        # of matrices whose last row is zero, only the first three rows and columns of the left factor act
        spin = velocity[:, :, :3]
        change = _product(spin, moving)
        change -= _product(moving[:, :, :3], velocity)
        acceleration = self._up_to(change)
        acceleration += _product(spin, velocity)
        acceleration[:, :, 3] -= self._gravity
        moments = np.einsum("nabr,ncbr->nacr", _product(frames, self._moments), frames)
        bias = np.einsum("nabr,nabr->nr", twists, self._from(_product(acceleration, moments)))
        mass = np.einsum("jabr,kabr->jkr", twists, _product(twists, self._from(moments)))
        mass = np.where(self._upper, mass, mass.transpose(1, 0, 2))
        mass += self._added
        return mass, bias

    def _place(self, q: Array) -> None:
        """T (links from the base on, 4, 4, replicas), and the joints' unit twists S (joints, 3, 4, replicas) in the base frame."""
        features, frames, twists, shifting = self._features, self._frames, self._twists, self._shifting
        n, replicas = q.shape
        angle = q + self._offset
        np.sin(angle, out=features[:, 1])
        np.cos(angle, out=features[:, 2])
        if len(shifting):
            features[shifting, 1] = angle[shifting]
        local = np.matmul(self._local, features).reshape(n, 3, 4, replicas)
        for here, step, there in zip(frames[:-1], local, frames[1:], strict=True):
            np.einsum("abr,bcr->acr", here[:3, :3], step, out=there[:3])
            there[:3, 3] += here[:3, 3]
        rotation = frames[:-1, :3, :3]
        x, y, z = axis = np.einsum("nabr,nbk->anr", rotation, self._axis)
        px, py, pz = np.einsum("nabr,nbk->anr", rotation, self._anchor) + frames[:-1, :3, 3].transpose(1, 0, 2)
        twists[:, 2, 1], twists[:, 0, 2], twists[:, 1, 0] = x, y, z
        twists[:, 1, 2], twists[:, 2, 0], twists[:, 0, 1] = -x, -y, -z
        twists[:, 0, 3], twists[:, 1, 3], twists[:, 2, 3] = py * z - pz * y, pz * x - px * z, px * y - py * x
        if len(shifting):
            twists[shifting, :, :3] = 0.0
            twists[shifting, :, 3] = axis[:, shifting].transpose(1, 0, 2)

    def _up_to(self, values: Array) -> Array:
        """Sums over each link and all links before it; the first axis counts links."""
        return (self._before @ values.reshape(len(values), -1)).reshape(values.shape)

    def _from(self, values: Array) -> Array:
        """Sums over each link and all links behind it."""
        return (self._before.T @ values.reshape(len(values), -1)).reshape(values.shape)


def _product(a: Array, b: Array) -> Array:
    """Matrix products, link by link and replica by replica."""
    return np.asarray(np.einsum("nabr,nbcr->nacr", a, b))


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
