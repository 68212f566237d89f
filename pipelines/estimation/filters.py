"""Filter signals: zero-phase low-pass, averages of a held command, local polynomials, spectra.

The same filter goes over a measured torque and over every column that explains it, so it
changes both alike, and the parameters between them do not feel it. SciPy's filters
are the reference of the tests; importing them takes longer than a fit.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from math import ceil, factorial
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected
from pipelines.io.log import Array

AMPLE = 24.0  # numerics: samples a period of the cut-off at which columns are computed
COARSE = 12.0  # numerics: those of a search: a change of sign then shows in hundredths of the noise
KEEP = 4.0  # numerics: samples left per period of the cut-off: 2 × 6 dB per octave at Nyquist
PAD = 4.0  # numerics: periods of the cut-off by which a stretch is continued at either end
_FORGOTTEN = 160, 12.0  # numerics: samples, and periods, in which the low-pass forgets an end
_PARTS = 4  # numerics: steps shorter than so many samples may be fractions, denominators up to it


def zero_phase(x: Array, cutoff_hz: float, rate: float) -> Array:
    """Filter along axis 0 forward and backward by Butterworth's low-pass of order 4.

    In the frequency domain, the ends continued by odd extensions in which it forgets the ends.

    Raises:
        InputRejected: T08, fewer than two samples; D01, missing ones.
    """
    if len(x) < 2:
        raise InputRejected("T08", f"{len(x)} samples to filter", remedy="record longer")
    if not np.isfinite(x.sum()):
        remedy = "cut the log at its gaps, or reconstruct the missing samples first"
        raise InputRejected("D01", "missing samples in a signal that is filtered", remedy=remedy)
    pad = min(len(x) - 1, max(_FORGOTTEN[0], ceil(_FORGOTTEN[1] * rate / cutoff_hz)))
    before, behind = 2.0 * x[0] - x[pad:0:-1], 2.0 * x[-1] - x[-2 : -pad - 2 : -1]
    wide = np.concatenate([before, x, behind])
    middle, size = 0.5 * (wide[0] + wide[-1]), fast_length(len(wide))
    hertz = rate / size * np.arange(size // 2 + 1, dtype=np.float64)
    response = passed_both_ways(hertz, cutoff_hz, rate)
    bins = np.fft.rfft(wide - middle, size, axis=0)
    bins *= response.reshape(-1, *[1] * (x.ndim - 1))
    return np.asarray(np.fft.irfft(bins, size, axis=0)[pad : pad + len(x)] + middle)


def thinned(x: npt.NDArray[Any], response: Array, count: int) -> npt.NDArray[Any]:
    """Return `count` samples of signals (channels, samples) over the same time, times `response` at
    their first frequencies.
    """
    from scipy.fft import irfft, rfft  # several channels at once, and in single precision

    spectrum = rfft(x, axis=1)[:, : len(response)]
    spectrum *= (response * (count / x.shape[1])).astype(x.dtype)
    return np.asarray(irfft(spectrum, n=count, axis=1, overwrite_x=True))


def fast_length(least: int) -> int:
    """Return the smallest 2^a 3^b 5^c from `least` on: the length of a fast Fourier transform."""
    best = 1 << (least - 1).bit_length()
    for three, five in product(range(20), range(14)):
        odd: int = 3**three * 5**five
        best = min(best, odd << max(0, (-(-least // odd) - 1).bit_length()))
    return best


def passed_both_ways(frequency: Array, cutoff_hz: float, rate: float, order: int = 4) -> Array:
    """Return the gain of `zero_phase` for a sinusoid of `frequency` [Hz].

    |H|² = 1 / (1 + (tan(π f / rate) / tan(π f_c / rate))^(2n)): Butterworth 1930, bilinear.
    """
    with np.errstate(over="ignore"):
        ratio = np.tan(np.pi * np.asarray(frequency) / rate) / np.tan(np.pi * cutoff_hz / rate)
        return np.asarray(1.0 / (1.0 + ratio ** (2 * order)))


def ample(cutoff_hz: float, rate: float, per_period: float = AMPLE) -> int:
    """Return every how many samples a column is computed before a low-pass at `cutoff_hz`."""
    return max(1, int(rate / (per_period * cutoff_hz)))


def choose_decimation(cutoff_hz: float, rate: float, keep: float = KEEP) -> int:
    """Return every how many samples are enough after a low-pass: `keep` a period at least.

    A multiple of `ample`, so that columns computed at that step hold every sample that stays.
    """
    most, step = max(1, int(rate / (keep * cutoff_hz) + 1e-9)), ample(cutoff_hz, rate)
    return most - most % step


def choose_step(cutoff_hz: float, rate: float, keep: float) -> Fraction:
    """Return the samples between rows: `choose_decimation`, or a fraction below four samples."""
    most = rate / (keep * cutoff_hz) + 1e-9
    if most >= _PARTS:
        return Fraction(choose_decimation(cutoff_hz, rate, keep))
    return max(Fraction(1), *(Fraction(int(most * n), n) for n in range(1, 1 + _PARTS)))


def centre_hold(command: Array) -> Array:
    """Average a held command over [t_{k-1}, t_{k+1}]: ½ (u_k + u_{k-1}), for k = 1 .. N - 2.

    u_k acts over [t_k, t_{k+1}): against states at t_k it comes half a sample late on average.
    """
    return np.asarray(0.5 * (command[1:-1] + command[:-2]))


def centre_samples(x: Array) -> Array:
    """Average a smooth signal, known by its samples, alike: for k = 1 .. N - 2 along axis 0.

    (1/2T) ∫ x dt over two samples = x + T²/6 x'' + T⁴/120 x'''' + ...; the even differences of five
    samples match it up to T⁴: (-1, 34, 114, 34, -1) / 180, error T⁶ x⁽⁶⁾ / 1512. The outermost two
    take Simpson's (1, 4, 1) / 6, error T⁴ x'''' / 180.
    """
    if len(x) < 3:
        words = f"{len(x)} samples: no average over two of their steps"
        raise InputRejected("T08", words, remedy="record at least three samples")
    out = np.multiply(x[1:-1], 4.0 / 6.0)
    out += (x[:-2] + x[2:]) * (1.0 / 6.0)
    if len(x) > 4:  # five samples minus Simpson: -1/180 of the fourth difference
        fourth = x[:-4] - 4.0 * x[1:-3] + 6.0 * x[2:-2] - 4.0 * x[3:-1] + x[4:]
        out[1:-1] -= fourth * (1.0 / 180.0)
    return np.asarray(out)


def half_width(sample_time: float, cutoff_hz: float, order: int = 4) -> int:
    """Return half the window [samples] of a local polynomial whose smoothing is down by 3 dB.

    f_c = (n + 1) / (3.2 M - 4.6) · fs / 2. Schafer 2011, eq. (15).
    """
    samples = ((order + 1) * 0.5 / (sample_time * cutoff_hz) + 4.6) / 3.2
    return max(order // 2 + 1, round(samples))


def kernel(half: int, order: int, derivative: int) -> Array:
    """Return the weights (2 half + 1,) of the least-squares polynomial's derivative, per sample, at
    the middle (Savitzky & Golay 1964).
    """
    k = np.arange(-half, half + 1) / half
    inverse = np.linalg.pinv(np.vander(k, order + 1, increasing=True))
    return np.asarray(inverse[derivative] * factorial(derivative) / half**derivative)


def apply_kernel(x: Array, weights: Array) -> Array:
    """Σ_k w_k x[i + k] for the middle samples (N - 2 half, channels)."""
    size = len(x) + len(weights) - 1
    fast = 1 << (size - 1).bit_length()
    # without the first sample, so that a large offset does not cost digits
    base = x[:1]
    spectrum = np.fft.rfft(x - base, fast, axis=0)
    spectrum *= np.fft.rfft(weights[::-1], fast).reshape(-1, *([1] * (x.ndim - 1)))
    smooth = np.fft.irfft(spectrum, fast, axis=0)[len(weights) - 1 : len(x)]
    return np.asarray(smooth + base * weights.sum())


def local_polynomial(x: Array, sample_time: float, half: int) -> tuple[Array, Array, Array]:
    """Return value, first and second derivative of `x` from sample `half` to N - half."""
    value, first, second = (apply_kernel(x, kernel(half, 4, d)) / sample_time**d for d in (0, 1, 2))
    return value, first, second


def welch(x: Array, rate: float, segment: int = 1024) -> tuple[Array, Array]:
    """Return frequencies [Hz] and the one-sided density [unit² / Hz] of `x` (samples, ...).

    Modified periodograms with Hann's window, half overlapping, the mean taken off. Welch 1967, IEEE
    Trans. Audio 15, p. 70. A shorter signal is one segment.

    Raises:
        InputRejected: T08, too few samples; D01, missing ones.
    """
    if len(x) < 4:
        words = f"{len(x)} samples have no spectrum"
        raise InputRejected("T08", words, remedy="record at least four samples")
    if not np.isfinite(x).all():
        words = "missing samples in a signal whose spectrum is computed"
        raise InputRejected("D01", words, remedy="cut the log at its gaps")
    size = min(segment, len(x))
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(size) / size)
    window = window.reshape(-1, *([1] * (x.ndim - 1)))
    starts = np.arange(0, len(x) - size + 1, size - size // 2)
    total = np.zeros((size // 2 + 1, *x.shape[1:]))
    for start in starts:
        piece = x[start : start + size]
        spectrum = np.fft.rfft((piece - piece.mean(axis=0)) * window, axis=0)
        total += spectrum.real**2 + spectrum.imag**2
    total *= 2.0 / (len(starts) * rate * (window**2).sum())
    total[0] *= 0.5
    if size % 2 == 0:
        total[-1] *= 0.5
    return np.asarray(np.fft.rfftfreq(size, 1.0 / rate), dtype=np.float64), total


def prediction_weights(covariance: Array, ridge: float = 0.0) -> Array:
    """Return the weights (p + 1, p + 1) of a sample and those before it, predicted by 0, 1, … p.

    With r_k the autocovariance of a stationary signal, the prediction of x_i by the k samples
    before it has weights a with (Yule 1927, Walker 1931)

        R a = (r_1 … r_k),    R = toeplitz(r_0 … r_{k-1}),    σ_k² = r_0 - a · (r_1 … r_k)

    and √r_0 (x_i - Σ_j a_j x_{i-j}) / σ_k is white and has the power of x. Of a signal that is
    zero, the weights are those of the signal itself.

    Args:
        covariance: (p + 1,) at lags 0 … p.
        ridge: white power added, as a share of the signal's: what a smooth signal lacks rises by no
            more than 1 / ridge.
    """
    from scipy.linalg import solve_toeplitz

    out = np.zeros((len(covariance), len(covariance)))
    if covariance[0] <= 0.0:
        out[:, 0] = 1.0
        return out
    r = covariance / covariance[0]
    r[0] += ridge
    for order in range(len(r)):
        a = solve_toeplitz(r[:order], r[1 : order + 1]) if order else np.zeros(0)
        left = r[0] - a @ r[1 : order + 1]
        out[order, : order + 1] = np.concatenate([[1.0], -a]) / np.sqrt(max(left, ridge))
    return out


def prediction_errors(weights: Array, x: Array) -> Array:
    """Return what the samples of `x` (channels, samples) are beyond their prediction.

    The first p samples are predicted by as many as there are (Durbin 1960), the others by p.
    """
    from scipy.ndimage import convolve1d

    middle = len(weights) // 2  # of the taps, where a filter that looks both ways has its origin
    out = np.asarray(convolve1d(x, weights[-1], 1, np.float64, "constant", origin=-middle))
    for sample in range(min(len(weights) - 1, x.shape[1])):
        out[:, sample] = x[:, sample::-1] @ weights[sample, : sample + 1]
    return out
