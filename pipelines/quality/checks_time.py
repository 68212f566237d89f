"""Check the clock of a log: its unit, its order, what is missing in it, whether it is long and fast enough."""

from __future__ import annotations

import numpy as np

from pipelines.errors import Check
from pipelines.io.limits import (
    FEWEST,
    GAP_LIMIT,
    LARGEST_JITTER,
    MOST_STEPS,
    SHORTEST,
    percent,
    recorded_span,
    shorter_than_period,
)
from pipelines.quality.checks_subject import Subject, many

_STALE_LEAST = 0.05  # of the samples: fewer repeated rows do no harm
_STALE_TOGETHER = 0.95  # of the repeats of one channel are those of all: by chance they are not

__all__ = ["CLOCK_CHECKS", "MOTION_BAND", "TIME_CHECKS"]


def length(s: Subject) -> list[Check]:
    """T08, T07: there are samples, and a periodic log holds a whole period."""
    log = s.log
    if log.n_samples < 2:
        return [s.say("T08", "reject",
                      f"{many(log.n_samples, 'sample')}",
                      signal="t",
                      remedy="record again; a log of one sample shows no motion")]
    if log.n_samples < FEWEST:
        return [s.say("T08", "reject",
                      f"{log.n_samples} samples, fewer than the {FEWEST} that any check needs",
                      signal="t",
                      remedy="record a longer log")]
    if log.n_samples < SHORTEST:
        return [s.say("T08", "warn",
                      f"{log.n_samples} samples, {recorded_span(log.signals['t'].values, log.sample_time):.3g} s: too short for "
                      f"any fit, which needs {SHORTEST} at least, {SHORTEST * log.sample_time:.3g} s at this rate",
                      signal="t",
                      remedy="record longer, some seconds of the motion at least")]
    time = s.good.log.t
    duration = recorded_span(time, log.sample_time)
    if log.period is not None and shorter_than_period(time, log.sample_time, log.period):
        return [s.say("T07", "reject",
                      f"{duration:.4g} s < {log.period:.4g} s period",
                      signal="t",
                      remedy="record at least one whole period, or correct the attribute period")]
    number = "" if log.period is None else f"{duration / log.period:.3g}"
    whole = f", {number} period{'' if number == '1' else 's'}" if number else ""
    return s.ok("T07", f"{log.n_samples} samples in {duration:.4g} s{whole}", signal="t")


def unit_of_time(s: Subject) -> list[Check]:
    """S08, S09: the steps of t and the declared sample time are the same quantity in the same unit."""
    if s.log.n_samples < 2:
        return []
    time, nominal = s.good.time, s.log.sample_time
    if time.is_rate:
        return [s.say("S09", "reject",
                      f"sample_time is {nominal:.6g}, the steps of t are {time.median:.6g} s: "
                      "it holds the rate in Hz, not the period",
                      signal="t",
                      remedy=f"write sample_time = {1.0 / nominal:.6g}")]
    if not time.unit:
        return [s.say("S08", "reject",
                      f"t steps by {time.median:.6g}, sample_time is {nominal:.6g} s, "
                      "and no unit of time makes them the same",
                      signal="t",
                      remedy="correct sample_time, or import the recording with the unit of its time column")]
    if time.unit == "s":
        return s.ok("S08", f"t steps by {time.median:.6g} s, as sample_time says", signal="t")
    what = "sample numbers" if time.unit == "samples" else f"in {time.unit}"
    return [s.say("S08", "repair",
                  f"t is declared in s, but is {what}: it steps by {time.median / time.scale:.6g} "
                  f"where sample_time is {nominal:.6g} s; read as that",
                  signal="t",
                  remedy="import the recording with the unit of its time column")]


