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

from pipelines.errors import InputRejected, UsageError
from pipelines.log.derive import derived_by
from pipelines.log.doctor.faults import Mask
from pipelines.log.doctor.segments import Usable, long_blocks, usable
from pipelines.log.experiment import Array, ExperimentLog
from pipelines.log.order_statistics import distinct, median
from pipelines.model.rigid.body import Motion
from pipelines.model.tuned import METHODS, Observers, Reconstruction, encoder_resolution, tuned_observers
from pipelines.signal.grid import Grid, Tracker, grids, on_grid
from pipelines.signal.observer import Observer, Track, observe
from pipelines.signal.smoother import Smoother, smooth, twicing_growth

__all__ = ["METHODS", "Mean", "Measured", "Observers", "Reconstructed", "Reconstruction", "encoder_resolution", "measured",
           "noise_response", "reconstruct"]

Indices = npt.NDArray[np.intp]
Run = Callable[[Array], tuple[Array, Array]]

_SIGNALS = ("q_hat", "dq_hat", "ddq_hat")
_LONG = 4096  # missing samples: of more, only the first are predicted
_END = 1024
_LEAD = 2  # missing samples at the very start that are predicted from what comes after
_VAGUE = 2.0  # times the usual standard deviation of the acceleration
_BEYOND = 5.0  # usual deviations: no cap below it, however still a joint stands
_CUTOFF_HZ = 100.0  # of the zero-phase filter where no bandwidth is asked for
_FASTEST = 0.4  # of the rate, its cut-off


@dataclass(frozen=True, eq=False)
class Measured:
    """The positions of a log as the filters see them."""

    good: Usable
    y: Array  # (kept samples, joints) [rad], unwrapped, NaN where missing or a glitch
    step: float  # [s] nominal
    grids: tuple[Grid, ...]  # stretches of an unbroken clock

    @property
    def longest(self) -> Grid:
        return max(self.grids, key=lambda grid: grid.last - grid.first)


@dataclass(frozen=True, eq=False)
class Reconstructed:
    """Motion with its uncertainty, and the observer it came from."""

    motion: Motion  # at every sample of the recording
    std: tuple[Array, Array, Array] | None  # of q, dq, ddq, each (samples, joints); None where the method has none
    observers: Observers | None  # as tuned on the longest stretch; None where the method has none
    good: Usable  # which samples, stretches and masks
    derived: bool  # taken from the log instead of computed
    mean: Mean | None = None  # where the log is the mean period of another

    @property
    def vague(self) -> Mask:
        """(samples, joints) near an end or a gap, where the acceleration is known half as well as elsewhere, or worse."""
        if self.std is None:
            return np.zeros(self.motion.q.shape, dtype=bool)
        std = self.std[2]
        return np.asarray(std > _VAGUE * np.array([median(column[~np.isnan(column)]) for column in std.T]))

    def signals(self) -> dict[str, Array]:
        """What a derived log gets."""
        values = dict(zip(_SIGNALS, (self.motion.q, self.motion.dq, self.motion.ddq), strict=True))
        return values | {f"{name}_std": std for name, std in zip(_SIGNALS, self.std or (), strict=False)}


@dataclass(frozen=True, eq=False)
class Mean:
    """Of which log another one is the mean period, and how it came of it (`mean_period`)."""

    first: int  # samples from here on are the mean; those before are copies of it
    last: int  # and those from here on
    periods: int  # in the mean
    source: ExperimentLog
    whole: Reconstructed  # the motion of the source
    fold: Callable[[Array], Array]  # from any signal of the source, (kept samples, channels), to its mean and the copies


