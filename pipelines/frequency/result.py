"""Store frequency responses as a result, of which the report draws figures and tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pipelines.frequency.config import ReportConfig
from pipelines.frequency.findings import Seen
from pipelines.frequency.modes import relative_acceleration
from pipelines.frequency.rational import Known, Mode
from pipelines.frequency.spectra import Array, Complex, FrequencyResponse, bands_below

__all__ = ["COHERENCE", "Band", "Curve", "Method", "Posture", "methods_of", "posture_of"]
__all__ += ["same_bins"]

_CONFIG = ReportConfig()
COHERENCE = _CONFIG.coherence  # numerics: a response of less is not reliable
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
    estimator: str
    logs: tuple[str, ...]
    resolution: float  # [Hz]
    averages: float
    coherence_below_0_7_hz: tuple[Band, ...]
    modes: tuple[Mode, ...]  # of the default, closed-loop
    traces: tuple[Mode, ...]  # of pairs that nearly cancel
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
    delay: Known | None  # [s] besides hold and controller; None: the phase advances, as none does
    misfit: float
    band: Band  # [Hz] of the fit
    relative: Curve  # acceleration per input
    fit: Curve  # the rational function at the same frequencies
    compliance: Curve  # τ → q [rad/(N m)]
    excited: tuple[Band, ...]  # [Hz] where responses are known: nothing is fitted or named outside
    filled: float  # share of the samples that were lost, and filled alike in all channels
    others_held: bool  # the motion of the other joints was taken out of `relative`
    with_reversal: Curve | None  # input → q of the whole log
    # [Hz] as text -> error of the indirect method with the controller taken as continuous; share
    continuous: Mapping[str, float]


def methods_of(seen: Seen) -> tuple[Method, ...]:
    """Closed-loop, direct, and indirect where the controller is described."""
    m = seen.measured
    several = (("closed-loop", m.plant), ("direct", m.direct), ("indirect", m.indirect))
    found = []
    for name, response in several:
        if response is None:
            continue
        default = response is m.plant
        f, coherence = response.frequency, response.coherence
        off = (None, None) if default else _difference(m.plant, response)
        found.append(
            Method(
                m.joint,
                m.first.posture,
                name,
                response.method,
                tuple(t.name for t in m.turned),
                response.resolution,
                response.averages,
                bands_below(f, coherence, COHERENCE),
                seen.modes.modes if default else (),
                seen.modes.traces if default else (),
                *off,
                Curve.of(response),
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
    """Return what is drawn and told of one joint in one posture."""
    m, modes, first = seen.measured, seen.modes, seen.measured.first
    relative = relative_acceleration(m)
    inside = relative.within(*modes.band)
    nothing = np.zeros(len(inside.frequency))
    fitted = replace(
        inside,
        response=modes.fit.response(inside.frequency),
        variance=nothing,
        coherence=nothing + 1.0,
    )
    left = [one.friction_left for one in m.turned if one.friction_left is not None]
    delay = modes.delay
    early = delay.value <= -2.0 * delay.std
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
        friction_left=float(np.mean(left)) if left else None,
        friction_below=modes.friction_below,
        distortion=m.distortion,
        detected_even=m.detected[0],
        detected_odd=m.detected[1],
        expected_level=seen.expected.level,
        expected_inertia=seen.expected.inertia,
        expected_from=seen.expected.source,
        level=modes.level,
        level_above=modes.level_above,
        inertia=modes.inertia,
        delay=None if early else replace(delay, value=max(delay.value, 0.0)),
        misfit=modes.misfit,
        band=modes.band,
        relative=Curve.of(relative),
        fit=Curve.of(fitted),
        compliance=Curve.of(m.compliance),
        excited=m.excited.intervals,
        filled=max(t.filled for t in m.turned),
        others_held=m.held is not None,
        with_reversal=None if m.with_reversal is None else Curve.of(m.with_reversal),
        continuous=_continuous(seen),
    )


def _continuous(seen: Seen) -> dict[str, float]:
    """Error of (29) with k_p + k_d jω at some frequencies, and at the resonances."""
    m = seen.measured
    if m.continuous is None or m.indirect is None:
        return {}
    resonances = [o.frequency.value for o in seen.modes.modes if o.kind == "resonance"]
    wanted = sorted({*_CONFIG.known_at, *(round(f, 1) for f in resonances)})
    found = {}
    for f in wanted:
        k = int(np.argmin(np.abs(m.indirect.frequency - f)))
        if abs(m.indirect.frequency[k] - f) <= 1.0:
            ratio = m.continuous.response[k] / m.indirect.response[k]
            found[f"{f:g}"] = float(abs(ratio - 1.0))
    return found
