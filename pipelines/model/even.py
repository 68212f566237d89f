"""Put a log whose clock is uneven on an even grid, so that every later filter has even samples.

    even = evened(log, good)        None where the clock is even already

Positions and measured torques are splines through the instants (`signal.instants`), a held
command is its average over each step. Lost samples within a stretch are bridged by the spline; a
gap remains a gap, and missing or spoilt samples remain so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipelines.errors import InputRejected
from pipelines.io.log import Array, ExperimentLog
from pipelines.quality.segments import Mask, Usable, usable
from pipelines.signal.instants import Instants, average_held, instants, merge_close
from pipelines.signal.resample import grid, resample

__all__ = ["EvenConfig", "Evened", "evened"]


@dataclass(frozen=True)
class EvenConfig:
    """When a clock counts as even, and when as none."""

    even: float = 1e-3  # of a sample time, rms of the intervals: 1e-6 rad at 1 rad/s and 1 kHz
    merged: float = 0.05  # of the samples that lie closer than a quarter step: no clock


@dataclass(frozen=True, eq=False)
class Evened:
    """A log on an even grid."""

    log: ExperimentLog
    good: Usable  # of `log`
    # kept samples of the recording, samples of `log`, their clock
    stretches: tuple[tuple[slice, slice, Instants], ...]

    def at_recording(self, values: Array, samples: int, spline: bool) -> Array:
        """Return signals (k, n, joints) at the kept samples of the recording, NaN outside runs."""
        out = np.full((len(values), samples, values.shape[2]), np.nan)
        flat = np.moveaxis(values, 1, 0).reshape(values.shape[1], -1)
        for recorded, even, clock in self.stretches:
            at = resample(self.log.t[even], flat[even], clock.t, "spline" if spline else "linear")
            out[:, recorded] = np.moveaxis(at.reshape(-1, *out.shape[::2]), 0, 1)
        return out


def evened(log: ExperimentLog, good: Usable, config: EvenConfig | None = None) -> Evened | None:
    """Return `log` on an even grid of its nominal sample time; None where its clock is even.

    Raises:
        InputRejected: T05, samples lie on each other.
    """
    config = config or EvenConfig()
    if good.time.jitter <= config.even or not good.runs:
        return None
    step = log.sample_time if good.time.known else good.time.median
    parts, stretches, done = [], [], 0
    for run in good.runs:
        stamps = good.log.t[run]
        clock = instants(stamps, _filled(stamps, good.log.q[run], good.position_spikes[run]), step)
        at = grid(float(clock.t.min()), float(clock.t.max()), 1.0 / step)
        parts.append((at, *_sampled(good, run, clock, at, step, log.torque != "measured", config)))
        stretches.append((run, slice(done, done + len(at)), clock))
        done += len(at)
    t, q, tau, saturated = (np.concatenate(part) for part in zip(*parts, strict=True))
    values = {"t": t, "q": q, "tau": tau}
    signals = {name: replace(good.log.signals[name], values=x) for name, x in values.items()}
    even = replace(log, signals=signals, sample_time=step, derived=None)
    return Evened(even, replace(usable(even), saturated=saturated > 0.0), tuple(stretches))


def _sampled(good: Usable, run: slice, clock: Instants, at: Array, step: float, held: bool,
             config: EvenConfig) -> tuple[Array, Array, Array]:
    """Return position, torque and saturation (n, joints) of one stretch at even times."""
    q, tau = (np.where(spoilt[run], np.nan, x[run]) for x, spoilt in
              ((good.log.q, good.position_spikes), (good.log.tau, good.torque_spikes)))
    lost = np.hstack([np.isnan(q), np.isnan(tau), good.saturated[run]]).astype(np.float64)
    q, tau = (_filled(clock.t, x, np.isnan(x)) for x in (q, tau))
    t, both = merge_close(clock.t, np.hstack([q, tau, lost]), step)
    if len(t) < (1.0 - config.merged) * len(clock.t):
        crowded = f"{len(clock.t) - len(t)} of {len(clock.t)} samples lie on another's place"
        raise InputRejected("T05", f"the clock is too uneven: {crowded}",
                            where=good.log.source or good.log.name,
                            remedy="record with an even clock, or resample with 'rrrid import'")
    joints = good.log.n_joints
    q, tau = resample(t, both[:, :joints], at), both[:, joints:2 * joints]
    tau = average_held(t, tau, at, step) if held else resample(t, tau, at)
    no_q, no_tau, saturated = np.split(resample(t, both[:, 2 * joints:], at, "linear"), 3, axis=1)
    return np.where(no_q > 0.0, np.nan, q), np.where(no_tau > 0.0, np.nan, tau), saturated


def _filled(t: Array, x: Array, spoilt: Mask) -> Array:
    """Return `x` (samples, joints) with straight lines where it is spoilt or not a number."""
    bad = spoilt | ~np.isfinite(x)
    if not bad.any():
        return x
    return np.stack([np.interp(t, t[~b], column[~b]) if not b.all() else np.zeros_like(column)
                     for column, b in zip(x.T, bad.T, strict=True)], axis=1)
