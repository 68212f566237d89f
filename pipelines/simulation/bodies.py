"""Forward dynamics: D⁻¹(q) and c(q, dq) + h(q) of arms of one kind, of many replicas at once.

`closed_form`: Kostić et al. 2004, (A5), of RRR arms, in plain numbers or in arrays.

`Chains`: the trace form of the equations of motion of any serial arm, eq. (5)-(7), after Paul
1981, ch. 6. With T_i the frame of link i, P_i its 4 by 4 matrix of moments ∫[x; 1][x; 1]ᵀ dm, and
S_j the matrix of joint j's twist, all in the base frame,

    ∂T_i/∂q_j = S_j T_i,      V_i = Σ_{j≤i} S_j q̇_j,      A_i = Σ_{j≤i} (V_j S_j - S_j V_j) q̇_j
    D_jk = tr(S_j Σ_{i≥k} P_i S_kᵀ), j ≤ k,      bias_j = tr(S_j Σ_{i≥j} P_i (A_i + V_i² - g)ᵀ)

Replicas are the last axis, links the one before it: NumPy is fastest on rows of neighbours.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pipelines.dynamics.base_parameters import BaseArm
from pipelines.dynamics.body import RigidBody
from pipelines.dynamics.functions import ARRAYS, Functions
from pipelines.dynamics.rrr import RRR
from pipelines.io.log import Array

__all__ = ["Chains", "ClosedForm", "Held", "bodies_of", "closed_form", "gained"]

Held = tuple[Array, Array]  # D⁻¹ (joints, joints, replicas), c + h (joints, replicas)
_FULL = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])  # where an element of a symmetric matrix is


def gained(inverse: Array, torque: Array) -> Array:
    """Return the acceleration (joints, replicas) [rad/s^2] by D⁻¹ and what torque is left."""
    return np.asarray(np.add.reduce(inverse * torque, axis=1))


class Chains:
    """Serial arms of any kind."""

    def __init__(self, body: BaseArm, p: Array, added: Array, replicas: int) -> None:
        """Take `p` (parameters,); `added` (joints, joints) [kg m^2] goes to D."""
        chain = body.chain
        n = chain.n_joints
        self._added, self._offset = added[..., None], chain.offset[:, None]
        self._gravity = chain.gravity[:, None]
        before, after = (
            np.array([np.column_stack([place.rotation, place.position]) for place in places])
            for places in (chain.before, chain.after)
        )  # (n, 3, 4)
        turning = np.array(chain.revolute)
        self._axis, self._anchor = before[:, :, 2:3], before[:, :, 3:]
        local = np.moveaxis(_local(before, after, turning), 0, -1)
        self._local = np.ascontiguousarray(local.reshape(n, 12, 3))
        self._shifting = np.flatnonzero(~turning)
        moments = np.array([_moments(link) for link in body.standard(p).reshape(n, 10)])
        self._moments = np.repeat(moments[..., None], replicas, axis=-1)
        self._before = np.tril(np.ones((n, n)))
        self._upper = np.triu(np.ones((n, n), dtype=bool))[..., None]
        self._features = np.ones((n, 3, replicas))
        self._frames = np.zeros((n + 1, 4, 4, replicas))
        for k in range(4):
            self._frames[0, k, k] = self._frames[:, 3, 3] = 1.0
        self._twists = np.zeros((n, 3, 4, replicas))

    def hold(self, q: Array, dq: Array) -> Held:
        self._place(q)
        frames, twists = self._frames[1:], self._twists
        moving = twists * dq[:, None, None]
        velocity = self._up_to(moving)
        # the last row of these matrices is zero: of the left factor three columns act
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
        try:
            return np.linalg.inv(mass.transpose(2, 0, 1)).transpose(1, 2, 0), bias
        except np.linalg.LinAlgError:
            return np.full_like(mass, np.nan), bias  # refused as a runaway

    def _place(self, q: Array) -> None:
        """Update T (links from the base on, 4, 4, replicas) and unit twists S (joints, 3, 4, …)."""
        features, frames, twists = self._features, self._frames, self._twists
        shifting = self._shifting
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
        anchor = np.einsum("nabr,nbk->anr", rotation, self._anchor)
        px, py, pz = anchor + frames[:-1, :3, 3].transpose(1, 0, 2)
        twists[:, 2, 1], twists[:, 0, 2], twists[:, 1, 0] = x, y, z
        twists[:, 1, 2], twists[:, 2, 0], twists[:, 0, 1] = -x, -y, -z
        twists[:, 0, 3] = py * z - pz * y
        twists[:, 1, 3] = pz * x - px * z
        twists[:, 2, 3] = px * y - py * x
        if len(shifting):
            twists[shifting, :, :3] = 0.0
            twists[shifting, :, 3] = axis[:, shifting].transpose(1, 0, 2)

    def _up_to(self, values: Array) -> Array:
        """Sum over each link and all links before it; the first axis counts links."""
        return (self._before @ values.reshape(len(values), -1)).reshape(values.shape)

    def _from(self, values: Array) -> Array:
        """Sum over each link and all links behind it."""
        return (self._before.T @ values.reshape(len(values), -1)).reshape(values.shape)


def _product(a: Array, b: Array) -> Array:
    """Return matrix products, link by link and replica by replica."""
    return np.asarray(np.einsum("nabr,nbcr->nacr", a, b))


def _local(before: Array, after: Array, turning: Array) -> Array:
    """Return before · joint · after (3, joints, 3, 4) as constant, factor of sin q and of cos q.

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
    return np.array(
        [
            [half - ixx, ixy, ixz, x],
            [ixy, half - iyy, iyz, y],
            [ixz, iyz, half - izz, z],
            [x, y, z, mass],
        ]
    )


