"""Tuning finds the jerk level that made the data, the bandwidth asked for, and says what it cannot tell."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import kstest

from pipelines.errors import InputRejected, UsageError
from pipelines.estimation.state_estimation import design, observe, smooth
from pipelines.estimation.tuning import (
    innovations,
    sigma_for_bandwidth,
    smoother_bandwidth,
    tune,
    whiteness,
)
from tests.estimation.chains import walk
from tests.seeds import seeds

T = 1e-3


def rounded(q: np.ndarray, step: float) -> np.ndarray:
    return np.asarray(np.round(q / step) * step)


def excitation(samples: int = 10_000) -> np.ndarray:
    """Position, speed and acceleration (3, samples) of the paper's kind of excitation: 100 harmonics of 0.1 Hz, 43 rad/s²."""
    rng, t = np.random.default_rng(5), np.arange(samples) * T
    w = 0.2 * np.pi * np.arange(1, 101)
    a, b = rng.standard_normal((2, 100, 1)) / w[:, None] * 0.3
    c, s = np.cos(w[:, None] * t), np.sin(w[:, None] * t)
    w = w[:, None]
    return np.stack([(a * s + b * c).sum(0), (w * (a * c - b * s)).sum(0), (-w * w * (a * s + b * c)).sum(0)])


@pytest.mark.parametrize(("order", "sigma"), [(2, 0.5), (2, 30.0), (3, 5.0), (3, 500.0), (3, 3e4), (4, 5e3), (4, 5e5), (4, 3e7)])
@pytest.mark.parametrize("seed", seeds(3))
def test_the_jerk_that_made_the_data_is_found(order: int, sigma: float, seed: int) -> None:
    """10 s at 1 kHz with a 1e-5 rad encoder: within a factor 1.5 by likelihood and by cross-validation alike."""
    q = walk(np.random.default_rng(seed), order, sigma, T, 10_000)[:, :1]
    for tuned in tune(rounded(q, 1e-5), T, 1e-5, order):
        assert 1 / 1.5 < tuned.jerk_std[0] / sigma < 1.5
        assert tuned.noise_variance[0] == pytest.approx(1e-10 / 12)


@pytest.mark.parametrize("seed", [3, 4])
def test_a_coarser_or_noisier_encoder_is_noticed(seed: int) -> None:
    """D08: said to count 1e-5 rad, it counts 1e-3, or has 1e-4 rad of noise: R within 20 %, jerk within a factor 1.5."""
    rng = np.random.default_rng(seed)
    q = walk(rng, 3, 500.0, T, 10_000)[:, :1]
    both = np.hstack([rounded(q, 1e-3), q + 1e-4 * rng.standard_normal(q.shape)])
    for tuned in tune(both, T, 1e-5):
        np.testing.assert_allclose(tuned.noise_variance, [1e-6 / 12, 1e-8], rtol=0.2)
        assert (np.abs(np.log(tuned.jerk_std / 500.0)) < np.log(1.5)).all()


def test_standing_still_is_left_out() -> None:
    """10 s of standing before and after do not change what 10 s of motion say; a channel that never moves has a level as well."""
    q = walk(np.random.default_rng(1), 3, 500.0, T, 10_000)[:, 0]
    long = np.concatenate([np.full(10_000, q[0]), q, np.full(10_000, q[-1])])
    tuned = tune(rounded(np.stack([long, 0 * long], axis=1), 1e-5), T, 1e-5)[0]
    assert 1 / 1.5 < tuned.jerk_std[0] / 500.0 < 1.5
    assert np.isfinite(tuned.jerk_std).all()


def test_missing_samples_do_not_stop_the_tuning() -> None:
    """The longest stretch without gaps is used; with none long enough, it is refused in words."""
    q = rounded(walk(np.random.default_rng(1), 3, 500.0, T, 10_000)[:, :1], 1e-5)
    q[1000::4000] = np.nan
    assert 1 / 1.5 < tune(q, T, 1e-5)[0].jerk_std[0] / 500.0 < 1.5
    q[::50] = np.nan
    with pytest.raises(InputRejected, match="T04"):
        tune(q, T, 1e-5)


