"""The minimiser, the barrier and the budget."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import optimize

from pipelines.fit.design.barrier import barrier, cost_of_bounds
from pipelines.fit.design.budget import Budget, SpentError
from pipelines.fit.design.lbfgs import minimise


def test_it_finds_the_minimum_of_the_rosenbrock_function() -> None:
    """In twelve dimensions, from the usual start, with SciPy's function and derivative."""
    found = minimise(lambda x: (float(optimize.rosen(x)), optimize.rosen_der(x)), np.tile([-1.2, 1.0], 6), 500, 1e-14)
    np.testing.assert_allclose(found.x, 1.0, atol=1e-5)


def test_it_stays_inside_the_domain() -> None:
    """x - log(1 - x²): the minimum lies near the edge, where the function ends."""
    def function(x: np.ndarray) -> tuple[float, np.ndarray]:
        walls = barrier(x[:, None], np.zeros(1), np.ones(1))
        return (np.inf, x) if walls is None else (float(x[0]) + 0.01 * walls[0], np.ones(1) + 0.01 * walls[1][:, 0])

    exact = optimize.brentq(lambda x: 1.0 + 0.01 * 2.0 * x / (1.0 - x * x), -1.0 + 1e-9, 0.0)
    assert minimise(function, np.zeros(1), 100, 1e-12).x[0] == pytest.approx(exact, abs=1e-6)


def test_the_barrier_s_derivatives() -> None:
    """By the signal and by the width of its bounds, against central differences."""
    y = np.random.default_rng(0).uniform(-0.8, 0.8, (3, 20)) * np.array([1.0, 2.0, 3.0])[:, None] + 0.5
    middle, half = np.full(3, 0.5), np.array([1.0, 2.0, 3.0])

    def value(signals: np.ndarray, width: np.ndarray) -> float:
        found = barrier(signals, middle, width)
        assert found is not None
        return found[0]

    found = barrier(y, middle, half)
    assert found is not None
    d, h = np.random.default_rng(1).normal(size=y.shape), 1e-6
    assert float((found[1] * d).sum()) == pytest.approx((value(y + h * d, half) - value(y - h * d, half)) / (2 * h), rel=1e-6)
    for k, cost in enumerate(cost_of_bounds(y, middle, half)):
        e = np.where(np.arange(3) == k, h, 0.0)
        assert -cost == pytest.approx((value(y, half * (1 + e)) - value(y, half * (1 - e))) / (2 * h), rel=1e-5)


def test_a_bound_that_is_met_is_not_kept() -> None:
    assert barrier(np.array([[0.0, 1.0]]), np.zeros(1), np.ones(1)) is None


def test_a_budget_counts_evaluations_alone() -> None:
    """With a number of evaluations no clock ends the search; without one, seconds do."""
    budget = Budget(0.0, 3)
    for _ in range(3):
        budget.spend()
    with pytest.raises(SpentError):
        budget.spend()
    assert budget.done == 3
    timed = Budget(0.0, None)
    timed.spend()
    with pytest.raises(SpentError):
        timed.spend()


def test_slow_first_evaluations_do_not_end_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """Setting up takes 0.5 s, each evaluation 1 ms, and 400 of them are kept for the end: of 10 s 9 remain to search."""
    clock = iter([0.0, *(0.5 + 0.008 * k for k in range(10_000))])
    monkeypatch.setattr("pipelines.fit.design.budget.time.process_time", lambda: next(clock))
    budget = Budget(10.0, None, reserve=400.0)

    def search() -> None:
        while True:
            budget.spend()

    with pytest.raises(SpentError):
        search()
    assert 8_500 <= budget.done <= 9_500