def order(s: Subject) -> list[Check]:
    """T01, D01: time runs forward and is a number."""
    time, found = s.good.time, []
    if time.undefined.size:
        found.append(s.say("D01", "repair" if time.undefined.size <= 0.01 * s.log.n_samples else "reject",
                           f"{many(time.undefined.size, 'stamp')} in t without a time, "
                           f"the first is sample {time.undefined[0]}; left out",
                           signal="t",
                           remedy="look why the recorder lost its clock there"))
    if time.steps.size:
        k = int(time.steps[0])
        back = (s.log.t[k] - s.log.t[k + 1]) * time.scale
        much = time.steps.size > MOST_STEPS
        then = "" if much else "; the log is split there"
        found.append(s.say("T01", "reject" if much else "repair",
                           f"time steps back {many(time.steps.size, 'time')}, first by {back:.4g} s{then}",
                           signal="t", sample=k + 1,
                           remedy="record with a monotonic clock, not with the time of day"))
    return found or s.ok("T01", "time runs forward throughout", signal="t")


def repeated_stamps(s: Subject) -> list[Check]:
    """T02: no stamp stands twice."""
    time = s.good.time
    if time.conflicting.size:
        words = f"{many(time.conflicting.size, 'stamp')} twice with different values"
        return [s.say("T02", "reject",
                      words if time.advances or time.steps.size else f"time stands still at {s.log.t[time.conflicting[0]]:.6g}",
                      signal="t", sample=int(time.conflicting[0]) + 1,
                      remedy="record with a clock that resolves a sample")]
    if time.repeated.size:
        return [s.say("T02", "repair",
                      f"{many(time.repeated.size, 'sample')} twice, stamp and all; dropped",
                      signal="t", sample=int(time.repeated[0]) + 1,
                      remedy="look why the recorder wrote them twice")]
    if stale := _stale(s):
        return [s.say("T02", "warn", stale, signal="t",
                      remedy="record at the rate at which the controller writes, or leave out the repeated samples on import")]
    return s.ok("T02", "every stamp stands once", signal="t")


def _stale(s: Subject) -> str:
    """Say how often a whole row is repeated under a new stamp; empty where none is.

    Channels stop and go each at its own time, but for a row that is stale: where the channel that changes most often stands
    still, all others do, and where it changes they do not. What stands still for longer is an arm at rest.
    """
    rows = np.hstack([s.log.q, s.log.tau])
    if len(rows) < FEWEST or rows.shape[1] < 2:
        return ""
    same = rows[1:] == rows[:-1]
    runs = np.flatnonzero(np.diff(np.pad(same.all(axis=1).astype(np.int8), 1))).reshape(-1, 2)
    rest = np.zeros(len(same), dtype=bool)
    for first, last in runs[np.diff(runs, axis=1)[:, 0] > GAP_LIMIT].tolist():
        rest[first:last] = True
    same = same[~rest]
    if len(same) < FEWEST:
        return ""
    finest = int(np.argmin(same.mean(axis=0)))
    others = np.delete(same, finest, axis=1).all(axis=1)
    stale, fresh = others[same[:, finest]], others[~same[:, finest]]
    if len(fresh) < 2 or len(stale) < _STALE_LEAST * len(same):
        return ""
    if stale.mean() < _STALE_TOGETHER or fresh.mean() > 1.0 - _STALE_TOGETHER:
        return ""
    between = np.diff(np.flatnonzero(~same[:, finest]))
    every = int(np.median(between))
    rate = 1.0 / s.log.sample_time
    if np.mean(between == every) < 1.0 - _STALE_LEAST:
        share = float(np.mean(same[:, finest]))
        return (f"{percent(share, 2)} of the samples repeat the one before under a new stamp: {rate * (1.0 - share):.4g} Hz on "
                "average")
    which = "every second sample repeats the one before" if every == 2 else f"only one in {every} samples is new"
    return f"{which}: {rate / every:.4g} Hz"


