"""Zero-phase low-pass, decimation and the averages of a held command, against scipy and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from pipelines.errors import InputRejected
from pipelines.estimation.filters import (
    centre_hold,
    centre_samples,
    choose_decimation,
    zero_phase,
)


@pytest.mark.parametrize("cutoff", [5.0, 50.0, 400.0])
def test_equal_to_sosfiltfilt(cutoff: float) -> None:
    """A random walk far from zero, to 1e-10 of its size, edges included, continued by as many samples."""
    x = np.random.default_rng(4).standard_normal((5000, 2)).cumsum(axis=0) + 100.0
    low_pass, continued = butter(4, cutoff, fs=1000.0, output="sos"), max(160, int(np.ceil(12e3 / cutoff)))
    expected = sosfiltfilt(low_pass, x, axis=0, padlen=continued)
    np.testing.assert_allclose(zero_phase(x, cutoff, 1000.0), expected, rtol=0, atol=1e-10 * np.abs(x).max())


def test_columns_are_filtered_as_signals_are() -> None:
    """Filtering commutes with the model: Y filtered times β is Yβ filtered, for an array (samples, joints, parameters)."""
    rng = np.random.default_rng(0)
    y, beta = rng.standard_normal((3000, 3, 15)), rng.standard_normal(15)
    np.testing.assert_allclose(zero_phase(y, 20.0, 1000.0) @ beta, zero_phase(y @ beta, 20.0, 1000.0), rtol=0, atol=1e-12)


def test_a_sine_keeps_its_phase_and_loses_half_its_power_at_the_cutoff() -> None:
    """-6 dB for both passes at the cut-off, no delay."""
    t = np.arange(20_000) * 1e-3
    for hz, gain in ((20.0, 0.5), (2.0, 1.0 / (1.0 + (np.tan(0.002 * np.pi) / np.tan(0.02 * np.pi)) ** 8))):
        found = zero_phase(np.sin(2 * np.pi * hz * t), 20.0, 1000.0)
        np.testing.assert_allclose(found[3000:-3000], gain * np.sin(2 * np.pi * hz * t)[3000:-3000], rtol=0, atol=1e-9)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_missing_samples_are_refused(bad: float) -> None:
    with pytest.raises(InputRejected, match="D01"):
        zero_phase(np.concatenate([np.zeros(50), [bad], np.zeros(50)]), 20.0, 1000.0)


def test_decimation_keeps_what_passed_the_low_pass() -> None:
    """No alias above 1e-3 of noise is left in the band when every n-th filtered sample is kept."""
    rng = np.random.default_rng(1)
    factor = choose_decimation(20.0, 1000.0)
    assert factor == 12
    t = np.arange(48_000) * 1e-3
    high = np.sin(2 * np.pi * (1000.0 / factor - 15.0) * t + rng.uniform())  # would fold to 15 Hz
    kept = zero_phase(high, 20.0, 1000.0)[::factor]
    assert kept.shape == (4000,)
    assert np.abs(kept[100:-100]).max() < 1e-3
    assert choose_decimation(400.0, 1000.0) == 1


def test_centred_hold_is_the_exact_average() -> None:
    """A held command integrated over the two steps around a sample."""
    u = np.random.default_rng(2).standard_normal((50, 2))
    fine = np.repeat(u, 1000, axis=0)
    exact = np.stack([fine[1000 * (k - 1):1000 * (k + 1)].mean(axis=0) for k in range(1, 49)])
    np.testing.assert_allclose(centre_hold(u), exact, rtol=0, atol=1e-12)


@pytest.mark.parametrize("hz", [10.0, 20.0, 40.0])
def test_centred_samples_are_the_average_of_a_sine(hz: float) -> None:
    """The average of sin(ω t) over two steps is sin(ω t) sin(ωT)/(ωT): error (ωT)⁶/1512 inside, (ωT)⁴/180 at the rims."""
    t, wt = np.arange(400) * 1e-3, 2 * np.pi * hz * 1e-3
    found = centre_samples(np.sin(2 * np.pi * hz * t + 0.3))
    error = np.abs(found - np.sinc(wt / np.pi) * np.sin(2 * np.pi * hz * t + 0.3)[1:-1])
    assert found.shape == (398,)
    assert error[1:-1].max() < 1.01 * wt**6 / 1512
    assert error[[0, -1]].max() < 1.01 * wt**4 / 180


def test_held_torque_and_averaged_columns_balance() -> None:
    """A mass under a held random force: with both averages the law F = m a holds to rounding, without them it does not."""
    u = np.random.default_rng(4).standard_normal(2000)
    # acceleration is what the force makes it, held too; its samples would be ambiguous, so the speed's law is used: v' = u
    v = np.concatenate([[0.0], np.cumsum(u)])[:-1]
    balance = (v[2:] - v[:-2]) / 2.0 - centre_hold(u)
    assert np.abs(balance).max() < 1e-12
    assert np.abs((v[2:] - v[:-2]) / 2.0 - u[1:-1]).std() > 0.1


def test_an_average_needs_three_samples() -> None:
    """Two samples have no average over two steps between them."""
    with pytest.raises(InputRejected, match="T08"):
        centre_samples(np.zeros(2))
