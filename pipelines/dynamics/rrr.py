"""The dynamics of the RRR arm in closed form, linear in 15 base parameters.

Kostić et al. 2004, eq. (8), (A4) and (A5), with erratum E1: the last trigonometric function of r34
is a cosine. Conventions: `verified.md`, section 0. S = q2 + q3; c, s a cosine and sine.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from pipelines.dynamics import rrr_kinematics
from pipelines.dynamics.base_parameters import BaseArm
from pipelines.dynamics.body import (
    BaseParameter,
    RigidBody,
    refuse_other_length,
    refuse_other_shapes,
)
from pipelines.dynamics.chain import STANDARD
from pipelines.io.log import Array
from pipelines.io.robot import RobotDescription

__all__ = ["ACTING", "RRR", "combined", "fits", "rigid_body"]

_TINY = 1e-12  # numerics: rounding

# The columns that act on each joint. Row three has four columns of row two: the one's end is the
# other's beginning.
_SHARED = [4, 5, 7, 8]  # numerics: columns that rows two and three share
ACTING = (tuple(range(11)), (0, 1, 2, 3, 9, 10, 11, 12, 13, 14, *_SHARED), (*_SHARED, 2, 3, 12))

_Rows = Array | dict[int, Array]

_MOMENTS = ("p3", "p4", "p14", "p15")  # in kg m, the others in kg m^2
_COMBINATIONS = (
    "a2^2 m3 + a2 m2 (a2 + 2 x2) - Ixx2 + Iyy2",
    "-2 (a2 m2 y2 + Ixy2)",
    "m3 (a3 + x3)",
    "m3 y3",
    "a3 m3 (a3 + 2 x3) - Ixx3 + Iyy3",
    "2 (a3 m3 y3 + Ixy3)",
    "2 d2 m2 z2 + d2^2 m2 + 2 (d2 + d3) m3 z3 + (d2 + d3)^2 m3 + Iyy1 + Ixx2 + Ixx3",
    "-(d2 + d3) m3 y3 - Iyz3",
    "-a3 m3 (z3 + d2 + d3) - (d2 + d3) m3 x3 - Ixz3",
    "-d2 m2 y2 - Iyz2",
    "-a2 (m3 (z3 + d2 + d3) + m2 (d2 + z2)) - d2 m2 x2 - Ixz2",
    "(a2^2 + a3^2 + 2 a3 x3) m3 + a2 m2 (a2 + 2 x2) + Izz2 + Izz3",
    "a3 m3 (a3 + 2 x3) + Izz3",
    "m2 (x2 + a2) + m3 a2",
    "m2 y2",
)


def fits(robot: RobotDescription) -> bool:
    """Return whether (A1)-(A5) hold: DH, alpha = (pi/2, 0, 0), a1 = 0, gravity along -z, no
    tool."""
    if robot.convention != "dh" or robot.revolute != (True, True, True):
        return False
    one, two, three = robot.joints
    zeros = (one.alpha - math.pi / 2, two.alpha, three.alpha, one.a, *robot.gravity[:2],
             *robot.tool)
    return all(abs(value) <= _TINY
               for value in zeros) and min(two.a, three.a, -robot.gravity[2]) > _TINY


class RRR(RigidBody):
    """The RRR arm: τ = R(q, dq, ddq) p with the 15 elements of (A4)."""

    def __init__(self, robot: RobotDescription) -> None:
        if not fits(robot):
            raise ValueError(f"'{robot.name}' is not an RRR arm as in Kostić et al. 2004")
        self.robot = robot
        names = [f"p{k}" for k in range(1, 16)]
        self.parameters = tuple(
            BaseParameter(name, "kg m" if name in _MOMENTS else "kg m^2", combination)
            for name, combination in zip(names, _COMBINATIONS, strict=True))
        self.geometry = rrr_kinematics.rrr_geometry(robot)
        self._a2 = robot.joints[1].a
        self._g = -robot.gravity[2]
        self._offset = np.array(self.geometry.offset)

    @cached_property
    def combine(self) -> Array:
        """(15, 30): p of standard parameters."""
        return combined(self.robot)

    @cached_property
    def links_behind(self) -> Array:
        """(30, 15): standard parameters with the torques of p, else zero."""
        base = BaseArm(self.robot).base
        links = np.zeros((30, 15))
        links[list(base.chosen)] = np.linalg.inv(self.combine[:, list(base.chosen)])
        return links

    def tip(self, q: Array) -> Array:
        """Return the tip (samples, 3) [m]."""
        refuse_other_shapes(3, q=q)
        return rrr_kinematics.tip(self.geometry, q)

    def regressor(self, q: Array, dq: Array, ddq: Array) -> Array:
        """R (samples, 3, 15), stored with samples fastest.

        Kostić et al. 2004, eq. (A5), with r34 as in erratum E1.
        """
        refuse_other_shapes(3, q=q, dq=dq, ddq=ddq)
        shape = np.shape(q)[:-1]
        R = np.zeros((3, 15, *shape))
        angles, v, u = (np.moveaxis(np.asarray(x, dtype=np.float64), -1, 0) for x in (q, dq, ddq))
        trigonometry = self._trigonometry(angles[1], angles[2])
        doubled = _doubled(trigonometry)
        self._fill_waist_row(R[0], trigonometry, doubled, v, u)
        self._fill_other_rows(R[1], R[2], trigonometry, doubled, v, u)
        R[2, _SHARED] = R[1, _SHARED]
        return np.moveaxis(R, (0, 1), (-2, -1))

    def acting_rows(self, q: Array, dq: Array, ddq: Array,
                    out: Array) -> tuple[Array, Array, Array]:
        """Return what is not always zero in R, of each joint (columns, samples), as `ACTING` tells.

        Written to `out` (28, samples), in which the columns that rows two and three share stand
        once. For q, dq, ddq (samples, 3).
        """
        angles, v, u = (np.ascontiguousarray(np.transpose(x), dtype=np.float64)
                        for x in (q, dq, ddq))
        trigonometry = self._trigonometry(angles[1], angles[2])
        waist, two, three = out[:11], out[11:25], out[21:28]
        doubled = _doubled(trigonometry)
        self._fill_waist_row(waist, trigonometry, doubled, v, u)
        self._fill_other_rows(dict(zip(ACTING[1], two, strict=True)),
                              dict(zip(ACTING[2], three, strict=True)), trigonometry, doubled, v, u)
        return waist, two, three

    def _fill_waist_row(self, one: _Rows, trigonometry: tuple[Array, ...],
                        doubled: tuple[Array, ...], dq: Array, ddq: Array) -> None:
        c2, s2, _, _, cS, sS = trigonometry
        sin22, cos22, sin2S, cos2S, sin223, cos223 = doubled
        v1, v2, v3 = dq
        u1, u2, u3 = ddq
        a2, v, u = self._a2, v2 + v3, u2 + u3
        v12, v13, v1v, v22, vv, half = v1 * v2, v1 * v3, v1 * v, v2 * v2, v * v, 0.5 * u1
        one[0][...] = u1 * (c2 * c2) - v12 * sin22
        one[1][...] = half * sin22 + v12 * cos22
        one[2][...] = (2 * a2) * ((u1 * cS - v13 * sS) * c2 - v12 * sin223)
        one[3][...] = (-2 * a2) * ((u1 * sS + v13 * cS) * c2 + v12 * cos223)
        one[4][...] = u1 * (cS * cS) - v1v * sin2S
        one[5][...] = -half * sin2S - v1v * cos2S
        one[6][...] = u1
        one[7][...] = u * cS - vv * sS
        one[8][...] = u * sS + vv * cS
        one[9][...] = u2 * c2 - v22 * s2
        one[10][...] = v22 * c2 + u2 * s2

    def _fill_other_rows(self, two: _Rows, three: _Rows, trigonometry: tuple[Array, ...],
                         doubled: tuple[Array, ...], dq: Array, ddq: Array) -> None:
        """Row two, and of row three what differs from it: see `_SHARED`."""
        c2, s2, c3, s3, cS, sS = trigonometry
        sin22, cos22, sin2S, cos2S, sin223, cos223 = doubled
        v1, v2, v3 = dq
        u1, u2, u3 = ddq
        a2, g, half = self._a2, self._g, 0.5 * v1 * v1
        turning, slanted, fore = 0.5 * v3 * v3 + v2 * v3, u2 + 0.5 * u3, half + v2 * v2
        up3, up4, bent3, bent4 = g * cS, g * sS, half * sin223, half * cos223
        np.multiply(half, sin22, out=two[0])
        np.multiply(half, -cos22, out=two[1])
        two[2][...] = (2 * a2) * (slanted * c3 - turning * s3 + bent3) + up3
        two[3][...] = (2 * a2) * (bent4 - slanted * s3 - turning * c3) - up4
        np.multiply(half, sin2S, out=two[4])
        np.multiply(half, cos2S, out=two[5])
        np.multiply(u1, cS, out=two[7])
        np.multiply(u1, sS, out=two[8])
        np.multiply(u1, c2, out=two[9])
        np.multiply(u1, s2, out=two[10])
        two[11][...] = u2
        two[12][...] = u3
        np.multiply(g, c2, out=two[13])
        np.multiply(-g, s2, out=two[14])

        three[2][...] = a2 * (fore * s3 + c3 * u2 + bent3) + up3
        three[3][...] = a2 * (fore * c3 - s3 * u2 + bent4) - up4
        np.add(u2, u3, out=three[12])

    def torque(self, q: Array, dq: Array, ddq: Array, p: Array) -> Array:
        """τ = R p (samples, 3) [N m]."""
        refuse_other_length(15, p)
        return np.asarray(self.regressor(q, dq, ddq) @ p)

    def _trigonometry(self, q2: Array, q3: Array) -> tuple[Array, ...]:
        """cos and sin of q2, q3 and S; those of S by the addition theorem."""
        q2, q3 = q2 + self._offset[1], q3 + self._offset[2]
        c2, s2, c3, s3 = np.cos(q2), np.sin(q2), np.cos(q3), np.sin(q3)
        return c2, s2, c3, s3, c2 * c3 - s2 * s3, s2 * c3 + c2 * s3


def _doubled(trigonometry: tuple[Array, ...]) -> tuple[Array, ...]:
    """sin and cos of 2 q2, of 2 S and of 2 q2 + q3."""
    c2, s2, _, _, cS, sS = trigonometry
    return (2 * s2 * c2, c2**2 - s2**2, 2 * sS * cS, cS**2 - sS**2, s2 * cS + c2 * sS,
            c2 * cS - s2 * sS)


def combined(robot: RobotDescription) -> Array:
    """L (15, 30) with p = L φ, φ the standard parameters. Kostić et al. 2004, eq. (A4)."""
    (_, a2, a3), (_, d2, d3) = ([getattr(joint, key) for joint in robot.joints]
                                for key in ("a", "d"))
    d = d2 + d3
    rows: tuple[dict[str, float], ...] = (
        {"m3": a2**2, "m2": a2**2, "mx2": 2 * a2, "Ixx2": -1.0, "Iyy2": 1.0},
        {"my2": -2 * a2, "Ixy2": -2.0},
        {"m3": a3, "mx3": 1.0},
        {"my3": 1.0},
        {"m3": a3**2, "mx3": 2 * a3, "Ixx3": -1.0, "Iyy3": 1.0},
        {"my3": 2 * a3, "Ixy3": 2.0},
        {"mz2": 2 * d2, "m2": d2**2, "mz3": 2 * d, "m3": d**2}
        | dict.fromkeys(("Iyy1", "Ixx2", "Ixx3"), 1.0),
        {"my3": -d, "Iyz3": -1.0},
        {"mz3": -a3, "m3": -a3 * d, "mx3": -d, "Ixz3": -1.0},
        {"my2": -d2, "Iyz2": -1.0},
        {"mz3": -a2, "m3": -a2 * d, "mz2": -a2, "m2": -a2 * d2, "mx2": -d2, "Ixz2": -1.0},
        {"m3": a2**2 + a3**2, "mx3": 2 * a3, "m2": a2**2, "mx2": 2 * a2, "Izz2": 1.0, "Izz3": 1.0},
        {"m3": a3**2, "mx3": 2 * a3, "Izz3": 1.0},
        {"mx2": 1.0, "m2": a2, "m3": a2},
        {"my2": 1.0},
    )
    combine = np.zeros((15, 30))
    for row, entries in zip(combine, rows, strict=True):
        for name, value in entries.items():
            row[10 * (int(name[-1]) - 1) + STANDARD.index(name[:-1])] = value
    return combine


def rigid_body(robot: RobotDescription) -> RigidBody:
    """Return the closed form where `robot` has its geometry, the general recursion otherwise."""
    return RRR(robot) if fits(robot) else BaseArm(robot)
