"""Store frequency responses as a result, of which the report draws figures and tables."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pipelines.frequency.config import ReportConfig
from pipelines.frequency.findings import Seen
from pipelines.frequency.rational import Known, Mode
from pipelines.frequency.spectra import Array, Complex, FrequencyResponse, Intervals, bands_below

__all__ = ["COHERENCE", "Curve", "Method", "Posture", "methods_of", "posture_of", "same_bins"]

COHERENCE = ReportConfig().coherence  # numerics: a response of less is not reliable


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
        """Return what is stored of a response."""
        value, std = response.response, np.sqrt(np.maximum(response.variance, 0.0))
        return cls(response.frequency, value.real, value.imag, std, response.coherence)

    @property
    def value(self) -> Complex:
        """Complex."""
        return np.asarray(self.real + 1j * self.imaginary, dtype=np.complex128)


@dataclass(frozen=True)
class Method:
    """The response of one joint in one posture by one method."""

    joint: int
    posture: Array  # (n,) [rad]
    method: str  # "closed-loop", "direct", "indirect"
    logs: tuple[str, ...]
    resolution: float  # [Hz]
    averages: float
    coherence_below_0_7_hz: Intervals
    modes: tuple[Mode, ...]  # of the default, closed-loop
    difference: float | None  # largest share off the default where both are reliable; None: of it
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
    expected_level: float | None  # of the rigid body: acceleration per input
    expected_inertia: float | None  # [kg m^2]
    expected_from: str
    level: Known  # measured, between friction and modes
    inertia: Known | None  # [kg m^2] measured below the modes
    delay: Known | None  # [s] besides hold and controller; None: the phase advances, as none does
    misfit: float
    band: tuple[float, float]  # [Hz] of the fit
    relative: Curve  # acceleration per input
    fit: Curve  # the rational function at the same frequencies
    compliance: Curve  # τ → q [rad/(N m)]
    excited: Intervals  # [Hz] where responses are known: nothing is fitted or named outside
    filled: float  # share of the samples that were lost, and filled alike in all channels
    others_held: bool  # the motion of the other joints was taken out of `relative`


def methods_of(seen: Seen) -> tuple[Method, ...]:
    """Closed-loop, direct, and indirect where the controller is described."""
    m = seen.measured
    found = []
    for name, response in (
        ("closed-loop", m.plant),
        ("direct", m.direct),
        ("indirect", m.indirect),
    ):
        if response is None:
            continue
        default = response is m.plant
        off, at = (None, None) if default else _difference(m.plant, response)
        found.append(
            Method(
                joint=m.joint,
                posture=m.first.posture,
                method=name,
                logs=tuple(t.name for t in m.turned),
                resolution=response.resolution,
                averages=response.averages,
                coherence_below_0_7_hz=bands_below(
                    response.frequency, response.coherence, COHERENCE
                ),
                modes=seen.modes.modes if default else (),
                difference=off,
                difference_at=at,
                curve=Curve.of(response),
            )
        )
    return tuple(found)


def _difference(
    default: FrequencyResponse, other: FrequencyResponse
) -> tuple[float | None, float | None]:
    """Largest share by which `other` is off beyond noise where it is coherent, and where [Hz]."""
    k, same = same_bins(default.frequency, other.frequency, default.resolution)
    good = same & (other.coherence >= COHERENCE)
    if not good.any():
        return None, None
    base = default.response[k]
    variance = np.maximum(default.variance[k], 0.0) + np.maximum(other.variance, 0.0)
    beyond = np.maximum(np.abs(other.response - base) - 3.0 * np.sqrt(variance), 0.0)
    off = np.where(good, beyond / np.maximum(np.abs(base), 1e-300), 0.0)
    worst = int(np.argmax(off))
    return float(off[worst]), float(other.frequency[worst])


def same_bins(
    default: Array, other: Array, resolution: float
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
    """Of each frequency of `other` its place in `default` [Hz], and whether it is there.

    Where v excites nothing the default has none, and another method makes its response of noise.
    """
    k = np.minimum(np.searchsorted(default, other), len(default) - 1)
    return k, np.asarray(np.abs(default[k] - other) < 0.25 * resolution)


def posture_of(seen: Seen) -> Posture:
    """Return what is drawn and reported of one joint in one posture."""
    m, modes, first = seen.measured, seen.modes, seen.measured.first
    part = modes.relative.within(*modes.band)
    exact = np.zeros(len(part.frequency))
    fitted = replace(
        part, response=modes.fit.response(part.frequency), variance=exact, coherence=exact + 1.0
    )
    delay = replace(modes.delay, value=max(modes.delay.value, 0.0))
    return Posture(
        joint=m.joint,
        posture=first.posture,
        revolute=first.revolute,
        input=first.quantity,
        controller=first.controller.law if first.controller else "unknown",
        logs=tuple(t.name for t in m.turned),
        sample_time=first.sample_time,
        speed=first.speed,
        swing=max(t.swing for t in m.turned),
        left_out=float(np.mean([t.left_out for t in m.turned])),
        expected_level=seen.expected.level,
        expected_inertia=seen.expected.inertia,
        expected_from=seen.expected.source,
        level=modes.level,
        inertia=modes.inertia,
        delay=None if modes.delay.value <= -2.0 * delay.std else delay,
        misfit=modes.misfit,
        band=modes.band,
        relative=Curve.of(modes.relative),
        fit=Curve.of(fitted),
        compliance=Curve.of(m.compliance),
        excited=m.excited,
        filled=max(t.filled for t in m.turned),
        others_held=m.held is not None,
    )
