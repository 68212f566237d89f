"""Intervals of a difference of two errors contain the true one as often as they say."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.estimation.bootstrap import apart, wald
from pipelines.io.log import Array


def _blocks(rng: np.random.Generator, blocks: int, worse: float) -> tuple[Array, Array, Array]:
    """Residuals of two models with most of their noise in common, the second with `worse` times the noise of its own."""
    strength = rng.uniform(0.5, 2.0, (blocks, 1))  # some stretches are harder than others
    common, one, other = (strength * rng.standard_normal((blocks, 50)) for _ in range(3))
    ours, theirs = common + 0.3 * one, common + 0.3 * worse * other
    return np.square(ours).sum(axis=1), np.square(theirs).sum(axis=1), np.full(blocks, 5000.0)


@pytest.mark.parametrize("blocks", [10, 20])
@pytest.mark.parametrize("worse", [pytest.param(1.0, marks=pytest.mark.slow), 2.0])
def test_the_interval_covers_the_true_difference(worse: float, blocks: int) -> None:
    """95 % of 150 draws, nine in ten at least where the blocks are few and uneven. E Σr² = 50 E s² (1 + 0.09 w²), E s² = 1.75."""
    rng = np.random.default_rng(blocks)
    truth = np.sqrt(50.0 * 1.75 / 5000.0) * (np.sqrt(1.0 + 0.09 * worse**2) - np.sqrt(1.09))
    inside = 0
    for _ in range(150):
        low, high = apart(*_blocks(rng, blocks, worse), rng)
        inside += low < truth < high
    assert 0.90 <= inside / 150 <= 0.98


def test_a_difference_is_seen_that_scatter_of_each_would_hide() -> None:
    """The blocks are the same for both: errors that scatter by 7 % are told apart where they differ by 5 %."""
    rng = np.random.default_rng(0)
    found = [apart(*_blocks(rng, 20, 1.5), rng) for _ in range(50)]
    assert np.mean([low > 0.0 for low, _ in found]) > 0.6


def test_one_block_says_nothing() -> None:
    assert apart(np.ones(1), np.ones(1), np.ones(1), np.random.default_rng(0)) == (-np.inf, np.inf)


@pytest.mark.parametrize("count", [1, 2, 10])
def test_numbers_of_none_differ_from_none_by_chance_alone(count: int) -> None:
    """Together one in twenty: of ten the largest alone would pass its own bound four times in ten."""
    rng = np.random.default_rng(count)
    half = rng.standard_normal((count, count))
    numbers = rng.standard_normal((4000, count)) @ half
    passed = np.mean([wald(one, half.T @ half, 0.05) > 1.0 for one in numbers])
    assert passed == pytest.approx(0.05, abs=0.012)


def test_two_numbers_that_imitate_each_other_are_sure_together() -> None:
    """Each within its deviation, ±1, and their sum four of its deviations from none."""
    covariance = np.array([[1.0, -0.99], [-0.99, 1.0]])
    assert wald(np.array([0.3, 0.3]), covariance, 0.01) > 1.0
    assert wald(np.array([0.3, -0.3]), covariance, 0.01) < 0.1


def test_a_number_of_which_nothing_is_known_differs_from_nothing() -> None:
    assert wald(np.array([5.0]), np.zeros((1, 1)), 0.01) == 0.0
