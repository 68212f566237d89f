"""Find the clock of a recording and the unit it counts in, as far as its numbers can say.

A clock rises. It is one column, or two: whole seconds and a fraction that starts again. Its unit is
the one its name gives, or the only one under which the recording has a plausible rate, moves at a
plausible pace and agrees with a recorded velocity. Numbers 0, 1, 2, … may also count samples.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.log.experiment import Array
from pipelines.log.recording.column_names import read_name, words_of
from pipelines.log.recording.column_roles import Group, unit_of_group
from pipelines.log.recording.evidence import Guess, Slope, units_of_ratio
from pipelines.log.recording.raw import RawTable

__all__ = ["Clock", "find_clock", "unit_of_clock"]

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_RATES = (1.0, 2e4)  # [Hz] of recordings whose time has no unit
_PACE = (
    0.02,
    50.0,
)  # [1/s] fastest speed over range of motion; the unit of length or angle cancels
_EPOCH = (1e9, 4e9)  # [s] since 1970: the years 2001 to 2096
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
    """Return the clock of the recording; None where no column rises like one."""
    of = {column: group.quantity for group in groups for column in group.columns}
    times, counters, plain = (
        [c for c in table.columns if of.get(c) == quantity] for quantity in ("time", "index", "")
    )
    found = [
        clock for pair in itertools.pairwise(times) if (clock := _pair(table, *pair, named=True))
    ]
    found += [_single(table, c) for c in times if _rises(table.columns[c])]
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
    return Clock((column,), (unit,), table.columns[column])


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
    if named and 0.1 * _RATES[0] <= 1.0 / (median * SECONDS[named]) <= 10.0 * _RATES[1]:
        return named, Guess(
            named,
            "sure",
            f"named so, and a median step of {median:.4g} makes "
            f"{1 / (median * SECONDS[named]):.4g} Hz",
        )
    fits = [unit for unit, f in SECONDS.items() if _RATES[0] <= 1.0 / (median * f) <= _RATES[1]]
    if (
        since := [unit for unit in fits if _EPOCH[0] < clock.values[0] * SECONDS[unit] < _EPOCH[1]]
    ) and len(since) == 1:
        return since[0], Guess(
            since[0],
            "sure",
            f"counted since 1970, and a median step of {median:.4g} makes "
            f"{1 / (median * SECONDS[since[0]]):.4g} Hz",
        )
    rates = {unit: f"{1 / (median * SECONDS[unit]):.4g} Hz in {unit}" for unit in fits}
    counts = _counts(clock.values)
    why = [
        f"a median step of {median:.4g} would be {' or '.join(rates.values()) or 'no plausible rate'}"
    ]
    if q is not None and (span := float(np.ptp(q, axis=0).max())) > 0:
        pace = _pace(clock.values, q) / span
        paced = [unit for unit in fits if _PACE[0] <= pace / SECONDS[unit] <= _PACE[1]]
        if len(paced) < len(fits):
            why.append("the pace of the motion leaves " + (" or ".join(paced) or "none"))
        fits = paced
    if slope is not None:
        agreeing = [
            unit for unit in fits if units_of_ratio(slope.factor / SECONDS[unit], _RATIO_TOLERANCE)
        ]
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


def _pace(t: Array, q: Array) -> float:
    """Return the largest mean speed over a hundredth of the recording, in the recorded units."""
    width = max(1, t.size // 100)
    elapsed = t[width:] - t[:-width]
    moved = np.abs(q[width:] - q[:-width]).max(axis=1)
    good = elapsed > 0
    return float((moved[good] / elapsed[good]).max()) if good.any() else 0.0
