"""Detect how a text file writes its table: delimiter, decimal sign, names and units of columns.

A line is data where every column that holds numbers further down holds one in it, too. The lines
above the first such line, comments included, are searched for one name a column: a plain line
before a comment, the table's own delimiter before another, the nearest before one further up. A
line of units below the names is read as such.

Lines of one form may label their numbers instead:

[14:02:11.254] [rt] q=[0.1, 0.2] tau=[3.0, 4.0]     timestamp, q[0], q[1], tau[0], tau[1]
<Rob><AIPos A1="0.1" A2="0.2"/><IPOC>4</IPOC></Rob>     AIPos.A1, AIPos.A2, IPOC
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from pipelines.errors import InputRejected
from pipelines.importers.config import TEXT
from pipelines.importers.names import narrow_signs
from pipelines.importers.recipe import TextFormat
from pipelines.io.units import UNITS, canonical_unit

Line = tuple[int, str]  # its number, from 1, and text

MISSING = frozenset({"", "nan", "NaN", "NAN", "NA", "N/A", "null", "NULL", "None", "missing",
                     "-nan", "-NaN", "-", "1.#IND", "-1.#IND", "1.#QNAN", "-1.#QNAN"})  # fmt: skip
FORMULA = re.compile(r"\s*(#(REF|DIV/0|N/A|NAME|VALUE|NUM|NULL)[!?]?|=.+|@.+)\s*")
WITH_UNIT = re.compile(r"([+-]?\d++\.?\d*+(?:[eE][+-]?\d+)?)\s*((?:[^\W\d_]|°)[^\d\s]{0,9})")
_NUMBER = re.compile(r"(?i:[+-]?((\d++\.?\d*|\.\d++)([ed][+-]?\d+)?|inf|infinity))")
_QUOTED = re.compile(r"""(['"])(.*)\1""")
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:,\d{3})+\.\d+")  # as spreadsheets show numbers, in quotes
_MARKS = "#%/*! "  # what a comment begins with
_WORDS = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "blanks", "": "one column"}
_BEHIND_SIGN = re.compile(r"(.*[^\s,/])(?:,| /)\s+(\S(?:.{0,18}\S)?)")  # as axes are labelled
_NO_UNIT = frozenset({"", "-", "1", "none", "n/a", "[]"})
_DATE = r"(?:\d{4}[-/.]\d\d[-/.]\d\d[T ])?\d{1,2}:\d\d:\d\d(?:[.,]\d{1,9})?Z?"
_PLAIN_NUMBER = (
    r"(?<![\w.])[+-]?(?:\d++\.?\d*+|\.\d++)(?:[eE][+-]?\d++)?(?![\w.])"
    r"|(?<!\w)(?:nan|NaN|[+-]?inf)(?!\w)"
)
_SPLIT = re.compile(f"({_DATE}|{_PLAIN_NUMBER})")
_PLACE = "\0"  # a number's place in a line's form; no text file holds it
_DAY = "\1"
_PIECE = re.compile(rf"[^\W\d][\w.]*|[\[({{<\])}}>]|{_PLACE}|{_DAY}")
_LABEL = re.compile(rf"(?<![\w.])[^\W\d][\w.]*+\s*+[=:>]\s*+[\"'\[({{]*[{_PLACE}{_DAY}]")


@dataclass(frozen=True)
class Dialect:
    """Delimiter ("" one column, " " any blanks), decimal sign, and cells of a line."""

    delimiter: str
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
    first: int = 0  # index of the first line of data among the lines that are not comments
    skipped: int = 0  # lines above it that are neither names nor units
    again: dict[str, str] = field(default_factory=dict)  # new name -> the same name before
    line: int = 0  # of the names


