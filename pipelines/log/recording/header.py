"""Find the names and units of a text table's columns in the lines above its numbers.

A line is data where every column that holds numbers further down holds one in it, too. The lines
above the first such line, comments included, are searched for one name a column: a plain line
before a comment, the table's own delimiter before another, the nearest before one further up. A
line of units below the names is read as such.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pipelines.errors import InputRejected
from pipelines.log.experiment import Array
from pipelines.log.recording.dialect import MISSING, Dialect, cells_of, holds_number, is_number
from pipelines.log.recording.vocabulary import narrow_signs
from pipelines.log.units import UNITS, canonical_unit

__all__ = ["FORMULA", "Header", "find_header", "names_and_units", "split_unit", "without_repeats"]

Line = tuple[int, str]

_SEARCHED = 40  # lines above the numbers
_SAMPLED = 20  # lines of numbers that say which columns are numbers
_MARKS = "#%/*! "  # what a comment begins with
_DELIMITERS = (",", ";", "\t", " ", "|")
_BEHIND_SIGN = re.compile(
    r"(.*[^\s,/])(?:,| /)\s+(\S(?:.{0,18}\S)?)"
)  # a unit as quantities and axes are labelled
_NO_UNIT = frozenset({"", "-", "1", "none", "n/a", "[]"})
FORMULA = re.compile(r"\s*(#(REF|DIV/0|N/A|NAME|VALUE|NUM|NULL)[!?]?|=.+|@.+)\s*")


@dataclass(frozen=True)
class Header:
    """Names and units of the columns, and where the numbers begin."""

    names: tuple[str, ...]
    units: dict[str, str]
    first: int  # index of the first line of data among the lines that are not comments
    skipped: int  # lines above it that are neither names nor units
    again: dict[str, str] = field(
        default_factory=dict
    )  # name given to a column -> the same name before
    line: int = 0  # of the names


def find_header(
    lines: list[Line], text: str, dialect: Dialect, source: str, has_header: bool | None
) -> Header:
    """Return the header of a table.

    Args:
        lines: (line number, line) without empty lines and comments.
        has_header: False where the recipe declares that the first line is data already.

    Raises:
        InputRejected: F16, one name more or less than columns.
    """
    width = dialect.width
    table = [
        i
        for i, (_, line) in enumerate(lines[: _SEARCHED + _SAMPLED])
        if len(cells_of(line, dialect.delimiter)) == width
    ]
    start = table[0] if table else 0
    if has_header is False:
        return _numbered(width, start)
    cells = [cells_of(lines[i][1], dialect.delimiter) for i in table]
    numeric = _numeric_columns(cells[2:] or cells[1:] or cells, dialect)
    first = next(
        (i for i, row in zip(table, cells, strict=True) if _is_data(row, numeric, dialect)),
        len(lines),
    )
    if first == len(lines) or not numeric:
        first = start + 1  # words alone: the first line names them
    number = lines[first][0] if first < len(lines) else lines[-1][0] + 1
    comments = _raw_lines_above(text, number, {n for n, _ in lines[:first]})
    above = sorted([(*line, False) for line in lines[max(0, first - _SEARCHED) : first]] + comments)
    names, units, used = _names_above(above, dialect, numeric, cells, source)
    if names is None:
        return _numbered(width, first, skipped=first)
    plain = {n for n, _ in lines[:first]}
    if len(set(names)) < width:
        names = _with_spans(names, [(n, line) for n, line, _ in above], min(used), dialect)
    named, found, again = names_and_units(names)
    found |= {
        name: unit for name, unit in zip(named, units, strict=True) if unit.lower() not in _NO_UNIT
    }
    return Header(named, found, first, len(plain - used), again, min(used))


def _numbered(width: int, first: int, skipped: int = 0) -> Header:
    return Header(tuple(f"column_{j + 1}" for j in range(width)), {}, first, skipped or first)


def _numeric_columns(rows: Sequence[Sequence[str]], dialect: Dialect) -> list[int]:
    """Return the columns of which more than half of the cells are numbers, empty ones apart."""
    columns = []
    for j in range(dialect.width):
        filled = [row[j] for row in rows if row[j] not in MISSING]
        if sum(holds_number(cell, dialect.decimal) for cell in filled) > 0.5 * len(filled):
            columns.append(j)
    return columns


def _is_data(row: Sequence[str], numeric: Sequence[int], dialect: Dialect) -> bool:
    """Tell whether `row` holds numbers where the table does; 0, 1, 2, … in order are names."""
    if len(numeric) > 2 and [row[j] for j in numeric] == [str(k) for k in range(len(numeric))]:
        return False
    filled = [row[j] for j in numeric if row[j] not in MISSING]
    return bool(filled) and all(holds_number(cell, dialect.decimal) for cell in filled)


def _raw_lines_above(text: str, number: int, known: set[int]) -> list[tuple[int, str, bool]]:
    """Return (line number, line, True) of the comments above line `number`."""
    above = text.split("\n", number)[: number - 1]
    begin = max(0, len(above) - _SEARCHED)
    return [
        (k, line.lstrip().lstrip(_MARKS).strip(), True)
        for k, line in enumerate(above[begin:], start=begin + 1)
        if line.strip() and k not in known
    ]


def _names_above(
    above: Sequence[tuple[int, str, bool]],
    dialect: Dialect,
    numeric: Sequence[int],
    rows: Sequence[Sequence[str]],
    source: str,
) -> tuple[tuple[str, ...] | None, tuple[str, ...], set[int]]:
    """Return names, units (empty where no line has them) and the numbers of the lines they are in."""
    width = dialect.width
    units, unit_line = ("",) * width, 0
    best: tuple[tuple[int, ...], tuple[str, ...], int] | None = None
    odd: tuple[int, int] | None = None
    for number, line, comment in above:
        for rank, delimiter in enumerate(dict.fromkeys((dialect.delimiter, *_DELIMITERS))):
            cells = [cell.strip(" ,;\t") for cell in cells_of(line.strip(), delimiter)]
            fitted = _fitted(cells, width, rows)
            if fitted is None:
                times = any(
                    re.match(r"\d{1,2}:\d\d", cell) for cell in cells
                )  # a message of the recorder
                if (
                    rank == 0
                    and not comment
                    and abs(len(cells) - width) == 1
                    and _words(cells)
                    and not times
                ):
                    odd = number, len(cells)
                continue
            of_units = _are_units(fitted)
            if of_units:  # "unit" is what the line is called
                said = [narrow_signs(cell).strip("[]() ") for cell in fitted]
                units = tuple("" if "unit" in cell.lower() else cell for cell in said)
                unit_line = number
            if _words([fitted[j] for j in numeric]) or _counted(fitted, numeric):
                filled = [cell for cell in fitted if cell]
                names = len(filled), len(set(filled))
                key = (int(not of_units), int(not comment), -rank, *names, number)
                if best is None or key > best[0]:
                    best = key, tuple(fitted), number
            break
    if best is not None and best[2] == unit_line:
        units, unit_line = ("",) * width, 0  # the only line of words: these are the names
    if best is None:
        if odd is not None:
            message = f"{odd[1]} names above {width} columns"
            remedy = "correct the header, or give [format] header = false and columns by number"
            raise InputRejected("F16", message, where=f"{source}, line {odd[0]}", remedy=remedy)
        return None, units, set()
    return best[1], units, {best[2], unit_line} - {0}


def _with_spans(
    names: tuple[str, ...], lines: Sequence[Line], at: int, dialect: Dialect
) -> tuple[str, ...]:
    """Return names that come several times, in line `at`, with what another line distinguishes.

    "waist", "", "", "elbow", "", "" above Angle, Torque, Speed, …: "waist Angle", "waist Torque", …
    pandas names the index in a line of its own, the first cell of which alone is filled.
    """
    index, best = "", names
    for number, line in reversed(lines):
        cells = cells_of(line, dialect.delimiter)
        if number == at or len(cells) != len(names) or not _words(cells):
            continue
        if number > at and not any(cells[1:]):
            index = cells[0]
            continue
        span, spanned = "", []
        for cell, name in zip(cells, names, strict=True):
            span = cell or span
            spanned.append((f"{name} {cell}" if number > at else f"{span} {name}").strip())
        if len(set(spanned)) > len(set(best)):
            best = tuple(spanned)
    return (index, *best[1:]) if index else best


def _fitted(cells: list[str], width: int, rows: Sequence[Sequence[str]]) -> list[str] | None:
    """Return one name a column, or None; an empty cell too many at either's end is left out.

    Rows that end in a delimiter have an unnamed, empty last cell. A table written with the number
    of its rows (R, pandas) has an unnamed first column. LabVIEW's text files name a last column
    "Comment" that the rows leave out.
    """
    if len(cells) == width:
        return cells
    body = rows[1:] or rows
    if len(cells) == width - 1:
        if all(row[-1] in MISSING for row in body):
            return [*cells, ""]
        if [row[0] for row in body] == [str(k) for k in _from(body[0][0], len(body))]:
            return ["row", *cells]
    if len(cells) == width + 1 and cells[-1].lower() in ("", "comment", "comments"):
        return cells[:-1]
    return None


def _from(first: str, count: int) -> range:
    return (
        range(int(first), int(first) + count) if first.isdecimal() and len(first) < 19 else range(0)
    )


def _words(cells: Sequence[str]) -> bool:
    """Tell whether the cells can be names: words, bare numbers among them at most, no formula."""
    numbers = [cell for cell in cells if is_number(cell)]
    words = sum(cell != "" for cell in cells) - len(numbers)
    return (
        words > 0
        and all(cell.isdecimal() for cell in numbers)
        and not any(FORMULA.fullmatch(cell) for cell in cells)
    )


def _counted(cells: Sequence[str], numeric: Sequence[int]) -> bool:
    return len(numeric) > 2 and [cells[j] for j in numeric] == [str(k) for k in range(len(numeric))]


def _are_units(cells: Sequence[str]) -> bool:
    """Tell whether most of the cells that say something are units of measurement."""
    bare = [narrow_signs(cell).strip("[]() ") for cell in cells]
    said = [cell for cell in bare if cell.lower() not in _NO_UNIT]
    known = sum(canonical_unit(cell) in UNITS or cell == "counts" for cell in said)
    return bool(said) and known > 0.5 * len(said)


def split_unit(name: str) -> tuple[str, str]:
    """Return ("q1", "deg") for "q1 [deg]", "q1（deg）", "q1, deg" or "q1 / deg"; an index in brackets is no unit."""
    whole = name.strip()
    text = narrow_signs(whole)
    if (behind := _BEHIND_SIGN.fullmatch(text)) and canonical_unit(behind[2]) in UNITS:
        return whole[: behind.end(1)], behind[2]
    stem, bracket, rest = text.rpartition(max("[(", key=text.rfind))
    unit = rest[:-1].strip()
    if not bracket or not stem.strip() or rest[-1:] not in ("]", ")") or not 0 < len(unit) <= 20:
        return whole, ""
    if set(unit) & set("[]()") or set(unit) <= set("0123456789 ,:"):
        return whole, ""
    return whole[: len(stem)].strip(), unit


def names_and_units(cells: Sequence[str]) -> tuple[tuple[str, ...], dict[str, str], dict[str, str]]:
    """Return the names, the units in brackets behind them, and which names come again.

    Names that differ only in their brackets keep them: "q[elbow]", "axis 1 (deg)", "axis 1 (Nm)".
    """
    pairs = [split_unit(cell) for cell in cells]
    times = Counter(name for name, _ in pairs)
    names: dict[str, None] = {}
    again: dict[str, str] = {}
    for j, (cell, (short, _)) in enumerate(zip(cells, pairs, strict=True)):
        name = (cell.strip() if times[short] > 1 else short) or f"column_{j + 1}"
        if name in names:
            again[f"{name}, column {j + 1}"] = name
            name = f"{name}, column {j + 1}"
        names[name] = None
    # Where brackets alone distinguish columns, only a known unit in them is one: not a joint's name.
    units = {
        name: unit
        for name, (short, unit) in zip(names, pairs, strict=True)
        if unit and (times[short] == 1 or canonical_unit(unit) in UNITS)
    }
    return tuple(names), units, again


def without_repeats(columns: dict[str, Array], header: Header, source: str) -> dict[str, Array]:
    """Return the columns without those that repeat one of the same name: a clock beside each channel.

    Raises:
        InputRejected: S03, two columns of one name hold different numbers.
    """
    for name, first in header.again.items():
        if (
            name in columns
            and first in columns
            and np.array_equal(columns[name], columns[first], equal_nan=True)
        ):
            continue
        at = header.names.index(first) + 1, header.names.index(name) + 1
        message = f"columns {at[0]} and {at[1]} are both named '{first[:80]}'"
        remedy = "rename one of them in the file"
        raise InputRejected("S03", message, where=f"{source}, line {header.line}", remedy=remedy)
    return {name: values for name, values in columns.items() if name not in header.again}
