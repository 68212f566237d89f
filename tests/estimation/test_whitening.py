"""Rows whose noise is white: what least squares of known noise make of them, by the Cholesky factor of its covariance."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import cholesky, solve_triangular, toeplitz
from scipy.signal import lfilter

from pipelines.estimation.candidate_columns import families, lay_family, whole_motion
from pipelines.estimation.estimate import Recipe
from pipelines.estimation.preparation import Logs, prepare
from pipelines.estimation.rows import Data, Whitening
from tests.diagnosis.arms import arm, hidden

ROWS = 4000
POLE = 0.95  # of a wander whose neighbours are nearly alike
SIZE = 0.3  # [N m]


def wander(rng: np.random.Generator, draws: int, rows: int = ROWS) -> Any:
    """(draws, rows) of an autoregression of first order, beside white noise of the same power."""
    slow = lfilter([np.sqrt(1.0 - POLE**2)], [1.0, -POLE], rng.standard_normal((draws, rows + 500)), axis=1)[:, 500:]
    return SIZE * np.sqrt(0.5) * (slow + rng.standard_normal((draws, rows)))


def covariance(rows: int) -> Any:
    return SIZE**2 * 0.5 * (toeplitz(POLE**np.arange(rows)) + np.eye(rows))


def rows_of(*stretches: slice, joints: int = 1) -> Any:
    """One log with rows of so many joints."""
    count = stretches[-1].stop
    weighed = np.ones((joints, count), dtype=bool)
    return SimpleNamespace(n_joints=joints, logs=[SimpleNamespace(n_joints=joints, rows=count, stretches=(stretches,) * joints,
                                                                  weighed=weighed)])


@pytest.fixture(scope="module")
def learnt() -> Whitening:
    return Whitening.of(rows_of(slice(0, ROWS)), wander(np.random.default_rng(1), 40))


def test_noise_is_white_and_keeps_its_size(learnt: Whitening) -> None:
    """Neighbours that shared half of their power share nothing, of noise that was not asked before."""
    x = learnt.through(wander(np.random.default_rng(2), 40), [0] * 40, [(slice(0, ROWS),)])
    shared = [np.mean(x[:, lag:] * x[:, :-lag]) / np.mean(x**2) for lag in range(1, 15)]
    np.testing.assert_allclose(shared, 0.0, atol=0.02)
    np.testing.assert_allclose(np.sqrt(np.mean(x**2)), SIZE, rtol=0.03)


def test_it_is_the_inverse_of_the_factor_of_the_covariance(learnt: Whitening) -> None:
    """From the first row of a stretch on, as the dense factor has it, but for what twenty rows do not tell of the ones before."""
    factor = cholesky(covariance(300), lower=True)
    x = wander(np.random.default_rng(3), 5, 300)
    dense = SIZE * solve_triangular(factor, x.T, lower=True).T
    np.testing.assert_allclose(learnt.through(x, [0] * 5, [(slice(0, 300),)]), dense, atol=0.06 * SIZE)


def test_a_quick_signal_is_told_better_by_far() -> None:
    """The scatter of an amplitude over a thousand draws is that of the best estimate there is (Aitken 1935), little more than half
    of that of plain least squares: of what moves slowly and at ten rows a period, the slow part tells least."""
    rng = np.random.default_rng(4)
    white = Whitening.of(rows_of(slice(0, ROWS)), wander(rng, 40))
    rows = 300
    i = np.arange(rows)
    signal = np.sin(2.0 * np.pi * i / 10.0) * (1.0 + 4.0 * (i > 200)) + 8.0 * np.cos(i / 60.0)
    draws = wander(rng, 1000, rows)
    plain = draws @ signal / (signal @ signal)
    one = white.through(signal[None], [0], [(slice(0, rows),)])[0]
    general = white.through(draws, [0] * 1000, [(slice(0, rows),)]) @ one / (one @ one)
    inverse = np.linalg.inv(covariance(rows))
    best = 1.0 / np.sqrt(signal @ inverse @ signal)
    assert np.std(general) < 0.6 * np.std(plain)
    np.testing.assert_allclose(np.std(general), best, rtol=0.08)


def test_stretches_do_not_tell_each_other_anything(learnt: Whitening) -> None:
    """Behind a gap rows begin anew, and each joint has a noise of its own."""
    x = wander(np.random.default_rng(5), 1, 200)
    whole = learnt.through(x, [0], [(slice(0, 120), slice(120, 200))])
    np.testing.assert_array_equal(whole[:, 120:], learnt.through(x[:, 120:], [0], [(slice(0, 80),)]))


def test_a_joint_without_noise_stays_as_it_is() -> None:
    two = rows_of(slice(0, 500), joints=2)
    found = Whitening.of(two, np.concatenate([wander(np.random.default_rng(6), 3, 500), np.zeros((3, 500))], axis=1))
    x = wander(np.random.default_rng(7), 1, 500)
    np.testing.assert_array_equal(found.through(x, [1], [(), (slice(0, 500),)]), x)


@pytest.fixture(scope="module", params=[0.0, 0.3])
def data(request: pytest.FixtureRequest) -> Data:
    """Of all rows, and of those of a joint that is not slow."""
    return prepare(Logs((hidden(1),)), Recipe(min_speed=(request.param,))).data


def test_rows_that_do_not_count_are_no_neighbours(data: Data) -> None:
    """Zeros in their place make no difference: a replica has them, a log has what it had."""
    whitening = Whitening.of(data, wander(np.random.default_rng(9), 6, data.rows))
    x = wander(np.random.default_rng(10), 3, data.rows)
    whole, masked = (np.where(data.counts, data.through(whitening, one), 0.0) for one in (x, np.where(data.counts, x, 0.0)))
    np.testing.assert_array_equal(whole, masked)


@pytest.mark.slow
def test_torque_and_columns_pass_alike(data: Data) -> None:
    """What is laid in whitened rows is what whitening makes of what is laid: of the arm's torque, and of the columns of every cause
    that is screened, one joint's or all."""
    whitening = Whitening.of(data, wander(np.random.default_rng(8), 6, data.rows))
    white = data.whitened(whitening)
    np.testing.assert_array_equal(white.y, data.through(whitening, data.y))
    np.testing.assert_allclose(white.lay(arm().torque), data.through(whitening, data.lay(arm().torque)), rtol=0.0, atol=1e-12)
    laws = arm().friction
    for family in families([law.effect for law in laws], whole_motion(data), arm()):
        if family.event:
            continue
        for plain, other in zip(lay_family(data, family, arm()), lay_family(white, family, arm()), strict=True):
            rows = np.zeros((plain.table.shape[0] * plain.table.shape[1], data.rows))
            rows[:, plain.rows] = plain.table.reshape(len(rows), -1)
            seen = np.zeros_like(rows)
            seen[:, other.rows] = other.table.reshape(len(rows), -1)
            scale = np.abs(rows).max() + 1e-12
            np.testing.assert_allclose(seen, data.through(whitening, rows), rtol=0.0, atol=1e-9 * scale, err_msg=family.cause)
