"""Read a recorded text file: its format is detected, its damage is counted, no number is guessed.

The delimiter and decimal sign are those under which most cells are numbers. A line is data where
every column that holds numbers further down holds one in it, too; the names are in the nearest line
of words above the first such line, comments included, and units may have a line of their own.
A line with the wrong number of cells, or with a cell that is no number, is left out and named, as
long as such lines are few (F09); the last line of a file that does not end in a line end is left
out, because its last number may be cut. pandas reads the lines that are whole, some at a time.
"""

from __future__ import annotations

import codecs
import contextlib
import csv
import io
import re
import warnings
from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipelines.errors import Check, InputRejected, clean
from pipelines.importers.config import ARRAYS, TEXT
from pipelines.importers.raw import RawTable, names_and_units
from pipelines.importers.recipe import TextFormat
from pipelines.io.log import Array
from pipelines.io.units import UNITS, canonical_unit

MISSING = frozenset({"", "nan", "NaN", "NAN", "NA", "N/A", "null", "NULL", "None", "missing",
                     "-nan", "-NaN", "-", "1.#IND", "-1.#IND", "1.#QNAN", "-1.#QNAN"})  # fmt: skip
_SHEET_ERROR = r"#(?:REF|DIV/0|N/A|NAME|VALUE|NUM|NULL)\b[!?]?"
_FORMULA = re.compile(rf"\s*(?:{_SHEET_ERROR}|=.+|@.+)\s*")
_NUMBER = re.compile(r"(?i:[+-]?((\d++\.?\d*|\.\d++)([ed][+-]?\d+)?|inf|infinity))")
_DELIMITERS = {",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "blanks",
               "": "one column"}  # fmt: skip
_DAY = 86400.0  # numerics: seconds
_EXPORT = "export the table again"


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
    data, checks = _as_utf8(data, source, given.encoding)
    if b'"[' in data:  # numpy breaks the lines of an array within its cell
        data = re.sub(rb'"\[[^"\]]*\]"', lambda cell: cell[0].replace(b"\n", b" "), data)
    ended, every = data.endswith(b"\n"), data.split(b"\n")
    mark = re.escape(given.comment) if given.comment else "[#%]|//"
    left_out = re.compile(rf"\s*(?:(?!{_SHEET_ERROR})(?:{mark})|$)".encode())
    numbers = [k for k, line in enumerate(every) if not left_out.match(line)]
    if not numbers:
        remedy = "record again, or copy the file again"
        raise InputRejected("F01", "no line of numbers in the file", source, remedy)
    dialect = _dialect(every, numbers, source, given)
    long = max(TEXT.long_side * len(numbers), TEXT.fewest_long)
    if dialect.width >= long and given.header is None:
        lines = [every[k].decode() for k in numbers]
        return _along_the_lines(lines, dialect, source)
    names, units, first, header = _header(every, numbers, dialect, source, given)
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        at = ", ".join(str(k) for k, name in enumerate(names, start=1) if name == twice[0])
        message = f"columns {at} are all named '{twice[0][:80]}'"
        where = f"{source}, line {header + 1}"
        raise InputRejected("S03", message, where, "give each its own name in the file")
    body = [k for k in numbers if k >= first]
    if not body:
        raise InputRejected("T08", "a header, but no sample", source, "record again")
    table = _whole_lines(every, body, ended, dialect, names, source)
    above = [line.decode().strip("#%/ ,;\t") for k, line in enumerate(every[:first]) if k != header]
    kept = {name: x for name, x in table.columns.items()
            if not (name.startswith("column_") and np.isnan(x).all())}  # fmt: skip
    if not kept:
        remedy = "rrrid import reads CSV and text tables, MAT (v5, v7.3) and NPY"
        raise InputRejected("F16", "no column of numbers", source, remedy)
    usual = dialect.delimiter in (",", "\t", "") and dialect.decimal == "."
    if not usual and given.delimiter is None:
        sign = "comma" if dialect.decimal == "," else "point"
        message = f"read as: {_DELIMITERS[dialect.delimiter]}, decimal {sign}"
        checks.append(Check.of("F16", "warn", message, source, "say so under [format] to be sure"))
    if skipped := [k for k in numbers if k < min(first, header)]:
        message = f"{len(skipped)} lines before the table left out"
        remedy = "give header or comment under [format] if not so"
        where = f"{source}, line {skipped[0] + 1}"
        checks.append(Check.of("F16", "warn", message, where, remedy))
    notes = tuple(note for note in above if note)[-ARRAYS.most_notes :]
    units |= table.units
    checks += table.checks
    return replace(table, columns=kept, units=units, notes=notes, checks=tuple(checks))


