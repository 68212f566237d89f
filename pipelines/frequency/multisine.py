"""Estimate responses to a periodic excitation: separate noise from nonlinear distortion.

    found = multisine_responses(realisations, rate, period)
    found.noise      covariance of what differs between periods: measurement noise, disturbances
    found.total      covariance of what differs between realisations: noise and distortion
    found.detection  the outputs at lines that were not excited: even and odd distortion

In P periods the excitation fills every P-th bin of the transform. What the bins in between hold is
noise and transient; the transient is smooth, a polynomial round every line (Pintelon, Schoukens
2012, System Identification, §7.3), and is taken off. What stays between realisations of other
phases, beyond the noise, is distortion (ibid. §4.3.1, the robust method).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected, UsageError
from pipelines.frequency.config import LinesConfig
from pipelines.frequency.spectra import Array, Complex, Responses, missing_samples

__all__ = ["DetectionLines", "MultisineResponses", "multisine_responses"]

Indices = npt.NDArray[np.int64]

_CONFIG = LinesConfig()


@dataclass(frozen=True, eq=False)
class DetectionLines:
    """Mean power of the outputs at harmonics that the excitation leaves out, below its highest."""

    frequency: Array  # [Hz] (lines,)
    odd: npt.NDArray[np.bool_]  # an odd multiple of 1/period (lines,)
    power: Array  # |mean over periods|², mean over realisations [unit²] (lines, outputs)
    noise: Array  # what of that the noise explains (lines, outputs)


@dataclass(frozen=True, eq=False)
class MultisineResponses:
    """At the excited lines."""

    noise: Responses
    total: Responses | None  # the same responses; None of one realisation
    detection: DetectionLines | None  # None where every line is excited


def multisine_responses(
    realisations: Sequence[Array],
    rate: float,
    period: int,
    source: int = 0,
    outputs: Sequence[int] = (1, 2),
) -> MultisineResponses:
    """Return responses at the lines of channel `source`, from records of whole periods.

    The last whole periods of each record are used, so a start from rest is best cut off before.

    Args:
        realisations: each (samples, channels), periodic with `period`, its phases drawn anew.
        rate: samples a second [Hz].
        period: [samples].

    Raises:
        InputRejected: T07, fewer than two periods; D09, a source without power; D01, missing
            samples.
        UsageError: C02, realisations that do not excite the same lines.
    """
    if not realisations:
        raise InputRejected("T07", "no realisation", remedy="give at least one record")
    found = [_harmonics(x[:, [source, *outputs]], period) for x in realisations]
    excited = [_excited(mean[:, 0]) for mean, _ in found]
    if any(not np.array_equal(k, excited[0]) for k in excited[1:]):
        remedy = "analyse those of one amplitude spectrum together"
        raise UsageError("C02", "realisations that excite different lines", remedy=remedy)
    lines, m = excited[0], len(found)
    each = np.stack([mean[lines, 1:] / mean[lines, :1] for mean, _ in found])
    power = [np.abs(mean[lines, 0])[:, None, None] ** 2 for mean, _ in found]
    noise = [one[lines, 1:, 1:] / own for (_, one), own in zip(found, power, strict=True)]
    response = each.mean(axis=0)
    frequency = np.asarray(lines * (rate / period), dtype=np.float64)
    periods = sum(len(x) // period for x in realisations)

    def responses(covariance: Complex, freedom: int) -> Responses:
        own = np.diagonal(covariance, axis1=1, axis2=2).real * periods  # of one period
        size = np.abs(response) ** 2
        coherence = size / np.maximum(size + own, 1e-300)
        kind = ("multisine", rate / period, float(periods), 1.0, float(freedom))
        return Responses(frequency, response, covariance, coherence, *kind)

    total = None
    if m > 1:
        rest, pooled = each - response, -(-_CONFIG.freedom // (m - 1)) | 1
        between = np.einsum("mka,mkb->kab", rest, np.conj(rest)) / ((m - 1) * m)
        total = responses(_pooled(between, np.abs(response), pooled), pooled * (m - 1))
    by_noise = responses(np.sum(noise, axis=0) / m**2, m * _CONFIG.freedom)
    dark = np.setdiff1d(np.arange(1, lines[-1]), lines)
    if not len(dark):
        return MultisineResponses(by_noise, total, None)
    seen = np.mean([np.abs(mean[dark, 1:]) ** 2 for mean, _ in found], axis=0)
    unseen = np.mean([np.diagonal(own[dark, 1:, 1:], 0, 1, 2).real for _, own in found], axis=0)
    detection = DetectionLines(dark * (rate / period), dark % 2 == 1, seen, unseen)
    return MultisineResponses(by_noise, total, detection)


def _pooled(covariance: Complex, size: Array, neighbours: int) -> Complex:
    """Return the mean of `neighbours` lines, relative to the `size` of responses (lines, outputs).

    Few realisations tell little of one line; distortion is smooth over the lines (ibid. §3.4).
    """
    scale = np.maximum(size, 1e-300)[:, :, None] * np.maximum(size, 1e-300)[:, None, :]
    around = np.arange(len(size))[:, None] + np.arange(neighbours) - neighbours // 2
    around = np.clip(around, 0, len(size) - 1)
    return np.asarray((covariance / scale)[around].mean(axis=1) * scale)


def _harmonics(x: Array, period: int) -> tuple[Complex, Complex]:
    """Amplitudes of the harmonics of the last whole periods of x, less their transient.

    Returns (harmonics, channels), harmonic k at k / period, and the covariance of that mean.
    """
    periods = len(x) // period if period >= _CONFIG.shortest else 0
    if periods <= 1:
        words = f"{len(x)} samples hold fewer than two periods of {period}"
        raise InputRejected("T07", words, remedy="record more periods, or use another method")
    x = x[len(x) - periods * period :]
    if not np.isfinite(x).all():
        raise missing_samples("response")
    transform = np.fft.rfft(x, axis=0) * (2.0 / len(x))
    harmonics = np.arange(1, (period - 1) // 2 + 1)
    # bins round a line that hold no harmonic, enough for the polynomial and the noise
    count = (_CONFIG.order + 1 + _CONFIG.freedom + 1) // 2
    side = np.arange(1, 4 * count * periods)
    side = side[side % periods != 0]
    offsets = np.concatenate([-side[:count][::-1], side[:count]])
    if offsets[-1] + 1 >= len(transform) // 2:
        words = f"{len(x)} samples hold too few bins between the lines"
        raise InputRejected("T08", words, remedy="record more periods")
    size, channels = len(harmonics) + 1, x.shape[1]
    mean = np.zeros((size, channels), dtype=np.complex128)
    noise = np.zeros((size, channels, channels), dtype=np.complex128)
    middle = harmonics * periods
    inner = (middle + offsets[0] >= 0) & (middle + offsets[-1] < len(transform))
    low = harmonics < len(harmonics) // 2
    above, below = side[: 2 * count], -side[: 2 * count]  # for lines at the ends of the spectrum
    for chosen, around in ((inner, offsets), (~inner & low, above), (~inner & ~low, below)):
        k = harmonics[chosen]
        mean[k], noise[k] = _less_transient(transform, middle[chosen], around)
    return mean, noise


def _less_transient(
    transform: Complex, middle: Indices, offsets: Indices
) -> tuple[Complex, Complex]:
    """Amplitudes at the bins `middle` less the polynomial through those round them; covariance."""
    powers = (offsets[:, None] / np.abs(offsets).max()) ** np.arange(_CONFIG.order + 1)
    inverse = np.linalg.pinv(powers)
    local = transform[middle[:, None] + offsets]  # (lines, offsets, channels)
    transient = np.einsum("s,ksc->kc", inverse[0], local)
    rest = local - np.einsum("st,ktc->ksc", powers @ inverse, local)
    covariance = np.einsum("ksa,ksb->kab", rest, np.conj(rest))
    covariance /= len(offsets) - _CONFIG.order - 1
    return transform[middle] - transient, covariance * (1.0 + float(inverse[0] @ inverse[0]))


def _excited(source: Complex) -> Indices:
    """Harmonics with power of the source."""
    size = np.abs(source)
    if not size.max() > 0.0:
        words = "the excitation has no power at any harmonic of its period"
        raise InputRejected("D09", words, remedy="check the period, and that the excitation was on")
    return np.asarray(np.flatnonzero(size > _CONFIG.excited * size.max()), dtype=np.int64)
