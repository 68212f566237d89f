"""A frequency response with its variance and coherence, and the three ways to one from signals inside a loop.

    an excitation v enters a loop; an input r and an output q of the plant are measured

    several = welch_responses(stretches, rate, ...)          v → (r, q), by averaged segments    cross_spectra.py
    several = local_polynomial(stretches, rate, ...)         v → (r, q), leakage taken out       local_polynomial.py
    several = multisine_responses(realisations, ...).noise   v → (r, q), periodic v              multisine_response.py
    plant   = closed_loop(several, output=1, input=0)        P = G_vq / G_vr = Φ_vq / Φ_vr, without the controller
    plant   = indirect(several.of(0), controller)            P = (1 - S) / (C S), S = G_vr, eq. (29)
    plant   = welch_responses of r → q, `.of(0)`             direct: biased where a disturbance goes round the loop

Equations (28), (29): Kostić et al. 2004. Variances: Pintelon, Schoukens 2012, System Identification, ch. 2 and 7.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

__all__ = ["Array", "Complex", "FrequencyResponse", "Responses", "bands_below", "closed_loop", "indirect"]

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """One response, input → output."""

    frequency: Array  # [Hz] (bins,)
    response: Complex  # [unit of output / unit of input] (bins,)
    variance: Array  # E|Ĝ - G|², real and imaginary part together (bins,)
    coherence: Array  # 0 … 1 (bins,); for a quotient the lower of its two
    method: str  # "welch", "local polynomial", "multisine"
    resolution: float  # [Hz] width of what one estimate looks at
    averages: float  # independent averages in one estimate
    correlated: float  # neighbouring bins that together carry one independent estimate, at least 1
    freedom: float = np.inf  # degrees of freedom of the variance

    def within(self, low: float, high: float) -> FrequencyResponse:
        """The bins with low ≤ frequency ≤ high [Hz]."""
        return self.where((self.frequency >= low) & (self.frequency <= high))

    def where(self, kept: npt.NDArray[np.bool_]) -> FrequencyResponse:
        """The bins that are `kept` (bins,)."""
        return replace(self, frequency=self.frequency[kept], response=self.response[kept], variance=self.variance[kept],
                       coherence=self.coherence[kept])

    def times(self, factor: Complex) -> FrequencyResponse:
        """Response times a `factor` (bins,) that is exactly known, as (jω)² of a second derivative or 1/(jω)."""
        return replace(self, response=self.response * factor, variance=self.variance * np.abs(factor) ** 2)


@dataclass(frozen=True, eq=False)
class Responses:
    """From one excitation to several outputs measured together, whose errors are correlated."""

    frequency: Array  # [Hz] (bins,)
    response: Complex  # (bins, outputs)
    covariance: Complex  # E (Ĝ - G)(Ĝ - G)ᴴ (bins, outputs, outputs)
    coherence: Array  # of the excitation with each output (bins, outputs)
    method: str
    resolution: float  # [Hz]
    averages: float
    correlated: float
    freedom: float = np.inf

    def of(self, output: int) -> FrequencyResponse:
        """That to one output."""
        return FrequencyResponse(self.frequency, self.response[:, output], self.covariance[:, output, output].real,
                                 self.coherence[:, output], self.method, self.resolution, self.averages, self.correlated,
                                 self.freedom)


def closed_loop(responses: Responses, output: int = 1, input: int = 0) -> FrequencyResponse:
    """P = G_v,output / G_v,input (bins,): no knowledge of the controller, no bias by what else drives the loop.

    P̂ - P ≈ (δ_out - P δ_in) / G_in; ibid., eq. (2-73). Where G_in is zero or unknown the response is NaN,
    its variance infinite, its coherence 0.
    """
    g_out, g_in, c = responses.response[:, output], responses.response[:, input], responses.covariance
    there = np.isfinite(g_in) & np.isfinite(g_out) & np.isfinite(c.real).all(axis=(1, 2)) & (g_in != 0.0)
    safe, c = np.where(there, g_in, 1.0), np.where(there[:, None, None], c, 0.0)
    plant = np.where(there, g_out, 0.0) / safe
    spread = c[:, output, output].real + np.abs(plant) ** 2 * c[:, input, input].real \
        - 2.0 * (np.conj(plant) * c[:, output, input]).real
    lower = np.minimum(responses.coherence[:, output], responses.coherence[:, input])
    return FrequencyResponse(responses.frequency, np.where(there, plant, np.nan),
                             np.where(there, np.maximum(spread, 0.0) / np.abs(safe) ** 2, np.inf), np.where(there, lower, 0.0),
                             responses.method, responses.resolution, responses.averages, responses.correlated, responses.freedom)


def indirect(sensitivity: FrequencyResponse, controller: Complex) -> FrequencyResponse:
    """P = (1 - S) / (C S), eq. (29), with the controller's own response C (bins,) at the same frequencies.

    C is that of the sampled controller: with the continuous one the error is 8.8 % at 28 Hz, 25 % at 80 Hz (1 kHz, kp = 400,
    kd = 28). |∂P/∂S| = 1 / |C S²|.
    """
    there = np.isfinite(sensitivity.response) & (sensitivity.response != 0.0) & (controller != 0.0)
    s, c = np.where(there, sensitivity.response, 1.0), np.where(there, controller, 1.0)
    variance = sensitivity.variance / np.abs(c * s**2) ** 2
    return replace(sensitivity, response=np.where(there, (1.0 - s) / (c * s), np.nan), variance=np.where(there, variance, np.inf),
                   coherence=np.where(there, sensitivity.coherence, 0.0))


def bands_below(frequency: Array, coherence: Array, limit: float = 0.7) -> tuple[tuple[float, float], ...]:
    """Stretches [Hz] of neighbouring bins where the coherence is under the limit, or unknown: (from, to) of each."""
    low = np.concatenate([[False], ~(coherence >= limit), [False]])
    edges = np.flatnonzero(low[1:] != low[:-1])
    return tuple((float(frequency[a]), float(frequency[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True))
