"""Find the samples of a log that a stage may use: contiguous stretches, and masks of what is bad.

    good = usable(log)
    for run in good.runs:                slices of good.log without a gap or a step of the clock
        q = good.log.q[run]
        fit only where good.fit[run]     nothing missing, saturated or a glitch on any joint

A recording is never changed: `good.log` is a copy in memory in which time is in seconds, repeated
samples are dropped and a wrapped encoder is unwrapped. Missing values are NaN; nothing is
interpolated. Thresholds are about sampling and about rare events, so that a healthy log, slow or
fast, clean or noisy, is left alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from pipelines.io import limits
from pipelines.io.limits import ABSURD, GAP_LIMIT, GAP_TICKS, SHORTEST, sentinels
from pipelines.io.log import Array, ExperimentLog, Signal
from pipelines.quality.config import CONFIG

Mask = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.intp]


@dataclass(frozen=True)
class TimeBase:
    """How the samples of a log lie in time; index k stands for the interval from k to k + 1."""

    unit: str  # of `t` as recorded, by its steps; "" where no unit fits the declared sample time
    scale: float  # [s] per unit of t
    is_rate: bool  # sample_time holds the rate
    median: float  # [s] interval
    undefined: Indices  # samples whose t is not a time
    steps: Indices  # where t goes back
    repeated: Indices  # where sample k + 1 is sample k once more, stamp and all
    conflicting: Indices  # where sample k + 1 has the stamp of sample k and other values
    gaps: Indices  # where more than GAP_LIMIT samples are missing
    gap_lengths: Array  # [s]
    dropped: Indices  # where a few samples are missing
    dropped_samples: int
    jitter: float  # rms deviation of the regular intervals from their median, in sample times
    worst: float  # largest such deviation
    advances: bool  # any stamp is later than the one before it

    @property
    def known(self) -> bool:
        return bool(self.unit) and not self.is_rate


def time_base(log: ExperimentLog) -> TimeBase:
    """Return how the samples of `log` lie in time."""
    t, nominal = np.where(np.abs(log.t) < CONFIG.no_time, log.t, np.nan), log.sample_time
    interval = np.diff(t)
    forward = interval[interval > 0]
    unit, scale, is_rate, typical = "s", 1.0, False, nominal
    if forward.size:
        unit, scale, is_rate = _time_unit(forward, nominal)
        typical = float(np.median(forward)) * scale
    with np.errstate(over="ignore", invalid="ignore"):
        ticks = interval * scale / (nominal if unit and not is_rate else typical)
    same = np.flatnonzero(interval == 0.0)
    # in a clock that stands still throughout no sample is a repetition
    twice = np.full(same.size, forward.size > 0)
    for values in (signal.values for signal in log.signals.values()):
        alike = [np.array_equal(values[k], values[k + 1], equal_nan=True) for k in same]
        twice &= np.array(alike, dtype=np.bool_)
    gaps = np.flatnonzero(ticks > GAP_TICKS)
    rms, worst = limits.jitter(ticks)
    late = limits.late(ticks, rms)
    return TimeBase(
        unit=unit,
        scale=scale,
        is_rate=is_rate,
        median=typical,
        undefined=np.flatnonzero(np.isnan(t)),
        steps=np.flatnonzero(interval < 0.0),
        repeated=same[twice],
        conflicting=same[~twice],
        gaps=gaps,
        gap_lengths=interval[gaps] * scale,
        dropped=late,
        dropped_samples=int(np.sum(np.rint(ticks[late]) - 1)),
        jitter=rms,
        worst=worst,
        advances=forward.size > 0,
    )


def _time_unit(forward: Array, nominal: float) -> tuple[str, float, bool]:
    """Return the unit of t by its steps, its seconds, and whether the sample time is a rate."""
    typical, mean = float(np.median(forward)), float(np.mean(forward))
    if min(abs(typical / nominal - 1.0), abs(mean / nominal - 1.0)) < 5.0 * CONFIG.unit_fits:
        return "s", 1.0, False
    if typical < nominal and abs(typical * nominal - 1.0) < CONFIG.unit_fits:
        return "s", 1.0, True
    units = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
    if typical == 1.0 and bool(np.all(np.rint(forward) == forward)):
        units["samples"] = nominal
    scale = nominal / typical
    fits = [unit for unit, s in units.items() if abs(s / scale - 1.0) < CONFIG.unit_fits]
    if not fits or np.ptp([units[unit] for unit in fits]) > CONFIG.unit_fits * scale:
        return "", 1.0, False
    return fits[0], units[fits[0]], False


@dataclass(frozen=True, eq=False)
class Usable:
    """A log as a stage may use it. Masks have the shape of `log.q`."""

    log: ExperimentLog  # repaired copy
    steps: tuple[float | None, ...]  # [rad] (joints) in which each encoder counts, where visible
    kept: Indices  # (samples,) index of each sample in the recording
    runs: tuple[slice, ...]  # contiguous stretches of at least SHORTEST samples
    missing: Mask  # no measurement of position or torque
    position_spikes: Mask
    torque_spikes: Mask
    saturated: Mask
    wrapped: Array  # (samples, joints) [rad] what wraps had added to the recorded position
    jumped: Mask  # first sample after a jump of the position that is no wrap
    stop: tuple[int, str] | None  # emergency stop: its first sample, and how it shows
    time: TimeBase  # of the recording

    @property
    def end(self) -> int:
        """Number of samples before an emergency stop."""
        return self.log.n_samples if self.stop is None else self.stop[0]

    @property
    def spikes(self) -> Mask:
        return self.position_spikes | self.torque_spikes

    @property
    def fit(self) -> Mask:
        """(samples,) where every joint's sample is good and lies in a run."""
        inside = np.zeros(self.log.n_samples, dtype=bool)
        for run in self.runs:
            inside[run] = True
        return inside & ~(self.missing | self.spikes | self.saturated).any(axis=1)


