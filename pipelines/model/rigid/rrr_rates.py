"""Joint speeds and accelerations of the RRR arm that belong to a motion of its tip, in closed form.

The derivatives of Kostić et al. 2004, eq. (A2), with the first axis' turning frame taken apart from the other two joints' plane:

    tip = R e_r - d e_t + (d1 + a2 sin q2 + a3 sin S) e_z,      R = a2 cos q2 + a3 cos S,      S = q2 + q3
"""

from __future__ import annotations

import numpy as np

from pipelines.model.rigid.body import Array, refuse_other_shapes
from pipelines.model.rigid.rrr_kinematics import Geometry

__all__ = ["joint_rates"]


def joint_rates(geometry: Geometry, q: Array, velocity: Array, acceleration: Array) -> tuple[Array, Array]:
    """dq [rad/s] and ddq [rad/s^2], each (samples, 3), for velocity [m/s] and acceleration [m/s^2] of the tip at q.

        ẋ·e_t = R q̇1                               ẋ·e_r = Ṙ + d q̇1
        ẍ·e_t = R q̈1 + 2 Ṙ q̇1 + d q̇1²              ẍ·e_r = R̈ + d q̈1 - R q̇1²
        -a2 s2 q̇2 - a3 sS Ṡ = Ṙ                    a2 c2 q̇2 + a3 cS Ṡ = ż,      determinant a2 a3 sin q3

    Meaningless at singular postures (R = 0 or sin q3 = 0): look at `InverseKinematics.singular` first.
    """
    refuse_other_shapes(3, q=q, velocity=velocity, acceleration=acceleration)
    q1, q2, q3 = np.moveaxis(q + np.asarray(geometry.offset), -1, 0)
    a2, a3, d = geometry.a2, geometry.a3, geometry.d
    c1, s1, c2, s2, cS, sS, s3 = np.cos(q1), np.sin(q1), np.cos(q2), np.sin(q2), np.cos(q2 + q3), np.sin(q2 + q3), np.sin(q3)
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
