"""The smoother is the one of Rauch, Tung and Striebel, over gaps and at both ends."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from benchmarks.textbook_kalman import Textbook
from pipelines.errors import InputRejected
from pipelines.estimation.motion import twicing_growth
from pipelines.estimation.state_estimation import Start, design, observe, smooth
from tests.estimation.chains import assert_near, exact_smoother, swing, walk, with_gaps
from tests.seeds import rarely

T, STEP = 1e-3, 1e-5
R = STEP**2 / 12


@pytest.mark.parametrize("order", [2, *rarely(3), 4])
@pytest.mark.parametrize("jerk", [np.array([50.0, 500.0, 3770.0]), np.array([1.0, 1e5, 10.0])])
@pytest.mark.parametrize("gaps", [True, *rarely(False)])
def test_equal_to_filterpy(order: int, jerk: np.ndarray, gaps: bool) -> None:
    """Position, speed and acceleration to 1e-8 of their largest (a fourth state to 1e-7), at every sample, gaps and ends too."""
    y = swing(2000, 3, STEP)
    y = with_gaps(y) if gaps else y
    mean, covariance = np.zeros(order), np.diag([1e-6, 1.0, 1e3, 1e6][:order])
    sigma = jerk * T ** (3 - order)
    track = smooth(y, design(T, sigma, R, order), Start(np.tile(mean, (3, 1)), np.tile(covariance, (3, 1, 1))))
    for j in range(3):
        reference = Textbook(sigma[j], R, order).smooth(np.arange(2000) * T, y[:, j], mean, covariance)
        assert_near(track.states[:3, :, j].T, reference.states[:, :3], 1e-8)
        assert_near(track.states[:, :, j].T, reference.states, 1e-7)


@pytest.mark.parametrize("order", [2, 3, 4])
@pytest.mark.parametrize("missing", [[], [20, *range(30, 50), 51, 53], [0, 1, 79]])
@pytest.mark.parametrize("known", [False, True])
def test_states_and_deviations_against_fifty_digits(order: int, missing: list[int], known: bool) -> None:
    """Where filterpy's covariances have lost their digits (1e-7 and worse), ours have not: 1e-9; the fourth state 1e-8."""
    y, sigma = swing(80, 1, STEP), 500.0 * T ** (3 - order)
    y[missing, 0] = np.nan
    observer = design(T, sigma, R, order)
    mean, covariance = np.zeros(order), np.diag([1e-6, 1.0, 1e3, 1e6][:order])
    if not known:
        mean[0] = y[np.isfinite(y[:, 0]), 0][0]
        covariance = np.diag((1e5 * observer.unit[0] / observer.filter.step[0] ** np.arange(order)) ** 2)
    _, _, states, std = exact_smoother(y[:, 0], T, sigma, R, mean, covariance)
    track = smooth(y, observer, Start(mean[None], covariance[None]) if known else None)
    assert_near(track.states[:3, :, 0].T, states[:, :3], 1e-9)
    assert_near(track.states[:, :, 0].T, states, 1e-8)
    np.testing.assert_allclose(track.std[:, :, 0].T, std, rtol=1e-9)


def test_middle_does_not_hear_the_ends() -> None:
    """Standard deviations are constant away from ends and gaps."""
    y = swing(6000, 2, STEP)
    y[3000:3003, 0] = np.nan
    observer = design(T, np.array([500.0, 50.0]), R)
    std, reach = smooth(y, observer).std, observer.settled
    far = np.concatenate([std[:, reach:3000 - reach], std[:, 3003 + reach:6000 - reach]], axis=1)
    np.testing.assert_allclose(far, np.broadcast_to(observer.smoothed_std.T[:, None], far.shape), rtol=1e-12)


