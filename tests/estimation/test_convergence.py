"""Estimates over a growing number of samples, against fits of exactly those samples."""

from __future__ import annotations

import numpy as np

from pipelines.estimation.least_squares import convergence, fit
from tests.estimation.problems import problem, white


def test_series_is_the_fit_of_the_first_samples() -> None:
    """Each point is what a fit of the samples so far gives with the same weights; the last is the fit itself."""
    one = problem()
    y = one.clean + white(np.random.default_rng(0), len(one.Y))
    whole = fit(one.blocks(y)).solution
    series = convergence(one.blocks(y), whole, parts=20)
    assert series.samples == tuple(range(250, 5001, 250))
    np.testing.assert_allclose(series.beta[-1], whole.beta, rtol=1e-9)
    np.testing.assert_allclose(series.std[-1], whole.std, rtol=1e-2)
    for k, n in ((3, 1000), (9, 2500)):
        weights = np.sqrt(whole.weights)
        a = (one.Y[:n] * weights[:, None]).reshape(-1, one.Y.shape[2])
        beta = np.linalg.lstsq(a, (y[:n] * weights).ravel(), rcond=None)[0]
        np.testing.assert_allclose(series.beta[k], beta, rtol=1e-6, atol=1e-9)


def test_estimates_settle_within_their_std() -> None:
    """The truth lies within four std all along, and std fall; before there is enough to solve, there is no number."""
    one = problem()
    y = one.clean + white(np.random.default_rng(1), len(one.Y))
    whole = fit(one.blocks(y)).solution
    series = convergence(one.blocks(y), whole, parts=1250)
    assert np.isnan(series.beta[0]).all()
    known = ~np.isnan(series.beta[:, 0])
    z = (series.beta[known] - one.beta) / series.std[known]
    assert np.mean(np.abs(z) < 2.0) > 0.85
    assert (np.diff(series.std[known], axis=0) <= 1e-12).all()
