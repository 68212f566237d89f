"""Power spectral density of signals, averaged over overlapping segments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected

__all__ = ["Spectrum", "welch"]

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Spectrum:
    """One-sided density: its integral over frequency is the variance."""

    frequency: Array  # [Hz] (bins,)
    density: Array  # [unit² / Hz] (bins, ...)
    segments: int  # how many were averaged: the relative deviation of a bin is about 1 / √segments

    @property
    def resolution(self) -> float:
        """Distance of the bins [Hz]."""
        return float(self.frequency[1])


def welch(x: Array, rate: float, segment: int = 1024) -> Spectrum:
    """Modified periodograms with Hann's window, half overlapping, the mean taken off. Welch 1967, IEEE Trans. Audio 15, p. 70.

    `x` (samples, ...) along axis 0; a shorter signal is one segment.
    """
    if len(x) < 4:
        raise InputRejected("T08", f"{len(x)} samples have no spectrum", remedy="record at least four samples")
    if not np.isfinite(x).all():
        raise InputRejected("D01", "missing samples in a signal whose spectrum is asked for", remedy="cut the log at its gaps")
    size = min(segment, len(x))
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(size) / size)
    starts = np.arange(0, len(x) - size + 1, size - size // 2)
    total = np.zeros((size // 2 + 1, *x.shape[1:]))
    for start in starts:
        piece = x[start:start + size]
        spectrum = np.fft.rfft((piece - piece.mean(axis=0)) * window.reshape(-1, *([1] * (x.ndim - 1))), axis=0)
        total += spectrum.real**2 + spectrum.imag**2
    total *= 2.0 / (len(starts) * rate * (window**2).sum())
    total[0] *= 0.5
    if size % 2 == 0:
        total[-1] *= 0.5
    return Spectrum(np.asarray(np.fft.rfftfreq(size, 1.0 / rate), dtype=np.float64), total, len(starts))
