"""Find out what the time of a recording is: seconds from a column of any unit, or from a declared rate."""

from __future__ import annotations

import math

import numpy as np

from pipelines.errors import Check, InputRejected
from pipelines.log.experiment import Array
from pipelines.log.recording.raw import RawTable
from pipelines.log.recording.recipe import TimeSpec
from pipelines.log.units import UNITS, canonical_unit, to_si

__all__ = ["counted_on", "declared_step", "plausible_units", "time_of"]

_NEAR = 0.2  # a rate within a fifth of the declared one is the declared one
_FASTEST, _SLOWEST = 1e5, 1.0  # [Hz] what robots are recorded at
_UNITS = {unit: UNITS[unit].factor for unit in ("s", "ms", "us", "ns")}


_FULL = (
    *(
        2.0**bits * unit for bits in (16, 24, 32) for unit in (1.0, 1e-3, 1e-6)
    ),  # counters of so many bits, some in s
    *(86400.0 * unit for unit in (1.0, 1e3, 1e6, 1e9)),
)  # and of a day


def counted_on(stamps: Array) -> tuple[Array, float]:
    """Return time stamps that go on where their counter starts again, and its range; 0 where it does not start again.

    It falls by its whole range less a step or a few: a clock that was set back by chance does not.
    """
    steps = np.diff(stamps)
    falls, rises = steps[steps < 0], steps[steps > 0]
    if not falls.size or not rises.size or np.nanmin(stamps) < 0.0:
        return stamps, 0.0
    near = 3.0 * float(np.median(rises))
    fits = [
        full
        for full in _FULL
        if np.nanmax(stamps) < full and ((falls + full > 0.0) & (falls + full <= near)).all()
    ]
    full = fits[0] if fits else 0.0
    return stamps + full * np.concatenate([[0.0], np.cumsum(steps < 0)]), full


def declared_step(spec: TimeSpec) -> float | None:
    """The sampling period a recipe declares. [s]"""
    return (
        spec.sample_time
        if spec.sample_time is not None
        else None
        if spec.rate is None
        else 1.0 / spec.rate
    )


def time_of(table: RawTable, spec: TimeSpec, assume: bool = False) -> tuple[Array, list[Check]]:
    """Time stamps [s], NaN where one is missing.

    Raises:
        InputRejected: S08 where unit and rate contradict each other or leave the unit open, T08 without samples.
    """
    step = declared_step(spec)
    if spec.column is None:  # the recipe was checked: then there is a rate
        return table.rows * np.float64(step or math.nan), []
    if len(spec.parts) > 1:
        return _summed(table, spec, step)
    column, declared = spec.parts[0]
    name = table.name_of(column, "t")
    where = f"{table.source}, column '{name}'"
    stamps = table.columns[name].copy()
    known = np.isfinite(stamps)
    stamps[known], full = counted_on(stamps[known])
    finite = stamps[known]
    steps = np.diff(finite)
    steps = steps[steps > 0]
    if finite.size < 2 or steps.size == 0:
        message = (
            f"{finite.size} time stamp{'s' if finite.size != 1 else ''}, none later than another"
        )
        raise InputRejected("T08", message, where=where, remedy="record again")
    median = float(np.median(steps))
    unit = declared or table.units.get(name)
    checks: list[Check] = []
    if full:
        message = f"the counter of time starts again after {full:.10g}: counted on"
        remedy = "none needed, unless the clock was set back by just so much"
        checks.append(Check.of("S08", "warn", message, where=where, remedy=remedy))
    if unit is None:
        unit = _detected(median, step, where, assume, checks)
    elif declared and (other := table.units.get(name)) and _contradict(other, declared):
        message = f"the header says '{other}', the recipe says '{declared}'"
        remedy = "correct one of them: the unit in [time], or the header"
        raise InputRejected("S08", message, where=where, remedy=remedy)
    elif not declared:
        message = f"unit '{unit}' of time taken from the header"
        checks.append(Check.of("S06", "ok", message, where=where))
    factor = _factor(unit, step, where)
    _plausible(median, factor, unit, step, where)
    origin = (
        finite[0] if abs(finite[0]) > 1e6 * median * finite.size else 0.0
    )  # an epoch: seconds since 1970 cost digits
    if origin:
        message = f"time starts at {finite[0]:.16g} {unit}; counted from there"
        checks.append(Check.of("S08", "ok", message, where=where))
    return (stamps - origin) * factor, checks


