"""Read a recipe and check it: unknown keys with their neighbours, values with their bounds, units and rates with their sense."""

from __future__ import annotations

import datetime
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from pipelines.errors import Gathering, InputRejected, UsageError, did_you_mean
from pipelines.log import schema
from pipelines.log.recording.recipe import (
    ColumnSpec,
    ControllerSpec,
    DriveSpec,
    FileSpec,
    LogSpec,
    MissingSpec,
    Recipe,
    ResampleSpec,
    SignalSpec,
    TableSpec,
    TextFormat,
    TimeSpec,
)
from pipelines.log.shipped import shipped
from pipelines.log.toml_text import parse_toml

__all__ = ["BLANK", "find_recipe", "parse_recipe"]

BLANK = "FILL IN"  # stands in a drafted recipe where nothing in the recording could tell


def find_recipe(source: str | Path) -> Path:
    """The recipe file of that path, or the shipped recipe of that bare name."""
    path = Path(source)
    return path if path.exists() else shipped("recipes", str(source))


def parse_recipe(text: str, where: object = "") -> Recipe:
    """Read and check a recipe.

    Raises:
        UsageError: C01 unknown key or not TOML, C02 a value out of its bounds.
        InputRejected: S04 a signal without unit, S09 a rate that is a period, S10 current without torque constant.
    """
    from pydantic import TypeAdapter, ValidationError

    try:
        table = _dated(parse_toml(text), where)
    except (ValueError, RecursionError) as problem:
        message = f"the recipe is not valid TOML: {problem}"
        remedy = "correct that line; strings need quotes, tables [ ]"
        raise UsageError("C01", message, where=where, remedy=remedy) from None
    _blanks(table, where)
    if "where" in table:
        raise UsageError("C01", "'where' is not a key of a recipe", where=where, remedy="remove it")
    try:
        recipe = TypeAdapter(Recipe).validate_json(json.dumps(_plain(table)), strict=True)
    except ValidationError as problem:
        found = Gathering()
        # A value that may be of several types is complained of once a type: the first will do.
        places = {str(_place(error)): error for error in reversed(problem.errors())}
        found.found += [_explain(error, where) for error in reversed(places.values())]
        found.raise_all()
        raise  # never reached: there is an error at least
    except RecursionError:
        message = "the recipe is nested too deeply"
        remedy = "rrrid import --guess FILE drafts a recipe"
        raise UsageError("C02", message, where=where, remedy=remedy) from None
    _bounds(recipe, where)
    _format(recipe.format, where)
    _meaning(recipe, where)
    return recipe


def _blanks(table: dict[str, Any], where: object) -> None:
    """C02: what --guess could not know and nobody has filled in."""
    if blanks := [place for place, text in _texts(table, "") if BLANK in text.upper()]:
        more = f" and at {', '.join(blanks[1:6])}" if len(blanks) > 1 else ""
        message = f"'{blanks[0]}' is still marked {BLANK}"
        remedy = f"replace the blank marked {BLANK} at {blanks[0]}{more}; the draft says what belongs there"
        raise UsageError("C02", message, where=where, remedy=remedy)


def _texts(value: Any, path: str) -> Iterator[tuple[str, str]]:
    """(place, text) of every text in the recipe."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _texts(item, f"{path}.{key}".lstrip("."))
    elif isinstance(value, list):
        for i, item in enumerate(value, start=1):
            yield from _texts(item, f"{path}[{i}]")
    elif isinstance(value, str):
        yield path, value


def _plain(value: Any) -> Any:
    """TOML's own dates as text, for the type check to complain of; everything else is JSON already."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return str(value) if isinstance(value, datetime.date | datetime.time) else value


def _dated(table: dict[str, Any], where: object) -> dict[str, Any]:
    """The recipe with `recorded` of [log] and of every [[file]] as UTC, in text."""
    cases = table["file"] if isinstance(table.get("file"), list) else []
    for place, owner in (
        ("log", table.get("log")),
        *((f"file[{i}]", case) for i, case in enumerate(cases, start=1)),
    ):
        if isinstance(owner, dict) and "recorded" in owner:
            owner["recorded"] = _utc(owner["recorded"], f"'{place}.recorded'", where)
    return table


def _utc(value: object, what: str, where: object) -> str:
    """A time as UTC. One without its offset is another hour in every country: nobody may guess which.

    Raises:
        UsageError: C02, no time, or no offset.
    """
    remedy = (
        "write it with its offset from UTC, 2024-05-17T11:30:00+02:00, or with Z, or leave it out"
    )
    try:
        time = (
            value
            if isinstance(value, datetime.datetime)
            else datetime.datetime.fromisoformat(str(value))
        )
    except ValueError:
        message = f"{what} is '{value}', not a date and time of ISO 8601"
        raise UsageError("C02", message, where=where, remedy=remedy) from None
    if time.tzinfo is None:
        message = f"{what} is {value}: the offset from UTC is missing"
        raise UsageError("C02", message, where=where, remedy=remedy)
    return time.astimezone(datetime.UTC).isoformat().replace("+00:00", "Z")


