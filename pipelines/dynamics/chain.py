"""Torques of any serial arm, and their regressor in the standard parameters.

    m, mx, my, mz, Ixx, Iyy, Izz, Ixy, Ixz, Iyz

of each link in its own frame: mx = ∫x dm, moments and products of inertia about the frame's
*origin*, products with *positive* sign, Ixy = +∫xy dm.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from pipelines.dynamics.kinematics import (
    LinkMotion,
    SerialChain,
    Turn,
    cross,
    link_motions,
    rows,
    turns,
    walking_memory,
)
from pipelines.io.log import Array

__all__ = ["STANDARD", "inverse_dynamics", "mass_matrix", "regressor", "spatial_inertia"]

STANDARD = ("m", "mx", "my", "mz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
# Fewer samples at once cost more in calls, more no longer gain.
_AT_ONCE = 8192  # numerics: samples worked on at once at most


def regressor(chain: SerialChain, q: Array, dq: Array, ddq: Array,
              columns: Sequence[int] | None = None, out: Array | None = None) -> Array:
    """Y with τ = Y φ: (samples, joints, columns), for q, dq, ddq (samples, joints).

    `columns` chooses standard parameters by increasing index (10 · link + position in STANDARD);
    all of them otherwise. The array is stored (joints, columns, samples), samples fastest, and so
    is `out`, memory of that shape to write to.
    """
    samples = len(q)
    fill = _Filler(chain, columns)
    # zeros, not empty: a joint does not feel the links before it, and pages never written cost no
    # time
    y = np.zeros((chain.n_joints, fill.columns, samples)) if out is None else out
    if out is not None:
        fill.clear(y)
    for part in _parts(0, samples):
        fill(y[:, :, part], q[part], dq[part], ddq[part])
    return y.transpose(2, 0, 1)


def _parts(first: int, stop: int) -> Iterator[slice]:
    """Yield first … stop in parts of equal size but for the last."""
    count = -(-(stop - first) // _AT_ONCE)
    size = -(-(stop - first) // max(count, 1))
    return (slice(first + k * size, min(first + (k + 1) * size, stop)) for k in range(count))


def _by_link(chain: SerialChain, columns: Sequence[int] | None) -> list[list[int]]:
    """Return the chosen columns of each link, 0 … 9."""
    every = range(10 * chain.n_joints)
    wanted = list(every) if columns is None else list(columns)
    if any(b <= a for a, b in pairwise(wanted)) or any(k not in every for k in wanted):
        raise ValueError(f"columns must be increasing and within 0 … {every.stop - 1}")
    return [[k - 10 * i for k in wanted if 10 * i <= k < 10 * (i + 1)]
            for i in range(chain.n_joints)]


class _Filler:
    """Writes blocks of the regressor, in memory that is taken once.

        τ_j = w_j · n_i + v_j · f_i,    with f_i, n_i linear in the ten parameters of link i

    Joint j's twist on link i's wrench: Atkeson, An & Hollerbach 1986, projected in the link's own
    frame, where the parameters are constant.
    """

    def __init__(self, chain: SerialChain, columns: Sequence[int] | None) -> None:
        self.chain = chain
        self.tables = []
        for wanted in _by_link(chain, columns):
            moments = _MOMENT_WRENCH[:, [k for k in wanted if k in _MOMENTS]]
            inertias = _INERTIA_WRENCH[:, [k - len(_MOMENTS) for k in wanted if k not in _MOMENTS]]
            self.tables.append([table for table in (moments, inertias) if table.size])
        self.widths = [sum(table.shape[1] for table in tables) for tables in self.tables]
        self._take(0)

    @property
    def columns(self) -> int:
        return sum(self.widths)

    def clear(self, y: Array) -> None:
        """Zero what no call writes: the columns of the links before each joint."""
        for j in range(1, self.chain.n_joints):
            y[j, :sum(self.widths[:j])] = 0.0

    def _take(self, samples: int) -> None:
        self.samples = samples
        self.walking = walking_memory(self.chain, samples)
        self.terms = np.zeros((_TERMS, samples))
        self.wrench = np.empty((_MOMENT_WRENCH.size, samples))

    def __call__(self, y: Array, q: Array, dq: Array, ddq: Array) -> None:
        """Write y (joints, columns, samples) for q, dq, ddq (samples, joints)."""
        if len(q) != self.samples:
            self._take(len(q))
        chain, at = self.chain, 0
        motions = link_motions(chain, turns(chain, rows(q)), rows(dq), rows(ddq), chain.gravity,
                               self.walking)
        for i, (link, tables) in enumerate(zip(motions, self.tables, strict=True)):
            if tables:
                _terms(link, self.terms)
            own = (2 if chain.revolute[i] else 5) if link.own_axis_is_z else None
            for table in tables:
                wrench = self.wrench[:table.size]
                self.terms.take(table.ravel(), axis=0, out=wrench, mode="clip")
                to = at + table.shape[1]
                _project(link.twists, wrench.reshape(*table.shape, -1), own, y[:i + 1, at:to])
                at = to


def _project(twists: Array, wrench: Array, own: int | None, out: Array) -> None:
    """Write to `out` (joints, columns, samples) the power of every twist on every wrench.

    Twists (6, joints, samples), wrench (3 or 6, columns, samples). Where the last joint's twist is
    a unit vector, `own` says which row of the wrench is the answer.
    """
    last = out.shape[0] - 1
    # joint by joint: half again as fast as all at once
    for j in range(last if own is not None else last + 1):
        np.einsum("rs,rcs->cs", twists[:len(wrench), j], wrench, out=out[j])
    if own is not None:
        out[last] = wrench[own] if own < len(wrench) else 0.0


# Rows of `_terms`: 0 nothing, 1-3 a, 4-6 α, 7-15 S row by row, 16-18 ω_y ω_z, ω_z ω_x, ω_x ω_y,
# 19-21 S_yy - S_xx, S_xx - S_zz, S_zz - S_yy, and the negatives of rows 1-18 behind them.
_MOMENTS = range(4)  # of the standard parameters of a link: m, mx, my, mz
_TERMS = 22 + 18  # numerics: rows of `_terms`
_DXY, _DXZ, _DYZ = 19, 20, 21  # numerics: rows of `_terms`
_AX, _AY, _AZ, _ALX, _ALY, _ALZ = range(1, 7)
_SXX, _SXY, _SXZ, _SYX, _SYY, _SYZ, _SZX, _SZY, _SZZ = range(7, 16)
_PX, _PY, _PZ = range(16, 19)
_MINUS = 21  # numerics: rows from one to its negative

# Moment (rows 0-2) and force (rows 3-5) of m, mx, my, mz: n = h × a, f = m a + S h, with h = (mx,
# my, mz).
_MOMENT_WRENCH = np.array([
    [0, 0, _AZ, _AY + _MINUS],
    [0, _AZ + _MINUS, 0, _AX],
    [0, _AY, _AX + _MINUS, 0],
    [_AX, _SXX, _SXY, _SXZ],
    [_AY, _SYX, _SYY, _SYZ],
    [_AZ, _SZX, _SZY, _SZZ],
])

# Moment of Ixx, Iyy, Izz, Ixy, Ixz, Iyz: n = I α + ω × I ω, the off-diagonals of I being the
# negative products.
_INERTIA_WRENCH = np.array([
    [_ALX, _PX + _MINUS, _PX, _SZX, _SYX + _MINUS, _DYZ],
    [_PY, _ALY, _PY + _MINUS, _SZY + _MINUS, _DXZ, _SXY],
    [_PZ + _MINUS, _PZ, _ALZ, _DXY, _SYZ, _SXZ + _MINUS],
])


def _terms(link: LinkMotion, out: Array) -> None:
    """Return what every element of a link's wrench is made of.

    S = [α]× + [ω]×², so that a point x accelerates by a + S x.
    """
    out[1:4] = link.acceleration()
    out[4:7] = link.alpha
    spin = out[7:16]
    np.multiply(link.omega[:, None], link.omega[None], out=spin.reshape(3, 3, -1))
    out[16], out[17], out[18] = spin[5], spin[6], spin[1]
    spin[::4] -= spin[0] + spin[4] + spin[8]  # [ω]×² = ω ωᵀ - |ω|² 1
    for k, (i, j) in enumerate(((5, 7), (6, 2), (1, 3))):
        spin[i] -= link.alpha[k]
        spin[j] += link.alpha[k]
    for k, (i, j) in enumerate(((4, 0), (0, 8), (8, 4))):
        np.subtract(spin[i], spin[j], out=out[19 + k])
    np.negative(out[1:19], out=out[22:])


def inverse_dynamics(chain: SerialChain, q: Array, dq: Array, ddq: Array, phi: Array,
                     gravity: Array | None = None) -> Array:
    """τ (samples, joints) [N m] of standard parameters `phi` (joints * 10,).

    The recursive Newton-Euler algorithm, Luh, Walker & Paul 1980; `gravity` replaces the chain's.
    """
    g = chain.gravity if gravity is None else gravity
    tau = np.empty(np.shape(q))
    for part in _parts(0, len(q)):
        moves = turns(chain, rows(q[part]))
        wrenches = [_wrench(link, values) for link, values in
                    zip(link_motions(chain, moves, rows(dq[part]), rows(ddq[part]), g,
                                     walking_memory(chain, len(q[part]), with_twists=False)),
                        np.reshape(phi, (-1, 10)), strict=True)]
        tau[part] = _inward(chain, moves, wrenches).T
    return tau


def _wrench(link: LinkMotion, values: Array) -> Array:
    """Return moment and force (6, samples) on one link: M A + V ×* M V.

        n = I α + ω × I ω + h × a,      f = m a + α × h + ω × (ω × h)
    """
    matrix = spatial_inertia(values)
    inertia, cross_h, mass = matrix[:3, :3], matrix[:3, 3:], values[0]
    omega, alpha, a = link.omega, link.alpha, link.acceleration()
    wrench = np.empty((6, omega.shape[1]))
    wrench[:3] = inertia @ alpha + cross_h @ a + cross(omega, inertia @ omega)
    wrench[3:] = mass * a - cross_h @ alpha - cross(omega, cross_h @ omega)
    return wrench


def _inward(chain: SerialChain, moves: list[Turn], wrenches: list[Array]) -> Array:
    """Collect the wrenches from the tip inwards; each joint's torque (joints, samples) is its
    share.

    A wrench goes inwards by the transpose of what carries a twist outwards.
    """
    tau = np.empty((chain.n_joints, wrenches[0].shape[1]))
    total = np.zeros_like(wrenches[0])
    for i in reversed(range(chain.n_joints)):
        total = chain.after[i].twist_matrix.T @ (total + wrenches[i])
        tau[i] = total[2 if moves[i].revolute else 5]
        moves[i].carry_wrench_back(total)
        total = chain.before[i].twist_matrix.T @ total
    return tau


def mass_matrix(chain: SerialChain, q: Array, phi: Array) -> Array:
    """D(q) (samples, joints, joints): the sum over links of Uᵀ M U, U the joints' twists.

    Siciliano et al. 2009, eq. (7.32), in the link's own frame.
    """
    n = chain.n_joints
    d = np.zeros((n, n, len(q)))
    for part in _parts(0, len(q)):
        still = np.zeros_like(rows(q[part]))
        for i, (link, values) in enumerate(
                zip(
                    link_motions(chain, turns(chain, rows(q[part])), still, still, np.zeros(3),
                                 walking_memory(chain, still.shape[1])), np.reshape(phi, (-1, 10)),
                    strict=True)):
            u = link.twists
            momentum = (spatial_inertia(values) @ u.reshape(6, -1)).reshape(u.shape)
            d[:i + 1, :i + 1, part] += np.einsum("rjs,rks->jks", u, momentum)
    return d.transpose(2, 0, 1)


def spatial_inertia(values: Array) -> Array:
    """M (6, 6): momentum about the origin of a twist [w; v]: I w + h × v, m v + w × h.

    Featherstone 2008, ch. 2 (rigid-body inertia).
    """
    mass, (hx, hy, hz) = values[0], values[1:4]
    ixx, iyy, izz, ixy, ixz, iyz = values[4:]
    cross_h = np.array([[0.0, -hz, hy], [hz, 0.0, -hx], [-hy, hx, 0.0]])
    inertia = np.array([[ixx, -ixy, -ixz], [-ixy, iyy, -iyz], [-ixz, -iyz, izz]])
    return np.block([[inertia, cross_h], [cross_h.T, mass * np.eye(3)]])
