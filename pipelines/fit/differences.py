"""Tell whether two estimates of one number differ by more than they are uncertain, many numbers at a time.

    z = (b - a) / √(σa² + σb²)

is standard normal where nothing differs and the errors of a and b are independent. Of n such numbers the largest |z| exceeds

    Φ⁻¹(1 - α/(2n))

with a probability of α at most (Bonferroni; Miller, Simultaneous Statistical Inference, 1981, p. 8). Of a number on a circle,
b - a is the shorter way around.
"""

from __future__ import annotations

import math
from statistics import NormalDist

__all__ = ["difference", "limit_of", "standardised"]


def difference(a: float, b: float, period: float | None = None) -> float:
    """b - a; of numbers that are the same again after a `period`, the nearer one to zero."""
    return b - a if period is None or not math.isfinite(b - a) else math.remainder(b - a, period)


def standardised(a: float, b: float, std_a: float, std_b: float, period: float | None = None) -> float:
    """z of the difference b - a; not a number where neither is uncertain."""
    std = math.hypot(std_a, std_b)
    return difference(a, b, period) / std if std > 0.0 else math.nan


def limit_of(count: int, alpha: float = 0.01) -> float:
    """What |z| of `count` numbers that do not differ exceeds with a probability of `alpha` at most, whichever it is."""
    return NormalDist().inv_cdf(1.0 - alpha / (2 * max(count, 1)))
