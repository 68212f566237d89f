"""Compute the rows of the regressor along a motion, and the adjoint of that map.

τ_j = rows_jᵀ p[columns_j], joint by joint, without columns that are always zero. From the
derivatives R̄ of a criterion by the rows, the adjoint gives

    q̄ = Σ R̄ ∂R/∂q,   dq̄ = Σ R̄ ∂R/∂dq,   ddq̄ = Σ R̄ ∂R/∂ddq

`RRRRows` differentiates Kostić et al. 2004, eq. (A5), by hand. `ChainRows` runs the recursion of
any serial arm backwards: with velocity V, acceleration A and the twists U of all joints, the entry
of joint j for parameter c of link i is y_jc = U_j · W_c(V, A), with the wrench

    n = h × a + I α + ω × I ω,   f = m a + S h,   S = [α]× + [ω]×²,   a = A_linear + ω × v

Friction acts on its own joint: tanh(w q̇), q̇ and a constant offset.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.base_parameters import BaseArm
from pipelines.dynamics.body import Array, RigidBody
from pipelines.dynamics.kinematics import Placement, Turn, cross, turns
from pipelines.dynamics.rrr import ACTING, RRR
from pipelines.excitation.config import CONFIG

__all__ = ["ArmColumns", "ChainRows", "RRRRows", "arm_columns", "grams_of"]

CROSS = ((1, 2), (2, 0), (0, 1))  # numerics: where [a]× holds -a_k, and transposed a_k

# I of Ixx, Iyy, Izz, Ixy, Ixz, Iyz: the off-diagonals are the negative products.
INERTIA = np.zeros((6, 3, 3))
for _k, (_i, _j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))):
    INERTIA[_k, _i, _j] = INERTIA[_k, _j, _i] = 1.0 if _i == _j else -1.0


class RRRRows:
    """The RRR arm, in closed form, for motions (3, joints, samples)."""

    def __init__(self, body: RRR) -> None:
        self.columns = tuple(np.array(acting, dtype=np.intp) for acting in ACTING)
        self._body = body
        self._a2, self._g = body.robot.joints[1].a, -body.robot.gravity[2]
        self._memory = np.empty((28, 0))

    def rows(self, motion: Array) -> tuple[Array, ...]:
        """Return the rows (columns, samples) of each joint; the next call overwrites them."""
        if self._memory.shape[1] != motion.shape[2]:
            self._memory = np.empty((28, motion.shape[2]))
        q, dq, ddq = (part.T for part in motion)
        return self._body.acting_rows(q, dq, ddq, self._memory)

    def adjoint(self, motion: Array, bars: Sequence[Array]) -> Array:
        """Return the derivatives by the motion from those by each row."""
        q2, q3 = (motion[0, j] + self._body.geometry.offset[j] for j in (1, 2))
        c2, s2, c3, s3 = np.cos(q2), np.sin(q2), np.cos(q3), np.sin(q3)
        angles = (c2, s2, c3, s3, c2 * c3 - s2 * s3, s2 * c3 + c2 * s3)
        out = np.zeros_like(motion)
        self._first_row(bars[0], angles, motion, out)
        self._other_rows(bars[1], bars[2], angles, motion, out)
        return out

    def _first_row(self, w: Array, angles: tuple[Array, ...], motion: Array, out: Array) -> None:
        c2, s2, _, _, cS, sS = angles
        (v1, v2, v3), (u1, u2, u3) = motion[1], motion[2]
        v, u, twice = v2 + v3, u2 + u3, 2.0 * self._a2
        sin22, cos22, sin2S, cos2S = 2 * s2 * c2, c2 * c2 - s2 * s2, 2 * sS * cS, cS * cS - sS * sS
        sin223, cos223 = s2 * cS + c2 * sS, c2 * cS - s2 * sS
        v12, v13, v1v, v22, vv = v1 * v2, v1 * v3, v1 * v, v2 * v2, v * v
        w2, w3 = twice * w[2], twice * w[3]
        up, down = w2 * cS - w3 * sS, w2 * sS + w3 * cS  # factors of u1 c2 and -v1 v3 c2
        k12 = w[1] * cos22 - w[0] * sin22 - w2 * sin223 - w3 * cos223
        k13 = -c2 * down
        k1v = -w[4] * sin2S - w[5] * cos2S
        by_u, by_vv = w[7] * cS + w[8] * sS, w[8] * cS - w[7] * sS
        by_u2, by_v22 = w[9] * c2 + w[10] * s2, w[10] * c2 - w[9] * s2
        mixed = v12 * (w3 * sin223 - w2 * cos223)  # of 2 q2 + q3
        by_q2 = (u1 * (w[1] * cos22 - w[0] * sin22) - 2 * v12 * (w[0] * cos22 + w[1] * sin22)
                 - s2 * (u1 * up - v13 * down) + mixed + u2 * by_v22 - v22 * by_u2)
        by_S = (mixed - c2 * (u1 * down + v13 * up) - u1 * (w[4] * sin2S + w[5] * cos2S)
                + 2 * v1v * (w[5] * sin2S - w[4] * cos2S) + u * by_vv - vv * by_u)
        out[0, 1] += by_q2 + by_S
        out[0, 2] += by_S
        out[1, 0] += k12 * v2 + k13 * v3 + k1v * v
        turn = k1v * v1 + 2 * v * by_vv
        out[1, 1] += k12 * v1 + turn + 2 * v2 * by_v22
        out[1, 2] += k13 * v1 + turn
        out[2, 0] += (w[0] * (c2 * c2) + 0.5 * w[1] * sin22 + c2 * up + w[4] * (cS * cS)
                      - 0.5 * w[5] * sin2S + w[6])
        out[2, 1] += by_u + by_u2
        out[2, 2] += by_u

    def _other_rows(self, two: Array, three: Array, angles: tuple[Array, ...], motion: Array,
                    out: Array) -> None:
        """Add rows two and three; columns 5, 6, 8 and 9, which they share, have both bars."""
        c2, s2, c3, s3, cS, sS = angles
        (v1, v2, v3), (u1, u2, u3) = motion[1], motion[2]
        a2, g, twice = self._a2, self._g, 2.0 * self._a2
        sin22, cos22, sin2S, cos2S = 2 * s2 * c2, c2 * c2 - s2 * s2, 2 * sS * cS, cS * cS - sS * sS
        sin223, cos223 = s2 * cS + c2 * sS, c2 * cS - s2 * sS
        half, turning, slanted = 0.5 * v1 * v1, 0.5 * v3 * v3 + v2 * v3, u2 + 0.5 * u3
        fore = half + v2 * v2
        t0, t1, t9, t10, t11, t12, t13, t14 = (two[k] for k in (0, 1, 4, 5, 6, 7, 8, 9))
        t4, t5, t7, t8 = (two[10 + k] + three[k] for k in range(4))
        t2, t3, r2, r3 = twice * two[2], twice * two[3], a2 * three[4], a2 * three[5]
        x2, x3 = t2 + r2, t3 + r3
        by_fore, by_bent = r2 * s3 + r3 * c3, r2 * c3 - r3 * s3
        by_turning, by_slanted = -t2 * s3 - t3 * c3, t2 * c3 - t3 * s3
        by_half = (t0 * sin22 - t1 * cos22 + x2 * sin223 + x3 * cos223 + t4 * sin2S + t5 * cos2S
                   + by_fore)
        mixed = half * (x2 * cos223 - x3 * sin223)
        by_q3 = slanted * by_turning - turning * by_slanted + fore * by_bent - u2 * by_fore
        by_q2 = (2 * half * (t0 * cos22 + t1 * sin22) + mixed + u1 * (t10 * c2 - t9 * s2)
                 - g * (t13 * s2 + t14 * c2))
        by_S = (mixed + 2 * half * (t4 * cos2S - t5 * sin2S) + u1 * (t8 * cS - t7 * sS)
                - g * ((two[2] + three[4]) * sS + (two[3] + three[5]) * cS))
        out[0, 1] += by_q2 + by_S
        out[0, 2] += by_S + by_q3
        out[1, 0] += v1 * by_half
        out[1, 1] += by_turning * v3 + 2 * v2 * by_fore
        out[1, 2] += by_turning * (v2 + v3)
        out[2, 0] += t7 * cS + t8 * sS + t9 * c2 + t10 * s2
        out[2, 1] += by_slanted + by_bent + t11 + three[6]
        out[2, 2] += 0.5 * by_slanted + t12 + three[6]


class ChainRows:
    """Any serial arm, without the columns of the links before each joint."""

    def __init__(self, body: BaseArm) -> None:
        self.chain = body.chain
        n, links = self.chain.n_joints, [divmod(k, 10) for k in body.base.chosen]
        self.chosen = [[c for link, c in links if link == i] for i in range(n)]
        self._first = np.cumsum([0, *map(len, self.chosen)])
        self.columns = tuple(np.arange(self._first[j], self._first[-1]) for j in range(n))
        # what the way back needs of each link: A, V and the twists of the joints so far behind its
        # turn (6, 2 + i, samples) and in its own frame (6, 3 + i, samples), and its wrenches
        self._links: list[tuple[Array, Array, Array]] = []
        self._moves: list[Turn] = []

    def rows(self, motion: Array) -> tuple[Array, ...]:
        """Return the rows (columns, samples) of each joint."""
        chain, n = self.chain, self.chain.n_joints
        self._moves, self._links = turns(chain, motion[0]), []
        y = np.empty((n, int(self._first[-1]), motion.shape[2]))
        state = np.zeros((6, 2, motion.shape[2]))
        state[3:, 0] = -chain.gravity[:, None]
        for i in range(n):
            turned = _through(chain.before[i], state).copy()
            self._moves[i].carry(turned)
            state = _driven(turned, self._moves[i].revolute, motion[1, i], motion[2, i])
            state = _through(chain.after[i], state)
            wrench = _wrenches(state[:, 0], state[:, 1], self.chosen[i])
            own = slice(self._first[i], self._first[i + 1])
            for j in range(i + 1):
                np.einsum("rs,rcs->cs", state[:, 2 + j], wrench, out=y[j, own])
            self._links.append((turned, state, wrench))
        return tuple(y[j, self._first[j]:] for j in range(n))

    def adjoint(self, motion: Array, bars: Sequence[Array]) -> Array:
        """Return the derivatives by the motion from those by each row, after its `rows`."""
        chain, n, at = self.chain, self.chain.n_joints, self._first
        out = np.zeros_like(motion)
        bar = np.zeros((6, 2 + n, motion.shape[2]))  # by A, V and all twists
        for i in reversed(range(n)):
            turned, state, wrench = self._links[i]
            own = np.stack([bars[j][at[i] - at[j]:at[i + 1] - at[j]] for j in range(i + 1)])
            if self.chosen[i]:
                bar[:, 2:3 + i] += np.einsum("jcs,rcs->rjs", own, wrench)
                on_wrench = np.einsum("jcs,rjs->rcs", own, state[:, 2:])
                _wrench_adjoint(state[:, 0], state[:, 1], self.chosen[i], on_wrench, bar)
            bar = _through(chain.after[i], bar, back=True)
            bar = bar[:, :2 + i]  # the joint's own twist is constant
            _drive_adjoint(turned, bar, self._moves[i].revolute, motion[1, i], out[:, i])
            out[0, i] += _turn_adjoint(self._moves[i], turned, bar)
            bar = _through(chain.before[i], bar, back=True)
        return out


def _through(frame: Placement, state: Array, back: bool = False) -> Array:
    """Return twists (6, k, samples) in the next frame, or derivatives by them carried back."""
    if not frame.moves:
        return state
    matrix = frame.twist_matrix.T if back else frame.twist_matrix
    return np.asarray((matrix @ state.reshape(6, -1)).reshape(state.shape))


def _pairs(revolute: bool) -> tuple[tuple[int, int], ...]:
    """Return the rows (t, s) with x × z: of x × (joint twist) t is x_s+1, and t + 1 is -x_s."""
    return ((0, 0), (3, 3)) if revolute else ((3, 0),)


def _driven(turned: Array, revolute: bool, dq: Array, ddq: Array) -> Array:
    """Return A + s q̈ + V × s q̇ and V + s q̇, and the joint's own twist s behind the others."""
    state = np.concatenate([turned, np.zeros_like(turned[:, :1])], axis=1)
    axis, velocity = 2 if revolute else 5, turned[:, 1]
    for t, s in _pairs(revolute):
        state[t, 0] += velocity[s + 1] * dq
        state[t + 1, 0] -= velocity[s] * dq
    state[axis, 0] += ddq
    state[axis, 1] += dq
    state[axis, -1] = 1.0
    return state


