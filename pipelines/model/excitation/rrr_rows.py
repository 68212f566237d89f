"""The RRR arm's regressor and its adjoint, in closed form.

A criterion L depends on the motion through the regressor, eq. (A5). Its derivative by every entry, R̄, becomes the derivative
by the motion by one pass over the formulas of (A5), each differentiated by hand:

    q̄ = Σ R̄ ∂R/∂q,   dq̄ = Σ R̄ ∂R/∂dq,   ddq̄ = Σ R̄ ∂R/∂ddq

The letters are those of `pipelines.model.rigid.rrr`; a bar is the derivative of L by what it stands over.
"""

from __future__ import annotations

import numpy as np

from pipelines.model.rigid.body import Array
from pipelines.model.rigid.rrr import ACTING, RRR

__all__ = ["RRRRows"]


class RRRRows:
    """Rows of τ = R p, joint by joint, without the columns that are always zero."""

    def __init__(self, body: RRR) -> None:
        self.columns = tuple(np.array(acting, dtype=np.intp) for acting in ACTING)
        self._body = body
        self._a2, self._g = body.robot.joints[1].a, -body.robot.gravity[2]
        self._memory = np.empty((28, 0))

    def rows(self, motion: Array) -> tuple[Array, ...]:
        """Each (columns of the joint, samples) for motion (3, joints, samples); overwritten by the next call."""
        if self._memory.shape[1] != motion.shape[2]:
            self._memory = np.empty((28, motion.shape[2]))
        return self._body.acting_rows(motion[0].T, motion[1].T, motion[2].T, self._memory)

    def adjoint(self, motion: Array, bars: tuple[Array, ...]) -> Array:
        """Derivatives by the motion (3, joints, samples) from those by each row."""
        _, q2, q3 = motion[0]
        q2, q3 = q2 + self._body.geometry.offset[1], q3 + self._body.geometry.offset[2]
        c2, s2, c3, s3 = np.cos(q2), np.sin(q2), np.cos(q3), np.sin(q3)
        angles = (c2, s2, c3, s3, c2 * c3 - s2 * s3, s2 * c3 + c2 * s3)
        out = np.zeros_like(motion)
        self._waist(bars[0], angles, motion, out)
        self._others(bars[1], bars[2], angles, motion, out)
        return out

    def _waist(self, w: Array, angles: tuple[Array, ...], motion: Array, out: Array) -> None:
        c2, s2, _, _, cS, sS = angles
        (v1, v2, v3), (u1, u2, u3) = motion[1], motion[2]
        v, u, twice = v2 + v3, u2 + u3, 2.0 * self._a2
        sin22, cos22, sin2S, cos2S = 2 * s2 * c2, c2 * c2 - s2 * s2, 2 * sS * cS, cS * cS - sS * sS
        sin223, cos223 = s2 * cS + c2 * sS, c2 * cS - s2 * sS
        v12, v13, v1v, v22, vv = v1 * v2, v1 * v3, v1 * v, v2 * v2, v * v
        w2, w3 = twice * w[2], twice * w[3]
        up, down = w2 * cS - w3 * sS, w2 * sS + w3 * cS  # what multiplies u1 c2 and -v1 v3 c2
        across = w2 * sin223 + w3 * cos223
        k12 = w[1] * cos22 - w[0] * sin22 - across
        k13 = -c2 * down
        k1v = -w[4] * sin2S - w[5] * cos2S
        by_u, by_vv = w[7] * cS + w[8] * sS, w[8] * cS - w[7] * sS
        by_u2, by_v22 = w[9] * c2 + w[10] * s2, w[10] * c2 - w[9] * s2
        mixed = v12 * (w3 * sin223 - w2 * cos223)  # of 2 q2 + q3
        lean = u1 * up - v13 * down
        by_q2 = u1 * (w[1] * cos22 - w[0] * sin22) - 2 * v12 * (w[0] * cos22 + w[1] * sin22) - s2 * lean + mixed \
            + u2 * (w[10] * c2 - w[9] * s2) - v22 * (w[9] * c2 + w[10] * s2)
        by_S = -c2 * (u1 * down + v13 * up) + mixed - u1 * (w[4] * sin2S + w[5] * cos2S) \
            + 2 * v1v * (w[5] * sin2S - w[4] * cos2S) + u * by_vv - vv * by_u
        out[0, 1] += by_q2 + by_S
        out[0, 2] += by_S
        out[1, 0] += k12 * v2 + k13 * v3 + k1v * v
        turn = k1v * v1 + 2 * v * by_vv
        out[1, 1] += k12 * v1 + turn + 2 * v2 * by_v22
        out[1, 2] += k13 * v1 + turn
        out[2, 0] += w[0] * (c2 * c2) + 0.5 * w[1] * sin22 + c2 * up + w[4] * (cS * cS) - 0.5 * w[5] * sin2S + w[6]
        out[2, 1] += by_u + by_u2
        out[2, 2] += by_u

    def _others(self, two: Array, three: Array, angles: tuple[Array, ...], motion: Array, out: Array) -> None:
        """Rows two and three; the columns 5, 6, 8 and 9 that they share count once, with both bars."""
        c2, s2, c3, s3, cS, sS = angles
        (v1, v2, v3), (u1, u2, u3) = motion[1], motion[2]
        a2, g, twice = self._a2, self._g, 2.0 * self._a2
        sin22, cos22, sin2S, cos2S = 2 * s2 * c2, c2 * c2 - s2 * s2, 2 * sS * cS, cS * cS - sS * sS
        sin223, cos223 = s2 * cS + c2 * sS, c2 * cS - s2 * sS
        half, turning, slanted = 0.5 * v1 * v1, 0.5 * v3 * v3 + v2 * v3, u2 + 0.5 * u3
        fore = half + v2 * v2
        t0, t1, t9, t10, t11, t12, t13, t14 = (two[k] for k in (0, 1, 4, 5, 6, 7, 8, 9))
        t4, t5, t7, t8 = (two[10 + k] + three[k] for k in range(4))
        t2, t3, r2, r3, r12 = twice * two[2], twice * two[3], a2 * three[4], a2 * three[5], three[6]
        x2, x3 = t2 + r2, t3 + r3
        by_fore, by_bent = r2 * s3 + r3 * c3, r2 * c3 - r3 * s3
        by_turning, by_slanted = -t2 * s3 - t3 * c3, t2 * c3 - t3 * s3
        by_half = t0 * sin22 - t1 * cos22 + x2 * sin223 + x3 * cos223 + t4 * sin2S + t5 * cos2S + by_fore
        mixed = half * (x2 * cos223 - x3 * sin223)
        by_q3 = slanted * by_turning - turning * by_slanted + fore * by_bent - u2 * by_fore
        by_q2 = 2 * half * (t0 * cos22 + t1 * sin22) + mixed + u1 * (t10 * c2 - t9 * s2) - g * (t13 * s2 + t14 * c2)
        by_S = mixed + 2 * half * (t4 * cos2S - t5 * sin2S) + u1 * (t8 * cS - t7 * sS) \
            - g * ((two[2] + three[4]) * sS + (two[3] + three[5]) * cS)
        out[0, 1] += by_q2 + by_S
        out[0, 2] += by_S + by_q3
        out[1, 0] += v1 * by_half
        out[1, 1] += by_turning * v3 + 2 * v2 * by_fore
        out[1, 2] += by_turning * (v2 + v3)
        out[2, 0] += t7 * cS + t8 * sS + t9 * c2 + t10 * s2
        out[2, 1] += by_slanted + by_bent + t11 + r12
        out[2, 2] += 0.5 * by_slanted + t12 + r12
