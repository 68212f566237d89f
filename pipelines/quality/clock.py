"""Check the clock of a log: its unit, its order, what is missing in it, its length and its rate."""

from __future__ import annotations

import numpy as np

from pipelines.errors import Check, Level
from pipelines.io import limits
from pipelines.io.limits import FEWEST, GAP_LIMIT, SHORTEST, percent
from pipelines.quality.config import CONFIG
from pipelines.quality.segments import long_blocks
from pipelines.quality.subject import Subject, many


def length(s: Subject) -> list[Check]:
    """T08, T07: there are samples, and a periodic log holds a whole period."""
    log, n = s.log, s.log.n_samples
    if n < FEWEST:
        words = f"{many(n, 'sample')}, fewer than the {FEWEST} that any check needs"
        return [s.say("T08", "reject", words, "record a longer log", signal="t")]
    span = limits.recorded_span(s.good.log.t, log.sample_time)
    if n < SHORTEST:
        words = f"{n} samples, {span:.3g} s: too short for any fit, which needs {SHORTEST} samples"
        return [s.say("T08", "warn", words, "record some seconds of the motion", signal="t")]
    if log.period and limits.shorter_than_period(s.good.log.t, log.sample_time, log.period):
        remedy = "record at least one whole period, or correct the attribute period"
        words = f"{span:.4g} s < {log.period:.4g} s period"
        return [s.say("T07", "reject", words, remedy, signal="t")]
    periods = f", periods: {span / log.period:.3g}" if log.period else ""
    return s.ok("T07", f"{n} samples in {span:.4g} s{periods}", signal="t")


def unit_of_time(s: Subject) -> list[Check]:
    """S08, S09: the steps of t and the declared sample time are alike, in one unit."""
    time, nominal = s.good.time, s.log.sample_time
    steps = f"sample_time is {nominal:.6g}, and t steps by {time.median / time.scale:.6g}"
    if time.is_rate:
        words = f"{steps}: it holds the rate in Hz"
        return [s.say("S09", "reject", words, f"write sample_time = {1 / nominal:.6g}", signal="t")]
    if time.unit == "s":
        return s.ok("S08", f"t steps by {time.median:.6g} s, as sample_time says", signal="t")
    remedy = "correct sample_time, or import the recording with the unit of its time column"
    if not time.unit:
        words = f"{steps}, and no unit of time makes them the same"
        return [s.say("S08", "reject", words, remedy, signal="t")]
    unit = "sample numbers" if time.unit == "samples" else f"in {time.unit}"
    return [s.say("S08", "repair", f"{steps}: t is {unit}, and read as that", remedy, signal="t")]


def order(s: Subject) -> list[Check]:
    """T01, D01: time runs forward and is a number."""
    time, found = s.good.time, []
    if (lost := time.undefined).size:
        words = f"{many(lost.size, 'stamp')} in t without a time, first {lost[0]}; left out"
        few, remedy = lost.size <= CONFIG.few * s.log.n_samples, "look at the recorder's clock"
        found.append(s.say("D01", "repair" if few else "reject", words, remedy, signal="t"))
    if (steps := time.steps).size:
        k = int(steps[0])
        back = (s.log.t[k] - s.log.t[k + 1]) * time.scale
        words = f"time steps back {many(steps.size, 'time')}, first by {back:.4g} s; split there"
        remedy = "record with a monotonic clock, not with the time of day"
        level: Level = "repair" if steps.size <= limits.MOST_STEPS else "reject"
        found.append(s.say("T01", level, words, remedy, signal="t", sample=k + 1))
    return found or s.ok("T01", "time runs forward throughout", signal="t")


def repeated_stamps(s: Subject) -> list[Check]:
    """T02: no stamp and no row is there twice."""
    time = s.good.time
    if (at := time.conflicting).size:
        words = f"{many(at.size, 'stamp')} twice with different values"
        if not (time.advances or time.steps.size):
            words = f"time stands still at {s.log.t[at[0]]:.6g}"
        remedy = "record with a clock that resolves a sample"
        return [s.say("T02", "reject", words, remedy, signal="t", sample=int(at[0]) + 1)]
    if (at := time.repeated).size:
        words = f"{many(at.size, 'sample')} twice, stamp and all; dropped"
        remedy = "find out why the recorder wrote them twice"
        return [s.say("T02", "repair", words, remedy, signal="t", sample=int(at[0]) + 1)]
    # A row is stale where the channel that changes most often repeats and all others do, and where
    # it changes they do not; channels that repeat values each at its own time are no such rows.
    rows = np.hstack([s.log.q, s.log.tau])
    same = rows[1:] == rows[:-1]
    rest = np.zeros(len(same), dtype=bool)
    for first, last in long_blocks(same.all(axis=1)):
        rest[first:last] = True
    same = same[~rest]
    finest = int(np.argmin(same.sum(axis=0)))
    old, others = same[:, finest], np.delete(same, finest, axis=1).all(axis=1)
    share = float(old.mean()) if len(same) >= FEWEST else 0.0
    if CONFIG.stale_share <= share < 1.0 and (
        min(others[old].mean(), 1.0 - others[~old].mean()) >= CONFIG.stale_together
    ):
        words = f"{percent(share, 2)} of the samples repeat the one before under a new stamp"
        if np.mean(np.diff(np.flatnonzero(~old)) == 1 + 1) >= 1.0 - CONFIG.stale_share:
            words = "every second sample repeats the one before"
        words += f": {(1.0 - share) / s.log.sample_time:.3g} Hz"
        remedy = "record at the controller's rate, or leave out the repeated samples on import"
        return [s.say("T02", "warn", words, remedy, signal="t")]
    return s.ok("T02", "no stamp is repeated", signal="t")


