"""Periods averaged, their noise measured, a strange one found."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, sosfreqz

from pipelines.errors import InputRejected, UsageError
from pipelines.estimation.filters import passed_both_ways
from pipelines.estimation.periods import average_periods, mean_of_periods, passed_std


def periodic(samples: int, size: float) -> np.ndarray:
    """Two channels of a periodic signal with harmonics up to a fiftieth of the rate."""
    phase = 2 * np.pi * np.arange(samples) / size
    return np.stack([np.sin(phase) + 0.3 * np.cos(int(size / 50) * phase), 2.0 + np.cos(2 * phase)], axis=1)


@pytest.mark.parametrize("size", [500, 500.37, 499.5])
def test_mean_and_noise_are_recovered(size: float) -> None:
    """Ten periods with white noise, whole number of samples or not: the signal within its claimed deviation, noise within 5 %."""
    rng, rate = np.random.default_rng(1), 1000.0
    noise = np.array([0.1, 0.02])
    x = periodic(int(10 * size) + 1, size)
    found = average_periods(x + noise * rng.standard_normal(x.shape), rate, size / rate)
    phase = 2 * np.pi * np.arange(round(size)) / round(size)
    truth = np.stack([np.sin(phase) + 0.3 * np.cos(int(size / 50) * phase), 2.0 + np.cos(2 * phase)], axis=1)
    assert found.count == 10
    np.testing.assert_allclose(np.sqrt(found.noise_variance), noise, rtol=0.05)
    assert (np.std(found.mean - truth, axis=0) < 1.1 * np.sqrt(found.noise_variance / 10)).all()


def test_interpolated_periods_of_a_clean_signal_are_exact() -> None:
    """Without noise, a period of 500.37 samples leaves 1e-6 of the signal as scatter."""
    found = average_periods(periodic(5004, 500.37), 1000.0, 0.50037)
    assert np.sqrt(found.noise_variance).max() < 1e-6


def test_a_strange_period_is_left_out_and_named() -> None:
    """Somebody pushed the arm in the third of six periods."""
    rng = np.random.default_rng(3)
    x = periodic(3000, 500) + 0.01 * rng.standard_normal((3000, 2))
    x[1200:1250, 1] += 1.0
    found = average_periods(x, 1000.0, 0.5)
    assert found.outliers == (2,)
    assert found.used == (0, 1, 3, 4, 5)
    np.testing.assert_allclose(np.sqrt(found.noise_variance), 0.01, rtol=0.06)


def test_missing_samples_are_left_out_of_the_mean() -> None:
    """A hole in one period is filled by nothing: the mean there is that of the other periods."""
    x = periodic(2000, 500)
    x[600:640] = np.nan
    found = average_periods(x, 1000.0, 0.5)
    np.testing.assert_allclose(found.mean, periodic(500, 500), rtol=0, atol=1e-12)


def test_too_little_is_refused() -> None:
    """Fewer than two periods; a phase never measured; a period of no length."""
    x = periodic(1500, 500)
    with pytest.raises(InputRejected, match="T07"):
        average_periods(x[:999], 1000.0, 0.5)
    x[100::500] = np.nan
    with pytest.raises(InputRejected, match="D02"):
        average_periods(x, 1000.0, 0.5)
    for period in (0.0, -1.0, np.nan):
        with pytest.raises(UsageError):
            average_periods(x, 1000.0, period)


LOW = passed_both_ways(np.arange(251) / 0.5, 40.0, 1000.0)


def noisy(periods: int, seed: int = 4) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return periodic(500 * periods, 500) + np.array([0.1, 0.02]) * rng.standard_normal((500 * periods, 2))


def test_what_a_low_pass_leaves_is_scipys() -> None:
    """|H|² of the Butterworth filter, and white noise after it: σ √(mean |H|⁴) over all frequencies."""
    sos = butter(4, 40.0, fs=1000.0, output="sos")
    hz = np.arange(251) / 0.5
    np.testing.assert_allclose(LOW[:-1], np.abs(sosfreqz(sos, hz[:-1], fs=1000.0)[1]) ** 2, rtol=1e-9, atol=1e-15)
    every = np.abs(sosfreqz(sos, np.fft.fftfreq(20_000, 1e-3), fs=1000.0)[1]) ** 4
    found = passed_std(average_periods(noisy(200), 1000.0, 0.5).rest, LOW)
    np.testing.assert_allclose(found, np.array([0.1, 0.02]) * np.sqrt(every.mean()), rtol=0.03)


def test_the_noise_from_sample_to_sample_is_that_between_periods() -> None:
    """White noise is all that differs."""
    found = average_periods(noisy(5), 1000.0, 0.5)
    np.testing.assert_allclose(passed_std(found.rest, LOW), found.white_std(LOW), rtol=0.2)


def test_a_disturbance_below_the_noise_is_found_in_what_the_low_pass_leaves() -> None:
    """A slow push of 0.1 where each sample has noise of 0.1: raw, its period is not odd; after the low-pass it is."""
    x, slow = noisy(6), passed_both_ways(np.arange(251) / 0.5, 10.0, 1000.0)
    x[1100:1400, 0] += 0.1
    assert average_periods(x, 1000.0, 0.5).outliers == ()
    assert average_periods(x, 1000.0, 0.5, amplitude=slow).outliers == (2,)


def test_one_count_is_no_odd_period() -> None:
    """Equal periods, but for one step of an encoder in one of them."""
    x = np.round(periodic(2500, 500) / 1e-3) * 1e-3
    x[1234, 0] += 1e-3
    assert average_periods(x, 1000.0, 0.5, least=np.full(2, 1e-3 / np.sqrt(12.0))).outliers == ()


def test_the_mean_of_some_periods() -> None:
    """Of the signal itself, whatever it is: the third period alone."""
    x = np.arange(2000.0)[:, None]
    np.testing.assert_array_equal(mean_of_periods(x, 1000.0, 0.5, (2,))[:, 0], np.arange(1000.0, 1500.0))


ALL = np.ones(251)  # passes every harmonic
NO_STEPS = np.zeros(2)


def settling(periods: int, size: float, seconds: float, seed: int = 5) -> np.ndarray:
    """Periods of 500 samples, noise of 0.1 and 0.02, whose second channel starts off by `size` and dies away in `seconds`."""
    x = noisy(periods, seed)
    x[:, 1] += size * np.exp(-np.arange(len(x)) * 1e-3 / seconds)
    return x


def test_what_is_periodic_has_no_start() -> None:
    """Of 300 noisy pairs of periods at most three seem to have one, and one step of an encoder is none."""
    assert sum(average_periods(noisy(2, seed), 1000.0, 0.5).begins_apart(LOW, NO_STEPS) for seed in range(300)) <= 3
    x = np.round(periodic(1000, 500) / 1e-3) * 1e-3
    x[3, 0] += 1e-3
    assert not average_periods(x, 1000.0, 0.5).begins_apart(ALL, np.full(2, 1e-3 / np.sqrt(12.0)))


@pytest.mark.parametrize("periods", [2, 4])
def test_a_start_that_dies_away_is_found(periods: int) -> None:
    """1 e^(-t/10 ms) in noise of 0.02; of a later period that is no start."""
    found = average_periods(settling(periods, 1.0, 0.01), 1000.0, 0.5)
    assert found.outliers == (0,) or found.begins_apart(ALL, NO_STEPS)
    assert not average_periods(settling(periods, 0.0, 0.01), 1000.0, 0.5).begins_apart(ALL, NO_STEPS)


def test_a_period_can_be_left_out_by_name() -> None:
    found = average_periods(noisy(4), 1000.0, 0.5, without=(0,))
    assert (found.used, found.outliers) == ((1, 2, 3), (0,))
