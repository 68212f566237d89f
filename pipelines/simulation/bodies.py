"""Forward dynamics: the accelerations of arms of one kind, one or many replicas at once.

`ManyRRR`, `OneRRR`: Kostić et al. 2004, (A5), in arrays and in plain numbers.

`ManyChains`: the trace form of the equations of motion of any serial arm, eq. (5)-(7), after Paul
1981, ch. 6. With T_i the frame of link i, P_i its 4 by 4 matrix of moments ∫[x; 1][x; 1]ᵀ dm, and
S_j the matrix of joint j's twist, all in the base frame,

    ∂T_i/∂q_j = S_j T_i,      V_i = Σ_{j≤i} S_j q̇_j,      A_i = Σ_{j≤i} (V_j S_j - S_j V_j) q̇_j
    D_jk = tr(S_j Σ_{i≥k} P_i S_kᵀ), j ≤ k,      bias_j = tr(S_j Σ_{i≥j} P_i (A_i + V_i² - g)ᵀ)

the sums over links being cumulative. Replicas are the last axis, links the one before it: NumPy is
fastest on rows of neighbours.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, sin

import numpy as np

from pipelines.dynamics.base_parameters import BaseArm
from pipelines.dynamics.body import RigidBody
from pipelines.dynamics.rrr import RRR
from pipelines.io.log import Array

__all__ = ["ManyChains", "ManyRRR", "OneRRR", "acceleration_of", "many_bodies"]

_STATES, _SEED = 200, 7  # numerics: random states at which coefficients are found
# numerics: the six angles, of q2 and q3
_ANGLES = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 0.0], [2.0, 2.0], [2.0, 1.0]])
# Elements of D in the order 11 12 13 22 23 33; cofactors 11 12 13 22 23 33 are ab - cd of them.
_COFACTORS = np.array([[3, 2, 1, 0, 1, 0], [5, 4, 4, 5, 2, 3], [4, 1, 2, 2, 0, 1],
                       [4, 5, 3, 2, 4, 1]])
_FULL = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])  # where an element of a symmetric matrix is
_UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))  # numerics: places of the elements of D


class ManyChains:
    """D(q) a = τ - c(q, dq) - h(q), solved for a, for every replica."""

    def __init__(self, body: BaseArm, p: Array, added: Array, replicas: int) -> None:
        """Take `p` (parameters,); `added` (joints, joints) [kg m^2] goes to D."""
        chain = body.chain
        n = chain.n_joints
        self._added, self._offset = added[..., None], chain.offset[:, None]
        self._gravity = chain.gravity[:, None]
        before, after = (
            np.array([np.column_stack([place.rotation, place.position]) for place in places])
            for places in (chain.before, chain.after))  # (n, 3, 4)
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
        self._inverse: Array = np.zeros((replicas, n, n))  # of what is held
        self._bias: Array = np.zeros((n, replicas))

    def acceleration(self, q: Array, dq: Array, torque: Array, out: Array) -> None:
        """Write a (joints, replicas) [rad/s^2] into `out`; `torque` is what is left for motion."""
        mass, bias = self.equations(q, dq)
        rest = (torque - bias).T[..., None]
        try:
            out[:] = np.linalg.solve(mass.transpose(2, 0, 1), rest)[..., 0].T
        except np.linalg.LinAlgError:
            out[:] = np.nan  # refused as a runaway

    def hold(self, q: Array, dq: Array) -> None:
        """Keep D and c + h as they are at q and dq, for `held_acceleration`."""
        mass, self._bias = self.equations(q, dq)
        try:
            self._inverse = np.asarray(np.linalg.inv(mass.transpose(2, 0, 1)))
        except np.linalg.LinAlgError:
            self._inverse = np.full_like(self._inverse, np.nan)

    def held_acceleration(self, torque: Array, out: Array) -> None:
        """`acceleration` with D, c and h as they were last held."""
        out[:] = self.gained(torque - self._bias)

    def gained(self, torque: Array) -> Array:
        """Return the acceleration (joints, replicas) that a torque gives what is held."""
        return np.asarray((self._inverse @ torque.T[..., None])[..., 0].T)

    def equations(self, q: Array, dq: Array) -> tuple[Array, Array]:
        """Return D (joints, joints, replicas) and c + h (joints, replicas)."""
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
        return mass, bias

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
    return np.array([[half - ixx, ixy, ixz, x], [ixy, half - iyy, iyz, y],
                     [ixz, iyz, half - izz, z], [x, y, z, mass], ])


class ManyRRR:
    """Many RRR arms: D(q), c(q, dq) and h(q) are linear in the sines and cosines of six angles.

        q2, q3, S = q2 + q3, 2 q2, 2 S, 2 q2 + q3       after 2 c2 cS = cos(2 q2 + q3) + cos q3

    One product of matrices then gives every element for every replica.
    """

    def __init__(self, body: RRR, p: Array, added: Array) -> None:
        """Take `p` (15,); `added` (3, 3) [kg m^2] goes to D."""
        self._table = _linear_in_features(body) @ p
        for row, place in zip(self._table, _UPPER, strict=False):
            row[0] += added[place]

    def acceleration(self, q: Array, dq: Array, torque: Array, out: Array) -> None:
        """Write a (3, replicas) [rad/s^2] into `out`; `torque` is what is left for motion."""
        rows = self._table @ _features(q)
        bias = rows[6:].reshape(3, 7, -1) * _products(dq)
        rest = torque - np.add.reduce(bias, axis=1)
        first, second, third, fourth = rows[_COFACTORS]
        cofactors = (first * second - third * fourth)[_FULL]
        np.add.reduce(cofactors * rest, axis=1, out=out)
        out /= np.add.reduce(rows[:3] * cofactors[0], axis=0)


def _features(q: Array) -> Array:
    """1, sines and cosines (13, replicas) of the six angles."""
    angles = _ANGLES @ q[1:]
    features = np.ones((13, angles.shape[1]))
    np.sin(angles, out=features[1:7])
    np.cos(angles, out=features[7:])
    return features


def _products(dq: Array) -> Array:
    """dq1², dq2², dq3², dq1 dq2, dq1 dq3, dq2 dq3, 1 (7, replicas)."""
    products = np.ones((7, dq.shape[1]))
    np.multiply(dq, dq, out=products[:3])
    np.multiply(dq[0], dq[1:], out=products[3:5])
    np.multiply(dq[1], dq[2], out=products[5])
    return products


def _linear_in_features(body: RRR) -> Array:
    """Return coefficients (27, features, parameters) of D11 D12 D13 D22 D23 D33, then of c + h.

    c and h have a row for each joint and product of speeds. Found on random states: the regressor
    is linear in them, and so is D in what an acceleration adds.
    """
    rng = np.random.default_rng(_SEED)
    q, dq = rng.uniform(-3.0, 3.0, (_STATES, 3)), rng.normal(size=(_STATES, 3))
    still, features = np.zeros_like(q), _features(q.T)
    weight = body.regressor(q, still, still)
    found = []
    for row, column in _UPPER:
        mass = body.regressor(q, still, still + np.eye(3)[column]) - weight
        found.append(np.linalg.lstsq(features.T, mass[:, row], rcond=None)[0])
    pairs = (_products(dq.T)[:, None] * features).reshape(7 * 13, -1)
    bias = body.regressor(q, dq, still)
    for joint in range(3):
        solved = np.linalg.lstsq(pairs.T, bias[:, joint], rcond=None)[0]
        found += list(solved.reshape(7, 13, -1))
    return np.array(found)


class OneRRR:
    """A single RRR arm in plain numbers, used as many are."""

    def __init__(self, body: RRR, p: Array, added: Array) -> None:
        self._acceleration = acceleration_of(body, p, added)

    def acceleration(self, q: Array, dq: Array, torque: Array, out: Array) -> None:
        """Write a (3, 1) [rad/s^2] into `out`, not numbers where the arm runs away."""
        _, q2, q3 = q[:, 0].tolist()
        try:
            out[:, 0] = self._acceleration(q2, q3, *dq[:, 0].tolist(), *torque[:, 0].tolist())
        except (ValueError, OverflowError):  # of an infinite number there is no sine
            out[:] = np.nan


def acceleration_of(body: RRR, p: Array, added: Array) -> Callable[..., tuple[float, float, float]]:
    """Return (q2, q3, dq1, dq2, dq3, torques) -> ddq of the rigid body, all of plain numbers.

    D(q) ddq = τ - c(q, dq) - h(q), Kostić et al. 2004, (A5), solved by the cofactors of D; terms
    that its elements share are worked out once. A closure holds the arm's numbers: attributes would
    cost a third more.
    """
    p1, p2, p3, p4, p5, p6, p7, p8, p9, p10, p11, p12, p13, p14, p15 = p.tolist()
    joints, g = body.robot.joints, -body.robot.gravity[2]
    a2, offset2, offset3 = joints[1].a, joints[1].offset, joints[2].offset
    (m11, m12, m13), (_, m22, m23), (_, _, m33) = added.tolist()
    e11, e22, e23, e33 = p7 + m11, p12 + m22, p13 + m23, p13 + m33
    twice_p1, twice_p5, twice_a2, a2_p3, a2_p4 = 2.0 * p1, 2.0 * p5, 2.0 * a2, a2 * p3, a2 * p4

    def acceleration(  # noqa: PLR0913
            q2: float, q3: float, v1: float, v2: float, v3: float, u1: float, u2: float,
            u3: float) -> tuple[float, float, float]:
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
        r1 = u1 + v1 * (v2 * upper + v3 * outer) - v * v * (p9 * cS - p8 * sS)
        r1 = r1 - v22 * (p11 * c2 - p10 * s2)
        r2 = u2 - half * upper + (v + v2) * v3 * bent - h3 - g * (p14 * c2 - p15 * s2)
        r3 = u3 - half * outer - v22 * bent - h3
        C11 = D22 * e33 - D23 * D23
        C12 = D13 * D23 - D12 * e33
        C13 = D12 * D23 - D13 * D22
        C23 = D12 * D13 - D11 * D23
        C22 = D11 * e33 - D13 * D13
        C33 = D11 * D22 - D12 * D12
        scale = 1.0 / (D11 * C11 + D12 * C12 + D13 * C13)
        return ((C11 * r1 + C12 * r2 + C13 * r3) * scale, (C12 * r1 + C22 * r2 + C23 * r3) * scale,
                (C13 * r1 + C23 * r2 + C33 * r3) * scale)

    return acceleration


def many_bodies(body: RigidBody, p: Array, added: Array,
                replicas: int) -> OneRRR | ManyRRR | ManyChains:
    """Return the forward dynamics of a kind of arm.

    Raises:
        TypeError: no forward dynamics is known of it.
    """
    if isinstance(body, RRR):
        return OneRRR(body, p, added) if replicas == 1 else ManyRRR(body, p, added)
    if isinstance(body, BaseArm):
        return ManyChains(body, p, added, replicas)
    raise TypeError(f"no forward dynamics is known of a {type(body).__name__}")
