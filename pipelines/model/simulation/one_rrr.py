"""One RRR arm without arrays: for a single robot plain numbers are several times faster than arrays of three.

The same (A5) of Kostić et al. 2004 as `ManyRRR`, gathered by what needs the fewest products, and the same Runge-Kutta step.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, sin, tanh

from pipelines.model.rigid.body import Array
from pipelines.model.rigid.rrr import RRR
from pipelines.model.simulation.plant import Plant

__all__ = ["OneRRR"]

_Triple = tuple[float, float, float]
_Acceleration = Callable[[float, float, float, float, float, float, float, float], _Triple]
_Friction = Callable[[float], float]


class OneRRR:
    """The integrator of one arm that nothing but rigid body and friction moves; used as `RungeKutta` is."""

    def __init__(self, plant: Plant, sample_time: float, steps: int) -> None:
        """`plant` as `fits` it; `steps` of equal size make one control sample."""
        self._acceleration = _acceleration(plant)
        self._h, self._steps = sample_time / steps, steps

    @staticmethod
    def fits(plant: Plant) -> bool:
        return plant.plain and isinstance(plant.body, RRR) and plant.p.size == 15

    def advance(self, t: Array, state: Array, states: Array, command: Array) -> Array:
        """Move `state` (6, 1) on by one sample, in place; there are no memories, and nothing depends on time."""
        del t
        f, h = self._acceleration, self._h
        half, sixth = 0.5 * h, h / 6.0
        q1, q2, q3, v1, v2, v3 = state[:, 0].tolist()
        u1, u2, u3 = command[:, 0].tolist()
        for _ in range(self._steps):
            a1, a2, a3 = f(q2, q3, v1, v2, v3, u1, u2, u3)
            # position's slopes are the speeds of the stages: k2 = v + h/2 a, k3 = v + h/2 b, k4 = v + h c
            w1, w2, w3 = v1 + half * a1, v2 + half * a2, v3 + half * a3
            b1, b2, b3 = f(q2 + half * v2, q3 + half * v3, w1, w2, w3, u1, u2, u3)
            x1, x2, x3 = v1 + half * b1, v2 + half * b2, v3 + half * b3
            c1, c2, c3 = f(q2 + half * w2, q3 + half * w3, x1, x2, x3, u1, u2, u3)
            y1, y2, y3 = v1 + h * c1, v2 + h * c2, v3 + h * c3
            d1, d2, d3 = f(q2 + h * x2, q3 + h * x3, y1, y2, y3, u1, u2, u3)
            q1 += sixth * (v1 + 2.0 * (w1 + x1) + y1)
            q2 += sixth * (v2 + 2.0 * (w2 + x2) + y2)
            q3 += sixth * (v3 + 2.0 * (w3 + x3) + y3)
            v1 += sixth * (a1 + 2.0 * (b1 + c1) + d1)
            v2 += sixth * (a2 + 2.0 * (b2 + c2) + d2)
            v3 += sixth * (a3 + 2.0 * (b3 + c3) + d3)
        state[:, 0] = q1, q2, q3, v1, v2, v3
        return states


def _acceleration(plant: Plant) -> _Acceleration:
    """f(q2, q3, v1, v2, v3, u1, u2, u3) = D⁻¹ (u - τ_f(v) - c - h), with its constants bound once."""
    p1, p2, p3, p4, p5, p6, p7, p8, p9, p10, p11, p12, p13, p14, p15 = plant.p.reshape(15).tolist()
    joints = plant.body.robot.joints
    a2, g, offset2, offset3 = joints[1].a, -plant.body.robot.gravity[2], joints[1].offset, joints[2].offset
    (m11, m12, m13), (_, m22, m23), (_, _, m33) = plant.added.tolist()
    k3, k4, twice = a2 * p3, a2 * p4, 2.0 * a2
    e11, e22, e23, e33 = p7 + m11, p12 + m22, p13 + m23, p13 + m33
    g3, g4, g14, g15 = g * p3, g * p4, g * p14, g * p15
    friction1, friction2, friction3 = _curves(plant)

    def acceleration(q2: float, q3: float, v1: float, v2: float, v3: float, u1: float, u2: float, u3: float) -> _Triple:
        q2 += offset2
        q3 += offset3
        c2, s2, c3, s3 = cos(q2), sin(q2), cos(q3), sin(q3)
        cS, sS = c2 * c3 - s2 * s3, s2 * c3 + c2 * s3
        swing, bent, near = p9 * cS - p8 * sS, k3 * s3 + k4 * c3, k3 * c3 - k4 * s3
        lever, across = p3 * cS - p4 * sS, twice * (p3 * sS + p4 * cS) * c2  # across = both + bent
        D13 = p8 * cS + p9 * sS + m13
        D12 = D13 - m13 + p10 * c2 + p11 * s2 + m12
        D11 = (p1 * c2 + p2 * s2 + twice * lever) * c2 + (p5 * cS - p6 * sS) * cS + e11
        D22, D23, D33 = e22 + near + near, e23 + near, e33
        fore = 2.0 * p5 * sS * cS + p6 * (cS * cS - sS * sS)
        upper = 2.0 * p1 * s2 * c2 - p2 * (c2 * c2 - s2 * s2) + fore + 2.0 * (across - bent)  # upper + fore + 2 both
        outer = fore + across
        v, half = v2 + v3, 0.5 * v1 * v1
        h3 = g3 * cS - g4 * sS
        r1 = u1 - friction1(v1) + v1 * (v2 * upper + v3 * outer) - v * v * swing - v2 * v2 * (p11 * c2 - p10 * s2)
        r2 = u2 - friction2(v2) - half * upper + (v3 + v2 + v2) * v3 * bent - h3 - g14 * c2 + g15 * s2
        r3 = u3 - friction3(v3) - half * outer - v2 * v2 * bent - h3
        C11, C12, C13 = D22 * D33 - D23 * D23, D13 * D23 - D12 * D33, D12 * D23 - D13 * D22
        inverse = 1.0 / (D11 * C11 + D12 * C12 + D13 * C13)
        C23 = D12 * D13 - D11 * D23
        return ((C11 * r1 + C12 * r2 + C13 * r3) * inverse,
                (C12 * r1 + (D11 * D33 - D13 * D13) * r2 + C23 * r3) * inverse,
                (C13 * r1 + C23 * r2 + (D11 * D22 - D12 * D12) * r3) * inverse)

    return acceleration


def _curves(plant: Plant) -> tuple[_Friction, _Friction, _Friction]:
    """The friction of each joint over its speed, only as many sigmoids as it has."""
    curves = plant.curves
    one, two, three = (_curve(float(curves.constant[j]), float(curves.viscous[j]),
                              [(f, w) for f, w in zip(curves.heights[:, j].tolist(), curves.sharpnesses[:, j].tolist(), strict=True)
                               if f != 0.0]) for j in range(3))
    return one, two, three


def _curve(constant: float, viscous: float, sigmoids: list[tuple[float, float]]) -> _Friction:
    if not sigmoids:
        return lambda v: constant + viscous * v
    if len(sigmoids) == 1:
        [(f, w)] = sigmoids
        return lambda v: constant + viscous * v + f * tanh(w * v)
    if len(sigmoids) == 3:
        (f1, w1), (f2, w2), (f3, w3) = sigmoids
        return lambda v: constant + viscous * v + f1 * tanh(w1 * v) + f2 * tanh(w2 * v) + f3 * tanh(w3 * v)
    return lambda v: constant + viscous * v + sum(f * tanh(w * v) for f, w in sigmoids)
