"""Turn the time of a recording into seconds: a column of any unit, two that are added, or a rate.

The unit is the recipe's, the header's, or the only one that fits the declared rate.
"""

from __future__ import annotations

import math

import numpy as np

from pipelines.errors import Check, InputRejected
from pipelines.importers.config import CLOCK
from pipelines.importers.names import quantity_of
from pipelines.importers.raw import RawTable
from pipelines.importers.recipe import TimeSpec
from pipelines.io.log import Array
from pipelines.io.units import UNITS, canonical_unit, to_si

SECONDS = {unit: UNITS[unit].factor for unit in ("s", "ms", "us", "ns")}
_INDEX = ("sample", "samples", "index")


def time_of(table: RawTable, spec: TimeSpec, assume: bool = False) -> tuple[Array, list[Check]]:
    """Return time stamps [s], NaN where one is missing.

    Raises:
        InputRejected: S08 where unit and rate contradict each other or leave the unit open, T08
            without samples.
    """
    step = spec.sample_time or (1.0 / spec.rate if spec.rate is not None else None)
    if spec.column is None:  # the recipe was checked: then there is a rate
        return table.rows * np.float64(step or math.nan), []
    names = [table.name_of(column, "t") for column, _ in spec.parts]
    where = f"{table.source}, column{'s' * (len(names) > 1)} '{', '.join(names)}'"
    total, checks = np.zeros(table.rows.size), list[Check]()
    for name, (_, declared) in zip(names, spec.parts, strict=True):
        stamps = table.columns[name]
        finite = stamps[np.isfinite(stamps)]
        rising = np.diff(finite)[np.diff(finite) > 0]
        if finite.size <= 1 or (not rising.size and not names[1:]):
            message = f"{finite.size} time stamp{'s' * (finite.size != 1)}, none later than another"
            raise InputRejected("T08", message, where, "record again, or another column")
        median = float(np.median(rising)) if rising.size else 1.0
        if names[1:] and declared is None:
            remedy = 'give [time] one unit a column: unit = ["s", "ns"]'
            raise InputRejected("S08", "no unit", where, remedy)
        unit = declared or table.units.get(name) or _only_unit(median, step, where, assume, checks)
        _refuse_other_unit(declared, table.units.get(name), where)
        if unit in _INDEX and step is None:
            message = "time is a sample index, but no rate is declared"
            raise InputRejected("S08", message, where, "add rate = … [Hz] to [time]")
        factor = step if unit in _INDEX and step else to_si(unit, "time", where=where).factor
        # An epoch: seconds since 1970 cost digits.
        origin = finite[0] if abs(finite[0]) > CLOCK.epoch * median * finite.size else 0.0
        if origin:
            message = f"time starts at {origin:.16g} {unit}; counted from there"
            checks.append(Check.of("S08", "ok", message, where))
        total += (stamps - origin) * factor
        if not names[1:]:
            _refuse_implausible(median, factor, unit, step, where)
    return total, checks


def plausible(median: float) -> dict[str, float]:
    """Return the units in which a median step gives a rate that robots are recorded at [Hz]."""
    rates = {unit: 1.0 / (median * factor) for unit, factor in SECONDS.items()}
    return {unit: rate for unit, rate in rates.items() if CLOCK.slowest <= rate <= CLOCK.fastest}


def _fitting(median: float, step: float) -> list[str]:
    """Return the units in which a median step is the declared one [s]."""
    fits = [u for u, factor in SECONDS.items() if abs(median * factor / step - 1.0) < CLOCK.near]
    return fits or (["sample"] if median == 1.0 else [])


def _refuse_other_unit(declared: str | None, header: str | None, where: str) -> None:
    """S08: refuse a header that says another unit of time than the recipe."""
    known, said = canonical_unit(header or ""), canonical_unit(declared or "")
    other = said in _INDEX or (said in UNITS and UNITS.get(known) != UNITS[said])
    if declared and quantity_of(known) == "time" and other:
        message = f"the header says '{header}', the recipe says '{declared}'"
        remedy = "correct one of them: the unit in [time], or the header"
        raise InputRejected("S08", message, where, remedy)


def _only_unit(
    median: float, step: float | None, where: str, assume: bool, checks: list[Check]
) -> str:
    """S08: return the only unit in which the steps of time are the declared ones [s]."""
    fits = _fitting(median, step) if step is not None else []
    if step is not None and len(fits) == 1:
        message = f"unit of time not declared; {fits[0]} fits the declared rate of "
        remedy = f'add unit = "{fits[0]}" to [time]'
        checks.append(Check.of("S08", "warn", f"{message}{1 / step:.6g} Hz", where, remedy))
        return fits[0]
    if step is None and assume:
        message = "unit of time not declared; taken as s, as --assume-units says"
        checks.append(Check.of("S04", "warn", message, where, "write it in the recipe"))
        return "s"
    rates = ", ".join(f"{unit} ({rate:.4g} Hz)" for unit, rate in plausible(median).items())
    message = f"unit of time not declared; its step of {median:.6g} could be: "
    raise InputRejected("S08", message + (rates or "none"), where, "add unit or rate to [time]")


def _refuse_implausible(
    median: float, factor: float, unit: str, step: float | None, where: str
) -> None:
    found = 1.0 / (median * factor)
    if step is not None and abs(median * factor / step - 1.0) >= CLOCK.near:
        hint = "".join(f"; in {fits} it would fit" for fits in _fitting(median, step)[:1])
        message = f"time in {unit} makes {found:.6g} Hz, but {1 / step:.6g} Hz is declared{hint}"
        raise InputRejected("S08", message, where, "correct unit or rate in [time]")
    if step is None and not CLOCK.slowest / 10 <= found <= 10 * CLOCK.fastest:
        right = " or ".join(plausible(median)) or "a sample index"
        message = f"time in {unit} makes {found:.6g} Hz; {right} looks right"
        remedy = "correct the unit in [time], or add the rate to confirm it"
        raise InputRejected("S08", message, where, remedy)
