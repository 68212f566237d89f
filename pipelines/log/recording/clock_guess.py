"""Find the clock of a recording and the unit it counts in, as far as its numbers can say.

A clock rises. It is one column, or two: whole seconds and a fraction that starts again. Its unit is
the one its name gives, or the only one under which the recording has a plausible rate, moves at a
plausible pace and agrees with a recorded velocity. Numbers 0, 1, 2, … may also count samples.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.errors import InputRejected
from pipelines.log.experiment import Array
from pipelines.log.recording.clock import counted_on
from pipelines.log.recording.column_groups import Group, unit_of_group
from pipelines.log.recording.column_names import read_name, words_of
from pipelines.log.recording.evidence import Guess, Slope, units_of_ratio
from pipelines.log.recording.raw import RawTable
from pipelines.log.recording.stated import Statement, stated_scale, stated_unit
from pipelines.log.units import UNITS

__all__ = [
    "SECONDS",
    "Clock",
    "clock_as_stated",
    "find_clock",
    "rate_as_stated",
    "round_rate",
    "unit_of_clock",
]

_COMMON = ("s", "ms", "us", "ns")
SECONDS = {unit: UNITS[unit].factor for unit in (*_COMMON, "100 ns", "min", "d")}
_RATES = (1.0, 2e4)  # [Hz] of recordings whose time has no unit
_PACE = (
    0.02,
    50.0,
)  # [1/s] fastest speed over range of motion; the unit of length or angle cancels
_THIS_CENTURY = (1e9, 4e9)  # [s] since 1970: the years 2001 to 2096
# (unit, year in which it begins to count, [s] from there to 1970): Unix, LabVIEW, .NET, Windows files, spreadsheets, MATLAB
_EPOCHS = (
    *((unit, "1970", 0.0) for unit in _COMMON),
    ("s", "1904", 2082844800.0),
    ("100 ns", "1", 62135596800.0),
    ("100 ns", "1601", 11644473600.0),
    ("d", "1900", 25569 * 86400.0),
    ("d", "0", 719529 * 86400.0),
)
_RISING = 0.9  # of all steps of a clock; some stamps come twice, some clocks are set back
_EVEN = 0.3  # standard deviation over mean of the steps of a clock without a name
_RATIO_TOLERANCE = 0.02


@dataclass(frozen=True)
class Clock:
    """Columns whose sum is the time, and the unit of each as far as it is known ("" where not)."""

    columns: tuple[str, ...]
    units: tuple[str, ...]
    values: Array  # (samples,) in the unit of the only column, or [s] of two

    @property
    def paired(self) -> bool:
        return len(self.columns) == 2


def find_clock(table: RawTable, groups: Sequence[Group]) -> Clock | None:
    """Return the clock of the recording; None where no column rises like one.

    Raises:
        InputRejected: T01, the only column of time runs backwards.
    """
    of = {column: group.quantity for group in groups for column in group.columns}
    times, counters, plain = (
        [c for c in table.columns if of.get(c) == quantity] for quantity in ("time", "index", "")
    )
    found = [
        clock for pair in itertools.pairwise(times) if (clock := _pair(table, *pair, named=True))
    ]
    found += [_single(table, c) for c in times if _rises(table.columns[c])]
    if not found and (backwards := [c for c in times if _rises(-table.columns[c])]):
        where = f"{table.source}, column '{backwards[0]}'"
        message = "falls from row to row: the newest row is first"
        remedy = "sort the rows by it, the oldest first"
        raise InputRejected("T01", message, where=where, remedy=remedy)
    if found:
        uneven = [_unevenness(clock.values) for clock in found]
        best = min(uneven)
        return next(
            clock for clock, value in zip(found, uneven, strict=True) if value <= 2.0 * best + 1e-6
        )
    if len(plain) > 2 and (clock := _pair(table, plain[0], plain[1], named=False)):
        return clock
    even = [c for c in plain[:2] if len(table.columns) > 2 and _rises_evenly(table.columns[c])]
    counting = [c for c in even if _counts(table.columns[c])]
    for column in [*(c for c in even if c not in counting), *counting]:
        return _single(table, column)
    counted = [c for c in counters if _rises(table.columns[c])]
    if not counted:
        return None
    values = table.columns[counted[0]]
    single = np.median(np.diff(values)) == 1.0  # KUKA's IPOC counts ms, in steps of its cycle
    return Clock((counted[0],), ("sample" if single else "",), values)


def _single(table: RawTable, column: str) -> Clock:
    unit = unit_of_group([column], table)[0] or ""
    return Clock((column,), (unit,), counted_on(table.columns[column])[0])


def _rises(values: Array) -> bool:
    """Tell whether a column rises like a clock; a fraction of a second that starts again is not enough."""
    steps = np.diff(values)
    falls = -steps[steps < 0]
    again = (
        any(abs(falls.max() / full - 1.0) < 0.1 for full in (1e3, 1e6, 1e9))
        if falls.size
        else False
    )
    return float(np.mean(steps > 0)) > _RISING and not (again and values.min() >= 0.0)


def _rises_evenly(values: Array) -> bool:
    steps = np.diff(values)
    return bool((steps > 0).all() and np.std(steps) < _EVEN * np.mean(steps))


def _counts(values: Array) -> bool:
    """Tell whether a column is 0, 1, 2, … or 1, 2, 3, …"""
    return values[0] in (0.0, 1.0) and float(np.mean(np.diff(values) == 1.0)) > _RISING


def _unevenness(values: Array) -> float:
    steps = np.diff(values)
    return float(np.std(steps) / max(abs(float(np.mean(steps))), 1e-300))


def _pair(table: RawTable, whole: str, fraction: str, named: bool) -> Clock | None:
    """Return the clock of whole seconds beside a fraction of them, where together they rise."""
    a, b = table.columns[whole], table.columns[fraction]
    if (a != np.round(a)).any() or (b < 0).any() or (b != np.round(b)).any() or _rises(a):
        return None
    if named and [w for w in words_of(whole) if not _second(w)] != [
        w for w in words_of(fraction) if not _second(w)
    ]:
        return None
    unit = read_name(fraction).unit if named else ""
    for candidate in (unit,) if unit in ("ns", "us", "ms") else ("ns", "us", "ms"):
        full = 1.0 / SECONDS[candidate]
        if b.max() >= full or (not unit and b.max() < 0.5 * full):
            continue
        values = (a - a[0]) + b * SECONDS[candidate]
        if _rises(values):
            return Clock((whole, fraction), ("s", candidate), values)
    return None


def _second(word: str) -> bool:
    return re.fullmatch(r"(nano|micro|milli|n|u|m)?s(ec(ond)?s?)?|tv", word) is not None


def unit_of_clock(clock: Clock, q: Array | None, slope: Slope | None) -> tuple[str, Guess]:
    """Return the unit, "" where it stays open, and the reason.

    Args:
        q: (samples, joints) positions in any unit.
        slope: relation of a recorded velocity to the positions, per recorded unit of time.
    """
    steps = np.diff(clock.values)
    median = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    if clock.paired:
        return "s", Guess(
            "s",
            "sure",
            f"whole seconds and {clock.units[1]} together rise by {median:.4g} s, {1 / median:.4g} Hz",
        )
    if clock.units[0] == "sample":
        return "sample", Guess("sample", "likely", "named a counter: the rate is not in the file")
    named = clock.units[0]
    if named and named not in SECONDS:
        return "", Guess("", "unsure", f"its name or header says '{named}': s, ms, us or ns?")
    rates = {unit: 1.0 / (median * f) for unit, f in SECONDS.items()}
    by_velocity = [
        unit
        for unit in _COMMON
        if slope is not None and units_of_ratio(slope.factor / SECONDS[unit], _RATIO_TOLERANCE)
    ]
    if named and 0.1 * _RATES[0] <= rates[named] <= 10.0 * _RATES[1]:
        if problem := _contradicts(named, rates, by_velocity, clock.values, q):
            return "", Guess("", "unsure", f"its name or header says '{named}', but {problem}")
        return named, Guess(
            named,
            "sure",
            f"named so, and a median step of {median:.4g} makes {rates[named]:.4g} Hz",
        )
    plausible = [unit for unit, rate in rates.items() if _RATES[0] <= rate <= _RATES[1]]
    if since := _since(clock.values[0], plausible):
        unit, years = since
        counted = f"counted since the year {years}, and a median step of {median:.4g} makes"
        return unit, Guess(unit, "sure", f"{counted} {rates[unit]:.4g} Hz")
    fits = [unit for unit in plausible if unit in _COMMON]
    counts = _counts(clock.values)
    would = " or ".join(f"{rates[unit]:.4g} Hz in {unit}" for unit in fits)
    why = [f"a median step of {median:.4g} would be {would or 'no plausible rate'}"]
    if q is not None:
        paced = _paced(fits, clock.values, q)
        if len(paced) < len(fits):
            why.append("the pace of the motion leaves " + (" or ".join(paced) or "none"))
        fits = paced
    agreeing = [unit for unit in fits if unit in by_velocity]
    if len(agreeing) == 1:
        return agreeing[0], Guess(
            agreeing[0], "likely", f"{'; '.join(why)}; the recorded velocity agrees"
        )
    if len(fits) == 1 and not counts:
        return fits[0], Guess(fits[0], "likely", "; ".join(why))
    why += (
        ['0, 1, 2, … may also count samples: then unit = "sample" and rate = … [Hz]']
        if counts
        else []
    )
    return "", Guess("", "unsure", "; ".join(why))


def rate_as_stated(stated: Statement | None, slope: Slope | None) -> tuple[float, Guess]:
    """Return the rate [Hz] that the file states; nan where it states none, or one that a velocity (per sample) contradicts."""
    if stated is None:
        return math.nan, Guess("", "unsure", "")
    agrees = slope is None or units_of_ratio(slope.factor * stated.number) is not None
    rate = stated.number if math.isfinite(stated.number) and agrees else math.nan
    return rate, Guess(f"{rate:g} Hz", "likely", f"the file states {stated.words}")


def clock_as_stated(
    clock: Clock,
    q: Array | None,
    slope: Slope | None,
    notes: Sequence[str],
    stated: Statement | None,
) -> tuple[str, Guess]:
    """Return the unit of a clock as `unit_of_clock` does, with what the file states of it and of the rate."""
    said = stated_unit(notes, "time") if not clock.paired and not clock.units[0] else None
    if said is not None and said.value:
        clock = replace(clock, units=(said.value,))
    unit, guess = unit_of_clock(clock, q, slope)
    if said is not None and said.value and guess.confidence == "sure":
        guess = replace(
            guess,
            confidence="likely",
            why=guess.why.replace("named so", f"the file states {said.words}"),
        )
    if not clock.units[0] and (ticks := stated_scale(notes, "time")):
        return "", Guess("", "unsure", f"the file states '{ticks[0].words}'")
    if stated is None or clock.paired or guess.confidence == "sure" or unit == "sample":
        return unit, guess
    steps = np.diff(clock.values)
    step = float(np.median(steps[steps > 0]))
    words = f"a median step of {step:.4g}, and the file states {stated.words}"
    fits = [
        other
        for other, size in SECONDS.items()
        if abs(step * size * stated.number - 1.0) < _RATIO_TOLERANCE
    ]
    if len(fits) == 1 and unit in ("", fits[0]):
        return fits[0], Guess(fits[0], "likely", words)
    if step == 1.0 and not unit and math.isfinite(stated.number):
        return "sample", Guess("sample", "likely", words)
    return "", Guess("", "unsure", f"{guess.why}; but {words}" if unit else guess.why)


def _since(first: float, units: Sequence[str]) -> tuple[str, str] | None:
    """Return the only unit in which a clock counts to this century, and since which year; None where none or several do."""
    low, high = _THIS_CENTURY
    found = [
        (unit, year)
        for unit, year, offset in _EPOCHS
        if unit in units and low < first * SECONDS[unit] - offset < high
    ]
    one = len({unit for unit, _ in found}) == 1
    return (found[0][0], " or ".join(year for _, year in found)) if one else None


def _contradicts(
    named: str, rates: dict[str, float], by_velocity: Sequence[str], t: Array, q: Array | None
) -> str:
    """Return what speaks against a unit of time that is named: a recorded velocity, or rate and pace; "" where nothing does."""
    if by_velocity and named not in by_velocity:
        return f"the recorded velocity is the slope of the position in {' or '.join(by_velocity)}"
    slow = rates[named] < _RATES[0] and q is not None and not _paced([named], t, q)
    return f"that makes {rates[named]:.4g} Hz, and a motion too slow for a robot" if slow else ""


def _paced(units: Sequence[str], t: Array, q: Array) -> list[str]:
    """Return the units in which the largest mean speed over a hundredth of the recording is a robot's; all of one at rest."""
    span = float(np.ptp(q, axis=0).max())
    width = max(1, t.size // 100)
    elapsed = t[width:] - t[:-width]
    moved = np.abs(q[width:] - q[:-width]).max(axis=1)
    good = elapsed > 0
    if span == 0.0:
        return list(units)
    pace = float((moved[good] / elapsed[good]).max()) / span if good.any() else 0.0
    return [unit for unit in units if _PACE[0] <= pace / SECONDS[unit] <= _PACE[1]]


def round_rate(rate: float) -> float:
    """Return the next round rate below, as recorders are set to. [Hz]"""
    decade = 10.0 ** np.floor(np.log10(rate))
    rounds = (1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)
    return float(max(m for m in rounds if m * decade <= rate * (1 + 1e-9)) * decade)
