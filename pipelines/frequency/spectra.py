"""Spectra and cross spectra of signals measured together, averaged over overlapping segments, and the responses they give.

    spectra = cross_spectra((x,), rate, segment)        x (samples, channels); every segment of every channel is transformed once
    spectra.density[:, 0, 1]                            Φ_01, as scipy.signal.csd(x[:, 0], x[:, 1])
    spectra.responses(0, (1, 2))                        H₁ from channel 0 to channels 1 and 2, with covariance and coherence

Welch 1967, IEEE Trans. Audio 15, p. 70; Bendat, Piersol 2010, Random Data, ch. 6 and 9.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.errors import InputRejected, UsageError
from pipelines.frequency.frequency_response import Array, Complex, Responses

__all__ = ["CrossSpectra", "cross_spectra", "welch_responses"]

_CACHE = 1 << 16  # numbers that are worked on at a time, so that they stay near the processor
_HANN_OVERLAP = 1.0 / 18.0  # twice the squared correlation of neighbouring segments that overlap by half: 2 (1/6)²
_HANN_BINS = 1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0)  # neighbouring bins of Hann's window correlate by 2/3 and 1/6; their squares
_HANN_WIDTH = 1.5  # equivalent noise bandwidth in bins


@dataclass(frozen=True, eq=False)
class CrossSpectra:
    """One-sided densities of every pair of channels."""

    frequency: Array  # [Hz] (bins,)
    density: Complex  # Φ_ab = E conj(X_a) X_b [unit_a unit_b / Hz] (bins, channels, channels)
    segments: int

    @property
    def averages(self) -> float:
        """Independent segments that would average as well; those that overlap by half correlate a little."""
        return self.segments / (1.0 + _HANN_OVERLAP * (self.segments - 1) / self.segments)

    def coherence(self, a: int, b: int) -> Array:
        """Γ² = |Φ_ab|² / (Φ_aa Φ_bb), eq. (28), (bins,); 0 where a channel is still.

        Raises:
            InputRejected: T08, one segment alone: it is 1 whatever the signals are.
        """
        if self.segments < 2:
            raise _too_short("one segment alone says nothing of coherence or variance")
        power = self.density[:, a, a].real * self.density[:, b, b].real
        found = np.abs(self.density[:, a, b]) ** 2 / np.where(power > 0.0, power, 1.0)
        return np.where(power > 0.0, np.minimum(found, 1.0), 0.0)

    def responses(self, source: int, outputs: Sequence[int]) -> Responses:
        """H₁ = Φ_xz / Φ_xx from channel `source` to each of `outputs`, at every frequency above 0.

        The covariance is that of the noise of the outputs, Φ_zz - Φ_zx Φ_xz / Φ_xx, which takes one degree of freedom, over
        averages and power of the source. Leakage is not in it: the same at every segment, it hides in the response.

        Raises:
            InputRejected: T08, fewer than two segments; D09, a source without power at some frequency.
        """
        z = list(outputs)
        coherence = np.stack([self.coherence(source, k) for k in z], axis=1)[1:]
        power, cross = self.density[1:, source, source].real, self.density[1:, source, z]
        if not (power > 0.0).all():
            raise InputRejected("D09", f"the excitation has no power at {self.frequency[1:][power <= 0.0][0]:.4g} Hz",
                                remedy="excite every frequency that is asked for")
        response = cross / power[:, None]
        own = np.swapaxes(self.density[1:][:, z][:, :, z], 1, 2)  # E Z Zᴴ
        noise = own - response[:, :, None] * np.conj(response)[:, None, :] * power[:, None, None]
        n = self.averages
        return Responses(self.frequency[1:], response, noise / ((n - 1.0) * power)[:, None, None], coherence, "welch",
                         _HANN_WIDTH * float(self.frequency[1]), n, _HANN_BINS, n - 1.0)


def cross_spectra(stretches: Sequence[Array], rate: float, segment: int) -> CrossSpectra:
    """Averaged over half overlapping segments of `segment` samples under Hann's window, the mean of each taken off.

    Args:
        stretches: of one experiment or several, each (samples, channels); what is shorter than a segment is left out.
        rate: samples a second [Hz]; the bins lie rate/segment apart.

    Raises:
        InputRejected: T08, no stretch holds a segment; D01, missing samples.
    """
    channels = _checked(stretches, segment)
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(segment) / segment)
    sums = _Sums(channels, segment // 2 + 1)
    for stretch in stretches:
        if len(stretch) < segment:
            continue
        rows = np.ascontiguousarray(np.asarray(stretch, dtype=np.float64).T)
        pieces = np.lib.stride_tricks.sliding_window_view(rows, segment, axis=1)[:, ::segment - segment // 2]
        at_once = max(1, _CACHE // (channels * segment))
        for first in range(0, pieces.shape[1], at_once):
            piece = pieces[:, first:first + at_once]
            piece = piece - piece.mean(axis=-1, keepdims=True)
            piece *= window
            sums.add(np.fft.rfft(piece, axis=-1))
    total = sums.matrix() * (2.0 / (sums.segments * rate * (window**2).sum()))
    total[0] *= 0.5
    if segment % 2 == 0:
        total[-1] *= 0.5
    return CrossSpectra(np.asarray(np.fft.rfftfreq(segment, 1.0 / rate), dtype=np.float64), total, sums.segments)


class _Sums:
    """Σ conj(X_a) X_b over segments: real on the diagonal, and each pair once."""

    def __init__(self, channels: int, bins: int) -> None:
        self.segments = 0
        self.pairs = [(a, b) for a in range(channels) for b in range(a + 1, channels)]
        self.own = np.zeros((channels, bins, 2))  # of real and imaginary part
        self.cross = np.zeros((len(self.pairs), bins), dtype=np.complex128)

    def add(self, x: Complex) -> None:
        """Those of x (channels, segments, bins)."""
        parts = x.view(np.float64).reshape(*x.shape, 2)
        self.own += np.einsum("csfp,csfp->cfp", parts, parts)
        for k, (a, b) in enumerate(self.pairs):
            product = np.conj(x[a])
            product *= x[b]
            self.cross[k] += product.sum(axis=0)
        self.segments += x.shape[1]

    def matrix(self) -> Complex:
        """(bins, channels, channels)."""
        channels, bins = self.own.shape[:2]
        whole = np.zeros((bins, channels, channels), dtype=np.complex128)
        whole[:, np.arange(channels), np.arange(channels)] = self.own.sum(axis=2).T
        for k, (a, b) in enumerate(self.pairs):
            whole[:, a, b] = self.cross[k]
            whole[:, b, a] = np.conj(self.cross[k])
        return whole


def welch_responses(stretches: Sequence[Array], rate: float, segment: int, source: int = 0,
                    outputs: Sequence[int] = (1, 2)) -> Responses:
    """From channel `source` to `outputs`, see `cross_spectra` and `CrossSpectra.responses`."""
    return cross_spectra(stretches, rate, segment).responses(source, outputs)


def _checked(stretches: Sequence[Array], segment: int) -> int:
    """How many channels every stretch has."""
    if segment < 4:
        raise UsageError("C02", f"segments of {segment} samples", remedy="give at least four")
    longest = max((len(x) for x in stretches), default=0)
    if longest < segment:
        raise _too_short(f"the longest stretch has {longest} samples, one segment {segment}")
    if not all(np.isfinite(x).all() for x in stretches):
        raise InputRejected("D01", "missing samples in a signal whose spectrum is asked for", remedy="cut the log at its gaps")
    counts = {int(x.shape[1]) for x in stretches}
    if len(counts) != 1:
        raise UsageError("C02", f"stretches of {sorted(counts)} channels", remedy="give all the same channels")
    return counts.pop()


def _too_short(why: str) -> InputRejected:
    return InputRejected("T08", why, remedy="record longer, or ask for a coarser resolution")
