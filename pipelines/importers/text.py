"""Read a recorded text file: its format is detected, its damage is counted, no line is guessed.

A line with the wrong number of cells, or with a cell that is no number, is left out and named, as
long as such lines are few (F09); the last line of a file that does not end in a line end is left
out, because its last number may be cut. A few lines of text between the rows are messages, left out
and named. Spreadsheet errors and formulas are refused: the numbers around them are not a recording.
"""

from __future__ import annotations

import codecs
import io
import re
from collections.abc import Container, Mapping
from dataclasses import replace

import numpy as np

from pipelines.errors import Check, InputRejected, clean
from pipelines.importers.config import TEXT
from pipelines.importers.header import (
    FORMULA,
    MISSING,
    WITH_UNIT,
    Dialect,
    Header,
    Line,
    cells_of,
    find_dialect,
    find_header,
    is_number,
    labelled_lines,
    names_and_units,
)
from pipelines.importers.names import vocabulary, words_of
from pipelines.importers.raw import RawTable
from pipelines.importers.recipe import TextFormat
from pipelines.io.limits import FEWEST
from pipelines.io.log import Array
from pipelines.io.units import UNITS, canonical_unit

# Encodings of a file without a mark; the first where none fits better.
_ENCODINGS = ("latin-1", "cp932", "gb18030", "cp949", "cp1250", "cp1251")
_MARKS = (codecs.BOM_UTF8, codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
# A cell such as "#REF!" at the start of a line is damage, not a comment.
_SHEET_ERROR = re.compile(r"\s*#(REF|DIV/0|N/A|NAME|VALUE|NUM|NULL)\b")
_GROUPED = re.compile(r"[-+.\d\seEnaNif]*[\[(][-+.\d\seEnaNif()\[\]]*")  # "12 (0.1 0.2) (3 4)"
_TIME_OF_DAY = re.compile(
    r"(?<!\d)(\d{1,2}):([0-5]\d):([0-5]\d)(?:[.,:;](\d{1,9}))?(?:\s?([AaPp])\.?[Mm]\b)?"
)
_USUAL = (Dialect(",", ".", 0), Dialect("\t", ".", 0), Dialect("", ".", 0))


def read_text(data: bytes, source: str, given: TextFormat | None = None) -> RawTable:
    """Return the table of a CSV or text file.

    Raises:
        InputRejected: F01 nothing in it, F09 too much damage, F16 no table, S03 two equal names.
    """
    detect = given in (None, TextFormat())
    given = given or TextFormat()
    text, checks = _decode(data, source, given.encoding)
    if '"[' in text and detect:  # numpy breaks the lines of an array within its cell
        text = re.sub(r'"\[[^"]*\]"', lambda cell: cell[0].replace("\n", " "), text)
    lines = _lines(text, (given.comment,) if given.comment else ("#", "%", "//"))
    if not lines:
        remedy = "record again, or copy the file again"
        raise InputRejected("F01", "no line of numbers in the file", where=source, remedy=remedy)
    if detect and (labelled := labelled_lines(lines)) is not None:
        names, rows = labelled
        if len(rows) < len(lines):
            message = f"{len(lines) - len(rows)} lines without the numbers of the others left out"
            remedy = "none where these are notes"
            checks.append(Check.of("F09", "warn", message, where=source, remedy=remedy))
        body = [(number, "\t".join(row)) for number, row in rows]
        table, wrong = _columns(body, Dialect("\t", ".", len(names)), names, source)
        notes = tuple(text.split("\n", rows[0][0])[: rows[0][0] - 1][-TEXT.most_notes :])
        return replace(_without(table, wrong), notes=notes, groups={}, checks=tuple(checks))
    if detect and all(_GROUPED.fullmatch(line) for _, line in lines):
        lines = [(number, re.sub(r"[()\[\]]", " ", line)) for number, line in lines]
    dialect = find_dialect(lines, source, given)
    if dialect.width > TEXT.widest:
        message = f"{dialect.width} cells in a line, {dialect.words}: not a table of columns"
        remedy = "give delimiter and decimal under [format], or one row a sample"
        raise InputRejected("F16", message, where=source, remedy=remedy)
    if replace(dialect, width=0) not in _USUAL and given.delimiter is None:
        message, remedy = f"read as: {dialect.words}", "say so under [format] to be sure"
        checks.append(Check.of("F16", "warn", message, where=source, remedy=remedy))
    long = dialect.width >= max(TEXT.long_side * len(lines), FEWEST) and given.header is None
    if long and (turned := _transposed(lines, dialect, source, checks)) is not None:
        return turned
    header = find_header(lines, text, dialect, source, given.header)
    body = _body(lines, header, text, dialect, source, checks)
    table = _undamaged(body, text.endswith("\n"), dialect, header.names, source, checks)
    columns = _without_repeats(table.columns, header, source)
    # Every line ends in a delimiter:
    empty = [n for n, v in columns.items() if n.startswith("column_") and np.isnan(v).all()]
    above = list(enumerate(text.split("\n", body[0][0])[: body[0][0] - 1], start=1))
    # Counted over lines of data: an empty line or a comment between them loses no sample.
    lines_kept = np.array([]) if table.lines is None else table.lines
    rows_kept = np.searchsorted(np.array([n for n, _ in body]), lines_kept)
    return replace(
        table,
        columns={name: values for name, values in columns.items() if name not in empty},
        rows=rows_kept,
        units={**header.units, **table.units},
        notes=tuple(line for number, line in above[-TEXT.most_notes :] if number != header.line),
        breaks=tuple(int(i) + 1 for i in np.flatnonzero(np.diff(rows_kept) > 1)),
        checks=tuple(checks),
    )


def _lines(text: str, marks: tuple[str, ...]) -> list[Line]:
    """Return all lines that are neither empty nor a comment."""
    return [
        (number, line)
        for number, line in enumerate(text.split("\n"), start=1)
        if line.strip() and (not line.lstrip().startswith(marks) or _SHEET_ERROR.match(line))
    ]


def _decode(data: bytes, source: str, encoding: str | None) -> tuple[str, list[Check]]:
    """F16: return the text of the file, by its byte order mark, its NUL bytes or its words.

    Raises:
        InputRejected: F16, NUL bytes inside, or not the encoding it claims.
    """
    checks: list[Check] = []
    if encoding is None:
        encoding = _encoding_of(data)
        if encoding != "utf-8":
            mark = " (byte order mark)" if data.startswith(_MARKS) else ""
            remedy = "give encoding under [format] if that is wrong"
            message = f"read as {encoding}{mark}"
            checks.append(Check.of("F16", "warn", message, where=source, remedy=remedy))
    if encoding.lower().replace("_", "-").startswith("utf-16"):
        data = data[: len(data) // 2 * 2]
    else:
        whole, data = len(data), data.rstrip(b"\0")
        if len(data) < whole:
            message = f"{whole - len(data)} NUL bytes at the end left out: the recorder lost its "
            remedy, message = "let the recorder close its file", f"{message}power"
            checks.append(Check.of("F09", "repair", message, where=source, remedy=remedy))
        if (at := data.find(b"\0")) >= 0:
            message = f"a NUL byte in line {data[:at].count(10) + 1}"
            remedy = "the file is damaged or not text; export it again"
            raise InputRejected("F16", message, where=source, remedy=remedy)
    try:
        text = data.decode(encoding)
    except (UnicodeDecodeError, LookupError) as problem:
        message, remedy = f"not text in {encoding}: {problem}", "give its encoding under [format]"
        raise InputRejected("F16", message, where=source, remedy=remedy) from None
    return text.replace("\r\n", "\n").replace("\r", "\n"), checks


def _encoding_of(data: bytes) -> str:
    if data.startswith(_MARKS):
        return "utf-8-sig" if data.startswith(codecs.BOM_UTF8) else "utf-16"
    head = data[: TEXT.head_bytes]
    for high, low, encoding in ((1, 0, "utf-16-le"), (0, 1, "utf-16-be")):
        nul = head[high::2].count(0)
        if nul > TEXT.nul_share * len(head) and head[low::2].count(0) == 0:
            return encoding
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:  # by how many words that name columns it has
        words = {e: words_of(head.decode(e, "ignore")) for e in _ENCODINGS}
        known = vocabulary().every
        return max(_ENCODINGS, key=lambda e: sum(word in known for word in words[e]))
    return "utf-8"


def _body(
    lines: list[Line], header: Header, text: str, dialect: Dialect, source: str, checks: list[Check]
) -> list[Line]:
    """Return the lines of data, without headers that come again and messages of the recorder.

    A message has words and not the cells of a row. It neither begins nor ends with a number, as the
    rows do: what does so is a damaged row.

    Raises:
        InputRejected: T08 no sample, F16 a further table.
    """
    body = lines[header.first :]
    if header.skipped:
        message = f"{header.skipped} lines before the table left out"
        remedy = "give header or comment under [format] if these are data"
        where = f"{source}, line {lines[0][0]}"
        checks.append(Check.of("F16", "warn", message, where=where, remedy=remedy))
    head = text.split("\n", header.line)[header.line - 1] if header.line else ""
    if again := [number for number, line in body if head and line == head]:
        body = [line for line in body if line[1] != head]
        message = f"the header comes again in {len(again)} lines, left out: the recorder was"
        where, remedy = f"{source}, line {again[0]}", "none where the clock goes on"
        check = Check.of("F16", "warn", f"{message} started again", where=where, remedy=remedy)
        checks.append(check)
    if not body:
        raise InputRejected("T08", "a header, but no sample", where=source, remedy="record again")

    def numeric(cell: str) -> bool:
        return is_number(cell, dialect.decimal) or cell in MISSING

    row = cells_of(body[0][1], dialect.delimiter)
    said: list[Line] = []
    for number, line in body:
        first = line.split(dialect.delimiter.strip(" ") or None, 1)[0].strip()
        if numeric(first) or not re.search(r"[^\W\d_]", line):
            continue
        cells = cells_of(line, dialect.delimiter)
        _refuse_further_table(cells, number, dialect, text, body[0][0], source)
        ends = numeric(cells[0]) or numeric(cells[-1]) or any(map(FORMULA.fullmatch, cells))
        if len(cells) != dialect.width and not ends and re.search(r"[^\W\d_]{3}", line):
            said.append((number, line))
    of_numbers = numeric(row[0]) and numeric(row[-1])
    if not said or not of_numbers or len(said) > TEXT.most_messages * len(body):
        return body
    words = f"{len(said)} lines of text between the rows left out"
    words += f", the first is line {said[0][0]}: '{clean(said[0][1], 60)}'"
    remedy = "none where these are messages of the recorder"
    checks.append(Check.of("F09", "warn", words, where=source, remedy=remedy))
    left_out = {number for number, _ in said}
    return [line for line in body if line[0] not in left_out]


def _refuse_further_table(
    names: list[str], number: int, dialect: Dialect, text: str, first: int, source: str
) -> None:
    """F16: at a line of other names than those above line `first` another table begins."""
    words = [name for name in names if name not in MISSING and not is_number(name)]
    if not 1 < len(names) == len(words) == dialect.width < 2 * len(set(words)):
        return
    above = text.split("\n", first)[: first - 1]
    if not names[0][:1].isalpha() or names in [cells_of(x, dialect.delimiter) for x in above]:
        return  # the recorder was started again
    message = f"a further table begins, of {', '.join(names[:3])[:60]} …"
    where, remedy = f"{source}, line {number}", "save each table in a file of its own"
    raise InputRejected("F16", message, where=where, remedy=remedy)


def _undamaged(
    body: list[Line],
    whole: bool,
    dialect: Dialect,
    names: tuple[str, ...],
    source: str,
    checks: list[Check],
) -> RawTable:
    """F09: return the undamaged lines; little damage is left out and named."""
    damage: dict[int, str] = {}  # by index in the body
    for i, (number, line) in enumerate(body):
        simple = dialect.delimiter not in ("", " ") and '"' not in line
        cells = [] if simple else cells_of(line, dialect.delimiter)
        count = len(cells) or line.count(dialect.delimiter) + 1
        if count != dialect.width:
            for name, cell in zip(names, cells_of(line, dialect.delimiter), strict=False):
                _refuse_formula(cell, name, number, source)
            damage[i] = f"{count} cells, not {dialect.width}"
    torn = set(damage)
    if not whole and len(body) - 1 not in torn:
        torn.add(len(body) - 1)
        message = "the last line has no line end: whether its last number is whole is not known"
        where = f"{source}, line {body[-1][0]}"
        remedy = "end the recording before the file is copied"
        message += ", it is left out"
        checks.append(Check.of("F09", "warn", message, where=where, remedy=remedy))
    good = [i for i in range(len(body)) if i not in torn]
    if not good:
        remedy = "record again, or copy the file again"
        raise InputRejected("T08", "no whole line of numbers", where=source, remedy=remedy)
    table, wrong = _columns([body[i] for i in good], dialect, names, source)
    damage |= {good[i]: reason for i, reason in wrong.items()}
    if damage:
        first = sorted(damage)[: TEXT.most_damaged]
        listed = ", ".join(f"line {body[i][0]} ({damage[i]})" for i in first)
        share = f"{len(damage)} of {len(body)} lines"
        few = min(TEXT.most_damaged, max(1, int(TEXT.damaged_share * len(body))))
        if len(damage) > few:
            message = f"{share} are out of step with the columns: {listed}"
            remedy = "export the file again, or cut the damaged part out"
            raise InputRejected("F09", message, where=source, remedy=remedy)
        message = f"{share} left out: {listed}"
        remedy = "copy or export the file again to have them all"
        checks.append(Check.of("F09", "repair", message, where=source, remedy=remedy))
    return _without(table, wrong)


def _without(table: RawTable, wrong: Container[int]) -> RawTable:
    """Return the table without some samples, by index."""
    keep = [k for k in range(table.rows.size) if k not in wrong]
    columns = {name: np.ascontiguousarray(x[keep]) for name, x in table.columns.items()}
    lines = None if table.lines is None else table.lines[keep]
    return replace(table, columns=columns, rows=np.arange(len(keep)), lines=lines)


def _columns(
    lines: list[Line], dialect: Dialect, names: tuple[str, ...], source: str
) -> tuple[RawTable, dict[int, str]]:
    """Return the columns: all numbers at once, or cell by cell to find which is no number.

    Lines (by index) with a cell of another kind come with the reason.
    """
    # numpy rounds every number correctly; pandas does so in some versions only.
    whole = "\n".join(line for _, line in lines)
    whole = whole.replace(",", ".") if dialect.decimal == "," else whole
    delimiter = dialect.delimiter.strip(" ") or None
    try:
        numbers = np.loadtxt(
            io.StringIO(whole), comments=None, delimiter=delimiter, quotechar='"', ndmin=2
        )
    except (ValueError, OverflowError):
        numbers = np.empty((0, 0))
    groups: dict[str, list[str]] = {}  # "q_1", "q_2", … may be asked for together as "q"
    for name in names:
        stem = name.rstrip("0123456789")
        if stem != name:
            groups.setdefault(stem.removesuffix("_"), []).append(name)
    at = np.array([number for number, _ in lines], dtype=np.int64)
    together = {stem: tuple(members) for stem, members in groups.items()}
    table = RawTable(source, {}, np.arange(len(lines)), groups=together, lines=at)
    if numbers.shape == (len(lines), len(names)):
        columns = dict(zip(names, np.ascontiguousarray(numbers.T), strict=True))
        return replace(table, columns=columns), {}
    rows = [cells_of(line, dialect.delimiter) for _, line in lines]
    wrong: dict[int, str] = {}
    columns, words = dict[str, Array](), list[RawTable]()
    for name, cells in zip(names, map(list, zip(*rows, strict=True)), strict=True):
        number = [is_number(cell, dialect.decimal) for cell in cells]
        bad = [i for i, c in enumerate(cells) if not number[i] and c not in MISSING]
        for i in bad:
            _refuse_formula(cells[i], name, lines[i][0], source)
        if len(bad) > max(TEXT.most_damaged, len(cells) // 2) or (bad and len(bad) == len(cells)):
            words.append(_words(table, name, cells, cells[bad[0]]))
            columns |= words[-1].columns
            continue
        pairs = zip(cells, number, strict=True)
        columns[name] = np.array([_value(c, dialect.decimal) if ok else np.nan for c, ok in pairs])
        wrong |= {i: f"'{cells[i][:30]}' in column '{name}' is no number" for i in bad}
    if not columns:
        remedy = "rrrid import reads CSV and text tables, MAT (v5, v7.3) and NPY"
        raise InputRejected("F16", "no column of numbers", where=source, remedy=remedy)
    return replace(
        table,
        columns=columns,
        units={name: unit for found in words for name, unit in found.units.items()},
        text={name: text for found in words for name, text in found.text.items()},
        labels={name: text for found in words for name, text in found.labels.items()},
        cycles={name: cycle for found in words for name, cycle in found.cycles.items()},
    ), wrong


def _value(cell: str, decimal: str) -> float:
    point = cell.replace(",", ".") if decimal == "," else cell
    return float(cell if "inf" in cell.lower() else re.sub("[dD]", "e", point))


def _refuse_formula(cell: str, column: str, line: int, source: str) -> None:
    if FORMULA.fullmatch(cell):
        message = f"'{cell[:30]}' in column '{column}' is a spreadsheet's formula or error"
        remedy = "export the recording itself, not an edited sheet"
        raise InputRejected("F16", message, where=f"{source}, line {line}", remedy=remedy)


def _words(table: RawTable, name: str, cells: list[str], example: str) -> RawTable:
    """Return a table of one column alone, of times of the day, durations, arrays or text."""
    if (seconds := _clock_times(cells)) is not None:
        return replace(table, columns={name: seconds}, units={name: "s"})
    # Numbers with one known unit behind them, as MATLAB writes a duration: "0.004 sec".
    found = [m for cell in cells if (m := WITH_UNIT.fullmatch(cell)) is not None]
    units = {canonical_unit(m[2]) for m in found}
    if len(found) == len(cells) and len(units) == 1 and units <= UNITS.keys():
        numbers = np.array([float(m[1]) for m in found])
        return replace(table, columns={name: numbers}, units={name: units.pop()})
    # Arrays, as Python and numpy write them.
    arrays = all(cell[:1] + cell[-1:] in ("[]", "()") for cell in cells)
    lists = [re.split(r"[\s,;]+", cell[1:-1].strip(" ,")) for cell in cells] if arrays else []
    lengths = sorted({len(row) for row in lists})
    if len(lengths) == 1 and all(is_number(number) for row in lists for number in row):
        items = enumerate(np.array(lists, dtype=np.float64).T)
        return replace(table, columns={f"{name}[{k}]": values for k, values in items})
    example = example[: TEXT.longest_example]
    if len(lengths) > 1:  # as of two publishers
        example = f"arrays of {lengths[0]} to {lengths[-1]} items: keep the rows of one kind"
    # After how many samples it repeats: after one, or after the joints of an arm.
    most = min(TEXT.most_joints, len(cells) // 2)
    period = next((k for k in range(1, most + 1) if cells[k:] == cells[:-k]), 0)
    labels = {name: cells[0]} if period == 1 else {}
    cycles = {name: tuple(cells[:period])} if period > 1 else {}
    return replace(table, text={name: example}, labels=labels, cycles=cycles)


def _clock_times(cells: list[str]) -> Array | None:
    """Return seconds [s] of times such as "2024-05-17T11:30:00.125Z" or "1:30 PM", over midnight.

    Hours that stay below 13 and start again after noon are of a clock of 12 hours.
    """
    found = [m for cell in cells if (m := _TIME_OF_DAY.search(cell)) is not None]
    if len(found) < len(cells):
        return None
    halves = any(m[5] for m in found)
    hours = np.array([int(m[1]) % 12 + 12 * (m[5] in "Pp") if m[5] else int(m[1]) for m in found])
    minutes = [60.0 * int(m[2]) + float(f"{m[3]}.{m[4] or 0}") for m in found]
    seconds = np.array(minutes) + 3600.0 * hours
    day = 86400.0 if halves or (hours > TEXT.half_day).any() else 43200.0
    again = np.diff(seconds) < -0.5 * day
    return np.asarray(seconds + day * np.concatenate([[0.0], np.cumsum(again)]))


def _without_repeats(columns: Mapping[str, Array], header: Header, source: str) -> dict[str, Array]:
    """Return the columns without those that repeat one of the same name: a clock of each channel.

    Raises:
        InputRejected: S03, two columns of one name hold different numbers.
    """
    places: dict[str, list[int]] = {}
    for name, first in header.again.items():
        both = [columns[key] for key in (name, first) if key in columns]
        if len(both) == 1 or not both or not np.array_equal(both[0], both[1], equal_nan=True):
            at = places.setdefault(first, [header.names.index(first) + 1])
            at.append(header.names.index(name) + 1)
    if places:
        pairs = [(", ".join(map(str, at)), name[:80]) for name, at in places.items()][:8]
        message = "; ".join(f"columns {at} are all named '{name}'" for at, name in pairs)
        where, remedy = f"{source}, line {header.line}", "give each its own name in the file"
        raise InputRejected("S03", message, where=where, remedy=remedy)
    return {name: values for name, values in columns.items() if name not in header.again}


def _transposed(
    lines: list[Line], dialect: Dialect, source: str, checks: list[Check]
) -> RawTable | None:
    """S11: read a table of few, long lines, one signal a line, perhaps behind its name and unit.

    None where some line does not hold numbers from the same cell on.
    """
    rows = [cells_of(line, dialect.delimiter) for _, line in lines]
    decimal = dialect.decimal
    starts = (k for k in range(3) if all(len(r) > k and is_number(r[k], decimal) for r in rows))
    begin = next(starts, None)
    if begin is None:
        return None
    for (number, _), row in zip(lines, rows, strict=True):
        if abs(len(row) - dialect.width) > 1:
            message, where = f"{len(row)} cells, not {dialect.width}", f"{source}, line {number}"
            remedy = "export the file again, one line a sample"
            raise InputRejected("F09", message, where=where, remedy=remedy)
    labels = [row[0] if begin else f"line_{i}" for i, row in enumerate(rows, start=1)]
    names, units, again = names_and_units(labels)
    if begin > 1:
        second = zip(names, (row[1].strip("[]() -") for row in rows), strict=True)
        units |= {name: unit for name, unit in second if unit}
    length = min(len(row) - (not row[-1]) for row in rows)
    cells = ("\t".join(row[k].replace(",", ".") for row in rows) for k in range(begin, length))
    body = list(enumerate(cells, start=begin + 1))
    table, _ = _columns(body, Dialect("\t", ".", len(rows)), names, source)
    header = Header(names, units, again=again, line=lines[0][0])
    columns = _without_repeats(table.columns, header, source)
    message = f"{len(rows)} lines of {length - begin} numbers, read with time along the line"
    remedy = "store one line a sample"
    checks.append(Check.of("S11", "warn", message, where=source, remedy=remedy))
    return replace(table, columns=columns, units=units, lines=None, checks=tuple(checks))
