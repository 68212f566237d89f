"""Find the band in which an excitation says anything about a plant in a loop.

    band = excited_band(responses, density)        v → (u, q); density of v at the same frequencies
    band.intervals                                 [Hz], each (low, high)
    band.holds(frequency)                          which frequencies lie in one

A response exists where the excitation v has power and where both of its responses, to the input u and to the output q of the
plant, are known. v is the instrument (Söderström, Stoica 1989, System Identification, ch. 8): P = G_vq / G_vu is unbiased in a
loop as long as G_vu is well above its own noise. From ten decibels on the bias of the quotient is below exp(-10) of it
(Pintelon, Schoukens 2012, System Identification, §2.4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.frequency.frequency_response import Array, Responses

__all__ = ["BandConfig", "ExcitedBand", "excited_band", "powered"]


@dataclass(frozen=True)
class BandConfig:
    """Limits of the excited band.

    Attributes:
        power: of v's mean density, weighted with itself, that a frequency needs: 40 dB down windows leak as much.
        known: |G|² over its variance that both responses need, 10 dB (Pintelon, Schoukens 2012, §2.4).
        around: share of a frequency to each side over whose median that is asked: an antiresonance, where the output vanishes,
            is no end of the band.
        hole: times the usual distance of neighbouring frequencies, and share of the frequency, beyond which there is a hole.
        fewest: frequencies that an interval needs.
    """

    power: float = 1e-4
    known: float = 10.0
    around: float = 0.15
    hole: tuple[float, float] = (4.0, 0.1)
    fewest: int = 5


@dataclass(frozen=True)
class ExcitedBand:
    """Where responses exist, lowest interval first; none where the excitation says nothing."""

    intervals: tuple[tuple[float, float], ...]  # [Hz]

    def holds(self, frequency: Array) -> npt.NDArray[np.bool_]:
        """Return a mask of the `frequency` [Hz] (any shape) that lie in an interval."""
        f = np.asarray(frequency)
        inside = np.zeros(f.shape, dtype=bool)
        for low, high in self.intervals:
            inside |= (f >= low) & (f <= high)
        return inside


def excited_band(responses: Responses, density: Array, config: BandConfig | None = None) -> ExcitedBand:
    """Intervals in which v has power and all its responses are known.

    Args:
        responses: from v to input and output of the plant, by frequency.
        density: of v [unit²/Hz] at their frequencies (bins,).
    """
    config = config or BandConfig()
    f = responses.frequency
    if len(f) < config.fewest or not float(density.sum()) > 0.0:
        return ExcitedBand(())
    variance = np.diagonal(responses.covariance, axis1=1, axis2=2).real
    with np.errstate(all="ignore"):
        known = np.nan_to_num(np.abs(responses.response) ** 2 / variance, nan=0.0).min(axis=1)
    first = np.searchsorted(f, f * (1.0 - config.around))
    last = np.searchsorted(f, f * (1.0 + config.around), side="right")
    usual = np.array([np.median(known[a:b]) for a, b in zip(first, last, strict=True)])
    good = np.flatnonzero(powered(density, config) & (usual >= config.known))
    if not len(good):
        return ExcitedBand(())
    widest = np.maximum(config.hole[0] * float(np.median(np.diff(f))), config.hole[1] * f[good[:-1]])
    parts = np.split(good, np.flatnonzero(np.diff(f[good]) > widest) + 1)
    return ExcitedBand(tuple((float(f[p[0]]), float(f[p[-1]])) for p in parts if len(p) >= config.fewest))


def powered(density: Array, config: BandConfig | None = None) -> npt.NDArray[np.bool_]:
    """Return a mask of the bins where v has power, from its `density` [unit²/Hz] (bins,), which is not zero throughout."""
    return np.asarray(density > (config or BandConfig()).power * float(density @ density) / float(density.sum()))
