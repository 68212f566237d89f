"""What is found out about the reconstructed motion of one log: the observer, what it leaves, how well the motion is known."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from pipelines.io.log import Array, ExperimentLog
from pipelines.io.results import NOT_STORED
from pipelines.io.schema import joint_unit
from pipelines.model import motion_quality as quality
from pipelines.model.estimation.conditioning import cutoff_at, wanted_cutoff
from pipelines.model.mean_period import NoiseFloor, mean_period, noise_floor
from pipelines.model.measured import Measured, measured
from pipelines.model.motion import Reconstructed, Reconstruction
from pipelines.model.tuned import Observers, encoder_resolution, tuned_observers
from pipelines.signal.observer import Observer
from pipelines.signal.tuning import smoother_bandwidth

__all__ = ["ALARM", "SLIGHT", "LogResult", "MeanResult", "ObserverResult", "Place", "Series", "SmootherResult", "alarm", "assess",
           "coloured", "straying"]

ALARM = 5e-4  # [rad] between measured and reconstructed position: Kostić et al. 2004, Fig. 10(a), stays below it
SLIGHT = 0.2  # rms autocorrelation that changes a variance by less than a tenth

_BUCKETS = 400  # of an envelope
_WHITE = 3.0  # standard deviations


@dataclass(frozen=True)
class ObserverResult:
    """The Kalman observer of Kostić et al. 2004, eq. (18)-(20). Every array is per joint."""

    order: int
    sample_time: float  # [s]
    gains: Array  # (joints, order) k_i of Kostić et al. 2004, eq. (20) [1, 1/s, 1/s², ...]
    bandwidth_hz: Array  # -3 dB of the position
    measurement_std: Array  # [rad] √R
    jerk_std: Array  # [rad/s^order] σ, as tuned or as asked for
    jerk_std_paper: Array  # the first guess of Kostić et al. 2004: the largest jerk of the reference


@dataclass(frozen=True)
class SmootherResult:
    """The smoother between the ends of a log: zero phase, and less jerk than an observer needs. Arrays per joint."""

    jerk_std: Array  # [rad/s^order]
    measurement_std: Array  # [rad]
    bandwidth_hz: Array  # -3 dB of the position


@dataclass(frozen=True)
class Series:
    """What the figures show: lowest and highest sample of each short stretch (points, joints)."""

    t: Array  # [s] (points,)
    error: Array  # [rad] measured minus reconstructed; NaN where nothing was measured
    speed: Array
    speed_std: Array  # largest of the stretch
    acceleration: Array
    acceleration_std: Array
    frequency: Array  # [Hz] (bins,)
    error_density: Array  # [rad²/Hz] (bins, joints)


@dataclass(frozen=True)
class MeanResult:
    """How well the mean period is known; an estimate takes its equations from it. Arrays per joint."""

    periods: int  # averaged
    position_std: Array  # in the middle of all samples
    speed_std: Array
    acceleration_std: Array


@dataclass(frozen=True)
class LogResult:
    """One log. Every array is per joint, in SI units (m for prismatic joints)."""

    name: str
    source: str
    file: str  # the derived log, relative to the output folder
    method: str
    samples: int
    predicted: int  # samples in which the position of some joint was not measured, and is predicted
    units: tuple[str, ...]  # of position
    resolution: Array  # [rad] of the encoders: described, or seen in the samples
    observer: ObserverResult
    smoother: SmootherResult | None
    innovation_whiteness: Array  # about standard normal where white; null for a joint that stands still
    innovation_correlation: Array  # rms of their autocorrelation over 30 lags
    innovation_verdict: tuple[str, ...]  # what that means
    reconstruction_error_max: Array  # [rad] max |measured - reconstructed|
    reconstruction_error_rms: Array  # [rad]
    peak_speed: Array
    peak_acceleration: Array
    position_std: Array  # of the reconstruction, in the middle of all samples
    speed_std: Array
    acceleration_std: Array
    noise_floor: NoiseFloor | None  # between the periods of a periodic log
    mean: MeanResult | None  # of its periods, where they are averaged
    series: Series | None
    log: ExperimentLog = field(metadata=NOT_STORED, repr=False)


@dataclass(frozen=True)
class Place:
    """Where a log came from, and the derived log's file without its ending."""

    source: str
    file: str


