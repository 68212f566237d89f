"""The regressor of any serial arm and its adjoint, by the recursion run backwards.

Forwards as in `pipelines.model.rigid.chain`: velocity V, acceleration A and the twists U of all joints walk out along the
chain, and joint j's entry for parameter c of link i is its twist on that parameter's wrench, y_jc = U_j · W_c(V, A).
Backwards, the derivative by every entry goes through the same steps in reverse order: a change of frame by its transpose, a
turn by its own derivative, a wrench by those of

    n = h × a + I α + ω × I ω,   f = m a + S h,   S = [α]× + [ω]×²,   a = A_linear + ω × v
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.model.rigid.base import BaseArm
from pipelines.model.rigid.body import Array
from pipelines.model.rigid.kinematics import Turn, cross, turns

__all__ = ["ChainRows"]

# I of Ixx, Iyy, Izz, Ixy, Ixz, Iyz: the off-diagonals are the negative products.
_INERTIA = np.zeros((6, 3, 3))
for _k, (_i, _j, _sign) in enumerate(((0, 0, 1.0), (1, 1, 1.0), (2, 2, 1.0), (0, 1, -1.0), (0, 2, -1.0), (1, 2, -1.0))):
    _INERTIA[_k, _i, _j] = _INERTIA[_k, _j, _i] = _sign


@dataclass(frozen=True, eq=False)
class _Link:
    """What the way back needs of one link. Columns of a state: A, V, then the twists of joints 0 … i."""

    turned: Array  # state (6, 2 + i, samples) behind the turn, before the joint's own speed is added
    state: Array  # (6, 3 + i, samples) in the link's own frame
    wrench: Array  # W (6, parameters of the link, samples)


class ChainRows:
    """Rows of τ = Y p, joint by joint, without the columns of the links before each joint."""

    def __init__(self, body: BaseArm) -> None:
        self.chain = body.chain
        self.chosen = [[k - 10 * i for k in body.base.chosen if 10 * i <= k < 10 * (i + 1)] for i in range(self.chain.n_joints)]
        self._first = np.concatenate([[0], np.cumsum([len(own) for own in self.chosen])]).astype(int)
        count = int(self._first[-1])
        self.columns = tuple(np.arange(self._first[j], count) for j in range(self.chain.n_joints))
        self._links: list[_Link] = []
        self._moves: list[Turn] = []

    def rows(self, motion: Array) -> tuple[Array, ...]:
        """Each (columns of the joint, samples) for motion (3, joints, samples)."""
        chain, n = self.chain, self.chain.n_joints
        self._moves = turns(chain, motion[0])
        self._links = []
        y = np.empty((n, int(self._first[-1]), motion.shape[2]))
        state = np.zeros((6, 2, motion.shape[2]))
        state[3:, 0] = -chain.gravity[:, None]
        for i in range(n):
            state = _through(chain.before[i].twist_matrix, state) if chain.before[i].moves else state.copy()
            self._moves[i].carry(state)
            turned = state
            state = _driven(turned, self._moves[i].revolute, motion[1, i], motion[2, i])
            state = _through(chain.after[i].twist_matrix, state) if chain.after[i].moves else state
            wrench = _wrenches(state[:, 0], state[:, 1], self.chosen[i])
            for j in range(i + 1):
                np.einsum("rs,rcs->cs", state[:, 2 + j], wrench, out=y[j, self._first[i]:self._first[i + 1]])
            self._links.append(_Link(turned, state, wrench))
        return tuple(y[j, self._first[j]:] for j in range(n))

    def adjoint(self, motion: Array, bars: tuple[Array, ...]) -> Array:
        """Derivatives by the motion (3, joints, samples) from those by each row; after `rows` of the same motion."""
        chain, n = self.chain, self.chain.n_joints
        out = np.zeros_like(motion)
        bar = np.zeros((6, 2 + n, motion.shape[2]))  # by A, V and all twists, in the frame the way back has reached
        for i in reversed(range(n)):
            link, first, stop = self._links[i], self._first[i], self._first[i + 1]
            own = np.stack([bars[j][first - self._first[j]:stop - self._first[j]] for j in range(i + 1)])
            if stop > first:
                bar[:, 2:3 + i] += np.einsum("jcs,rcs->rjs", own, link.wrench)
                on_wrench = np.einsum("jcs,rjs->rcs", own, link.state[:, 2:])
                _wrench_adjoint(link.state[:, 0], link.state[:, 1], self.chosen[i], on_wrench, bar)
            if chain.after[i].moves:
                bar = _through(chain.after[i].twist_matrix.T, bar)
            bar = bar[:, :2 + i]  # the joint's own twist is constant
            _drive_adjoint(link.turned, bar, self._moves[i].revolute, motion[1, i], out[:, i])
            out[0, i] += _turn_adjoint(self._moves[i], link.turned, bar)
            if chain.before[i].moves:
                bar = _through(chain.before[i].twist_matrix.T, bar)
        return out


def _through(matrix: Array, state: Array) -> Array:
    return np.asarray((matrix @ state.reshape(6, -1)).reshape(state.shape))


def _driven(turned: Array, revolute: bool, dq: Array, ddq: Array) -> Array:
    """A + s q̈ + V × s q̇ and V + s q̇, with the joint's own twist s behind the others."""
    state = np.concatenate([turned, np.zeros_like(turned[:, :1])], axis=1)
    axis, first = (2, 0) if revolute else (5, 3)
    velocity = turned[:, 1]
    state[first, 0] += velocity[1] * dq
    state[first + 1, 0] -= velocity[0] * dq
    if revolute:
        state[3, 0] += velocity[4] * dq
        state[4, 0] -= velocity[3] * dq
    state[axis, 0] += ddq
    state[axis, 1] += dq
    state[axis, -1] = 1.0
    return state


