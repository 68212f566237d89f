"""Find what is wrong with the samples of a log: clock, missing values, glitches, limits. Masks and indices, no words.

`checks` turns these findings into sentences, `segments` into stretches that a stage may use. Every threshold is a
statement about sampling or about the statistics of rare events, so that a healthy log, slow or fast, clean or noisy,
is left alone:

    a glitch      stands out of its neighbours by 4 times what 99 % of the samples do (10 σ of white noise), and by 4
                  times what 90 % of those around it do, while the samples before and after it agree with each other, as they do not
                  at a step or at a sudden start
    saturation    the described limit is reached, or the torque stays at its extreme value while the arm moves and
                  leaves it faster than a smooth peak of the same width could
    an interval   is judged in units of the nominal sampling time
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.io import limits
from pipelines.io.experiment import Array, ExperimentLog
from pipelines.io.limits import ABSURD, GAP_LIMIT, GAP_TICKS, sentinels
from pipelines.io.order_statistics import distinct, in_order, median, quantile

__all__ = ["GAP_LIMIT", "Mask", "TimeBase", "jumps", "lagged_speed", "missing", "quantum", "saturated",
           "spikes", "time_base", "torque_limit"]

Mask = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.intp]

_NO_TIME = 1e20  # nanoseconds since 1970 are 2e18


@dataclass(frozen=True)
class TimeBase:
    """How the samples of a log lie in time."""

    unit: str  # of `t` as recorded: "s", or what its steps say it is; "" where no unit fits the declared sample time
    scale: float  # [s] per unit of t
    is_rate: bool  # sample_time holds the rate
    median: float  # [s] interval, by the recorded t in seconds
    undefined: Indices  # samples whose t is not a time
    steps: Indices  # k: t[k + 1] < t[k]
    repeated: Indices  # k: sample k + 1 is sample k once more, stamp and all
    conflicting: Indices  # k: sample k + 1 has the stamp of sample k and other values
    gaps: Indices  # k: more than GAP_LIMIT samples are missing between k and k + 1
    gap_lengths: Array  # [s]
    dropped: Indices  # k: a few samples are missing there
    dropped_samples: int
    jitter: float  # rms deviation of the regular intervals from their median, in sample times
    worst: float  # largest such deviation
    advances: bool  # any stamp is later than the one before it

    @property
    def known(self) -> bool:
        return bool(self.unit) and not self.is_rate


def time_base(log: ExperimentLog) -> TimeBase:
    """How the samples of `log` lie in time; see `TimeBase`."""
    t, nominal = np.where(np.abs(log.t) < _NO_TIME, log.t, np.nan), log.sample_time
    undefined = np.flatnonzero(~np.isfinite(t))
    interval = np.diff(t)
    forward = interval[np.isfinite(interval) & (interval > 0)]
    none = np.zeros(0, dtype=np.intp)
    if forward.size == 0:  # it stands still or runs backwards throughout: no two samples lie apart, so none repeats another
        return TimeBase("s", 1.0, False, nominal, undefined, np.flatnonzero(interval < 0.0), none,
                        np.flatnonzero(interval == 0.0), none, np.zeros(0), none, 0, 0.0, 0.0, False)
    unit, scale, is_rate = _time_unit(t, forward, nominal)
    typical = float(median(forward)) * scale
    tick = nominal if unit and not is_rate else typical
    with np.errstate(over="ignore", invalid="ignore"):
        ticks = interval * scale / tick
    same = np.flatnonzero(interval == 0.0)
    exact = np.array([_repeats(log, k) for k in same.tolist()], dtype=np.bool_)
    gaps = np.flatnonzero(ticks > GAP_TICKS)
    rms, worst = limits.jitter(ticks)
    late = limits.late(ticks, rms)
    return TimeBase(unit, scale, is_rate, typical, undefined, np.flatnonzero(interval < 0.0), same[exact], same[~exact],
                    gaps, interval[gaps] * scale, late, int(np.sum(np.rint(ticks[late]) - 1)), rms, worst, True)


def _time_unit(t: Array, forward: Array, nominal: float) -> tuple[str, float, bool]:
    """What unit makes the steps of `t` the nominal sample time: (unit, seconds per unit, sample_time is a rate)."""
    typical, mean = float(median(forward)), float(np.mean(forward))
    if any(abs(step / nominal - 1.0) < 0.1 for step in (typical, mean)):
        return "s", 1.0, False
    if typical < nominal and abs(typical * nominal - 1.0) < 0.02:
        return "s", 1.0, True
    units = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
    if typical == 1.0 and bool(np.all(np.rint(forward) == forward)):
        units["samples"] = nominal
    fits = {unit: factor for unit, factor in units.items() if abs(typical * factor / nominal - 1.0) < 0.02}
    if not fits or max(fits.values()) > 1.02 * min(fits.values()):
        return "", 1.0, False
    unit = next(iter(fits))
    return unit, fits[unit], False


def _repeats(log: ExperimentLog, k: int) -> bool:
    return all(np.array_equal(s.values[k], s.values[k + 1], equal_nan=True) for s in log.signals.values())


def missing(x: Array) -> Mask:
    """Samples without a measurement: not a number, infinite, absurdly large, or a sentinel."""
    with np.errstate(invalid="ignore"):
        return ~(np.abs(x) < ABSURD) | sentinels(x)


def quantum(x: Array) -> float | None:
    """The step in which `x` (samples,) was counted, or None where no step is visible."""
    values = distinct(x[np.isfinite(x)])
    if values.size < 20:
        return None
    steps = np.diff(values)
    steps = steps[steps > 1e-11 * np.abs(values[[0, -1]]).max()]
    if steps.size < 19:
        return None
    # the smallest ten: one alone may be a rounding error of the recording
    step = float(median(np.partition(steps, 9)[:10]))
    counts = steps[steps < 1000 * step] / step
    return step if float(np.mean(np.abs(counts - np.rint(counts)) < 0.05)) > 0.98 else None


def lagged_speed(q: Array, sample_time: float, lag: float = 0.01) -> Array:
    """Speed (samples - 2 m, joints) as the difference over ±`lag` seconds: m = lag / sample_time, at least 1.

    In a short or very fast log `lag` is a twentieth of it at most: over half the log, a motion to and fro has no speed.
    """
    m = max(1, min(round(lag / sample_time), len(q) // 20))
    return (q[2 * m:] - q[:-2 * m]) / (2 * m * sample_time)


def spikes(x: Array, smooth: bool, floor: Array) -> Mask:
    """Glitches of one or two samples in `x` (samples, joints).

    Args:
        smooth: a position, compared with the cubic through its neighbours; otherwise a torque, which may jump,
            compared with their median.
        floor: (joints,) smaller ones are left alone.
    """
    found = np.zeros(x.shape, dtype=bool)
    for width in (1, 2):
        reach = 2 * width
        if len(x) < 40 * width:
            continue
        near, far = width, (2 * width if smooth else width + 1)
        middle = slice(reach, -reach)
        a, b, c, d = (x[reach + k:len(x) - reach + k] for k in (-far, -near, near, far))
        if smooth:
            expected = (4.0 * (b + c) - (a + d)) / 6.0
            left, right, spread = 2.0 * b - a, 2.0 * c - d, np.zeros_like(a)
        else:
            two = in_order(np.where(np.isnan(beside), np.inf, beside) for beside in (a, b, c, d))[1:3]  # a missing one comes last
            expected = (two[0] + two[1]) / 2.0
            left, right, spread = (a + b) / 2.0, (c + d) / 2.0, np.maximum(np.abs(a - b), np.abs(c - d))
        off = np.abs(x[middle] - expected)
        off = np.where(np.isfinite(off), off, 0.0)
        # a kink, as at a hard stop, continues one of its sides
        alone = np.minimum(np.abs(x[middle] - left), np.abs(x[middle] - right)) > 0.6 * off
        with np.errstate(invalid="ignore"):
            limit = np.maximum(4.0 * quantile(off, 0.99), floor)
            candidate = (off > limit) & alone & (np.abs(left - right) < 0.4 * off) & (spread < 0.4 * off)
        found[middle] |= candidate & _stands_out_locally(off, candidate)
    return found


def _stands_out_locally(off: Array, candidate: Mask) -> Mask:
    """Return whether each candidate is 4 times what 90 % of the 50 samples around it are: fast parts of a log are noisier."""
    row, column = np.nonzero(candidate)
    around = np.clip(row[:, None] + np.concatenate([np.arange(-29, -4), np.arange(5, 30)]), 0, len(off) - 1)
    values = np.where(np.isfinite(near := off[around, column[:, None]]), near, 0.0)
    result = np.zeros_like(candidate)
    result[row, column] = off[row, column] > 4.0 * quantile(values, 0.9, axis=1) if row.size else False
    return result


def torque_limit(log: ExperimentLog) -> Array:
    """(joints,) the lower of the controller's and the robot's torque limit [N m]; inf where neither is described."""
    limit = np.array([joint.torque for joint in log.robot.joints])
    if log.controller is not None and log.controller.output_limit is not None:
        limit = np.minimum(limit, log.controller.output_limit)
    return limit


def saturated(log: ExperimentLog) -> Mask:
    """Samples at which the drive could not give the torque that was asked for."""
    tau, limit = log.tau, torque_limit(log)
    with np.errstate(invalid="ignore"):
        at_limit = np.abs(tau) >= 0.999 * limit
        if log.torque == "measured":  # a measured torque beyond the limit shows that the limit is not one
            at_limit &= ~(np.abs(tau) > 1.01 * limit).any(axis=0)
    if log.experiment in ("friction", "hold", "frf") or (log.controller is not None and log.controller.law == "open-loop"):
        return at_limit  # an open-loop torque is constant because it was asked to be
    for j in range(tau.shape[1]):
        step = quantum(tau[:, j]) or 0.0
        for sign in (1.0, -1.0):
            at_limit[:, j] |= _flat_top(sign * tau[:, j], log.q[:, j], step)
    return at_limit


def _flat_top(x: Array, q: Array, step: float) -> Mask:
    """Runs at the very maximum of `x` that no smooth peak makes: within half a run's length beside it, `x` falls by more
    than 10 quanta, each `step`, where a parabola that spends the run within one quantum would be down by 3."""
    flat = np.zeros(x.shape, dtype=bool)
    finite = np.isfinite(x)
    if not finite.any():
        return flat
    top = x[finite].max()
    at = np.concatenate(([False], finite & (x >= top - max(0.01 * step, 1e-9 * abs(top))), [False]))
    edges = np.flatnonzero(np.diff(at.astype(np.int8))).reshape(-1, 2)
    travel = float(np.ptp(q[np.isfinite(q)])) if np.isfinite(q).any() else 0.0
    for start, stop in edges.tolist():
        half = max(2, (stop - start) // 2)
        before, after = x[max(0, start - half):start], x[stop:stop + half]
        if stop - start < 5 or before.size < 2 or after.size < 2:
            continue
        drop = top - max(np.nanmin(before, initial=top), np.nanmin(after, initial=top))
        moved = float(np.ptp(q[start:stop]))
        if drop > max(10.0 * step, 1e-3 * abs(top)) and moved > 1e-3 * travel:  # an arm at rest may well stay there
            flat[start:stop] = True
    return np.asarray(at[1:-1]) if int(flat.sum()) >= 10 else np.zeros_like(flat)


def jumps(q: Array) -> tuple[Mask, Array]:
    """Steps between two samples that no motion makes, and by how much.

    Returns:
        (samples - 1, joints) mask, and the size of each step [rad] beyond what its neighbours suggest.
    """
    step = np.diff(q, axis=0)
    if len(step) < 8:
        return np.zeros(step.shape, dtype=bool), np.zeros(step.shape)
    padded = np.pad(step, ((3, 3), (0, 0)), mode="edge")
    middle = in_order(padded[k:k + len(step)] for k in (0, 1, 2, 4, 5, 6))[2:4]
    around = (middle[0] + middle[1]) / 2.0
    excess = step - around
    excess = np.where(np.isfinite(excess), excess, 0.0)
    usual = quantile(np.abs(excess), 0.99)
    with np.errstate(invalid="ignore"):
        jump = np.abs(excess) > np.maximum(30.0 * usual, 0.02)
        ahead = np.pad(excess, ((0, 2), (0, 0)))  # a glitch comes back within two samples; a jump stays
        back = np.pad(excess, ((2, 0), (0, 0)))
        for k in (1, 2):
            jump &= ~(np.abs(excess + ahead[k:k + len(step)]) < 0.4 * np.abs(excess))
            jump &= ~(np.abs(excess + back[2 - k:2 - k + len(step)]) < 0.4 * np.abs(excess))
    return jump, np.where(jump, excess, 0.0)
