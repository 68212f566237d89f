"""Responses by local polynomials: what an excitation of any kind tells, without the leakage that windows leave.

    X_out(k + r) = G(k + r) X_source(k + r) + T(k + r) + noise        for |r| ≤ n bins

of the transform of the whole record: response G and transient T are smooth, so near each frequency both are polynomials in r,
found by least squares. What is left is the noise, with the degrees of freedom of the window. Several outputs share the
regressors. Several stretches share the response, in one system of equations, and each has a transient of its own: the window
is as narrow as all of them together allow.

Pintelon, Schoukens 2012, System Identification, §7.2, eq. (7-6) to (7-24).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.errors import InputRejected, UsageError
from pipelines.frequency.frequency_response import Array, Complex, Responses

__all__ = ["local_polynomial"]

_FREEDOM = 10  # least degrees of freedom of the noise estimate: its own deviation is then a third
_LEAST_HALF = 2  # bins to each side of a window in one stretch: with fewer its transient takes them all
_AT_ONCE = 500  # windows solved together
_WIDER = 1.15  # factor from one trial of the width to the next
_EMPTY = 1e-10  # of the strongest amplitude: what is smaller is rounding, no source
_LEAKED = 1e-6  # of the power in the strongest window: what is smaller has leaked from lines elsewhere


@dataclass(frozen=True, eq=False)
class _Record:
    """The transform of one stretch."""

    transform: Complex  # (bins, channels), over the root of the samples: the noise of a bin is that of any other stretch
    bins: float  # a hertz
    half: int  # bins to each side of a window


def local_polynomial(stretches: Sequence[Array], rate: float, frequency: Array, source: int = 0, outputs: Sequence[int] = (1, 2),
                     order: int = 2, width: float | None = None) -> Responses:
    """Responses from channel `source` to `outputs` at every `frequency`, with the covariance of the noise.

    Where the source has no power round a frequency the response is NaN, its covariance infinite, its coherence 0.

    Args:
        stretches: each (samples, channels); one too short for a window is left out.
        rate: samples a second [Hz].
        frequency: [Hz] (frequencies,) evenly spaced, where the responses are wanted.
        order: of both polynomials.
        width: [Hz] of the window; None for the narrowest that leaves ten degrees of freedom, has room for most of what was
            recorded, and holds enough lines of a periodic source. That is wide: for a periodic source `multisine_responses`
            resolves more.

    Raises:
        InputRejected: T08, no stretch is long enough for the width; D09, no power of the source anywhere; D01, missing samples.
    """
    if order < 0 or not ((frequency > 0.0) & (frequency < 0.5 * rate)).all():
        raise UsageError("C02", f"order {order}, frequencies {frequency.min():g} to {frequency.max():g} Hz at {rate:g} Hz",
                         remedy="ask for frequencies between 0 and half the rate")
    if not all(np.isfinite(x).all() for x in stretches):
        raise InputRejected("D01", "missing samples in a signal whose response is asked for", remedy="cut the log at its gaps")
    channels = [source, *outputs]
    whole = [_Record(np.fft.rfft(x[:, channels], axis=0) / np.sqrt(len(x)), len(x) / rate, 0) for x in stretches if len(x)]
    records = _narrowest(whole, frequency, order) if width is None else _of_width(whole, width, order)
    if not records or _freedom(records, order) < 1:
        longest = max((len(x) for x in stretches), default=0) / rate
        raise InputRejected("T08", f"{longest:.3g} s at most are too short for local polynomials of order {order}"
                            + ("" if width is None else f" over {width:.3g} Hz"), remedy="record longer, or ask for a wider window")
    parts = [_solve(records, frequency[a:a + _AT_ONCE], order) for a in range(0, len(frequency), _AT_ONCE)]
    response, noise, weight, power = (np.concatenate(z) for z in zip(*parts, strict=True))
    return _responses(records, frequency, response, noise, weight, power, _freedom(records, order))


def _of_width(whole: list[_Record], width: float, order: int) -> list[_Record]:
    """The stretches in which a window of `width` [Hz] has room, with its bins."""
    sized = [replace(one, half=int(0.5 * width * one.bins)) for one in whole]
    return [one for one in sized if one.half >= max(_LEAST_HALF, (order + 2) // 2) and 2 * one.half + 3 <= len(one.transform)]


def _freedom(records: list[_Record], order: int) -> int:
    """Equations less unknowns: one response, and a transient for each stretch."""
    return sum(2 * one.half + 1 for one in records) - (order + 1) * (len(records) + 1)


def _narrowest(whole: list[_Record], frequency: Array, order: int) -> list[_Record]:
    """With the narrowest window that will do; none where no window does."""
    total = sum(one.bins for one in whole)
    width = 2.0 * _LEAST_HALF / max((one.bins for one in whole), default=1.0)
    enough: list[_Record] = []
    while width < 0.5 * float(frequency[-1]):
        records = _of_width(whole, width, order)
        if records and _freedom(records, order) >= _FREEDOM and sum(one.bins for one in records) >= 0.5 * total:
            enough = enough or records  # without excitation no window holds lines: as it is
            if _hold_lines(records, frequency, order):
                return records
        width *= _WIDER
    return enough


def _hold_lines(records: list[_Record], frequency: Array, order: int) -> bool:
    """Return whether three quarters of the windows that the source excites hold order + 3 lines of it.

    (Σ power)² / Σ power² lines of equal power; half of the bins where the source is noise.
    """
    first, second = np.zeros(len(frequency)), np.zeros(len(frequency))
    for one in records:
        power = np.abs(one.transform[:, 0]) ** 2
        sums = np.cumsum(np.concatenate([np.zeros((1, 2)), np.stack([power, power**2], axis=1)]), axis=0)
        middle = np.clip(np.rint(frequency * one.bins).astype(np.int64), one.half, len(power) - one.half - 1)
        a, b = (sums[middle + one.half + 1] - sums[middle - one.half]).T
        first, second = first + a, second + b
    excited = (first > _LEAKED * first.max()) & (second > 0.0)
    return bool(excited.any() and np.quantile(first[excited] ** 2 / second[excited], 0.25) >= order + 3)


def _solve(records: list[_Record], frequency: Array, order: int) -> tuple[Complex, Complex, Array, Array]:
    """Least squares in every window: response and noise covariance (windows, …), weight and power of the source (windows,).

    The transient of a stretch is taken out of its window beforehand: what is orthogonal to its polynomial is the same for all
    frequencies.
    """
    rows, powers = [], []
    widest = max(one.half / one.bins for one in records)
    for one in records:
        middle = np.clip(np.rint(frequency * one.bins).astype(np.int64), one.half + 1, len(one.transform) - one.half - 2)
        offsets = np.arange(-one.half, one.half + 1)
        index = middle[:, None] + offsets
        local = one.transform[index]  # (windows, bins, channels)
        away = ((index / one.bins - frequency[:, None]) / widest)[:, :, None] ** np.arange(order + 1)
        basis, _ = np.linalg.qr((offsets[:, None] / one.half) ** np.arange(order + 1))
        both = np.concatenate([away * local[:, :, :1], local[:, :, 1:]], axis=2)
        rows.append(both - basis @ (basis.T @ both))
        powers.append(np.abs(local[:, :, 0]) ** 2)
    stacked, power = np.concatenate(rows, axis=1), np.concatenate(powers, axis=1).mean(axis=1)
    columns, z = stacked[:, :, :order + 1], stacked[:, :, order + 1:]
    size = np.sqrt((np.abs(columns) ** 2).sum(axis=1))
    size[size == 0.0] = 1.0
    q, r = np.linalg.qr(columns / size[:, None, :])
    strongest = max(float(np.abs(one.transform[1:, 0]).max()) for one in records)
    there = (np.abs(np.diagonal(r, axis1=1, axis2=2)).min(axis=1) > _EMPTY) & (power > (_EMPTY * strongest) ** 2)
    r[~there] = np.eye(order + 1)
    seen = np.conj(np.swapaxes(q, 1, 2)) @ z
    inverse = np.linalg.inv(r)
    rest = z - q @ seen
    noise = np.swapaxes(np.swapaxes(np.conj(rest), 1, 2) @ rest, 1, 2) / _freedom(records, order)
    weight = np.where(there, size[:, 0] ** 2 / (np.abs(inverse[:, 0]) ** 2).sum(axis=1), 0.0)
    return (inverse @ seen)[:, 0] / size[:, :1], noise, weight, power


def _responses(records: list[_Record], frequency: Array, response: Complex, noise: Complex, weight: Array, power: Array,
               freedom: int) -> Responses:
    """With coherence, and how many neighbouring frequencies make one independent estimate."""
    there = weight > 0.0
    if not there.any():
        raise InputRejected("D09", "the excitation has no power at the frequencies asked for",
                            remedy="excite them, or ask for a wider window")
    explained = np.abs(response) ** 2 * power[:, None]
    both = explained + np.diagonal(noise, axis1=1, axis2=2).real
    coherence = np.where(there[:, None] & (both > 0.0), explained / np.where(both > 0.0, both, 1.0), 0.0)
    averages = float(np.median(weight[there] / power[there]))
    spacing = float(frequency[1] - frequency[0]) if len(frequency) > 1 else np.inf
    correlated = max(1.0, averages / sum(one.bins for one in records) / spacing)
    covariance = np.where(there[:, None, None], noise / np.where(there, weight, 1.0)[:, None, None], np.inf)
    return Responses(frequency, np.where(there[:, None], response, np.nan), covariance, coherence, "local polynomial",
                     max((2 * one.half + 1) / one.bins for one in records), averages, correlated, float(freedom))
