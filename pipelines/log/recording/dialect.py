"""Tell how a text file writes its numbers: encoding, delimiter, decimal sign, header, units."""

from __future__ import annotations

import codecs
import re
from collections import Counter
from dataclasses import dataclass

from pipelines.errors import Check, InputRejected
from pipelines.log.recording.column_names import words_of
from pipelines.log.recording.vocabulary import ALL_WORDS
from pipelines.log.units import UNITS, canonical_unit

__all__ = [
    "MISSING",
    "WITH_UNIT",
    "Dialect",
    "TextFormat",
    "cells_of",
    "decode",
    "find_dialect",
    "holds_number",
    "is_number",
    "lines_of",
]

MISSING = frozenset(
    {
        "",
        "nan",
        "NaN",
        "NAN",
        "NA",
        "N/A",
        "null",
        "NULL",
        "None",
        "missing",
        "-nan",
        "-NaN",
        "-",
        "1.#IND",
        "-1.#IND",
        "1.#QNAN",
        "-1.#QNAN",
    }
)
_NUMBER = re.compile(
    r"[+-]?(\d++\.?\d*|\.\d+)([eEdD][+-]?\d+)?|[+-]?(inf|Inf|INF|infinity|Infinity)"
)
WITH_UNIT = re.compile(r"([+-]?\d++\.?\d*+(?:[eE][+-]?\d+)?)\s*([^\W\d_][^\d\s]{0,9})")
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:,\d{3})+\.\d+")  # as spreadsheets show numbers, in quotes
_ENCODINGS = (
    "latin-1",
    "cp932",
    "gb18030",
    "cp949",
    "cp1250",
    "cp1251",
)  # without a mark; the first where none fits better
_HEAD = 8192  # [bytes] in which the names of the columns are
_COMMENTS = ("#", "%", "//")
_DELIMITERS = (",", ";", "\t", "|", " ")
_WORDS = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "blanks", "": "one column"}


@dataclass(frozen=True)
class TextFormat:
    """The format of a text file as a recipe states it; the rest is detected."""

    __pydantic_config__ = {"extra": "forbid"}  # noqa: RUF012

    delimiter: str | None = None
    decimal: str | None = None  # "." or ","
    header: bool | None = None  # false: the first line is data already
    encoding: str | None = None
    comment: str | None = None  # lines that start so are left out


@dataclass(frozen=True)
class Dialect:
    delimiter: str  # "" one column, " " any blanks
    decimal: str
    width: int

    @property
    def words(self) -> str:
        return f"{_WORDS.get(self.delimiter, repr(self.delimiter))}, decimal {'comma' if self.decimal == ',' else 'point'}"


