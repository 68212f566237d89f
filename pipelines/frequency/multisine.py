"""Responses to a periodic excitation: noise told apart from nonlinear distortion.

    found = multisine_responses(realisations, rate, period)
    found.noise      response at the excited lines; covariance of what differs between periods: measurement noise, disturbances
    found.total      the same response; covariance of what differs between realisations: noise and nonlinear distortion
    found.detection  what the outputs show at lines that were not excited: even and odd distortion, from one realisation already

In P periods the excitation fills every P-th bin of the transform. What the bins in between hold is noise and transient; the
transient is smooth, a polynomial round every line (Pintelon, Schoukens 2012, System Identification, §7.3), and is taken off.
What stays between realisations of other phases, beyond the noise, is distortion (ibid. §4.3.1, the robust method).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected, UsageError
from pipelines.frequency.frequency_response import Array, Complex, Responses

__all__ = ["DetectionLines", "MultisineResponses", "multisine_responses"]

Indices = npt.NDArray[np.int64]

_EXCITED = 1e-3  # of the strongest line's amplitude: what is weaker is no line of the excitation
_FREEDOM = 10  # degrees of freedom of the noise at a line


@dataclass(frozen=True, eq=False)
class DetectionLines:
    """Mean power of the outputs at harmonics of the period that the excitation leaves out, below its highest line."""

    frequency: Array  # [Hz] (lines,)
    odd: npt.NDArray[np.bool_]  # an odd multiple of 1/period (lines,)
    power: Array  # |mean over periods|², mean over realisations [unit²] of an amplitude (lines, outputs)
    noise: Array  # what of that the noise explains (lines, outputs)

    def exceeds(self, times: float = 5.0) -> npt.NDArray[np.bool_]:
        """Lines with more than so many times the power of the noise (lines, outputs)."""
        return np.asarray(self.power > times * self.noise)


@dataclass(frozen=True, eq=False)
class MultisineResponses:
    """At the excited lines."""

    noise: Responses
    total: Responses | None  # None of one realisation
    detection: DetectionLines | None  # None where every line is excited
    amplitude: Array  # mean |amplitude| of each output at the excited lines [unit] (lines, outputs)
    periods: tuple[int, ...]  # of each realisation
    realisations: int

    def distortion(self) -> Array | None:
        """Std of the response by nonlinear distortion in one realisation (lines, outputs); 0 where noise explains all."""
        if self.total is None:
            return None
        more = np.diagonal(self.total.covariance - self.noise.covariance, axis1=1, axis2=2).real
        return np.asarray(np.sqrt(np.maximum(more, 0.0) * self.realisations))


@dataclass(frozen=True, eq=False)
class _Lines:
    """Of one realisation: every harmonic of the period, the transient taken off."""

    mean: Complex  # amplitude of each channel (harmonics, channels); harmonic k at k / period
    noise: Complex  # covariance of that mean (harmonics, channels, channels)
    periods: int


def multisine_responses(realisations: Sequence[Array], rate: float, period: int, source: int = 0,
                        outputs: Sequence[int] = (1, 2), order: int = 2) -> MultisineResponses:
    """Responses at the lines of channel `source`, from records of whole periods.

    The last whole periods of each record are used, so a start from rest is best cut off before by the caller.

    Args:
        realisations: each (samples, channels), periodic with `period`, its phases drawn anew.
        rate: samples a second [Hz].
        period: [samples].
        order: of the polynomial that the transient follows round a line.

    Raises:
        InputRejected: T07, fewer than two periods; D09, a source without power; D01, missing samples.
        UsageError: C02, realisations that do not excite the same lines.
    """
    z = [source, *outputs]
    found = [_lines(x[:, z], period, order) for x in realisations]
    excited = [_excited(one.mean[:, 0]) for one in found]
    if not excited:
        raise InputRejected("T07", "no realisation", remedy="give at least one record")
    if any(not np.array_equal(k, excited[0]) for k in excited[1:]):
        raise UsageError("C02", "realisations that excite different lines",
                         remedy="analyse those of one amplitude spectrum together")
    lines, m = excited[0], len(found)
    each = np.stack([one.mean[lines, 1:] / one.mean[lines, :1] for one in found])
    noise = np.stack([one.noise[lines, 1:, 1:] / (np.abs(one.mean[lines, 0]) ** 2)[:, None, None] for one in found])
    response, frequency = each.mean(axis=0), np.asarray(lines * (rate / period), dtype=np.float64)
    total, pooled = None, -(-_FREEDOM // max(m - 1, 1)) | 1
    if m > 1:
        rest = each - response
        total = _pooled(np.einsum("mka,mkb->kab", rest, np.conj(rest)) / ((m - 1) * m), np.abs(response), pooled)
    periods = tuple(one.periods for one in found)

    def responses(covariance: Complex, freedom: int) -> Responses:
        own = np.diagonal(covariance, axis1=1, axis2=2).real * sum(periods)  # of one period
        return Responses(frequency, response, covariance, np.abs(response) ** 2 / np.maximum(np.abs(response) ** 2 + own, 1e-300),
                         "multisine", rate / period, float(sum(periods)), 1.0, float(freedom))

    amplitude = np.mean([np.abs(one.mean[lines, 1:]) for one in found], axis=0)
    by_noise = responses(noise.sum(axis=0) / m**2, m * _FREEDOM)
    by_all = None if total is None else responses(total, pooled * (m - 1))
    return MultisineResponses(by_noise, by_all, _detection(found, lines, rate / period), amplitude, periods, m)


def _pooled(covariance: Complex, size: Array, neighbours: int) -> Complex:
    """The mean of `neighbours` lines, relative to the `size` of the responses (lines, outputs).

    Few realisations tell little of one line; distortion is smooth over the lines (Pintelon, Schoukens 2012, §3.4).
    """
    scale = np.maximum(size, 1e-300)[:, :, None] * np.maximum(size, 1e-300)[:, None, :]
    around = np.clip(np.arange(len(size))[:, None] + np.arange(neighbours) - neighbours // 2, 0, len(size) - 1)
    return np.asarray((covariance / scale)[around].mean(axis=1) * scale)


def _lines(x: Array, period: int, order: int) -> _Lines:
    """Amplitudes of the harmonics of the last whole periods of x (samples, channels), less their transient."""
    periods = len(x) // period if period >= 4 else 0
    if periods < 2:
        raise InputRejected("T07", f"{len(x)} samples hold fewer than two periods of {period}",
                            remedy="record more periods, or use another method")
    x = x[len(x) - periods * period:]
    if not np.isfinite(x).all():
        raise InputRejected("D01", "missing samples in a signal whose response is asked for", remedy="cut the log at its gaps")
    transform = np.fft.rfft(x, axis=0) * (2.0 / len(x))
    harmonics = np.arange(1, (period - 1) // 2 + 1)
    offsets = _offsets(periods, order)
    if offsets[-1] + 1 >= len(transform) // 2:
        raise InputRejected("T08", f"{len(x)} samples hold too few bins between the lines", remedy="record more periods")
    size, channels = len(harmonics) + 1, x.shape[1]
    mean, noise = np.zeros((size, channels), np.complex128), np.zeros((size, channels, channels), np.complex128)
    middle = harmonics * periods
    inner = (middle + offsets[0] >= 0) & (middle + offsets[-1] < len(transform))
    for chosen, around in ((inner, offsets), (~inner & (harmonics < len(harmonics) // 2), _one_sided(offsets, periods)),
                           (~inner & (harmonics >= len(harmonics) // 2), -_one_sided(offsets, periods))):
        k = harmonics[chosen]
        mean[k], noise[k] = _less_transient(transform, middle[chosen], around, order)
    return _Lines(mean, noise, periods)


def _offsets(periods: int, order: int) -> Indices:
    """Bins round a line that hold no harmonic, as many on each side, enough for the polynomial and the noise."""
    need = (order + 1 + _FREEDOM + 1) // 2
    side = np.arange(1, 2 * need * periods)
    side = side[side % periods != 0][:need]
    return np.asarray(np.concatenate([-side[::-1], side]), dtype=np.int64)


def _one_sided(offsets: Indices, periods: int) -> Indices:
    """As many on one side, for lines at the end of the spectrum."""
    side = np.arange(1, 2 * len(offsets) * periods)
    return np.asarray(side[side % periods != 0][:len(offsets)], dtype=np.int64)


def _less_transient(transform: Complex, middle: Indices, offsets: Indices, order: int) -> tuple[Complex, Complex]:
    """Amplitudes at the bins `middle` less the polynomial through those round them, and the covariance of that."""
    powers = (offsets[:, None] / np.abs(offsets).max()) ** np.arange(order + 1)
    inverse = np.linalg.pinv(powers)
    local = transform[middle[:, None] + offsets]  # (lines, offsets, channels)
    transient = np.einsum("s,ksc->kc", inverse[0], local)
    rest = local - np.einsum("st,ktc->ksc", powers @ inverse, local)
    covariance = np.einsum("ksa,ksb->kab", rest, np.conj(rest)) / (len(offsets) - order - 1)
    return transform[middle] - transient, covariance * (1.0 + float(inverse[0] @ inverse[0]))


def _excited(source: Complex) -> Indices:
    """Harmonics with power of the source."""
    size = np.abs(source)
    if not size.max() > 0.0:
        raise InputRejected("D09", "the excitation has no power at any harmonic of its period",
                            remedy="check the period, and that the excitation was on")
    return np.asarray(np.flatnonzero(size > _EXCITED * size.max()), dtype=np.int64)


def _detection(found: list[_Lines], lines: Indices, spacing: float) -> DetectionLines | None:
    dark = np.setdiff1d(np.arange(1, lines[-1]), lines)
    if not len(dark):
        return None
    power = np.mean([np.abs(one.mean[dark, 1:]) ** 2 for one in found], axis=0)
    noise = np.mean([np.diagonal(one.noise[dark, 1:, 1:], axis1=1, axis2=2).real for one in found], axis=0)
    return DetectionLines(dark * spacing, dark % 2 == 1, power, noise)
