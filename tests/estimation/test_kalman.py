"""The textbook filter: closed forms, uneven sampling and missing samples."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.textbook_kalman import Textbook
from tests.estimation.chains import exact_smoother, swing


def test_one_measurement_is_a_weighted_mean() -> None:
    """The first update: x = P / (P + R) y."""
    states = Textbook(1.0, 4.0, 2).filter(np.array([0.0, 1.0]), np.array([10.0, np.nan]), np.zeros(2), np.diag([1.0, 1.0])).states
    assert states[0, 0] == pytest.approx(2.0, rel=1e-14)


def test_smoother_against_fifty_digits() -> None:
    """Even steps with missing samples: filterpy's smoother, given the steps in its own order, is the textbook's."""
    y = swing(50, 1, 1e-5)[:, 0]
    y[[10, 11, 30]] = np.nan
    covariance = np.diag([1e-6, 1.0, 1e3])
    _, _, states, _ = exact_smoother(y, 1e-3, 500.0, 1e-11, np.zeros(3), covariance)
    found = Textbook(500.0, 1e-11).smooth(np.arange(50) * 1e-3, y, np.zeros(3), covariance).states
    np.testing.assert_allclose(found / np.abs(states).max(axis=0), states / np.abs(states).max(axis=0), rtol=0, atol=1e-9)


def test_a_skipped_time_is_a_step_twice_as_long_for_a_chain_without_noise() -> None:
    """Uneven steps: a parabola sampled unevenly comes out as its position, speed and acceleration."""
    t = np.cumsum(np.random.default_rng(1).uniform(0.5e-3, 2e-3, 400))
    y = 0.3 + 2.0 * t - 4.0 * t**2
    track = Textbook(1e-3, 1e-12).smooth(t, y, np.array([y[0], 0.0, 0.0]), np.diag([1e-6, 1e2, 1e4]))
    np.testing.assert_allclose(track.states, np.stack([y, 2.0 - 8.0 * t, np.full(400, -8.0)], axis=1), rtol=0, atol=2e-4)