def _drive_adjoint(turned: Array, bar: Array, revolute: bool, dq: Array, out: Array) -> None:
    """Add the derivatives by q̇ and q̈ to `out` (3, samples), and that by V to `bar`."""
    axis, velocity = 2 if revolute else 5, turned[:, 1]
    on_a, on_v = bar[:, 0], bar[:, 1]
    out[2] += on_a[axis]
    out[1] += on_v[axis]
    for t, s in _pairs(revolute):
        out[1] += on_a[t] * velocity[s + 1] - on_a[t + 1] * velocity[s]
        on_v[s + 1] += on_a[t] * dq
        on_v[s] -= on_a[t + 1] * dq


def _turn_adjoint(move: Turn, turned: Array, bar: Array) -> Array:
    """Return the derivative by the joint's position (samples,); carry `bar` back in place."""
    by_q = np.zeros(turned.shape[2])
    for t, s in _pairs(move.revolute):
        by_q += np.einsum("ks,ks->s", bar[t], turned[s + 1])
        by_q -= np.einsum("ks,ks->s", bar[t + 1], turned[s])
    if move.revolute:
        Turn(True, move.cosine, -move.sine, move.shift).carry(bar)
    else:
        bar[1] += bar[3] * move.shift
        bar[0] -= bar[4] * move.shift
    return by_q


