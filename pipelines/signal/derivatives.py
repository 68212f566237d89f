"""Smooth and differentiate even samples by local polynomials (Savitzky & Golay 1964), all channels at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import factorial

import numpy as np
import numpy.typing as npt

__all__ = ["Smoothed", "apply_kernel", "half_width", "kernel", "local_polynomial"]

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Smoothed:
    """A signal and its derivatives at the samples from `half` to N - half of what it was made from."""

    value: Array
    first: Array
    second: Array
    half: int


def half_width(sample_time: float, cutoff_hz: float, order: int = 4) -> int:
    """Half the window, in samples, whose smoothing is down by 3 dB at `cutoff_hz`.

    f_c = (n + 1) / (3.2 M - 4.6) · fs / 2. Schafer 2011, "What is a Savitzky-Golay filter?", eq. (15).
    """
    samples = ((order + 1) * 0.5 / (sample_time * cutoff_hz) + 4.6) / 3.2
    return max(order // 2 + 1, round(samples))


@lru_cache(maxsize=64)
def kernel(half: int, order: int, derivative: int) -> Array:
    """Weights (2 half + 1,) that give the derivative, per sample, of the least-squares polynomial at the middle."""
    k = np.arange(-half, half + 1) / half
    inverse = np.linalg.pinv(np.vander(k, order + 1, increasing=True))
    weights: Array = inverse[derivative] * factorial(derivative) / half**derivative
    weights.flags.writeable = False
    return weights


def apply_kernel(x: Array, weights: Array) -> Array:
    """Σ_k w_k x[i + k] for the middle samples (N - 2 half, channels): the window never reaches over an end."""
    size = len(x) + len(weights) - 1
    fast = 1 << (size - 1).bit_length()
    # the first sample is taken out, so that a large offset does not cost digits; weights of a derivative sum to zero
    base = x[:1]
    spectrum = np.fft.rfft(x - base, fast, axis=0)
    product = spectrum * np.fft.rfft(weights[::-1], fast).reshape(-1, *([1] * (x.ndim - 1)))
    smooth = np.fft.irfft(product, fast, axis=0)[len(weights) - 1:len(x)]
    return np.asarray(smooth + base * weights.sum())


def local_polynomial(x: Array, sample_time: float, half: int, order: int = 4) -> Smoothed:
    """Value, first and second derivative of `x` (samples, channels)."""
    value, first, second = (apply_kernel(x, kernel(half, order, d)) / sample_time**d for d in (0, 1, 2))
    return Smoothed(value, first, second, half)
