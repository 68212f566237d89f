"""Mend a recording where mending is honest, refuse it where it is not, and say every time what was done.

Samples go in, samples come out: nothing is ever filled in. What is missing leaves a gap in time; a clock that was set
back ends one log and begins the next.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from pipelines.errors import Check, Gathering, InputRejected
from pipelines.log import limits as common
from pipelines.log.experiment import Array
from pipelines.log.limits import (
    ABSURD,
    FEWEST,
    GAP_LIMIT,
    GAP_TICKS,
    LARGEST_JITTER,
    MOST_STEPS,
    percent,
    sentinels,
)

__all__ = ["Limits", "Recording", "late_intervals", "mend"]

_SHORTEST_PART = 0.1  # of all samples
_MOST_MISSING = 0.2

Index = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Recording:
    """Signals on one clock, still in recorded units."""

    t: Array  # (samples,) [s]
    signals: Mapping[str, Array]  # name -> (samples, joints)
    columns: Mapping[str, tuple[str, ...]]  # name -> the file's column of each joint, for messages
    places: Index  # (samples,) line or row of each sample in the file
    where: str
    clocked: bool = True  # the file has a column of time; else a rate was declared
    word: str = "row"  # what `places` counts: "line" or "row"
    breaks: tuple[int, ...] = ()  # samples before which the file is damaged
    si: Mapping[str, float] = field(
        default_factory=dict
    )  # name -> what one recorded unit is in SI; 1 where it is not said

    def take(self, chosen: slice | npt.NDArray[np.bool_]) -> Recording:
        kept = (
            np.flatnonzero(chosen)
            if isinstance(chosen, np.ndarray)
            else np.arange(self.t.size)[chosen]
        )
        breaks = tuple(
            sorted({int(np.searchsorted(kept, b)) for b in self.breaks} - {0, kept.size})
        )
        return replace(
            self,
            t=self.t[chosen],
            signals={name: values[chosen] for name, values in self.signals.items()},
            places=self.places[chosen],
            breaks=breaks,
        )

    def listed(self, which: Index) -> str:
        """Lines or rows in words, the first few."""
        shown = ", ".join(str(self.places[i]) for i in which[:5])
        return (
            f"{self.word}{'s' if which.size != 1 else ''} {shown}{' …' if which.size > 5 else ''}"
        )

    def column(self, name: str, joint: int) -> str:
        return f"{self.where}, column '{self.columns[name][joint]}'"


@dataclass(frozen=True)
class Limits:
    """What a recipe says of missing samples and gaps."""

    missing: tuple[float, ...] = ()
    longest_gap: float | None = None  # [s]; default what an observer predicts through
    resampled: bool = False


def mend(recording: Recording, limits: Limits) -> tuple[tuple[Recording, ...], tuple[Check, ...]]:
    """The parts of a recording that can be logs, and what was done to get them.

    Raises:
        InputRejected: T01, T02, T04, T08, D02, D03: what cannot be mended.
    """
    checks: list[Check] = []
    if recording.t.size < 2:
        message = f"{recording.t.size} sample{'s' if recording.t.size != 1 else ''}"
        raise InputRejected("T08", message, where=recording.where, remedy="record again")
    recording = _mark_missing(recording, limits.missing, checks)
    recording = _drop_missing(recording, checks)
    recording = _drop_duplicates(recording, checks)
    parts = tuple(
        piece
        for part in _split_at_steps(recording, checks)
        for piece in _split_at_gaps(part, limits, checks)
    )
    if (
        not limits.resampled
    ):  # else what becomes of late samples is part of the record of the resampling
        for part in parts:
            _report_clock(part, checks)
    return parts, tuple(checks)


def _mark_missing(
    recording: Recording, missing: tuple[float, ...], checks: list[Check]
) -> Recording:
    """D03: declared sentinels become NaN; infinite, absurd and undeclared sentinel-like numbers are refused."""
    signals, problems = {}, Gathering()
    for name, values in recording.signals.items():
        values = values.copy()
        if missing:
            hit = np.isin(values, np.array(missing))
            if (count := int(hit.sum())) > 0:
                values[hit] = np.nan
                checks.append(
                    Check.of(
                        "D03",
                        "repair",
                        f"{count} numbers of {name} are declared missing values",
                        where=recording.where,
                        remedy="correct [missing] if these are samples",
                    )
                )
        for joint in range(values.shape[1]):
            with problems.part():
                _refuse_absurd(recording, name, joint, values[:, joint])
        signals[name] = values
    problems.raise_all()
    return replace(recording, signals=signals)


def _refuse_absurd(recording: Recording, name: str, joint: int, values: Array) -> None:
    bad = np.flatnonzero(np.abs(values) * recording.si.get(name, 1.0) >= ABSURD)
    remedy = "if it means 'no sample', add [missing] values = [{}]; else the recording is damaged"
    if bad.size:
        raise InputRejected(
            "D03",
            f"{values[bad[0]]:g} in {recording.listed(bad)}",
            where=recording.column(name, joint),
            remedy=remedy.format(repr(float(values[bad[0]]))),
        )
    filler = np.flatnonzero(sentinels(values[:, None])[:, 0])
    if filler.size:
        value = f"{values[filler[0]]:.17g}"
        message = f"{value} in {recording.listed(filler)} looks like 'no sample': nothing else comes near it"
        raise InputRejected(
            "D03", message, where=recording.column(name, joint), remedy=remedy.format(value)
        )


def _drop_missing(recording: Recording, checks: list[Check]) -> Recording:
    """D01, D02: samples with a hole are left out, which leaves a gap in time; a channel of holes is refused."""
    lost = ~np.isfinite(recording.t)
    empty = np.all([np.isnan(values).all(axis=1) for values in recording.signals.values()], axis=0)
    if (
        recording.clocked and 0.0 < empty.mean() < 1.0
    ):  # rows of other topics in one table: no samples of these signals
        return _drop_missing(recording.take(~empty), checks)
    if lost.all():
        message = "no time stamp is a number"
        remedy = "choose another column of time"
        raise InputRejected("D02", message, where=recording.where, remedy=remedy)
    for name, values in recording.signals.items():
        holes = np.isnan(values)
        for joint in np.flatnonzero(holes.mean(axis=0) > _MOST_MISSING):
            share = holes[:, joint].mean()
            remedy = "choose another column, or record again"
            raise InputRejected(
                "D02",
                "holds no number at all"
                if share == 1.0
                else f"{100 * share:.0f} % of its samples are missing",
                where=recording.column(name, int(joint)),
                remedy=remedy,
            )
        lost |= holes.any(axis=1)
    if not lost.any():
        return recording
    which = np.flatnonzero(lost)
    if lost.mean() > _MOST_MISSING:
        message = f"{which.size} of {lost.size} samples have a missing value"
        raise InputRejected("D02", message, where=recording.where, remedy="record again")
    message = f"{which.size} of {lost.size} samples with a missing value left out ({recording.listed(which)})"
    remedy = "look for what loses samples"
    checks.append(Check.of("D01", "repair", message, where=recording.where, remedy=remedy))
    return recording.take(~lost)


def _drop_duplicates(recording: Recording, checks: list[Check]) -> Recording:
    """T02: a sample written twice is dropped; one stamp with two values is refused."""
    again = np.concatenate([[False], np.diff(recording.t) == 0.0])
    if not again.any():
        return recording
    which = np.flatnonzero(again)
    differ = np.zeros(which.size, dtype=bool)
    for values in recording.signals.values():
        differ |= (values[which] != values[which - 1]).any(axis=1)
    if differ.any():
        message = (
            f"{int(differ.sum())} time stamps stand twice with different values "
            f"({recording.listed(which[differ])})"
        )
        remedy = "record time with more digits, or import by rate instead of the column"
        raise InputRejected("T02", message, where=recording.where, remedy=remedy)
    message = f"{which.size} samples that stand twice dropped ({recording.listed(which)})"
    remedy = "let each sample be recorded once"
    checks.append(Check.of("T02", "repair", message, where=recording.where, remedy=remedy))
    return recording.take(~again)


def _split_at_steps(recording: Recording, checks: list[Check]) -> tuple[Recording, ...]:
    """T01: where the clock was set back (or, without a clock, lines are lost) one part ends and another begins."""
    back = np.flatnonzero(np.diff(recording.t) < 0.0) + 1
    if back.size > MOST_STEPS:
        message = f"time runs backwards {back.size} times ({recording.listed(back)})"
        remedy = "sort the file by time, or choose another column of time"
        raise InputRejected("T01", message, where=recording.where, remedy=remedy)
    cuts = sorted({*map(int, back), *(() if recording.clocked else recording.breaks)})
    if not cuts:
        return (_long_enough(recording),)
    kept, into = _cut(recording, cuts)
    code, why = (
        ("T01", "time steps back")
        if back.size
        else ("F09", "lines are lost and no clock says how many")
    )
    message = f"{why} at {recording.listed(np.array(cuts))}: {into}"
    remedy = "record without interruption, by one clock"
    checks.append(Check.of(code, "repair", message, where=recording.where, remedy=remedy))
    if not kept:
        _long_enough(recording.take(slice(0, cuts[0])))
    return kept


def _cut(recording: Recording, cuts: Sequence[int]) -> tuple[tuple[Recording, ...], str]:
    """The parts between the samples `cuts` that are long enough for a log, and what was done in words."""
    parts = [
        recording.take(slice(a, b))
        for a, b in zip([0, *cuts], [*cuts, recording.t.size], strict=True)
    ]
    kept = tuple(
        part
        for part in parts
        if part.t.size >= max(FEWEST, _SHORTEST_PART * recording.t.size / len(parts))
    )
    dropped = recording.t.size - sum(part.t.size for part in kept)
    return kept, (
        f"{'one part is kept' if len(kept) == 1 else f'split into {len(kept)} parts'}"
        f"{f', {dropped} samples of short parts left out' if dropped else ''}"
    )


def _long_enough(recording: Recording) -> Recording:
    if recording.t.size < FEWEST:
        message = f"{recording.t.size} samples left; a log needs {FEWEST}"
        raise InputRejected("T08", message, where=recording.where, remedy="record longer")
    return recording


def _split_at_gaps(part: Recording, limits: Limits, checks: list[Check]) -> tuple[Recording, ...]:
    """T04: a gap that no observer predicts through ends one log and begins the next; nothing is interpolated across it."""
    steps = np.diff(part.t)
    longest = GAP_TICKS * float(np.median(steps))
    if limits.longest_gap is not None:  # only resampling can bridge more than an observer does
        longest = limits.longest_gap if limits.resampled else min(longest, limits.longest_gap)
    wide = np.flatnonzero(steps > longest)
    if not wide.size:
        return (part,)
    kept, into = _cut(part, (wide + 1).tolist())
    words = (
        f"{wide.size} gap{'s' if wide.size != 1 else ''} longer than {longest:.4g} s, the longest {steps.max():.4g} s, "
        f"after {part.listed(wide)}"
    )
    if steps[wide].sum() > 0.5 * (part.t[-1] - part.t[0]) or not kept:
        most = (
            "they make more than half of the recording"
            if kept
            else f"no stretch between them has {FEWEST} samples"
        )
        remedy = "record again without interruption"
        raise InputRejected("T04", f"{words}: {most}", where=part.where, remedy=remedy)
    remedy = "look why the recorder stopped there"
    checks.append(Check.of("T04", "repair", f"{words}: {into}", where=part.where, remedy=remedy))
    return kept


def late_intervals(part: Recording) -> Index:
    """The samples after which a few are lost, or come late."""
    ticks = np.diff(part.t) / float(np.median(np.diff(part.t)))
    return common.late(ticks, common.jitter(ticks)[0])


def _report_clock(part: Recording, checks: list[Check]) -> None:
    """T03, T05: lost samples and uneven time are said; they stay as gaps of `t`, for no sample is invented."""
    steps = np.diff(part.t)
    median = float(np.median(steps))
    rms, worst = common.jitter(steps / median)
    gaps = late_intervals(part)
    lost = int(np.round(steps[gaps] / median - 1.0).sum())
    if lost:
        message = (
            f"{lost} sample{'s' if lost != 1 else ''} ({100.0 * lost / (lost + part.t.size):.2g} %) lost in "
            f"{gaps.size} gap{'s' if gaps.size != 1 else ''} of at most {GAP_LIMIT}, after {part.listed(gaps)}"
        )
        remedy = "give the recorder more priority, or record fewer signals"
        checks.append(Check.of("T03", "warn", message, where=part.where, remedy=remedy))
    if rms > LARGEST_JITTER:
        message = (
            f"time is uneven: steps vary about {median:.6g} s by {percent(rms)} (rms), at most by "
            f"{percent(worst)}"
        )
        remedy = "add [resample] rate = … for an even grid"
        checks.append(Check.of("T05", "warn", message, where=part.where, remedy=remedy))
