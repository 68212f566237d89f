"""The observer is the Kalman filter, from its first sample on and through every gap."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from benchmarks.textbook_kalman import Textbook
from pipelines.errors import InputRejected, UsageError
from pipelines.estimation.chain import held_input, lyapunov, stationary, transition
from pipelines.estimation.state_estimation import Start, design, observe
from tests.estimation.chains import assert_near, exact_smoother, swing, with_gaps
from tests.seeds import rarely

T, STEP = 1e-3, 1e-5
R = STEP**2 / 12
JERK = [np.array([50.0, 500.0, 3770.0]), np.array([1.0, 1e5, 10.0])]


def known_start(order: int) -> tuple[np.ndarray, np.ndarray]:
    return np.zeros(order), np.diag([1e-6, 1.0, 1e3, 1e6][:order])


@pytest.mark.parametrize("order", [2, 3, 4])
@pytest.mark.parametrize("index", [1e-8, 1e-4, 1e-2, 1.0, 30.0, 1600.0])
def test_gain_solves_the_riccati_equation(order: int, index: float) -> None:
    """Gain and covariance equal scipy's solution of the discrete algebraic Riccati equation."""
    f = stationary(order, np.array([index]))
    reach = held_input(order, f.step)[0] * index / f.step[0] ** order
    p = solve_discrete_are(transition(order, f.step)[0].T, np.eye(order)[:, :1], np.outer(reach, reach), np.eye(1))
    np.testing.assert_allclose(f.prior[0], p, rtol=1e-9)
    np.testing.assert_allclose(f.gain[0], p[:, 0] / (p[0, 0] + 1.0), rtol=1e-9)


def test_reference_gains_transfer_functions_and_run(vectors: dict[str, Any]) -> None:
    """Gains, transfer functions and 300 samples that filterpy computed elsewhere."""
    known = vectors["kalman"]
    observer = design(known["Ts"], known["sigma_jerk"], known["R"])
    np.testing.assert_allclose(observer.gain[0], known["k"], rtol=1e-9)
    hz = np.geomspace(0.1, 499.0, 60)
    late = np.exp(-2j * np.pi * np.outer(hz, np.arange(4)) * known["Ts"])
    expected = np.stack([late @ known[name] for name in ("num_q", "num_v", "num_a")], axis=1) / (late @ known["den"])[:, None]
    found = observer.response(hz)[:, 0]
    assert_near(found, expected, 1e-9)
    # the stationary run: the prior is the stationary one, so nothing has to settle
    f, unit = observer.filter, observer.unit[0]
    start = Start(np.zeros((1, 3)), (f.prior[0] * np.outer(unit, unit))[None])
    states = observe(np.array(known["y"])[:, None], observer, start).states[:, :, 0].T
    np.testing.assert_allclose(states, known["xbar"], atol=0, rtol=1e-8)


def test_bandwidth_and_noise_of_the_verified_table() -> None:
    """verified.md, section 5: σ, bandwidth at -3 dB, peak, and noise of the acceleration."""
    observer = design(T, np.array([1.0, 50.0, 500.0, 3770.0]), R)
    np.testing.assert_allclose(observer.bandwidth_hz, [31, 105, 207, 388], rtol=0.015)
    np.testing.assert_allclose(np.abs(observer.response(np.geomspace(1, 499, 4000))[:, :, 0]).max(axis=0),
                               [1.54, 1.44, 1.31, 1.16], rtol=0.005)
    f = observer.filter  # what passes of white noise R
    spread = lyapunov(f.updater @ f.transition, f.gain[:, :, None] * f.gain[:, None, :])
    noise_std = np.sqrt(np.einsum("njj->nj", spread)) * observer.unit
    np.testing.assert_allclose(noise_std[:, 2], [0.0022, 0.057, 0.38, 2.0], rtol=0.02)


@pytest.mark.parametrize("order", [2, *rarely(3), 4])
@pytest.mark.parametrize("jerk", JERK)
@pytest.mark.parametrize("gaps", [True, *rarely(False)])
def test_equal_to_filterpy_step_by_step(order: int, jerk: np.ndarray, gaps: bool) -> None:
    """States to 1e-8 of their largest, standard deviations to 1e-8, over the whole run: start, gaps and end included."""
    y = swing(2000, 3, STEP)
    y = with_gaps(y) if gaps else y
    mean, covariance = known_start(order)
    sigma = jerk * T ** (3 - order)
    track = observe(y, design(T, sigma, R, order), Start(np.tile(mean, (3, 1)), np.tile(covariance, (3, 1, 1))))
    std = track.std
    for j in range(3):
        reference = Textbook(sigma[j], R, order).filter(np.arange(2000) * T, y[:, j], mean, covariance)
        assert_near(track.states[:, :, j].T, reference.states, 1e-8)
        np.testing.assert_allclose(std[:, :, j].T, np.sqrt(np.einsum("kii->ki", reference.covariance)), rtol=1e-8)


