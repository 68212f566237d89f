"""Two estimates of one number, many at a time, and of numbers on a circle."""

from __future__ import annotations

import math

import numpy as np
from scipy import stats

from pipelines.estimation.bootstrap import difference, limit_of, standardised

TURN = 2.0 * math.pi


def test_the_limit_is_that_of_a_normal_distribution() -> None:
    """z and its limit against scipy: of n figures none exceeds it with a probability of 1 - α at least."""
    for count, alpha in ((1, 0.05), (30, 0.01), (400, 0.001)):
        limit = limit_of(count, alpha)
        assert math.isclose(limit, stats.norm.isf(alpha / (2 * count)), rel_tol=1e-9)
        assert (1.0 - 2.0 * stats.norm.sf(limit))**count >= 1.0 - alpha
    assert standardised(1.0, 6.0, 3.0, 4.0) == 1.0
    assert math.isnan(standardised(1.0, 2.0, 0.0, 0.0))


def test_the_way_around_a_circle_is_the_shorter_one() -> None:
    """As the angle between two unit vectors has it, whatever turns are added; phases of 2.40 and -2.96 rad are 0.92 rad apart."""
    rng = np.random.default_rng(1)
    for a, b, turns in zip(rng.uniform(-3.1, 3.1, 200), rng.uniform(-3.1, 3.1, 200), rng.integers(-3, 4, 200), strict=True):
        away = difference(a, b + turns * TURN, TURN)
        assert math.isclose(away, float(np.angle(np.exp(1j * (b - a)))), abs_tol=1e-9)
        assert math.isclose(difference(b + turns * TURN, a, TURN), -away, abs_tol=1e-9)
    assert math.isclose(standardised(2.4024, -2.9644, 0.1439, 0.0289, TURN), 0.9164 / math.hypot(0.1439, 0.0289), rel_tol=1e-3)
    assert difference(2.4, -3.0) == -5.4
