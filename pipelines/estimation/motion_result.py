"""Assess the reconstructed motion of a log: its observer, its residual, its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipelines.estimation.config import MotionConfig
from pipelines.estimation.grids import Measured, lay_on, measured
from pipelines.estimation.motion import (
    Reconstructed,
    Reconstruction,
    encoder_resolution,
    tuned_observers,
)
from pipelines.estimation.periods import NoiseFloor, mean_period
from pipelines.estimation.regression import cutoff_at, wanted_cutoff
from pipelines.estimation.state_estimation import Observer
from pipelines.estimation.tuning import innovations, smoother_bandwidth, whiteness
from pipelines.io.log import Array, ExperimentLog
from pipelines.io.results import NOT_STORED
from pipelines.io.schema import joint_unit

_CONFIG = MotionConfig()


@dataclass(frozen=True)
class ObserverResult:
    """The Kalman observer of Kostić et al. 2004, eq. (18)-(20). Every array is per joint."""

    order: int
    sample_time: float  # [s]
    gains: Array  # (joints, order) k_i of Kostić et al. 2004, eq. (20) [1, 1/s, 1/s², ...]
    bandwidth_hz: Array  # -3 dB of the position
    measurement_std: Array  # [rad] √R
    jerk_std: Array  # [rad/s^order] σ, as tuned or of the bandwidth that was given


@dataclass(frozen=True)
class SmootherResult:
    """The smoother between the ends of a log: zero phase, and less jerk than an observer needs."""

    jerk_std: Array  # [rad/s^order] (joints,)
    measurement_std: Array  # [rad]
    bandwidth_hz: Array  # -3 dB of the position


@dataclass(frozen=True)
class Series:
    """Series of the figures: lowest and highest sample of each short stretch (points, joints)."""

    t: Array  # [s] (points,)
    error: Array  # [rad] measured minus reconstructed; NaN where nothing was measured
    speed: Array
    speed_std: Array  # largest of the stretch
    acceleration: Array
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
    innovation_whiteness: Array  # standard normal where white; null for a joint that stands still
    innovation_correlation: Array  # rms of their autocorrelation over 30 lags
    innovation_verdict: tuple[str, ...]  # what that means
    reconstruction_error_max: Array  # [rad] max |measured - reconstructed|
    peak_speed: Array
    peak_acceleration: Array
    position_std: Array  # of the reconstruction, in the middle of all samples
    speed_std: Array
    acceleration_std: Array
    noise_floor: NoiseFloor | None  # between the periods of a periodic log
    series: Series | None
    log: ExperimentLog = field(metadata=NOT_STORED, repr=False)

    @property
    def alarm(self) -> Array:
        """[rad] (joints,) by which a reconstructed position may differ from a measured one.

        The paper's limit, or one step of the encoder: what a coarse encoder counts is up to half a
        step from the motion, and further where its count is late.
        """
        return np.maximum(_CONFIG.alarm, self.resolution)

    @property
    def straying(self) -> tuple[int, ...]:
        """Revolute joints, from 1, whose reconstruction is further than `alarm` from measured."""
        far = self.reconstruction_error_max > self.alarm
        return tuple(j for j, unit in enumerate(self.units, 1) if unit == "rad" and far[j - 1])

    @property
    def coloured(self) -> tuple[int, ...]:
        """Joints, from 1, with innovations so coloured that no stated deviation holds."""
        verdicts = enumerate(self.innovation_verdict, 1)
        return tuple(j for j, words in verdicts if words.startswith("coloured"))


def assess(
    log: ExperimentLog,
    found: Reconstructed,
    how: Reconstruction,
    names: tuple[str, str],
    derived: ExperimentLog,
    draw: bool,
) -> LogResult:
    """Return all about the motion `found` of `log`; the series for figures if `draw`.

    Args:
        names: of the file that was read, and of the one that is written, without its ending.
    """
    seen, kept, runs = measured(log, found.good), found.good.kept, found.good.runs
    tuned = found.observers or tuned_observers(seen, how)
    causal, smoothing = tuned.causal, tuned.smoothing
    inside = np.concatenate([np.arange(run.start, run.stop) for run in runs])
    error = np.full_like(seen.y, np.nan)  # Fig. 10(a)
    error[inside] = seen.y[inside] - found.motion.q[kept][inside]
    white, correlation = _whiteness(seen, causal)
    rate = 1.0 / seen.step
    cutoff = cutoff_at(wanted_cutoff(found.motion, rate), rate)
    position, speed, acceleration = (np.median(std, axis=0) for std in found.std)
    return LogResult(
        name=log.name,
        source=names[0],
        file=names[1],
        method=how.method,
        samples=log.n_samples,
        predicted=int(np.isnan(seen.y).any(axis=1).sum()),
        units=tuple(joint_unit("q", joint.revolute) for joint in log.robot.joints),
        resolution=encoder_resolution(found.good),
        observer=ObserverResult(
            causal.order,
            causal.sample_time,
            causal.gain,
            causal.bandwidth_hz,
            np.sqrt(causal.noise_variance),
            causal.jerk_std,
        ),
        smoother=SmootherResult(
            smoothing.jerk_std,
            np.sqrt(smoothing.noise_variance),
            smoother_bandwidth(smoothing, tuned.twice),
        )
        if how.method == "smoother"
        else None,
        innovation_whiteness=white,
        innovation_correlation=correlation,
        innovation_verdict=tuple(map(_verdict, white.tolist(), correlation.tolist())),
        reconstruction_error_max=np.nanmax(np.abs(error), axis=0),
        peak_speed=np.abs(found.motion.dq[kept[inside]]).max(axis=0),
        peak_acceleration=np.abs(found.motion.ddq[kept[inside]]).max(axis=0),
        position_std=position,
        speed_std=speed,
        acceleration_std=acceleration,
        noise_floor=mean_period(log, found, cutoff)[0],
        series=_series(seen, found, error) if draw else None,
        log=derived,
    )


def _whiteness(seen: Measured, observer: Observer) -> tuple[Array, Array]:
    """Return the whiteness of the innovations and the rms of their autocorrelation; (joints,) each.

    NaN for a joint that stood still. The statistic grows with the samples: that a correlation is
    there, not that it is large.
    """
    grid = seen.longest
    laid = lay_on(seen.y[grid.first : grid.last], grid)[: _CONFIG.longest]
    travel = np.nanmax(laid, axis=0) - np.nanmin(laid, axis=0)
    still = travel < 2.5 * encoder_resolution(seen.good)
    statistic, each = whiteness(innovations(laid, observer))
    correlation = np.sqrt((each**2).mean(axis=0))
    return np.where(still, np.nan, statistic), np.where(still, np.nan, correlation)


def _verdict(statistic: float, correlation: float) -> str:
    if np.isnan(statistic):
        return "none: the joint stands still"
    if abs(statistic) < _CONFIG.white:
        return "white: the observer takes from the encoder all that a model of random jerk can"
    if correlation < _CONFIG.slight:
        words = "the motion is smoother than random jerk, the standard deviations hold"
        return f"nearly white, correlation {correlation:.2f}: {words}"
    words = "an encoder error with a pattern, a vibration, or a bandwidth that was given and does "
    words += "not fit; the standard deviations may be too small"
    return f"coloured, correlation {correlation:.2f}: {words}"


def _series(seen: Measured, found: Reconstructed, error: Array) -> Series:
    kept, t = seen.good.kept, seen.good.log.t
    size = max(1, -(-len(kept) // _CONFIG.buckets))
    first = np.arange(0, len(kept), size)
    middle = t[np.minimum(first + size // 2, len(t) - 1)]

    def envelope(x: Array) -> Array:
        """(2 buckets, joints): lowest and highest of each bucket, NaN where it has none."""
        low = np.fmin.reduceat(x, first, axis=0)
        high = np.fmax.reduceat(x, first, axis=0)
        return np.stack([low, high], axis=1).reshape(-1, x.shape[1])

    return Series(
        np.stack([t[first], middle], axis=1).ravel(),
        envelope(error),
        envelope(found.motion.dq[kept]),
        envelope(found.std[1][kept]),
        envelope(found.motion.ddq[kept]),
        envelope(found.std[2][kept]),
    )
