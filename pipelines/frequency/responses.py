"""Estimate the plant's frequency response of one joint in one posture, by three methods.

    for measured in measured_responses(logs, how): ...

    closed-loop   P = Φ_vq / Φ_vu           needs no controller, no bias; the default
    indirect      P = (1 - S)/(C S), (29)   with the controller as it was sampled
    direct        P = Φ_uq / Φ_uu, (26)     biased where a disturbance goes round the loop,
                                            whatever its coherence says

Kostić et al. 2004, Section IV.D, eq. (26)-(29). u is r under computed torque, τ under PD.
Compliance and accelerance are those of Φ_vq / Φ_vτ. Logs of one joint and one posture are
realisations: what differs between them, or between the two directions, beyond the noise, is
distortion.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pipelines.errors import InputRejected, UsageError
from pipelines.frequency.config import ResponseConfig
from pipelines.frequency.controller import (
    continuous_controller,
    double_integrator,
    loop_delay,
    sampled_controller,
)
from pipelines.frequency.local_polynomial import local_polynomial
from pipelines.frequency.multisine import DetectionLines, MultisineResponses, multisine_responses
from pipelines.frequency.others_held import Held, others_held
from pipelines.frequency.signals import INPUT, POSITION, TORQUE, Turned, V, turned_joint
from pipelines.frequency.spectra import (
    Array,
    ExcitedBand,
    FrequencyResponse,
    Responses,
    closed_loop,
    cross_spectra,
    excited_band,
    indirect,
    powered,
)
from pipelines.io.log import ExperimentLog

__all__ = ["ESTIMATORS", "How", "Measured", "measured_responses"]

ESTIMATORS = ("auto", "multisine", "local-polynomial", "welch")

# of the outputs of v
_INPUT, _POSITION, _TORQUE = INPUT - 1, POSITION - 1, TORQUE - 1  # numerics
_CONFIG = ResponseConfig()

Detected = tuple[float | None, float | None]


@dataclass(frozen=True)
class How:
    """How spectra are taken."""

    estimator: str = "auto"  # multisine where v repeats, local-polynomial else
    resolution: float | None = None  # [Hz] None: one over the period, or 0.25 Hz

    def checked(self) -> How:
        """Raise UsageError, C02, for what is no estimator or no resolution."""
        if self.estimator not in ESTIMATORS:
            words, remedy = f"'{self.estimator}' is no estimator", ", ".join(ESTIMATORS)
            raise UsageError("C02", words, where="--estimator", remedy=f"one of {remedy}")
        low, high = _CONFIG.finest, _CONFIG.coarsest
        if self.resolution is not None and not low <= self.resolution <= high:
            words = f"a resolution of {self.resolution:g} Hz"
            raise UsageError(
                "C02", words, where="--resolution", remedy=f"give {low:g} to {high:g} Hz"
            )
        return self


@dataclass(frozen=True, eq=False)
class Measured:
    """One joint in one posture."""

    turned: tuple[Turned, ...]  # its logs
    plant: FrequencyResponse  # u → q by Φ_vq/Φ_vu
    held: Held | None  # the same in the excited band, the other joints held; None: all one
    torque_per_input: float | None  # D̂ [kg m^2] or 1 under PD; None: they cannot be compared
    aliased: bool  # the input was sampled, and v has power up to half the rate: it folds back
    excited: ExcitedBand  # where it exists: nothing is fitted, judged or named outside
    direct: FrequencyResponse
    indirect: FrequencyResponse | None  # None: the log does not describe the controller
    continuous: FrequencyResponse | None  # what (29) gives with k_p + k_d jω: shown, never used
    compliance: FrequencyResponse  # τ → q [rad/N m]
    with_reversal: FrequencyResponse | None  # u → q of the whole log, None where too short
    distortion: float | None  # what differs between realisations over the noise; None of one
    by_sensor: Array  # relative variance of `plant` by the noise of reading the position (bins,)
    detected: Detected  # power of the position at even and odd lines that v leaves out over noise

    @property
    def first(self) -> Turned:
        """The first of its logs."""
        return self.turned[0]

    @property
    def joint(self) -> int:
        """1-based."""
        return self.first.joint

    @property
    def load(self) -> float:
        """The steady torque less friction over the torque's deviation, the smallest of the logs."""
        return min(one.load for one in self.turned)


