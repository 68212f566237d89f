"""Streaming least squares against np.linalg.lstsq on the whole matrix, and against known truths."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from pipelines.estimation.least_squares import (
    Block,
    errors,
    fit,
    gather,
    solve,
    triangulate,
)
from pipelines.io.log import Array
from tests.estimation.problems import CHANNELS, SIGMA, WIDTH, Problem, problem, white

METHODS = [gather, triangulate]


def whole(Y: Array, y: Array, weights: Array) -> Array:
    """The answer of one dense factorisation."""
    root = np.sqrt(weights)
    return np.asarray(np.linalg.lstsq((Y * root[:, None]).reshape(-1, Y.shape[2]), (y * root).ravel(), rcond=None)[0])


def noisy(seed: int = 1) -> tuple[Problem, Array]:
    one = problem()
    return one, one.clean + white(np.random.default_rng(seed), len(one.Y))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("size", [5000, 700, 64, 7])
def test_blocks_give_the_answer_of_the_whole(method: type, size: int) -> None:
    """However the samples are cut, β is that of one dense factorisation, to 1e-11."""
    one, y = noisy()
    weights = np.array([0.3, 2.0, 50.0])
    found = solve(method(one.blocks(y, size)), weights=weights)
    truth = whole(one.Y, y, weights)
    assert np.abs(found.beta - truth).max() <= 1e-11 * np.abs(truth).max()


@pytest.mark.parametrize("method", METHODS)
def test_what_is_remembered_tells_the_residual(method: type) -> None:
    """Residuals, relative error and covariance agree with those computed from every sample."""
    one, y = noisy()
    found = solve(method(one.blocks(y, 500)), weights=1 / SIGMA**2)
    residual = y - one.Y @ found.beta
    np.testing.assert_allclose(found.errors.rms, np.sqrt(np.mean(residual**2, axis=0)), rtol=1e-9)
    np.testing.assert_allclose(found.errors.signal_rms, np.sqrt(np.mean(y**2, axis=0)), rtol=1e-12)
    np.testing.assert_allclose(found.errors.relative_error, np.linalg.norm(residual) / np.linalg.norm(y), rtol=1e-9)
    a = (one.Y / SIGMA[:, None]).reshape(-1, WIDTH)
    assert abs(found.freedom.sum() - (a.shape[0] - WIDTH)) < 1e-6
    bread = np.linalg.inv(a.T @ a)
    meat = sum(np.square(found.sigma[j] / SIGMA[j]**2) * one.Y[:, j].T @ one.Y[:, j] for j in range(CHANNELS))
    np.testing.assert_allclose(found.covariance, bread @ meat @ bread, rtol=1e-7, atol=1e-12)


def test_weights_are_those_of_maximum_likelihood() -> None:
    """Reweighting ends where the likelihood of channels with unknown noise has its maximum, as a direct search finds it."""
    one, y = noisy()
    found = fit(one.blocks(y)).solution
    n = len(y)

    def minus_log_likelihood(log_sigma: Array) -> float:
        beta = whole(one.Y, y, np.exp(-2 * log_sigma))
        rss = np.square(y - one.Y @ beta).sum(axis=0)
        return float(np.sum(found.freedom * log_sigma + 0.5 * rss * np.exp(-2 * log_sigma)) / n)

    best = minimize(minus_log_likelihood, np.log(2 * SIGMA), method="Nelder-Mead", options={"xatol": 1e-6, "fatol": 1e-12})
    np.testing.assert_allclose(found.sigma, np.exp(best.x), rtol=1e-3)
    np.testing.assert_allclose(found.sigma, SIGMA, rtol=0.05)


def test_a_noisy_channel_is_heard_less() -> None:
    """What a quiet channel also feels is found several times nearer to the truth than without weights."""
    weighted, plain = [], []
    one = problem()
    for seed in range(20):
        y = one.clean + white(np.random.default_rng(seed), len(one.Y)) * [5.0, 1.0, 0.2]
        weighted.append(fit(one.blocks(y)).solution.beta - one.beta)
        plain.append(fit(one.blocks(y), weights=np.ones(CHANNELS)).solution.beta - one.beta)
    shared = slice(0, WIDTH - 3)
    assert np.linalg.norm(np.array(plain)[:, shared]) > 5 * np.linalg.norm(np.array(weighted)[:, shared])


def test_merged_logs_are_one_log() -> None:
    """Two logs added, in either order, give what all their samples give, whether products or triangles are kept."""
    one, y = noisy()
    first, second = one.blocks(y[:2000]), [Block.of(one.Y[2000:], y[2000:])]
    truth = fit([*first, *second]).solution.beta
    for method in METHODS:
        a, b = method(first), method(second)
        for both in (a + b, b + a):
            assert both.samples == len(y)
            assert both.longest == 3000
            assert np.abs(solve(both).beta - truth).max() < 1e-10


def test_columns_that_do_not_act_cost_nothing_and_change_nothing() -> None:
    """Columns left out where they are zero, block by block, leave the estimate as it is."""
    one, y = noisy()
    sparse = [Block.of(one.Y[k:k + 500], y[k:k + 500]) for k in range(0, len(y), 500)]
    assert [len(c) for c in sparse[0].columns] == [WIDTH - 2 - 2, WIDTH - 2, WIDTH - 2]
    full = [Block(WIDTH, (np.arange(WIDTH),) * y.shape[1], tuple(one.Y.transpose(1, 2, 0)), tuple(y.T))]
    np.testing.assert_allclose(fit(sparse).solution.beta, fit(full).solution.beta, rtol=1e-11)
    late = one.Y.copy()
    late[:2500, :, 5] = 0.0  # a column that wakes in the middle of the log
    for method in METHODS:
        blocks = [Block.of(late[k:k + 500], y[k:k + 500]) for k in range(0, len(y), 500)]
        np.testing.assert_allclose(solve(method(blocks), weights=1 / SIGMA**2).beta, whole(late, y, 1 / SIGMA**2), rtol=1e-9)


@pytest.mark.parametrize(("condition", "method", "bar"), [(1e2, "normal equations", 1e-10), (1e6, "QR", 1e-9), (1e9, "QR", 1e-5)])
def test_bad_condition_calls_for_triangles(condition: float, method: str, bar: float) -> None:
    """With no noise parameters come back, and what would lose them in products goes through QR."""
    rng = np.random.default_rng(3)
    u, _, v = np.linalg.svd(rng.standard_normal((3000, 8)), full_matrices=False)
    a = u * np.geomspace(1.0, 1.0 / condition, 8) @ v
    beta = rng.standard_normal(8)
    Y = a.reshape(1000, 3, 8)
    found = fit([Block.of(Y[k:k + 100], (Y @ beta)[k:k + 100]) for k in range(0, 1000, 100)])
    assert found.statistics.triangular == (method == "QR")
    assert np.linalg.norm(found.solution.beta - beta) <= bar * np.linalg.norm(beta)
    equilibrated = a / np.linalg.norm(a, axis=0)
    assert found.solution.condition == pytest.approx(np.linalg.cond(equilibrated), rel=1e-2)


def test_units_do_not_matter() -> None:
    """Columns in millimetres or tons give the same physics: estimate and std scale, to rounding."""
    one, y = noisy()
    scale = np.geomspace(1e-9, 1e9, WIDTH)
    here, there = (fit([Block.of(Y, y)]).solution for Y in (one.Y, one.Y * scale))
    np.testing.assert_allclose(there.beta * scale, here.beta, rtol=1e-9)
    np.testing.assert_allclose(there.std * scale, here.std, rtol=1e-9)


def test_a_parameter_that_nothing_shows_has_no_value() -> None:
    """A zero column and a doubled column have infinite std; the others are as if these were not there."""
    one, y = noisy()
    more = np.concatenate([one.Y, np.zeros_like(one.Y[:, :, :1]), one.Y[:, :, 4:5]], axis=2)
    found = fit([Block.of(more, y)]).solution
    assert list(np.flatnonzero(~np.isfinite(found.std))) == [4, WIDTH, WIDTH + 1]
    assert found.rank == WIDTH
    others = [k for k in range(WIDTH) if k != 4]
    np.testing.assert_allclose(found.beta[others], fit(one.blocks(y)).solution.beta[others], rtol=1e-6)
    np.testing.assert_allclose(found.std[others], fit(one.blocks(y)).solution.std[others], rtol=1e-6)


def test_held_out_error_needs_no_samples() -> None:
    """The error of given parameters on another log, from what that log left behind."""
    one, other = noisy(seed=2)
    truth = one.beta * 1.01
    seen = errors(gather(one.blocks(other, 333)), truth)
    residual = other - one.Y @ truth
    assert seen.relative_error == pytest.approx(np.linalg.norm(residual) / np.linalg.norm(other), rel=1e-9)
    np.testing.assert_allclose(seen.rms, np.sqrt(np.mean(residual**2, axis=0)), rtol=1e-9)


def test_silence_is_answered_with_zero() -> None:
    """No signal in a channel, or in all, is no error."""
    one, y = noisy()
    y = y * [1.0, 0.0, 1.0]
    assert np.isfinite(fit(one.blocks(y)).solution.beta).all()
    assert not fit(one.blocks(np.zeros_like(y))).solution.beta.any()
    with pytest.raises(ValueError, match="no equations"):
        fit([])
