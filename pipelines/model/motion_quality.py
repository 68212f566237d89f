"""How well a motion is known: what is left of the measurement, and how white that is."""

from __future__ import annotations

import numpy as np

from pipelines.io.log import Array
from pipelines.model.measured import Measured
from pipelines.model.motion import Reconstructed
from pipelines.model.tuned import encoder_resolution
from pipelines.signal.grid import lay_on
from pipelines.signal.observer import Observer
from pipelines.signal.spectra import Spectrum, welch
from pipelines.signal.tuning import innovations, paper_rule, whiteness

__all__ = ["error_spectrum", "innovation_whiteness", "paper_jerk", "reconstruction_error", "typical_std"]

_LONGEST = 131072  # samples that a spectrum or a test of whiteness looks at


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
