"""Median, quantile, order and distinct values as NumPy gives them, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.io.order_statistics import distinct, in_order, median, quantile


@pytest.mark.parametrize("count", [1, 2, 3, 4, 10, 999, 10000])
@pytest.mark.parametrize("axis", [0, 1])
def test_the_median_is_numpys(count: int, axis: int) -> None:
    """Of odd and even counts, along either axis, with repeated, infinite and undefined values."""
    rng = np.random.default_rng([3, count])
    x = np.round(rng.standard_normal((count, 7)), 2)
    x[:, 5] = np.inf
    x[count // 2, 6] = np.nan
    x = x if axis == 0 else x.T.copy()
    assert median(x, axis).tobytes() == np.median(x, axis=axis).tobytes()


@pytest.mark.parametrize("count", [1, 2, 3, 100, 101, 9999])
@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.75, 0.9, 0.99, 1.0])
def test_a_quantile_is_numpys(count: int, share: float) -> None:
    """Along either axis, with repeated and undefined values."""
    x = np.round(np.random.default_rng([4, count]).standard_normal((count, 5)), 3)
    x[count // 3, 4] = np.nan
    assert quantile(x, share).tobytes() == np.quantile(x, share, axis=0).tobytes()
    assert quantile(x.T, share, 1).tobytes() == np.quantile(x.T, share, axis=1).tobytes()


def test_nothing_has_no_median() -> None:
    """Not a number, without a warning."""
    for found in (median(np.zeros((0, 2))), quantile(np.zeros((0, 2)), 0.9)):
        assert np.isnan(found).tolist() == [True, True]
    assert np.isnan(median(np.zeros(0)))


@pytest.mark.parametrize("few", range(1, 8))
def test_a_few_arrays_in_order(few: int) -> None:
    """As np.sort has them, infinite ones too; where one of them is undefined, all are."""
    x = np.round(np.random.default_rng([5, few]).standard_normal((few, 500, 2)), 1)
    x[few // 2, :20], x[0, 10:40] = np.inf, -np.inf
    assert np.array_equal(np.stack(in_order(x)), np.sort(x, axis=0))
    for k in range(few):
        y = x.copy()
        y[k, 7] = np.nan
        found = np.stack(in_order(y))
        assert np.isnan(found[:, 7]).all()
        assert np.isfinite(found[:, 50:]).all()


def test_distinct_values_are_numpys() -> None:
    """Sorted, each once; of zeros with two signs one; of nothing nothing; of any shape and kind."""
    rng = np.random.default_rng(3)
    for x in (np.round(rng.standard_normal((50, 40)), 1), np.array([0.0, -0.0, 0.0]), np.zeros(0), rng.integers(0, 9, 30)):
        found = distinct(x)
        assert found.tolist() == np.unique(x).tolist()
        assert found.dtype == x.dtype