def _place(error: Any) -> list[Any]:
    """Return the keys that lead to the value of a complaint, without the types that pydantic tried."""
    return [
        part
        for part in error["loc"]
        if not (isinstance(part, str) and ("[" in part or part in ("str", "int", "float")))
    ]


_SECTIONS: Mapping[str, type] = {
    "log": LogSpec,
    "file": FileSpec,
    "time": TimeSpec,
    "signals": SignalSpec,
    "drive": DriveSpec,
    "resample": ResampleSpec,
    "missing": MissingSpec,
    "format": TextFormat,
    "controller": ControllerSpec,
    "table": TableSpec,
}


def _explain(error: Any, where: object) -> UsageError:
    """The first complaint of pydantic in our words, with the key it is about."""
    path = _place(error)
    place = ".".join(
        f"[{part + 1}]" if isinstance(part, int) else str(part) for part in path
    ).replace(".[", "[")
    if error["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        kind = (
            Recipe
            if len(path) == 1
            else ColumnSpec
            if "columns" in path[:-1]
            else _SECTIONS[str(path[0])]
        )
        known = [f.name for f in fields(kind) if f.name != "where"]
        message = f"'{place}' is not a key of a recipe{did_you_mean(str(path[-1]), known)}"
        return UsageError("C01", message, where=where, remedy=f"known here: {', '.join(known)}")
    if error["type"] in ("missing", "missing_argument"):
        remedy = "rrrid import --guess FILE drafts a recipe"
        return UsageError("C02", f"'{place}' is missing", where=where, remedy=remedy)
    message = f"'{place}': {error['msg']}, not {error['input']!r}"
    remedy = "correct the value; the module recipe.py lists the keys"
    return UsageError("C02", message, where=where, remedy=remedy)


_LARGEST = 1e12
# Numbers that must be finite and above a bound.
_POSITIVE = (
    "rate",
    "sample_time",
    "longest_gap",
    "counts_per_rev",
    "wrap",
    "period",
    "torque_constant",
)


def _numbers(owner: object, path: str) -> Iterator[tuple[str, str, float]]:
    """(place, key, number) of every number in the recipe, lists taken apart."""
    for item in fields(owner) if is_dataclass(owner) else ():
        yield from _below(getattr(owner, item.name), f"{path}.{item.name}".lstrip("."), item.name)


def _below(value: object, path: str, key: str) -> Iterator[tuple[str, str, float]]:
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _below(inner, f"{path}.{name}", str(name))
    elif isinstance(value, tuple):
        for i, inner in enumerate(value):
            yield from _below(inner, f"{path}[{i + 1}]", key)
    elif is_dataclass(value):
        yield from _numbers(value, path)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        try:
            yield path, key, float(value)
        except OverflowError:  # an integer of hundreds of digits
            yield path, key, math.inf


def _bounds(recipe: Recipe, where: object) -> None:
    """C02: every number finite and inside its bounds."""
    for path, key, number in _numbers(recipe, ""):
        if path.startswith(("robot.", "missing.")):
            continue
        if not math.isfinite(number):
            message = f"'{path}' is {number}, must be a finite number"
            raise UsageError("C02", message, where=where, remedy="correct the number")
        if abs(number) > _LARGEST:
            message = f"'{path}' is {number}, must lie within ±{_LARGEST:g}"
            remedy = "correct the number, or use another unit"
            raise UsageError("C02", message, where=where, remedy=remedy)
        if key in _POSITIVE and number <= 0.0:
            message = f"'{path}' is {number}, must be above 0"
            raise UsageError("C02", message, where=where, remedy="correct the number")
        if key == "sign" and abs(number) != 1.0:
            message = f"'{path}' is {number}, must be 1 or -1"
            raise UsageError("C02", message, where=where, remedy="use scale for other factors")
        if key in ("joint", "column", "columns") and (number < 1 or number != int(number)):
            message = f"'{path}' is {number}, must be 1 or more"
            raise UsageError("C02", message, where=where, remedy="joints and columns count from 1")