def closed_form(body: RRR, p: Array, added: Array, m: Functions) -> Callable[..., tuple[Any, ...]]:
    """Return (q2, q3, dq1, dq2, dq3) -> D⁻¹ 11 12 13 22 23 33 and c + h, in numbers or arrays.

    Kostić et al. 2004, (A5), D inverted by its cofactors. A closure holds the arm's numbers:
    attributes would cost a third more.
    """
    sin, cos = m.sin, m.cos
    p1, p2, p3, p4, p5, p6, p7, p8, p9, p10, p11, p12, p13, p14, p15 = p.tolist()
    joints, g = body.robot.joints, -body.robot.gravity[2]
    a2, offset2, offset3 = joints[1].a, joints[1].offset, joints[2].offset
    (m11, m12, m13), (_, m22, m23), (_, _, m33) = added.tolist()
    e11, e22, e23, e33 = p7 + m11, p12 + m22, p13 + m23, p13 + m33
    twice_p1, twice_p5, twice_a2, a2_p3, a2_p4 = 2.0 * p1, 2.0 * p5, 2.0 * a2, a2 * p3, a2 * p4

    def equations(q2: Any, q3: Any, v1: Any, v2: Any, v3: Any) -> tuple[Any, ...]:
        q2, q3 = q2 + offset2, q3 + offset3
        c2, s2, c3, s3 = cos(q2), sin(q2), cos(q3), sin(q3)
        cS = c2 * c3 - s2 * s3
        sS = s2 * c3 + c2 * s3
        lever = p3 * cS - p4 * sS
        across = twice_a2 * (p3 * sS + p4 * cS) * c2
        near = a2_p3 * c3 - a2_p4 * s3
        bent = a2_p3 * s3 + a2_p4 * c3
        d0 = p8 * cS + p9 * sS
        D13 = d0 + m13
        D12 = d0 + p10 * c2 + p11 * s2 + m12
        D11 = (p1 * c2 + p2 * s2 + twice_a2 * lever) * c2 + (p5 * cS - p6 * sS) * cS + e11
        D22 = e22 + near + near
        D23 = e23 + near
        outer = twice_p5 * sS * cS + p6 * (cS * cS - sS * sS) + across
        upper = twice_p1 * s2 * c2 - p2 * (c2 * c2 - s2 * s2) + outer + across - bent - bent
        v, v22 = v2 + v3, v2 * v2
        half = 0.5 * v1 * v1
        h3 = g * lever
        b1 = v * v * (p9 * cS - p8 * sS) + v22 * (p11 * c2 - p10 * s2)
        b1 = b1 - v1 * (v2 * upper + v3 * outer)
        b2 = half * upper - (v + v2) * v3 * bent + h3 + g * (p14 * c2 - p15 * s2)
        b3 = half * outer + v22 * bent + h3
        C11 = D22 * e33 - D23 * D23
        C12 = D13 * D23 - D12 * e33
        C13 = D12 * D23 - D13 * D22
        scale = 1.0 / (D11 * C11 + D12 * C12 + D13 * C13)
        return (
            C11 * scale,
            C12 * scale,
            C13 * scale,
            (D11 * e33 - D13 * D13) * scale,
            (D12 * D13 - D11 * D23) * scale,
            (D11 * D22 - D12 * D12) * scale,
            b1,
            b2,
            b3,
        )

    return equations


class ClosedForm:
    """RRR arms."""

    def __init__(self, body: RRR, p: Array, added: Array) -> None:
        """Take `p` (15,); `added` (3, 3) [kg m^2] goes to D."""
        self._equations = closed_form(body, p, added, ARRAYS)

    def hold(self, q: Array, dq: Array) -> Held:
        """Return D⁻¹ and c + h at q and dq (3, replicas)."""
        found = self._equations(q[1], q[2], *dq)
        return np.array(found[:6])[_FULL], np.array(found[6:])


def bodies_of(body: RigidBody, p: Array, added: Array, replicas: int) -> Chains | ClosedForm:
    """Return the forward dynamics of a kind of arm.

    Raises:
        TypeError: no forward dynamics is known of it.
    """
    if isinstance(body, RRR):
        return ClosedForm(body, p, added)
    if isinstance(body, BaseArm):
        return Chains(body, p, added, replicas)
    raise TypeError(f"no forward dynamics is known of a {type(body).__name__}")
