"""The excitation of a frequency response: an odd random-phase multisine whose missing lines detect distortion.

    lines = odd_lines(rng, period, highest)        harmonics k of 1/period, odd, one of every four left out at random
    v = realisation(rng, lines, period, samples)   Σ cos(2π k t / period + φ_k), φ_k drawn anew, rms 1

What an even power of the motion does shows at even lines, what an odd power does at the odd lines left out. What differs
between realisations of other phases on the same lines is distortion, what differs between periods is noise (Pintelon, Schoukens
2012, System Identification, §4.3.1; Schoukens et al. 2005, Automatica 41, on random grids of odd lines).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipelines.model.rigid.body import Array

__all__ = ["odd_lines", "realisation"]

Lines = npt.NDArray[np.int64]

_GROUP = 4  # odd lines of which one is left out


def odd_lines(rng: np.random.Generator, lowest: int, highest: int) -> Lines:
    """Odd harmonics from `lowest` to `highest`, without one of every four neighbours."""
    odd = np.arange(lowest | 1, highest + 1, 2)
    groups = len(odd) // _GROUP
    out = _GROUP * np.arange(groups) + rng.integers(_GROUP, size=groups)
    return np.asarray(np.delete(odd, out), dtype=np.int64)


def realisation(rng: np.random.Generator, lines: Lines, period: int, samples: int) -> Array:
    """Lines of equal amplitude and random phase, rms 1, repeated after `period` samples (samples,)."""
    spectrum = np.zeros(period // 2 + 1, dtype=np.complex128)
    spectrum[lines] = np.exp(2j * np.pi * rng.uniform(size=len(lines)))
    one = np.fft.irfft(spectrum, period)
    return np.asarray(np.resize(one / np.sqrt(np.mean(one**2)), samples))