def measured(log: ExperimentLog, good: Usable | None = None) -> Measured:
    """The positions of `log` on even grids.

    Raises:
        InputRejected: T04, no stretch of it is long enough; T05, its clock is too uneven.
    """
    good = usable(log) if good is None else good
    if not good.runs:
        raise InputRejected("T04", "no stretch without a gap is long enough to reconstruct motion from",
                            where=log.source or log.name, remedy="'rrrid inspect' shows what is missing; record again")
    y = np.where(good.position_spikes, np.nan, good.log.q)
    lost = np.isnan(y)
    if lost.all(axis=0).any():
        raise InputRejected("D02", f"joint {int(np.argmax(lost.all(axis=0))) + 1} has no measurement at all",
                            where=log.source or log.name, remedy="leave the joint out, or record it again")
    edges = np.flatnonzero(np.diff(lost.any(axis=1).astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
    ends = [place for a, b in edges.tolist() if b - a > _LONG for place in (a + _END, b)]
    cuts = np.concatenate([np.flatnonzero(good.jumped.any(axis=1)), [good.end], ends]).astype(np.intp)
    step = log.sample_time if good.time.known else good.time.median
    return Measured(good, y, step, tuple(grids(good.log.t, step, cuts)))


def reconstruct(log: ExperimentLog, how: Reconstruction, good: Usable | None = None) -> Reconstructed:
    """The motion of `log`; `good` is `usable(log)`, for whoever has it already.

    Raises:
        UsageError: C02, settings that do not fit the log.
        InputRejected: T04, no stretch of it is long enough; T05, its clock is too uneven.
    """
    how.check(log.n_joints)
    if derived_by(log, "reconstruct", how.as_settings()) and all(name in log for name in _SIGNALS):
        return _taken(log, usable(log) if good is None else good)
    seen = measured(log, good)
    states, std = np.full((3, *seen.y.shape), np.nan), np.full((3, *seen.y.shape), np.nan)
    filtering = how.method in ("smoother", "observer")
    tuned = tuned_observers(seen.good, seen.y, seen.longest, seen.step, how) if filtering else None
    track = _differences(seen, how) if tuned is None else _filter(tuned, how)
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


def noise_response(log: ExperimentLog, found: Reconstructed, how: Reconstruction, samples: int,
                   rng: np.random.Generator) -> tuple[Array, Array]:
    """What white noise as strong as that of the positions does to `found` (3, samples, joints), and its variance [rad²] (joints,).

    Every way to reconstruct is linear in the positions: the response to noise adds to the motion.
    """
    seen, joints = measured(log, found.good), log.n_joints
    track: Tracker
    if found.std is None:
        track, variance = _differences(seen, how), encoder_resolution(found.good) ** 2 / 12.0
    else:
        tuned = found.observers or tuned_observers(seen.good, seen.y, seen.longest, seen.step, how)
        track, variance = _filter(tuned, how), tuned.smoothing.noise_variance
    response = track(np.sqrt(variance) * rng.standard_normal((samples, joints)))[0][:3]
    return np.nan_to_num(response), variance


def _taken(log: ExperimentLog, good: Usable) -> Reconstructed:
    motion = Motion(log.t, log["q_hat"], log["dq_hat"], log["ddq_hat"])
    known = "q_hat_std" in log
    return Reconstructed(motion, (log["q_hat_std"], log["dq_hat_std"], log["ddq_hat_std"]) if known else None, None, good, True)


def _filter(tuned: Observers, how: Reconstruction) -> Tracker:
    """The filter of one grid: (samples, joints) with NaN where missing -> (3 or more, samples, joints) and deviations."""
    if how.method == "observer":
        return _padded(tuned.causal, lambda y, joints: observe(y, tuned.causal if joints is None else tuned.causal.pick(joints)))
    inner, outer = _smoother(tuned.smoothing), _smoother(tuned.causal)
    if not tuned.twice:
        return inner
    inner = _twice(inner, tuned.smoothing.order)

    def run(y: Array) -> tuple[Array, Array]:
        (states, std), (ends, ends_std) = inner(y), outer(y)
        for j, reach in enumerate(_reach(tuned.smoothing).tolist()):
            near = _near_ends(np.isnan(y[:, j]), reach)
            states[:, near, j], std[:, near, j] = ends[:, near, j], ends_std[:, near, j]
        return states, std

    return run


def _twice(run: Run, order: int) -> Run:
    """What `run` leaves of the samples goes through it once more, and is added. See `Observers`."""

    def again(y: Array) -> tuple[Array, Array]:
        states, std = run(y)
        more, _ = run(y - states[0])
        growth = np.ones(len(states))
        growth[:order] = twicing_growth(order)
        return states + more, std * growth[:, None, None]

    return again


def _smoother(observer: Observer) -> Run:
    own = Smoother(observer)
    return _padded(observer, lambda y, joints: smooth(y, own if joints is None else own.pick(joints)))


def _padded(observer: Observer, filter_: Callable[[Array, Indices | None], Track]) -> Run:
    """`filter_` over the joints and samples that it can know; NaN elsewhere; and an acceleration whatever the order."""
    order = observer.order

    def run(y: Array) -> tuple[Array, Array]:
        states, std = (np.full((max(3, order), *y.shape), np.nan) for _ in range(2))
        present = np.isfinite(y)
        lead = present.argmax(axis=0)
        lead[lead <= _LEAD] = 0
        lead[present.sum(axis=0) <= order] = len(y)  # fewer samples than states: the joint is not known here
        for first in distinct(lead[lead < len(y)]).tolist():
            joints = np.flatnonzero(lead == first)
            whole = len(joints) == y.shape[1]
            track = filter_(y[first:], None) if whole else filter_(y[first:, joints], joints)
            where = slice(None) if whole else joints
            states[:order, first:, where] = track.states
            std[:order, first:, where] = track.full_std()
        if order == 2:  # the held acceleration itself, known as well as it is bounded
            states[2] = np.gradient(states[1], observer.sample_time, axis=0)
            std[2] = np.where(np.isfinite(std[1]), observer.jerk_std, np.nan)
        return states, std

    return run


def _reach(observer: Observer) -> Indices:
    """(joints,) samples after which an end is forgotten to about 1/1000."""
    samples = 7.0 / -np.log(np.abs(observer.filter.poles).max(axis=1))
    return np.asarray(np.ceil(samples), dtype=np.intp)


def _near_ends(lost: Mask, reach: int) -> Mask:
    """Samples within `reach` of an end or of a long block that is missing."""
    near = np.zeros(len(lost), dtype=bool)
    for a, b in [(0, 0), (len(lost), len(lost)), *long_blocks(lost)]:
        near[max(0, a - reach):b + reach] = True
    return near


def _differences(seen: Measured, how: Reconstruction) -> Tracker:
    """Central differences, of the samples or of what a zero-phase low-pass leaves of them: textbook rivals without deviations."""
    lowest, highest = 1.0 / (seen.longest.size * seen.step), _FASTEST / seen.step
    if how.method == "zero-phase" and not all(lowest <= hz <= highest for hz in how.bandwidth or ()):
        raise UsageError("C02", "a cut-off whose period is longer than the log, or near half the rate", where="--bandwidth",
                         remedy=f"choose between {lowest:.2g} and {highest:.3g} Hz")

    def central(y: Array) -> tuple[Array, Array | None]:
        dq, ddq = np.full_like(y, np.nan), np.full_like(y, np.nan)
        dq[1:-1] = (y[2:] - y[:-2]) / (2.0 * seen.step)
        ddq[1:-1] = (y[2:] - 2.0 * y[1:-1] + y[:-2]) / seen.step**2
        return np.stack([y, dq, ddq]), None

    def zero_phase_central(y: Array) -> tuple[Array, Array | None]:
        from pipelines.signal.filters import design_low_pass, zero_phase

        whole = y if np.isfinite(y).all() else _completed(seen, y)
        cutoff = _CUTOFF_HZ if how.bandwidth is None else max(how.bandwidth)
        low_pass = design_low_pass(min(cutoff, highest), 1.0 / seen.step)
        return central(zero_phase(whole, low_pass) if len(y) > low_pass.padding else whole)

    return zero_phase_central if how.method == "zero-phase" else central


def _completed(seen: Measured, y: Array) -> Array:
    """Missing samples as the smoother predicts them."""
    how = Reconstruction()
    states, _ = _filter(tuned_observers(seen.good, seen.y, seen.longest, seen.step, how), how)(y)
    whole, at = np.where(np.isfinite(y), y, states[0]), np.arange(len(y))
    for column in whole.T:  # before the first sample, or a joint without any
        known = np.isfinite(column)
        column[~known] = np.interp(at[~known], at[known], column[known]) if known.any() else 0.0
    return whole


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
