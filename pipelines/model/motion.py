"""The motion of a log: position, speed and acceleration of every joint, by the method asked for.

    found = reconstruct(log, Reconstruction())
    found.motion.q, .dq, .ddq                  at the log's own samples, finite at each of them

Kostić et al. 2004, Section IV.C.4, eq. (16)-(21). A log that holds the signals already, derived from the same recording
with the same settings, is taken at its word; anything else is computed.

Samples without a measurement are predicted through by the model of the observer, from both sides, with the deviation that
comes of it. Where that exceeds what the joint ever did (after a lost connection, say) nothing is known but that: the value is
drawn straight from the last to the next that is known, its deviation is the range of the joint, its largest speed or acceleration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Motion
from pipelines.io.log import Array, ExperimentLog, derived_by
from pipelines.model.even import Evened, evened
from pipelines.model.measured import Measured, measured
from pipelines.model.trackers import difference_tracker, filter_tracker
from pipelines.model.tuned import (
    METHODS,
    Observers,
    Reconstruction,
    encoder_resolution,
    tuned_observers,
)
from pipelines.quality.segments import Mask, Usable, usable
from pipelines.signal.grid import Tracker, on_grid

__all__ = ["METHODS", "Mean", "Observers", "Reconstructed", "Reconstruction", "encoder_resolution", "for_equations",
           "noise_response", "reconstruct"]

Indices = npt.NDArray[np.intp]

_SIGNALS = ("q_hat", "dq_hat", "ddq_hat")
_VAGUE = 2.0  # times the usual standard deviation of the acceleration
_BEYOND = 5.0  # usual deviations: no cap below it, however still a joint stands


@dataclass(frozen=True, eq=False)
class Reconstructed:
    """Motion with its uncertainty, and the observer it came from."""

    motion: Motion  # at every sample of the recording
    std: tuple[Array, Array, Array] | None  # of q, dq, ddq, each (samples, joints); None where the method has none
    observers: Observers | None  # as tuned on the longest stretch; None where the method has none
    good: Usable  # which samples, stretches and masks
    derived: bool  # taken from the log instead of computed
    mean: Mean | None = None  # where the log is the mean period of another
    stuck: Mask | None = None  # (kept samples, joints) where dry friction holds a joint: its own equations are left out
    even: tuple[ExperimentLog, Reconstructed] | None = None  # of an uneven clock: the log on an even grid, for equations

    @property
    def vague(self) -> Mask:
        """(samples, joints) near an end or a gap, where the acceleration is known half as well as elsewhere, or worse."""
        if self.std is None:
            return np.zeros(self.motion.q.shape, dtype=bool)
        std = self.std[2]
        known = [column[~np.isnan(column)] for column in std.T]
        usual = np.array([np.median(x) if x.size else np.nan for x in known])
        return np.asarray(std > _VAGUE * usual)

    def signals(self) -> dict[str, Array]:
        """What a derived log gets."""
        values = dict(zip(_SIGNALS, (self.motion.q, self.motion.dq, self.motion.ddq), strict=True))
        return values | {f"{name}_std": std for name, std in zip(_SIGNALS, self.std or (), strict=False)}


@dataclass(frozen=True, eq=False)
class Mean:
    """Of which log another one is the mean period, and how it came of it (`mean_period`)."""

    first: int  # samples from here on are the mean; those before are copies of it
    last: int  # and those from here on
    periods: float  # in the mean: of each of its samples, on average
    differing: Array  # (joints,) share of the noise variance of positions that differs between periods; the rest repeats
    source: ExperimentLog
    whole: Reconstructed  # the motion of the source
    fold: Callable[[Array], Array]  # from any signal of the source, (kept samples, channels), to its mean and the copies


def reconstruct(log: ExperimentLog, how: Reconstruction, good: Usable | None = None,
                observers: Observers | None = None) -> Reconstructed:
    """The motion of `log`; `good` is `usable(log)`, for whoever has it already; `observers` those of a log like it.

    Raises:
        UsageError: C02, settings that do not fit the log.
        InputRejected: T04, no stretch of it is long enough; T05, its clock is too uneven.
    """
    how.check(log.n_joints)
    good = usable(log) if good is None else good
    if (even := evened(log, good)) is not None:
        return _of_even(log, even, how, good, observers)
    if derived_by(log, "reconstruct", how.as_settings()) and all(name in log for name in _SIGNALS):
        return _taken(log, good)
    seen = measured(log, good)
    states, std = np.full((3, *seen.y.shape), np.nan), np.full((3, *seen.y.shape), np.nan)
    filtering = how.method in ("smoother", "observer")
    tuned = (observers or tuned_observers(seen.good, seen.y, seen.longest, seen.step, how)) if filtering else None
    track = difference_tracker(seen, how) if tuned is None else filter_tracker(tuned, how)
    for grid in seen.grids:
        rows = slice(grid.first, grid.last)
        if grid.size > 1 and np.isfinite(seen.y[rows]).any():
            found, deviation = on_grid(seen.y[rows], grid, seen.step, track)
            states[:, rows] = found[:3]
            std[:, rows] = np.nan if deviation is None else deviation[:3]
    bound = _known_at_all(seen, states, std, tuned)
    _fill(states, std, bound)
    states, std = (_at_recording(seen.good.kept, values, log.n_samples) for values in (states, std))
    std[:, seen.good.time.undefined] = bound[:, None]
    return Reconstructed(Motion(log.t, *states), (std[0], std[1], std[2]) if filtering else None, tuned, seen.good, False)


def for_equations(motions: tuple[tuple[ExperimentLog, Reconstructed], ...]) -> tuple[tuple[ExperimentLog, Reconstructed], ...]:
    """Return the logs and motions that equations are made of: those with an uneven clock on their even grid."""
    return tuple((log, found) if found.even is None else found.even for log, found in motions)


def _of_even(log: ExperimentLog, even: Evened, how: Reconstruction, good: Usable, observers: Observers | None) -> Reconstructed:
    """Return the motion at the instants of the samples, from that on an even grid."""
    found = reconstruct(even.log, how, even.good, observers)
    samples = len(good.kept)
    states = even.at_recording(np.stack([found.motion.q, found.motion.dq, found.motion.ddq]), samples, spline=True)
    std = np.full_like(states, np.nan)
    if found.std is not None:
        std = even.at_recording(np.stack(found.std), samples, spline=False)
    bound = _bounds(found)
    _fill(states, std, bound)
    states, std = (_at_recording(good.kept, values, log.n_samples) for values in (states, std))
    std[:, good.time.undefined] = bound[:, None]
    return Reconstructed(Motion(log.t, *states), None if found.std is None else (std[0], std[1], std[2]), found.observers, good,
                         False, even=(even.log, found))


def _bounds(found: Reconstructed) -> Array:
    """Return what can be said of a joint where nothing was measured (3, joints): its range, largest speed and acceleration."""
    motion = found.motion
    return np.maximum([np.ptp(motion.q, axis=0), np.abs(motion.dq).max(axis=0), np.abs(motion.ddq).max(axis=0)], 1e-12)


def noise_response(log: ExperimentLog, found: Reconstructed, how: Reconstruction, samples: int,
                   rng: np.random.Generator) -> tuple[Array, Array]:
    """What white noise as strong as that of the positions does to `found` (3, samples, joints), and its variance [rad²] (joints,).

    Every way to reconstruct is linear in the positions: the response to noise adds to the motion.
    """
    seen, joints = measured(log, found.good), log.n_joints
    track: Tracker
    if found.std is None:
        track, variance = difference_tracker(seen, how), encoder_resolution(found.good) ** 2 / 12.0
    else:
        tuned = found.observers or tuned_observers(seen.good, seen.y, seen.longest, seen.step, how)
        track, variance = filter_tracker(tuned, how), tuned.smoothing.noise_variance
    response = track(np.sqrt(variance) * rng.standard_normal((samples, joints)))[0][:3]
    return np.nan_to_num(response), variance


def _taken(log: ExperimentLog, good: Usable) -> Reconstructed:
    motion = Motion(log.t, log["q_hat"], log["dq_hat"], log["ddq_hat"])
    known = "q_hat_std" in log
    return Reconstructed(motion, (log["q_hat_std"], log["dq_hat_std"], log["ddq_hat_std"]) if known else None, None, good, True)


def _known_at_all(seen: Measured, states: Array, std: Array, tuned: Observers | None) -> Array:
    """(3, joints) what can be said of a joint where nothing was measured: its range, largest speed and acceleration."""
    inside = np.zeros(len(seen.y), dtype=bool)
    for run in seen.good.runs:
        inside[run] = True
    usual = np.zeros(states[:, 0].shape)
    if tuned is not None:
        usual[:min(3, tuned.causal.order)] = tuned.causal.std.T[:3]
        usual[2] = tuned.causal.jerk_std if tuned.causal.order == 2 else usual[2]
    with np.errstate(invalid="ignore"):
        sure = inside[:, None] & ~(std > 10.0 * np.maximum(usual, 1e-300)[:, None])
    size = np.where(sure & np.isfinite(states), np.abs(states), 0.0).max(axis=1)
    size[0] = np.nanmax(seen.y, axis=0) - np.nanmin(seen.y, axis=0)
    return np.asarray(np.maximum(np.maximum(size, _BEYOND * usual), 1e-12))


def _fill(states: Array, std: Array, bound: Array) -> None:
    """In place: nothing is less certain than `bound` (3, joints), and nothing is undefined."""
    with np.errstate(invalid="ignore"):
        unknown = ~np.isfinite(states) | (std >= bound[:, None])
    index = np.arange(states.shape[1])
    for i, j in np.argwhere(unknown.any(axis=1)).tolist():
        gap = unknown[i, :, j]
        if not gap.all():
            states[i, gap, j] = np.interp(index[gap], index[~gap], states[i, ~gap, j])
        else:
            states[i, :, j] = 0.0
        std[i, gap, j] = bound[i, j]


def _at_recording(kept: Indices, values: Array, samples: int) -> Array:
    """From the kept samples to all of the recording: one left out is the one before it."""
    if len(kept) == samples:
        return values
    place = np.searchsorted(kept, np.arange(samples), side="right") - 1
    return values[:, np.maximum(place, 0)]
