"""Detect how a text file writes its table: encoding, delimiter, decimal sign, names and units.

A line is data where every column that holds numbers further down holds one in it, too. The lines
above the first such line, comments included, are searched for one name a column: a plain line
before a comment, the table's own delimiter before another, the nearest before one further up. A
line of units below the names is read as such.
"""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pipelines.errors import Check, InputRejected
from pipelines.importers.column_names import ALL_WORDS, narrow_signs, words_of
from pipelines.importers.recipe import TextFormat
from pipelines.io.experiment import Array
from pipelines.io.units import UNITS, canonical_unit

__all__ = ["FORMULA", "MISSING", "WITH_UNIT", "Dialect", "Header", "Line", "cells_of", "decode",
           "find_dialect", "find_header", "is_number", "lines_of", "names_and_units", "split_unit",
           "without_repeats"]  # fmt: skip

Line = tuple[int, str]  # its number, from 1, and text

MISSING = frozenset({"", "nan", "NaN", "NAN", "NA", "N/A", "null", "NULL", "None", "missing",
                     "-nan", "-NaN", "-", "1.#IND", "-1.#IND", "1.#QNAN", "-1.#QNAN"})  # fmt: skip
FORMULA = re.compile(r"\s*(#(REF|DIV/0|N/A|NAME|VALUE|NUM|NULL)[!?]?|=.+|@.+)\s*")
WITH_UNIT = re.compile(r"([+-]?\d++\.?\d*+(?:[eE][+-]?\d+)?)\s*((?:[^\W\d_]|°)[^\d\s]{0,9})")
_INFINITE = r"[+-]?(inf|Inf|INF|infinity|Infinity)"
_NUMBER = re.compile(rf"[+-]?(\d++\.?\d*|\.\d++)([eEdD][+-]?\d+)?|{_INFINITE}")
_QUOTED = re.compile(r"""(['"])(.*)\1""")
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:,\d{3})+\.\d+")  # as spreadsheets show numbers, in quotes
# Encodings of a file without a mark; the first where none fits better.
_ENCODINGS = ("latin-1", "cp932", "gb18030", "cp949", "cp1250", "cp1251")
_HEAD = 8192  # [bytes] in which the names of the columns are
_MARKS = "#%/*! "  # what a comment begins with
# A cell such as "#REF!" at the start of a line is damage, not a comment.
_SHEET_ERROR = re.compile(r"\s*#(REF|DIV/0|N/A|NAME|VALUE|NUM|NULL)\b")
_WORDS = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "blanks", "": "one column"}
_SEARCHED = 40  # lines above the numbers
_SEEN = _SEARCHED + 20  # and lines of numbers that say which columns are numbers
_BEHIND_SIGN = re.compile(r"(.*[^\s,/])(?:,| /)\s+(\S(?:.{0,18}\S)?)")  # as axes are labelled
_NO_UNIT = frozenset({"", "-", "1", "none", "n/a", "[]"})


@dataclass(frozen=True)
class Dialect:
    delimiter: str  # "" one column, " " any blanks
    decimal: str
    width: int

    @property
    def words(self) -> str:
        sign = "comma" if self.decimal == "," else "point"
        return f"{_WORDS.get(self.delimiter, repr(self.delimiter))}, decimal {sign}"


@dataclass(frozen=True)
class Header:
    """Names and units of the columns, and where the numbers begin."""

    names: tuple[str, ...]
    units: dict[str, str]
    first: int  # index of the first line of data among the lines that are not comments
    skipped: int  # lines above it that are neither names nor units
    again: dict[str, str] = field(default_factory=dict)  # new name -> the same name before
    line: int = 0  # of the names