def measured_responses(
    logs: Iterable[ExperimentLog], how: How | None = None
) -> tuple[Measured, ...]:
    """Return every joint and posture in turn, by joint, then by the order of the logs.

    Raises:
        InputRejected: S01, T05, T08, D09: a log that no spectrum can be taken of.
        UsageError: C02, see `How.checked`.
    """
    how = (how or How()).checked()
    groups: list[list[Turned]] = []
    for turned in sorted((turned_joint(log) for log in logs), key=lambda t: t.joint):
        same = next((group for group in groups if _together(group[0], turned)), None)
        if same is None:
            groups.append([turned])
        else:
            same.append(turned)
    inertia: dict[int, float] = {}
    for group in groups:
        joint, most = group[0].joint, _CONFIG.postures * max(_roughly(one) for one in group)
        inertia[joint] = max(most, inertia.get(joint, 0.0))
    return tuple(_measured(tuple(group), how, inertia) for group in groups)


def _together(a: Turned, b: Turned) -> bool:
    apart = np.delete(a.posture - b.posture, a.joint - 1)
    same = bool(np.abs(apart).max(initial=0.0) < _CONFIG.same_posture)
    return same and a.settings() == b.settings()


def _roughly(turned: Turned) -> float:
    """Return the joint's inertia [kg m^2] of a log, torque over acceleration by v, or inf.

    Over the octave and a bit where v begins to drive it: there friction matters little, and modes
    hardly yet.
    """
    shortest = min(len(s.signals) for s in turned.stretches)
    channels = [s.signals[:, [V, TORQUE, POSITION]] for s in turned.stretches]
    segment = min(round(_CONFIG.density * turned.rate), shortest)
    spectra = cross_spectra(channels, turned.rate, segment)
    f = spectra.frequency
    driven = powered(spectra.density[:, 0, 0].real) & (f >= _CONFIG.coupled)
    inside = driven & (f <= _CONFIG.octave * f[driven].min(initial=np.inf))
    if not inside.any():
        return np.inf
    torque, position = np.abs(spectra.density[inside, 0, 1:]).T
    acceleration = np.maximum(position * (2.0 * np.pi * f[inside]) ** 2, 1e-300)
    return float(np.median(torque / acceleration))


def _measured(turned: tuple[Turned, ...], how: How, inertia: dict[int, float]) -> Measured:
    first = turned[0]
    signals = [s.signals for one in turned for s in one.stretches]
    several, distortion, detected = _excited(turned, signals, how)
    plant = closed_loop(several, _POSITION, _INPUT)
    if not len(plant.frequency):
        words = "the excitation has no power at any frequency"
        raise InputRejected("D09", words, remedy="excite the joint")
    late, _ = loop_delay(first.controller, first.quantity)
    shift = np.exp(2j * np.pi * plant.frequency * late * first.sample_time)
    where = (first.controller, first.joint, plant.frequency)
    controllers = (sampled_controller(*where, first.sample_time), continuous_controller(*where))
    sensitivity = several.of(_INPUT).times(shift)
    by_controller = [None if c is None else indirect(sensitivity, c / shift) for c in controllers]
    f, density = _spectrum(signals, first.rate, V)
    top = float(np.median(density[f > _CONFIG.highest * first.rate]))
    density = np.interp(several.frequency, f, density)
    own = [_INPUT, _POSITION]
    covariance = several.covariance[:, own][:, :, own]
    band = excited_band(
        replace(several, response=several.response[:, own], covariance=covariance), density
    )
    inside = density[band.holds(several.frequency)]
    to_the_top = bool(len(inside)) and top > _CONFIG.folded * float(np.median(inside))
    compliance = closed_loop(several, _POSITION, _TORQUE)
    ratio = _torque_per_input(plant, compliance, band)
    read = np.zeros(len(plant.frequency))
    if not to_the_top:
        read = _by_sensor(several, turned, signals, how)
    return Measured(
        turned=turned,
        plant=plant,
        held=_held(several, first, band, ratio, inertia),
        torque_per_input=ratio,
        aliased=not first.held and to_the_top,
        excited=band,
        direct=_welch([x[:, [INPUT, POSITION]] for x in signals], turned, how, 0, (1,)).of(0),
        indirect=by_controller[0],
        continuous=by_controller[1],
        compliance=compliance,
        with_reversal=_with_reversal(turned, how),
        distortion=distortion,
        by_sensor=read,
        detected=detected,
    )


