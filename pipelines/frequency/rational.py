"""A rational function through a frequency response: modes, plateaus and delay, each with its deviation.

    H(s) = g s⁻ⁱ (held, sampled) e^(-s delay) · Π (1 + b s + a s²) [zeros] / Π (1 + b s + a s²) [poles]

    found = fit_rational(frequency, response, variance, integrators=2, hold=1e-3, ...)    # rational_search.py
    found.modes()                       resonances and antiresonances inside the band, by frequency
    found.low, found.high               g below all modes, and what is left of it above them, g Π a_zeros / Π a_poles
    found.delay                         [s], beside the hold

Products of sections, with s in units of the middle of the band, keep the fit well conditioned at any order, and every section is
a mode: ω = 1/√a, ζ = b / (2√a). g, a and b are positive: poles are stable and every damping is positive, as of a passive
structure that is moved and measured at one place (all zeros of such a response are minimum phase, too). Maximum likelihood: the
sum of |Ĝ - H|² / variance is smallest (Pintelon, Schoukens 2012, System Identification, §9.11); the number of sections is that
of the shortest description (ibid. §11.3; Rissanen 1978, Automatica 14).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

__all__ = ["Array", "Complex", "Known", "Mode", "Rational", "known_part", "product"]

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

_CANCELS = 2.0  # standard deviations within which a resonance and an antiresonance are the same


@dataclass(frozen=True)
class Known:
    """A value and its standard deviation."""

    value: float
    std: float


@dataclass(frozen=True)
class Mode:
    """One lightly or heavily damped pair of poles or zeros."""

    kind: Literal["resonance", "antiresonance"]
    frequency: Known  # undamped [Hz]
    damping: Known  # ratio [1]
    distinct: bool  # False where one of the other kind takes it away within two standard deviations


@dataclass(frozen=True, eq=False)
class Rational:
    """A fitted function. `parameters`: log g, delay · unit, log b, log a of each zero section, then of each pole section."""

    parameters: Array  # (2 + 2 zeros + 2 poles,), s in `unit`
    covariance: Array  # of them; zero rows for what was held
    zeros: int  # sections
    poles: int
    integrators: int
    hold: float  # [s]; 0 for none
    unit: float  # [rad/s] of s
    band: tuple[float, float]  # [Hz] of the fit
    misfit: float  # mean of |Ĝ - H|² / variance, over degrees of freedom: 1 where the model is right and the variance too
    description: float  # length of the description, to compare numbers of sections on the same data

    def response(self, frequency: Array) -> Complex:
        """H at these frequencies [Hz]."""
        s = np.asarray(2j * np.pi * frequency, dtype=np.complex128)
        value, _ = product(self.parameters, np.asarray(s / self.unit), self.zeros)
        return np.asarray(value * known_part(s, self.integrators, self.hold))

    @property
    def low(self) -> Known:
        """g: the plateau below all modes, of H sⁱ."""
        value = float(np.exp(self.parameters[0]))
        return Known(value, value * float(np.sqrt(self.covariance[0, 0])))

    @property
    def high(self) -> Known:
        """g Π a_zeros / Π a_poles: the plateau above all modes, where there are as many zeros as poles; else (0, 0)."""
        if self.zeros != self.poles:
            return Known(0.0, 0.0)
        sign = np.repeat([1.0, -1.0], [self.zeros, self.poles])
        gradient = np.zeros(len(self.parameters))
        gradient[0], gradient[3::2] = 1.0, sign
        value = float(np.exp(gradient @ self.parameters))
        return Known(value, value * float(np.sqrt(gradient @ self.covariance @ gradient)))

    @property
    def delay(self) -> Known:
        """[s], beside that of the hold."""
        return Known(float(self.parameters[1] / self.unit), float(np.sqrt(self.covariance[1, 1]) / self.unit))

    def modes(self, beyond: float = 1.0) -> tuple[Mode, ...]:
        """Complex pairs whose frequency lies in the band of the fit, or up to `beyond` times its upper end."""
        found = [self._mode(k) for k in range(self.zeros + self.poles)]
        inside = [m for m in found if m is not None and self.band[0] <= m.frequency.value <= beyond * self.band[1]]
        cancelled = _cancelled(inside)
        marked = [Mode(m.kind, m.frequency, m.damping, i not in cancelled) for i, m in enumerate(inside)]
        return tuple(sorted(marked, key=lambda m: m.frequency.value))

    def _mode(self, section: int) -> Mode | None:
        """ω = 1/√a, ζ = b/(2√a); δω/ω = -δ(log a)/2, δζ/ζ = δ(log b) - δ(log a)/2. None for two real roots."""
        at = slice(2 + 2 * section, 4 + 2 * section)
        log_b, log_a = self.parameters[at]
        c, damping = self.covariance[at, at], 0.5 * np.exp(log_b - 0.5 * log_a)
        hertz = self.unit * np.exp(-0.5 * log_a) / (2.0 * np.pi)
        if damping >= 1.0:
            return None
        gradient = damping * np.array([1.0, -0.5])
        kind: Literal["resonance", "antiresonance"] = "antiresonance" if section < self.zeros else "resonance"
        return Mode(kind, Known(float(hertz), float(hertz * 0.5 * np.sqrt(c[1, 1]))),
                    Known(float(damping), float(np.sqrt(gradient @ c @ gradient))), True)


def known_part(s: Complex, integrators: int, hold: float) -> Complex:
    """s⁻ⁱ at s [rad/s] (bins,) of an input that is held between samples; as it is for hold = 0.

    One or two integrators are sampled exactly, T / (z - 1) and T² (z + 1) / (2 (z - 1)²): what lies above half the rate folds
    back, 1.6 % at a fifth of the rate. Otherwise the hold alone, (1 - e^(-sT)) / (s T).
    """
    if hold <= 0.0:
        return np.asarray(s ** -float(integrators))
    step = np.expm1(s * hold)  # z - 1
    if integrators == 1:
        return np.asarray(hold / step)
    if integrators == 2:
        return np.asarray(0.5 * hold**2 * (step + 2.0) / step**2)
    return np.asarray(-np.expm1(-s * hold) / (s * hold) * s ** -float(integrators))


def product(parameters: Array, s: Complex, zeros: int) -> tuple[Complex, Complex]:
    """Everything that is fitted, at s in units of the fit (bins,), and each 1 + b s + a s² (sections, bins)."""
    sections = 1.0 + np.exp(parameters[2::2, None]) * s + np.exp(parameters[3::2, None]) * s**2
    value = np.exp(parameters[0] - s * parameters[1]) * np.prod(sections[:zeros], axis=0) / np.prod(sections[zeros:], axis=0)
    return np.asarray(value), np.asarray(sections)


def _cancelled(modes: Sequence[Mode]) -> set[int]:
    """Places of the modes that one of the other kind takes away, the nearest first, each at most one."""
    gone: set[int] = set()
    near = sorted((_apart(m, o), i, k) for i, m in enumerate(modes) for k, o in enumerate(modes[:i]) if o.kind != m.kind)
    for apart, i, k in near:
        if apart <= _CANCELS and not gone & {i, k}:
            gone |= {i, k}
    return gone


def _apart(m: Mode, other: Mode) -> float:
    """The larger difference of frequency and damping, in standard deviations of it."""
    return max(abs(x.value - y.value) / max(float(np.hypot(x.std, y.std)), 1e-300)
               for x, y in ((m.frequency, other.frequency), (m.damping, other.damping)))
