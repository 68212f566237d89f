"""Responses by local polynomials: what an excitation of any kind tells, without the leakage that windows leave.

    X_out(k + r) = G(k + r) X_source(k + r) + T(k + r) + noise        for |r| ≤ n bins

of the transform of the whole record: response G and transient T are smooth, so near each frequency both are polynomials in r,
found by least squares. What is left is the noise, with the degrees of freedom of the window. Several outputs share the
regressors, and several stretches their response: each has its own transient.

Pintelon, Schoukens 2012, System Identification, §7.2, eq. (7-6) to (7-24).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected, UsageError
from pipelines.signal.frequency_response import Array, Complex, Responses

__all__ = ["local_polynomial"]

Indices = npt.NDArray[np.int64]

_FREEDOM = 10  # least degrees of freedom of a noise estimate: its own deviation is then a third
_LEAST_FREEDOM = 4  # in one stretch
_AT_ONCE = 2000  # windows solved together
_EMPTY = 1e-10  # of the strongest amplitude: what is smaller is rounding, no source
_LEAKED = 1e-6  # of the power in the strongest window: what is smaller has leaked from lines elsewhere


@dataclass(frozen=True, eq=False)
class _Local:
    """Of one stretch, at every frequency asked for."""

    response: Complex  # (frequencies, outputs)
    noise: Complex  # covariance of the outputs in one bin (frequencies, outputs, outputs)
    weight: Array  # power of the source that the response stands on, 1 / (XᴴX)⁻¹₀₀ (frequencies,); 0 where there is none
    power: Array  # of the source, mean of the window (frequencies,)
    freedom: int
    bins: float  # bins a hertz
    width: float  # [Hz] of the window


def local_polynomial(stretches: Sequence[Array], rate: float, frequency: Array, source: int = 0, outputs: Sequence[int] = (1, 2),
                     order: int = 2, width: float | None = None) -> Responses:
    """Responses from channel `source` to `outputs` at every `frequency`, with the covariance of the noise.

    Where the source has no power round a frequency the response is NaN, its covariance infinite, its coherence 0.

    Args:
        stretches: each (samples, channels); one too short for a window is left out.
        rate: samples a second [Hz].
        frequency: [Hz] (frequencies,) evenly spaced, where the responses are wanted.
        order: of both polynomials.
        width: [Hz] of the window; None for the narrowest that leaves ten degrees of freedom in all stretches, and holds
            enough lines of a periodic source. That is wide: for a periodic source `multisine_responses` resolves more.

    Raises:
        InputRejected: T08, no stretch is long enough for the width; D09, no power of the source anywhere; D01, missing samples.
    """
    if order < 0 or not ((frequency > 0.0) & (frequency < 0.5 * rate)).all():
        raise UsageError("C02", f"order {order}, frequencies {frequency.min():g} to {frequency.max():g} Hz at {rate:g} Hz",
                         remedy="ask for frequencies between 0 and half the rate")
    least = max(_LEAST_FREEDOM, -(-_FREEDOM // max(len(stretches), 1)))
    found = [one for x in stretches
             if (one := _of_stretch(x, rate, frequency, [source, *outputs], order, width, least)) is not None]
    if not found:
        longest = max((len(x) for x in stretches), default=0) / rate
        raise InputRejected("T08", f"{longest:.3g} s at most are too short for local polynomials of order {order}"
                            + ("" if width is None else f" over {width:.3g} Hz"), remedy="record longer, or ask for a wider window")
    return _together(found, frequency)


def _of_stretch(x: Array, rate: float, frequency: Array, channels: list[int], order: int, width: float | None,
                least: int) -> _Local | None:
    """None for a stretch in which a window holds too few bins."""
    if not np.isfinite(x).all():
        raise InputRejected("D01", "missing samples in a signal whose response is asked for", remedy="cut the log at its gaps")
    unknowns, bins = 2 * (order + 1), len(x) / rate
    half = (unknowns + least) // 2 if width is None else int(0.5 * width * bins)
    if 2 * half + 1 - unknowns < _LEAST_FREEDOM or 2 * half + 3 > len(x) // 2:
        return None
    transform = np.fft.rfft(x[:, channels], axis=0) / np.sqrt(len(x))
    if width is None:
        half = _holding_lines(np.abs(transform[:, 0]) ** 2, frequency * bins, half, order)
    middle = np.clip(np.rint(frequency * bins).astype(np.int64), half + 1, len(transform) - half - 2)
    parts = [_solve(transform, middle[a:a + _AT_ONCE], frequency[a:a + _AT_ONCE] * bins, half, order)
             for a in range(0, len(frequency), _AT_ONCE)]
    response, noise, weight, power = (np.concatenate(z) for z in zip(*parts, strict=True))
    return _Local(response, noise, weight, power, 2 * half + 1 - unknowns, bins, (2 * half + 1) / bins)


def _holding_lines(power: Array, at: Array, half: int, order: int) -> int:
    """The window, half or more bins to each side, in which the power of the source is that of lines enough.

    (Σ power)² / Σ power² lines of equal power; half of the bins where the source is noise. Three quarters of the windows that
    the source excites must hold order + 3 of them; where no window does, as without excitation, it stays as it is.
    """
    sums = np.cumsum(np.concatenate([np.zeros((1, 2)), np.stack([power, power**2], axis=1)]), axis=0)
    wide = half
    while 2 * wide + 3 <= len(power) // 8:
        middle = np.clip(np.rint(at).astype(np.int64), wide, len(power) - wide - 1)
        first, second = (sums[middle + wide + 1] - sums[middle - wide]).T
        excited = (first > _LEAKED * first.max()) & (second > 0.0)
        if excited.any() and np.quantile(first[excited] ** 2 / second[excited], 0.25) >= order + 3:
            return wide
        wide += max(1, wide // 4)
    return half


def _solve(transform: Complex, middle: Indices, at: Array, half: int, order: int) -> tuple[Complex, Complex, Array, Array]:
    """Least squares in every window round the bins `middle` (windows,); the response at the bins `at`, in between if need be."""
    index = middle[:, None] + np.arange(-half, half + 1)
    local = transform[index]  # (windows, bins, channels)
    powers = ((index - at[:, None]) / half)[:, :, None] ** np.arange(order + 1)
    columns = np.concatenate([powers * local[:, :, :1], powers], axis=2)
    size = np.sqrt((np.abs(columns) ** 2).sum(axis=1))
    size[size == 0.0] = 1.0
    q, r = np.linalg.qr(columns / size[:, None, :])
    power = (np.abs(local[:, :, 0]) ** 2).mean(axis=1)
    strongest = np.abs(transform[1:, 0]).max()
    there = (np.abs(np.diagonal(r, axis1=1, axis2=2)).min(axis=1) > _EMPTY) & (power > (_EMPTY * strongest) ** 2)
    r[~there] = np.eye(r.shape[-1])
    z = local[:, :, 1:]
    seen = np.conj(np.swapaxes(q, 1, 2)) @ z
    inverse = np.linalg.inv(r)
    response = (inverse @ seen)[:, 0] / size[:, :1]
    rest = z - q @ seen
    noise = np.swapaxes(np.swapaxes(np.conj(rest), 1, 2) @ rest, 1, 2) / (2 * half + 1 - columns.shape[2])
    weight = np.where(there, size[:, 0] ** 2 / (np.abs(inverse[:, 0]) ** 2).sum(axis=1), 0.0)
    return response, noise, weight, power


def _together(found: list[_Local], frequency: Array) -> Responses:
    """The mean of stretches, weighted with the power that each response stands on; the noise pooled."""
    weight = np.stack([one.weight for one in found])
    whole = weight.sum(axis=0)
    there = whole > 0.0
    if not there.any():
        raise InputRejected("D09", "the excitation has no power at the frequencies asked for",
                            remedy="excite them, or ask for a wider window")
    share = weight / np.where(there, whole, 1.0)
    response = sum((s[:, None] * one.response for s, one in zip(share, found, strict=True)),
                   np.zeros_like(found[0].response))
    freedom = sum(one.freedom for one in found)
    noise = sum((one.freedom / freedom * one.noise for one in found), np.zeros_like(found[0].noise))
    power = np.asarray(sum(one.power for one in found)) / len(found)
    explained = np.abs(response) ** 2 * power[:, None]
    both = explained + np.diagonal(noise, axis1=1, axis2=2).real
    coherence = np.where(there[:, None] & (both > 0.0), explained / np.where(both > 0.0, both, 1.0), 0.0)
    averages = float(np.median(whole[there] / power[there]))
    spacing = float(frequency[1] - frequency[0]) if len(frequency) > 1 else np.inf
    correlated = max(1.0, averages / sum(one.bins for one in found) / spacing)
    covariance = np.where(there[:, None, None], noise / np.where(there, whole, 1.0)[:, None, None], np.inf)
    return Responses(frequency, np.where(there[:, None], response, np.nan), covariance, coherence, "local polynomial",
                     max(one.width for one in found), averages, correlated, float(freedom))
