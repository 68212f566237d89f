"""Local polynomials: what Welch's windows smear, they leave sharp, and they know how sure they are."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from pipelines.errors import InputRejected, UsageError
from pipelines.frequency.local_polynomial import local_polynomial
from pipelines.frequency.spectra import closed_loop
from tests.frequency.loops import Plant, T, closed_loop_record, welch_responses

RATE = 1.0 / T
LIGHT = Plant(((28.0, 0.01, 0.3),))


def _light_mode(seed: int, samples: int = 60_000, noise: float = 0.02) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """u, y of one mode of 1 % damping, from rest, and the held and sampled truth by scipy: numerator, denominator."""
    rng = np.random.default_rng(seed)
    w = 2.0 * np.pi * 28.0
    numerator, denominator, _ = signal.cont2discrete(([w * w], [1.0, 0.02 * w, w * w]), T)
    u = rng.standard_normal(samples)
    y = signal.lfilter(numerator[0], denominator, u)
    return np.stack([u, y + noise * y.std() * rng.standard_normal(samples)], axis=1), numerator[0], denominator


@pytest.mark.parametrize("seed", range(4))
def test_half_the_error_of_welch_at_a_light_resonance(seed: int) -> None:
    """Same 60 s, the best of five lengths of segments: the error at the peak is at most half."""
    x, numerator, denominator = _light_mode(seed)
    ours = local_polynomial((x,), RATE, np.arange(27.0, 29.0, 0.05), 0, (1,)).of(0)

    def error(found_frequency: np.ndarray, found: np.ndarray) -> float:
        near = np.abs(found_frequency - 28.0) < 0.28  # the half-power band
        _, truth = signal.freqz(numerator, denominator, found_frequency[near], fs=RATE)
        return float(np.sqrt(np.mean(np.abs(found[near] / truth - 1.0) ** 2)))

    theirs = []
    for segment in (2048, 4096, 8192, 16384, 32768 - 2048):
        welch = welch_responses((x,), RATE, segment, 0, (1,)).of(0)
        theirs.append(error(welch.frequency, welch.response))
    assert error(ours.frequency, ours.response) <= 0.5 * min(theirs)


def test_without_noise_the_start_from_rest_is_no_error() -> None:
    """Where the response is smooth, transient and leakage leave less than 1e-6; Welch's leave 1e-3."""
    x, numerator, denominator = _light_mode(0, 20_000, noise=0.0)
    frequency = np.arange(100.0, 400.0, 5.0)
    _, truth = signal.freqz(numerator, denominator, frequency, fs=RATE)
    ours = local_polynomial((x,), RATE, frequency, 0, (1,)).of(0)
    welch = welch_responses((x,), RATE, 1000, 0, (1,)).of(0)
    theirs = np.interp(frequency, welch.frequency, np.abs(welch.response))
    assert np.max(np.abs(ours.response / truth - 1.0)) < 1e-3
    assert np.median(np.abs(ours.response / truth - 1.0)) < 0.03 * np.median(np.abs(theirs / np.abs(truth) - 1.0))


def test_errors_in_a_loop_are_as_large_as_said() -> None:
    """12 records of a plant in a loop, two stretches each: |error|² over variance averages 1, 95 % of it below 3."""
    ratios = []
    frequency = np.arange(5.0, 200.0, 1.0)
    truth = LIGHT.response(frequency)
    for seed in range(12):
        rng = np.random.default_rng(seed)
        v, d, n = (scale * rng.standard_normal(24_000) for scale in (10.0, 2.0, 2e-6))
        x = closed_loop_record(LIGHT, v, d, n, 400.0, 28.0)
        found = closed_loop(local_polynomial((x[:13_000], x[13_500:], x[:20]), RATE, frequency))
        away = np.abs(frequency - 28.0) > 3.0  # the windows are 1.4 Hz, the resonance 0.6 Hz wide
        ratios.append((np.abs(found.response - truth) ** 2 / found.variance)[away])
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.2)
    assert np.mean(np.array(ratios) < 3.0) > 0.92


