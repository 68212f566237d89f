"""Separable least squares against scipy's general solver, and its covariance against repetition."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

from pipelines.estimation.varpro import Separable, fit_separable, linear_part
from pipelines.io.log import Array

T = np.linspace(0.0, 4.0, 400)
ALPHA, BETA, THETA = 0.7, np.array([2.0, -1.5]), np.log(np.array([0.6, 3.0]))


def decays(theta: Array) -> Array:
    return np.exp(-T[:, None] * np.exp(theta))


def model(numbers: Array) -> Array:
    return np.asarray(numbers[0] * T + decays(numbers[3:]) @ numbers[1:3])


def problem(rng: np.random.Generator, noise: float = 0.01) -> Separable:
    y = model(np.concatenate([[ALPHA], BETA, THETA])) + noise * rng.standard_normal(len(T))
    return Separable(y, T[:, None], decays, np.log([0.05, 0.05]), np.log([50.0, 50.0]))


@pytest.mark.parametrize("seed", range(3))
def test_it_ends_where_a_general_solver_ends(seed: int) -> None:
    """Two exponentials and a line: all five numbers as scipy's Levenberg-Marquardt has them."""
    one = problem(np.random.default_rng(seed))
    found = fit_separable(one, [np.log([0.3, 1.0]), np.log([1.0, 5.0])])
    start = np.concatenate([[0.5], [1.0, -1.0], np.log([0.5, 2.0])])
    theirs = least_squares(lambda numbers: model(numbers) - one.y, start, method="lm", xtol=1e-12, ftol=1e-12).x
    assert found.residual @ found.residual <= (1.0 + 1e-5) * np.sum(np.square(model(theirs) - one.y))
    std = np.sqrt(np.diag(found.covariance))
    assert np.all(np.abs(np.concatenate([found.beta, found.theta]) - theirs) < 0.05 * std)


def test_the_covariance_is_what_repetition_shows() -> None:
    """Sixty repetitions: deviations over standard deviations have a root mean square of about one."""
    scores = []
    for seed in range(60):
        found = fit_separable(problem(np.random.default_rng([1, seed])), [THETA], lags=0)
        apart = np.concatenate([found.beta, found.theta]) - np.concatenate([[ALPHA], BETA, THETA])
        scores.append(apart / np.sqrt(np.diag(found.covariance)))
    rms = np.sqrt(np.mean(np.square(scores), axis=0))
    assert np.all((rms > 0.75) & (rms < 1.3)), rms


def test_columns_that_are_one_share_the_least() -> None:
    """Twice the same column: what it explains is split, and no number is large."""
    x = np.linspace(0.0, 1.0, 50)
    found = linear_part(np.stack([x, x, np.ones(50)], axis=1), 3.0 * x + 1.0)
    np.testing.assert_allclose(found.beta, [1.5, 1.5, 1.0], rtol=1e-6)
    assert found.rss < 1e-12


def test_a_number_that_no_row_shows_is_marked() -> None:
    """A column of zeros: its number is zero, its share seen is zero, the others are untouched."""
    rng = np.random.default_rng(4)
    y = 2.0 * T + 0.01 * rng.standard_normal(len(T))
    nothing = Separable(y, T[:, None], lambda theta: np.zeros((len(T), 1)), np.zeros(0), np.zeros(0))
    found = fit_separable(nothing, [np.zeros(0)])
    assert found.seen.tolist() == pytest.approx([1.0, 0.0])
    assert found.beta[1] == 0.0


def test_bounds_hold_and_are_named() -> None:
    """A truth outside its bounds ends on the bound."""
    one = problem(np.random.default_rng(6))
    tight = Separable(one.y, one.fixed, one.build, np.log([0.05, 0.05]), np.log([50.0, 2.0]))
    found = fit_separable(tight, [np.log([0.5, 1.5])])
    assert found.at_bound == (False, True)
    assert found.theta[1] <= np.log(2.0) + 1e-12