def lost_samples(s: Subject) -> list[Check]:
    """T03: a few samples were dropped."""
    time = s.good.time
    if not time.dropped.size:
        return s.ok("T03", "no sample dropped", signal="t")
    share = 100.0 * time.dropped_samples / (s.log.n_samples + time.dropped_samples)
    then = "spectra fill them in alike in all channels" if s.log.experiment == "frf" else \
        "the observer predicts through them, nothing is interpolated"
    return [s.say("T03", "warn",
                  f"{many(time.dropped_samples, 'sample')} ({share:.2g} %) dropped at {many(time.dropped.size, 'place')}; {then}",
                  signal="t", sample=int(time.dropped[0]),
                  remedy="give the recorder more priority, or record fewer signals")]


def gaps(s: Subject) -> list[Check]:
    """T04: stretches without samples take the log apart."""
    time, runs = s.good.time, s.good.runs
    if not time.gaps.size:
        return s.ok("T04", f"no gap of more than {GAP_LIMIT} samples", signal="t")
    longest = max((run.stop - run.start for run in runs), default=0)
    words = f"{many(time.gaps.size, 'gap')} of more than {GAP_LIMIT} samples, {time.gap_lengths.sum():.4g} s together"
    if not runs:
        return [s.say("T04", "reject",
                      f"{words}; no stretch between them has {SHORTEST} samples",
                      signal="t", sample=int(time.gaps[0]),
                      remedy="record again without interruption")]
    return [s.say("T04", "repair",
                  f"{words}; the longest of {many(len(runs), 'usable part')} has {longest} samples",
                  signal="t", sample=int(time.gaps[0]),
                  remedy="look why the recorder stopped there")]


def jitter(s: Subject) -> list[Check]:
    """T05: samples come at even intervals."""
    time = s.good.time
    words = f"the interval varies: rms {percent(time.jitter)}, at most {percent(time.worst)} of the sample time"
    if time.jitter <= LARGEST_JITTER:
        return s.ok("T05", words, signal="t")
    return [s.say("T05", "warn",
                  f"{words}; more than {percent(LARGEST_JITTER)} rms",
                  signal="t",
                  remedy="sample by a timer; a frequency response needs even sampling")]


def band(s: Subject) -> list[Check]:
    """T09: the motion is sampled at least ten times in its own period.

    With c_k the correlation of the steps of q at a distance of k samples, motion at f gives c1 = cos(2π f / fs), white
    noise -1/2. Ten samples a period is c1 = 0.81; noise is told from fast motion by c2, to which it does not contribute.
    """
    slow = [j for j in range(s.log.n_joints) if s.travel[j] > 0 and _undersampled(s, j)]
    rate = 1.0 / s.log.sample_time
    if slow and s.log.experiment != "frf":
        return [s.say("T09", "reject",
                      f"a rate of {rate:.4g} Hz is too low for this motion: fewer than ten samples in its period, "
                      "the speed between them is lost",
                      signal="q", joint=j,
                      remedy="record faster; ten times the highest frequency at least")
                for j in slow]
    return s.ok("T09", f"a rate of {rate:.4g} Hz resolves the motion", signal="q")


def _undersampled(s: Subject, joint: int) -> bool:
    q, step = s.position[:, joint], s.steps[joint] or s.log.robot.joints[joint].encoder_resolution or 0.0
    even = (np.abs(np.diff(s.good.log.t) / s.log.sample_time - 1.0) < 0.5) & ~s.good.jumped[1:, joint]
    d = np.where(even & np.isfinite(np.diff(q)), np.diff(q), 0.0)
    power = float(d @ d)
    if d.size < FEWEST or power <= 0 or np.sqrt(power / d.size) < 5.0 * step or np.ptp(q[np.isfinite(q)]) < 100.0 * step:
        return False
    c1, c2 = float(d[1:] @ d[:-1]) / power, float(d[2:] @ d[:-2]) / power
    return (c1 < 0.81 and c2 < 0.5 and c2 < c1) or c1 < -0.6


CLOCK_CHECKS = (length, order, repeated_stamps)  # of a clock that never runs forward nothing else can be said
TIME_CHECKS = (length, unit_of_time, order, repeated_stamps, lost_samples, gaps, jitter)
MOTION_BAND = band
