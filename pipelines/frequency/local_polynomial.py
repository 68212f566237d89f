"""Estimate responses by local polynomials: any excitation, without the leakage of windows.

    X_out(k + r) = G(k + r) X_source(k + r) + T(k + r) + noise        for |r| ≤ n bins

of the transform of the whole record: response G and transient T are smooth, so near each frequency
both are polynomials in r, found by least squares. The rest is the noise, with the degrees of
freedom of the window. Several outputs share the regressors. Several stretches share the response,
in one system of equations, and each has a transient of its own: the window is as narrow as all of
them together allow.

Pintelon, Schoukens 2012, System Identification, §7.2, eq. (7-6) to (7-24).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.errors import InputRejected, UsageError
from pipelines.frequency.config import PolynomialConfig
from pipelines.frequency.spectra import Array, Complex, Responses, missing_samples

__all__ = ["local_polynomial"]

_CONFIG = PolynomialConfig()
_TERMS = _CONFIG.order + 1  # numerics: numbers of a polynomial


@dataclass(frozen=True, eq=False)
class _Record:
    """The transform of one stretch."""

    transform: Complex  # (bins, channels), over the root of the samples: noise as of any stretch
    bins: float  # a hertz
    half: int  # bins to each side of a window


def local_polynomial(
    stretches: Sequence[Array],
    rate: float,
    frequency: Array,
    source: int = 0,
    outputs: Sequence[int] = (1, 2),
) -> Responses:
    """Return responses from channel `source` to `outputs`, with the covariance of the noise.

    Where the source has no power round a frequency the response is NaN, its covariance infinite,
    its coherence 0. The window is the narrowest that leaves ten degrees of freedom, has room for
    most of what was recorded, and holds enough lines of a periodic source. That is wide: for a
    periodic source `multisine_responses` resolves more.

    Args:
        stretches: each (samples, channels); one too short for a window is left out.
        rate: samples a second [Hz].
        frequency: [Hz] (frequencies,) evenly spaced, where the responses are wanted.

    Raises:
        InputRejected: T08, no stretch is long enough; D09, no power of the source anywhere; D01,
            missing samples.
    """
    if not ((frequency > 0.0) & (frequency < 0.5 * rate)).all():
        asked = f"frequencies {frequency.min():g} to {frequency.max():g} Hz at {rate:g} Hz"
        raise UsageError("C02", asked, remedy="ask for frequencies between 0 and half the rate")
    if not all(np.isfinite(x).all() for x in stretches):
        raise missing_samples("response")
    channels = [source, *outputs]
    whole = [
        _Record(np.fft.rfft(x[:, channels], axis=0) / np.sqrt(len(x)), len(x) / rate, 0)
        for x in stretches
        if len(x)
    ]
    records = _narrowest(whole, frequency)
    if not records:
        longest = max((one.bins for one in whole), default=0.0)
        words = f"{longest:.3g} s at most are too short for local polynomials"
        raise InputRejected("T08", words, remedy="record longer")
    step = _CONFIG.at_once
    parts = [_solve(records, frequency[a : a + step]) for a in range(0, len(frequency), step)]
    found = [np.concatenate(z) for z in zip(*parts, strict=True)]
    return _responses(records, frequency, *found)


def _responses(
    records: list[_Record],
    frequency: Array,
    response: Complex,
    noise: Complex,
    weight: Array,
    power: Array,
) -> Responses:
    """With coherence, and how many neighbouring frequencies make one independent estimate."""
    there = weight > 0.0
    if not there.any():
        words = "the excitation has no power at the frequencies asked for"
        raise InputRejected("D09", words, remedy="excite them")
    explained = np.abs(response) ** 2 * power[:, None]
    both = explained + np.diagonal(noise, axis1=1, axis2=2).real
    coherence = explained / np.where(both > 0.0, both, 1.0)
    coherence = np.where(there[:, None] & (both > 0.0), coherence, 0.0)
    averages = float(np.median(weight[there] / power[there]))
    spacing = float(frequency[1] - frequency[0]) if len(frequency) > 1 else np.inf
    spread = noise / np.where(there, weight, 1.0)[:, None, None]
    return Responses(
        frequency,
        np.where(there[:, None], response, np.nan),
        np.where(there[:, None, None], spread, np.inf),
        coherence,
        "local polynomial",
        max((2 * one.half + 1) / one.bins for one in records),
        averages,
        max(1.0, averages / sum(one.bins for one in records) / spacing),
        float(_freedom(records)),
    )


def _freedom(records: list[_Record]) -> int:
    """Equations less unknowns: one response, and a transient for each stretch."""
    return sum(2 * one.half + 1 for one in records) - _TERMS * (len(records) + 1)


def _narrowest(whole: list[_Record], frequency: Array) -> list[_Record]:
    """Return the stretches with the narrowest window that will do; none where no window does."""
    total = sum(one.bins for one in whole)
    width = 2.0 * _CONFIG.half / max((one.bins for one in whole), default=1.0)
    enough: list[_Record] = []
    while width < 0.5 * float(frequency[-1]):
        sized = [replace(one, half=int(0.5 * width * one.bins)) for one in whole]
        records = [
            one
            for one in sized
            if one.half >= _CONFIG.half and 2 * (one.half + 1) < len(one.transform)
        ]
        free = records and _freedom(records) >= _CONFIG.freedom
        if free and sum(one.bins for one in records) >= 0.5 * total:
            enough = enough or records  # without excitation no window holds lines: as it is
            if _hold_lines(records, frequency):
                return records
        width *= _CONFIG.wider
    return enough


def _middle(one: _Record, frequency: Array, margin: int) -> Array:
    """Bins nearest to these frequencies round which a window has room."""
    last = len(one.transform) - one.half - 1 - margin
    return np.clip(np.rint(frequency * one.bins).astype(np.int64), one.half + margin, last)


def _hold_lines(records: list[_Record], frequency: Array) -> bool:
    """Return whether three quarters of the excited windows hold order + 3 lines of the source.

    (Σ power)² / Σ power² lines of equal power; half of the bins where the source is noise.
    """
    sums = np.zeros((2, len(frequency)))
    for one in records:
        power = np.abs(one.transform[:, 0]) ** 2
        upto = np.pad(np.cumsum([power, power**2], axis=1), ((0, 0), (1, 0)))
        middle = _middle(one, frequency, 0)
        sums += upto[:, middle + one.half + 1] - upto[:, middle - one.half]
    first, second = sums
    excited = (first > _CONFIG.leaked * first.max()) & (second > 0.0)
    lines = first[excited] ** 2 / second[excited]
    return bool(excited.any() and np.quantile(lines, 0.25) >= _CONFIG.order + 3)


def _solve(records: list[_Record], frequency: Array) -> tuple[Complex, Complex, Array, Array]:
    """Least squares in every window: response, noise covariance, weight and power of the source.

    (windows, …) each. The transient of a stretch is taken out of its window beforehand: what is
    orthogonal to its polynomial is the same for all frequencies.
    """
    rows, powers = [], []
    widest = max(one.half / one.bins for one in records)
    for one in records:
        offsets = np.arange(-one.half, one.half + 1)
        index = _middle(one, frequency, 1)[:, None] + offsets
        local = one.transform[index]  # (windows, bins, channels)
        away = ((index / one.bins - frequency[:, None]) / widest)[:, :, None] ** np.arange(_TERMS)
        basis, _ = np.linalg.qr((offsets[:, None] / one.half) ** np.arange(_TERMS))
        both = np.concatenate([away * local[:, :, :1], local[:, :, 1:]], axis=2)
        rows.append(both - basis @ (basis.T @ both))
        powers.append(np.abs(local[:, :, 0]) ** 2)
    stacked, power = np.concatenate(rows, axis=1), np.concatenate(powers, axis=1).mean(axis=1)
    columns, z = stacked[:, :, :_TERMS], stacked[:, :, _TERMS:]
    size = np.sqrt((np.abs(columns) ** 2).sum(axis=1))
    size[size == 0.0] = 1.0
    q, r = np.linalg.qr(columns / size[:, None, :])
    strongest = max(float(np.abs(one.transform[1:, 0]).max()) for one in records)
    there = np.abs(np.diagonal(r, axis1=1, axis2=2)).min(axis=1) > _CONFIG.empty
    there &= power > (_CONFIG.empty * strongest) ** 2
    r[~there] = np.eye(_TERMS)
    seen = np.conj(np.swapaxes(q, 1, 2)) @ z
    inverse = np.linalg.inv(r)
    rest = z - q @ seen
    noise = np.swapaxes(np.swapaxes(np.conj(rest), 1, 2) @ rest, 1, 2) / _freedom(records)
    told = size[:, 0] ** 2 / (np.abs(inverse[:, 0]) ** 2).sum(axis=1)
    return (inverse @ seen)[:, 0] / size[:, :1], noise, np.where(there, told, 0.0), power