def usable(log: ExperimentLog) -> Usable:
    """Return what of `log` can be used; a log that `checks` rejects may have no run at all."""
    time = time_base(log)
    bad = np.concatenate([time.undefined, time.repeated + 1, time.conflicting + 1])
    kept = np.delete(np.arange(log.n_samples), bad)
    signals = {}
    for name, signal in log.signals.items():
        values = signal.values[kept]
        if name == "t":
            values = values * time.scale
        else:  # what is infinite, absurdly large or a filler is no measurement
            with np.errstate(invalid="ignore"):
                values = np.where((np.abs(values) < ABSURD) & ~sentinels(values), values, np.nan)
        signals[name] = Signal(values, "s" if name == "t" else signal.units, signal.long_name)
    gone = np.isnan(signals["q"].values) | np.isnan(signals["tau"].values)
    wrapped, jumped = _unwrapped(replace(log, signals=signals))
    signals["q"] = replace(signals["q"], values=signals["q"].values - wrapped)
    good = replace(log, signals=signals)
    steps = tuple(quantum(column) for column in good.q.T)
    floor, torque_floor = _glitch_floors(good, steps)
    stop = _emergency_stop(good)
    end = good.n_samples if stop is None else stop[0]
    return Usable(
        log=good,
        steps=steps,
        kept=kept,
        runs=_runs(good, time, gone, jumped, end),
        missing=gone,
        position_spikes=spikes(good.q, True, floor),
        torque_spikes=spikes(good.tau, False, torque_floor),
        saturated=_saturated(good),
        wrapped=wrapped,
        jumped=jumped,
        stop=stop,
        time=time,
    )


def _runs(
    log: ExperimentLog, time: TimeBase, gone: Mask, jumped: Mask, end: int
) -> tuple[slice, ...]:
    """Return the stretches between clock steps, gaps, long missing blocks and position jumps."""
    with np.errstate(invalid="ignore"):
        ticks = np.diff(log.t) / (log.sample_time if time.known else time.median)
        cut = (ticks <= 0.0) | (ticks > GAP_TICKS) | jumped[1:].any(axis=1)
    bad = np.arange(log.n_samples) >= end
    for start, stop in long_blocks(np.asarray(gone.any(axis=1))):
        bad[start:stop] = True
    edges = np.flatnonzero(cut | (bad[1:] != bad[:-1])) + 1
    edges = np.concatenate(([0], edges, [log.n_samples]))
    whole = (slice(int(a), int(b)) for a, b in pairwise(edges) if b - a >= SHORTEST)
    return tuple(run for run in whole if not bad[run.start])


