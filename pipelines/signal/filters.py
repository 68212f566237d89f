"""Zero-phase low-pass, decimation, and the averages that belong to a held command.

The same filter goes over a measured torque and over every column that explains it, so whatever it does to one it does to the
other, and the parameters between them do not feel it.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected, UsageError
from pipelines.signal.blocks import impulse_toeplitz

__all__ = [
    "AMPLE",
    "COARSE",
    "KEEP",
    "LowPass",
    "ample",
    "centre_hold",
    "centre_samples",
    "choose_decimation",
    "choose_step",
    "design_low_pass",
    "fast_length",
    "passed_both_ways",
    "thinned",
    "zero_phase",
]

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

_BLOCK = 48
AMPLE = 24.0  # samples a period of the cut-off, at which columns are computed: what it lets through shows no difference
COARSE = 12.0  # at which those of a search are: a change of sign within a sample then shows in a few hundredths of the noise
_PARTS = 4  # numerics: steps shorter than so many samples may be fractions, with denominators up to it
KEEP = 4.0  # samples left per period of the cut-off: the filter is down by 2 × 6 dB per octave and order at the new Nyquist


@dataclass(frozen=True)
class LowPass:
    """A Butterworth low-pass as a sum of its modes: H(z) = direct + Σ residue / (z - pole)."""

    order: int
    poles: Complex  # upper half plane and real axis only
    residues: Complex  # doubled for the pairs, so that the real part is the sum of both
    direct: float

    @property
    def padding(self) -> int:
        """Samples a signal is extended by at either end: three times the taps, as filtfilt does (Gustafsson 1996, sec. I)."""
        return 3 * (self.order + 1)


def design_low_pass(cutoff_hz: float, rate: float, order: int = 4) -> LowPass:
    """Butterworth 1930, by the bilinear transform with prewarping: -3 dB at `cutoff_hz` for one pass, -6 dB for both."""
    if not 0.0 < cutoff_hz < rate / 2.0:
        raise UsageError("C02", f"cut-off {cutoff_hz:g} Hz of a low-pass",
                         remedy=f"choose one between 0 and half the rate, {rate / 2:g} Hz")
    if not 1 <= order <= 8:
        raise UsageError("C02", f"a low-pass of order {order}", remedy="choose an order from 1 to 8")
    # s = 2 (z - 1) / (z + 1), analogue poles on a circle of the warped cut-off
    analogue = 2.0 * np.tan(np.pi * cutoff_hz / rate) * np.exp(0.5j * np.pi * (1.0 + (2.0 * np.arange(order) + 1.0) / order))
    poles = (2.0 + analogue) / (2.0 - analogue)
    direct = np.prod(-analogue / (2.0 - analogue)).real
    apart = poles[:, None] - poles + np.eye(order)
    residues = direct * (poles + 1.0) ** order / np.prod(apart, axis=1)
    single = np.abs(analogue.imag) <= 1e-9 * np.abs(analogue)
    upper = single | (analogue.imag > 0.0)
    return LowPass(order, poles[upper], np.where(single, 1.0, 2.0)[upper] * residues[upper], float(direct))


def zero_phase(x: Array, low_pass: LowPass) -> Array:
    """Forward and backward along axis 0, odd extension at the ends and steady start, as scipy.signal.sosfiltfilt."""
    pad = low_pass.padding
    if len(x) <= pad:
        raise InputRejected("T08", f"{len(x)} samples are too few for a low-pass of order {low_pass.order}",
                            remedy=f"record more than {pad} samples")
    flat = np.asarray(x, dtype=np.float64).reshape(len(x), -1)
    if not np.isfinite(flat[[0, -1]]).all() or not np.isfinite(flat.sum()):
        raise InputRejected("D01", "missing samples in a signal that is to be filtered",
                            remedy="cut the log at its gaps, or reconstruct the missing samples first")
    extended = np.concatenate([2.0 * flat[0] - flat[pad:0:-1], flat, 2.0 * flat[-1] - flat[-2:-pad - 2:-1]])
    back = _one_pass(_one_pass(extended, low_pass)[::-1], low_pass)[::-1]
    return np.ascontiguousarray(back[pad:-pad]).reshape(x.shape)


def thinned(x: npt.NDArray[Any], response: Array, count: int) -> npt.NDArray[Any]:
    """Return `count` samples of signals (channels, samples) over the same time, times `response` at their first frequencies."""
    from scipy.fft import irfft, rfft  # several channels at once, and in single precision

    spectrum = rfft(x, axis=1)[:, :len(response)]
    spectrum *= (response * (count / x.shape[1])).astype(x.dtype)
    return np.asarray(irfft(spectrum, n=count, axis=1, overwrite_x=True))


def _one_pass(u: Array, low_pass: LowPass) -> Array:
    """The causal filter of `u` (samples, columns), started as if the first value had always been there."""
    samples, columns = u.shape
    count, m = -(-samples // _BLOCK), len(low_pass.poles)
    power = low_pass.poles ** np.arange(_BLOCK + 1)[:, None]  # (B + 1, m)
    pulse = np.concatenate([[low_pass.direct], (power[:_BLOCK - 1] @ low_pass.residues).real])
    free = power[:_BLOCK] * low_pass.residues
    # state of a mode as real and imaginary part, side by side with the inputs of the block: one real product gives its outputs
    kernel = np.concatenate([impulse_toeplitz(pulse).T, free.real, -free.imag], axis=1)
    beside = np.zeros((count, _BLOCK + 2 * m, columns))
    whole = samples // _BLOCK
    beside[:whole, :_BLOCK] = u[:whole * _BLOCK].reshape(whole, _BLOCK, columns)
    if whole < count:
        beside[-1, :samples - whole * _BLOCK] = u[whole * _BLOCK:]
    leave = power[_BLOCK - 1::-1].T
    steady = (1.0 / (1.0 - low_pass.poles))[:, None] * u[0]
    drive = np.empty((count, 2 * m, columns))
    drive[0] = np.concatenate([steady.real, steady.imag])
    np.matmul(np.concatenate([leave.real, leave.imag]), beside[:-1, :_BLOCK], out=drive[1:])
    beside[:, _BLOCK:] = _carry(power[_BLOCK], drive)
    return np.asarray((kernel @ beside).reshape(count * _BLOCK, columns)[:samples])


def _carry(across: Complex, drive: Array) -> Array:
    """x_{b+1} = across x_b + drive_{b+1} for modes stored as real and imaginary parts, by doubling (blocks.py), in place."""
    shift = 1
    while shift < len(drive) and np.abs(across).max() > 1e-22:
        turn = np.block([[np.diag(across.real), -np.diag(across.imag)], [np.diag(across.imag), np.diag(across.real)]])
        drive[shift:] += turn @ drive[:-shift]
        across, shift = across * across, 2 * shift
    return drive


def choose_decimation(cutoff_hz: float, rate: float, keep: float = KEEP) -> int:
    """Every how many samples are enough after a low-pass at `cutoff_hz`: at least `keep` a period of the cut-off stay.

    A multiple of `ample`, so that columns computed at that step hold every sample that stays.
    """
    most, step = max(1, int(rate / (keep * cutoff_hz) + 1e-9)), ample(cutoff_hz, rate)
    return most - most % step


def choose_step(cutoff_hz: float, rate: float, keep: float) -> Fraction:
    """Return the samples between rows: `choose_decimation`, or below four samples the largest fraction that leaves `keep`."""
    most = rate / (keep * cutoff_hz) + 1e-9
    if most >= _PARTS:
        return Fraction(choose_decimation(cutoff_hz, rate, keep))
    return max(Fraction(1), *(Fraction(int(most * part), part) for part in range(1, 1 + _PARTS)))


def ample(cutoff_hz: float, rate: float, per_period: float = AMPLE) -> int:
    """Return every how many samples a column is computed before a low-pass at `cutoff_hz`."""
    return max(1, int(rate / (per_period * cutoff_hz)))


def centre_hold(command: Array) -> Array:
    """Average over [t_{k-1}, t_{k+1}] of a command held from sample to sample: ½ (u_k + u_{k-1}), exact, for k = 1 .. N - 2.

    u_k acts over [t_k, t_{k+1}); beside states sampled at t_k it comes half a sample late, on average. This average is centred.
    """
    return np.asarray(0.5 * (command[1:-1] + command[:-2]))


def centre_samples(x: Array) -> Array:
    """The same average of a smooth signal known by its samples, for k = 1 .. N - 2 along axis 0.

    (1/2T) ∫ x dt over two samples = x + T²/6 x'' + T⁴/120 x'''' + ...; the even differences of five samples match it up to T⁴:
    (-1, 34, 114, 34, -1) / 180, error T⁶ x⁽⁶⁾ / 1512. The outermost two take Simpson's (1, 4, 1) / 6, error T⁴ x'''' / 180.
    """
    if len(x) < 3:
        raise InputRejected("T08", f"{len(x)} samples: no average over two of their steps", remedy="record at least three samples")
    out = np.multiply(x[1:-1], 4.0 / 6.0)
    out += (x[:-2] + x[2:]) * (1.0 / 6.0)
    if len(x) > 4:
        # five samples minus Simpson: -1/180 of the fourth difference
        out[1:-1] -= (x[:-4] - 4.0 * x[1:-3] + 6.0 * x[2:-2] - 4.0 * x[3:-1] + x[4:]) * (1.0 / 180.0)
    return np.asarray(out)


def fast_length(n: int) -> int:
    """Return the smallest 2^a 3^b 5^c from n on: the length of a fast Fourier transform."""
    from scipy.fft import next_fast_len

    return int(next_fast_len(n, real=True))


def passed_both_ways(frequency: Array, cutoff_hz: float, rate: float, order: int = 4) -> Array:
    """Return the gain of `zero_phase` for a sinusoid of `frequency` [Hz]: |H|² of the low-pass, real.

    |H|² = 1 / (1 + (tan(π f / rate) / tan(π f_c / rate))^(2n)): Butterworth 1930, by the bilinear transform.
    """
    with np.errstate(over="ignore"):
        return np.asarray(1.0 / (1.0 + (np.tan(np.pi * np.asarray(frequency) / rate)
                                        / np.tan(np.pi * cutoff_hz / rate)) ** (2 * order)))