def _format(form: TextFormat | None, where: object) -> None:
    """C02: delimiter, decimal sign, encoding and comment are such that a text can have."""
    if form is None:
        return
    wrong = {
        "delimiter": bool(form.delimiter)
        and (
            len(str(form.delimiter)) != 1
            or str(form.delimiter) in "\0\r\n.\"'"
            or str(form.delimiter).isalnum()
        ),
        "decimal": form.decimal not in (None, ".", ","),
        "encoding": form.encoding is not None and not _known_encoding(form.encoding),
        "comment": form.comment is not None
        and (not form.comment or any(c in form.comment for c in "\0\r\n")),
    }
    remedies = {
        "delimiter": "one character: , ; tab or blank",
        "decimal": "'.' or ','",
        "encoding": "for example utf-8 or latin-1",
        "comment": "the characters that begin a comment",
    }
    for key, bad in wrong.items():
        if bad:
            message = f"'format.{key}' is {getattr(form, key)!r}"
            raise UsageError("C02", message, where=where, remedy=f"give {remedies[key]}")


def _known_encoding(name: str) -> bool:
    try:
        "0".encode(name)
    except (LookupError, ValueError, TypeError):
        return False
    return True


def _meaning(recipe: Recipe, where: object) -> None:
    """What single values cannot show: signals known, units given, rates that are rates."""
    known = [name for name in schema.SIGNALS if name != "t"]
    for name, spec in recipe.signals.items():
        if name not in known:
            message = f"'signals.{name}' is not a signal{did_you_mean(name, known)}"
            remedy = f"signals: {', '.join(known)}; time has its own table [time]"
            raise UsageError("C01", message, where=where, remedy=remedy)
        if (spec.columns is None) == (spec.column is None):
            message = f"'signals.{name}' needs columns (a list, a pattern or a name), once"
            remedy = 'write columns = "q_{j}", or columns = ["a", "b", "c"]'
            raise UsageError("C02", message, where=where, remedy=remedy)
        if (
            "counts" in (spec.unit if isinstance(spec.unit, tuple) else (spec.unit,))
            and spec.counts_per_rev is None
        ):
            message = f"'signals.{name}' is in counts: counts_per_rev is missing"
            raise UsageError("C02", message, where=where, remedy="add counts_per_rev")
    references = [name for name in ("q_ref", "dq_ref", "ddq_ref") if name in recipe.signals]
    if len(references) not in (0, 3):
        message = f"{', '.join(references)} alone: q_ref, dq_ref and ddq_ref come together"
        raise UsageError("C02", message, where=where, remedy="map all three, or none")
    no_logs = not recipe.log.match and not any(not case.skip for case in recipe.file)
    if no_logs and recipe.table:
        return  # maps alone: no clock, no signals
    for name in ("q", "tau"):
        if name not in recipe.signals:
            message = f"the recipe maps no signal '{name}'"
            remedy = f"add {name} = {{ columns = …, unit = … }} to [signals]"
            raise InputRejected("S01", message, where=where, remedy=remedy)
    rates = {
        "time.rate": recipe.time.rate,
        "resample.rate": recipe.resample.rate if recipe.resample else None,
    }
    for place, rate in rates.items():
        if rate is not None and rate < 1.0:
            message = f"{place} is {rate:g} Hz: a period?"
            remedy = f"a period of {rate:g} s is a rate of {1 / rate:g} Hz"
            raise InputRejected("S09", message, where=where, remedy=remedy)
    if recipe.time.sample_time is not None and recipe.time.sample_time > 1.0:
        message = f"time.sample_time is {recipe.time.sample_time:g} s: a rate?"
        remedy = f"write rate = {recipe.time.sample_time:g}"
        raise InputRejected("S09", message, where=where, remedy=remedy)
    parts = recipe.time.column if isinstance(recipe.time.column, tuple) else ()
    if isinstance(recipe.time.unit, tuple) and len(recipe.time.unit) != len(parts):
        message = (
            f"'time.unit' holds {len(recipe.time.unit)} units for {max(1, len(parts))} columns"
        )
        remedy = 'give one unit a column: column = ["sec", "nanosec"], unit = ["s", "ns"]'
        raise UsageError("C02", message, where=where, remedy=remedy)
    if recipe.time.rate is not None and recipe.time.sample_time is not None:
        remedy = "give one of them"
        raise UsageError("C02", "'time' has both rate and sample_time", where=where, remedy=remedy)
    if recipe.time.column is None and recipe.time.rate is None and recipe.time.sample_time is None:
        remedy = "give the column of the time stamps, or the sampling rate [Hz]"
        raise UsageError("C02", "'time' has neither column nor rate", where=where, remedy=remedy)
    if no_logs:
        remedy = 'write match = "*.csv" in [log], or [[file]] cases'
        raise UsageError("C02", "the recipe matches no files", where=where, remedy=remedy)