def test_claimed_deviation_is_the_real_one_and_below_the_observers() -> None:
    """On data made by the model the errors have the deviation claimed, within 6 %, a third of the observer's or less."""
    rng = np.random.default_rng(3)
    truth = np.stack([walk(rng, 3, 500.0, T, 4000) for _ in range(8)], axis=-1).transpose(1, 0, 2)
    y = truth[0] + rng.standard_normal(truth[0].shape) * np.sqrt(R)
    observer = design(T, np.full(8, 500.0), R)
    track = smooth(y, observer)
    error = (track.states - truth)[:, 200:-200]
    np.testing.assert_allclose(error.std(axis=(1, 2)), track.std[:, 2000, 0], rtol=0.06)
    assert (track.std[1:, 2000, 0] < observer.std[0, 1:] / 2).all()


def test_time_reversed_data_give_time_reversed_states() -> None:
    """Forward and backward are the same problem up to the half step by which the held jerk lies ahead: far below the deviation."""
    y = swing(4000, 1, STEP)
    observer = design(T, 500.0, R)
    forward, backward = smooth(y, observer).states[:, 500:-500, 0], smooth(y[::-1].copy(), observer).states[:, 500:-500, 0]
    std = observer.smoothed_std[0]
    assert np.sqrt(np.mean((forward[0] - backward[0, ::-1]) ** 2)) < 0.1 * std[0]
    assert np.sqrt(np.mean((forward[1] + backward[1, ::-1]) ** 2)) < 0.1 * std[1]


@pytest.mark.parametrize("samples", [2, 3, 31, 32, 33, 63, 64, 65])
def test_any_length(samples: int) -> None:
    """No length meets an edge of the blocks: observer and smoother agree at the last sample, where they know the same."""
    y = swing(samples, 2, STEP)
    observer = design(T, np.array([50.0, 3770.0]), R)
    causal, both = observe(y, observer), smooth(y, observer)
    assert_near(both.states[:, -1].T, causal.states[:, -1].T, 1e-7)
    np.testing.assert_allclose(both.std[:, -1], causal.std[:, -1], rtol=1e-7)


def test_infinite_measurements_are_refused() -> None:
    """An infinity is no missing sample."""
    with pytest.raises(InputRejected):
        smooth(np.array([[0.0], [np.inf], [0.0]]), design(T, 500.0, R))


@pytest.mark.slow
def test_a_log_longer_than_one_chunk() -> None:
    """Worked on chunk by chunk, observer and smoother of 50 000 samples give what filterpy gives near every joint of chunks."""
    y = swing(50_000, 1, STEP)
    y[30_000:30_003] = np.nan
    observer, mean, covariance = design(T, 500.0, R), np.zeros(3), np.diag([1e-6, 1.0, 1e3])
    start, book = Start(mean[None], covariance[None]), Textbook(500.0, R)
    for run, reference in ((observe, book.filter), (smooth, book.smooth)):
        expected = reference(np.arange(50_000) * T, y[:, 0], mean, covariance).states
        assert_near(run(y, observer, start).states[:, :, 0].T, expected, 1e-8)


@pytest.mark.parametrize("order", [2, 3, 4])
def test_a_second_pass_costs_what_it_says(order: int) -> None:
    """Noise of one and bias of a random chain, over all frequencies: S (1 - G)⁴ + R (1 - (1 - G)²)² against S (1 - G)² + R G²."""
    def variance(i: int, passes: int) -> float:
        def density(x: float) -> float:
            left = x ** (2 * order) / (1.0 + x ** (2 * order))  # 1 - G, with R = 1 and S = 1 / x^2n
            return float(x ** (2 * i) * ((left**passes) ** 2 / x ** (2 * order) + (1.0 - left**passes) ** 2))

        return float(quad(density, 0.0, 1.0)[0] + quad(density, 1.0, np.inf)[0])

    found = [np.sqrt(variance(i, 2) / variance(i, 1)) for i in range(order)]
    np.testing.assert_allclose(twicing_growth(order), found, rtol=1e-6)
