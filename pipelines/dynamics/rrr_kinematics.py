"""Forward and inverse kinematics of the RRR arm in closed form.

    answer = inverse(rrr_geometry(robot), tips)         every branch of every tip, with its status

Kostić et al. 2004, eq. (A1)-(A3), corrected by errata E2-E5 of `verified.md`: atan2, all four
branches, and what to say where there is none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import refuse_other_shapes
from pipelines.io.log import Array
from pipelines.io.robot import RobotDescription

__all__ = ["BRANCHES", "Geometry", "InverseKinematics", "Reach", "inverse", "joint_rates",
           "rrr_geometry", "tip"]

# (shoulder, elbow) of each branch. Shoulder +1 faces the tip, elbow -1 is then up; over the back
# (-1) elbow +1 is up.
BRANCHES = ((1, -1), (1, 1), (-1, -1), (-1, 1))  # numerics: signs

# A tip this far outside the workspace is rounding: it counts as on its border.
_CLIP = 1e-13  # numerics: [m] of rounding
_MERGED = 1e-12  # numerics: [m] within this of the border two branches are one to rounding


@dataclass(frozen=True)
class Geometry:
    """The lengths in the kinematics; of d2 and d3 only their sum d counts."""

    d1: float  # [m]
    a2: float  # [m]
    a3: float  # [m]
    d: float  # [m]
    offset: tuple[float, float, float]  # [rad] q_model = q_log + offset


class Reach(IntEnum):
    """How a tip can be reached; from INSIDE_CYLINDER on it cannot."""

    REACHABLE = 0
    SHOULDER = 1
    ELBOW = 2
    SHOULDER_AND_ELBOW = 3
    INSIDE_CYLINDER = 4
    TOO_NEAR = 5
    TOO_FAR = 6
    NOT_A_NUMBER = 7

    @property
    def words(self) -> str:
        return _WORDS[self]


_WORDS = {
    Reach.REACHABLE: "reachable in four ways",
    Reach.SHOULDER: "singular: the tip touches the cylinder about the first axis, front and back "
                    "branch are one",
    Reach.ELBOW: "singular: the elbow is stretched or folded, elbow up and elbow down are "
                 "one",
    Reach.SHOULDER_AND_ELBOW: "singular at shoulder and elbow: all four branches are one up to "
                              "a turn of the elbow",
    Reach.INSIDE_CYLINDER: "unreachable: inside the cylinder of radius d2 + d3 about the first "
                           "axis",
    Reach.TOO_NEAR: "unreachable: nearer to the shoulder than the folded arm",
    Reach.TOO_FAR: "unreachable: farther from the shoulder than the stretched arm",
    Reach.NOT_A_NUMBER: "unreachable: a coordinate of the tip is not a number",
}


@dataclass(frozen=True, eq=False)
class InverseKinematics:
    """Every way to reach each tip."""

    # [rad] (branches, samples, 3) in the log's zero, within (-pi, pi]; NaN where unreachable
    q: Array
    status: npt.NDArray[np.int8]  # (samples,) values of Reach; all branches of a tip share it

    @property
    def reachable(self) -> npt.NDArray[np.bool_]:
        return np.asarray(self.status < Reach.INSIDE_CYLINDER)

    @property
    def singular(self) -> npt.NDArray[np.bool_]:
        return np.asarray(self.reachable & (self.status != Reach.REACHABLE))

    def words(self, sample: int) -> str:
        return Reach(int(self.status[sample])).words


def rrr_geometry(robot: RobotDescription) -> Geometry:
    """Take the lengths out of a description that `rrr.fits`."""
    one, two, three = robot.joints
    return Geometry(one.d, two.a, three.a, two.d + three.d, (one.offset, two.offset, three.offset))


def tip(geometry: Geometry, q: Array) -> Array:
    """Tip position (samples, 3) [m]. Kostić et al. 2004, eq. (A2).

        x = cos q1 (a3 cos(q2+q3) + a2 cos q2) + d sin q1
        y = sin q1 (a3 cos(q2+q3) + a2 cos q2) - d cos q1
        z = a3 sin(q2+q3) + a2 sin q2 + d1
    """
    q1, q2, q3 = np.moveaxis(q + np.asarray(geometry.offset), -1, 0)
    reach = geometry.a3 * np.cos(q2 + q3) + geometry.a2 * np.cos(q2)
    c1, s1 = np.cos(q1), np.sin(q1)
    z = geometry.a3 * np.sin(q2 + q3) + geometry.a2 * np.sin(q2) + geometry.d1
    return np.stack([c1 * reach + geometry.d * s1, s1 * reach - geometry.d * c1, z], axis=-1)


def inverse(geometry: Geometry, tips: Array) -> InverseKinematics:
    """Return all branches of the inverse kinematics.

    Kostić et al. 2004, eq. (A3), corrected by errata E2-E5.

        rho = sqrt(x^2 + y^2);  W = sh sqrt((rho - d)(rho + d));  V = z - d1
        q1 = atan2(d x + W y, W x - d y)
        c3 = (W^2 + V^2 - a2^2 - a3^2)/(2 a2 a3);  s3 = el sqrt((1 - c3)(1 + c3))
        q3 = atan2(s3, c3)
        q2 = atan2((a2 + a3 c3) V - a3 s3 W, (a2 + a3 c3) W + a3 s3 V)

    Args:
        tips: (samples, 3) [m] in the base frame.
    """
    refuse_other_shapes(3, tips=tips)
    a2, a3, d = geometry.a2, geometry.a3, geometry.d
    x, y, z = np.moveaxis(np.asarray(tips, dtype=np.float64), -1, 0)
    shoulder, elbow = (np.array(signs, dtype=np.float64)[:, None]
                       for signs in zip(*BRANCHES, strict=True))
    rho, V = np.hypot(x, y), z - geometry.d1
    status = _reach(geometry, rho, V)
    squared = np.maximum((rho - abs(d)) * (rho + abs(d)), 0.0)
    W = shoulder * np.sqrt(squared)
    c3 = np.clip((squared + V**2 - a2**2 - a3**2) / (2 * a2 * a3), -1.0, 1.0)
    s3 = elbow * np.sqrt((1 - c3) * (1 + c3))
    q1 = np.arctan2(d * x + W * y, W * x - d * y)
    q2 = np.arctan2((a2 + a3 * c3) * V - a3 * s3 * W, (a2 + a3 * c3) * W + a3 * s3 * V)
    q3 = np.arctan2(s3, c3 + np.zeros_like(s3))
    q = _wrapped(np.stack([q1, q2, q3], axis=-1) - np.asarray(geometry.offset))
    q[:, status >= Reach.INSIDE_CYLINDER] = np.nan
    return InverseKinematics(q, status)


def _reach(geometry: Geometry, rho: Array, V: Array) -> npt.NDArray[np.int8]:
    """Reachable iff rho >= |d| and |a3 - a2| <= sqrt(rho^2 - d^2 + V^2) <= a2 + a3 (E5)."""
    beyond = rho - abs(geometry.d)  # [m] beyond the cylinder
    r = np.sqrt(np.maximum(beyond, 0.0) * (rho + abs(geometry.d)) + V**2)
    folded, stretched = r - abs(geometry.a3 - geometry.a2), geometry.a2 + geometry.a3 - r
    status = (Reach.SHOULDER * (np.abs(beyond) <= _MERGED) + Reach.ELBOW *
              ((np.abs(folded) <= _MERGED) | (np.abs(stretched) <= _MERGED))).astype(np.int8)
    status[folded < -_CLIP] = Reach.TOO_NEAR
    status[~(stretched >= -_CLIP)] = Reach.TOO_FAR
    status[beyond < -_CLIP] = Reach.INSIDE_CYLINDER
    status[np.isnan(rho) | np.isnan(V)] = Reach.NOT_A_NUMBER
    return status


def _wrapped(q: Array) -> Array:
    """`q` within (-pi, pi], values already there untouched."""
    return np.asarray(q - 2 * math.pi * np.ceil((q - math.pi) / (2 * math.pi)))


def joint_rates(geometry: Geometry, q: Array, velocity: Array,
                acceleration: Array) -> tuple[Array, Array]:
    """Return dq [rad/s] and ddq [rad/s^2], each (samples, 3), of a moving tip.

    The tip at q has this velocity [m/s] and acceleration [m/s^2].

        ẋ·e_t = R q̇1                               ẋ·e_r = Ṙ + d q̇1
        ẍ·e_t = R q̈1 + 2 Ṙ q̇1 + d q̇1²              ẍ·e_r = R̈ + d q̈1 - R q̇1²
        -a2 s2 q̇2 - a3 sS Ṡ = Ṙ                    a2 c2 q̇2 + a3 cS Ṡ = ż

    The determinant of the last two is a2 a3 sin q3. Meaningless at singular postures (R = 0 or
    sin q3 = 0): look at `InverseKinematics.singular` first.
    """
    refuse_other_shapes(3, q=q, velocity=velocity, acceleration=acceleration)
    q1, q2, q3 = np.moveaxis(q + np.asarray(geometry.offset), -1, 0)
    a2, a3, d = geometry.a2, geometry.a3, geometry.d
    c1, s1, c2, s2, cS, sS, s3 = np.cos(q1), np.sin(q1), np.cos(q2), np.sin(q2), np.cos(
        q2 + q3), np.sin(q2 + q3), np.sin(q3)
    R = a2 * c2 + a3 * cS
    x, y, z = np.moveaxis(velocity, -1, 0)
    v1 = (c1 * y - s1 * x) / R
    outwards = c1 * x + s1 * y - d * v1
    v2, vS = (cS * outwards + sS * z) / (a2 * s3), -(c2 * outwards + s2 * z) / (a3 * s3)

    x, y, z = np.moveaxis(acceleration, -1, 0)
    u1 = (c1 * y - s1 * x - 2 * outwards * v1 - d * v1**2) / R
    # what is left for q̈2 and S̈ when the centripetal terms of the two links are taken off
    along = c1 * x + s1 * y - d * u1 + R * v1**2 + a2 * c2 * v2**2 + a3 * cS * vS**2
    up = z + a2 * s2 * v2**2 + a3 * sS * vS**2
    u2, uS = (cS * along + sS * up) / (a2 * s3), -(c2 * along + s2 * up) / (a3 * s3)
    return np.stack([v1, v2, vS - v2], axis=-1), np.stack([u1, u2, uS - u2], axis=-1)
