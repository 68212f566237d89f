"""What mass that is nowhere negative demands of the RRR arm's base parameters.

With X = x + a_i the coordinate from the joint's axis, `verified.md` section 3 writes (A4) as moments of mass:

    p5  = ∫₃ (X² - y²)        p6 = 2 ∫₃ X y       p13 = ∫₃ (X² + y²)
    p1  = ∫₂ (X² - y²) + a2² m3                   p12 = ∫₂ (X² + y²) + a2² m3 + p13

so that each of the following is a sum of positive moments, or a Schwarz inequality between them. All are necessary, not
sufficient: `pipelines.fit.consistency` asks for bodies that have all parameters at once.
"""

from __future__ import annotations

import numpy as np

from pipelines.fit.consistency import Inequality
from pipelines.model.rigid.body import Array
from pipelines.model.rigid.chain import STANDARD
from pipelines.model.rigid.rrr import RRR

__all__ = ["rrr_combine", "rrr_inequalities"]

_P1, _P5, _P6, _P12, _P13 = 0, 4, 5, 11, 12


def rrr_inequalities(p: Array, covariance: Array) -> tuple[Inequality, ...]:
    """The inequalities on p (15,), each with a standard deviation to first order from its covariance (15, 15)."""
    p1, p5, p6, p12, p13 = p[[_P1, _P5, _P6, _P12, _P13]]
    across = float(np.hypot(p5, p6))
    tilt = (p5 / across, p6 / across) if across > 0.0 else (0.0, 0.0)
    rows = (
        ("p13 - sqrt(p5^2 + p6^2) > 0", p13 - across, {_P13: 1.0, _P5: -tilt[0], _P6: -tilt[1]}),
        ("p12 - p13 - p1 > 0", p12 - p13 - p1, {_P12: 1.0, _P13: -1.0, _P1: -1.0}),
        ("p13 - p5 > 0", p13 - p5, {_P13: 1.0, _P5: -1.0}),
        ("(p13^2 - p5^2)/4 - (p6/2)^2 >= 0", 0.25 * (p13**2 - p5**2 - p6**2),
         {_P13: 0.5 * p13, _P5: -0.5 * p5, _P6: -0.5 * p6}),
    )
    return tuple(Inequality(name, float(value), _std(slope, covariance)) for name, value, slope in rows)


def _std(slope: dict[int, float], covariance: Array) -> float:
    used = list(slope)
    g = np.array([slope[k] for k in used])
    part = covariance[np.ix_(used, used)]
    return float(np.sqrt(max(g @ part @ g, 0.0))) if np.isfinite(part).all() else float("inf")


def rrr_combine(body: RRR) -> Array:
    """L (15, 30) with p = L φ, φ the standard parameters of `chain.STANDARD`. Kostić et al. 2004, eq. (A4)."""
    (_, a2, a3), (_, d2, d3) = ([getattr(joint, key) for joint in body.robot.joints] for key in ("a", "d"))
    d = d2 + d3
    rows: tuple[dict[str, float], ...] = (
        {"m3": a2**2, "m2": a2**2, "mx2": 2 * a2, "Ixx2": -1.0, "Iyy2": 1.0},
        {"my2": -2 * a2, "Ixy2": -2.0},
        {"m3": a3, "mx3": 1.0},
        {"my3": 1.0},
        {"m3": a3**2, "mx3": 2 * a3, "Ixx3": -1.0, "Iyy3": 1.0},
        {"my3": 2 * a3, "Ixy3": 2.0},
        {"mz2": 2 * d2, "m2": d2**2, "mz3": 2 * d, "m3": d**2, "Iyy1": 1.0, "Ixx2": 1.0, "Ixx3": 1.0},
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
