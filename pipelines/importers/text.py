"""Read a recorded text file: its format is detected, its damage is counted, no number is guessed.

The delimiter and decimal sign are those under which most cells are numbers. A line is data where
every column that holds numbers further down holds one in it, too; the names are in the nearest line
of words above the first such line, comments included, and units may have a line of their own.
A line with the wrong number of cells, or with a cell that is no number, is left out and named, as
long as such lines are few (F09); the last line of a file that does not end in a line end is left
out, because its last number may be cut. pandas reads the lines that are whole.
"""

from __future__ import annotations

import codecs
import contextlib
import csv
import io
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipelines.errors import Check, InputRejected, clean
from pipelines.importers.config import ARRAYS, TEXT
from pipelines.importers.raw import RawTable, names_and_units
from pipelines.importers.recipe import TextFormat
from pipelines.io.log import Array
from pipelines.io.units import UNITS, canonical_unit

Line = tuple[int, str]  # its number, from 1, and text

MISSING = frozenset({"", "nan", "NaN", "NAN", "NA", "N/A", "null", "NULL", "None", "missing",
                     "-nan", "-NaN", "-", "1.#IND", "-1.#IND", "1.#QNAN", "-1.#QNAN"})  # fmt: skip
_SHEET_ERROR = r"#(?:REF|DIV/0|N/A|NAME|VALUE|NUM|NULL)\b[!?]?"
_FORMULA = re.compile(rf"\s*(?:{_SHEET_ERROR}|=.+|@.+)\s*")
_NUMBER = re.compile(r"(?i:[+-]?((\d++\.?\d*|\.\d++)([ed][+-]?\d+)?|inf|infinity))")
_MARKS = (codecs.BOM_UTF8, codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_DELIMITERS = {
    ",": "comma",
    ";": "semicolon",
    "\t": "tab",
    "|": "bar",
    " ": "blanks",
    "": "one column",
}
_NOWHERE = "\x1f"  # a delimiter that no text has
_STAMP = re.compile(
    r"^(?P<day>.*?)(?<!\d)(?P<hour>\d{1,2}):(?P<minute>[0-5]\d):(?P<second>[0-5]\d(?:[.,:]\d+)?)"
    r"(?:\s*(?P<half>[AaPp])\.?\s?[Mm]\b)?.*?(?P<year> \d{4})?$"
)
_DAY = 86400.0  # numerics: seconds


@dataclass(frozen=True)
class Dialect:
    """Delimiter ("" one column, " " any blanks), decimal sign, and cells of a line."""

    delimiter: str
    decimal: str
    width: int

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line without blanks and quotes around them."""
        if self.delimiter == "":
            return [line.strip().strip('"')]
        if '"' in line:
            spaced = re.sub(r"\s+", " ", line.strip()) if self.delimiter == " " else line
            with contextlib.suppress(csv.Error):  # a cell without end
                cells = next(csv.reader([spaced], delimiter=self.delimiter), [])
                return [cell.strip() for cell in cells]
        return [cell.strip() for cell in line.split(self.delimiter.strip(" ") or None)]

    def is_number(self, cell: str) -> bool:
        point = cell.replace(",", ".") if self.decimal == "," and "." not in cell else cell
        return _NUMBER.fullmatch(point) is not None or cell in MISSING


def read_text(data: bytes, source: str, given: TextFormat | None = None) -> RawTable:
    """Return the table of a CSV or text file.

    Raises:
        InputRejected: F01 nothing in it, F09 too much damage, F16 no table, S03 two equal names.
    """
    given = given or TextFormat()
    text, checks = _decode(data, source, given.encoding)
    if '"[' in text:  # numpy breaks the lines of an array within its cell
        text = re.sub(r'"\[[^"\]]*\]"', lambda cell: cell[0].replace("\n", " "), text)
    every = list(enumerate(text.split("\n"), start=1))
    marks = (given.comment,) if given.comment else ("#", "%", "//")
    lines = [
        (number, line)
        for number, line in every
        if line.strip()
        and (not line.lstrip().startswith(marks) or re.match(rf"\s*{_SHEET_ERROR}", line))
    ]
    if not lines:
        remedy = "record again, or copy the file again"
        raise InputRejected("F01", "no line of numbers in the file", source, remedy)
    dialect = _dialect(lines, source, given)
    if dialect.width >= max(TEXT.long_side * len(lines), TEXT.fewest_long) and given.header is None:
        return _along_the_lines(lines, dialect, source)
    names, units, body, header = _header(lines, every, dialect, source, given.header)
    if len(set(names)) < len(names):
        first = next(name for k, name in enumerate(names) if name in names[:k])
        at = ", ".join(str(k) for k, name in enumerate(names, start=1) if name == first)
        message, where = f"columns {at} are all named '{first[:80]}'", f"{source}, line {header}"
        raise InputRejected("S03", message, where, "give each its own name in the file")
    if not body:
        raise InputRejected("T08", "a header, but no sample", source, "record again")
    table = _whole_lines(body, text.endswith("\n"), dialect, names, source)
    above = [line.strip("#%/ ,;\t") for number, line in every[: body[0][0] - 1] if number != header]
    kept = {name: x for name, x in table.columns.items()
            if not (name.startswith("column_") and np.isnan(x).all())}  # fmt: skip
    if not kept:
        remedy = "rrrid import reads CSV and text tables, MAT (v5, v7.3) and NPY"
        raise InputRejected("F16", "no column of numbers", source, remedy)
    return replace(
        table,
        columns=kept,
        units={**units, **table.units},
        notes=tuple(note for note in above if note)[-ARRAYS.most_notes :],
        checks=(*checks, *_unusual(dialect, given, lines, body, header, source), *table.checks),
    )


def _decode(data: bytes, source: str, encoding: str | None) -> tuple[str, list[Check]]:
    """F16: return the text of the file, by its byte order mark or its NUL bytes, else UTF-8.

    Raises:
        InputRejected: F16, NUL bytes inside, or not the encoding it claims.
    """
    checks: list[Check] = []
    if encoding is None:
        encoding = _encoding_of(data, source)
        if encoding != "utf-8":
            mark = " (byte order mark)" if data.startswith(_MARKS) else ""
            remedy = "give encoding under [format] if that is wrong"
            checks.append(Check.of("F16", "warn", f"read as {encoding}{mark}", source, remedy))
    if encoding.lower().replace("_", "-").startswith("utf-16"):
        data = data[: len(data) // 2 * 2]
    else:
        whole, data = len(data), data.rstrip(b"\0")
        if len(data) < whole:
            message = f"{whole - len(data)} NUL bytes at the end left out: the recorder lost its "
            remedy, message = "let the recorder close its file", f"{message}power"
            checks.append(Check.of("F09", "repair", message, source, remedy))
        if (at := data.find(b"\0")) >= 0:
            message = f"a NUL byte in line {data[:at].count(10) + 1}"
            remedy = "the file is damaged or not text; export it again"
            raise InputRejected("F16", message, source, remedy)
    try:
        text = data.decode(encoding)
    except (UnicodeDecodeError, LookupError) as problem:
        message, remedy = f"not text in {encoding}: {problem}", "give its encoding under [format]"
        raise InputRejected("F16", message, source, remedy) from None
    return text.replace("\r\n", "\n").replace("\r", "\n"), checks


def _encoding_of(data: bytes, source: str) -> str:
    if data.startswith(_MARKS):
        return "utf-8-sig" if data.startswith(codecs.BOM_UTF8) else "utf-16"
    head = data[: TEXT.head_bytes]
    for high, low, encoding in ((1, 0, "utf-16-le"), (0, 1, "utf-16-be")):
        nul = head[high::2].count(0)
        if nul > TEXT.nul_share * len(head) and head[low::2].count(0) == 0:
            return encoding
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:  # accents come alone, letters of other alphabets side by side
        side_by_side = b"".join(re.findall(rb"[\x80-\xff]{2,}", head))
        if 2 * len(side_by_side) <= len(re.findall(rb"[\x80-\xff]", head)):
            return "latin-1"
        message, remedy = (
            "text in an unknown encoding",
            "save it as UTF-8, or give [format] encoding",
        )
        raise InputRejected("F16", message, source, remedy) from None
    return "utf-8"


def _dialect(lines: list[Line], source: str, given: TextFormat) -> Dialect:
    """F16: return the format in which most cells are numbers and all lines have one width.

    Raises:
        InputRejected: F16, the decimal comma is not distinguishable from the delimiter.
    """
    step = max(1, len(lines) // TEXT.sampled)
    sample = [line for _, line in lines[len(lines) > 1 :: step]]
    delimiters = tuple(_DELIMITERS) if given.delimiter is None else (given.delimiter,)
    decimals = (".", ",") if any("," in line for line in sample) else (".",)
    decimals = (given.decimal,) if given.decimal else decimals
    pairs = [(a, b) for a in delimiters for b in decimals if a != b]
    if not pairs:
        remedy = "give delimiter and decimal under [format]"
        raise InputRejected("F16", "no delimiter fits", source, remedy)
    scored = []
    for delimiter, decimal in pairs:
        form = Dialect(delimiter, decimal, 0)
        split = [form.cells(line) for line in sample]
        width = Counter(map(len, split)).most_common(1)[0][0]
        numeric = sum(sum(map(form.is_number, row)) for row in split if len(row) == width)
        head = form.cells(lines[0][1])
        fits = len(head) == width or all(map(form.is_number, head))
        share = round(numeric / (width * len(split)), TEXT.decimals)
        scored.append(((share, fits, width, decimal == "."), replace(form, width=width)))
    score, dialect = max(scored, key=lambda pair: pair[0])
    names = len(dialect.cells(lines[0][1]))
    if not score[1] and dialect.delimiter == "," and dialect.width == 2 * names and names > 1:
        number = next(n for n, line in lines if line.count(",") + 1 == dialect.width)
        cells = f"line {number} has {dialect.width} cells under {names} names"
        message = f"{cells}: comma is both delimiter and decimal sign"
        remedy = "export with a semicolon or tab between the columns, or with decimal points"
        raise InputRejected("F16", message, source, remedy)
    if dialect.width > TEXT.widest:
        message = f"{dialect.width} cells in a line: not a table of columns"
        remedy = "give delimiter and decimal under [format], or one row a sample"
        raise InputRejected("F16", message, source, remedy)
    return dialect


def _unusual(
    dialect: Dialect,
    given: TextFormat,
    lines: list[Line],
    body: list[Line],
    header: int,
    source: str,
) -> list[Check]:
    """F16: report a dialect that is not usual, and lines above the table that were left out."""
    checks = []
    usual = dialect.delimiter in (",", "\t", "") and dialect.decimal == "."
    if not usual and given.delimiter is None:
        sign = "comma" if dialect.decimal == "," else "point"
        words = f"{_DELIMITERS.get(dialect.delimiter, dialect.delimiter)}, decimal {sign}"
        message, remedy = f"read as: {words}", "say so under [format] to be sure"
        checks.append(Check.of("F16", "warn", message, source, remedy))
    skipped = [number for number, _ in lines if number < body[0][0] and number < header]
    if skipped:
        message = f"{len(skipped)} lines before the table left out"
        remedy, where = "give header or comment under [format]", f"{source}, line {skipped[0]}"
        checks.append(Check.of("F16", "warn", message, where, f"{remedy} if not so"))
    return checks


def _header(
    lines: list[Line], every: list[Line], dialect: Dialect, source: str, has_header: bool | None
) -> tuple[list[str], dict[str, str], list[Line], int]:
    """Return names and units of the columns, the lines of data, and the number of the names' line.

    Raises:
        InputRejected: F16, one name more or less than columns.
    """
    width = dialect.width
    numbered = [f"column_{j + 1}" for j in range(width)]
    if has_header is False:
        return numbered, {}, lines, 0
    rows = [(k, dialect.cells(line)) for k, (_, line) in enumerate(lines[: 2 * TEXT.head])]
    table = [(k, row) for k, row in rows if len(row) == width]
    later = [row for _, row in table[2:]] or [row for _, row in table[1:]] or [r for _, r in table]
    numeric = [
        j for j in range(width)
        if sum(map(dialect.is_number, (row[j] for row in later))) > TEXT.numeric * len(later)
        and any(row[j] not in MISSING for row in later)
    ]  # fmt: skip
    counted = [str(k) for k in range(len(numeric))]  # 0, 1, 2, … are names
    data = [k for k, row in table if numeric and all(dialect.is_number(row[j]) for j in numeric)]
    if len(data) > 1 and len(counted) >= TEXT.fewest_counted:
        data = data[1:] if [rows[data[0]][1][j] for j in numeric] == counted else data
    first = data[0] if data else min(1, len(lines))
    number = lines[first][0] if first < len(lines) else every[-1][0] + 1
    plain = {n for n, _ in lines}
    units: list[str] = []
    best: tuple[int, list[str], int] | None = None  # different names, names, line
    for n, line in reversed(
        [pair for pair in every[: number - 1] if pair[1].strip()][-TEXT.head :]
    ):
        bare = line if n in plain else line.lstrip().lstrip("#%/*! ")
        cells = _fitted(bare, dialect, later)
        if cells is None:
            split = len(dialect.cells(line))
            if n in plain and abs(split - width) == 1 and not (units or best) and split > 1:
                message, where = f"{split} names above {width} columns", f"{source}, line {n}"
                remedy = "correct the header, or give [format] header = false and columns by number"
                raise InputRejected("F16", message, where, remedy)
            continue
        said = [cell.strip("[]() ") for cell in cells]
        known = [c for c in said if c not in ("", "-", "1")]
        of_units = sum(canonical_unit(c) in UNITS or c == "counts" for c in known)
        names = [cells[j] for j in numeric]
        words = any(name and not dialect.is_number(name) for name in names)
        if not units and 2 * of_units > len(known):
            units = said
        elif (words or names == counted) and (best is None or len(set(names)) > best[0]):
            best = (len(set(names)), cells, n)
    if best is None:
        return numbered, {}, lines[first:], 0
    columns, found = names_and_units(best[1])
    pairs = zip(columns, units, strict=True) if units else ()
    found |= {name: unit for name, unit in pairs if unit not in ("", "-", "1")}
    return columns, found, lines[first:], best[2]


def _fitted(line: str, dialect: Dialect, rows: Sequence[Sequence[str]]) -> list[str] | None:
    """Return one cell a column of a line above the table, or None.

    Rows that end in a delimiter have an unnamed, empty last cell; a table with numbered rows (R,
    pandas) has an unnamed first column. Comments may have another delimiter than the table.
    """
    for delimiter in dict.fromkeys((dialect.delimiter, ",", ";", "\t", " ", "|")):
        cells = replace(dialect, delimiter=delimiter).cells(line.strip())
        cells = [cell.strip(" ,;\t") for cell in cells]
        if len(cells) == dialect.width:
            return cells
        if len(cells) == dialect.width - 1 and cells:
            if all(row[-1] in MISSING for row in rows):
                return [*cells, ""]
            if all(row[0].isdecimal() for row in rows) and delimiter == dialect.delimiter:
                return ["row", *cells]
        if len(cells) == dialect.width + 1 and not cells[-1]:
            return cells[:-1]
    return None


def _whole_lines(
    body: list[Line], ended: bool, dialect: Dialect, names: list[str], source: str
) -> RawTable:
    """F09: return the undamaged lines; little damage is left out and named."""
    damage: dict[int, str] = {}  # by index in the body
    delimiter = dialect.delimiter.strip(" ")
    for i, (number, line) in enumerate(body):
        simple = delimiter and '"' not in line
        cells = [] if simple else dialect.cells(line)
        count = line.count(delimiter) + 1 if simple else len(cells)
        if count != dialect.width or line.count('"') % 2:
            for cell in dialect.cells(line):
                _refuse_formula(cell, "?", number, source)
            damage[i] = f"{count} cells, not {dialect.width}"
    checks, torn = [], set(damage)
    if not ended and len(body) - 1 not in torn:
        torn.add(len(body) - 1)
        message = "the last line has no line end: whether its last number is whole is not known, "
        where, remedy = f"{source}, line {body[-1][0]}", "end the recording before it is copied"
        checks.append(Check.of("F09", "warn", f"{message}it is left out", where, remedy))
    good = [i for i in range(len(body)) if i not in torn]
    if not good:
        remedy = "record again, or copy the file again"
        raise InputRejected("T08", "no whole line of numbers", source, remedy)
    table, wrong = _columns([body[i] for i in good], dialect, names, source)
    for number, line in (body[good[k]] for k in wrong):
        cells = dialect.cells(line)
        if not any(map(dialect.is_number, cells)) and names_and_units(cells)[0] != names:
            message = f"a further table begins, of {', '.join(cells[:3])[:60]} …"
            where, remedy = f"{source}, line {number}", "save each table in a file of its own"
            raise InputRejected("F16", message, where, remedy)
    damage |= {good[k]: reason for k, reason in wrong.items()}
    if damage:
        first = sorted(damage)[: TEXT.most_damaged]
        listed = ", ".join(f"line {body[i][0]} ({damage[i]})" for i in first)
        share = f"{len(damage)} of {len(body)} lines"
        few = min(TEXT.most_damaged, max(1, int(TEXT.damaged_share * len(body))))
        if len(damage) > few:
            message = f"{share} are out of step with the columns: {listed}"
            remedy = "export the file again, or cut the damaged part out"
            raise InputRejected("F09", message, source, remedy)
        remedy = "copy or export the file again to have them all"
        checks.append(Check.of("F09", "repair", f"{share} left out: {listed}", source, remedy))
    keep = [k for k in range(len(good)) if k not in wrong]
    rows = np.array([good[k] for k in keep], dtype=np.int64)
    return replace(
        table,
        columns={name: np.ascontiguousarray(x[keep]) for name, x in table.columns.items()},
        rows=rows,
        lines=np.array([body[i][0] for i in rows], dtype=np.int64),
        breaks=tuple(int(i) + 1 for i in np.flatnonzero(np.diff(rows) > 1)),
        checks=tuple(checks),
    )


def _columns(
    lines: list[Line], dialect: Dialect, names: list[str], source: str
) -> tuple[RawTable, dict[int, str]]:
    """Return the columns of whole lines, and those (by index) with a cell that is no number."""
    import pandas as pd

    separator = {" ": r"\s+", "": _NOWHERE}.get(dialect.delimiter, dialect.delimiter)
    try:
        frame = pd.read_csv(
            io.StringIO("\n".join(line for _, line in lines)),
            sep=separator, decimal=dialect.decimal, header=None, names=range(dialect.width),
            index_col=False, na_values=sorted(MISSING), keep_default_na=False,
            skipinitialspace=True, skip_blank_lines=False, low_memory=False,
        )  # fmt: skip
    except (ValueError, OverflowError) as problem:
        message = f"no table of numbers: {problem}"
        raise InputRejected("F16", message, source, "export the table again") from None
    if len(frame) != len(lines):
        raise InputRejected("F16", "quotes that do not end", source, "export the table again")
    columns, units, text = dict[str, Array](), dict[str, str](), dict[str, str]()
    wrong: dict[int, str] = {}
    for name, (_, cells) in zip(names, frame.items(), strict=True):
        if cells.dtype.kind in "iuf":
            columns[name] = cells.to_numpy(np.float64)
            continue
        words = cells.astype("string").str.strip()
        point = words.str.replace(",", ".") if dialect.decimal == "," else words
        # Fortran writes 1D-3.
        numbers = pd.to_numeric(point.str.replace(r"(?<=\d)[dD](?=[+-]?\d)", "e", regex=True),
                                errors="coerce").to_numpy(np.float64, na_value=np.nan)  # fmt: skip
        missing = words.isna().to_numpy() | words.isin(MISSING).to_numpy(bool, na_value=True)
        bad = np.flatnonzero(np.isnan(numbers) & ~missing)
        for i in bad:
            _refuse_formula(words[i], name, lines[i][0], source)
        if bad.size <= max(TEXT.most_damaged, len(lines) // 2) and bad.size < len(lines):
            columns[name] = numbers
            wrong |= {int(i): f"'{words[i][:30]}' in column '{name}' is no number" for i in bad}
        elif (seconds := _clock_times(words)) is not None:
            columns[name], units[name] = seconds, "s"
        elif (lists := _lists(words)) is not None:
            columns |= {f"{name}[{k}]": values for k, values in enumerate(lists.T)}
        else:
            text[name] = clean(words[int(bad[0])], ARRAYS.longest_text)
    return RawTable(source, columns, np.arange(len(lines)), units, text), wrong


def _refuse_formula(cell: str, column: str, line: int, source: str) -> None:
    if _FORMULA.fullmatch(cell):
        message = f"'{cell[:30]}' in column '{column}' is a spreadsheet's formula or error"
        remedy = "export the recording itself, not an edited sheet"
        raise InputRejected("F16", message, f"{source}, line {line}", remedy)


def _clock_times(cells: Any) -> Array | None:
    """Return seconds [s] since the first midnight of "2024-05-17T11:30:00.125Z" or "1:30:00 PM".

    Times of one day, or of none, are counted on over midnight.
    """
    parts = cells.str.extract(_STAMP)
    if parts["hour"].isna().any():
        return None
    parts = parts.fillna("")
    second = parts["second"].str.replace("[,:]", ".", regex=True)
    every = (parts["hour"], parts["minute"], second)
    hour, minute, second = (part.to_numpy(np.float64) for part in every)
    half = parts["half"].str.lower().to_numpy(str)
    hour = np.where(half == "", hour, hour % 12.0 + 12.0 * (half == "p"))
    seconds = 3600.0 * hour + 60.0 * minute + second
    days = _days(parts["day"] + parts["year"])
    if days is not None and not days.any():
        days = np.concatenate([[0.0], np.cumsum(np.diff(seconds) < -0.5 * _DAY)])
    return None if days is None else seconds + _DAY * days


def _days(cells: Any) -> Array | None:
    """Return days since the first of dates or of texts such as "1 days"; None where it is neither.

    Of 5/6 and 6/5, that reading counts in which the days are nearer together.
    """
    import pandas as pd

    codes, texts = pd.factorize(cells.str.strip(" [(_").str.rstrip("T ,:/_-"))
    if len(texts) == 1:
        return np.zeros(len(cells))
    words, read = pd.Series(texts), list[Array]()
    if words.str.fullmatch(r"-?\d+ days?").all():
        read.append(words.str.split().str[0].to_numpy(np.float64))
    for first in () if read else (False, True):
        with contextlib.suppress(ValueError, OverflowError):
            dates = pd.to_datetime(words, format="mixed", dayfirst=first, utc=True)
            read.append((dates - dates[0]).dt.days.to_numpy(np.float64))
    return min(read, key=np.ptp)[codes] if read else None


def _lists(cells: Any) -> Array | None:
    """Return (samples, items) of cells that hold lists of one length: "[0.1, 0.2]"."""
    rows = [re.split(r"[\s,;]+", str(cell).strip("[]() ,")) for cell in cells]
    bracketed = all(str(cell)[:1] + str(cell)[-1:] in ("[]", "()") for cell in cells)
    if not bracketed or len({len(row) for row in rows}) > 1:
        return None
    try:
        return np.array(rows, dtype=np.float64)
    except ValueError:
        return None


def _along_the_lines(lines: list[Line], dialect: Dialect, source: str) -> RawTable:
    """S11: read a table of few, long lines, one signal a line, behind its name and perhaps unit."""
    rows = [dialect.cells(line) for _, line in lines]
    length = min(len(row) - (not row[-1]) for row in rows)
    turned = ("\t".join(column) for column in zip(*(row[:length] for row in rows), strict=True))
    given = TextFormat(delimiter="\t", decimal="," if dialect.decimal == "," else ".")
    table = read_text(("\n".join(turned) + "\n").encode(), source, given)
    message = f"{len(rows)} lines of {length} cells, read with time along the line"
    remedy = "store one line a sample"
    check = Check.of("S11", "warn", message, source, remedy)
    return replace(table, lines=None, checks=(check, *table.checks))
