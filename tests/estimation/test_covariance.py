"""Does the truth lie where the standard deviations say? Over many seeds, for noise with and without a memory."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pipelines.estimation.covariance import robust_covariance
from pipelines.estimation.least_squares import fit, gather, solve
from pipelines.io.log import Array
from tests.estimation.problems import (
    CHANNELS,
    SIGMA,
    Problem,
    autoregressive,
    correlated,
    low_passed,
    problem,
    white,
)

SEEDS = 80

Noise = Callable[[np.random.Generator, int], Array]
NEARLY_INTEGRATED: Noise = lambda rng, n: autoregressive(rng, n, 0.99)  # noqa: E731


def scores(noise: Noise, every: int = 0, size: int | None = None, width: int = 13) -> tuple[Array, Array]:
    """Errors over standard deviations (seeds, parameters): allowing for memory, and by the white-noise formula."""
    raw = problem(width=width)
    one = Problem(low_passed(raw.Y, every), raw.beta) if every else raw
    robust, plain = [], []
    for seed in range(SEEDS):
        y = raw.clean + noise(np.random.default_rng(seed), len(raw.Y))
        blocks = one.blocks(low_passed(y, every) if every else y, size)
        fitted = fit(blocks)
        off = fitted.solution.beta - raw.beta
        robust.append(off / robust_covariance(blocks, fitted.solution, fitted.statistics.longest).std)
        plain.append(off / fitted.solution.std)
    return np.array(robust), np.array(plain)


def covered(z: Array) -> float:
    return float(np.mean(np.abs(z) < 2.0))


@pytest.mark.parametrize(("noise", "every", "size", "width"), [
    pytest.param(white, 0, None, 13, id="white", marks=pytest.mark.slow),
    pytest.param(autoregressive, 0, None, 13, id="ar"),
    pytest.param(NEARLY_INTEGRATED, 0, None, 13, id="ar 0.99", marks=pytest.mark.slow),
    pytest.param(white, 5, None, 13, id="decimated by 5", marks=pytest.mark.slow),
    pytest.param(correlated, 10, None, 13, id="correlated, decimated"),
    *(pytest.param(*other, id=name, marks=pytest.mark.slow) for name, other in {
        "ar, blocks": (autoregressive, 0, 1000, 13), "ar, 40 parameters": (autoregressive, 0, None, 40),
        "correlated channels": (correlated, 0, None, 13), "low-passed": (white, 1, None, 13),
        "decimated by 10": (white, 10, None, 13), "ar, decimated": (autoregressive, 10, None, 13),
        "decimated, 40 parameters": (white, 5, None, 40)}.items())])
def test_truth_lies_within_two_standard_deviations(noise: Noise, every: int, size: int | None, width: int) -> None:
    """In 92-98 % of all cases, no parameter biased by more than 0.3 std."""
    z, _ = scores(noise, every, size, width)
    assert 0.92 <= covered(z) <= 0.98
    assert np.abs(z.mean(axis=0)).max() < 0.3
    assert 0.9 < z.std() < 1.1


@pytest.mark.slow
def test_the_white_noise_formula_would_not_do() -> None:
    """What the sandwich is for: with a memory of 20 samples the plain formula covers less than half."""
    assert covered(scores(autoregressive)[1]) < 0.5
    assert covered(scores(white, 1)[1]) < 0.6


def test_white_noise_is_recognised() -> None:
    """Where the residual is white nothing is added; where it is not, it is noticed, also between channels alone."""
    one = problem()

    def seen(noise: Noise, seed: int) -> tuple[bool, Array]:
        blocks = one.blocks(one.clean + noise(np.random.default_rng(seed), len(one.Y)))
        fitted = fit(blocks)
        robust = robust_covariance(blocks, fitted.solution, fitted.statistics.longest)
        return robust.white, robust.inflation

    assert sum(seen(white, seed)[0] for seed in range(20)) >= 18
    assert not any(seen(autoregressive, seed)[0] for seed in range(5))
    assert not any(seen(correlated, seed)[0] for seed in range(5))
    assert seen(autoregressive, 0)[1].min() > 3.0


@pytest.mark.slow
def test_against_the_covariance_of_known_noise() -> None:
    """With 80 000 samples the estimated covariance is the exact one of AR(1) noise, C Aᵀ V A C, to a few per cent."""
    memory, samples = 0.9, 80_000
    one = problem(samples=samples)
    noise = autoregressive(np.random.default_rng(0), samples, memory)
    blocks = one.blocks(one.clean + noise, 20_000)
    found = solve(gather(blocks), weights=1 / SIGMA**2)
    robust = robust_covariance(blocks, found, 20_000)
    meat = np.zeros_like(found.bread)
    lags = memory ** np.arange(120) / (1 - memory**2)  # autocovariance of x(k) = memory x(k-1) + e(k)
    for j in range(CHANNELS):
        a = one.Y[:, j] / SIGMA[j]
        for lag, gamma in enumerate(lags):
            product = gamma * a[lag:].T @ a[:samples - lag]
            meat += product if lag == 0 else product + product.T
    exact = np.sqrt(np.diag(found.bread @ meat @ found.bread))
    np.testing.assert_allclose(robust.std, exact, rtol=0.08)


def test_a_silent_channel_and_a_lost_parameter() -> None:
    """A channel without residual is no obstacle; a parameter that nothing shows has an infinite std, the others a finite."""
    one = problem()
    noise = autoregressive(np.random.default_rng(0), len(one.Y)) * [1.0, 0.0, 1.0]
    Y = np.concatenate([one.Y, np.zeros_like(one.Y[:, :, :1])], axis=2)
    blocks = Problem(Y, one.beta).blocks(one.clean + noise)
    fitted = fit(blocks)
    std = robust_covariance(blocks, fitted.solution, fitted.statistics.longest).std
    assert np.isfinite(std[:-1]).all()
    assert np.isinf(std[-1])
