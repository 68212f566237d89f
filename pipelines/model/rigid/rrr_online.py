"""The torque of the RRR arm for one sample, in plain numbers: what a controller computes between two samples.

The same equations as in `rrr.py`, Kostić et al. 2004, eq. (A5) as corrected by erratum E1, on floats instead of arrays. NumPy
costs about a microsecond a call whatever the size; one sample is some eighty multiplications, which cost less than ten such calls.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, sin

from pipelines.model.rigid.body import Array
from pipelines.model.rigid.rrr import RRR

__all__ = ["RRROnline"]

Numbers = list[float]


class RRROnline:
    """An RRR arm with its base parameters, one sample at a time."""

    def __init__(self, body: RRR, p: Array) -> None:
        _, two, three = body.robot.joints
        self._offset = (two.offset, three.offset)  # [rad] the waist's own angle changes no torque
        self._a2 = two.a
        self._g = -body.robot.gravity[2]
        self._p = tuple(float(value) for value in p)

    def parts(self, q: Sequence[float], dq: Sequence[float], ddq: Sequence[float]) -> tuple[Numbers, Numbers, Numbers]:
        """Inertial, Coriolis and gravity torque, each (3,) [N m].

            D11 = p1 c2^2 + p2 s2 c2 + 2 a2 c2 (p3 cS - p4 sS) + p5 cS^2 - p6 sS cS + p7;  D33 = p13
            D13 = p8 cS + p9 sS;  D12 = D13 + p10 c2 + p11 s2
            D22 = p12 + 2 a2 (p3 c3 - p4 s3);  D23 = p13 + a2 (p3 c3 - p4 s3)
            h3 = g (p3 cS - p4 sS);  h2 = h3 + g (p14 c2 - p15 s2);  h1 = 0
        """
        p1, p2, p3, p4, p5, p6, p7, p8, p9, p10, p11, p12, p13, p14, p15 = self._p
        v1, v2, v3 = dq
        u1, u2, u3 = ddq
        a2, g = self._a2, self._g
        q2, q3 = q[1] + self._offset[0], q[2] + self._offset[1]
        c2, s2, c3, s3 = cos(q2), sin(q2), cos(q3), sin(q3)
        cS, sS = c2 * c3 - s2 * s3, s2 * c3 + c2 * s3
        along, across = p3 * cS - p4 * sS, p3 * sS + p4 * cS
        D13 = p8 * cS + p9 * sS
        D12 = D13 + p10 * c2 + p11 * s2
        bent = a2 * (p3 * c3 - p4 * s3)
        D23 = p13 + bent
        D11 = (p1 * c2 + p2 * s2 + 2.0 * a2 * along) * c2 + (p5 * cS - p6 * sS) * cS + p7

        v, half, v22 = v2 + v3, 0.5 * v1 * v1, v2 * v2
        upper = 2.0 * p1 * s2 * c2 - p2 * (c2 * c2 - s2 * s2)
        fore = 2.0 * p5 * sS * cS + p6 * (cS * cS - sS * sS)
        both = a2 * (p3 * (s2 * cS + c2 * sS) + p4 * (c2 * cS - s2 * sS))
        turned = a2 * (p3 * s3 + p4 * c3)
        h3 = g * along
        return ([D11 * u1 + D12 * u2 + D13 * u3, D12 * u1 + (D23 + p12 - p13 + bent) * u2 + D23 * u3,
                 D13 * u1 + D23 * u2 + p13 * u3],
                [v * v * (p9 * cS - p8 * sS) + v22 * (p11 * c2 - p10 * s2)
                 - v1 * (v2 * (upper + 2.0 * both) + v * fore + 2.0 * v3 * a2 * c2 * across),
                 half * (upper + fore + 2.0 * both) - (v3 + 2.0 * v2) * v3 * turned,
                 half * (fore + both + turned) + v22 * turned],
                [0.0, h3 + g * (p14 * c2 - p15 * s2), h3])

    def inertia_times(self, q: Sequence[float], r: Sequence[float]) -> Numbers:
        """D(q) r (3,) [N m] for r [rad/s^2]."""
        return self.parts(q, [0.0, 0.0, 0.0], r)[0]