def assess(log: ExperimentLog, found: Reconstructed, how: Reconstruction, place: Place, derived: ExperimentLog,
           draw: bool) -> LogResult:
    """All about the motion `found` of `log`; the series for figures if `draw`."""
    seen = measured(log, found.good)
    tuned = found.observers or tuned_observers(seen.good, seen.y, seen.longest, seen.step, how)
    error, observer = quality.reconstruction_error(seen, found), tuned.causal
    (white, correlation), inside = quality.innovation_whiteness(seen, observer), _inside(seen)
    return LogResult(
        log.name, place.source, place.file, how.method, log.n_samples, int(np.isnan(seen.y).any(axis=1).sum()),
        tuple(joint_unit("q", joint.revolute) for joint in log.robot.joints),
        encoder_resolution(found.good), _observer(observer, quality.paper_jerk(seen, found, how.order)),
        _smoother(tuned) if how.method == "smoother" else None,
        white, correlation, tuple(_words(w, c) for w, c in zip(white.tolist(), correlation.tolist(), strict=True)),
        np.nanmax(np.abs(error), axis=0), np.sqrt(np.nanmean(error**2, axis=0)),
        np.abs(found.motion.dq[inside]).max(axis=0), np.abs(found.motion.ddq[inside]).max(axis=0), *quality.typical_std(found),
        *_periods(log, seen, found, how), _series(seen, found, error) if draw else None, derived)


def _periods(log: ExperimentLog, seen: Measured, found: Reconstructed,
             how: Reconstruction) -> tuple[NoiseFloor | None, MeanResult | None]:
    """What differs between periods, before and after the low-pass that an estimate would choose, and their mean."""
    cutoff = cutoff_at(wanted_cutoff(found.motion, 1.0 / seen.step), 1.0 / seen.step)
    if not how.average:
        return noise_floor(log, found, cutoff), None
    floor, mean = mean_period(log, found, cutoff)
    return floor, None if floor is None or mean is None else MeanResult(floor.periods, *quality.typical_std(mean[1]))


def alarm(log: LogResult) -> Array:
    """[rad] (joints,) by which a reconstructed position may differ from a measured one: `ALARM`, or one step of the encoder.

    What a coarse encoder counts is up to half a step from the motion, and further where its count is late.
    """
    return np.maximum(ALARM, log.resolution)


def straying(log: LogResult) -> tuple[int, ...]:
    """Revolute joints, counted from 1, whose reconstructed position is further than `alarm` from a measured one."""
    triples = zip(log.units, log.reconstruction_error_max.tolist(), alarm(log).tolist(), strict=True)
    return tuple(j for j, (unit, error, limit) in enumerate(triples, 1) if unit == "rad" and error > limit)


def coloured(log: LogResult) -> tuple[int, ...]:
    """Joints, counted from 1, whose innovations are so coloured that no stated standard deviation can be relied on."""
    return tuple(j for j, words in enumerate(log.innovation_verdict, 1) if words.startswith("coloured"))


def _inside(seen: Measured) -> npt.NDArray[np.intp]:
    """Indices, in the recording, of the samples of usable stretches."""
    return np.concatenate([seen.good.kept[run] for run in seen.good.runs])


def _observer(observer: Observer, paper: Array) -> ObserverResult:
    return ObserverResult(observer.order, observer.sample_time, observer.gain, observer.bandwidth_hz,
                          np.sqrt(observer.noise_variance), observer.jerk_std, paper)


def _smoother(tuned: Observers) -> SmootherResult:
    own = tuned.smoothing
    return SmootherResult(own.jerk_std, np.sqrt(own.noise_variance), smoother_bandwidth(own, tuned.twice))


def _words(statistic: float, correlation: float) -> str:
    if np.isnan(statistic):
        return "none: the joint stands still"
    if abs(statistic) < _WHITE:
        return "white: the observer takes from the encoder all that a model of random jerk can"
    if correlation < SLIGHT:
        return f"nearly white, correlation {correlation:.2f}: the motion is smoother than random jerk, the standard deviations hold"
    return (f"coloured, correlation {correlation:.2f}: an encoder error with a pattern, a vibration, or a jerk level that was "
            "asked for and does not fit; the standard deviations may be too small")


def _series(seen: Measured, found: Reconstructed, error: Array) -> Series:
    kept = seen.good.kept
    size = max(1, -(-len(kept) // _BUCKETS))
    first = np.arange(0, len(kept), size)
    t = seen.good.log.t
    std = found.std or (np.full_like(error, np.nan),) * 3
    spectrum = quality.error_spectrum(seen, error)
    return Series(np.stack([t[first], t[np.minimum(first + size // 2, len(t) - 1)]], axis=1).ravel(), _envelope(error, size),
                  _envelope(found.motion.dq[kept], size), _envelope(std[1][kept], size),
                  _envelope(found.motion.ddq[kept], size), _envelope(std[2][kept], size), spectrum.frequency, spectrum.density)


def _envelope(x: Array, size: int) -> Array:
    """(2 buckets, joints): lowest and highest of each bucket of `size` samples, NaN where it has none."""
    first = np.arange(0, len(x), size)
    low = np.minimum.reduceat(np.where(np.isnan(x), np.inf, x), first, axis=0)
    high = np.maximum.reduceat(np.where(np.isnan(x), -np.inf, x), first, axis=0)
    both = np.stack([low, high], axis=1).reshape(-1, x.shape[1])
    return np.where(np.isfinite(both), both, np.nan)
