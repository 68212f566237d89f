"""Describe motions as finite Fourier series: exact derivatives, their adjoint, and bounds.

Kostić et al. 2004, eq. (22), with w_j = 2π j Δf and the index that the print lacks (erratum E14):

    q = q0 + Σ (a_j sin w_j t - b_j cos w_j t)/w_j
    q̇ = Σ (a_j cos w_j t + b_j sin w_j t),    q̈ = Σ w_j (b_j cos w_j t - a_j sin w_j t)

All channels share one period. The bounds hold between samples too. On M samples of a period
everything is one real Fourier transform.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["FourierSeries", "adjoint", "degree_of", "periodic_peak", "synthesise"]

Array = npt.NDArray[np.float64]

_NEGLIGIBLE = (
    1e-9  # numerics: of the largest sample: what the amplitudes beyond a degree may add up to
)


@dataclass(frozen=True, eq=False)
class FourierSeries:
    """A periodic motion of several channels."""

    period: float  # [s]
    offset: Array  # q0 (channels,) [rad]
    cosine: Array  # a (channels, harmonics) [rad/s], amplitudes of the speed
    sine: Array  # b (channels, harmonics) [rad/s]

    @property
    def harmonics(self) -> int:
        return int(self.cosine.shape[1])

    @property
    def omega(self) -> Array:
        """w_j (harmonics,) [rad/s]."""
        return np.asarray(2.0 * np.pi / self.period * np.arange(1, self.harmonics + 1))

    def samples(self, count: int) -> Array:
        """q, dq, ddq (3, channels, count) at t = 0, T/count, …: one period."""
        return synthesise(self.offset, self.cosine, self.sine, self.omega, count)

    def at(self, t: Array) -> Array:
        """q, dq, ddq (3, channels, len(t)) at any times, harmonic by harmonic."""
        out = np.zeros((3, len(self.offset), len(t)))
        out[0] = self.offset[:, None]
        for j, w in enumerate(self.omega):
            c, s = np.cos(w * t), np.sin(w * t)
            a, b = self.cosine[:, j, None], self.sine[:, j, None]
            out[0] += (a * s - b * c) / w
            out[1] += a * c + b * s
            out[2] += w * (b * c - a * s)
        return out


def synthesise(offset: Array, cosine: Array, sine: Array, omega: Array, count: int) -> Array:
    """Return q, dq, ddq (3, channels, count) of eq. (22) at `count` > 2 · harmonics samples."""
    channels, harmonics = cosine.shape
    spectrum = np.zeros((3, channels, count // 2 + 1), dtype=np.complex128)
    speed = spectrum[1, :, 1 : harmonics + 1]  # q̇ = Re Σ (a - i b) exp(i w t)
    speed.real, speed.imag = 0.5 * count * cosine, -0.5 * count * sine
    jw = 1j * omega
    spectrum[0, :, 0] = count * offset
    np.divide(speed, jw, out=spectrum[0, :, 1 : harmonics + 1])
    np.multiply(speed, jw, out=spectrum[2, :, 1 : harmonics + 1])
    return np.asarray(np.fft.irfft(spectrum, count, axis=2))


def adjoint(bars: Array, omega: Array) -> tuple[Array, Array, Array]:
    """Return the transpose of `synthesise`: derivatives by q, dq, ddq (3, channels, count) as those
    by offset, cosine and sine.
    """
    spectrum = np.fft.rfft(bars, axis=2)[:, :, : len(omega) + 1]
    c, s = spectrum[:, :, 1:].real, -spectrum[:, :, 1:].imag  # Σ x cos w t and Σ x sin w t
    cosine = c[1] + s[0] / omega - s[2] * omega
    sine = s[1] - c[0] / omega + c[2] * omega
    return spectrum[0, :, 0].real, np.asarray(cosine), np.asarray(sine)


def periodic_peak(samples: Array) -> tuple[Array, Array]:
    """Bounds (lowest, highest) of periodic signals between their samples (…, count) as well.

    A trigonometric polynomial of degree K stays, between M equal samples, within 1/cos(πK/M) of its
    largest one (Ehlich & Zeller 1964). Of another signal the amplitudes beyond a degree are added.
    """
    count = samples.shape[-1]
    low, high = samples.min(axis=-1), samples.max(axis=-1)
    middle, swing = 0.5 * (low + high), 0.5 * (high - low)
    degree, tail = degree_of(samples)
    reach = (swing + tail) / np.cos(np.pi * np.minimum(degree, 0.499 * count) / count) + tail
    return np.asarray(middle - reach), np.asarray(middle + reach)


def degree_of(samples: Array) -> tuple[Array, Array]:
    """(degree, what the amplitudes beyond it add up to) of periodic signals (…, count)."""
    count = samples.shape[-1]
    amplitudes = 2.0 / count * np.abs(np.fft.rfft(samples, axis=-1))
    beyond = np.cumsum(amplitudes[..., ::-1], axis=-1)[..., ::-1]
    # of all degrees above each
    beyond = np.concatenate([beyond[..., 1:], np.zeros_like(beyond[..., :1])], axis=-1)
    limit = _NEGLIGIBLE * np.maximum(np.abs(samples).max(axis=-1, keepdims=True), 1e-300)
    degree = np.argmax(beyond <= limit, axis=-1)
    return degree.astype(np.float64), np.take_along_axis(beyond, degree[..., None], axis=-1)[..., 0]