def long_blocks(mask: Mask) -> list[tuple[int, int]]:
    """Return from-to of the runs of `mask` that are longer than an observer can predict through."""
    return [(a, b) for a, b in blocks(mask) if b - a > GAP_LIMIT]


def blocks(mask: Mask) -> list[tuple[int, int]]:
    """Return from-to of every run of `mask` (samples,)."""
    edges = np.flatnonzero(np.diff(np.pad(mask.astype(np.int8), 1))).reshape(-1, 2)
    return [(int(a), int(b)) for a, b in edges]


def quantum(x: Array) -> float | None:
    """Return the step in which `x` (samples,) was counted, or None where no step is visible."""
    values = np.unique(x[np.isfinite(x)])
    steps = np.diff(values)
    steps = steps[steps > 1e-11 * np.abs(values).max(initial=0.0)]
    if steps.size < limits.FEWEST - 1:
        return None
    # the smallest ten: one alone may be a rounding error of the recording
    step = float(np.median(np.partition(steps, 9)[:10]))
    counts = steps[steps < 1000 * step] / step
    whole = np.mean(np.abs(counts - np.rint(counts)) < CONFIG.step_fits)
    return step if whole > CONFIG.steps_fit else None


def lagged_speed(q: Array, sample_time: float, lag: float = CONFIG.speed_lag) -> Array:
    """Return speeds (samples - 2 m, joints), differences over ±`lag` seconds, m samples.

    In a short or very fast log m is a twentieth of it at most: over half the log, a motion to and
    fro has no speed.
    """
    m = max(1, min(round(lag / sample_time), len(q) // 20))
    return (q[2 * m :] - q[: -2 * m]) / (2 * m * sample_time)


def _glitch_floors(log: ExperimentLog, shown: tuple[float | None, ...]) -> tuple[Array, Array]:
    """Return what no glitch is below (joints,): of position [rad], and of torque [N m].

    Eight encoder steps; of torque, shares of its range and limit, and what one encoder step does
    through the controller's gains.
    """
    described = [joint.encoder_resolution or 0.0 for joint in log.robot.joints]
    steps = np.maximum([step or 0.0 for step in shown], described)
    position = np.maximum(CONFIG.glitch_steps * steps, 1e-9)
    finite = np.where(np.isfinite(log.tau), log.tau, 0.0)
    limit = torque_limit(log)
    limit = np.where(np.isfinite(limit), limit, 0.0)
    torque = CONFIG.glitch_limit * limit
    if finite.size:
        low, high = np.quantile(finite, (0.01, 0.99), axis=0)
        torque = np.maximum(CONFIG.glitch_torque * (high - low), torque)
    control = log.controller
    if control is not None and control.kp is not None and control.kd is not None:
        pd = control.law.startswith("pd") / 4.0
        step = (control.kp + control.kd / log.sample_time) * position
        torque = np.maximum(torque, pd * step)
    return position, np.maximum(torque, 1e-9)


def spikes(x: Array, smooth: bool, floor: Array) -> Mask:
    """Return glitches of one or two samples in `x` (samples, joints).

    A glitch is far from its neighbours, which agree with each other as they do not at a step or at
    a sudden start, and farther than the samples around it: fast parts of a log are noisier.

    Args:
        smooth: a position, compared with the cubic through its neighbours; otherwise a torque,
            which may jump, compared with their median.
        floor: (joints,) smaller ones are left alone.
    """
    found = np.zeros(x.shape, dtype=bool)
    around = np.concatenate([np.arange(-29, -4), np.arange(5, 30)])
    for width in (1, 2):
        reach = 2 * width
        if len(x) < 40 * width:
            continue
        near, far = width, (reach if smooth else width + 1)
        at = slice(reach, -reach)
        a, b, c, d = (x[reach + k : len(x) - reach + k] for k in (-far, -near, near, far))
        if smooth:
            expected = (4.0 * (b + c) - (a + d)) / 6.0
            left, right, spread = 2.0 * b - a, 2.0 * c - d, np.zeros_like(a)
        else:
            expected = _median_of_four(a, b, c, d)
            left, right = (a + b) / 2.0, (c + d) / 2.0
            spread = np.maximum(np.abs(a - b), np.abs(c - d))
        off = np.abs(x[at] - expected)
        off = np.where(np.isfinite(off), off, 0.0)
        # a kink, as at a hard stop, continues one of its sides
        kink = np.minimum(np.abs(x[at] - left), np.abs(x[at] - right))
        glitch = off > np.maximum(CONFIG.glitch * np.quantile(off, 0.99, axis=0), floor)
        glitch &= kink > CONFIG.glitch_alone * off
        glitch &= np.maximum(np.abs(left - right), spread) < CONFIG.glitch_sides * off
        # and four times what 90 % of the 50 samples around it are
        row, column = np.nonzero(glitch)
        beside = np.clip(row[:, None] + around, 0, len(off) - 1)
        usual = np.quantile(off[beside, column[:, None]], 0.9, axis=1) if row.size else 0.0
        glitch[row, column] = off[row, column] > CONFIG.glitch * usual
        found[at] |= glitch
    return found


def _median_of_four(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Return the mean of the middle two of four, a missing one counting as the largest."""
    a, b, c, d = (np.where(np.isnan(x), np.inf, x) for x in (a, b, c, d))
    low = np.maximum(np.minimum(a, b), np.minimum(c, d))
    high = np.minimum(np.maximum(a, b), np.maximum(c, d))
    return np.asarray((low + high) / 2.0)


def torque_limit(log: ExperimentLog) -> Array:
    """Return the lower of the controller's and the robot's torque limit (joints,) [N m], or inf."""
    limit = np.array([joint.torque for joint in log.robot.joints])
    if log.controller is not None and log.controller.output_limit is not None:
        limit = np.minimum(limit, log.controller.output_limit)
    return limit


def _saturated(log: ExperimentLog) -> Mask:
    """Return where the drive could not give the torque: at its limit, or at a flat top."""
    tau, limit = np.abs(log.tau), torque_limit(log)
    at_limit = np.asarray(tau >= CONFIG.at_limit * limit)
    if log.torque == "measured":  # beyond the limit it shows that the limit is not one
        at_limit &= ~(tau > CONFIG.beyond * limit).any(axis=0)
    open_loop = log.controller is not None and log.controller.law == "open-loop"
    if open_loop or log.experiment in ("friction", "hold", "frf"):
        return at_limit  # an open-loop torque is constant because the experiment is
    for j, column in enumerate(log.tau.T):
        step = quantum(column) or 0.0
        at_limit[:, j] |= _flat_top(column, log.q[:, j], step)
        at_limit[:, j] |= _flat_top(-column, log.q[:, j], step)
    return at_limit


def _flat_top(x: Array, q: Array, step: float) -> Mask:
    """Return the samples at the maximum of `x` (samples,), where runs of them are no smooth peak.

    Within half a run's length of its ends, `x` falls by more than 10 quanta, each `step`, where a
    parabola that spends the run within one quantum would be down by 3.
    """
    finite = np.isfinite(x)
    top = float(np.max(x, where=finite, initial=-np.inf))
    at = finite & (x >= top - max(0.01 * step, 1e-9 * abs(top)))
    known = q[np.isfinite(q)]
    travel = float(np.ptp(known)) if known.size else 0.0
    flat = 0
    for start, stop in blocks(at):
        half = max(2, (stop - start) // 2)
        before, after = x[max(0, start - half) : start], x[stop : stop + half]
        if stop - start < CONFIG.flat_least or min(before.size, after.size) <= 1:
            continue
        drop = top - max(np.nanmin(before, initial=top), np.nanmin(after, initial=top))
        moved = float(np.ptp(q[start:stop])) > 1e-3 * travel  # an arm at rest may well stay there
        if moved and drop > max(10.0 * step, 1e-3 * abs(top)):
            flat += stop - start
    return at & (flat >= CONFIG.flat_together)


def _unwrapped(log: ExperimentLog) -> tuple[Array, Mask]:
    """Return what wraps added to each position (samples, joints) [rad], and where it jumps.

    A wrap is by whole turns or by the range of a counter; the mask has the first sample after every
    jump that is neither.
    """
    jump, size = _jumps(log.q)
    jump &= (np.abs(np.diff(log.t)) < 1.5 * log.sample_time)[:, None]  # not across a gap
    undo = np.zeros_like(size)
    for j in np.flatnonzero(jump.any(axis=0)):
        joint = log.robot.joints[j]
        step = joint.encoder_resolution or quantum(log.q[:, j]) or 0.0
        periods = [step * 2**bits for bits in CONFIG.counters if step]
        for period in [2.0 * np.pi] * joint.revolute + periods:
            turns = np.rint(size[:, j] / period)
            fits = np.abs(size[:, j] - turns * period) < CONFIG.turn_fits * period
            fits &= jump[:, j] & (turns != 0) & (np.abs(turns) <= CONFIG.turns)
            undo[fits, j] = turns[fits] * period
            jump[fits, j] = False
    return np.cumsum(np.pad(undo, ((1, 0), (0, 0))), axis=0), np.pad(jump, ((1, 0), (0, 0)))


def _jumps(q: Array) -> tuple[Mask, Array]:
    """Return where `q` (samples, joints) steps as no motion does, and by how much.

    Returns:
        (samples - 1, joints) mask, and the size of each step [rad] beyond its neighbours' median.
    """
    step = np.diff(q, axis=0)
    largest = float(np.nanmax(np.abs(step), initial=0.0))
    if len(q) < limits.FEWEST or largest < CONFIG.jump_least / 2.0:
        return np.zeros(step.shape, dtype=bool), np.zeros(step.shape)
    padded = np.pad(step, ((3, 3), (0, 0)), mode="edge")
    around = np.median(np.stack([padded[k : k + len(step)] for k in (0, 1, 2, 4, 5, 6)]), axis=0)
    excess = np.where(np.isfinite(step - around), step - around, 0.0)
    usual = np.quantile(np.abs(excess), 0.99, axis=0)
    jump = np.abs(excess) > np.maximum(CONFIG.jump * usual, CONFIG.jump_least)
    padded = np.pad(excess, ((2, 2), (0, 0)))
    for k in (0, 1, 3, 4):  # a glitch comes back within two samples; a jump stays
        back = np.abs(excess + padded[k : k + len(step)])
        jump &= back >= CONFIG.glitch_sides * np.abs(excess)
    return jump, np.where(jump, excess, 0.0)


def _emergency_stop(log: ExperimentLog) -> tuple[int, str] | None:
    """Return the sample from which the arm no longer follows, up to the end of the log, and how.

    A joint leaves its reference and stays away, or all torques drop to zero for good while the arm
    moves. In a friction log that is a coast-down, and meant.
    """
    if log.experiment in ("hold", "frf") or log.n_samples < SHORTEST:
        return None
    shortest, events = max(20, round(CONFIG.stop_least / log.sample_time)), []
    if "q_ref" in log:
        error = np.abs(log.q - log["q_ref"])
        measured = np.isfinite(error)
        spread = np.std(np.where(np.isfinite(log["q_ref"]), log["q_ref"], 0.0), axis=0)
        usual = np.median(np.where(measured, error, 0.0), axis=0)
        lost = (error > np.maximum(np.maximum(0.05, 0.25 * spread), 8.0 * usual)) | ~measured
        starts = _start_of_last_run(lost & measured.any(axis=0))
        joint, start = int(starts.argmin()), int(starts.min())
        if measured[start:, joint].sum() > (log.n_samples - start) / 2:
            off = float(np.nanmax(error[start:, joint]))
            words = f"joint {joint + 1} leaves its reference by {off:.3g} rad and stays away"
            events.append((start, words))
    if log.experiment != "friction":
        start = int(_start_of_last_run((log.tau == 0.0).all(axis=1)[:, None])[0])
        speed = np.abs(lagged_speed(log.q, log.sample_time))
        speed = np.where(np.isfinite(speed), speed, 0.0)
        usual = np.quantile(speed, 0.75, axis=0)
        before = speed[max(0, start - shortest) : start].max(axis=0, initial=0.0)
        if ((before > 0.3 * usual) & (usual > 0)).any():
            events.append((start, "all torques drop to zero while the arm moves"))
    late = [e for e in events if 0.1 * log.n_samples < e[0] < log.n_samples - shortest]
    return min(late, default=None)


def _start_of_last_run(mask: Mask) -> Indices:
    """Return the first sample (joints,) of the run that reaches the end, else the number of all."""
    backward = mask[::-1]
    length = np.where(backward.all(axis=0), len(mask), np.argmin(backward, axis=0))
    return np.asarray(len(mask) - length, dtype=np.intp)
