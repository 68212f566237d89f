"""The plant's frequency response of one joint in one posture, by three methods, from all its logs.

    for measured in measured_responses(logs, how): ...

    closed-loop   P = Φ_vq / Φ_vu           needs no controller, no bias; the default
    indirect      P = (1 - S)/(C S), (29)   with the controller as it was sampled
    direct        P = Φ_uq / Φ_uu, (26)     biased where a disturbance goes round the loop, whatever its coherence says

Kostić et al. 2004, Section IV.D, eq. (26)-(29). u is r under computed torque, τ under PD. Compliance and accelerance are
those of Φ_vq / Φ_vτ. Logs of one joint and one posture are realisations: what differs between them, or between the two
directions, beyond the noise, is distortion.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected, UsageError
from pipelines.frequency.controller import continuous_controller, loop_delay, sampled_controller
from pipelines.frequency.excited_band import ExcitedBand, excited_band, powered
from pipelines.frequency.frequency_response import (
    FrequencyResponse,
    Responses,
    closed_loop,
    indirect,
)
from pipelines.frequency.local_polynomial import local_polynomial
from pipelines.frequency.multisine import (
    DetectionLines,
    MultisineResponses,
    multisine_responses,
)
from pipelines.frequency.others_held import Held, others_held
from pipelines.frequency.signals import INPUT, POSITION, TORQUE, Stretch, Turned, V, turned_joint
from pipelines.frequency.spectra import cross_spectra
from pipelines.io.log import Array, ExperimentLog

__all__ = ["ESTIMATORS", "How", "Measured", "double_integrator", "measured_responses"]

ESTIMATORS = ("auto", "multisine", "local-polynomial", "welch")


@dataclass(frozen=True)
class ResponseConfig:
    """Numbers of a response.

    Attributes:
        same_posture: [rad] within which two logs are of one posture
        highest: of the rate
        lowest: [Hz]
        segments: at least, for the coherence and variance of Welch's method
        no_power: of the strongest bin of the source
        folded: of the density of v in its band, near half the rate: it goes on beyond
        coupled: [Hz] from where on friction and gravity of the other joints matter less than their inertia
        octave: highest over lowest frequency of v that a rough inertia is taken from
        constant: [Hz] where input and torque are compared
        postures: times that the inertia about a joint grows from one posture to another, at most: it bounds the coupled modes
        density: [s] of the segments that show where v has power, to half a hertz: Hann's window leaks into two bins
        smooth: lines over which distortion is compared with noise
        white: of the rate, bounds of bands below its half: of white noise they are equally dense
        level: of the densest of these bands over the least dense, at most
    """

    same_posture: float = 0.02
    highest: float = 0.45
    lowest: float = 0.5
    segments: int = 4
    no_power: float = 1e-12
    folded: float = 0.1
    coupled: float = 4.0
    octave: float = 2.5
    constant: tuple[float, float] = (10.0, 80.0)
    postures: float = 3.0
    density: float = 4.0
    smooth: int = 25
    white: tuple[float, ...] = (0.35, 0.4, 0.45, 0.5)
    level: float = 1.5


_CONFIG = ResponseConfig()


@dataclass(frozen=True)
class How:
    """How spectra are taken."""

    estimator: str = "auto"  # multisine where v repeats, local-polynomial else
    resolution: float | None = None  # [Hz] None: one over the period, or 0.25 Hz

    def checked(self) -> How:
        """Raises UsageError, C02, for what is no estimator or no resolution."""
        if self.estimator not in ESTIMATORS:
            raise UsageError("C02", f"'{self.estimator}' is no estimator", where="--estimator",
                             remedy=f"one of {', '.join(ESTIMATORS)}")
        if self.resolution is not None and not 0.01 <= self.resolution <= 20.0:
            raise UsageError("C02", f"a resolution of {self.resolution:g} Hz", where="--resolution", remedy="give 0.01 to 20 Hz")
        return self


@dataclass(frozen=True, eq=False)
class Measured:
    """One joint in one posture."""

    turned: tuple[Turned, ...]  # its logs
    plant: FrequencyResponse  # u → q by Φ_vq/Φ_vu
    held: Held | None  # the same in the excited band, were the other joints held; None where that is all one
    torque_per_input: float | None  # D̂ [kg m^2] under computed torque, 1 under PD; None where they cannot be compared
    aliased: bool  # the input was sampled, not held, and v has power up to half the rate: what lies above has folded back
    excited: ExcitedBand  # where it exists: nothing is fitted, judged or named outside
    direct: FrequencyResponse
    indirect: FrequencyResponse | None  # None: the log does not describe the controller
    continuous: FrequencyResponse | None  # what (29) gives with k_p + k_d jω: shown, never used
    compliance: FrequencyResponse  # τ → q [rad/N m]
    with_reversal: FrequencyResponse | None  # u → q from the whole log, None where it is too short
    distortion: float | None  # what differs between realisations over what noise explains, median of variances; None of one
    by_sensor: Array  # relative variance of `plant` by the noise with which the position is read (bins,)
    detected: tuple[float | None, float | None]  # power of the position at even and odd lines that v leaves out, over the noise's

    @property
    def first(self) -> Turned:
        return self.turned[0]

    @property
    def joint(self) -> int:
        return self.first.joint

    @property
    def load(self) -> float:
        """The steady torque less friction over the deviation of the torque, the smallest of the logs; 0 where unknown."""
        return min(one.load for one in self.turned)

    @property
    def others(self) -> Array:
        """The angles of the held joints (n - 1,) [rad]."""
        return np.delete(self.first.posture, self.joint - 1)


def measured_responses(logs: Iterable[ExperimentLog], how: How | None = None) -> tuple[Measured, ...]:
    """Every joint and posture in turn, by joint, then by the order of the logs.

    Raises:
        InputRejected: a log that no spectrum can be taken of, with what to record: S01, T05, T08, D09.
    """
    how = (how or How()).checked()
    groups: list[list[Turned]] = []
    for turned in sorted((turned_joint(log) for log in logs), key=lambda t: t.joint):
        for group in groups:
            if _together(group[0], turned):
                group.append(turned)
                break
        else:
            groups.append([turned])
    inertia: dict[int, float] = {}
    for group in groups:
        known = [_roughly(one) for one in group]
        inertia[group[0].joint] = max(_CONFIG.postures * max(known), inertia.get(group[0].joint, 0.0))
    return tuple(_measured(tuple(group), how, inertia) for group in groups)


def _roughly(turned: Turned) -> float:
    """Return the inertia [kg m^2] of the joint from all of a log, torque over acceleration by v; inf where v tells none.

    Over the octave and a bit where v begins to drive it: there friction matters little, and modes hardly yet.
    """
    spectra = cross_spectra([s.signals[:, [V, TORQUE, POSITION]] for s in turned.stretches], turned.rate,
                            min(round(_CONFIG.density * turned.rate), *(len(s.signals) for s in turned.stretches)))
    f = spectra.frequency
    driven = powered(spectra.density[:, 0, 0].real) & (f >= _CONFIG.coupled)
    inside = driven & (f <= _CONFIG.octave * f[driven].min(initial=np.inf))
    if not inside.any():
        return np.inf
    torque, position = spectra.density[inside, 0, 1], spectra.density[inside, 0, 2]
    return float(np.median(np.abs(torque) / np.maximum(np.abs(position) * (2.0 * np.pi * f[inside]) ** 2, 1e-300)))


def _together(a: Turned, b: Turned) -> bool:
    if a.settings() != b.settings() or a.lines != b.lines:
        return False
    apart = np.delete(a.posture - b.posture, a.joint - 1)
    return bool(np.abs(apart).max(initial=0.0) < _CONFIG.same_posture)


def _measured(turned: tuple[Turned, ...], how: How, inertia: dict[int, float]) -> Measured:
    first = turned[0]
    stretches = [s for one in turned for s in one.stretches]
    several, distortion, detected = _excited(turned, stretches, how)
    plant = _reliable(closed_loop(several, POSITION - 1, INPUT - 1))
    sensitivity = several.of(INPUT - 1)
    late, _ = loop_delay(first.controller, first.quantity)
    shift = np.exp(2j * np.pi * plant.frequency * late * first.sample_time)
    sampled = sampled_controller(first.controller, first.joint, plant.frequency, first.sample_time)
    smooth = continuous_controller(first.controller, first.joint, plant.frequency) if first.controller else None
    both = [None if c is None else indirect(sensitivity.times(shift), c / shift) for c in (sampled, smooth)]
    density, top = _density(several.frequency, stretches, first.rate)
    band = excited_band(_outputs(several, (INPUT - 1, POSITION - 1)), density)
    inside = density[band.holds(several.frequency)]
    to_the_top = bool(len(inside)) and top > _CONFIG.folded * float(np.median(inside))
    aliased = not first.held and to_the_top
    compliance = closed_loop(several, POSITION - 1, TORQUE - 1)
    ratio = _torque_per_input(plant, compliance, band)
    return Measured(turned, plant, _held(several, first, band, ratio, inertia), ratio, aliased, band,
                    _direct([s.signals for s in stretches], turned, how), both[0], both[1],
                    compliance, _with_reversal(turned, how), distortion,
                    np.zeros(len(plant.frequency)) if to_the_top else _by_sensor(several, turned, stretches, how), detected)


def _by_sensor(several: Responses, turned: tuple[Turned, ...], stretches: Sequence[Stretch], how: How) -> Array:
    """Relative variance (bins,) by the noise with which the position is read; 0 where it does not show by itself.

    It is white: as dense as the position near half the rate, if that is level. Motion is not level there: by a force it
    falls with the square of the frequency at least. White noise is taken through the same spectra: q = P u + n whatever the
    controller makes of n, and P̂ is off by Φ_vn / Φ_vu.
    """
    rate = turned[0].rate
    frequency, density = _spectrum(stretches, rate, POSITION)
    sizes = [float(np.median(density[(frequency > low * rate) & (frequency < high * rate)]))
             for low, high in pairwise(_CONFIG.white)]
    if max(sizes) > _CONFIG.level * min(sizes):
        return np.zeros(len(several.frequency))
    rng = np.random.default_rng(0)
    read = [replace(one, signals=np.column_stack([one.signals[:, V], rng.standard_normal((len(one.signals), POSITION))]))
            for one in stretches]
    noise, _, _ = _excited(turned, read, how, distorted=False)
    variance = np.interp(several.frequency, noise.frequency, noise.covariance[:, POSITION - 1, POSITION - 1].real)
    size = np.maximum(np.abs(several.response[:, POSITION - 1]) ** 2, 1e-300)
    return np.asarray(0.5 * sizes[-1] * rate * _smooth(variance) / size)


def _smooth(values: Array) -> Array:
    """The mean over neighbouring lines."""
    width = min(_CONFIG.smooth, len(values))
    padded = np.pad(values, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")


def _density(frequency: Array, stretches: Sequence[Stretch], rate: float) -> tuple[Array, float]:
    """Of v [unit²/Hz] at these frequencies, and its median over the last tenth below half the rate."""
    f, density = _spectrum(stretches, rate, V)
    return np.interp(frequency, f, density), float(np.median(density[f > 0.45 * rate]))


def _spectrum(stretches: Sequence[Stretch], rate: float, channel: int) -> tuple[Array, Array]:
    """Frequencies [Hz] and the density [unit²/Hz] of a channel."""
    segment = min(round(_CONFIG.density * rate), *(len(s.signals) for s in stretches))
    spectra = cross_spectra([s.signals[:, [channel]] for s in stretches], rate, segment)
    return spectra.frequency, spectra.density[:, 0, 0].real


def _held(several: Responses, first: Turned, band: ExcitedBand, ratio: float | None,
          inertia: dict[int, float]) -> Held | None:
    """u → q with the other joints held: computed torque leaves them at rest only where nothing gives way.

    A joint whose inertia no log shows moves less than one before it.
    """
    inside = _where(several, band.holds(several.frequency) & (several.frequency >= _CONFIG.coupled))
    rigid = np.asarray(double_integrator(inside.frequency, first.sample_time, held=first.torque_held), dtype=np.complex128)
    found = others_held(inside, rigid, TORQUE - 1, POSITION - 1, tuple(range(TORQUE, several.response.shape[1])),
                        np.array([inertia.get(k, _roughly(first) if k > first.joint else np.inf)
                                  for k in range(1, len(first.posture) + 1) if k != first.joint]))
    if found is None or ratio is None:
        return None
    _, delay = loop_delay(first.controller, first.quantity)
    own = double_integrator(inside.frequency, first.sample_time, delay, first.held)
    return found.times(np.asarray(ratio * own / rigid))


def _torque_per_input(plant: FrequencyResponse, compliance: FrequencyResponse, band: ExcitedBand) -> float | None:
    """τ/u, one number per joint, D̂ or 1: the median, weighted by what is known."""
    torque, whole = (one.where(band.holds(one.frequency)).within(*_CONFIG.constant) for one in (compliance, plant))
    if not len(torque.frequency) or len(torque.frequency) != len(whole.frequency):
        return None
    ratio = (whole.response / torque.response).real
    weight = np.abs(torque.response) ** 2 / np.maximum(torque.variance, 1e-300)
    order = np.argsort(ratio)
    middle = np.searchsorted(np.cumsum(weight[order]), 0.5 * weight.sum())
    return float(ratio[order][min(int(middle), len(order) - 1)])


def _outputs(several: Responses, which: tuple[int, ...]) -> Responses:
    kept = list(which)
    return replace(several, response=several.response[:, kept], covariance=several.covariance[:, kept][:, :, kept],
                   coherence=several.coherence[:, kept])


def _excited(turned: tuple[Turned, ...], stretches: Sequence[Stretch],
             how: How, distorted: bool = True) -> tuple[Responses, float | None, tuple[float | None, float | None]]:
    """v → (u, q, τ), the distortion where there are realisations, and what detection lines show; else noise alone."""
    first, signals = turned[0], [s.signals for s in stretches]
    outputs = range(1, signals[0].shape[1])
    periods = {one.period for one in turned}
    whole = [x for x in signals if first.period is not None and len(x) >= 2 * first.period]
    periodic = len(periods) == 1 and first.period is not None and bool(whole)
    if how.estimator == "multisine" and not periodic:
        raise InputRejected("T07", f"v of joint {first.joint} does not repeat while the joint turns at constant speed",
                            where=first.name,
                            remedy="inject a periodic multisine for two periods or more, or take another estimator")
    if how.estimator == "multisine" or (how.estimator == "auto" and periodic and first.period is not None):
        assert first.period is not None
        found = multisine_responses(whole, first.rate, first.period, V, outputs)
        return (*_of_multisine(found), _detected(found.detection)) if distorted else (found.noise, None, (None, None))
    if how.estimator == "welch":
        return _welch(signals, turned, how, V, outputs), None, (None, None)
    spacing = how.resolution or 0.25
    frequency = np.arange(np.ceil(_CONFIG.lowest / spacing), np.floor(_CONFIG.highest * first.rate / spacing) + 1) * spacing
    return _known(local_polynomial(signals, first.rate, frequency, V, outputs)), None, (None, None)


def _detected(lines: DetectionLines | None) -> tuple[float | None, float | None]:
    """Even and odd distortion of the position: mean power at the lines left out over the noise there."""
    if lines is None:
        return None, None
    inside = lines.frequency >= _CONFIG.lowest
    power, noise = lines.power[:, POSITION - 1], np.maximum(lines.noise[:, POSITION - 1], 1e-300)
    kinds = [inside & lines.odd, inside & ~lines.odd]
    odd, even = (float(np.median(power[k] / noise[k])) if k.any() else None for k in kinds)
    return even, odd


def _of_multisine(found: MultisineResponses) -> tuple[Responses, float | None]:
    """The response with the covariance of noise, raised where realisations differ by more than noise does.

    Few realisations tell the distortion of one line badly: it is compared with the noise over neighbouring lines.
    """
    noise = found.noise
    if found.total is None:
        return noise, None
    position = POSITION - 1
    own, total = (np.maximum(r.covariance[:, position, position].real, 1e-300) for r in (noise, found.total))
    local = _smooth(total / own)
    raised = np.maximum(local, 1.0)
    return replace(noise, covariance=noise.covariance * raised[:, None, None]), float(np.median(local))


def _where(several: Responses, kept: npt.NDArray[np.bool_]) -> Responses:
    return replace(several, frequency=several.frequency[kept], response=several.response[kept],
                   covariance=several.covariance[kept], coherence=several.coherence[kept])


def _known(several: Responses) -> Responses:
    """The bins where the excitation had power."""
    return _where(several, np.asarray(np.isfinite(several.response).all(axis=1)))


def _reliable(response: FrequencyResponse) -> FrequencyResponse:
    if not len(response.frequency):
        raise InputRejected("D09", "the excitation has no power at any frequency", remedy="excite the joint")
    return response


@dataclass(frozen=True)
class _Segments:
    """Of Welch's method. A periodic v has lines: two periods to a segment, and Hann's window keeps its lines apart."""

    samples: int
    every: int  # bins that count: each, or each second one


def _segments(turned: tuple[Turned, ...], lengths: Sequence[int], how: How) -> _Segments:
    """Two periods, or what the resolution asks, so many that four of them are averaged.

    Raises:
        InputRejected: T08, the record is too short for the resolution that was asked for.
    """
    first = turned[0]

    def count(segment: int) -> int:
        return sum(1 + 2 * (length - segment) // segment for length in lengths if length >= segment)

    if how.resolution is None and first.period and count(2 * first.period) >= _CONFIG.segments:
        return _Segments(2 * first.period, 2)
    wanted = round(first.rate / (how.resolution or 0.25))
    if how.resolution is not None and count(wanted) < _CONFIG.segments:
        raise InputRejected("T08", f"{sum(lengths) / first.rate:.3g} s at constant speed are too short for {how.resolution:g} Hz",
                            where=first.name,
                            remedy=f"record {_CONFIG.segments / how.resolution:.3g} s each way, or ask for a coarser one")
    while wanted > 64 and count(wanted) < _CONFIG.segments:
        wanted //= 2
    return _Segments(wanted, 1)


def _welch(stretches: Sequence[Array], turned: tuple[Turned, ...], how: How, source: int, outputs: Sequence[int]) -> Responses:
    first = turned[0]
    segments = _segments(turned, [len(x) for x in stretches], how)
    spectra = cross_spectra(stretches, first.rate, segments.samples)
    power = spectra.density[:, source, source].real
    excited = power > _CONFIG.no_power * power.max()
    density = spectra.density.copy()
    density[~excited, source, source] = power.max()  # of a bin that is left out below
    found = replace(spectra, density=density).responses(source, outputs)
    number = np.rint(found.frequency * segments.samples * first.sample_time)
    inside = (found.frequency >= _CONFIG.lowest) & (found.frequency <= _CONFIG.highest * first.rate)
    return _where(found, inside & excited[1:] & (number % segments.every == 0))


def _direct(signals: Sequence[Array], turned: tuple[Turned, ...], how: How) -> FrequencyResponse:
    """What the paper's (26) gives, by averaged spectra of input and position."""
    return _welch([x[:, [INPUT, POSITION]] for x in signals], turned, how, 0, (1,)).of(0)


def _with_reversal(turned: tuple[Turned, ...], how: How) -> FrequencyResponse | None:
    """From the whole log: what it would have been had nothing been left out."""
    known = [one.whole for one in turned]
    least = _CONFIG.segments * round(turned[0].rate / (how.resolution or 0.25))
    if not all(np.isfinite(x).all() for x in known) or sum(len(x) for x in known) < least:
        return None
    return closed_loop(_welch(known, turned, how, V, (INPUT, POSITION)))


def double_integrator(frequency: Array, sample_time: float, delay: int = 0, held: bool = True) -> Array:
    """(z + 1) T²/(2 (z - 1)²) z^-delay (frequencies,), complex: unit inertia under a torque held over a sample.

    Not `held`, 1/s²: a torque that was measured when position was.
    """
    if not held:
        return np.asarray(-1.0 / (2.0 * np.pi * np.asarray(frequency)) ** 2 + 0j)
    z = np.exp(2j * np.pi * np.asarray(frequency) * sample_time)
    return np.asarray(sample_time**2 * (z + 1.0) / (2.0 * (z - 1.0) ** 2) * z ** -float(delay))