def test_diffuse_start_against_fifty_digits() -> None:
    """A start that knows nothing keeps its digits, though its covariance is 1e10 times the noise, and so do gaps after it.

    From the third sample on the states agree to 1e-9; the two before it, which know no acceleration yet, to 1e-5 of their
    own deviation.
    """
    y = swing(60, 1, STEP)
    y[[20, *range(30, 40), 52], 0] = np.nan
    observer = design(T, 500.0, R)
    spread = np.diag((1e5 * observer.unit[0] / observer.filter.step[0] ** np.arange(3)) ** 2)
    states, std, _, _ = exact_smoother(y[:, 0], T, 500.0, R, np.array([y[0, 0], 0.0, 0.0]), spread)
    track = observe(y, observer)
    assert_near(track.states[:, 2:, 0].T, states[2:], 1e-9)
    assert (np.abs(track.states[:, :2, 0].T - states[:2]) <= 1e-5 * std[:2]).all()
    np.testing.assert_allclose(track.std[:, :, 0].T, std, rtol=1e-7)


def test_missing_samples_are_predicted_not_interpolated() -> None:
    """Through a gap the speed of order 2 stays what it was before the gap, whatever comes after it."""
    y = swing(1000, 1, STEP)
    y[400:420] = np.nan
    other = y.copy()
    other[420:] += 1.0
    observer = design(T, 1.0, R, order=2)
    first, second = observe(y, observer).states, observe(other, observer).states
    assert np.array_equal(first[:, :420], second[:, :420])
    np.testing.assert_allclose(first[1, 400:420, 0], first[1, 399, 0], rtol=1e-12)


def test_claimed_deviation_is_the_real_one() -> None:
    """On chains driven as the model says, the error of every state has the standard deviation claimed, within 3 %."""
    rng = np.random.default_rng(11)
    n, joints = 4000, 40
    xi = rng.standard_normal((n, joints)) * 500.0
    # exact chain of three integrators, by sums of its held input
    a = np.cumsum(np.vstack([np.zeros(joints), xi[:-1]]), axis=0) * T
    v = np.cumsum(np.vstack([np.zeros(joints), a[:-1] * T + xi[:-1] * T**2 / 2]), axis=0)
    q = np.cumsum(np.vstack([np.zeros(joints), v[:-1] * T + a[:-1] * T**2 / 2 + xi[:-1] * T**3 / 6]), axis=0)
    track = observe(q + rng.standard_normal(q.shape) * np.sqrt(R), design(T, np.full(joints, 500.0), R))
    error = track.states - np.stack([q, v, a])
    np.testing.assert_allclose(error[:, 200:].std(axis=(1, 2)), track.std[:, 1000, 0], rtol=0.03)


def test_a_constant_is_followed_exactly() -> None:
    """An offset of six million steps costs the speeds and accelerations nothing but the rounding of the measurement."""
    y = swing(3000, 2, STEP)
    observer = design(T, np.array([50.0, 5e3]), R)
    found, expected = (observe(q, observer).states[1:, 50:].transpose(1, 0, 2) for q in (y + 64.0, y))
    assert_near(found, expected, 1e-8)


@pytest.mark.parametrize(("y", "code"), [
    (np.zeros((1, 1)), "T08"), (np.array([[0.0], [np.inf], [np.nan]]), "D03"), (np.full((9, 1), np.nan), "D02"),
])
def test_bad_measurements_are_refused(y: np.ndarray, code: str) -> None:
    """Too few samples, infinities and dead channels are named, not filtered."""
    with pytest.raises(InputRejected) as caught:
        observe(y, design(T, 500.0, R))
    assert caught.value.code == f"RRID-{code}"


@pytest.mark.parametrize("bad", [{"order": 5}, {"jerk_std": -1.0}, {"noise_variance": 0.0}, {"jerk_std": np.nan},
                                 {"jerk_std": np.inf}, {"sample_time": 0.0}])
def test_bad_settings_are_refused(bad: dict[str, Any]) -> None:
    """No observer comes of numbers out of range."""
    with pytest.raises(UsageError):
        design(**({"sample_time": T, "jerk_std": 500.0, "noise_variance": R} | bad))
