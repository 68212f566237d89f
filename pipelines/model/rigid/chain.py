"""Torques of any serial arm, and their regressor in the standard parameters.

Ten standard parameters a link, in this order, in the link's own frame:

    m, mx, my, mz, Ixx, Iyy, Izz, Ixy, Ixz, Iyz

mx = ∫x dm is the first moment (mass times centre of mass). Moments and products of inertia are about the frame's
*origin*, products with *positive* sign, Ixy = +∫xy dm: the inertia tensor's off-diagonal elements are their negatives.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from pipelines.log.robot import LinkParameters
from pipelines.model.rigid.geometry import SerialChain
from pipelines.model.rigid.kinematics import LinkMotion, Turn, link_motions, rows, turns

__all__ = ["BLOCK", "STANDARD", "inverse_dynamics", "mass_matrix", "regressor", "regressor_blocks",
           "standard_parameters"]

Array = npt.NDArray[np.float64]

STANDARD = ("m", "mx", "my", "mz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
BLOCK = 4096  # samples handed on at once by `regressor_blocks`
_CACHED = 1024  # samples worked on at once: all rows of one link then fit into the second-level cache


def standard_parameters(links: Sequence[LinkParameters]) -> Array:
    """The standard parameters (links * 10,) of known links."""
    return np.array([v for k in links for v in (k.mass, *(k.mass * c for c in k.com), *k.inertia)], dtype=float)


def regressor(chain: SerialChain, q: Array, dq: Array, ddq: Array, columns: Sequence[int] | None = None) -> Array:
    """Y with τ = Y φ: (samples, joints, columns), for q, dq, ddq (samples, joints).

    `columns` chooses standard parameters by increasing index (10 · link + position in STANDARD); all of them otherwise.
    The array is stored (joints, columns, samples), samples fastest: `Y.transpose(1, 2, 0)` is contiguous.
    """
    chosen = _by_link(chain, columns)
    samples = len(q)
    # zeros, not empty: a joint does not feel the links before it, and pages never written cost no time
    y = np.zeros((chain.n_joints, sum(map(len, chosen)), samples))
    for start in range(0, samples, _CACHED):
        part = slice(start, min(start + _CACHED, samples))
        _fill(y[:, :, part], chain, rows(q[part]), rows(dq[part]), rows(ddq[part]), chosen)
    return y.transpose(2, 0, 1)


def regressor_blocks(chain: SerialChain, q: Array, dq: Array, ddq: Array, columns: Sequence[int] | None = None,
                     block: int = BLOCK) -> Iterator[tuple[slice, Array]]:
    """The regressor in blocks of samples: (which samples, Y (joints, columns, block)), memory constant in their number.

    The array is written anew for every block: what is to be kept must be copied.
    """
    chosen = _by_link(chain, columns)
    buffer = np.zeros((chain.n_joints, sum(map(len, chosen)), min(block, max(len(q), 1))))
    for first in range(0, len(q), block):
        whole = slice(first, min(first + block, len(q)))
        y = buffer[:, :, :whole.stop - whole.start]
        for start in range(whole.start, whole.stop, _CACHED):
            part = slice(start, min(start + _CACHED, whole.stop))
            _fill(y[:, :, start - first:part.stop - first], chain, rows(q[part]), rows(dq[part]), rows(ddq[part]), chosen)
        yield whole, y


def _by_link(chain: SerialChain, columns: Sequence[int] | None) -> list[list[int]]:
    """The chosen columns of each link, 0 … 9."""
    every = range(10 * chain.n_joints)
    wanted = list(every) if columns is None else list(columns)
    if any(b <= a for a, b in zip(wanted, wanted[1:], strict=False)) or any(k not in every for k in wanted):
        raise ValueError(f"columns must be increasing and within 0 … {every.stop - 1}")
    return [[k - 10 * i for k in wanted if 10 * i <= k < 10 * (i + 1)] for i in range(chain.n_joints)]


def _fill(y: Array, chain: SerialChain, q: Array, dq: Array, ddq: Array, chosen: list[list[int]]) -> None:
    """Write Y (joints, columns, samples) of one block. Joint j's torque through link i is its twist on link i's wrench:

        τ_j = w_j · n_i + v_j · f_i,    with f_i, n_i linear in the ten parameters of link i

    which is the element-wise form of Atkeson, An & Hollerbach 1986, eq. (12)-(15).
    """
    at = 0
    for i, (link, wanted) in enumerate(zip(link_motions(chain, turns(chain, q), dq, ddq, chain.gravity), chosen,
                                           strict=True)):
        heads, tails = [k for k in wanted if k < 4], [k - 4 for k in wanted if k >= 4]
        split, end = at + len(heads), at + len(wanted)
        spin = _spin(link)
        if heads:
            _contract(link.twists, _pick(_moment_wrench(link, spin), heads), y[:i + 1, at:split])
        if tails:
            _contract(link.twists[:3], _pick(_inertia_moment(link, spin), tails), y[:i + 1, split:end])
        at = end


def _pick(wrench: Array, which: list[int]) -> Array:
    return wrench if len(which) == wrench.shape[1] else wrench[:, which]


def _contract(twists: Array, wrench: Array, out: Array) -> None:
    np.einsum("rjs,rcs->jcs", twists, wrench, out=out)


def _spin(link: LinkMotion) -> Array:
    """S (3, 3, samples) = [α]× + [ω]×²: a point x of the link accelerates by a + S x."""
    spin = link.omega[:, None] * link.omega[None]  # [ω]×² = ω ωᵀ - |ω|² 1
    xx, yy, zz = spin[0, 0].copy(), spin[1, 1].copy(), spin[2, 2]
    np.add(yy, zz, out=spin[0, 0])
    np.add(xx, zz, out=spin[1, 1])
    np.add(xx, yy, out=spin[2, 2])
    for k, (a, b) in enumerate(((1, 2), (2, 0), (0, 1))):
        np.negative(spin[k, k], out=spin[k, k])
        spin[a, b] -= link.alpha[k]
        spin[b, a] += link.alpha[k]
    return spin


def _moment_wrench(link: LinkMotion, spin: Array) -> Array:
    """Moment (rows 0-2) and force (rows 3-5) of m, mx, my, mz: f = m a + S h,  n = h × a, with h = (mx, my, mz)."""
    wrench = np.zeros((6, 4, spin.shape[2]))
    a = link.acceleration
    wrench[3:, 0] = a
    wrench[3:, 1:] = spin
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        wrench[j, 1 + i] = -a[k]  # (h × a)_j = … - h_i a_k, (h × a)_k = h_i a_j - …
        wrench[i, 1 + j] = a[k]
    return wrench


def _inertia_moment(link: LinkMotion, spin: Array) -> Array:
    """Moment (3, 6, samples) of Ixx, Iyy, Izz, Ixy, Ixz, Iyz: n = I α + ω × I ω, off-diagonals of I negative."""
    s, alpha = spin, link.alpha
    moment = np.empty((3, 6, spin.shape[2]))
    half = 0.5
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        product = half * (s[i, j] + s[j, i])  # ω_i ω_j
        moment[k, k] = alpha[k]
        np.negative(product, out=moment[k, i])
        moment[k, j] = product
    np.copyto(moment[:, 3], np.stack([s[2, 0], -s[2, 1], s[1, 1] - s[0, 0]]))
    np.copyto(moment[:, 4], np.stack([-s[1, 0], s[0, 0] - s[2, 2], s[1, 2]]))
    np.copyto(moment[:, 5], np.stack([s[2, 2] - s[1, 1], s[0, 1], -s[0, 2]]))
    return moment


def inverse_dynamics(chain: SerialChain, q: Array, dq: Array, ddq: Array, phi: Array,
                     gravity: Array | None = None) -> Array:
    """τ (samples, joints) [N m] of standard parameters `phi` (joints * 10,), by the recursive Newton-Euler algorithm.

    Luh, Walker & Paul 1980. `gravity` stands in for the chain's own, so that it can be left out.
    """
    g = chain.gravity if gravity is None else gravity
    tau = np.empty(np.shape(q))
    for start in range(0, len(q), _CACHED):
        part = slice(start, start + _CACHED)
        moves = turns(chain, rows(q[part]))
        wrenches = [_wrench(link, values) for link, values in
                    zip(link_motions(chain, moves, rows(dq[part]), rows(ddq[part]), g, with_twists=False),
                        np.reshape(phi, (-1, 10)), strict=True)]
        tau[part] = _inward(chain, moves, wrenches).T
    return tau


def _wrench(link: LinkMotion, values: Array) -> Array:
    """Moment and force (6, samples) on one link: n = I α + ω × I ω + h × a,  f = m a + α × h + ω × (ω × h)."""
    mass, h = values[0], values[1:4]
    ixx, iyy, izz, ixy, ixz, iyz = values[4:]
    inertia = np.array([[ixx, -ixy, -ixz], [-ixy, iyy, -iyz], [-ixz, -iyz, izz]])
    cross_h = np.array([[0.0, -h[2], h[1]], [h[2], 0.0, -h[0]], [-h[1], h[0], 0.0]])  # h × a = cross_h a
    omega, alpha, a = link.omega, link.alpha, link.acceleration
    wrench = np.empty((6, omega.shape[1]))
    wrench[:3] = inertia @ alpha + cross_h @ a + _cross(omega, inertia @ omega)
    wrench[3:] = mass * a - cross_h @ alpha - _cross(omega, cross_h @ omega)
    return wrench


def _cross(a: Array, b: Array) -> Array:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _inward(chain: SerialChain, moves: list[Turn], wrenches: list[Array]) -> Array:
    """Collect the wrenches from the tip inwards; each joint's torque (joints, samples) is its own axis's share.

    A wrench goes inwards by the transpose of what carries a twist outwards, so that power is the same on both sides.
    """
    tau = np.empty((chain.n_joints, wrenches[0].shape[1]))
    total = np.zeros_like(wrenches[0])
    for i in reversed(range(chain.n_joints)):
        total = chain.after[i].twist_matrix().T @ (total + wrenches[i])
        tau[i] = total[2 if moves[i].revolute else 5]
        _move_inward(moves[i], total)
        total = chain.before[i].twist_matrix().T @ total
    return tau


def _move_inward(move: Turn, wrench: Array) -> None:
    if move.revolute:
        Turn(True, move.cosine, -move.sine, move.shift).rotate(wrench)
    else:  # moment + z s × force
        wrench[0] -= move.shift * wrench[4]
        wrench[1] += move.shift * wrench[3]


def mass_matrix(chain: SerialChain, q: Array, phi: Array) -> Array:
    """D(q) (samples, joints, joints): the sum over links of Uᵀ M U, with U the twists of the joints before it.

    Siciliano et al. 2009, eq. (7.32), in the link's own frame.
    """
    n = chain.n_joints
    d = np.zeros((n, n, len(q)))
    for start in range(0, len(q), _CACHED):
        part = slice(start, start + _CACHED)
        still = np.zeros_like(rows(q[part]))
        for i, (link, values) in enumerate(zip(link_motions(chain, turns(chain, rows(q[part])), still, still,
                                                            np.zeros(3)), np.reshape(phi, (-1, 10)), strict=True)):
            u = link.twists
            momentum = (_spatial_inertia(values) @ u.reshape(6, -1)).reshape(u.shape)
            d[:i + 1, :i + 1, part] += np.einsum("rjs,rks->jks", u, momentum)
    return d.transpose(2, 0, 1)


def _spatial_inertia(values: Array) -> Array:
    """M (6, 6): momentum about the origin of a twist [w; v]: I w + h × v, m v + w × h. Featherstone 2008, eq. (2.62)."""
    mass, (hx, hy, hz) = values[0], values[1:4]
    ixx, iyy, izz, ixy, ixz, iyz = values[4:]
    cross_h = np.array([[0.0, -hz, hy], [hz, 0.0, -hx], [-hy, hx, 0.0]])
    inertia = np.array([[ixx, -ixy, -ixz], [-ixy, iyy, -iyz], [-ixz, -iyz, izz]])
    return np.block([[inertia, cross_h], [cross_h.T, mass * np.eye(3)]])
