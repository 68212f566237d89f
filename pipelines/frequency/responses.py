"""Estimate the plant's frequency response of one joint in one posture, by three methods.

    for measured in measured_responses(logs): ...

    closed-loop   P = Φ_vq / Φ_vu           needs no controller, no bias; the default
    indirect      P = (1 - S)/(C S), (29)   with the controller as it was sampled
    direct        P = Φ_uq / Φ_uu, (26)     biased where a disturbance goes round the loop,
                                            whatever its coherence says

Kostić et al. 2004, Section IV.D, eq. (26)-(29). u is r under computed torque, τ under PD. Segments
of a periodic v hold two periods, and Hann's window keeps its lines apart; of any other they are as
long as leaves some to average. Logs of one joint and one posture are averaged.

Under PD the other joints are held by their controllers alone, and swing above the band of those.
Where every joint was excited in a posture, those experiments are superposed so that the others
stand still: with τ_j = Σ_k Z_jk q_k in each, [Z_j1 … Z_jn] follows from as many of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from pipelines.errors import InputRejected
from pipelines.frequency.config import ResponseConfig
from pipelines.frequency.controller import loop_delay, sampled_controller
from pipelines.frequency.signals import INPUT, Turned, V, turned_joint
from pipelines.frequency.spectra import (
    Array,
    FrequencyResponse,
    Intervals,
    Responses,
    closed_loop,
    cross_spectra,
    excited_band,
    indirect,
    inside,
)
from pipelines.io.log import ExperimentLog

__all__ = ["Measured", "averaged_responses", "measured_responses"]

_CONFIG = ResponseConfig()
_OF_INPUT = INPUT - 1  # numerics: place among the outputs of v
_REPEATED = 1.0 / 3.0  # numerics: twice the correlation 1/6 of half overlapping Hann windows
_OF_LINES = 1.0 / 18.0  # numerics: twice its square, that of bins two apart as well


@dataclass(frozen=True, eq=False)
class Measured:
    """One joint in one posture."""

    turned: tuple[Turned, ...]  # its logs
    several: Responses  # v → input, positions and torques of all joints
    plant: FrequencyResponse  # u → q by Φ_vq/Φ_vu
    compliance: FrequencyResponse  # τ → q [rad/N m]
    direct: FrequencyResponse
    indirect: FrequencyResponse | None  # None: the log does not describe the controller
    torque_per_input: float | None  # D̂ [kg m^2] or 1 under PD; None: they cannot be compared
    aliased: bool  # the input was sampled, and v has power up to half the rate: it folds back
    excited: Intervals  # where the response exists: nothing is fitted, judged or named outside
    held: FrequencyResponse | None = None  # `plant` with the other joints held; None: not known

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


def measured_responses(logs: Iterable[ExperimentLog]) -> tuple[Measured, ...]:
    """Return every joint and posture in turn, by joint, then by the order of the logs.

    One posture is all logs of a joint whose other joints are held within a tolerance, under one
    controller and one kind of excitation.

    Raises:
        InputRejected: S01, T05, T08, D09: a log that no spectrum can be taken of.
    """
    groups: list[list[Turned]] = []
    for turned in sorted((turned_joint(log) for log in logs), key=lambda t: t.joint):
        for group in groups:
            apart = np.delete(group[0].posture - turned.posture, turned.joint - 1)
            near = bool(np.abs(apart).max(initial=0.0) < _CONFIG.same_posture)
            if near and group[0].settings() == turned.settings():
                group.append(turned)
                break
        else:
            groups.append([turned])
    segments = [_segment(group) for group in groups]
    found = []
    for group in groups:  # one resolution for all that are superposed
        first = group[0]
        alike = [
            size
            for size, other in zip(segments, groups, strict=True)
            if (other[0].period, other[0].sample_time) == (first.period, first.sample_time)
        ]
        found.append(_measured(tuple(group), *min(alike)))
    return tuple(replace(one, held=_others_held(one, found)) for one in found)


def _signals(turned: Sequence[Turned]) -> list[Array]:
    return [s.signals for one in turned for s in one.stretches]


def _segment(turned: Sequence[Turned]) -> tuple[int, int]:
    """Return samples of a segment, and of which bins each one counts: two periods, every second."""
    lengths = [len(x) for x in _signals(turned)]

    def averages(segment: int) -> int:
        return sum(1 + (n - segment) // (segment - segment // 2) for n in lengths if n >= segment)

    period = turned[0].period
    if period is not None and averages(2 * period) >= _CONFIG.of_lines:
        return 2 * period, 2
    segment = max(lengths)
    while averages(segment) < _CONFIG.segments or (
        sum(n for n in lengths if n >= segment) < _CONFIG.most * sum(lengths)
    ):
        segment = int(_CONFIG.shorter * segment)
    return segment, 1


def averaged_responses(
    signals: Sequence[Array], rate: float, samples: int, every: int
) -> Responses:
    """Return responses from the first channel to the others, where it has power.

    Args:
        signals: each (samples, channels).
        rate: samples a second [Hz].
        samples: of a segment.
        every: how many bins apart those lie that count.
    """
    spectra = cross_spectra(signals, rate, samples)
    power = spectra.density[:, 0, 0].real
    powered = power > _CONFIG.no_power * power.max()
    spectra.density[~powered, 0, 0] = power.max()  # of a bin that is left out below
    found = spectra.responses(0, range(1, signals[0].shape[1]))
    if every > 1:  # of a source that repeats, errors of overlapping parts add as they correlate
        rest = 1.0 - 1.0 / spectra.segments
        wider = (1.0 + rest * _REPEATED) / (1.0 + rest * _OF_LINES)
        found = replace(found, covariance=found.covariance * wider, correlated=1.0 + _OF_LINES)
    f, number = found.frequency, np.arange(1, len(power))
    kept = (f >= _CONFIG.lowest) & (f <= _CONFIG.highest * rate)
    return found.where(kept & powered[1:] & (number % every == 0))


def _measured(turned: tuple[Turned, ...], samples: int, every: int) -> Measured:
    first, signals = turned[0], _signals(turned)
    several = averaged_responses(signals, first.rate, samples, every)
    position, torque = first.position - 1, first.torque - 1
    plant = closed_loop(several, position, _OF_INPUT)
    compliance = closed_loop(several, position, torque)
    if not len(plant.frequency):
        words = "the excitation has no power at any frequency"
        raise InputRejected("D09", words, remedy="excite the joint")
    late, _ = loop_delay(first.controller, first.quantity)
    shift = np.exp(2j * np.pi * plant.frequency * late * first.sample_time)
    by_controller, c = (
        None,
        sampled_controller(first.controller, first.joint, plant.frequency, first.sample_time),
    )
    if c is not None:
        by_controller = indirect(several.of(_OF_INPUT).times(shift), c / shift)
    segment = min(round(_CONFIG.density * first.rate), *(len(x) for x in signals))
    spectra = cross_spectra([x[:, [V]] for x in signals], first.rate, segment)
    f, density = spectra.frequency, spectra.density[:, 0, 0].real
    band = excited_band(
        [several.of(_OF_INPUT), several.of(position)], np.interp(several.frequency, f, density)
    )
    typical = density[inside(band, f)]
    top = float(np.median(density[f > _CONFIG.highest * first.rate]))
    folds = bool(len(typical)) and top > _CONFIG.folded * float(np.median(typical))
    own = [x[:, [INPUT, first.position]] for x in signals]
    return Measured(
        turned=turned,
        several=several,
        plant=plant,
        compliance=compliance,
        direct=averaged_responses(own, first.rate, samples, every).of(0),
        indirect=by_controller,
        torque_per_input=_torque_per_input(plant, compliance, band),
        aliased=not first.held and folds,
        excited=band,
    )


def _torque_per_input(
    plant: FrequencyResponse, compliance: FrequencyResponse, band: Intervals
) -> float | None:
    """τ/u, one number per joint, D̂ or 1: the median, weighted by what is known."""
    f, (low, high) = plant.frequency, _CONFIG.constant
    both = inside(band, f) & (f >= low) & (f <= high)
    if not both.any():
        return None
    ratio = (plant.response[both] / compliance.response[both]).real
    known = np.abs(compliance.response) ** 2 / np.maximum(compliance.variance, 1e-300)
    order = np.argsort(ratio)
    weight = np.cumsum(known[both][order])
    middle = int(np.searchsorted(weight, 0.5 * weight[-1]))
    return float(ratio[order][min(middle, len(order) - 1)])


def _stands_as(one: Turned, other: Turned) -> bool:
    """Return whether all joints stand alike; `other` holds that which `one` turns in its stroke.

    The joint that `other` turns is not compared: that is for the call the other way round.
    """
    tolerance, (low, high) = _CONFIG.same_posture, one.stroke
    apart = np.delete(other.posture - one.posture, [one.joint - 1, other.joint - 1])
    near = bool(np.abs(apart).max(initial=0.0) < tolerance)
    return near and low - tolerance < other.posture[one.joint - 1] < high + tolerance


def _others_held(one: Measured, every: Sequence[Measured]) -> FrequencyResponse | None:
    """Return τ_j → q_j with the other joints held, from the experiments on all joints.

    w superposes them: Σ_e w_e q_k^e is 1 for the joint and 0 for the others. Then Z_jj is
    Σ_e w_e τ_j^e, off by Σ_e w_e (δτ_j^e - Σ_k Z_jk δq_k^e).
    """
    first, n, j = one.first, len(one.first.posture), one.joint - 1
    same = [
        other
        for other in every
        if other is one
        or (
            other.joint != one.joint
            and other.several.resolution == one.several.resolution
            and _stands_as(first, other.first)
            and _stands_as(other.first, first)
        )
    ]
    quantities = {other.first.quantity for other in same}
    if n == 1 or quantities != {"tau"} or [o.joint for o in same] != list(range(1, n + 1)):
        return None
    f = reduce(np.intersect1d, [other.several.frequency for other in same])
    several = [other.several.where(np.isin(other.several.frequency, f)) for other in same]
    rows = [1 + n + j, *range(1, 1 + n)]  # of torque and positions, among the outputs of v
    t = np.stack([each.response[:, rows[0]] for each in several], axis=1)
    q = np.stack([each.response[:, rows[1:]] for each in several], axis=2)
    inverse = np.linalg.inv(q)  # (bins, experiments, joints)
    w, z = inverse[:, :, j], (t[:, None] @ inverse)[:, 0]  # Z_j1 … Z_jn
    rest = np.concatenate([np.ones((len(f), 1)), -z], axis=1)
    variance = np.zeros(len(f))
    for k, each in enumerate(several):
        own = each.covariance[:, rows][:, :, rows]
        variance += np.abs(w[:, k]) ** 2 * np.einsum("ba,bac,bc->b", rest, own, rest.conj()).real
    response = np.asarray(1.0 / z[:, j], dtype=np.complex128)
    variance = variance * np.abs(response) ** 4
    plant = one.plant.where(np.isin(one.plant.frequency, f))
    return replace(plant, response=response, variance=variance)