def _summed(table: RawTable, spec: TimeSpec, step: float | None) -> tuple[Array, list[Check]]:
    """The sum of several columns [s], each counted from its own first stamp where it is large: no digit of the fraction is lost."""
    total = np.zeros(table.rows.size)
    for column, unit in spec.parts:
        name = table.name_of(column, "t")
        stamps = table.columns[name]
        finite = stamps[np.isfinite(stamps)]
        if unit is None or finite.size < 2:
            message = "no unit" if unit is None else "no time stamps"
            remedy = 'give [time] one unit a column: unit = ["s", "ns"]'
            raise InputRejected(
                "S08", message, where=f"{table.source}, column '{name}'", remedy=remedy
            )
        factor = to_si(unit, "time", where=f"{table.source}, column '{name}'").factor
        total += (stamps - (finite[0] if abs(finite[0]) * factor > 1e6 else 0.0)) * factor
    where = f"{table.source}, columns {', '.join(str(column) for column, _ in spec.parts)}"
    steps = np.diff(total[np.isfinite(total)])
    if not (steps > 0).any():
        message = "no time stamp is later than another"
        raise InputRejected("T08", message, where=where, remedy="choose other columns of time")
    _plausible(float(np.median(steps[steps > 0])), 1.0, "s", step, where)
    return total, []


def _contradict(header: str, declared: str) -> bool:
    """Return whether two units of time differ; a header that names none of them says nothing."""
    header, declared = canonical_unit(header), canonical_unit(declared)
    known = header in UNITS and UNITS[header].quantity == "time"
    if declared in ("sample", "samples", "index"):
        return known
    return known and declared in UNITS and UNITS[header] != UNITS[declared]


def _factor(unit: str, step: float | None, where: str) -> float:
    if unit in ("sample", "samples", "index"):
        if step is None:
            message = "time is a sample index, but no rate is declared"
            raise InputRejected("S08", message, where=where, remedy="add rate = … [Hz] to [time]")
        return step
    return to_si(unit, "time", where=where).factor


def plausible_units(median: float) -> list[str]:
    """The units in which a median step gives a rate that robots are recorded at."""
    return [
        unit for unit, factor in _UNITS.items() if _SLOWEST <= 1.0 / (median * factor) <= _FASTEST
    ]


def _fitting(median: float, step: float) -> list[str]:
    fits = [unit for unit, factor in _UNITS.items() if abs(median * factor / step - 1.0) < _NEAR]
    return fits or (["sample"] if abs(median - 1.0) < 1e-9 else [])


def _detected(
    median: float, step: float | None, where: str, assume: bool, checks: list[Check]
) -> str:
    """S08: the unit of time stamps that nobody declared, where only one is possible."""
    if step is not None:
        fits = _fitting(median, step)
        if len(fits) == 1:
            message = (
                f"unit of time not declared; {fits[0]} fits the declared rate of {1 / step:.6g} Hz"
            )
            remedy = f'add unit = "{fits[0]}" to [time]'
            checks.append(Check.of("S08", "warn", message, where=where, remedy=remedy))
            return fits[0]
    elif assume:
        message = "unit of time not declared; taken as s, as --assume-units says"
        remedy = "write the unit in the recipe"
        checks.append(Check.of("S04", "warn", message, where=where, remedy=remedy))
        return "s"
    options = (
        ", ".join(
            f"{unit} ({1 / (median * _UNITS[unit]):.4g} Hz)" for unit in plausible_units(median)
        )
        or "none plausible"
    )
    message = f"unit of time not declared; its step of {median:.6g} could be: {options}"
    raise InputRejected("S08", message, where=where, remedy="add unit or rate to [time]")


def _plausible(median: float, factor: float, unit: str, step: float | None, where: str) -> None:
    found = 1.0 / (median * factor)
    if step is not None and abs(median * factor / step - 1.0) >= _NEAR:
        fits = _fitting(median, step)
        hint = f"; in {fits[0]} it would fit" if fits else ""
        message = f"time in {unit} makes {found:.6g} Hz, but {1 / step:.6g} Hz is declared{hint}"
        raise InputRejected("S08", message, where=where, remedy="correct unit or rate in [time]")
    if step is None and not _SLOWEST / 10 <= found <= 10 * _FASTEST:
        options = plausible_units(median)
        message = f"time in {unit} makes {found:.6g} Hz; {' or '.join(options) or 'a sample index'} looks right"
        remedy = "correct the unit in [time], or add the rate to confirm it"
        raise InputRejected("S08", message, where=where, remedy=remedy)