def cells_of(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line without blanks and quotes around them."""
    if delimiter == "":
        return [line.strip().strip('"')]
    if delimiter == " ":
        quoted = re.findall(r'"[^"]*"|[^\s"]+', line) if '"' in line else line.split()
        return [cell.strip('"') for cell in quoted]
    if '"' in line:
        try:
            cells = [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
            return [cell.replace(",", "") if _THOUSANDS.fullmatch(cell) else cell for cell in cells]
        except (csv.Error, StopIteration):
            pass
    bare = (cell.strip() for cell in line.split(delimiter))
    return [found[2] if (found := _QUOTED.fullmatch(cell)) else cell for cell in bare]


def is_number(cell: str, decimal: str = ".") -> bool:
    """Return whether a cell is a number with that decimal sign, or with a point."""
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
    step = max(1, len(lines) // TEXT.sampled)
    sample = [line for _, line in lines[len(lines) > 1 :: step]]
    delimiters = tuple(_WORDS) if given.delimiter is None else (given.delimiter,)
    decimals = (".", ",") if any("," in line for line in sample) else (".",)
    decimals = (given.decimal,) if given.decimal else decimals
    head = lines[0][1]
    scored = [_score(sample, a, b, head) for a in delimiters for b in decimals if a != b]
    if not scored:
        remedy = "give delimiter and decimal under [format]"
        raise InputRejected("F16", "no delimiter fits", where=source, remedy=remedy)
    score, dialect = max(scored, key=lambda pair: pair[0])
    names = len(cells_of(head, ","))
    if not score[1] and dialect.delimiter == "," and dialect.width == 2 * names and names > 1:
        split = ((number, cells_of(line, ",")) for number, line in lines)
        number, row = next((number, row) for number, row in split if len(row) == dialect.width)
        if all(map(is_number, row)) and given.delimiter is None:  # no such names above them
            cells = f"line {number} has {dialect.width} cells under {names} names"
            message = f"{cells}: comma is both delimiter and decimal sign"
            remedy = "export with a semicolon or tab between the columns, or with decimal points"
            raise InputRejected("F16", message, where=source, remedy=remedy)
    return dialect


def _score(
    sample: list[str], delimiter: str, decimal: str, first: str
) -> tuple[tuple[float, ...], Dialect]:
    split = [cells_of(line, delimiter) for line in sample]
    width = Counter(map(len, split)).most_common(1)[0][0]
    same = [cells for cells in split if len(cells) == width]
    numeric = sum(_holds_number(c, decimal) or c in MISSING for cells in same for c in cells)
    head = cells_of(first, delimiter)
    fits = float(len(head) == width or all(is_number(cell, decimal) for cell in head))
    # Rounded, so that one torn line does not outweigh a header that fits.
    share = round(numeric / (width * len(split)), 1)
    return (share, fits, width, float(decimal == ".")), Dialect(delimiter, decimal, width)


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
    width, seen = dialect.width, enumerate(lines[: TEXT.head + TEXT.sampled_head])
    near = [(i, cells_of(line, dialect.delimiter)) for i, (_, line) in seen]
    table = [(i, cells) for i, cells in near if len(cells) == width]
    first = table[0][0] if table else 0
    numbered = tuple(f"column_{j + 1}" for j in range(width))
    if has_header is False:
        return Header(numbered, {}, first, first)
    rows = [cells for _, cells in table]
    numeric = _numeric_columns(rows[2:] or rows[1:] or rows, dialect)
    data = (i for i, row in table if _is_data(row, numeric, dialect))
    # Of words alone, the first line names them.
    first = next(data, first + 1) if numeric else first + 1
    number = lines[first][0] if first < len(lines) else lines[-1][0] + 1
    plain = dict(lines[:first])
    above = [
        (n, plain.get(n, line.lstrip().lstrip(_MARKS).strip()))
        for n, line in enumerate(text.split("\n", number)[: number - 1], start=1)
        if line.strip() and n >= number - TEXT.head
    ]
    names, units, used = _names_above(above, plain, dialect, numeric, rows, source)
    if names is None:
        return Header(numbered, {}, first, first)
    if len(set(names)) < width:
        names = _with_spans(names, above, min(used), dialect)
    named, found, again = names_and_units(names)
    pairs = zip(named, units, strict=True)
    found |= {name: unit for name, unit in pairs if unit.lower() not in _NO_UNIT}
    skipped = len(plain.keys() - used)
    return Header(named, found, first, skipped, again, min(used))


def _numeric_columns(rows: Sequence[Sequence[str]], dialect: Dialect) -> list[int]:
    """Return the columns of which more than half of the cells are numbers, without empty ones."""
    columns = []
    for j in range(dialect.width):
        filled = [row[j] for row in rows if row[j] not in MISSING]
        if 2 * sum(_holds_number(cell, dialect.decimal) for cell in filled) > len(filled):
            columns.append(j)
    return columns


def _is_data(row: Sequence[str], numeric: Sequence[int], dialect: Dialect) -> bool:
    """Return whether `row` holds numbers where the table does; 0, 1, 2, … in order are names."""
    filled = [row[j] for j in numeric if row[j] not in MISSING]
    numbers = bool(filled) and all(_holds_number(cell, dialect.decimal) for cell in filled)
    return numbers and not _counted(row, numeric)


def _names_above(
    above: Sequence[Line],
    plain: dict[int, str],
    dialect: Dialect,
    numeric: Sequence[int],
    rows: Sequence[Sequence[str]],
    source: str,
) -> tuple[tuple[str, ...] | None, tuple[str, ...], set[int]]:
    """Return names, units ("" where no line has them) and the numbers of the lines they are in.

    Of the lines `above`, those that are not `plain` are comments.
    """
    width = dialect.width
    no_units = ("",) * width
    units, unit_line = no_units, 0
    best: tuple[tuple[int, ...], tuple[str, ...], int] | None = None
    odd: tuple[int, int] | None = None
    delimiters = tuple(dict.fromkeys((dialect.delimiter, ",", ";", "\t", " ", "|")))
    for number, line in above:
        split = [[c.strip(" ,;\t") for c in cells_of(line.strip(), d)] for d in delimiters]
        fitted = [_fitted(cells, width, rows) for cells in split]
        if number in plain and fitted[0] is None and abs(len(split[0]) - width) == 1:
            timed = any(re.match(r"\d{1,2}:\d\d", cell) for cell in split[0])  # a message
            odd = (number, len(split[0])) if _are_words(split[0]) and not timed else odd
        fits = [(rank, cells) for rank, cells in enumerate(fitted) if cells is not None]
        if not fits:
            continue
        rank, cells = fits[0]
        said = [narrow_signs(cell).strip("[]() ") for cell in cells]
        known = [c for c in said if c.lower() not in _NO_UNIT]
        is_unit = [canonical_unit(cell) in UNITS or cell == "counts" for cell in known]
        of_units = 2 * sum(is_unit) > len(is_unit)
        if of_units:  # "unit" is what the line is called
            units = tuple("" if "unit" in cell.lower() else cell for cell in said)
            unit_line = number
        if _are_words([cells[j] for j in numeric]) or _counted(cells, numeric):
            filled = [cell for cell in cells if cell]
            counts = len(filled), len(set(filled)), number
            key = (int(not of_units), int(number in plain), -rank, *counts)
            best = (key, tuple(cells), number) if best is None or key > best[0] else best
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
        if number == at or len(cells) != len(names) or not _are_words(cells):
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
        counts = first.isdecimal() and len(first) <= TEXT.most_digits
        if counts and [row[0] for row in body] == [str(int(first) + k) for k in range(len(body))]:
            return ["row", *cells]
    last_alone = len(cells) == width + 1 and cells[-1].lower() in ("", "comment", "comments")
    return cells[:-1] if last_alone else None


def _are_words(cells: Sequence[str]) -> bool:
    """Return whether the cells can be names: words, bare numbers among them, no formula."""
    numbers = [cell for cell in cells if is_number(cell)]
    words = sum(cell != "" for cell in cells) > len(numbers)
    formulas = any(FORMULA.fullmatch(cell) for cell in cells)
    return words and all(cell.isdecimal() for cell in numbers) and not formulas


def _counted(cells: Sequence[str], numeric: Sequence[int]) -> bool:
    counts = [str(k) for k in range(len(numeric))]
    return len(numeric) >= TEXT.fewest_counted and [cells[j] for j in numeric] == counts


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
    if not bracket or not stem.strip() or rest[-1:] not in ("]", ")"):
        return whole, ""
    index = set(unit) <= set("0123456789 ,:")
    if index or len(unit) > TEXT.longest_unit or set(unit) & set("[]()"):
        return whole, ""
    return whole[: len(stem)].strip(), unit


def names_and_units(cells: Sequence[str]) -> tuple[tuple[str, ...], dict[str, str], dict[str, str]]:
    """Return the names, the units in brackets behind them, and which names come again.

    Names that differ only in their brackets keep them: "q[elbow]", "axis 1 (deg)", "axis 1 (Nm)".
    """
    pairs = [split_unit(cell) for cell in cells]
    times = Counter(name for name, _ in pairs)
    names: dict[str, None] = {}
    units: dict[str, str] = {}
    again: dict[str, str] = {}
    for j, (cell, (short, unit)) in enumerate(zip(cells, pairs, strict=True), start=1):
        name = (cell.strip() if times[short] > 1 else short) or f"column_{j}"
        if name in names:
            again[f"{name}, column {j}"] = name
            name = f"{name}, column {j}"
        names[name] = None
        # Where brackets alone distinguish columns, only a known unit in them is one: no joint's.
        if unit and (times[short] == 1 or canonical_unit(unit) in UNITS):
            units[name] = unit
    return tuple(names), units, again


def labelled_lines(lines: list[Line]) -> tuple[tuple[str, ...], list[tuple[int, list[str]]]] | None:
    """Return the names, and the number and texts of each line with them; None of other text."""
    middle = [_form(line)[0] for _, line in lines[len(lines) // 4 :][: TEXT.sampled]]
    if any(len(line) > TEXT.longest_line for _, line in lines):
        return None
    if sum(len(_LABEL.findall(form)) for form in middle) < 2 * len(middle):
        return None
    named, count = Counter(map(_names_in, middle)).most_common(1)[0]
    if count < TEXT.one_form * len(middle) or len(set(named)) < max(len(named), 2):
        return None
    forms = [(number, *_form(line)) for number, line in lines]
    alike = {form for form in {form for _, form, _ in forms} if _names_in(form) == named}
    rows = [(number, values) for number, form, values in forms if form in alike]
    return (named, rows) if len(rows) >= TEXT.one_form * len(lines) else None


def _form(line: str) -> tuple[str, list[str]]:
    """Return a line with marks for its numbers, and these."""
    pieces = _SPLIT.split(line)  # words and numbers by turns
    values = pieces[1::2]
    pieces[1::2] = [_DAY if ":" in value else _PLACE for value in values]
    return " ".join("".join(pieces).split()), values


def _names_in(form: str) -> tuple[str, ...]:
    """Return the name of each number in a line's form: its label, with a place among several."""
    found: list[str] = []
    labels: list[str] = []  # of the open brackets
    label, tag = "", False
    for piece in _PIECE.findall(form):
        if piece in "[({<":
            labels.append("" if piece == "<" else label)
            tag = piece == "<"
        elif piece in "])}>":
            label = label if piece == ">" else ""
            del labels[-1:]
        elif piece in (_PLACE, _DAY):
            prefix = f"{labels[-1]}." if labels and labels[-1] not in ("", label) else ""
            found.append("timestamp" if piece == _DAY else prefix + label)
            label = label if labels and labels[-1] == label else ""
        else:
            label = piece
            if tag:
                labels[-1], tag = piece, False
    times, place = Counter(found), Counter[str]()
    names = []
    for k, name in enumerate(found, start=1):
        several = bool(name) and times[name] > 1
        names.append(f"{name}[{place[name]}]" if several else name or f"column_{k}")
        place[name] += 1
    return tuple(names)