def _wrenches(spatial: Array, velocity: Array, chosen: list[int]) -> Array:
    """Return W (6, chosen, samples): moment and force of each parameter at unit value."""
    wrench = np.zeros((6, len(chosen), spatial.shape[1]))
    alpha, omega = spatial[:3], velocity[:3]
    a = spatial[3:] + cross(omega, velocity[3:])
    spin = omega[:, None] * omega[None] - (omega * omega).sum(axis=0) * np.eye(3)[:, :, None]
    for k, (i, j) in enumerate(CROSS):
        spin[i, j] -= alpha[k]
        spin[j, i] += alpha[k]
    for k, c in enumerate(chosen):
        if c == 0:
            wrench[3:, k] = a
        elif c <= len(CROSS):
            i, j = CROSS[c - 1]  # e × a for the axis e = c - 1
            wrench[i, k], wrench[j, k] = -a[j], a[i]
            wrench[3:, k] = spin[:, c - 1]
        else:
            inertia = INERTIA[c - 4]
            wrench[:3, k] = inertia @ alpha + cross(omega, inertia @ omega)
    return wrench


def _wrench_adjoint(spatial: Array, velocity: Array, chosen: list[int], on: Array,
                    bar: Array) -> None:
    """Add to `bar` the derivatives by A and V, from those by the wrenches (6, chosen, samples)."""
    omega, v = velocity[:3], velocity[3:]
    by_a, by_alpha, by_omega = np.zeros_like(omega), bar[:3, 0], np.zeros_like(omega)
    by_s = np.zeros((3, 3, omega.shape[1]))
    for k, c in enumerate(chosen):
        moment, force = on[:3, k], on[3:, k]
        if c == 0:
            by_a += force
        elif c <= len(CROSS):
            i, j = CROSS[c - 1]
            by_a[j] -= moment[i]
            by_a[i] += moment[j]
            by_s[:, c - 1] += force
        else:
            inertia = INERTIA[c - 4]
            by_alpha += inertia @ moment
            by_omega += inertia @ cross(moment, omega) + cross(inertia @ omega, moment)
    for k, (i, j) in enumerate(CROSS):
        by_alpha[k] += by_s[j, i] - by_s[i, j]
    trace = by_s[0, 0] + by_s[1, 1] + by_s[2, 2]
    by_omega += np.einsum("ijs,js->is", by_s + by_s.swapaxes(0, 1), omega) - 2.0 * trace * omega
    bar[3:, 0] += by_a
    bar[:3, 1] += by_omega + cross(v, by_a)
    bar[3:, 1] += cross(by_a, omega)


