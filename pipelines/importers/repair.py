"""Repair a recording where that is honest, refuse it where it is not, and say what was done.

Samples go in, samples come out: nothing is ever filled in. A missing one leaves a gap in time; a
clock that was set back ends one log and begins the next.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from pipelines.errors import Check, Gathering, InputRejected, Level
from pipelines.importers.config import REPAIR
from pipelines.io import limits as common
from pipelines.io.limits import FEWEST
from pipelines.io.log import Array
from pipelines.quality.subject import many

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
    si: Mapping[str, float] = field(default_factory=dict)  # name -> SI of one recorded unit, or 1

    def take(self, chosen: slice | npt.NDArray[np.bool_]) -> Recording:
        """Return the recording of some samples."""
        kept = np.arange(self.t.size)[chosen]
        breaks = {int(np.searchsorted(kept, b)) for b in self.breaks} - {0, kept.size}
        return replace(
            self,
            t=self.t[chosen],
            signals={name: values[chosen] for name, values in self.signals.items()},
            places=self.places[chosen],
            breaks=tuple(sorted(breaks)),
        )

    def listed(self, which: Index) -> str:
        """Return lines or rows in words, the first few."""
        shown = ", ".join(str(self.places[i]) for i in which[:5])
        more = " …" if which[5:].size else ""
        return f"{self.word}{'s' if which.size != 1 else ''} {shown}{more}"

    def column(self, name: str, joint: int) -> str:
        return f"{self.where}, column '{self.columns[name][joint]}'"

    def check(self, code: str, message: str, remedy: str, level: Level = "repair") -> Check:
        """Return a check of what was done to the recording, or is left as it is."""
        return Check.of(code, level, message, self.where, remedy)

    def refused(self, code: str, message: str, remedy: str) -> InputRejected:
        return InputRejected(code, message, self.where, remedy)


@dataclass(frozen=True)
class Limits:
    """The entries of a recipe for missing samples and gaps."""

    missing: tuple[float, ...] = ()
    longest_gap: float | None = None  # [s]; default what an observer predicts through
    resampled: bool = False


def repair(recording: Recording, limits: Limits) -> tuple[tuple[Recording, ...], tuple[Check, ...]]:
    """Return the parts of a recording that can be logs, and what was done to get them.

    Raises:
        InputRejected: T01, T02, T04, T08, D02, D03: what cannot be repaired.
    """
    checks: list[Check] = []
    if recording.t.size <= 1:
        raise recording.refused("T08", many(recording.t.size, "sample"), "record again")
    recording = _mark_missing(recording, limits.missing, checks)
    recording = _drop_missing(recording, checks)
    recording = _drop_duplicates(recording, checks)
    steady = _split_at_steps(recording, checks)
    parts = tuple(piece for part in steady for piece in _split_at_gaps(part, limits, checks))
    return parts, tuple(checks)


def _mark_missing(
    recording: Recording, missing: tuple[float, ...], checks: list[Check]
) -> Recording:
    """D03: make declared sentinels NaN; refuse infinite, absurd and undeclared ones."""
    signals, problems = {}, Gathering()
    for name, raw in recording.signals.items():
        hit = np.isin(raw, missing)
        signals[name] = values = np.where(hit, np.nan, raw)
        if hit.any():
            message = f"{int(hit.sum())} numbers of {name} are declared missing values"
            checks.append(recording.check("D03", message, "correct [missing] if these are samples"))
        absurd = np.abs(values) * recording.si.get(name, 1.0) >= common.ABSURD
        filler = common.sentinels(values) & ~absurd
        for joint in np.flatnonzero((absurd | filler).any(axis=0)).tolist():
            bad = np.flatnonzero(absurd[:, joint] if absurd[:, joint].any() else filler[:, joint])
            number = float(values[bad[0], joint])
            message = f"{number:g} in {recording.listed(bad)}"
            if not absurd[:, joint].any():
                message += " looks like 'no sample': nothing else comes near it"
            value = repr(number).removesuffix(".0")
            remedy = f"if it means 'no sample', add [missing] values = [{value}]; else the "
            remedy += "recording is damaged"
            with problems.part():
                raise InputRejected("D03", message, recording.column(name, joint), remedy)
    problems.raise_all()
    return replace(recording, signals=signals)


def _drop_missing(recording: Recording, checks: list[Check]) -> Recording:
    """D01, D02: leave out samples with a hole, which leaves a gap; refuse a channel of holes."""
    empty = np.all([np.isnan(x).all(axis=1) for x in recording.signals.values()], axis=0)
    if recording.clocked and 0.0 < empty.mean() < 1.0:  # rows of other topics: no samples of these
        recording = recording.take(~empty)
    lost = ~np.isfinite(recording.t)
    if lost.all():
        raise recording.refused("D02", "no time stamp is a number", "choose another column of time")
    for name, values in recording.signals.items():
        holes = np.isnan(values)
        for joint in np.flatnonzero(holes.mean(axis=0) > REPAIR.most_missing).tolist():
            share = holes[:, joint].mean()
            message = f"{100 * share:.0f} % of its samples are missing"
            message = "holds no number at all" if share == 1.0 else message
            remedy = "choose another column, or record again"
            raise InputRejected("D02", message, recording.column(name, joint), remedy)
        lost |= holes.any(axis=1)
    if not lost.any():
        return recording
    which = np.flatnonzero(lost)
    samples = f"{which.size} of {lost.size} samples"
    if lost.mean() > REPAIR.most_missing:
        raise recording.refused("D02", f"{samples} have a missing value", "record again")
    message = f"{samples} with a missing value left out ({recording.listed(which)})"
    checks.append(recording.check("D01", message, "look for what loses samples"))
    return recording.take(~lost)


def _drop_duplicates(recording: Recording, checks: list[Check]) -> Recording:
    """T02: drop a sample that is written twice; refuse one stamp with two values."""
    which = np.flatnonzero(np.diff(recording.t) == 0.0) + 1
    if not which.size:
        return recording
    every = recording.signals.values()
    differ = np.any([(x[which] != x[which - 1]).any(axis=1) for x in every], axis=0)
    if differ.any():
        message = f"{int(differ.sum())} time stamps stand twice with different values "
        message += f"({recording.listed(which[differ])})"
        remedy = "record time with more digits, or import by rate instead of the column"
        raise recording.refused("T02", message, remedy)
    message = f"{which.size} samples that stand twice dropped ({recording.listed(which)})"
    checks.append(recording.check("T02", message, "let each sample be recorded once"))
    return recording.take(np.isin(np.arange(recording.t.size), which, invert=True))


def _split_at_steps(recording: Recording, checks: list[Check]) -> tuple[Recording, ...]:
    """T01: split where the clock was set back or, without a clock, lines are lost."""
    back = np.flatnonzero(np.diff(recording.t) < 0.0) + 1
    if back.size > common.MOST_STEPS:
        message = f"time runs backwards {back.size} times ({recording.listed(back)})"
        remedy = "sort the file by time, or choose another column of time"
        raise recording.refused("T01", message, remedy)
    cuts = sorted({*map(int, back), *(() if recording.clocked else recording.breaks)})
    kept, into = _cut(recording, cuts)
    if cuts:
        lost = ("F09", "lines are lost and no clock says how many")
        code, why = ("T01", "time steps back") if back.size else lost
        message = f"{why} at {recording.listed(np.array(cuts))}: {into}"
        checks.append(recording.check(code, message, "record without interruption, by one clock"))
    if not kept:
        message = f"{cuts[0] if cuts else recording.t.size} samples left; a log needs {FEWEST}"
        raise recording.refused("T08", message, "record longer")
    return kept


def _cut(recording: Recording, cuts: Sequence[int]) -> tuple[tuple[Recording, ...], str]:
    """Return the parts between `cuts` that are long enough for a log, and words for it."""
    size = recording.t.size
    parts = [recording.take(slice(a, b)) for a, b in zip([0, *cuts], [*cuts, size], strict=True)]
    shortest = max(FEWEST, REPAIR.shortest_part * size / len(parts))
    kept = tuple(part for part in parts if part.t.size >= shortest)
    words = "one part is kept" if len(kept) == 1 else f"split into {len(kept)} parts"
    if dropped := size - sum(part.t.size for part in kept):
        words += f", {dropped} samples of short parts left out"
    return kept, words


def _split_at_gaps(part: Recording, limits: Limits, checks: list[Check]) -> tuple[Recording, ...]:
    """T04: split at a gap that no observer predicts through; nothing is interpolated across it."""
    steps = np.diff(part.t)
    longest = common.GAP_TICKS * float(np.median(steps))
    if limits.longest_gap is not None:  # only resampling can bridge more than an observer does
        longest = limits.longest_gap if limits.resampled else min(longest, limits.longest_gap)
    wide = np.flatnonzero(steps > longest)
    if not wide.size:
        return (part,)
    kept, into = _cut(part, (wide + 1).tolist())
    words = f"{many(wide.size, 'gap')} longer than {longest:.4g} s, the longest {steps.max():.4g} s"
    words += f", after {part.listed(wide)}"
    if not kept or steps[wide].sum() > 0.5 * (part.t[-1] - part.t[0]):
        most = "they make more than half of the recording"
        most = most if kept else f"no stretch between them has {FEWEST} samples"
        raise part.refused("T04", f"{words}: {most}", "record again without interruption")
    checks.append(part.check("T04", f"{words}: {into}", "look why the recorder stopped there"))
    return kept
