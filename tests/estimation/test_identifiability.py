"""What can be seen is called visible, what cannot is named."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.estimation.identifiability import (
    _resolved,
    condition_number,
    typical_size,
    unresolved,
    visible,
)
from pipelines.estimation.least_squares import Block, Solution, fit, gather, triangulate
from pipelines.io.log import Array
from tests.estimation.problems import WIDTH, problem, white

NAMES = [f"b{k}" for k in range(WIDTH)]


def solution(Y: Array, beta: Array, loudness: float = 0.01, seed: int = 0) -> Solution:
    noise = white(np.random.default_rng(seed), len(Y)) * loudness
    return fit([Block.of(Y, Y @ beta + noise)]).solution


@pytest.mark.parametrize("method", [gather, triangulate])
def test_condition_number_of_the_whole_matrix(method: type) -> None:
    """The condition of Φ is NumPy's, of all columns and of some, whatever their scales."""
    one = problem()
    scale = np.geomspace(1.0, 300.0, WIDTH)
    Y = one.Y * scale
    seen = method([Block.of(Y[k:k + 700], one.clean[k:k + 700]) for k in range(0, len(Y), 700)])
    assert condition_number(seen) == pytest.approx(np.linalg.cond(Y.reshape(-1, WIDTH)), rel=1e-6)
    assert condition_number(seen, [0, 3, 7]) == pytest.approx(np.linalg.cond(Y[:, :, [0, 3, 7]].reshape(-1, 3)), rel=1e-6)


def test_everything_seen() -> None:
    """A rich log leaves nothing to name."""
    one = problem()
    found = solution(one.Y, one.beta)
    assert _resolved(found, 1.0).sum() == WIDTH
    assert unresolved(found, NAMES).parameters == ()
    assert unresolved(found, NAMES).told({}) == ""


def test_exactly_dependent_columns_are_named() -> None:
    """A column that never acts, a column that repeats another, and one that is the sum of two: each group by name."""
    one = problem()
    Y = one.Y.copy()
    Y[:, :, 2] = 0.0
    Y[:, :, 5] = -3.0 * Y[:, :, 4]
    Y[:, :, 9] = Y[:, :, 7] + Y[:, :, 8]
    found = solution(Y, one.beta)
    named = unresolved(found, NAMES)
    assert _resolved(found, 1.0).sum() == WIDTH - 3
    assert named.never_moved == ("b2",)
    assert named.confused == (("b4", "b5"), ("b7", "b8", "b9"))
    assert named.parameters == ("b2", "b4", "b5", "b7", "b8", "b9")
    assert named.told({}) == "no sample shows b2; b4 and b5 cannot be separated; b7, b8 and b9 cannot be separated"


@pytest.mark.parametrize(("difference", "loudness", "rank"), [(1e-2, 0.01, WIDTH), (1e-2, 3.0, WIDTH), (1e-4, 3.0, WIDTH - 1),
                                                              (1e-5, 0.01, WIDTH), (1e-5, 3.0, WIDTH - 1)])
def test_noise_decides_what_is_dependent(difference: float, loudness: float, rank: int) -> None:
    """Columns that nearly repeat each other are told apart in a quiet log and not in a noisy one."""
    one = problem()
    Y = one.Y.copy()
    Y[:, :, 5] = Y[:, :, 4] + difference * Y[:, :, 5]
    found = solution(Y, one.beta, loudness)
    assert _resolved(found, 1.0).sum() == rank
    assert unresolved(found, NAMES).confused == ((("b4", "b5"),) if rank < WIDTH else ())


def test_visible_or_not() -> None:
    """A value that stands out of its noise is visible, also a zero that is known to be small beside its like."""
    value, std = np.array([1.0, 0.02, 0.0, 0.0, 2.0]), np.array([0.1, 0.02, 0.01, 0.3, np.inf])
    assert visible(value, std).tolist() == [True, False, False, False, False]
    typical = typical_size(value, std, ["kg"] * 5)
    np.testing.assert_allclose(typical, 1.0)
    assert visible(value, std, typical).tolist() == [True, True, True, False, False]
    assert visible(value, std, typical_size(value, std, ["kg", "m", "m", "m", "kg"])).tolist() == [True, False, False, False, False]