@dataclass(frozen=True, eq=False)
class ArmColumns:
    """The columns that are estimated from a motion: rigid body, and friction if wanted."""

    rigid: RRRRows | ChainRows
    names: tuple[str, ...]
    units: tuple[str, ...]
    columns: tuple[np.ndarray, ...]  # of each joint
    rigid_count: int
    friction: bool

    def rows(self, motion: Array) -> tuple[Array, ...]:
        """Return the rows (columns, samples) of each joint for motion (3, joints, samples)."""
        rigid = self.rigid.rows(motion)
        if not self.friction:
            return rigid
        return tuple(
            np.concatenate([own, np.stack([np.tanh(CONFIG.sharpness * v), v, np.ones_like(v)])])
            for own, v in zip(rigid, motion[1], strict=True))

    def adjoint(self, motion: Array, bars: Sequence[Array]) -> Array:
        """Return the derivatives by the motion from those by each row, after its `rows`."""
        if not self.friction:
            return self.rigid.adjoint(motion, bars)
        out = self.rigid.adjoint(motion, [bar[:-3] for bar in bars])
        for j, bar in enumerate(bars):
            level = np.tanh(CONFIG.sharpness * motion[1, j])
            out[1, j] += bar[-3] * CONFIG.sharpness * (1.0 - level * level) + bar[-2]
        return out