def _by_sensor(
    several: Responses, turned: tuple[Turned, ...], signals: Sequence[Array], how: How
) -> Array:
    """Relative variance (bins,) by the noise of reading the position; 0 where it does not show.

    It is white: as dense as the position near half the rate, if that is level. Motion is not level
    there: by a force it falls with the square of the frequency at least. White noise is taken
    through the same spectra: q = P u + n whatever the controller makes of n, and P̂ is off by
    Φ_vn / Φ_vu.
    """
    rate = turned[0].rate
    f, density = _spectrum(signals, rate, POSITION)
    sizes = [
        float(np.median(density[(f > low * rate) & (f < high * rate)]))
        for low, high in pairwise(_CONFIG.white)
    ]
    if max(sizes) > _CONFIG.level * min(sizes):
        return np.zeros(len(several.frequency))
    rng = np.random.default_rng(0)
    read = [np.column_stack([x[:, V], rng.standard_normal((len(x), POSITION))]) for x in signals]
    noise, _, _ = _excited(turned, read, how, distorted=False)
    variance = np.interp(several.frequency, noise.frequency, noise.variance[:, _POSITION])
    size = np.maximum(np.abs(several.response[:, _POSITION]) ** 2, 1e-300)
    return np.asarray(0.5 * sizes[-1] * rate * _smooth(variance) / size)


