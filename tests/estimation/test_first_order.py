"""The first-order lag against its closed form and scipy."""

from __future__ import annotations

import numpy as np
from scipy.signal import cont2discrete, lfilter

from pipelines.dynamics.first_order import held_mean, lagging, rate_of_change


def test_a_ramp_comes_late_by_the_time_constant() -> None:
    """x = c t gives c (t - T) + c T e^(-t/T), exactly, whatever the step."""
    t = np.arange(400.0) * 7e-3
    for time in (1e-6, 0.02, 3.0):
        expected = 5.0 * (t - time) + 5.0 * time * np.exp(-t / time)
        np.testing.assert_allclose(lagging(5.0 * t, t, time), expected, atol=1e-11)


def test_against_scipy() -> None:
    """A random signal, straight between the samples: scipy's first-order hold."""
    rng, h, time = np.random.default_rng(2), 1e-3, 4e-3
    x = np.concatenate([[0.0], rng.normal(size=5000)])
    b, a, _ = cont2discrete(([1.0], [time, 1.0]), h, method="foh")
    np.testing.assert_allclose(lagging(x, h * np.arange(len(x), dtype=np.float64), time), lfilter(b.ravel(), a, x), atol=1e-11)


def test_a_held_signal_is_averaged_over_each_sample() -> None:
    """Against the lag stepped a hundred times a sample."""
    rng, h, time, fine = np.random.default_rng(3), 1e-3, 5e-3, 100
    u = rng.normal(size=(300, 2))
    b, a, _ = cont2discrete(([1.0], [time, 1.0]), h / fine, method="zoh")
    y = lfilter(b.ravel(), a, np.repeat(u, fine, axis=0), axis=0)  # at the beginning of each step
    mean = (0.5 * (y[:-1] + y[1:]))[:299 * fine].reshape(299, fine, 2).mean(axis=1)
    np.testing.assert_allclose(held_mean(u, h, time)[:299], mean, atol=1e-5)
    np.testing.assert_array_equal(held_mean(u, h, 0.0), u)


def test_behind_a_gap_it_begins_anew() -> None:
    """What was before a gap is neither remembered nor differentiated."""
    t = np.concatenate([np.arange(100.0), 500.0 + np.arange(100.0)]) * 1e-3
    x = np.where(t < 0.3, 1.0, 7.0)
    np.testing.assert_allclose(lagging(x, t, 0.01), x, atol=1e-12)
    np.testing.assert_allclose(rate_of_change(x, t), 0.0, atol=1e-9)


def test_a_rate_of_change() -> None:
    """Of a sine, by central differences: h² x'''/6."""
    t = np.arange(2000.0) * 1e-3
    found = rate_of_change(np.sin(10.0 * t), t)
    np.testing.assert_allclose(found[1:-1], 10.0 * np.cos(10.0 * t[1:-1]), atol=2e-4)
