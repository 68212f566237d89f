"""Necessary conditions on the RRR arm's base parameters for mass that is nowhere negative.

With X = x + a_i the coordinate from the joint's axis, `verified.md` section 3 writes (A4) as
moments of mass:

    p5  = ∫₃ (X² - y²)        p6 = 2 ∫₃ X y       p13 = ∫₃ (X² + y²)
    p1  = ∫₂ (X² - y²) + a2² m3                   p12 = ∫₂ (X² + y²) + a2² m3 + p13

so that each of the following is a sum of positive moments, or a Schwarz inequality between them.
All are necessary, not sufficient: `pipelines.estimation.consistency` asks for bodies that have all
parameters at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.io.log import Array

__all__ = ["Inequality", "rrr_inequalities"]

_P1, _P5, _P6, _P12, _P13 = 0, 4, 5, 11, 12  # numerics: places in p


@dataclass(frozen=True)
class Inequality:
    """A quantity that physics demands to be positive, with its uncertainty."""

    name: str  # "p13 - p5 = 2 ∫ y² dm > 0"
    value: float
    std: float

    @property
    def satisfied(self) -> bool:
        """Return whether it holds within three deviations; where those are unknown, as it is."""
        return self.value > -(3.0 * self.std if np.isfinite(self.std) else 0.0)


def rrr_inequalities(p: Array, covariance: Array) -> tuple[Inequality, ...]:
    """Return the inequalities on p (15,).

    Each has a standard deviation to first order from its covariance (15, 15).
    """
    p1, p5, p6, p12, p13 = p[[_P1, _P5, _P6, _P12, _P13]]
    across = float(np.hypot(p5, p6))
    tilt = (p5 / across, p6 / across) if across > 0.0 else (0.0, 0.0)
    rows = (
        ("p13 - sqrt(p5^2 + p6^2) > 0", p13 - across, {_P13: 1.0, _P5: -tilt[0], _P6: -tilt[1]}),
        ("p12 - p13 - p1 > 0", p12 - p13 - p1, {_P12: 1.0, _P13: -1.0, _P1: -1.0}),
        ("p13 - p5 > 0", p13 - p5, {_P13: 1.0, _P5: -1.0}),
        ("(p13^2 - p5^2)/4 - (p6/2)^2 >= 0", 0.25 * (p13**2 - p5**2 - p6**2),
         {_P13: 0.5 * p13, _P5: -0.5 * p5, _P6: -0.5 * p6}))
    return tuple(
        Inequality(name, float(value), _std(slope, covariance)) for name, value, slope in rows)


def _std(slope: dict[int, float], covariance: Array) -> float:
    used = list(slope)
    g = np.array([slope[k] for k in used])
    part = covariance[np.ix_(used, used)]
    return float(np.sqrt(max(g @ part @ g, 0.0))) if np.isfinite(part).all() else float("inf")