def arm_columns(body: RigidBody, *, friction: bool) -> ArmColumns:
    """Return the columns of `body`, in closed form or by the recursion."""
    if isinstance(body, RRR):
        rigid: RRRRows | ChainRows = RRRRows(body)
    else:
        rigid = ChainRows(body if isinstance(body, BaseArm) else BaseArm(body.robot))
    names, units = [p.name for p in body.parameters], [p.unit for p in body.parameters]
    columns, count = rigid.columns, len(names)
    if friction:
        columns = tuple(np.concatenate([own, count + 3 * j + np.arange(3)])
                        for j, own in enumerate(columns))
        for j, revolute in enumerate(body.robot.revolute, 1):
            torque, damping = ("N m", "N m s/rad") if revolute else ("N", "N s/m")
            names += [f"coulomb:{j}", f"viscous:{j}", f"torque_offset:{j}"]
            units += [torque, damping, torque]
    return ArmColumns(rigid, tuple(names), tuple(units), columns, count, friction)


def grams_of(columns: ArmColumns, motion: Array) -> Array:
    """Return S_j = A_jᵀ A_j / samples of every joint (joints, columns, columns)."""
    return grams_of_rows(columns, columns.rows(motion))


def grams_of_rows(columns: ArmColumns, rows: Sequence[Array]) -> Array:
    """Return the same of rows that are computed already."""
    grams = np.zeros((len(rows), len(columns.names), len(columns.names)))
    for gram, own, row in zip(grams, columns.columns, rows, strict=True):
        gram[np.ix_(own, own)] = row @ row.T / row.shape[1]
    return grams