def _smooth(values: Array) -> Array:
    """Return the mean over neighbouring lines."""
    width = min(_CONFIG.smooth, len(values))
    padded = np.pad(values, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")


def _spectrum(signals: Sequence[Array], rate: float, channel: int) -> tuple[Array, Array]:
    """Frequencies [Hz] and the density [unit²/Hz] of a channel."""
    segment = min(round(_CONFIG.density * rate), *(len(x) for x in signals))
    spectra = cross_spectra([x[:, [channel]] for x in signals], rate, segment)
    return spectra.frequency, spectra.density[:, 0, 0].real


def _held(
    several: Responses,
    first: Turned,
    band: ExcitedBand,
    ratio: float | None,
    inertia: dict[int, float],
) -> Held | None:
    """u → q with the other joints held: computed torque rests them only in a rigid arm.

    A joint whose inertia no log shows moves less than one before it.
    """
    if ratio is None:
        return None
    f = several.frequency
    inside = several.where(band.holds(f) & (f >= _CONFIG.coupled))
    f, sample_time = inside.frequency, first.sample_time
    rigid = double_integrator(f, sample_time, held=first.torque_held)
    others = [k for k in range(1, len(first.posture) + 1) if k != first.joint]
    known = {k: inertia.get(k, _roughly(first) if k > first.joint else np.inf) for k in others}
    places = tuple(range(TORQUE, several.response.shape[1]))
    most = np.array(list(known.values()))
    found = others_held(inside, rigid, _TORQUE, _POSITION, places, most)
    if found is None:
        return None
    _, delay = loop_delay(first.controller, first.quantity)
    own = double_integrator(f, sample_time, delay, first.held)
    return found.times(np.asarray(ratio * own / rigid))


def _torque_per_input(
    plant: FrequencyResponse, compliance: FrequencyResponse, band: ExcitedBand
) -> float | None:
    """τ/u, one number per joint, D̂ or 1: the median, weighted by what is known."""
    inside = [one.where(band.holds(one.frequency)) for one in (compliance, plant)]
    torque, whole = (one.within(*_CONFIG.constant) for one in inside)
    if not len(torque.frequency) or len(torque.frequency) != len(whole.frequency):
        return None
    ratio = (whole.response / torque.response).real
    weight = np.abs(torque.response) ** 2 / np.maximum(torque.variance, 1e-300)
    order = np.argsort(ratio)
    middle = int(np.searchsorted(np.cumsum(weight[order]), 0.5 * weight.sum()))
    return float(ratio[order][min(middle, len(order) - 1)])


def _excited(
    turned: tuple[Turned, ...], signals: Sequence[Array], how: How, distorted: bool = True
) -> tuple[Responses, float | None, Detected]:
    """v → (u, q, τ, …), the distortion between realisations, what detection lines show.

    Not `distorted`: with the covariance of noise alone.
    """
    first, outputs = turned[0], range(1, signals[0].shape[1])
    period = first.period if len({one.period for one in turned}) == 1 else None
    whole = [x for x in signals if period is not None and len(x) >= 2 * period]
    if how.estimator == "multisine" and not whole:
        words = f"v of joint {first.joint} does not repeat while the joint turns at constant speed"
        remedy = "inject a periodic multisine for two periods or more, or take another estimator"
        raise InputRejected("T07", words, where=first.name, remedy=remedy)
    if period is not None and whole and how.estimator in ("auto", "multisine"):
        found = multisine_responses(whole, first.rate, period, V, outputs)
        if not distorted:
            return found.noise, None, (None, None)
        return (*_of_multisine(found), _detected(found.detection))
    if how.estimator == "welch":
        return _welch(signals, turned, how, V, outputs), None, (None, None)
    spacing = how.resolution or _CONFIG.resolution
    last = np.floor(_CONFIG.highest * first.rate / spacing)
    frequency = np.arange(np.ceil(_CONFIG.lowest / spacing), last + 1) * spacing
    several = local_polynomial(signals, first.rate, frequency, V, outputs)
    known = np.asarray(np.isfinite(several.response).all(axis=1))
    return several.where(known), None, (None, None)


def _detected(lines: DetectionLines | None) -> Detected:
    """Even and odd distortion of the position: mean power at the lines left out over the noise."""
    if lines is None:
        return None, None
    inside = lines.frequency >= _CONFIG.lowest
    share = lines.power[:, _POSITION] / np.maximum(lines.noise[:, _POSITION], 1e-300)
    kinds = (inside & ~lines.odd, inside & lines.odd)
    even, odd = (float(np.median(share[k])) if k.any() else None for k in kinds)
    return even, odd


def _of_multisine(found: MultisineResponses) -> tuple[Responses, float | None]:
    """Return the response, its covariance raised where realisations differ by more than noise does.

    Few realisations tell the distortion of one line badly: it is compared with the noise over
    neighbouring lines.
    """
    noise = found.noise
    if found.total is None:
        return noise, None
    own, total = (np.maximum(r.variance[:, _POSITION], 1e-300) for r in (noise, found.total))
    local = _smooth(total / own)
    raised = np.maximum(local, 1.0)[:, None, None]
    return replace(noise, covariance=noise.covariance * raised), float(np.median(local))


def _segments(turned: tuple[Turned, ...], lengths: Sequence[int], how: How) -> tuple[int, int]:
    """Return the samples of a segment of Welch's method, and of which bins each one counts.

    A periodic v has lines: two periods to a segment, and Hann's window keeps its lines apart; else
    what the resolution asks, so short that four of them are averaged.

    Raises:
        InputRejected: T08, the record is too short for the resolution that was asked for.
    """
    first = turned[0]

    def enough(segment: int) -> bool:
        counts = [1 + 2 * (length - segment) // segment for length in lengths if length >= segment]
        return sum(counts) >= _CONFIG.segments

    if how.resolution is None and first.period and enough(2 * first.period):
        return 2 * first.period, 2
    wanted = round(first.rate / (how.resolution or _CONFIG.resolution))
    if how.resolution is not None and not enough(wanted):
        seconds, asked = sum(lengths) / first.rate, how.resolution
        words = f"{seconds:.3g} s at constant speed are too short for {asked:g} Hz"
        remedy = f"record {_CONFIG.segments / asked:.3g} s each way, or ask for a coarser one"
        raise InputRejected("T08", words, where=first.name, remedy=remedy)
    while wanted > _CONFIG.least and not enough(wanted):
        wanted //= 2
    return wanted, 1


def _welch(
    signals: Sequence[Array],
    turned: tuple[Turned, ...],
    how: How,
    source: int,
    outputs: Sequence[int],
) -> Responses:
    first = turned[0]
    samples, every = _segments(turned, [len(x) for x in signals], how)
    spectra = cross_spectra(signals, first.rate, samples)
    density = spectra.density.copy()
    power = density[:, source, source].real
    excited = power > _CONFIG.no_power * power.max()
    density[~excited, source, source] = power.max()  # of a bin that is left out below
    found = replace(spectra, density=density).responses(source, outputs)
    number = np.rint(found.frequency * samples * first.sample_time)
    inside = found.frequency >= _CONFIG.lowest
    inside &= found.frequency <= _CONFIG.highest * first.rate
    return found.where(inside & excited[1:] & (number % every == 0))


def _with_reversal(turned: tuple[Turned, ...], how: How) -> FrequencyResponse | None:
    """From the whole log: what it would have been had nothing been left out."""
    known = [one.whole for one in turned]
    segment = round(turned[0].rate / (how.resolution or _CONFIG.resolution))
    if not all(np.isfinite(x).all() for x in known):
        return None
    if sum(len(x) for x in known) < _CONFIG.segments * segment:
        return None
    return closed_loop(_welch(known, turned, how, V, (INPUT, POSITION)))
