"""Cross spectra: equal to scipy's, and as sure of themselves as they may be."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from pipelines.errors import InputRejected
from pipelines.frequency.spectra import cross_spectra
from tests.frequency.loops import welch_responses

RATE = 1000.0


def _noise(samples: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(samples)
    y = signal.lfilter([0.2, 0.1], [1.0, -1.6, 0.8], u) + 0.3 * rng.standard_normal(samples)
    return np.stack([u, y + 3.0, rng.standard_normal(samples) - 0.2 * y], axis=1)


@pytest.mark.parametrize("segment", [256, 255, 1000])
def test_densities_and_coherence_are_scipys(segment: int) -> None:
    """welch, csd and coherence of every pair, to 1e-12 of the largest, for even and odd segments."""
    x = _noise(10_007)
    ours = cross_spectra((x,), RATE, segment)
    for a in range(3):
        frequency, own = signal.welch(x[:, a], RATE, nperseg=segment)
        np.testing.assert_allclose(ours.frequency, frequency, rtol=1e-14)
        np.testing.assert_allclose(ours.density[:, a, a], own, rtol=0, atol=1e-12 * own.max())
        for b in range(3):
            _, cross = signal.csd(x[:, a], x[:, b], RATE, nperseg=segment)
            np.testing.assert_allclose(ours.density[:, a, b], cross, rtol=0, atol=1e-12 * np.abs(cross).max())
            _, coherence = signal.coherence(x[:, a], x[:, b], RATE, nperseg=segment)
            np.testing.assert_allclose(ours.coherence(a, b)[1:], coherence[1:], rtol=0, atol=1e-12)


def test_stretches_are_averaged_without_what_lies_between() -> None:
    """Two stretches weigh as their segments do; one that is too short is left out."""
    x = _noise(9000)
    first, second, short = x[:4000], x[4500:], x[4000:4100]
    _, a = signal.csd(first[:, 0], first[:, 1], RATE, nperseg=500)
    _, b = signal.csd(second[:, 0], second[:, 1], RATE, nperseg=500)
    both = cross_spectra((first, short, second), RATE, 500)
    assert both.segments == 15 + 17
    np.testing.assert_allclose(both.density[:, 0, 1], (15 * a + 17 * b) / 32, rtol=0, atol=1e-12 * np.abs(a).max())


def test_the_response_lies_in_its_disc_as_often_as_it_says() -> None:
    """95 % of the true responses lie in a disc of variance x -ln .05 (Bendat & Piersol 2010), at 40 seeds of few averages."""
    inside = []
    for seed in range(40):
        found = welch_responses((_noise(6000, seed),), RATE, 500, 0, (1,)).of(0).within(10.0, 490.0)
        _, truth = signal.freqz([0.2, 0.1], [1.0, -1.6, 0.8], found.frequency, fs=RATE)
        inside.append(np.mean(np.abs(found.response - truth) ** 2 <= -np.log(0.05) * found.variance))
    assert 0.93 < np.mean(inside) < 0.995


def test_what_cannot_be_averaged_is_said() -> None:
    """Too short, one segment, missing samples, a source that is still."""
    x = _noise(1000)
    for stretches, segment, code in (((x,), 2000, "T08"), ((x,), 1000, "T08"), ((np.where(x > 3.0, np.nan, x),), 200, "D01"),
                                     ((x * np.array([0.0, 1.0, 1.0]),), 200, "D09")):
        with pytest.raises(InputRejected) as refused:
            welch_responses(stretches, RATE, segment)
        assert refused.value.code == f"RRID-{code}"
        assert refused.value.remedy
