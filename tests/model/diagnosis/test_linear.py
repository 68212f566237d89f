"""Least squares around a solution, against the textbook's projections."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from pipelines.model.diagnosis.linear import covariance, deviations, solved, visibility


def _table(rows: int = 400, seed: int = 3) -> np.ndarray:
    """Four columns of very different size; the fourth is the sum of the first two but for a thousandth."""
    rng = np.random.default_rng(seed)
    table = rng.standard_normal((4, rows)) * np.array([[1.0], [1e3], [1e-4], [1.0]])
    table[3] = table[0] + 1e-3 * table[1] + 1e-3 * table[3]
    return table


def test_visibility_is_what_the_projection_on_the_other_columns_leaves() -> None:
    table = _table()
    for place, eta in zip((0, 2, 3), visibility(table, (0, 2, 3)), strict=True):
        others = scipy.linalg.orth(np.delete(table, place, axis=0).T)
        left = table[place] - others @ (others.T @ table[place])
        assert np.isclose(eta, np.linalg.norm(left) / np.linalg.norm(table[place]), rtol=1e-6)


def test_a_column_that_others_are_as_well_is_not_seen() -> None:
    table = _table()
    table[3] = table[0] + 1e-3 * table[1]
    assert visibility(table, (3,))[0] < 1e-6
    assert visibility(table, (2,))[0] > 0.9


def test_the_step_is_scipys_least_squares() -> None:
    table = _table()
    y = np.random.default_rng(1).standard_normal(table.shape[1])
    expected, *_ = scipy.linalg.lstsq(table.T, y)
    assert np.allclose(solved(table, y), expected, rtol=1e-6)


def test_equal_columns_share_what_they_explain() -> None:
    column = np.random.default_rng(2).standard_normal(50)
    assert np.allclose(solved(np.stack([column, column]), 2.0 * column), [1.0, 1.0])


def test_deviations_are_those_that_repeated_noise_shows() -> None:
    """Moving-average noise of 5 rows on slow columns: plain least squares would say far too little."""
    rng = np.random.default_rng(0)
    phase = np.linspace(0.0, 60.0, 6000)
    table = np.stack([np.sin(phase), np.ones_like(phase)])
    found, said = [], []
    for _ in range(200):
        noise = np.convolve(rng.standard_normal(phase.size + 4), np.ones(5) / 5**0.5, "valid")
        found.append(solved(table, noise))
        said.append(deviations(table, noise - found[-1] @ table))
    assert np.allclose(np.mean(said, axis=0), np.std(found, axis=0), rtol=0.15)
    assert np.allclose(np.diag(covariance(table, noise)), deviations(table, noise) ** 2)
