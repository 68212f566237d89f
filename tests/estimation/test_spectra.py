"""Spectra against scipy and Parseval."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from pipelines.errors import InputRejected
from pipelines.estimation.filters import welch


@pytest.mark.parametrize(("samples", "segment"), [(5000, 1024), (5000, 1000), (5000, 333), (700, 1024), (5000, 5000)])
def test_equal_to_scipy(samples: int, segment: int) -> None:
    """Every bin to 1e-12 of the largest, for even and odd segments, several channels, fewer samples than a segment."""
    x = np.random.default_rng(segment).standard_normal((samples, 2, 3)) + 5.0
    frequency, density = welch(x, 250.0, segment)
    hz, expected = signal.welch(x, 250.0, nperseg=min(segment, samples), axis=0)
    np.testing.assert_allclose(frequency, hz, rtol=1e-14)
    np.testing.assert_allclose(density, expected, rtol=0, atol=1e-12 * expected.max())


def test_density_integrates_to_the_variance() -> None:
    """White noise of variance 4 has a flat density of 4 over half the rate."""
    x = 2.0 * np.random.default_rng(0).standard_normal(200_000)
    frequency, density = welch(x, 1000.0)
    assert density.sum() * frequency[1] == pytest.approx(4.0, rel=0.01)
    assert density[5:-5].mean() == pytest.approx(4.0 / 500.0, rel=0.01)


def test_missing_and_too_few_samples_are_refused() -> None:
    """A NaN would make every bin a NaN without a word."""
    for x, code in ((np.zeros(3), "T08"), (np.array([0.0, 1.0, np.nan, 0.0]), "D01")):
        with pytest.raises(InputRejected, match=code):
            welch(x, 1.0)
