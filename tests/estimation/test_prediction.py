"""What the samples before do not tell: against the Cholesky factor of the dense covariance."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import cholesky, solve_triangular, toeplitz

from pipelines.estimation.filters import prediction_errors, prediction_weights

POWER = 0.3


def autoregression(lags: int) -> np.ndarray:
    """(lags,) autocovariance of 1 / ((1 - 0.7 B)(1 + 0.4 B)) by its impulse response; of second order."""
    impulse = np.convolve(0.7**np.arange(400), (-0.4)**np.arange(400))[:400]
    out = np.array([impulse[:400 - k] @ impulse[k:] for k in range(lags)])
    return POWER * out / out[0]


@pytest.mark.parametrize("order", [2, 6])
def test_they_are_the_inverse_of_the_factor_of_the_covariance(order: int) -> None:
    """From the first sample on, once the order of the autoregression is reached."""
    samples = 40
    factor = cholesky(toeplitz(autoregression(samples)), lower=True)
    x = np.random.default_rng(1).standard_normal((3, samples))
    dense = np.sqrt(POWER) * solve_triangular(factor, x.T, lower=True).T
    assert_allclose(prediction_errors(prediction_weights(autoregression(order + 1)), x), dense, rtol=0.0, atol=1e-12)


def test_two_samples_tell_the_autoregression() -> None:
    """1 - 0.3 B - 0.28 B², whatever lies beyond it."""
    weights = prediction_weights(autoregression(5))[-1]
    assert_allclose(weights / weights[0], [1.0, -0.3, -0.28, 0.0, 0.0], atol=1e-12)


def test_what_is_white_stays_and_what_is_zero_too() -> None:
    x = np.random.default_rng(2).standard_normal((2, 30))
    for covariance in ([POWER, 0.0, 0.0], [0.0, 0.0, 0.0]):
        assert_array_equal(prediction_errors(prediction_weights(np.array(covariance)), x), x)


def test_a_ridge_bounds_what_is_brought_back() -> None:
    """Of samples that tell each other all, an error is at most 1 / √ridge of the signal; without one it is without end."""
    slow = np.cos(1e-6 * np.arange(9))
    assert np.abs(prediction_weights(slow, 1e-4)[-1]).sum() < 1e2 * 2.0
    x = np.ones((1, 30))
    assert np.abs(prediction_errors(prediction_weights(slow, 1e-4), x)).max() < 1.01


def test_a_signal_shorter_than_the_order() -> None:
    x = np.random.default_rng(3).standard_normal((1, 3))
    factor = cholesky(toeplitz(autoregression(3)), lower=True)
    dense = np.sqrt(POWER) * solve_triangular(factor, x.T, lower=True).T
    assert_allclose(prediction_errors(prediction_weights(autoregression(9)), x), dense, rtol=0.0, atol=1e-12)