def _as_utf8(data: bytes, source: str, encoding: str | None) -> tuple[bytes, list[Check]]:
    """F16: return the text in UTF-8, by its byte order mark or NUL bytes, else UTF-8 or Latin-1.

    Raises:
        InputRejected: F16, NUL bytes inside, or not the encoding it claims.
    """
    checks: list[Check] = []
    if encoding is None:
        encoding = _encoding_of(data, source)
        if encoding != "utf-8":
            remedy = "give encoding under [format] if that is wrong"
            checks.append(Check.of("F16", "warn", f"read as {encoding}", source, remedy))
    if encoding.lower().replace("_", "-").startswith("utf-16"):
        data = data[: len(data) // 2 * 2]
    else:
        whole, data = len(data), data.rstrip(b"\0")
        if len(data) < whole:
            message = f"{whole - len(data)} NUL bytes at the end left out: the recorder lost power"
            remedy = "let the recorder close its file"
            checks.append(Check.of("F09", "repair", message, source, remedy))
        if (at := data.find(b"\0")) >= 0:
            message = f"a NUL byte in line {data[:at].count(10) + 1}"
            remedy = "the file is damaged or not text; export it again"
            raise InputRejected("F16", message, source, remedy)
    try:
        data = data if encoding == "utf-8" else data.decode(encoding).encode()
        data.decode()
    except (UnicodeError, LookupError) as problem:
        message, remedy = f"not text in {encoding}: {problem}", "give its encoding under [format]"
        raise InputRejected("F16", message, source, remedy) from None
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n"), checks


def _encoding_of(data: bytes, source: str) -> str:
    head, letters = data[: TEXT.head_bytes], rb"[\x80-\xff]"
    if data.startswith(codecs.BOM_UTF8):
        return "utf-8-sig"
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    for high, low, encoding in ((1, 0, "utf-16-le"), (0, 1, "utf-16-be")):
        nul = head[high::2].count(0)
        if nul > TEXT.nul_share * len(head) and not head[low::2].count(0):
            return encoding
    try:
        data.decode()
    except UnicodeDecodeError:  # accents come alone, letters of other alphabets together
        together = b"".join(re.findall(letters + b"{2,}", head))
        if 2 * len(together) <= len(re.findall(letters, head)):
            return "latin-1"
        message, remedy = "text in an unknown encoding", "save it as UTF-8, or give its encoding"
        raise InputRejected("F16", message, source, f"{remedy} under [format]") from None
    return "utf-8"


def _dialect(every: list[bytes], plain: list[int], source: str, given: TextFormat) -> Dialect:
    """F16: return the format in which most cells are numbers and all lines have one width.

    Raises:
        InputRejected: F16, the decimal comma is not distinguishable from the delimiter.
    """
    sampled = plain[len(plain) > 1 :: max(1, len(plain) // TEXT.sampled)]
    sample, first = [every[k].decode() for k in sampled], every[plain[0]].decode()
    delimiters = tuple(_DELIMITERS) if given.delimiter is None else (given.delimiter,)
    decimals = (".", ",") if any("," in line for line in sample) else (".",)
    decimals = (given.decimal,) if given.decimal else decimals
    scored = []
    for delimiter, decimal in ((a, b) for a in delimiters for b in decimals if a != b):
        form = Dialect(delimiter, decimal, 0)
        split = [form.cells(line) for line in sample]
        width = Counter(map(len, split)).most_common(1)[0][0]
        numeric = sum(sum(map(form.is_number, row)) for row in split if len(row) == width)
        head = form.cells(first)
        fits = len(head) == width or all(map(form.is_number, head))
        share = round(numeric / (width * len(split)), TEXT.decimals)
        scored.append(((share, fits, width, decimal == "."), replace(form, width=width)))
    if not scored:
        remedy = "give delimiter and decimal under [format]"
        raise InputRejected("F16", "no delimiter fits", source, remedy)
    (_, fits, width, _), dialect = max(scored, key=lambda pair: pair[0])
    names = len(dialect.cells(first))
    if not fits and dialect.delimiter == "," and width == 2 * names and names > 1:
        number = next(k for k in plain if every[k].count(b",") + 1 == width)
        message = (
            f"line {number + 1} has {width} cells under {names} names: comma is both delimiter "
        )
        message += "and decimal sign"
        remedy = "export with a semicolon or tab between the columns, or with decimal points"
        raise InputRejected("F16", message, source, remedy)
    if width > TEXT.widest:
        message = f"{width} cells in a line: not a table of columns"
        remedy = "give delimiter and decimal under [format], or one row a sample"
        raise InputRejected("F16", message, source, remedy)
    return dialect


def _header(
    every: list[bytes], plain: list[int], dialect: Dialect, source: str, given: TextFormat
) -> tuple[list[str], dict[str, str], int, int]:
    """Return names and units of the columns, the first line of data and that of the names (or -1).

    Raises:
        InputRejected: F16, one name more or less than columns.
    """
    width, nameless = dialect.width, [f"column_{j + 1}" for j in range(dialect.width)]
    if given.header is False:
        return nameless, {}, plain[0], -1
    rows = [(k, dialect.cells(every[k].decode())) for k in plain[: 2 * TEXT.head]]
    rows = [(k, cells) for k, cells in rows if len(cells) == width]
    later = [cells for _, cells in rows[2:] or rows[1:] or rows]
    numeric = [
        j for j in range(width)
        if sum(dialect.is_number(row[j]) for row in later) > TEXT.numeric * len(later)
        and any(row[j] not in MISSING for row in later)
    ]  # fmt: skip
    counted = [str(k) for k in range(len(numeric))]  # 0, 1, 2, … are names
    data = [(k, r) for k, r in rows if numeric and all(dialect.is_number(r[j]) for j in numeric)]
    if len(data) > 1 and len(counted) >= TEXT.fewest_counted:
        data = data[1:] if [data[0][1][j] for j in numeric] == counted else data
    first = data[0][0] if data else plain[1] if len(plain) > 1 else len(every)
    units: list[str] = []
    best: tuple[int, list[str], int] | None = None  # different names, names, line
    above = [k for k in range(first) if every[k].strip()][-TEXT.head :]
    for k in reversed(above):
        line, is_plain = every[k].decode(), k in plain[: 2 * TEXT.head]
        cells = _fitted(line if is_plain else line.lstrip().lstrip("#%/*! "), dialect, later)
        if cells is None:
            split = len(dialect.cells(line))
            if is_plain and abs(split - width) == 1 and not (units or best) and split > 1:
                message, where = f"{split} names above {width} columns", f"{source}, line {k + 1}"
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
            best = (len(set(names)), cells, k)
    if best is None:
        return nameless, {}, first, -1
    columns, found = names_and_units(best[1])
    pairs = zip(columns, units, strict=True) if units else ()
    found |= {name: unit for name, unit in pairs if unit not in ("", "-", "1")}
    return columns, found, first, best[2]


def _fitted(line: str, dialect: Dialect, rows: list[list[str]]) -> list[str] | None:
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
    every: list[bytes],
    body: list[int],
    ended: bool,
    dialect: Dialect,
    names: list[str],
    source: str,
) -> RawTable:
    """F09: return the undamaged lines; little damage is left out and named."""
    damage: dict[int, str] = {}  # by line
    delimiter = dialect.delimiter.strip(" ").encode()
    for k in body:
        line = every[k]
        simple = delimiter and b'"' not in line
        width = line.count(delimiter) + 1 if simple else len(dialect.cells(line.decode()))
        if width != dialect.width or line.count(b'"') % 2:
            damage[k] = f"{width} cells, not {dialect.width}"
            for cell in dialect.cells(line.decode()):
                _refuse_formula(cell, "?", k, source)
    checks, uncertain = [], -1
    if not ended and body[-1] not in damage:
        uncertain = body[-1]
        message = "the last line has no line end: whether its last number is whole is not known, "
        where, remedy = f"{source}, line {body[-1] + 1}", "end the recording before it is copied"
        checks.append(Check.of("F09", "warn", f"{message}it is left out", where, remedy))
    good = [k for k in body if k not in damage and k != uncertain]
    if not good:
        remedy = "record again, or copy the file again"
        raise InputRejected("T08", "no whole line of numbers", source, remedy)
    table, wrong = _columns(every, good, dialect, names, source)
    for i in wrong:
        cells = dialect.cells(every[good[i]].decode())
        if not any(map(dialect.is_number, cells)) and names_and_units(cells)[0] != names:
            message = f"a further table begins, of {', '.join(cells[:3])[:60]} …"
            where, remedy = f"{source}, line {good[i] + 1}", "save each table in a file of its own"
            raise InputRejected("F16", message, where, remedy)
    damage |= {good[i]: reason for i, reason in wrong.items()}
    if damage:
        first = sorted(damage)[: TEXT.most_damaged]
        listed = ", ".join(f"line {k + 1} ({damage[k]})" for k in first)
        share = f"{len(damage)} of {len(body)} lines"
        if len(damage) > min(TEXT.most_damaged, max(1, int(TEXT.damaged_share * len(body)))):
            message = f"{share} are out of step with the columns: {listed}"
            remedy = "export the file again, or cut the damaged part out"
            raise InputRejected("F09", message, source, remedy)
        remedy = "copy or export the file again to have them all"
        checks.append(Check.of("F09", "repair", f"{share} left out: {listed}", source, remedy))
    keep = np.delete(np.arange(len(good)), list(wrong))
    lines = np.array(good, dtype=np.int64)[keep]
    rows = np.searchsorted(np.array(body), lines)
    return replace(
        table,
        columns={name: x[keep] for name, x in table.columns.items()},
        rows=rows,
        lines=lines + 1,
        breaks=tuple((np.flatnonzero(np.diff(rows) > 1) + 1).tolist()),
        checks=tuple(checks),
    )


def _columns(
    every: list[bytes], good: list[int], dialect: Dialect, names: list[str], source: str
) -> tuple[RawTable, dict[int, str]]:
    """Return the columns of whole lines, and those (by index) with a cell that is no number."""
    import pandas as pd

    separator = {" ": r"\s+", "": "\x1f"}.get(dialect.delimiter, dialect.delimiter)
    parts: dict[str, list[Any]] = {name: [] for name in names}
    for begin in range(0, len(good), TEXT.chunk):
        lines = [every[k] for k in good[begin : begin + TEXT.chunk]]
        try:
            frame = pd.read_csv(
                io.BytesIO(b"\n".join(lines)),
                sep=separator, decimal=dialect.decimal, header=None, names=range(dialect.width),
                index_col=False, na_values=sorted(MISSING), keep_default_na=False,
                skipinitialspace=True, skip_blank_lines=False, low_memory=False,
            )  # fmt: skip
        except (ValueError, OverflowError) as problem:
            message = f"no table of numbers: {problem}"
            raise InputRejected("F16", message, source, _EXPORT) from None
        if len(frame) != len(lines):
            raise InputRejected("F16", "quotes that do not end", source, _EXPORT)
        for name, (_, cells) in zip(names, frame.items(), strict=True):
            numbers = cells.dtype.kind in "iuf"
            parts[name].append(cells.to_numpy(np.float64) if numbers else cells)
    columns, units, text = dict[str, Array](), dict[str, str](), dict[str, str]()
    wrong: dict[int, str] = {}
    for name in names:
        cells = parts.pop(name)
        if all(isinstance(part, np.ndarray) for part in cells):
            columns[name] = np.concatenate(cells)
            continue
        words = pd.concat([pd.Series(part) for part in cells], ignore_index=True)
        words = words.astype("string").str.strip()
        point = words.str.replace(",", ".") if dialect.decimal == "," else words
        # Fortran writes 1D-3.
        numbers = pd.to_numeric(point.str.replace(r"(?<=\d)[dD](?=[+-]?\d)", "e", regex=True),
                                errors="coerce").to_numpy(np.float64, na_value=np.nan)  # fmt: skip
        missing = words.isna().to_numpy() | words.isin(MISSING).to_numpy(bool, na_value=True)
        bad = np.flatnonzero(np.isnan(numbers) & ~missing)
        for i in bad:
            _refuse_formula(words[i], name, good[i], source)
        if bad.size <= max(TEXT.most_damaged, len(good) // 2) and bad.size < len(good):
            columns[name] = numbers
            wrong |= {int(i): f"'{words[i][:30]}' in column '{name}' is no number" for i in bad}
        elif (seconds := _clock_times(words)) is not None:
            columns[name], units[name] = seconds, "s"
        elif (lists := _lists(words)) is not None:
            columns |= {f"{name}[{k}]": values for k, values in enumerate(lists.T)}
        else:
            text[name] = clean(words[int(bad[0])], ARRAYS.longest_text)
    return RawTable(source, columns, np.arange(len(good)), units, text), wrong


def _refuse_formula(cell: str, column: str, line: int, source: str) -> None:
    if _FORMULA.fullmatch(cell):
        message = f"'{cell[:30]}' in column '{column}' is a spreadsheet's formula or error"
        remedy = "export the recording itself, not an edited sheet"
        raise InputRejected("F16", message, f"{source}, line {line + 1}", remedy)


def _clock_times(words: Any) -> Array | None:
    """Return seconds [s] of dates with their offsets from UTC, durations, or times of the day.

    Times of the day are counted on over midnight. Of 5/6 and 6/5, that reading counts in which the
    days are nearer together. None of other words.
    """
    import pandas as pd

    point = words.str.replace(r"(\d:\d\d:\d\d)[,:](\d)", r"\1.\2", regex=True).str.strip("[](_ ")
    if not point.str.contains(r"\d:[0-5]\d:[0-5]\d", na=False).all():
        return None
    with contextlib.suppress(ValueError, OverflowError):
        return _over_midnight(pd.to_timedelta(point).dt.total_seconds().to_numpy(), point)
    for form in ("ISO8601", None, "mixed"):  # None: that of the first cell
        read = list[Array]()
        for first in (False,) if form == "ISO8601" else (False, True):
            with warnings.catch_warnings(), contextlib.suppress(ValueError, OverflowError):
                warnings.simplefilter("ignore")  # of an order of day and month that is not asked
                dates = pd.to_datetime(point, format=form, dayfirst=first, utc=True)
                read.append((dates - dates.iloc[0]).dt.total_seconds().to_numpy(np.float64))
        if read:
            return _over_midnight(min(read, key=np.ptp), point)
    return None


def _over_midnight(seconds: Array, words: Any) -> Array:
    """Return times of the day counted on over midnight; what has a date or days as it is."""
    if not words.str.fullmatch(r"[\d:.]+(?:\s*[AaPp]\.?\s?[Mm]\.?)?").all():
        return seconds
    return seconds + _DAY * np.concatenate([[0.0], np.cumsum(np.diff(seconds) < -0.5 * _DAY)])


def _lists(cells: Any) -> Array | None:
    """Return (samples, items) of cells that hold lists of one length: "[0.1, 0.2]"."""
    if not all(str(cell)[:1] + str(cell)[-1:] in ("[]", "()") for cell in cells):
        return None
    rows = [re.split(r"[\s,;]+", str(cell).strip("[]() ,")) for cell in cells]
    try:
        return np.array(rows, dtype=np.float64)
    except ValueError:
        return None


def _along_the_lines(lines: list[str], dialect: Dialect, source: str) -> RawTable:
    """S11: read a table of few, long lines, one signal a line, behind its name and perhaps unit."""
    rows = [dialect.cells(line) for line in lines]
    length = min(len(row) - (not row[-1]) for row in rows)
    turned = ("\t".join(column) for column in zip(*(row[:length] for row in rows), strict=True))
    given = TextFormat(delimiter="\t", decimal="," if dialect.decimal == "," else ".")
    table = read_text(("\n".join(turned) + "\n").encode(), source, given)
    message = f"{len(rows)} lines of {length} cells, read with time along the line"
    check = Check.of("S11", "warn", message, source, "store one line a sample")
    return replace(table, lines=None, checks=(check, *table.checks))