def _drive_adjoint(turned: Array, bar: Array, revolute: bool, dq: Array, out: Array) -> None:
    """By q̇ and q̈ of the joint, added to `out` (3, samples), and by V before it, added to `bar`."""
    axis, first = (2, 0) if revolute else (5, 3)
    velocity = turned[:, 1]
    on_a, on_v = bar[:, 0], bar[:, 1]
    out[2] += on_a[axis]
    out[1] += on_v[axis] + on_a[first] * velocity[1] - on_a[first + 1] * velocity[0]
    on_v[1] += on_a[first] * dq
    on_v[0] -= on_a[first + 1] * dq
    if revolute:
        out[1] += on_a[3] * velocity[4] - on_a[4] * velocity[3]
        on_v[4] += on_a[3] * dq
        on_v[3] -= on_a[4] * dq


def _turn_adjoint(move: Turn, turned: Array, bar: Array) -> Array:
    """By the joint's position (samples,); `bar` is carried back through the joint in place.

    Turned by q, dx/dq = y and dy/dq = -x; shifted by q, v + w × z q.
    """
    if move.revolute:
        by_angle = np.zeros(turned.shape[2])
        for x, y in ((0, 1), (3, 4)):
            by_angle += np.einsum("ks,ks->s", bar[x], turned[y]) - np.einsum("ks,ks->s", bar[y], turned[x])
        Turn(True, move.cosine, -move.sine, move.shift).carry(bar)
        return by_angle
    by_shift = np.einsum("ks,ks->s", bar[3], turned[1]) - np.einsum("ks,ks->s", bar[4], turned[0])
    bar[1] += bar[3] * move.shift
    bar[0] -= bar[4] * move.shift
    return np.asarray(by_shift)


def _acceleration(spatial: Array, velocity: Array) -> Array:
    """a = A_linear + ω × v, what an accelerometer in the link frame's origin would show."""
    return np.asarray(spatial[3:] + cross(velocity[:3], velocity[3:]))


def _spin(alpha: Array, omega: Array) -> Array:
    """S = [α]× + ω ωᵀ - |ω|² 1 (3, 3, samples)."""
    s = omega[:, None] * omega[None]
    square = (omega * omega).sum(axis=0)
    for k in range(3):
        s[k, k] -= square
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        s[i, j] -= alpha[k]
        s[j, i] += alpha[k]
    return s


def _wrenches(spatial: Array, velocity: Array, chosen: list[int]) -> Array:
    """W (6, chosen, samples): moment and force of each parameter of one link at unit value."""
    wrench = np.zeros((6, len(chosen), spatial.shape[1]))
    alpha, omega, a = spatial[:3], velocity[:3], _acceleration(spatial, velocity)
    s = _spin(alpha, omega) if any(1 <= c <= 3 for c in chosen) else None
    for k, c in enumerate(chosen):
        if c == 0:
            wrench[3:, k] = a
        elif c <= 3 and s is not None:
            i, j = c % 3, (c + 1) % 3  # e × a for the axis e = c - 1
            wrench[i, k], wrench[j, k] = -a[j], a[i]
            wrench[3:, k] = s[:, c - 1]
        else:
            inertia = _INERTIA[c - 4]
            wrench[:3, k] = inertia @ alpha + cross(omega, inertia @ omega)
    return wrench


def _wrench_adjoint(spatial: Array, velocity: Array, chosen: list[int], on: Array, bar: Array) -> None:
    """From derivatives by the wrenches, `on` (6, chosen, samples), to those by A and V, added to `bar`."""
    omega, v = velocity[:3], velocity[3:]
    by_a, by_alpha, by_omega = np.zeros_like(omega), bar[:3, 0], np.zeros_like(omega)
    by_s = np.zeros((3, 3, omega.shape[1]))
    for k, c in enumerate(chosen):
        moment, force = on[:3, k], on[3:, k]
        if c == 0:
            by_a += force
        elif c <= 3:
            i, j = c % 3, (c + 1) % 3
            by_a[j] -= moment[i]
            by_a[i] += moment[j]
            by_s[:, c - 1] += force
        else:
            inertia = _INERTIA[c - 4]
            by_alpha += inertia @ moment
            by_omega += inertia @ cross(moment, omega) + cross(inertia @ omega, moment)
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        by_alpha[k] += by_s[j, i] - by_s[i, j]
    trace = by_s[0, 0] + by_s[1, 1] + by_s[2, 2]
    by_omega += np.einsum("ijs,js->is", by_s, omega) + np.einsum("jis,js->is", by_s, omega) - 2.0 * trace * omega
    bar[3:, 0] += by_a
    bar[:3, 1] += by_omega + cross(v, by_a)
    bar[3:, 1] += cross(by_a, omega)