def decode(data: bytes, source: str, encoding: str | None = None) -> tuple[str, list[Check]]:
    """F16: return the text of the file, by its byte order mark, its NUL bytes or its words.

    Raises:
        InputRejected: F16, NUL bytes inside, or not the encoding it claims.
    """
    checks: list[Check] = []
    if encoding is None:
        encoding = _encoding_of(data)
        if encoding != "utf-8":
            marks = (codecs.BOM_UTF8, codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
            message = f"read as {encoding}{' (byte order mark)' if data.startswith(marks) else ''}"
            remedy = "give encoding under [format] if that is wrong"
            checks.append(Check.of("F16", "warn", message, where=source, remedy=remedy))
    if not encoding.lower().replace("_", "-").startswith("utf-16"):
        whole = len(data)
        data = data.rstrip(b"\0")
        if len(data) < whole:
            left_out = f"{whole - len(data)} NUL bytes at the end left out"
            message = f"{left_out}: the recorder lost its power"
            remedy = "let the recorder close its file"
            checks.append(Check.of("F09", "repair", message, where=source, remedy=remedy))
        if (at := data.find(b"\0")) >= 0:
            line = data[:at].count(b"\n") + 1
            remedy = "the file is damaged or not text; export it again"
            raise InputRejected("F16", f"a NUL byte in line {line}", where=source, remedy=remedy)
    elif len(data) % 2:
        data = data[:-1]
    try:
        text = data.decode(encoding)
    except (UnicodeDecodeError, LookupError) as problem:
        message, remedy = f"not text in {encoding}: {problem}", "give its encoding under [format]"
        raise InputRejected("F16", message, where=source, remedy=remedy) from None
    return text.replace("\r\n", "\n").replace("\r", "\n"), checks


def _encoding_of(data: bytes) -> str:
    if data.startswith(codecs.BOM_UTF8):
        return "utf-8-sig"
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    even, odd = data[:4096:2], data[1:4096:2]
    for high, low, encoding in ((odd, even, "utf-16-le"), (even, odd, "utf-16-be")):
        if len(data) >= 8 and high.count(0) > 0.6 * len(high) and low.count(0) == 0:
            return encoding
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        head = data[:_HEAD]  # by how many words that name columns it has
        words = {e: words_of(head.decode(e, "ignore")) for e in _ENCODINGS}
        return max(_ENCODINGS, key=lambda e: sum(word in ALL_WORDS for word in words[e]))
    return "utf-8"


def lines_of(text: str, comment: str | None) -> list[Line]:
    """Return all lines that are neither empty nor a comment."""
    marks = (comment,) if comment else ("#", "%", "//")
    return [
        (number, line)
        for number, line in enumerate(text.split("\n"), start=1)
        if line.strip() and (not line.lstrip().startswith(marks) or _SHEET_ERROR.match(line))
    ]


def cells_of(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line without blanks and quotes around them."""
    if delimiter == "":
        return [line.strip().strip('"')]
    if delimiter == " ":
        quoted = re.findall(r'"[^"]*"|[^\s"]+', line) if '"' in line else line.split()
        return [cell.strip('"') for cell in quoted] if '"' in line else quoted
    if '"' in line:
        try:
            cells = [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
            return [cell.replace(",", "") if _THOUSANDS.fullmatch(cell) else cell for cell in cells]
        except (csv.Error, StopIteration):
            pass
    bare = (cell.strip() for cell in line.split(delimiter))
    return [found[2] if (found := _QUOTED.fullmatch(cell)) else cell for cell in bare]


def is_number(cell: str, decimal: str = ".") -> bool:
    point = cell.replace(",", ".") if decimal == "," and "." not in cell else cell
    return _NUMBER.fullmatch(point) is not None


def _holds_number(cell: str, decimal: str) -> bool:
    """Return whether a cell is a number, or one with a known unit behind it: "0.004 sec"."""
    if is_number(cell, decimal):
        return True
    found = WITH_UNIT.fullmatch(cell)
    return found is not None and canonical_unit(found[2]) in UNITS


def find_dialect(lines: list[Line], source: str, given: TextFormat) -> Dialect:
    """F16: return the format in which most cells are numbers and all lines have one width.

    Raises:
        InputRejected: F16, the decimal comma is not distinguishable from the delimiter.
    """
    step = max(1, len(lines) // 200)
    sample = [line for _, line in lines[len(lines) > 1 :: step]][:240]
    commas = any("," in line for line in sample)
    delimiters = tuple(_WORDS) if given.delimiter is None else (given.delimiter,)
    decimals = (given.decimal,) if given.decimal else (".", ",") if commas else (".",)
    pairs = [(a, b) for a in delimiters for b in decimals if a != b]
    if not pairs:
        remedy = "give delimiter and decimal under [format]"
        raise InputRejected("F16", "no delimiter fits", where=source, remedy=remedy)
    scored = [_score(sample, delimiter, decimal, lines[0][1]) for delimiter, decimal in pairs]
    dialect, score = max(scored, key=lambda one: one[1])
    if score[1] == 0.0 and given.delimiter is None:
        _refuse_two_commas(lines, dialect, source)
    return dialect


def _score(
    sample: list[str], delimiter: str, decimal: str, first: str
) -> tuple[Dialect, tuple[float, ...]]:
    split = [cells_of(line, delimiter) for line in sample]
    width = Counter(map(len, split)).most_common(1)[0][0]
    same = [cells for cells in split if len(cells) == width]
    numeric = sum(_holds_number(c, decimal) or c in MISSING for cells in same for c in cells)
    head = cells_of(first, delimiter)
    fits = float(len(head) == width or all(is_number(cell, decimal) for cell in head))
    # Rounded, so that one torn line does not outweigh a header that fits.
    share = round(numeric / (width * len(same)) * len(same) / len(split), 1)
    return Dialect(delimiter, decimal, width), (share, fits, width, float(decimal == "."))


def _refuse_two_commas(lines: list[Line], dialect: Dialect, source: str) -> None:
    names, width = len(cells_of(lines[0][1], ",")), dialect.width
    if dialect.delimiter != "," or names < 2 or width != 2 * names:
        return
    split = ((number, cells_of(line, ",")) for number, line in lines)
    number, row = next((number, cells) for number, cells in split if len(cells) == width)
    if all(map(is_number, row)):  # no names of that many columns above them
        cells = f"line {number} has {width} cells under {names} names"
        message = f"{cells}: comma is both delimiter and decimal sign"
        remedy = "export with a semicolon or tab between the columns, or with decimal points"
        raise InputRejected("F16", message, where=source, remedy=remedy)


def find_header(
    lines: list[Line], text: str, dialect: Dialect, source: str, has_header: bool | None
) -> Header:
    """Return the header of a table.

    Args:
        lines: without empty lines and comments.
        has_header: False where the recipe declares that the first line is data already.

    Raises:
        InputRejected: F16, one name more or less than columns.
    """
    width = dialect.width
    near = [(i, cells_of(line, dialect.delimiter)) for i, (_, line) in enumerate(lines[:_SEEN])]
    table = [(i, cells) for i, cells in near if len(cells) == width]
    start = table[0][0] if table else 0
    if has_header is False:
        return _numbered(width, start)
    rows = [cells for _, cells in table]
    numeric = _numeric_columns(rows[2:] or rows[1:] or rows, dialect)
    data = (i for i, row in table if _is_data(row, numeric, dialect))
    first = next(data, len(lines))
    if first == len(lines) or not numeric:
        first = start + 1  # words alone: the first line names them
    number = lines[first][0] if first < len(lines) else lines[-1][0] + 1
    plain = {n for n, _ in lines[:first]}
    above = [(*line, False) for line in lines[max(0, first - _SEARCHED) : first]]
    above = sorted(above + _comments_above(text, number, plain))
    names, units, used = _names_above(above, dialect, numeric, rows, source)
    if names is None:
        return _numbered(width, first, skipped=first)
    if len(set(names)) < width:
        names = _with_spans(names, [(n, line) for n, line, _ in above], min(used), dialect)
    named, found, again = names_and_units(names)
    pairs = zip(named, units, strict=True)
    found |= {name: unit for name, unit in pairs if unit.lower() not in _NO_UNIT}
    return Header(named, found, first, len(plain - used), again, min(used))


def _numbered(width: int, first: int, skipped: int = 0) -> Header:
    return Header(tuple(f"column_{j + 1}" for j in range(width)), {}, first, skipped or first)


def _numeric_columns(rows: Sequence[Sequence[str]], dialect: Dialect) -> list[int]:
    """Return the columns of which more than half of the cells are numbers, without empty ones."""
    columns = []
    for j in range(dialect.width):
        filled = [row[j] for row in rows if row[j] not in MISSING]
        if sum(_holds_number(cell, dialect.decimal) for cell in filled) > 0.5 * len(filled):
            columns.append(j)
    return columns


def _is_data(row: Sequence[str], numeric: Sequence[int], dialect: Dialect) -> bool:
    """Return whether `row` holds numbers where the table does; 0, 1, 2, … in order are names."""
    filled = [row[j] for j in numeric if row[j] not in MISSING]
    numbers = bool(filled) and all(_holds_number(cell, dialect.decimal) for cell in filled)
    return numbers and not _counted(row, numeric)


def _comments_above(text: str, number: int, known: set[int]) -> list[tuple[int, str, bool]]:
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
    """Return names, units ("" where no line has them) and the numbers of the lines they are in."""
    width = dialect.width
    no_units = ("",) * width
    units, unit_line = no_units, 0
    best: tuple[tuple[int, ...], tuple[str, ...], int] | None = None
    odd: tuple[int, int] | None = None
    delimiters = tuple(dict.fromkeys((dialect.delimiter, ",", ";", "\t", " ", "|")))
    for number, line, comment in above:
        for rank, delimiter in enumerate(delimiters):
            cells = [cell.strip(" ,;\t") for cell in cells_of(line.strip(), delimiter)]
            fitted = _fitted(cells, width, rows)
            if fitted is None:
                times = any(
                    re.match(r"\d{1,2}:\d\d", cell) for cell in cells
                )  # a recorder's message
                near = rank == 0 and not comment and abs(len(cells) - width) == 1
                odd = (number, len(cells)) if near and _words(cells) and not times else odd
                continue
            of_units = _are_units(fitted)
            if of_units:
                said = [narrow_signs(cell).strip("[]() ") for cell in fitted]
                # "unit" is what the line is called
                units = tuple("" if "unit" in cell.lower() else cell for cell in said)
                unit_line = number
            if _words([fitted[j] for j in numeric]) or _counted(fitted, numeric):
                filled = [cell for cell in fitted if cell]
                counts = len(filled), len(set(filled)), number
                key = (int(not of_units), int(not comment), -rank, *counts)
                best = (key, tuple(fitted), number) if best is None or key > best[0] else best
            break
    if best is not None:
        if best[2] == unit_line:  # the only line of words: these are the names
            units, unit_line = no_units, 0
        return best[1], units, {best[2], unit_line} - {0}
    if odd is not None:
        message, where = f"{odd[1]} names above {width} columns", f"{source}, line {odd[0]}"
        remedy = "correct the header, or give [format] header = false and columns by number"
        raise InputRejected("F16", message, where=where, remedy=remedy)
    return None, units, set()


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
    """Return one name a column, or None; an empty cell too many at either end is left out.

    Rows that end in a delimiter have an unnamed, empty last cell. A table with numbered rows (R,
    pandas) has an unnamed first column. LabVIEW names a last column "Comment" that the rows lack.
    """
    if len(cells) == width:
        return cells
    body = rows[1:] or rows
    if len(cells) == width - 1:
        if all(row[-1] in MISSING for row in body):
            return [*cells, ""]
        first = body[0][0]
        counts = first.isdecimal() and len(first) < 19
        if counts and [row[0] for row in body] == [str(int(first) + k) for k in range(len(body))]:
            return ["row", *cells]
    last_alone = len(cells) == width + 1 and cells[-1].lower() in ("", "comment", "comments")
    return cells[:-1] if last_alone else None


def _words(cells: Sequence[str]) -> bool:
    """Return whether the cells can be names: words, bare numbers among them, no formula."""
    numbers = [cell for cell in cells if is_number(cell)]
    words = sum(cell != "" for cell in cells) > len(numbers)
    formulas = any(FORMULA.fullmatch(cell) for cell in cells)
    return words and all(cell.isdecimal() for cell in numbers) and not formulas


def _counted(cells: Sequence[str], numeric: Sequence[int]) -> bool:
    return len(numeric) > 2 and [cells[j] for j in numeric] == list(map(str, range(len(numeric))))


def _are_units(cells: Sequence[str]) -> bool:
    """Return whether most of the filled cells are units of measurement."""
    bare = [narrow_signs(cell).strip("[]() ") for cell in cells]
    said = [cell for cell in bare if cell.lower() not in _NO_UNIT]
    known = sum(canonical_unit(cell) in UNITS or cell == "counts" for cell in said)
    return bool(said) and known > 0.5 * len(said)


def split_unit(name: str) -> tuple[str, str]:
    """Return ("q1", "deg") for "q1 [deg]", "q1（deg）", "q1, deg" or "q1 / deg".

    An index in brackets is no unit.
    """
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
    # Where brackets alone distinguish columns, only a known unit in them is one: no joint's name.
    units = {
        name: unit
        for name, (short, unit) in zip(names, pairs, strict=True)
        if unit and (times[short] == 1 or canonical_unit(unit) in UNITS)
    }
    return tuple(names), units, again


def without_repeats(columns: dict[str, Array], header: Header, source: str) -> dict[str, Array]:
    """Return the columns without those that repeat one of the same name: a clock of each channel.

    Raises:
        InputRejected: S03, two columns of one name hold different numbers.
    """
    places: dict[str, list[int]] = {}
    for name, first in header.again.items():
        both = [columns[key] for key in (name, first) if key in columns]
        if len(both) < 2 or not np.array_equal(both[0], both[1], equal_nan=True):
            at = places.setdefault(first, [header.names.index(first) + 1])
            at.append(header.names.index(name) + 1)
    if places:
        pairs = [(", ".join(map(str, at)), name[:80]) for name, at in places.items()][:8]
        message = "; ".join(f"columns {at} are all named '{name}'" for at, name in pairs)
        where, remedy = f"{source}, line {header.line}", "give each its own name in the file"
        raise InputRejected("S03", message, where=where, remedy=remedy)
    return {name: values for name, values in columns.items() if name not in header.again}