def lost_samples(s: Subject) -> list[Check]:
    """T03: a few samples were dropped."""
    at, lost = s.good.time.dropped, s.good.time.dropped_samples
    if not at.size:
        return s.ok("T03", "no sample dropped", signal="t")
    share = 100.0 * lost / (s.log.n_samples + lost)
    words = f"{many(lost, 'sample')} ({share:.2g} %) dropped at {many(at.size, 'place')}; "
    words += "nothing is interpolated"
    remedy = "give the recorder more priority, or record fewer signals"
    return [s.say("T03", "warn", words, remedy, signal="t", sample=int(at[0]))]


def gaps(s: Subject) -> list[Check]:
    """T04: stretches without samples take the log apart."""
    at, runs, limit = s.good.time.gaps, s.good.runs, f"of more than {GAP_LIMIT} samples"
    if not at.size:
        return s.ok("T04", f"no gap {limit}", signal="t")
    lost = f"{many(at.size, 'gap')} {limit}, {s.good.time.gap_lengths.sum():.4g} s together"
    longest = max((run.stop - run.start for run in runs), default=0)
    words = f"{lost}; the longest of {many(len(runs), 'usable part')} has {longest} samples"
    if not runs:
        words = f"{lost}; no stretch between them has {SHORTEST} samples"
    level: Level = "repair" if runs else "reject"
    remedy = "record again without interruption"
    return [s.say("T04", level, words, remedy, signal="t", sample=int(at[0]))]


def jitter(s: Subject) -> list[Check]:
    """T05: samples come at even intervals."""
    rms, worst = percent(s.good.time.jitter), percent(s.good.time.worst)
    words = f"the interval varies: rms {rms}, at most {worst} of the sample time"
    if s.good.time.jitter <= limits.LARGEST_JITTER:
        return s.ok("T05", words, signal="t")
    words += f"; more than {percent(limits.LARGEST_JITTER)} rms"
    remedy = "sample by a timer; a frequency response needs even sampling"
    return [s.say("T05", "warn", words, remedy, signal="t")]


def band(s: Subject) -> list[Check]:
    """T09: the motion is sampled at least ten times in its own period.

    With c_k the correlation of the steps of q at a distance of k samples, motion at f gives
    c1 = cos(2π f / fs), white noise -1/2. Ten samples a period is c1 = 0.81; noise differs from
    fast motion by c2, to which it does not contribute.
    """
    rate, found = f"a rate of {1.0 / s.log.sample_time:.4g} Hz", []
    words = f"{rate} is too low for this motion: fewer than ten samples in its period"
    remedy = "record faster; ten times the highest frequency at least"
    for j in range(s.log.n_joints) if s.log.experiment != "frf" else ():
        q, described = s.position[:, j], s.log.robot.joints[j].encoder_resolution
        step = s.good.steps[j] or described or 0.0
        even = np.abs(np.diff(s.good.log.t) / s.log.sample_time - 1.0) < CONFIG.even
        even &= np.isfinite(np.diff(q)) & ~s.good.jumped[1:, j]
        d = np.where(even, np.diff(q), 0.0)
        power = float(d @ d)
        if power <= d.size * (5.0 * step) ** 2 or s.travel[j] < 100.0 * step:
            continue
        c1, c2 = float(d[1:] @ d[:-1]) / power, float(d[2:] @ d[:-2]) / power
        fast = c1 < CONFIG.band and c2 < min(CONFIG.band_next, c1)
        if fast or c1 < CONFIG.alternating:
            found.append(s.say("T09", "reject", words, remedy, signal="q", joint=j))
    return found or s.ok("T09", f"{rate} resolves the motion", signal="q")


ORDER_CHECKS = (order, repeated_stamps)  # of a clock that never runs forward nothing else is known
CLOCK_CHECKS = (length, unit_of_time, *ORDER_CHECKS, lost_samples, gaps, jitter, band)
