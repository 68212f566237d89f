"""Least squares around a solution, against the textbook's projections."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.signal

from pipelines.estimation.model_fit import covariance, left_out, solved, superfluous


def _table(rows: int = 400, seed: int = 3) -> np.ndarray:
    """Four columns of very different size; the fourth is the sum of the first two but for a thousandth."""
    rng = np.random.default_rng(seed)
    table = rng.standard_normal((4, rows)) * np.array([[1.0], [1e3], [1e-4], [1.0]])
    table[3] = table[0] + 1e-3 * table[1] + 1e-3 * table[3]
    return table


def test_a_column_is_superfluous_where_the_projection_on_the_others_leaves_less() -> None:
    table = _table()
    for place in (0, 2, 3):
        others = scipy.linalg.orth(np.delete(table, place, axis=0).T)
        left = table[place] - others @ (others.T @ table[place])
        seen = float(np.linalg.norm(left) / np.linalg.norm(table[place]))
        assert superfluous(table, (place,), 1.001 * seen) == [place]
        assert superfluous(table, (place,), 0.999 * seen) == []


def test_a_column_that_others_are_as_well_is_superfluous() -> None:
    table = _table()
    table[3] = table[0] + 1e-3 * table[1]
    assert superfluous(table, (3,), 1e-6) == [3]
    assert superfluous(table, (2,), 0.9) == []


def test_of_columns_that_are_the_same_together_one_goes() -> None:
    """Powers of an angle far from zero: none is seen beside all the others, and without one of them the rest is."""
    angle = np.linspace(1.9, 2.1, 500)
    powers = np.stack([angle**power for power in range(4)])
    assert superfluous(powers, (0, 1, 2, 3), 1e-4) != [0, 1, 2, 3]
    kept = np.delete(powers, superfluous(powers, (0, 1, 2, 3), 1e-4), axis=0)
    assert superfluous(kept, range(len(kept)), 1e-4) == []
    assert np.linalg.matrix_rank(kept) == len(kept) >= 2


def test_the_step_is_scipys_least_squares() -> None:
    table = _table()
    y = np.random.default_rng(1).standard_normal(table.shape[1])
    expected, *_ = scipy.linalg.lstsq(table.T, y)
    assert np.allclose(solved(table, y), expected, rtol=1e-6)


def test_equal_columns_share_what_they_explain() -> None:
    column = np.random.default_rng(2).standard_normal(50)
    assert np.allclose(solved(np.stack([column, column]), 2.0 * column), [1.0, 1.0])


def _deviations(table: np.ndarray, residual: np.ndarray) -> np.ndarray:
    return np.sqrt(np.diag(covariance(table, residual)))


def test_deviations_are_those_that_repeated_noise_shows() -> None:
    """Moving-average noise of 5 rows on slow columns: plain least squares would say far too little."""
    rng = np.random.default_rng(0)
    phase = np.linspace(0.0, 60.0, 6000)
    table = np.stack([np.sin(phase), np.ones_like(phase)])
    found, said = [], []
    for _ in range(200):
        noise = np.convolve(rng.standard_normal(phase.size + 4), np.ones(5) / 5**0.5, "valid")
        found.append(solved(table, noise))
        said.append(_deviations(table, noise - found[-1] @ table))
    assert np.allclose(np.mean(said, axis=0), np.std(found, axis=0), rtol=0.15)


def _repeated(lacking: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How two coefficients scatter over repetitions, and what noise alone and blocks left out say of that, on the mean; a law that
    the model lacks pulls by so much in another direction every 60 rows."""
    rng = np.random.default_rng(0)
    phase = np.linspace(0.0, 300.0, 6000)
    table = np.stack([np.sin(phase), np.ones_like(phase)])
    blocks = np.arange(phase.size) * 30 // phase.size
    found, noise, left = [], [], []
    for _ in range(200):
        slow = np.repeat(rng.standard_normal((2, 100)), 60, axis=1)  # for a third of a block, and of three times the lags
        y = rng.standard_normal(phase.size) + lacking * np.sum(slow * table, axis=0)
        found.append(solved(table, y))
        rest = y - found[-1] @ table
        noise.append(_deviations(table, rest))
        left.append(left_out(table, rest, blocks))
    return np.std(found, axis=0), np.mean(noise, axis=0), np.mean(left, axis=0)


def test_blocks_left_out_tell_what_a_law_lacks() -> None:
    """Coefficients that other time asks for otherwise: neighbouring rows tell two thirds of the scatter, blocks all."""
    scatter, noise, left = _repeated(lacking=0.5)
    assert (noise < 0.75 * scatter).all()
    np.testing.assert_allclose(left, scatter, rtol=0.1)


def test_of_noise_alone_blocks_left_out_tell_as_much() -> None:
    scatter, noise, left = _repeated(lacking=0.0)
    np.testing.assert_allclose(noise, scatter, rtol=0.1)
    np.testing.assert_allclose(left, scatter, rtol=0.1)


def test_blocks_left_out_are_refits_without_them() -> None:
    """To first order it is the very refit: the model is linear."""
    table, rng = _table()[:3], np.random.default_rng(5)
    y = rng.standard_normal(table.shape[1])
    blocks = np.arange(table.shape[1]) * 8 // table.shape[1]
    whole = solved(table, y)
    refits = np.array([scipy.linalg.lstsq(table[:, blocks != b].T, y[blocks != b])[0] for b in range(8)])
    expected = np.sqrt(7.0 / 8.0 * np.sum((refits - refits.mean(axis=0)) ** 2, axis=0))
    np.testing.assert_allclose(left_out(table, y - whole @ table, blocks), expected, rtol=1e-6)


def test_what_one_block_alone_tells_has_no_say() -> None:
    """A column that is zero but in one block: the others do not move it, and noise is all that is known of it."""
    table = np.stack([np.ones(400), np.where(np.arange(400) < 50, 1.0, 0.0)])
    residual = np.random.default_rng(6).standard_normal(400)
    residual -= solved(table, residual) @ table
    found = left_out(table, residual, np.arange(400) // 50)
    assert np.isfinite(found).all()


@pytest.mark.parametrize("rows", [400, 21, 20, 9, 2])
def test_the_covariance_is_the_sum_of_newey_and_west(rows: int) -> None:
    """Products of rows up to 20 apart, one by one, fewer where there are no more:

        C Σ_t Σ_s max(0, 1 - |t - s| / 21) r_t r_s x_t x_sᵀ C,    C = (Σ_t x_t x_tᵀ)⁻¹
    """
    rng = np.random.default_rng(4)
    table = rng.standard_normal((2, rows)) * np.array([[1.0], [1e3]])
    residual = scipy.signal.lfilter([1.0], [1.0, -0.9], rng.standard_normal(rows))
    meat = np.zeros((2, 2))
    for t in range(rows):
        for s in range(max(0, t - 20), min(rows, t + 21)):
            meat += (1.0 - abs(t - s) / 21.0) * residual[t] * residual[s] * np.outer(table[:, t], table[:, s])
    bread = np.linalg.inv(table @ table.T)
    expected, found = bread @ meat @ bread, covariance(table, residual)
    size = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(found / size / size[:, None], expected / size / size[:, None], atol=1e-9)
