"""The torque of any serial arm for one sample, in plain numbers: what a controller computes between two samples.

The recursive Newton-Euler algorithm of `chain.py` (Luh, Walker & Paul 1980), on floats instead of arrays. What stands fixed
between two joints is put into one placement, and each link's parameters are moved into its joint's own frame, once and for all:
what is left for each sample and joint is one fixed rotation and one turn about z.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, sin

import numpy as np

from pipelines.model.rigid.body import Array
from pipelines.model.rigid.geometry import Placement, SerialChain

__all__ = ["ChainOnline"]

Numbers = list[float]
_Vector = tuple[float, float, float]


@dataclass(frozen=True)
class _Link:
    """One joint and the link it moves, in the joint's own frame (axis z)."""

    revolute: bool
    offset: float  # [rad] or [m]
    rotation: tuple[float, ...]  # (9,) row by row, of the joint at zero in the joint frame before it
    position: _Vector  # [m]
    mass: float  # [kg]
    moment: _Vector  # [kg m] first moments
    inertia: tuple[float, ...]  # (6,) [kg m^2] Ixx Iyy Izz of the tensor about the origin, and its elements xy xz yz


class ChainOnline:
    """A serial arm with its standard parameters, one sample at a time."""

    def __init__(self, chain: SerialChain, phi: Array) -> None:
        ends = (None, *chain.after)
        self._links = tuple(
            _link(chain, i, before if end is None else end @ before, values)
            for i, (before, end, values) in enumerate(zip(chain.before, ends[:-1], np.reshape(phi, (-1, 10)), strict=True)))
        gx, gy, gz = (float(g) for g in chain.gravity)
        self._up: _Vector = (-gx, -gy, -gz)
        self._rest = [0.0] * chain.n_joints

    def parts(self, q: Sequence[float], dq: Sequence[float], ddq: Sequence[float]) -> tuple[Numbers, Numbers, Numbers]:
        """Inertial, Coriolis and gravity torque, each (joints,) [N m]."""
        turned = self._turned(q)
        rest, weightless = self._rest, (0.0, 0.0, 0.0)
        return (self._torque(turned, rest, ddq, weightless), self._torque(turned, dq, rest, weightless),
                self._torque(turned, rest, rest, self._up))

    def inertia_times(self, q: Sequence[float], r: Sequence[float]) -> Numbers:
        """D(q) r (joints,) [N m] for r [rad/s^2]."""
        return self._torque(self._turned(q), self._rest, r, (0.0, 0.0, 0.0))

    def _turned(self, q: Sequence[float]) -> list[tuple[_Vector, _Vector, _Vector, _Vector]]:
        """For each joint the axes x, y, z of its moved frame and its origin, in the joint frame before it."""
        frames = []
        for link, angle in zip(self._links, q, strict=True):
            xx, yx, zx, xy, yy, zy, xz, yz, zz = link.rotation
            if link.revolute:
                c, s = cos(angle + link.offset), sin(angle + link.offset)
                frames.append(((xx * c + yx * s, xy * c + yy * s, xz * c + yz * s),
                               (yx * c - xx * s, yy * c - xy * s, yz * c - xz * s), (zx, zy, zz), link.position))
            else:
                shift, (px, py, pz) = angle + link.offset, link.position
                frames.append(((xx, xy, xz), (yx, yy, yz), (zx, zy, zz),
                               (px + zx * shift, py + zy * shift, pz + zz * shift)))
        return frames

    def _torque(self, frames: list[tuple[_Vector, _Vector, _Vector, _Vector]], dq: Sequence[float], ddq: Sequence[float],
                up: _Vector) -> Numbers:
        """One recursion outwards and one inwards; the base accelerates by `up` [m/s^2].

            ω_i = ω + z q̇,  α_i = α + z q̈ + ω × z q̇,  a_i = a + α × p + ω × (ω × p)      revolute
            a_i = a + α × p + ω × (ω × p) + z q̈ + 2 ω × z q̇                              prismatic
            f = m a + α × h + ω × (ω × h),   n = I α + ω × I ω + h × a
        """
        wx = wy = wz = ax = ay = az = 0.0  # angular velocity and acceleration
        lx, ly, lz = up  # linear acceleration of the frame's origin
        wrenches = []
        for link, (x, y, z, p), v, u in zip(self._links, frames, dq, ddq, strict=True):
            px, py, pz = p
            cx, cy, cz = wy * pz - wz * py, wz * px - wx * pz, wx * py - wy * px
            tx = lx + ay * pz - az * py + wy * cz - wz * cy
            ty = ly + az * px - ax * pz + wz * cx - wx * cz
            tz = lz + ax * py - ay * px + wx * cy - wy * cx
            wx, wy, wz = (wx * x[0] + wy * x[1] + wz * x[2], wx * y[0] + wy * y[1] + wz * y[2],
                          wx * z[0] + wy * z[1] + wz * z[2])
            ax, ay, az = (ax * x[0] + ay * x[1] + az * x[2], ax * y[0] + ay * y[1] + az * y[2],
                          ax * z[0] + ay * z[1] + az * z[2])
            lx, ly, lz = (tx * x[0] + ty * x[1] + tz * x[2], tx * y[0] + ty * y[1] + tz * y[2],
                          tx * z[0] + ty * z[1] + tz * z[2])
            if link.revolute:
                ax, ay, az, wz = ax + wy * v, ay - wx * v, az + u, wz + v
            else:
                lx, ly, lz = lx + 2.0 * wy * v, ly - 2.0 * wx * v, lz + u
            m, (hx, hy, hz), (ixx, iyy, izz, ixy, ixz, iyz) = link.mass, link.moment, link.inertia
            cx, cy, cz = wy * hz - wz * hy, wz * hx - wx * hz, wx * hy - wy * hx
            ox, oy, oz = (ixx * wx + ixy * wy + ixz * wz, ixy * wx + iyy * wy + iyz * wz, ixz * wx + iyz * wy + izz * wz)
            wrenches.append((m * lx + ay * hz - az * hy + wy * cz - wz * cy,
                             m * ly + az * hx - ax * hz + wz * cx - wx * cz,
                             m * lz + ax * hy - ay * hx + wx * cy - wy * cx,
                             ixx * ax + ixy * ay + ixz * az + wy * oz - wz * oy + hy * lz - hz * ly,
                             ixy * ax + iyy * ay + iyz * az + wz * ox - wx * oz + hz * lx - hx * lz,
                             ixz * ax + iyz * ay + izz * az + wx * oy - wy * ox + hx * ly - hy * lx))
        return self._inward(frames, wrenches)

    def _inward(self, frames: list[tuple[_Vector, _Vector, _Vector, _Vector]],
                wrenches: list[tuple[float, float, float, float, float, float]]) -> Numbers:
        """Collect forces and moments from the tip inwards; each joint carries its own axis's share."""
        tau = []
        fx = fy = fz = nx = ny = nz = 0.0
        for link, (x, y, z, p), (ownx, owny, ownz, turnx, turny, turnz) in zip(
                reversed(self._links), reversed(frames), reversed(wrenches), strict=True):
            fx, fy, fz, nx, ny, nz = fx + ownx, fy + owny, fz + ownz, nx + turnx, ny + turny, nz + turnz
            tau.append(nz if link.revolute else fz)
            fx, fy, fz = (fx * x[0] + fy * y[0] + fz * z[0], fx * x[1] + fy * y[1] + fz * z[1],
                          fx * x[2] + fy * y[2] + fz * z[2])
            nx, ny, nz = (nx * x[0] + ny * y[0] + nz * z[0] + p[1] * fz - p[2] * fy,
                          nx * x[1] + ny * y[1] + nz * z[1] + p[2] * fx - p[0] * fz,
                          nx * x[2] + ny * y[2] + nz * z[2] + p[0] * fy - p[1] * fx)
        tau.reverse()
        return tau


def _link(chain: SerialChain, i: int, place: Placement, values: Array) -> _Link:
    """Joint i at `place` in the joint frame before it; `values` its ten standard parameters in the link's own frame.

    M_joint = Xᵀ M X with X the twist matrix from the joint's frame to the link's (Featherstone 2008, ch. 2).
    """
    m, hx, hy, hz, xx, yy, zz, xy, xz, yz = values
    lever = np.array([[0.0, -hz, hy], [hz, 0.0, -hx], [-hy, hx, 0.0]])
    own = np.block([[np.array([[xx, -xy, -xz], [-xy, yy, -yz], [-xz, -yz, zz]]), lever], [lever.T, m * np.eye(3)]])
    moved = chain.after[i].twist_matrix.T @ own @ chain.after[i].twist_matrix
    inertia = tuple(float(moved[j, k]) for j, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    x, y, z = (float(value) for value in place.position)
    return _Link(chain.revolute[i], float(chain.offset[i]), tuple(float(value) for value in place.rotation.ravel()),
                 (x, y, z), float(m), (float(moved[2, 4]), float(moved[0, 5]), float(moved[1, 3])), inertia)