def decode(data: bytes, source: str, encoding: str | None = None) -> tuple[str, list[Check]]:
    """F16: the text of the file, by its byte order mark, its NUL bytes or what it can be.

    Raises:
        InputRejected: F16, NUL bytes inside, or not the encoding it claims.
    """
    checks: list[Check] = []
    if encoding is None:
        encoding = _encoding_of(data)
        if encoding != "utf-8":
            mark = (
                " (byte order mark)"
                if data.startswith((codecs.BOM_UTF8, codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
                else ""
            )
            message = f"read as {encoding}{mark}"
            remedy = "give encoding under [format] if that is wrong"
            checks.append(Check.of("F16", "warn", message, where=source, remedy=remedy))
    if not encoding.lower().replace("_", "-").startswith("utf-16"):
        whole = len(data)
        data = data.rstrip(b"\0")
        if len(data) < whole:
            message = (
                f"{whole - len(data)} NUL bytes at the end left out: the recorder lost its power"
            )
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
        message = f"not text in {encoding}: {problem}"
        remedy = "give its encoding under [format]"
        raise InputRejected("F16", message, where=source, remedy=remedy) from None
    return text.replace("\r\n", "\n").replace("\r", "\n"), checks


def _encoding_of(data: bytes) -> str:
    if data.startswith(codecs.BOM_UTF8):
        return "utf-8-sig"
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    head = data[:4096]
    if len(head) >= 8:
        if head[1::2].count(0) > 0.6 * len(head[1::2]) and head[0::2].count(0) == 0:
            return "utf-16-le"
        if head[0::2].count(0) > 0.6 * len(head[0::2]) and head[1::2].count(0) == 0:
            return "utf-16-be"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return max(_ENCODINGS, key=lambda encoding: _words_in(data[:_HEAD], encoding))
    return "utf-8"


def _words_in(head: bytes, encoding: str) -> int:
    """Return how many words that name columns the head of a file has in an encoding."""
    return sum(word in ALL_WORDS for word in words_of(head.decode(encoding, "ignore")))


def lines_of(text: str, comment: str | None) -> list[tuple[int, str]]:
    """(line number, line) of all lines that are neither empty nor a comment."""
    marks = (comment,) if comment else _COMMENTS
    # A cell such as "#REF!" at the start of a line is damage, not a comment; a comment is followed by a blank or letters.
    return [
        (number, line)
        for number, line in enumerate(text.split("\n"), start=1)
        if line.strip()
        and not (
            line.lstrip().startswith(marks)
            and not re.match(r"\s*#(REF|DIV/0|N/A|NAME|VALUE|NUM|NULL)\b", line)
        )
    ]


def cells_of(line: str, delimiter: str) -> list[str]:
    """The cells of a line, blanks and quotes taken off."""
    if delimiter == "":
        return [line.strip().strip('"')]
    if delimiter == " ":
        return (
            [cell.strip('"') for cell in re.findall(r'"[^"]*"|[^\s"]+', line)]
            if '"' in line
            else line.split()
        )
    if '"' in line:
        import csv

        try:
            cells = [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
            return [cell.replace(",", "") if _THOUSANDS.fullmatch(cell) else cell for cell in cells]
        except (csv.Error, StopIteration):
            pass
    return [cell.strip().strip("'\"") for cell in line.split(delimiter)]


def is_number(cell: str, decimal: str = ".") -> bool:
    return (
        _NUMBER.fullmatch(cell.replace(",", ".") if decimal == "," and "." not in cell else cell)
        is not None
    )


def holds_number(cell: str, decimal: str = ".") -> bool:
    """Tell whether a cell is a number, or one with a known unit behind it: "0.004 sec"."""
    if is_number(cell, decimal):
        return True
    found = WITH_UNIT.fullmatch(cell)
    return found is not None and canonical_unit(found[2]) in UNITS


def find_dialect(lines: list[tuple[int, str]], source: str, given: TextFormat) -> Dialect:
    """F16: the delimiter and decimal sign under which most cells are numbers and all lines have one width.

    Raises:
        InputRejected: F16, the decimal comma is not distinguishable from the delimiter.
    """
    step = max(1, len(lines) // 200)
    sample = [line for _, line in lines[len(lines) > 1 :: step]][:240]
    best: tuple[tuple[float, ...], Dialect] | None = None
    for delimiter in (given.delimiter,) if given.delimiter is not None else (*_DELIMITERS, ""):
        for decimal in (given.decimal,) if given.decimal else (".", ","):
            if decimal == delimiter or (
                decimal == "," and given.decimal is None and not any("," in line for line in sample)
            ):
                continue
            dialect, score = _score(sample, delimiter, decimal, lines[0][1])
            if best is None or score > best[0]:
                best = (score, dialect)
    if best is None:
        remedy = "give delimiter and decimal under [format]"
        raise InputRejected("F16", "no delimiter fits", where=source, remedy=remedy)
    if best[0][1] == 0.0 and given.delimiter is None:
        _refuse_two_commas(lines, best[1], source)
    return best[1]


def _score(
    sample: list[str], delimiter: str, decimal: str, first: str
) -> tuple[Dialect, tuple[float, ...]]:
    split = [cells_of(line, delimiter) for line in sample]
    width = Counter(map(len, split)).most_common(1)[0][0]
    same = [cells for cells in split if len(cells) == width]
    numeric = sum(
        holds_number(cell, decimal) or cell in MISSING for cells in same for cell in cells
    ) / (width * len(same))
    head = cells_of(first, delimiter)
    fits = float(len(head) == width or all(is_number(cell, decimal) for cell in head))
    # Rounded, so that one torn line does not outweigh a header that fits.
    return Dialect(delimiter, decimal, width), (
        round(numeric * len(same) / len(split), 1),
        fits,
        width,
        float(decimal == "."),
    )


def _refuse_two_commas(lines: list[tuple[int, str]], dialect: Dialect, source: str) -> None:
    names = len(cells_of(lines[0][1], ","))
    if dialect.delimiter != "," or names < 2 or dialect.width != 2 * names:
        return
    number, row = next(
        (k, cells) for k, line in lines if len(cells := cells_of(line, ",")) == dialect.width
    )
    if all(map(is_number, row)):  # no names of that many columns above them
        message = (
            f"line {number} has {dialect.width} cells under {names} names: "
            "comma is both delimiter and decimal sign"
        )
        remedy = "export with a semicolon or tab between the columns, or with decimal points"
        raise InputRejected("F16", message, where=source, remedy=remedy)
