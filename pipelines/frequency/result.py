"""Frequency responses as a result that is stored: what every figure and table of the report is drawn from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pipelines.frequency.findings import Findings, Seen
from pipelines.frequency.frequency_response import FrequencyResponse, bands_below
from pipelines.frequency.modes import relative_acceleration
from pipelines.frequency.rational import Known, Mode
from pipelines.io.log import Array

__all__ = ["Band", "Classified", "Curve", "Method", "ModeFound", "Posture", "Undecided", "classified", "methods_of", "posture_of",
           "same_bins", "undecided"]

COHERENCE = 0.7  # Kostić et al. 2004, Section IV.D: a response of less is not reliable
Band = tuple[float, float]


@dataclass(frozen=True)
class Curve:
    """A response over frequency. Arrays (bins,)."""

    frequency: Array  # [Hz]
    real: Array
    imaginary: Array
    std: Array  # √E|Ĝ - G|²
    coherence: Array

    @classmethod
    def of(cls, response: FrequencyResponse) -> Curve:
        return cls(response.frequency, np.asarray(response.response.real), np.asarray(response.response.imag),
                   np.sqrt(np.maximum(response.variance, 0.0)), response.coherence)

    @property
    def value(self) -> np.ndarray[tuple[int, ...], np.dtype[np.complex128]]:
        return np.asarray(self.real + 1j * self.imaginary, dtype=np.complex128)


@dataclass(frozen=True)
class ModeFound:
    """A distinct resonance or antiresonance."""

    kind: str  # "resonance", "antiresonance"
    frequency: Known  # [Hz]
    damping: Known  # ratio


@dataclass(frozen=True)
class Method:
    """The response of one joint in one posture by one method; modes are those of the default, closed-loop."""

    joint: int
    posture: Array  # (n,) [rad]
    method: str  # "closed-loop", "direct", "indirect"
    estimator: str
    logs: tuple[str, ...]
    resolution: float  # [Hz]
    averages: float
    coherence_below_0_7_hz: tuple[Band, ...]
    modes: tuple[ModeFound, ...]
    traces: tuple[ModeFound, ...]  # of pairs that nearly cancel
    difference: float | None  # largest from the default where both are reliable, as a share of it; None of the default itself
    difference_at: float | None  # [Hz]
    curve: Curve  # input → q


@dataclass(frozen=True)
class Posture:
    """One joint in one posture: experiment, rigid body, and what is beside it."""

    joint: int
    posture: Array  # (n,) [rad]
    revolute: bool
    input: str  # "r" [rad/s^2] or "tau" [N m]
    controller: str
    logs: tuple[str, ...]
    sample_time: float  # [s]
    speed: float  # [rad/s]
    swing: float  # [rad/s] std of the speed about it, by the excitation
    left_out: float  # share of the samples
    friction_left: float | None  # of the input, half its difference between the directions
    friction_below: float  # [Hz] below which friction changes the magnitude by more than a tenth
    distortion: float | None  # variance between realisations and directions over that of noise
    detected_even: float | None  # power at lines that v leaves out, over that of noise
    detected_odd: float | None
    expected_level: float | None  # of the rigid body: acceleration per input
    expected_inertia: float | None  # [kg m^2]
    expected_from: str
    level: Known  # measured, between friction and modes
    level_above: Known  # above all modes
    inertia: Known | None  # [kg m^2] measured below the modes
    delay: Known | None  # [s] besides hold and controller; None: the phase advances, which no delay explains
    misfit: float
    band: Band  # [Hz] of the fit
    relative: Curve  # acceleration per input
    fit: Curve  # the rational function at the same frequencies
    compliance: Curve  # τ → q [rad/(N m)]
    excited: tuple[Band, ...]  # [Hz] where v has power and its responses are known: nothing is fitted, judged or named outside
    filled: float  # share of the samples that were lost, and filled alike in all channels
    others_held: bool  # the motion of the other joints was taken out of `relative`
    with_reversal: Curve | None  # input → q of the whole log
    continuous: Mapping[str, float]  # [Hz] as text -> error of the indirect method with the controller taken as continuous; share


@dataclass(frozen=True)
class Classified:
    """What is sure."""

    kind: str  # "base", "joint", "rigid", "delay"
    joint: int | None
    evidence: str
    cause: str | None
    frequency: Known | None  # [Hz]
    damping: Known | None
    parameters: Mapping[str, Known]
    seen_at: tuple[int, ...]
    frequencies: tuple[Known, ...] = ()  # [Hz] `frequency` in each posture


@dataclass(frozen=True)
class Undecided:
    """What is there and could be more than one thing."""

    joint: int
    frequency: Known | None  # [Hz]
    candidates: tuple[str, ...]
    evidence: str
    experiment: str


def methods_of(seen: Seen) -> tuple[Method, ...]:
    """Closed-loop, direct, and indirect where the controller is described."""
    m = seen.measured
    modes, traces = (tuple(_mode(one) for one in several) for several in (seen.modes.modes, seen.modes.traces))
    several = [("closed-loop", m.plant, modes, traces), ("direct", m.direct, (), ())]
    if m.indirect is not None:
        several.append(("indirect", m.indirect, (), ()))
    found = []
    for name, response, own, faint in several:
        off = (None, None) if name == "closed-loop" else difference(m.plant, response)
        found.append(Method(m.joint, m.first.posture, name, response.method, tuple(t.name for t in m.turned), response.resolution,
                            response.averages, bands_below(response.frequency, response.coherence, COHERENCE), own, faint, *off,
                            Curve.of(response)))
    return tuple(found)


def _mode(mode: Mode) -> ModeFound:
    return ModeFound(mode.kind, mode.frequency, mode.damping)


def difference(default: FrequencyResponse, other: FrequencyResponse) -> tuple[float | None, float | None]:
    """Largest share by which `other` is off beyond what noise explains, where its coherence looks fine, and the frequency."""
    k, same = same_bins(default.frequency, other.frequency, default.resolution)
    good = same & (other.coherence >= COHERENCE)
    if not good.any():
        return None, None
    base, size = default.response[k], np.abs(default.response[k])
    noise = 3.0 * np.sqrt(np.maximum(default.variance[k], 0.0) + np.maximum(other.variance, 0.0))
    off = np.where(good, np.maximum(np.abs(other.response - base) - noise, 0.0) / np.maximum(size, 1e-300), 0.0)
    worst = int(np.argmax(off))
    return float(off[worst]), float(other.frequency[worst])


def same_bins(default: Array, other: Array, resolution: float) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
    """Of each frequency of `other` the place of the same one in `default` [Hz], and whether there is one: where v excites nothing
    the default has none, and another method makes its response of noise alone."""
    k = np.minimum(np.searchsorted(default, other), len(default) - 1)
    return k, np.asarray(np.abs(default[k] - other) < 0.25 * resolution)


def posture_of(seen: Seen) -> Posture:
    """What is drawn and told of one joint in one posture."""
    m, modes, first = seen.measured, seen.modes, seen.measured.first
    relative = relative_acceleration(m)
    fitted = modes.fit.response(relative.frequency)
    inside = (relative.frequency >= modes.band[0]) & (relative.frequency <= modes.band[1])
    nothing, fitted = np.zeros(int(inside.sum())), fitted[inside]
    fit = Curve(relative.frequency[inside], np.asarray(fitted.real), np.asarray(fitted.imag), nothing, nothing + 1.0)
    left = [one.friction_left for one in m.turned if one.friction_left is not None]
    return Posture(m.joint, first.posture, first.revolute, first.quantity, first.controller.law if first.controller else "unknown",
                   tuple(t.name for t in m.turned), first.sample_time, first.speed, max(t.swing for t in m.turned),
                   float(np.mean([t.left_out for t in m.turned])), float(np.mean(left)) if left else None, modes.friction_below,
                   m.distortion, *m.detected,
                   seen.expected.level, seen.expected.inertia, seen.expected.source, modes.level, modes.level_above,
                   modes.inertia, _not_negative(modes.delay), modes.misfit, modes.band, Curve.of(relative), fit,
                   Curve.of(m.compliance), m.excited.intervals, max(t.filled for t in m.turned), m.held is not None,
                   None if m.with_reversal is None else Curve.of(m.with_reversal), _continuous(seen))


def _not_negative(delay: Known) -> Known | None:
    """Return the delay, none below zero within two deviations of it, or None where it is negative for certain."""
    return replace(delay, value=max(delay.value, 0.0)) if delay.value > -2.0 * delay.std else None


def _continuous(seen: Seen) -> dict[str, float]:
    """Error of (29) with k_p + k_d jω at 5, 28, 80 Hz, and at the resonances."""
    m = seen.measured
    if m.continuous is None or m.indirect is None:
        return {}
    wanted = sorted({5.0, 28.0, 80.0, *(round(o.frequency.value, 1) for o in seen.modes.modes if o.kind == "resonance")})
    found = {}
    for f in wanted:
        k = int(np.argmin(np.abs(m.indirect.frequency - f)))
        if abs(m.indirect.frequency[k] - f) <= 1.0:
            found[f"{f:g}"] = float(abs(m.continuous.response[k] / m.indirect.response[k] - 1.0))
    return found


def classified(found: Findings) -> tuple[Classified, ...]:
    return tuple(Classified(f.kind, f.joint, f.evidence, f.cause, f.frequency, f.damping, dict(f.parameters), f.seen_at,
                            f.frequencies)
                 for f in found.classification)


def undecided(found: Findings) -> tuple[Undecided, ...]:
    return tuple(Undecided(o.joint, o.frequency, o.candidates, o.evidence, o.experiment) for o in found.undecided)
