"""A motion that repeats: what is told of the estimate holds, whether its residual repeats as well or is noise."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy.linalg import helmert

from pipelines.estimation.covariance import (
    CONTRAST,
    MEAN,
    Contrasted,
    Cycle,
    Robust,
    of_mean,
    robust_covariance,
)
from pipelines.estimation.least_squares import Block, fit, gather, solve
from pipelines.io.log import Array
from tests.fit.problems import CHANNELS, SIGMA, Problem, autoregressive, problem, white

PERIODS, PHASES = 4, 2500
SEEDS, MORE = 25, 200  # of every run; of the long campaigns


def turned(blocks: list[Block], phase: Array | None = None, phases: int = PHASES) -> Contrasted:
    """The blocks of one log that repeats every `phases` samples."""
    where = np.arange(sum(block.samples for block in blocks)) % phases if phase is None else phase
    return Contrasted(lambda: ((0, block) for block in blocks), (Cycle(where, phases),))


def repeating(unlike: float = 0.0) -> Problem:
    """Four periods of five seconds; `unlike`, a part of the columns that is another in each."""
    one = problem(samples=PHASES)
    Y = np.tile(one.Y, (PERIODS, 1, 1))
    return Problem(Y + unlike * problem(seed=3, samples=len(Y)).Y * (Y != 0.0), one.beta)


@lru_cache(maxsize=1)
def scores(seeds: int, repeats: float, noise: float, memory: float, unlike: float) -> tuple[Array, Array]:
    """Errors over standard deviations (seeds, parameters): by phases, and as if every period were news."""
    one, own, pooled = repeating(unlike), [], []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        lacks = np.tile(autoregressive(rng, PHASES, memory), (PERIODS, 1))
        blocks = one.blocks(one.clean + repeats * lacks + noise * autoregressive(rng, len(one.Y), memory))
        fitted = fit(blocks)
        off = fitted.solution.beta - one.beta
        every = robust_covariance(blocks, fitted.solution, fitted.statistics.longest)
        own.append(off / robust_covariance(turned(blocks), fitted.solution, PHASES).at_least(every).std)
        pooled.append(off / every.std)
    return np.array(own), np.array(pooled)


def covered(z: Array) -> float:
    return float(np.mean(np.abs(z) < 2.0))


@pytest.mark.parametrize(("seeds", "repeats", "noise", "memory", "unlike"), [
    pytest.param(SEEDS, 0.0, 1.0, 0.95, 0.0, id="noise alone"),
    pytest.param(SEEDS, 1.0, 0.1, 0.95, 0.0, id="it repeats"),
    *(pytest.param(MORE, *other, id=f"{name}, {MORE}", marks=pytest.mark.slow) for name, other in {
        "noise alone": (0.0, 1.0, 0.95, 0.0), "it repeats": (1.0, 0.1, 0.95, 0.0),
        "both": (1.0, 1.0, 0.95, 0.0), "white noise alone": (0.0, 1.0, 0.0, 0.0), "white, repeats": (1.0, 0.1, 0.0, 0.0),
        "noise, periods unlike": (0.0, 1.0, 0.95, 1.0), "both, periods unlike": (1.0, 1.0, 0.95, 1.0)}.items())])
def test_truth_lies_within_two_standard_deviations(seeds: int, repeats: float, noise: float, memory: float,
                                                   unlike: float) -> None:
    """In 92-98 % of all cases, of noise alone as well as of an error that is the same in every period."""
    z, _ = scores(seeds, repeats, noise, memory, unlike)
    assert 0.92 <= covered(z) <= 0.98
    assert 0.9 < z.std() < 1.1


@pytest.mark.parametrize(("phases", "periods", "memory"), [
    pytest.param(500, 8, 0.95, id="half a second"),
    pytest.param(400, 10, 0.8, id="400 phases", marks=pytest.mark.slow),
    pytest.param(1000, 5, 0.99, id="a memory of 100", marks=pytest.mark.slow),
    pytest.param(200, 20, 0.95, id="200 phases", marks=pytest.mark.slow)])
def test_noise_that_remembers_long_beside_a_period(phases: int, periods: int, memory: float) -> None:
    """Columns that jump from the end of a period to its beginning: turned alone would tell too little, and the larger holds."""
    period, alone, larger = problem(samples=phases), [], []
    one = Problem(np.tile(period.Y, (periods, 1, 1)), period.beta)
    for seed in range(SEEDS):
        blocks = one.blocks(one.clean + autoregressive(np.random.default_rng(seed), len(one.Y), memory))
        solution = fit(blocks).solution
        every = robust_covariance(blocks, solution, len(one.Y))
        own = robust_covariance(turned(blocks, phases=phases), solution, phases)
        alone.append((solution.beta - one.beta) / own.std)
        larger.append((solution.beta - one.beta) / own.at_least(every).std)
    assert np.std(alone) > 1.03
    assert 0.9 < np.std(larger) < 1.1
    assert covered(np.array(larger)) >= 0.92


def test_the_larger_of_two_is_a_covariance() -> None:
    """Deviations of the one or the other, correlations those of the first, what nothing shows infinite."""
    rng = np.random.default_rng(0)
    one, other = (Robust(x @ x.T, False, np.ones(4), ()) for x in rng.standard_normal((2, 4, 6)))
    one.covariance[3] = one.covariance[:, 3] = other.covariance[3] = other.covariance[:, 3] = np.inf
    both = one.at_least(other)
    np.testing.assert_allclose(both.std, np.maximum(one.std, other.std))
    assert not np.array_equal(both.std, one.std)
    correlation = [x.covariance[:3, :3] / x.std[:3] / x.std[:3, None] for x in (one, both)]
    np.testing.assert_allclose(correlation[0], correlation[1])
    np.testing.assert_allclose(both.inflation, np.append(both.std[:3] / one.std[:3], 1.0))


def test_what_repeats_is_no_news() -> None:
    """What the turn is for: four periods taken for independent tell deviations smaller by 2 than the scatter is."""
    z, pooled = scores(SEEDS, 1.0, 0.1, 0.95, 0.0)
    assert pooled.std() / z.std() == pytest.approx(np.sqrt(PERIODS), rel=0.1)
    assert covered(pooled) < 0.7


def test_against_the_covariance_of_a_known_error() -> None:
    """An AR(1) error in each of four periods and white noise beside it: C (M² Āᵀ V Ā + M σ² ĀᵀĀ) C, to some per cent."""
    memory, phases, noise = 0.9, 20_000, 2.0
    period = problem(samples=phases)
    rng = np.random.default_rng(0)
    y = np.tile(period.clean + autoregressive(rng, phases, memory), (PERIODS, 1)) + noise * white(rng, PERIODS * phases)
    blocks = Problem(np.tile(period.Y, (PERIODS, 1, 1)), period.beta).blocks(y, phases)
    found = solve(gather(blocks), weights=1 / SIGMA**2)
    robust = robust_covariance(turned(blocks, phases=phases), found, phases)
    meat = np.zeros_like(found.bread)
    for j in range(CHANNELS):
        a = period.Y[:, j] / SIGMA[j]
        meat += PERIODS * noise**2 * a.T @ a
        for lag in range(120):
            product = PERIODS**2 * memory**lag / (1 - memory**2) * a[lag:].T @ a[:phases - lag]
            meat += product if lag == 0 else product + product.T
    exact = np.sqrt(np.diag(found.bread @ meat @ found.bread))
    np.testing.assert_allclose(robust.std, exact, rtol=0.1)


def test_contrasts_are_those_of_helmert() -> None:
    """Phase by phase the equations times the orthogonal matrix that SciPy has, its first row the mean."""
    one = problem(samples=4 * 50)
    y = one.clean + white(np.random.default_rng(0), 200)
    out = list(turned(one.blocks(y, 70), phases=50))
    whole = np.einsum("km,mpj->kpj", helmert(4, full=True), y.reshape(4, 50, CHANNELS))
    means = [block for block in out if block.noise == of_mean(4)]
    assert len(means) == 1
    np.testing.assert_allclose(np.array(means[0].y).T, whole[0], atol=1e-12)
    rest = np.concatenate([np.array(block.y) for block in out if block.noise == CONTRAST], axis=1)
    np.testing.assert_allclose(np.abs(rest.T), np.abs(whole[1:].reshape(-1, CHANNELS)), atol=1e-12)


def test_a_turn_changes_no_estimate() -> None:
    """Gaps, equations left out of one channel, a phase that comes twice, a period cut short: the products stay what they were."""
    one, rng = problem(samples=430), np.random.default_rng(1)
    y = one.clean + white(rng, 430)
    phase = np.delete(np.arange(431) % 100, 40)
    phase[250] = phase[249]
    blocks = []
    for block in one.blocks(y, 110):
        used = tuple(rng.random((CHANNELS, block.samples)) > 0.2)
        blocks.append(Block(block.width, block.columns, tuple(v * u for v, u in zip(block.values, used, strict=True)),
                            tuple(v * u for v, u in zip(block.y, used, strict=True)), used))
    before, after = gather(blocks), gather(turned(blocks, phase, 100))
    np.testing.assert_allclose(after.gram, before.gram, atol=1e-10 * before.gram.max())
    np.testing.assert_array_equal(after.counts, before.counts)


@pytest.mark.parametrize("phases", [2, 9, 30])
def test_a_period_of_few_equations_is_no_obstacle(phases: int) -> None:
    """No autoregression looks further back than a block is long; noise that remembers for ten periods asks it to."""
    one = problem(samples=600)
    blocks = one.blocks(one.clean + autoregressive(np.random.default_rng(0), 600, 0.99))
    solution = fit(blocks).solution
    assert np.isfinite(robust_covariance(turned(blocks, phases=phases), solution, phases).std).all()


def test_what_repeats_nothing_passes_as_it_is() -> None:
    one = problem(samples=300)
    blocks = one.blocks(one.clean, 150)
    both = Contrasted(lambda: enumerate(blocks), (None, Cycle(np.arange(150) % 50, 50)))
    out = list(both)
    assert out[0] is blocks[0]
    assert [block.noise for block in out[1:]] == [CONTRAST, CONTRAST, of_mean(3)]
    assert both.longest(150) == 150


@pytest.mark.slow
@pytest.mark.parametrize(("way", "seeds"), [
    ("mean", SEEDS), ("mean", MORE // 2), ("every sample", MORE // 2)])
def test_logs_of_one_period_beside_one_of_several(way: str, seeds: int) -> None:
    """An error in each: what is told of both together holds, as it does where the log of several gives its mean alone.

    With one spectrum for all, that log would seem to be as near to the truth as its weight says.
    """
    one, logs = problem(samples=PHASES), 3
    told: dict[str, list[Array]] = {"its own": [], "one spectrum": []}
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        single = [one.blocks(one.clean + autoregressive(rng, PHASES))[0] for _ in range(logs)]
        y = np.tile(one.clean + autoregressive(rng, PHASES), (PERIODS, 1)) + 0.05 * white(rng, PERIODS * PHASES)
        turn = turned(repeating().blocks(y))
        blocks = [*single, *(block for block in turn if way == "every sample" or block.noise == of_mean(PERIODS))]
        found = fit(blocks).solution
        for spectrum, used in {"its own": blocks, "one spectrum": [replace(block, noise=0) for block in blocks]}.items():
            told[spectrum].append((found.beta - one.beta) / robust_covariance(used, found, PHASES).std)
    z = {spectrum: float(np.std(scores)) for spectrum, scores in told.items()}
    assert 0.9 < z["its own"] < 1.1
    assert z["one spectrum"] > 1.2


def test_logs_of_two_periods_beside_one_of_thirty() -> None:
    """√M times the same error: one spectrum of all means would be that of none of them."""
    counts = (2, 2, 30)
    one = problem(samples=PHASES)
    told: dict[str, list[Array]] = {"each": [], "one spectrum": []}
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        blocks = []
        for count in counts:
            noise = autoregressive(rng, PHASES) + 0.05 / np.sqrt(count) * white(rng, PHASES)
            (mean,) = Problem(np.sqrt(count) * one.Y, one.beta).blocks(np.sqrt(count) * (one.clean + noise))
            blocks.append(replace(mean, noise=of_mean(count)))
        found = fit(blocks).solution
        for way, used in {"each": blocks, "one spectrum": [replace(block, noise=MEAN) for block in blocks]}.items():
            told[way].append((found.beta - one.beta) / robust_covariance(used, found, PHASES).std)
    z = {way: float(np.std(scores)) for way, scores in told.items()}
    assert 0.9 < z["each"] < 1.1
    assert z["one spectrum"] > 1.4