@pytest.mark.parametrize(("step", "best"), [(1e-5, 0.08), (1e-4, 0.3), (1e-3, 1.2)])
def test_cross_validation_serves_the_smoother_on_an_excitation(step: float, best: float) -> None:
    """On the paper's kind of excitation the smoother so tuned reaches the acceleration, five times nearer than by likelihood."""
    motion = excitation()
    y = rounded(motion[0], step)[:, None]
    errors = []
    for tuned in tune(y, T, step)[::-1]:
        states = smooth(y, design(T, tuned.jerk_std, tuned.noise_variance)).states[2, 500:-500, 0]
        errors.append((states - motion[2, 500:-500]).std())
    assert errors[0] < best
    assert errors[0] < errors[1] / (5.0 if step == 1e-5 else 1.5)


def test_likelihood_serves_the_observer_on_an_excitation() -> None:
    """The causal acceleration is best, within 15 %, at the level that the likelihood chooses."""
    motion = excitation()
    y = rounded(motion[0], 1e-5)[:, None]
    sigma = tune(y, T, 1e-5)[0].jerk_std[0]
    error = [(observe(y, design(T, s, 1e-10 / 12)).states[2, 500:, 0] - motion[2, 500:]).std()
             for s in sigma * np.geomspace(1 / 30, 30, 13)]
    assert error[6] < 1.15 * min(error)


@pytest.mark.parametrize("order", [2, 3, 4])
def test_bandwidth_is_the_one_asked_for(order: int) -> None:
    """Amplitude of a sine at the asked frequency: 1/√2 within 2 % of the frequency, for the observer and for the smoother."""
    hz = np.array([5.0, 30.0, 105.0, 300.0])
    t = np.arange(20_000) * T
    observer = design(T, sigma_for_bandwidth(hz, T, 1e-11, order), 1e-11, order)
    np.testing.assert_allclose(observer.bandwidth_hz, hz, rtol=1e-6)
    for run, asked in ((observe, hz), (smooth, smoother_bandwidth(observer))):
        phase, middle = 2 * np.pi * asked * t[:, None], slice(8000, 12_000)
        passed = run(np.sin(phase), observer).states[0, middle]
        for j, x in enumerate(phase[middle].T):
            waves = np.stack([np.sin(x), np.cos(x)], axis=1)
            amplitude = np.linalg.norm(np.linalg.lstsq(waves, passed[:, j], rcond=None)[0])
            # the slope of a first-order filter there is -1/2: 2 % of frequency are 1 % of amplitude or more
            np.testing.assert_allclose(amplitude, np.sqrt(0.5), rtol=0.005)


@pytest.mark.parametrize("hz", [0.0, 500.0, -3.0, np.nan])
def test_a_bandwidth_out_of_reach_is_refused(hz: float) -> None:
    """Nothing at or above half the rate, nothing below zero."""
    with pytest.raises(UsageError):
        sigma_for_bandwidth(hz, T, 1e-11)


def test_whiteness_is_standard_normal_for_white_noise_and_large_for_coloured() -> None:
    """400 white channels, one in twenty samples missing: the statistic passes Kolmogorov-Smirnov against χ². Coloured: far out."""
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((3000, 400))
    noise[rng.random(noise.shape) < 0.05] = np.nan
    q = whiteness(noise)[0] * np.sqrt(60.0) + 30.0
    assert kstest(q, "chi2", args=(30,)).pvalue > 0.01
    coloured = np.convolve(rng.standard_normal(3000), [1.0, 0.5])[:, None]
    assert whiteness(coloured)[0][0] > 20.0


def test_innovations_are_white_at_the_right_level_only() -> None:
    """At the true jerk the innovations have variance one and no correlation; at a tenth and at ten times it they have not."""
    y = walk(np.random.default_rng(7), 3, 500.0, T, 20_000)[:, :1]
    y = y + 3e-6 * np.random.default_rng(8).standard_normal(y.shape)
    y[5000:5010] = np.nan
    right, slow, fast = (innovations(y, design(T, s, 9e-12)) for s in (500.0, 50.0, 5000.0))
    assert np.nanvar(right) == pytest.approx(1.0, abs=0.05)
    assert abs(whiteness(right)[0][0]) < 4.0
    assert whiteness(slow)[0][0] > 50.0
    assert whiteness(fast)[0][0] > 50.0
    assert np.isnan(right[5000:5010]).all()
