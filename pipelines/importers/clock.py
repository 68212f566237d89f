"""Find the time of a recording: its columns, and the seconds they count.

A clock rises. It is one column, or two: whole seconds and a fraction that starts again. An import
takes its unit from the recipe, the header or the declared rate. A draft takes it from the name, or
as the only one under which the recording has a plausible rate, moves at a plausible pace and agrees
with a recorded velocity. Numbers 0, 1, 2, … may also count samples.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.errors import Check, InputRejected
from pipelines.importers.columns import Group, own_units
from pipelines.importers.config import CLOCK, SCORES
from pipelines.importers.evidence import OTHER, Clue, Guess, Slope, units_of_ratio, unsure, weigh
from pipelines.importers.names import quantity_of, read_name, words_of
from pipelines.importers.notes import Statement, stated_scale, stated_unit
from pipelines.importers.raw import RawTable
from pipelines.importers.recipe import TimeSpec
from pipelines.io.log import Array
from pipelines.io.units import UNITS, canonical_unit, to_si

_COMMON = ("s", "ms", "us", "ns")
SECONDS = {unit: UNITS[unit].factor for unit in (*_COMMON, "100 ns", "min", "d")}
_INDEX = ("sample", "samples", "index")
# Unit, year in which it begins to count, [s] from there to 1970: Unix, LabVIEW, .NET, Windows,
# spreadsheets, MATLAB.
_EPOCHS = (
    *((unit, "1970", 0.0) for unit in _COMMON), ("s", "1904", 2082844800.0),
    ("100 ns", "1", 62135596800.0), ("100 ns", "1601", 11644473600.0),
    ("d", "1900", 25569 * 86400.0), ("d", "0", 719529 * 86400.0),
)  # fmt: skip
# Ranges of counters: of so many bits, some in s; and of a day.
_BITS = (2.0**bits * unit for bits in (16, 24, 32) for unit in (1.0, 1e-3, 1e-6))
_RANGES = (*_BITS, *(86400.0 * unit for unit in (1.0, 1e3, 1e6, 1e9)))


def median_step(values: Array) -> float:
    """Return the median of the steps forward; 1 without any."""
    steps = np.diff(values)
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0


def counted_on(stamps: Array) -> tuple[Array, float]:
    """Return time stamps that go on where their counter starts again, and its range, else 0.

    It falls by its whole range less a step or a few: a clock that was set back by chance does not.
    """
    steps = np.diff(stamps)
    falls, rises = steps[steps < 0], steps[steps > 0]
    if not falls.size or not rises.size or np.nanmin(stamps) < 0.0:
        return stamps, 0.0
    near, highest = CLOCK.few_steps * float(np.median(rises)), np.nanmax(stamps)
    fits = (x for x in _RANGES if highest < x and ((falls > -x) & (falls + x <= near)).all())
    full = next(fits, 0.0)
    return stamps + full * np.concatenate([[0.0], np.cumsum(steps < 0)]), full


def round_rate(rate: float) -> float:
    """Return the next round rate below, as recorders are set to. [Hz]"""
    decade = 10.0 ** np.floor(np.log10(rate))
    rounds = (1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)
    return float(max(m for m in rounds if m * decade <= rate * (1 + 1e-9)) * decade)


def time_of(table: RawTable, spec: TimeSpec, assume: bool = False) -> tuple[Array, list[Check]]:
    """Return time stamps [s], NaN where one is missing.

    Raises:
        InputRejected: S08 where unit and rate contradict each other or leave the unit open, T08
            without samples.
    """
    step = spec.sample_time
    if step is None and spec.rate is not None:
        step = 1.0 / spec.rate
    if spec.column is None:  # the recipe was checked: then there is a rate
        return table.rows * np.float64(step or math.nan), []
    names = [table.name_of(column, "t") for column, _ in spec.parts]
    where = f"{table.source}, column{'s' * (len(names) > 1)} '{', '.join(names)}'"
    for name in names:
        if (count := int(np.isfinite(table.columns[name]).sum())) <= 1:
            message = f"{count} time stamp{'s' * (count != 1)}, none later than another"
            raise InputRejected("T08", message, where=where, remedy="record again")
    checks: list[Check] = []
    if names[1:]:
        unit, factor = "s", 1.0
        stamps = _summed(
            table, [(n, u) for n, (_, u) in zip(names, spec.parts, strict=True)], where
        )
    else:
        stamps = table.columns[names[0]].copy()
        known = np.isfinite(stamps)
        stamps[known], full = counted_on(stamps[known])
        if full:
            message = f"the counter of time starts again after {full:.10g}: counted on"
            remedy = "none needed, unless the clock was set back by just so much"
            checks.append(Check.of("S08", "warn", message, where=where, remedy=remedy))
        unit, said = _unit_of_stamps(
            spec.parts[0][1],
            table.units.get(names[0]),
            median_step(stamps[known]),
            step,
            where,
            assume,
        )
        checks += said
        if unit in _INDEX and step is None:
            message = "time is a sample index, but no rate is declared"
            raise InputRejected("S08", message, where=where, remedy="add rate = … [Hz] to [time]")
        factor = step if unit in _INDEX and step else to_si(unit, "time", where=where).factor
    finite = stamps[np.isfinite(stamps)]
    if not (np.diff(finite) > 0).any():
        message = f"{finite.size} time stamps, none later than another"
        raise InputRejected("T08", message, where=where, remedy="choose another column of time")
    _refuse_implausible(median_step(finite), factor, unit, step, where)
    # An epoch: seconds since 1970 cost digits.
    origin = 0.0
    if abs(finite[0]) > CLOCK.epoch * median_step(finite) * finite.size:
        origin = finite[0]
        message = f"time starts at {origin:.16g} {unit}; counted from there"
        checks.append(Check.of("S08", "ok", message, where=where))
    return (stamps - origin) * factor, checks


def _summed(table: RawTable, parts: Sequence[tuple[str, str | None]], where: str) -> Array:
    """Return the sum of columns [s], large ones from their first stamp: no digit is lost."""
    total = np.zeros(table.rows.size)
    for name, unit in parts:
        if unit is None:
            remedy = 'give [time] one unit a column: unit = ["s", "ns"]'
            raise InputRejected("S08", "no unit", where=where, remedy=remedy)
        factor, stamps = to_si(unit, "time", where=where).factor, table.columns[name]
        first = stamps[np.isfinite(stamps)][0]
        total += (stamps - (first if abs(first) * factor > CLOCK.epoch else 0.0)) * factor
    return total


def _plausible(median: float) -> dict[str, float]:
    """Return the units in which a median step gives a rate that robots are recorded at [Hz]."""
    rates = {unit: 1.0 / (median * SECONDS[unit]) for unit in _COMMON}
    return {unit: rate for unit, rate in rates.items() if CLOCK.slowest <= rate <= CLOCK.fastest}


def _fitting(median: float, step: float) -> list[str]:
    """Return the units in which a median step is the declared one [s]."""
    fits = [unit for unit in _COMMON if abs(median * SECONDS[unit] / step - 1.0) < CLOCK.near]
    return fits or (["sample"] if median == 1.0 else [])


def _unit_of_stamps(
    declared: str | None,
    header: str | None,
    median: float,
    step: float | None,
    where: str,
    assume: bool,
) -> tuple[str, list[Check]]:
    """S08: return the unit of time stamps: the recipe's, the header's, or the only possible one."""
    if declared:
        known, said = canonical_unit(header or ""), canonical_unit(declared)
        other = said in _INDEX or (said in UNITS and UNITS.get(known) != UNITS[said])
        if header and quantity_of(known) == "time" and other:
            message = f"the header says '{header}', the recipe says '{declared}'"
            remedy = "correct one of them: the unit in [time], or the header"
            raise InputRejected("S08", message, where=where, remedy=remedy)
        return declared, []
    if header:
        message = f"unit '{header}' of time taken from the header"
        return header, [Check.of("S06", "ok", message, where=where)]
    fits = _fitting(median, step) if step is not None else []
    if step is not None and len(fits) == 1:
        message = f"unit of time not declared; {fits[0]} fits the declared rate of "
        remedy = f'add unit = "{fits[0]}" to [time]'
        words = f"{message}{1 / step:.6g} Hz"
        return fits[0], [Check.of("S08", "warn", words, where=where, remedy=remedy)]
    if step is None and assume:
        message = "unit of time not declared; taken as s, as --assume-units says"
        return "s", [Check.of("S04", "warn", message, where=where, remedy="write it in the recipe")]
    rates = [f"{unit} ({rate:.4g} Hz)" for unit, rate in _plausible(median).items()]
    options = ", ".join(rates) or "none plausible"
    message = f"unit of time not declared; its step of {median:.6g} could be: {options}"
    raise InputRejected("S08", message, where=where, remedy="add unit or rate to [time]")


def _refuse_implausible(
    median: float, factor: float, unit: str, step: float | None, where: str
) -> None:
    found = 1.0 / (median * factor)
    if step is not None and abs(median * factor / step - 1.0) >= CLOCK.near:
        fits = _fitting(median, step)
        hint = f"; in {fits[0]} it would fit" if fits else ""
        message = f"time in {unit} makes {found:.6g} Hz, but {1 / step:.6g} Hz is declared{hint}"
        remedy = "correct unit or rate in [time]"
        raise InputRejected("S08", message, where=where, remedy=remedy)
    if step is None and not CLOCK.slowest / 10 <= found <= 10 * CLOCK.fastest:
        right = " or ".join(_plausible(median)) or "a sample index"
        message = f"time in {unit} makes {found:.6g} Hz; {right} looks right"
        remedy = "correct the unit in [time], or add the rate to confirm it"
        raise InputRejected("S08", message, where=where, remedy=remedy)


@dataclass(frozen=True)
class Clock:
    """Columns whose sum is the time, and the unit of each as far as it is known ("" where not)."""

    columns: tuple[str, ...]
    units: tuple[str, ...]
    values: Array  # (samples,) in the unit of the only column, or [s] of two

    @property
    def paired(self) -> bool:
        return len(self.columns) > 1


def find_clock(table: RawTable, groups: Sequence[Group]) -> Clock | None:
    """Return the clock of the recording; None where no column rises like one.

    Columns named a time come first, then unnamed ones with even steps, then counters.

    Raises:
        InputRejected: T01, the only column of time runs backwards.
    """
    of = {column: group.quantity for group in groups for column in group.columns}
    times, plain, counters = (
        [c for c in table.columns if of.get(c) == kind] for kind in ("time", "", "index")
    )

    def single(column: str) -> Clock:
        unit = own_units([column], table)[0] or ""
        return Clock((column,), (unit,), counted_on(table.columns[column])[0])

    def unevenness(values: Array) -> float:
        steps = np.diff(values)
        return float(np.std(steps) / max(abs(float(np.mean(steps))), 1e-300))

    pairs = [_pair(table, *pair, named=True) for pair in itertools.pairwise(times)]
    found = [clock for clock in pairs if clock]
    found += [single(c) for c in times if _rises(table.columns[c])]
    if not found and (backwards := [c for c in times if _rises(-table.columns[c])]):
        message = "falls from row to row: the newest row is first"
        where = f"{table.source}, column '{backwards[0]}'"
        remedy = "sort the rows by it, the oldest first"
        raise InputRejected("T01", message, where=where, remedy=remedy)
    if found:
        uneven = [unevenness(clock.values) for clock in found]
        best = 2.0 * min(uneven) + CLOCK.rounding
        return next(c for c, u in zip(found, uneven, strict=True) if u <= best)
    if plain[2:] and (clock := _pair(table, plain[0], plain[1], named=False)):
        return clock
    columns = {c: table.columns[c] for c in (plain[:2] if [*table.columns][2:] else [])}
    even = [c for c, x in columns.items() if (np.diff(x) > 0).all() and unevenness(x) < CLOCK.even]
    if even:
        return single(min(even, key=lambda c: _counts(table.columns[c])))
    counted = next((c for c in counters if _rises(table.columns[c])), None)
    if counted is None:
        return None
    by_one = np.median(np.diff(table.columns[counted])) == 1.0  # KUKA's IPOC counts ms
    return Clock((counted,), ("sample" if by_one else "",), table.columns[counted])


def _rises(values: Array) -> bool:
    """Return whether a column rises like a clock, unlike a fraction of a second."""
    steps = np.diff(values)
    fall = float(-steps.min()) if steps.size and steps.min() < 0 else math.nan
    again = any(abs(fall / full - 1.0) < CLOCK.again for full in (1e3, 1e6, 1e9))
    return float(np.mean(steps > 0)) > CLOCK.rising and not (again and values.min() >= 0.0)


def _counts(values: Array) -> bool:
    """Return whether a column is 0, 1, 2, … or 1, 2, 3, …"""
    return values[0] in (0.0, 1.0) and float(np.mean(np.diff(values) == 1.0)) > CLOCK.rising


def _pair(table: RawTable, whole: str, fraction: str, named: bool) -> Clock | None:
    """Return the clock of whole seconds and a fraction of them, where together they rise."""
    a, b = table.columns[whole], table.columns[fraction]
    if (a != np.round(a)).any() or (b < 0).any() or (b != np.round(b)).any() or _rises(a):
        return None
    second = re.compile(r"(nano|micro|milli|n|u|m)?s(ec(ond)?s?)?|tv")
    stems = [[w for w in words_of(name) if not second.fullmatch(w)] for name in (whole, fraction)]
    if named and stems[0] != stems[1]:
        return None
    unit = read_name(fraction).unit if named else ""
    for candidate in (unit,) if unit in _COMMON[1:] else ("ns", "us", "ms"):
        full = 1.0 / SECONDS[candidate]
        if b.max() >= full or (not unit and 2.0 * b.max() < full):
            continue
        values = (a - a[0]) + b * SECONDS[candidate]
        if _rises(values):
            return Clock((whole, fraction), ("s", candidate), values)
    return None


def guess_unit(
    clock: Clock,
    q: Array | None,
    slope: Slope | None,
    notes: Sequence[str],
    stated: Statement | None,
) -> Guess:
    """Return the unit of a clock, with the reason.

    Args:
        q: (samples, joints) positions in any unit.
        slope: relation of a recorded velocity to the positions, per recorded unit of time.
        notes: lines of the file, that may state the unit.
        stated: the rate that the file states.
    """
    median, own = median_step(clock.values), clock.units[0]
    if clock.paired:
        rise = f"rise by {median:.4g} s, {1 / median:.4g} Hz"
        return Guess("s", "sure", f"whole seconds and {clock.units[1]} together {rise}")
    if own == "sample":
        return Guess("sample", "likely", "named a counter: the rate is not in the file")
    if own and own not in SECONDS:
        return unsure(f"its name or header says '{own}': s, ms, us or ns?")
    if not own and (ticks := stated_scale(notes, "time")):
        return unsure(f"the file states '{ticks[0].words}'")
    said = stated_unit(notes, "time") if not own else None
    named = own or (said.value if said else "")
    rates = {unit: 1.0 / (median * seconds) for unit, seconds in SECONDS.items()}
    low, high = CLOCK.slowest, CLOCK.unnamed_fastest
    ratios = {unit: slope.factor / SECONDS[unit] for unit in _COMMON} if slope else {}
    agrees = [unit for unit, r in ratios.items() if units_of_ratio(r, CLOCK.same_rate)]
    if named and 0.1 * low <= rates[named] <= 10.0 * high:
        why = "named so" if said is None else f"the file states {said.words}"
        why += f", and a median step of {median:.4g} makes {rates[named]:.4g} Hz"
        clues = [Clue(named, SCORES.sure if own else SCORES.stated, why)]
        problem = ""
        if agrees and named not in agrees:
            others = " or ".join(agrees)
            problem = f"the recorded velocity is the slope of the position in {others}"
        elif rates[named] < low and q is not None and not _paced(named, clock.values, q):
            problem = f"that makes {rates[named]:.4g} Hz, and a motion too slow for a robot"
        if problem:
            return unsure(f"its name or header says '{named}', but {problem}")
    else:
        clues = _clues_by_numbers(clock.values, q, agrees, rates)
    if stated is not None and not own:
        words = f"a median step of {median:.4g}, and the file states {stated.words}"
        periods = {unit: stated.number / rate for unit, rate in rates.items()}
        fits = [unit for unit, x in periods.items() if abs(x - 1.0) < CLOCK.same_rate]
        counted = median == 1.0 and math.isfinite(stated.number)
        value = fits[0] if len(fits) == 1 else "sample" if counted else OTHER
        clues.append(Clue(value, SCORES.stated, words))
    return weigh(clues)


def _clues_by_numbers(
    stamps: Array, q: Array | None, agrees: Sequence[str], rates: dict[str, float]
) -> list[Clue]:
    """Return the clues of rate, pace and velocity to the unit of a clock without one."""
    median, low, high = median_step(stamps), CLOCK.slowest, CLOCK.unnamed_fastest
    plausible = [unit for unit, rate in rates.items() if low <= rate <= high]
    since = [
        (unit, year)
        for unit, year, offset in _EPOCHS
        if unit in plausible
        and CLOCK.from_2001 < stamps[0] * SECONDS[unit] - offset < CLOCK.to_2096
    ]
    if len({unit for unit, _ in since}) == 1:
        unit, years = since[0][0], " or ".join(year for _, year in since)
        why = f"counted since the year {years}, and a median step of {median:.4g} makes"
        return [Clue(unit, SCORES.sure, f"{why} {rates[unit]:.4g} Hz")]
    fits = [unit for unit in plausible if unit in _COMMON]
    paced = [unit for unit in fits if q is None or _paced(unit, stamps, q)]
    would = " or ".join(f"{rates[unit]:.4g} Hz in {unit}" for unit in fits)
    why = f"a median step of {median:.4g} would be {would or 'no plausible rate'}"
    if len(paced) < len(fits):
        why += "; the pace of the motion leaves " + (" or ".join(paced) or "none")
    clues = [Clue(unit, SCORES.plausible, why) for unit in paced] or [Clue(OTHER, 0.0, why)]
    agreeing = [unit for unit in paced if unit in agrees]
    if len(agreeing) == 1:
        clues.append(Clue(agreeing[0], SCORES.fits, "the recorded velocity agrees"))
    elif len(paced) == 1:
        clues.append(Clue(paced[0], SCORES.fits))
    if _counts(stamps) and len(agreeing) != 1:
        also = '0, 1, 2, … may also count samples: then unit = "sample" and rate = … [Hz]'
        clues.append(Clue("sample", SCORES.plausible, also))
        clues += [Clue(unit, -SCORES.fits) for unit in paced]
    return clues


def _paced(unit: str, t: Array, q: Array) -> bool:
    """Return whether the largest mean speed over a hundredth of the log is a robot's in a unit."""
    span = float(np.ptp(q, axis=0).max())
    width = max(1, t.size // 100)
    elapsed = t[width:] - t[:-width]
    moved = np.abs(q[width:] - q[:-width]).max(axis=1)
    good = elapsed > 0
    if span == 0.0:
        return True
    pace = float((moved[good] / elapsed[good]).max()) / span if good.any() else 0.0
    return CLOCK.slowest_pace <= pace / SECONDS[unit] <= CLOCK.fastest_pace
