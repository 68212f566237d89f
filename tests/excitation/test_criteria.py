"""Criteria: what they are, that their derivatives are theirs, that the smooth ones bound the sharp ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pipelines.excitation.criteria import (
    Spectrum,
    a_optimal,
    condition,
    d_optimal,
    spectrum,
)

Criterion = Callable[[Spectrum], tuple[float, np.ndarray]]
WEIGHTS = np.array([0.5, 2.0, 0.0, 1.0, 3.0, 0.1])


def _inverse_trace(m: np.ndarray) -> complex:
    return complex(WEIGHTS @ np.diag(np.linalg.inv(m)))


# Each criterion beside the same in complex arithmetic, by matrix powers, inverses and determinants alone.
CRITERIA: dict[str, tuple[Criterion, Callable[[np.ndarray], complex]]] = {
    "condition": (lambda s: condition(s, 6), lambda m: 0.5 * (np.log(np.trace(np.linalg.matrix_power(m, 6))) + np.log(
        np.trace(np.linalg.matrix_power(np.linalg.inv(m), 6)))) / 6),
    "D": (d_optimal, lambda m: -0.5 * np.log(np.linalg.det(m)) / 6),
    "A": (lambda s: a_optimal(s, WEIGHTS), lambda m: 0.5 * np.log(_inverse_trace(m))),
}


def _matrix(seed: int) -> np.ndarray:
    a = np.random.default_rng(seed).normal(size=(9, 6)) * np.array([1.0, 2.0, 0.3, 1.0, 4.0, 0.8])
    return np.asarray(a.T @ a)


@pytest.mark.parametrize("name", CRITERIA)
def test_value_and_derivative(name: str) -> None:
    """The derivative along any symmetric direction equals the complex step's."""
    mine, exact = CRITERIA[name]
    m = _matrix(1)
    value, gradient = mine(spectrum(m))
    assert value == pytest.approx(exact(m.astype(complex)).real, rel=1e-12)
    for seed in range(4):
        d = np.random.default_rng(seed).normal(size=(6, 6))
        d = d + d.T
        step = exact(m + 1e-30j * d).imag / 1e-30
        assert float((gradient * d).sum()) == pytest.approx(step, rel=1e-9, abs=1e-12)


def test_the_surrogate_bounds_the_condition_number_and_closes_in() -> None:
    """From above, ever closer: at p = 600 within log(n)/(2p) on each side of NumPy's condition number."""
    a = np.random.default_rng(2).normal(size=(50, 8))
    truth = np.log(np.linalg.cond(a))
    found = spectrum(a.T @ a / 50)
    values = [condition(found, p)[0] for p in (4, 16, 64, 600)]
    assert found.condition == pytest.approx(np.exp(truth), rel=1e-10)
    assert values == sorted(values, reverse=True)
    assert truth <= values[-1] <= truth + np.log(8) / 600