def test_a_periodic_source_gets_windows_that_hold_its_lines() -> None:
    """Lines every 0.5 Hz in bins of 1/20 Hz: the window grows by itself, and the response is right."""
    rng = np.random.default_rng(1)
    spectrum = np.zeros(1001, dtype=complex)
    spectrum[2:800] = np.exp(2j * np.pi * rng.random(798))
    u = np.resize(np.fft.irfft(spectrum, 2000), 20_000)
    y = signal.lfilter([0.5], [1.0, -0.5], u)
    x = np.stack([u, y + 1e-4 * y.std() * rng.standard_normal(len(u))], axis=1)
    found = local_polynomial((x,), RATE, np.arange(20.0, 350.0, 2.0), 0, (1,)).of(0)
    _, truth = signal.freqz([0.5], [1.0, -0.5], found.frequency, fs=RATE)
    assert found.resolution > 2.0
    assert np.max(np.abs(found.response / truth - 1.0)) < 1e-3


def test_lines_are_counted_only_where_the_source_has_any() -> None:
    """Two periods of lines every 0.25 Hz up to 250 Hz, asked for up to 340 Hz: what is empty above widens no window below.

    An antiresonance 2 ζ f = 2.4 Hz wide shows its depth, 2 ζ to its own width: in windows of 20 Hz it would be filled up.
    """
    rng = np.random.default_rng(5)
    spectrum = np.zeros(2001, dtype=complex)
    spectrum[2:1001] = np.exp(2j * np.pi * rng.random(999))
    v = np.resize(np.fft.irfft(spectrum, 4000), 16_000)
    omega, damping = 2.0 * np.pi * 30.0, 0.04
    zeros, poles = [1.0 / omega**2, 2.0 * damping / omega, 1.0], [1.0 / (3.0 * omega) ** 2, 0.2 / (3.0 * omega), 1.0]
    b, a, _ = signal.cont2discrete((zeros, poles), 1.0 / RATE, method="bilinear")
    y = signal.lfilter(b[0], a, v)[8000:]
    found = local_polynomial((np.stack([v[8000:], y], axis=1),), RATE, np.arange(1.0, 340.0, 0.25), 0, (1,)).of(0)
    near = found.within(25.0, 35.0)
    _, truth = signal.freqz(b[0], a, near.frequency, fs=RATE)
    assert found.resolution < 2.5
    assert np.abs(near.response).min() == pytest.approx(np.abs(truth).min(), rel=0.1)


def test_where_nothing_was_excited_nothing_is_known() -> None:
    """A source of lines below 100 Hz alone: NaN, no coherence, no end of variance above; the quotient too."""
    rng = np.random.default_rng(2)
    spectrum = np.zeros(2001, dtype=complex)
    spectrum[4:400] = np.exp(2j * np.pi * rng.random(396))
    u = np.resize(np.fft.irfft(spectrum, 4000), 40_000)
    u -= u.mean()
    x = np.stack([u, 2.0 * u, 3.0 * u], axis=1)
    x[:, 1:] += 1e-3 * rng.standard_normal((len(u), 2))
    found = local_polynomial((x,), RATE, np.array([50.0, 200.0, 350.0]))
    quotient = closed_loop(found)
    assert np.isfinite(found.response[0]).all()
    assert np.isnan(found.response[1:]).all()
    assert quotient.response[0] == pytest.approx(1.5, rel=1e-2)
    assert np.isnan(quotient.response[1:]).all()
    assert (quotient.coherence[1:] == 0.0).all()
    assert not np.isfinite(quotient.variance[1:]).any()


def test_what_cannot_be_found_is_said() -> None:
    """Too short for the window, missing samples, no excitation at all, frequencies beyond half the rate."""
    x = np.random.default_rng(0).standard_normal((5000, 3))
    at = np.array([50.0, 60.0])
    for signals, code in ((x[:30], "T08"), (np.where(x > 3.0, np.nan, x), "D01"),
                                 (x * np.array([0.0, 1.0, 1.0]), "D09")):
        with pytest.raises(InputRejected) as refused:
            local_polynomial((signals,), RATE, at)
        assert refused.value.code == f"RRID-{code}"
    with pytest.raises(UsageError):
        local_polynomial((x,), RATE, np.array([50.0, 600.0]))
