"""The paper's extended Kalman filter: its model against derivatives of its own, its filter against filterpy's."""

from __future__ import annotations

import cmath

import numpy as np
import pytest

from benchmarks.textbook_kalman import ExtendedTextbook
from pipelines.friction.ekf import EKF_NAMES, EkfStart, joint_step, run_ekf
from pipelines.friction.extended_filter import filter_extended
from tests.friction.one_joint import COSINE, ENCODER, INERTIA, SINE, recorded

TRUE = np.array([0.3, 0.8, 1.0 / INERTIA, SINE, 0.4, 1.2, -0.4, 120.0, 60.0, 12.0, 0.12, COSINE])


def complex_step(x: list[complex], u: float, step: float) -> list[complex]:
    """Two midpoint steps of eq. (10)-(11), in complex numbers."""
    q, v, theta, c, f1, f2, f3, w1, w2, w3, b = x[:11]
    d = x[11] if len(x) > 11 else 0.0
    h = step / 2.0

    def rate(q: complex, v: complex) -> complex:
        friction = sum(f * cmath.tanh(w * v) for f, w in ((f1, w1), (f2, w2), (f3, w3))) + b * v
        return theta * (u - c * cmath.sin(q) - d * cmath.cos(q) - friction)

    for _ in range(2):
        q_mid, v_mid = q + 0.5 * h * v, v + 0.5 * h * rate(q, v)
        q, v = q + h * v_mid, v + h * rate(q_mid, v_mid)
    return [q, v]


@pytest.mark.parametrize("states", [11, 12])
def test_derivatives_by_complex_step(states: int) -> None:
    """Every derivative of the next position and speed to 1e-12."""
    advance = joint_step(1e-3)
    rng = np.random.default_rng(2)
    for _ in range(5):
        x = TRUE[:states] * rng.uniform(0.5, 1.5, states) * np.where(np.arange(states) == 1, 0.02, 1.0)
        ahead, moving = advance(x, 1.3)
        np.testing.assert_allclose(ahead[:2], np.real(complex_step(x.astype(complex).tolist(), 1.3, 1e-3)), rtol=1e-14)
        np.testing.assert_array_equal(ahead[2:], x[2:])
        for i in range(states):
            moved = x.astype(complex)
            moved[i] += 1e-30j
            slope = np.imag(complex_step(moved.tolist(), 1.3, 1e-3)) / 1e-30
            np.testing.assert_allclose(moving[:, i], slope, rtol=1e-11, atol=1e-14)


def test_step_by_step_as_filterpy() -> None:
    """Eleven states over 1500 samples, some of them missing: equal at each step to 1e-9 of the largest of its kind."""
    log = recorded("three_sigmoid", 2)
    y, tau = log.q[:1500, 2].copy(), log.tau[:1500, 2]
    y[700:720] = np.nan
    mean = TRUE[:11] * np.array([0.0, 0.0, 0.85, 0.9, 0.8, 0.8, 0.8, 0.8, 0.8, 0.8, 1.2])
    covariance = np.diag(np.square(np.array([1e-5, 0.01, 2.0, 0.3, 0.4, 0.4, 0.4, 30.0, 20.0, 5.0, 0.05])))
    reach = np.array([5e-7, 1e-3]) * 0.2
    process = np.zeros((11, 11))
    process[:2, :2] = np.outer(reach, reach)
    advance, noise = joint_step(1e-3), (ENCODER / np.sqrt(12.0)) ** 2
    ours = filter_extended(advance, y, tau, mean, covariance, process, noise)
    theirs = ExtendedTextbook(advance, process, noise).filter(y, tau, mean, covariance)
    apart = np.abs(ours.states - theirs.states).max(axis=0) / np.abs(theirs.states).max(axis=0)
    assert apart.max() <= 1e-9, dict(zip(EKF_NAMES, apart, strict=False))
    assert np.isnan(ours.innovations[700:720]).all()
    assert np.abs(theirs.states[-1, 2:] - mean[2:]).max() > 1e-3, "the filter moved"


def test_it_finds_the_constants() -> None:
    """From 15 % off, one pass over 20 s: inertia and gravity to 1 %."""
    log = recorded("three_sigmoid", 3)
    std = np.array([ENCODER, 0.01, 2.0, 0.4, 0.3, 0.4, 0.2, 30.0, 20.0, 5.0, 0.05, 0.2])
    off = np.where(np.arange(12) < 2, 0.0, np.where(np.arange(12) % 2, 0.85, 1.15))
    found = run_ekf(log.q[:, 2], log.tau[:, 2], 1e-3, EkfStart(TRUE * off, std, 0.02, ENCODER / np.sqrt(12.0)))
    assert 1.0 / found.mean[2] == pytest.approx(INERTIA, rel=0.01)
    assert found.mean[3] == pytest.approx(SINE, rel=0.01)
    assert found.mean[11] == pytest.approx(COSINE, abs=0.01 * SINE)
