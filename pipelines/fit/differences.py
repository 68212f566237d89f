"""Tell whether two estimates of one number differ by more than they are uncertain, many numbers at a time.

    z = (b - a) / √(σa² + σb²)

is standard normal where nothing differs and the errors of a and b are independent. Of n such numbers the largest |z| exceeds

    Φ⁻¹(1 - α/(2n))

with a probability of α at most (Bonferroni; Miller, Simultaneous Statistical Inference, 1981, p. 8).
"""

from __future__ import annotations

import math
from statistics import NormalDist

__all__ = ["limit_of", "standardised"]


def standardised(a: float, b: float, std_a: float, std_b: float) -> float:
    """z of the difference b - a; not a number where neither is uncertain."""
    std = math.hypot(std_a, std_b)
    return (b - a) / std if std > 0.0 else math.nan


def limit_of(count: int, alpha: float = 0.01) -> float:
    """What |z| of `count` numbers that do not differ exceeds with a probability of `alpha` at most, whichever it is."""
    return NormalDist().inv_cdf(1.0 - alpha / (2 * max(count, 1)))
