"""How well a motion is known: what is left of the measurement, how white that is, what repeats in each period."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.errors import InputRejected
from pipelines.log.experiment import Array, ExperimentLog
from pipelines.model.motion import Measured, Reconstructed
from pipelines.model.tuned import encoder_resolution
from pipelines.signal.grid import lay_on
from pipelines.signal.observer import Observer
from pipelines.signal.periods import average_periods
from pipelines.signal.spectra import Spectrum, welch
from pipelines.signal.tuning import innovations, paper_rule, whiteness

__all__ = ["NoiseFloor", "error_spectrum", "innovation_whiteness", "noise_floor", "paper_jerk",
           "reconstruction_error", "typical_std"]

_LONGEST = 131072  # samples that a spectrum or a test of whiteness looks at


@dataclass(frozen=True)
class NoiseFloor:
    """What differs from period to period: nothing that repeats, be it modelled or not, is in it. Each (joints,)."""

    periods: int  # compared
    left_out: tuple[int, ...]  # periods that differ from the others, counted from 1
    position: Array  # [rad] standard deviation of one sample
    torque: Array  # [N m]


def reconstruction_error(seen: Measured, found: Reconstructed) -> Array:
    """Measured minus reconstructed position [rad] (kept samples, joints), Fig. 10(a); NaN where nothing was measured or used."""
    inside = np.zeros(len(seen.y), dtype=bool)
    for run in seen.good.runs:
        inside[run] = True
    return np.asarray(np.where(inside[:, None], seen.y - found.motion.q[seen.good.kept], np.nan))


def error_spectrum(seen: Measured, error: Array) -> Spectrum:
    """Its density [rad²/Hz] over the longest stretch."""
    run = max(seen.good.runs, key=lambda r: r.stop - r.start)
    return welch(np.nan_to_num(error[run][:_LONGEST]), 1.0 / seen.step)


def innovation_whiteness(seen: Measured, observer: Observer) -> tuple[Array, Array]:
    """About standard normal where the innovations are white, and the rms of their autocorrelation over 30 lags; each (joints,).

    NaN for a joint that stood still. The statistic grows with the samples: that a correlation is there, not that it is large.
    """
    grid = seen.longest
    laid = lay_on(seen.y[grid.first:grid.last], grid)[:_LONGEST]
    still = np.nanmax(laid, axis=0) - np.nanmin(laid, axis=0) < 2.5 * encoder_resolution(seen.good)
    white = whiteness(innovations(laid, observer))
    correlation = np.sqrt((white.autocorrelation**2).mean(axis=0))
    return np.where(still, np.nan, white.statistic), np.where(still, np.nan, correlation)


def paper_jerk(seen: Measured, found: Reconstructed, order: int) -> Array:
    """The paper's first guess of σ (joints,): the largest jerk of the reference, or of the motion found."""
    log, run = seen.good.log, max(seen.good.runs, key=lambda r: r.stop - r.start)
    with_reference = "q_ref" in log and bool(np.isfinite(log["q_ref"][run]).all())
    motion = log["q_ref"] if with_reference else found.motion.q[seen.good.kept]
    return paper_rule(motion[run], seen.step, order)


def typical_std(found: Reconstructed) -> tuple[Array, Array, Array]:
    """Median standard deviation of position, speed and acceleration (joints,); NaN where the method has none."""
    if found.std is None:
        unknown = np.full(found.motion.q.shape[1], np.nan)
        return unknown, unknown, unknown
    position, speed, acceleration = (np.median(std, axis=0) for std in found.std)
    return position, speed, acceleration


def noise_floor(log: ExperimentLog, seen: Measured) -> NoiseFloor | None:
    """Scatter between the periods of a periodic log; None where it has none, or fewer than two are whole."""
    grid = seen.longest
    if log.period is None or grid.size * seen.step < 2.0 * log.period * (1.0 - 1e-9):
        return None
    rows, good = slice(grid.first, grid.last), seen.good
    torque = np.where(good.torque_spikes, np.nan, good.log.tau)
    try:
        position, effort = (average_periods(lay_on(x[rows], grid), 1.0 / grid.step, log.period) for x in (seen.y, torque))
    except InputRejected:  # a part of the period was never measured
        return None
    left_out = tuple(k + 1 for k in sorted({*position.outliers, *effort.outliers}))
    return NoiseFloor(min(position.count, effort.count), left_out, np.sqrt(position.noise_variance), np.sqrt(effort.noise_variance))
