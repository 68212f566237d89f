"""The barrier: its derivatives, on both sides of the limit, and what a limit costs."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.excitation.constraints import barrier, cost_of_limits

HALF = np.array([1.0, 2.0, 3.0])
MIDDLE = np.full(3, 0.5)


@pytest.mark.parametrize("reach", [0.8, 1.3])
def test_the_barrier_s_derivative(reach: float) -> None:
    """By the signal, against central differences; within the limits and beyond, where it is finite too."""
    y = np.random.default_rng(0).uniform(-reach, reach, (3, 20)) * HALF[:, None] + 0.5
    _, slope, inside = barrier(y, MIDDLE, HALF)
    assert inside == (reach < 1.0)
    d, h = np.random.default_rng(1).normal(size=y.shape), 1e-6
    found = (barrier(y + h * d, MIDDLE, HALF)[0] - barrier(y - h * d, MIDDLE, HALF)[0]) / (2 * h)
    assert float((slope * d).sum()) == pytest.approx(found, rel=1e-6)


def test_it_is_the_logarithm_within_the_limits() -> None:
    """-(1/n) Σ log(1 - g²), also where another sample is beyond."""
    g = np.array([[0.1, -0.7, 0.99, 0.3]])
    assert barrier(g, np.zeros(1), np.ones(1))[0] == pytest.approx(-np.log(1.0 - g**2).mean())
    beyond, inside = (barrier(np.append(g, [[x]], axis=1), np.zeros(1), np.ones(1)) for x in (1.2, 0.0))
    assert beyond[0] > inside[0]
    assert not barrier(np.array([[0.0, 1.0]]), np.zeros(1), np.ones(1))[2]


def test_the_cost_of_a_limit_is_its_derivative() -> None:
    """By the logarithm of its width, as a share of all."""
    y = np.random.default_rng(0).uniform(-0.8, 0.8, (3, 20)) * HALF[:, None] + 0.5
    h, found = 1e-6, []
    for k in range(3):
        e = np.where(np.arange(3) == k, h, 0.0)
        found.append((barrier(y, MIDDLE, HALF * (1 - e))[0] - barrier(y, MIDDLE, HALF * (1 + e))[0]) / (2 * h))
    np.testing.assert_allclose(cost_of_limits(y, MIDDLE, HALF), np.array(found) / sum(found), rtol=1e-5)
