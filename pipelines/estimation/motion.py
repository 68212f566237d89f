"""Reconstruct the motion of a log: position, speed and acceleration of every joint.

    found = reconstruct(log, Reconstruction())
    found.motion.q, .dq, .ddq                  at the log's own samples, finite at each of them

Kostić et al. 2004, Section IV.C.4, eq. (16)-(21). The motion of a derived log of the same recording
with the same settings is taken from it; anything else is computed.

Samples without a measurement are predicted through by the model of the observer, from both sides,
with the deviation that comes of it. Where that exceeds what the joint ever did (after a lost
connection, say) nothing more is known: the value is interpolated linearly, its deviation is the
range of the joint, its largest speed or acceleration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.body import Motion
from pipelines.errors import UsageError
from pipelines.estimation.config import ReconstructionConfig
from pipelines.estimation.filters import design_low_pass, zero_phase
from pipelines.estimation.grids import Measured, Tracker, measured, on_grid
from pipelines.estimation.observers import (
    METHODS,
    Observers,
    Reconstruction,
    encoder_resolution,
    tuned_observers,
)
from pipelines.estimation.smoother import smooth, twicing_growth
from pipelines.estimation.state_estimation import Observer, Start, Track, observe
from pipelines.estimation.uneven_clock import Evened, evened
from pipelines.io.log import Array, ExperimentLog, derived_by
from pipelines.quality.segments import Mask, Usable, long_blocks, usable

__all__ = ["METHODS", "Mean", "Reconstructed", "Reconstruction", "encoder_resolution"]
__all__ += ["for_equations", "noise_response", "reconstruct"]

Motions = tuple[tuple[ExperimentLog, "Reconstructed"], ...]
_Filter = Callable[[Array, Observer, Start | None], Track]

_CONFIG = ReconstructionConfig()
_SIGNALS = ("q_hat", "dq_hat", "ddq_hat")


@dataclass(frozen=True, eq=False)
class Reconstructed:
    """Motion with its uncertainty, and the observer it came from."""

    motion: Motion  # at every sample of the recording
    # of q, dq, ddq, each (samples, joints); None where the method has none
    std: tuple[Array, Array, Array] | None
    observers: Observers | None  # as tuned on the longest stretch; None where there are none
    good: Usable  # which samples, stretches and masks
    derived: bool  # taken from the log instead of computed
    mean: Mean | None = None  # where the log is the mean period of another
    even: tuple[ExperimentLog, Reconstructed] | None = None  # of an uneven clock: on an even grid

    @property
    def vague(self) -> Mask:
        """(samples, joints) where the acceleration is known half as well as elsewhere, or worse."""
        if self.std is None:
            return np.zeros(self.motion.q.shape, dtype=bool)
        return np.asarray(self.std[2] > _CONFIG.vague * known_median(self.std[2]))

    def signals(self) -> dict[str, Array]:
        """Return the signals of a derived log."""
        parts = (self.motion.q, self.motion.dq, self.motion.ddq)
        values = dict(zip(_SIGNALS, parts, strict=True))
        deviations = zip(_SIGNALS, self.std or (), strict=False)
        return values | {f"{name}_std": std for name, std in deviations}


@dataclass(frozen=True, eq=False)
class Mean:
    """Of which log another one is the mean period, and how it was averaged (`mean_period`)."""

    first: int  # samples from here on are the mean; those before are copies of it
    last: int  # and those from here on
    periods: float  # in the mean: of each of its samples, on average
    source: ExperimentLog
    whole: Reconstructed  # the motion of the source


def known_median(x: Array) -> Array:
    """Return the median of each column that is known; NaN where nothing is."""
    known = [column[~np.isnan(column)] for column in x.T]
    return np.array([np.median(column) if column.size else np.nan for column in known])


def reconstruct(
    log: ExperimentLog,
    how: Reconstruction,
    good: Usable | None = None,
    observers: Observers | None = None,
) -> Reconstructed:
    """Return the motion of `log`.

    Args:
        good: `usable(log)`, where it is known.
        observers: of a log like it, instead of tuning.

    Raises:
        UsageError: C02, settings that do not fit the log.
        InputRejected: T04, no stretch of it is long enough; T05, its clock is too uneven.
    """
    how.check(log.n_joints)
    good = usable(log) if good is None else good
    if (even := evened(log, good)) is not None:
        return _of_even(log, even, how, good, observers)
    if derived_by(log, "reconstruct", how.as_settings()) and all(name in log for name in _SIGNALS):
        motion, known = Motion(log.t, log["q_hat"], log["dq_hat"], log["ddq_hat"]), None
        if "q_hat_std" in log:
            known = (log["q_hat_std"], log["dq_hat_std"], log["ddq_hat_std"])
        return Reconstructed(motion, known, None, good, True)
    seen = measured(log, good)
    states, std = np.full((3, *seen.y.shape), np.nan), np.full((3, *seen.y.shape), np.nan)
    filtering = how.method in ("smoother", "observer")
    tuned = (observers or tuned_observers(seen, how)) if filtering else None
    track = difference_tracker(seen, how) if tuned is None else filter_tracker(tuned, how)
    for grid in seen.grids:
        rows = slice(grid.first, grid.last)
        if grid.size > 1 and np.isfinite(seen.y[rows]).any():
            found, deviation = on_grid(seen.y[rows], grid, seen.step, track)
            states[:, rows] = found[:3]
            if deviation is not None:
                std[:, rows] = deviation[:3]
    bound = _largest(seen, states, std, tuned)
    return _completed(log, seen.good, states, std if filtering else None, bound, tuned)


def for_equations(motions: Motions) -> Motions:
    """Return the logs and motions that equations are made of: of an uneven clock, those evened."""
    return tuple((log, found) if found.even is None else found.even for log, found in motions)


def _of_even(
    log: ExperimentLog, even: Evened, how: Reconstruction, good: Usable, observers: Observers | None
) -> Reconstructed:
    """Return the motion at the instants of the samples, from that on an even grid."""
    found = reconstruct(even.log, how, even.good, observers)
    motion, samples = found.motion, len(good.kept)
    states = np.stack([motion.q, motion.dq, motion.ddq])
    states = even.at_recording(states, samples, spline=True)
    std = None
    if found.std is not None:
        std = even.at_recording(np.stack(found.std), samples, spline=False)
    sizes = [np.ptp(motion.q, axis=0), *(np.abs(x).max(axis=0) for x in (motion.dq, motion.ddq))]
    bound = np.maximum(sizes, 1e-12)
    return _completed(log, good, states, std, bound, found.observers, (even.log, found))


def _completed(
    log: ExperimentLog,
    good: Usable,
    states: Array,
    std: Array | None,
    bound: Array,
    observers: Observers | None,
    even: tuple[ExperimentLog, Reconstructed] | None = None,
) -> Reconstructed:
    """Return the motion at all samples of the recording.

    Nothing is less certain than `bound` (3, joints), and nothing is undefined.
    """
    known = np.full_like(states, np.nan) if std is None else std
    with np.errstate(invalid="ignore"):
        unknown = ~np.isfinite(states) | (known >= bound[:, None])
    index = np.arange(states.shape[1])
    for i, j in np.argwhere(unknown.any(axis=1)).tolist():
        gap, x = unknown[i, :, j], states[i, :, j]
        x[gap] = 0.0 if gap.all() else np.interp(index[gap], index[~gap], x[~gap])
        known[i, gap, j] = bound[i, j]
    if len(good.kept) < log.n_samples:  # a sample left out is the one before it
        place = np.searchsorted(good.kept, np.arange(log.n_samples), side="right") - 1
        states, known = states[:, np.maximum(place, 0)], known[:, np.maximum(place, 0)]
    known[:, good.time.undefined] = bound[:, None]
    deviations = None if std is None else (known[0], known[1], known[2])
    return Reconstructed(Motion(log.t, *states), deviations, observers, good, False, even=even)


def _largest(seen: Measured, states: Array, std: Array, tuned: Observers | None) -> Array:
    """Return (3, joints) the range, largest speed and largest acceleration of each joint."""
    inside = np.zeros(len(seen.y), dtype=bool)
    for run in seen.good.runs:
        inside[run] = True
    usual = np.zeros(states[:, 0].shape)
    if tuned is not None:
        causal = tuned.causal
        usual[: min(3, causal.order)] = causal.std.T[:3]
        usual[2] = causal.jerk_std if causal.order == 2 else usual[2]
    with np.errstate(invalid="ignore"):
        sure = inside[:, None] & ~(std > 10.0 * np.maximum(usual, 1e-300)[:, None])
    size = np.where(sure & np.isfinite(states), np.abs(states), 0.0).max(axis=1)
    size[0] = np.nanmax(seen.y, axis=0) - np.nanmin(seen.y, axis=0)
    return np.asarray(np.maximum(np.maximum(size, _CONFIG.beyond * usual), 1e-12))


def noise_response(
    log: ExperimentLog,
    found: Reconstructed,
    how: Reconstruction,
    samples: int,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """Return the response (3, samples, joints) of a reconstruction to white noise as strong as that
    of the positions, and its variance [rad²] (joints,).

    Every way to reconstruct is linear in the positions: the response adds to the motion.
    """
    seen = measured(log, found.good)
    track: Tracker
    if found.std is None:
        track, variance = difference_tracker(seen, how), encoder_resolution(found.good) ** 2 / 12.0
    else:
        tuned = found.observers or tuned_observers(seen, how)
        track, variance = filter_tracker(tuned, how), tuned.smoothing.noise_variance
    noise = np.sqrt(variance) * rng.standard_normal((samples, log.n_joints))
    return np.nan_to_num(track(noise)[0][:3]), variance


def filter_tracker(tuned: Observers, how: Reconstruction) -> Callable[[Array], tuple[Array, Array]]:
    """Return the observer or the smoother of one grid, with deviations."""
    if how.method == "observer":
        return lambda y: _filtered(y, tuned.causal, observe)
    if not tuned.twice:
        return lambda y: _filtered(y, tuned.smoothing, smooth)
    inner = tuned.smoothing
    # samples after which an end is forgotten to about 1/1000
    forgotten = _CONFIG.forgotten / -np.log(np.abs(inner.filter.poles).max(axis=1))
    reach = np.ceil(forgotten).astype(int).tolist()
    growth = np.ones(max(3, inner.order))
    growth[: inner.order] = twicing_growth(inner.order)

    def track(y: Array) -> tuple[Array, Array]:
        """Smooth, and smooth once more what that left; near ends and gaps as the observer."""
        states, std = _filtered(y, inner, smooth)
        states = states + _filtered(y - states[0], inner, smooth)[0]
        std = std * growth[:, None, None]
        ends, ends_std = _filtered(y, tuned.causal, smooth)
        for j, far in enumerate(reach):
            lost, near = np.isnan(y[:, j]), np.zeros(len(y), dtype=bool)
            for a, b in [(0, 0), (len(lost), len(lost)), *long_blocks(lost)]:
                near[max(0, a - far) : b + far] = True
            states[:, near, j], std[:, near, j] = ends[:, near, j], ends_std[:, near, j]
        return states, std

    return track


def _filtered(y: Array, observer: Observer, run: _Filter) -> tuple[Array, Array]:
    """Run a filter over the joints and samples that it can know; NaN elsewhere.

    Returns states and deviations (3 or more, samples, joints): an acceleration for any order.
    """
    order = observer.order
    states, std = (np.full((max(3, order), *y.shape), np.nan) for _ in range(2))
    present = np.isfinite(y)
    lead = present.argmax(axis=0)
    lead[lead <= _CONFIG.lead] = 0  # predicted from what comes after
    lead[present.sum(axis=0) <= order] = len(y)  # fewer samples than states
    for first in np.unique(lead[lead < len(y)]).tolist():
        joints = np.flatnonzero(lead == first)
        whole = len(joints) == y.shape[1]
        where = slice(None) if whole else joints
        own = observer if whole else observer.pick(joints)
        track = run(y[first:, where], own, None)
        states[:order, first:, where] = track.states
        std[:order, first:, where] = track.full_std()
    if order == 2:  # the held acceleration itself, known as well as it is bounded
        states[2] = np.gradient(states[1], observer.sample_time, axis=0)
        std[2] = np.where(np.isfinite(std[1]), observer.jerk_std, np.nan)
    return states, std


def difference_tracker(seen: Measured, how: Reconstruction) -> Tracker:
    """Return central differences, of the samples or of what a zero-phase low-pass leaves of them.

    Raises:
        UsageError: C02, a cut-off that no such log can be filtered with.
    """
    lowest, highest = 1.0 / (seen.longest.size * seen.step), _CONFIG.highest / seen.step
    smooth_first = how.method == "zero-phase"
    if smooth_first and not all(lowest <= hz <= highest for hz in how.bandwidth or ()):
        words = "a cut-off whose period is longer than the log, or near half the rate"
        remedy = f"choose between {lowest:.2g} and {highest:.3g} Hz"
        raise UsageError("C02", words, "--bandwidth", remedy)

    def central(y: Array) -> tuple[Array, Array | None]:
        if smooth_first:
            cutoff = _CONFIG.cutoff_hz if how.bandwidth is None else max(how.bandwidth)
            low_pass = design_low_pass(min(cutoff, highest), 1.0 / seen.step)
            y = y if np.isfinite(y).all() else _predicted(seen, y)
            y = zero_phase(y, low_pass) if len(y) > low_pass.padding else y
        dq, ddq = np.full_like(y, np.nan), np.full_like(y, np.nan)
        dq[1:-1] = (y[2:] - y[:-2]) / (2.0 * seen.step)
        ddq[1:-1] = (y[2:] - 2.0 * y[1:-1] + y[:-2]) / seen.step**2
        return np.stack([y, dq, ddq]), None

    return central


def _predicted(seen: Measured, y: Array) -> Array:
    """Return `y` with missing samples as the smoother predicts them."""
    how = Reconstruction()
    states, _ = filter_tracker(tuned_observers(seen, how), how)(y)
    whole, at = np.where(np.isfinite(y), y, states[0]), np.arange(len(y))
    for column in whole.T:  # before the first sample, or a joint without any
        known = np.isfinite(column)
        column[~known] = np.interp(at[~known], at[known], column[known]) if known.any() else 0.0
    return whole
