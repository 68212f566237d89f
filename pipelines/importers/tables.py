"""Read a recorded text file: its format is detected, its damage is counted, no line is guessed.

A line with the wrong number of cells, or with a cell that is no number, is left out and named, as
long as such lines are few (F09); the last line of a file that does not end in a line end is left
out, because its last number may be cut. A few lines of text between the rows are messages, left out
and named. Spreadsheet errors and formulas are refused: the numbers
around them are not a recording. Lines of one form may label their numbers instead:

    [14:02:11.254] [rt] q=[0.1, 0.2] tau=[3.0, 4.0]     timestamp, q[0], q[1], tau[0], tau[1]
    <Rob><AIPos A1="0.1" A2="0.2"/><IPOC>4</IPOC></Rob>     AIPos.A1, AIPos.A2, IPOC
"""

from __future__ import annotations

import io
import re
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from pipelines.errors import Check, InputRejected, clean
from pipelines.importers.raw import RawTable
from pipelines.importers.recipe import TextFormat
from pipelines.importers.text_format import (
    FORMULA,
    MISSING,
    WITH_UNIT,
    Dialect,
    Header,
    Line,
    cells_of,
    decode,
    find_dialect,
    find_header,
    is_number,
    lines_of,
    names_and_units,
    without_repeats,
)
from pipelines.io.experiment import Array
from pipelines.io.limits import FEWEST
from pipelines.io.units import UNITS, canonical_unit

__all__ = ["LABELLED_VALUE", "read_text"]

_MOST_DAMAGED = 10  # lines
_DAMAGED_SHARE = 1e-3
_MOST_JOINTS = 32
_MOST_NOTES = 40  # lines above a table
_WORD = re.compile(r"[^\W\d_]{3}")
_WIDEST = 100_000  # cells in a line: a signal of 100 s at 1 kHz, stored along its row
_LONGEST_SIDE = 4  # times the other: a table of numbers is read along it
_TIME_OF_DAY = re.compile(
    r"(?<!\d)(\d{1,2}):([0-5]\d):([0-5]\d)(?:[.,:;](\d{1,9}))?(?:\s?([AaPp])\.?[Mm]\b)?"
)
_DATE = r"(?:\d{4}[-/.]\d\d[-/.]\d\d[T ])?\d{1,2}:\d\d:\d\d(?:[.,]\d{1,9})?Z?"
_NUMBER = (
    r"(?<![\w.])[+-]?(?:\d++\.?\d*+|\.\d++)(?:[eE][+-]?\d++)?(?![\w.])"
    r"|(?<!\w)(?:nan|NaN|[+-]?inf)(?!\w)"
)
LABELLED_VALUE = re.compile(rf"{_DATE}|{_NUMBER}")
_SPLIT = re.compile(f"({LABELLED_VALUE.pattern})")
_MARK = "\0"  # a number's place in a line's form; no text file holds it
_DAY = "\1"
_PIECE = re.compile(rf"[^\W\d][\w.]*|[\[({{<\])}}>]|{_MARK}|{_DAY}")
_LABEL = re.compile(rf"(?<![\w.])[^\W\d][\w.]*+\s*+[=:>]\s*+[\"'\[({{]*{_MARK}")
_GROUPED = re.compile(r"[-+.\d\seEnaNif]*[\[(][-+.\d\seEnaNif()\[\]]*")  # "12 (0.1 0.2) (3 4)"
_NO_BRACKETS = str.maketrans("()[]", "    ")
_SEARCHED = 200  # lines that show the form
_LEAST = 0.9  # of these, behind the first lines, and of all lines, that have one form
_LONGEST = 20_000  # characters of a line
_MOST_FORMS = 1000  # that are remembered; the words of a line may vary


def read_text(data: bytes, source: str, given: TextFormat | None = None) -> RawTable:
    """Return the table of a CSV or text file.

    Raises:
        InputRejected: F01 nothing in it, F09 too much damage, F16 no table, S03 two equal names.
    """
    given = given or TextFormat()
    text, checks = decode(data, source, given.encoding)
    if '"[' in text and given == TextFormat():  # numpy breaks the lines of an array within its cell
        parts = text.split('"')
        for k in range(1, len(parts), 2):
            if parts[k][:1] + parts[k][-1:] == "[]":
                parts[k] = parts[k].replace("\n", " ")
        text = '"'.join(parts)
    lines = lines_of(text, given.comment)
    if not lines:
        remedy = "record again, or copy the file again"
        raise InputRejected("F01", "no line of numbers in the file", where=source, remedy=remedy)
    if given == TextFormat() and (labelled := _labelled_lines(lines)) is not None:
        return _labelled(*labelled, text, source, checks)
    if given == TextFormat() and all(_GROUPED.fullmatch(line) for _, line in lines):
        lines = [(number, line.translate(_NO_BRACKETS)) for number, line in lines]
    dialect = find_dialect(lines, source, given)
    if dialect.width > _WIDEST:
        message = f"{dialect.width} cells in a line, {dialect.words}: not a table of columns"
        remedy = "give delimiter and decimal under [format], or one row a sample"
        raise InputRejected("F16", message, where=source, remedy=remedy)
    usual = ((",", "."), ("\t", "."), ("", "."))
    if (dialect.delimiter, dialect.decimal) not in usual and given.delimiter is None:
        message, remedy = f"read as: {dialect.words}", "say so under [format] to be sure"
        checks.append(Check.of("F16", "warn", message, where=source, remedy=remedy))
    long = dialect.width >= max(_LONGEST_SIDE * len(lines), FEWEST) and given.header is None
    if long and (turned := _transposed(lines, dialect, source, checks)) is not None:
        return turned
    header = find_header(lines, text, dialect, source, given.header)
    body = _body(lines, header, text, source, checks)
    body = _without_messages(body, dialect, source, checks)
    _refuse_further_table(body, dialect, text, source)
    reader = _Reader(dialect, header.names, source)
    kept, found = _numbers(body, text.endswith("\n"), reader, checks)
    columns = without_repeats(found.columns, header, source)
    notes = tuple(line for number, line in _above(text, body[0][0]) if number != header.line)
    lines_kept = np.array([number for number, _ in kept], dtype=np.int64)
    # Counted over lines of data: an empty line or a comment between them loses no sample.
    rows = np.searchsorted(np.array([number for number, _ in body], dtype=np.int64), lines_kept)
    breaks = tuple(int(i) + 1 for i in np.flatnonzero(np.diff(rows) > 1))
    # Every line ends in a delimiter:
    empty = [n for n, v in columns.items() if n.startswith("column_") and np.isnan(v).all()]
    return RawTable(
        source,
        {name: values for name, values in columns.items() if name not in empty},
        rows,
        units=header.units | {name: u for name, u in found.units.items() if name in columns},
        text=found.text,
        lines=lines_kept,
        breaks=breaks,
        checks=tuple(checks),
        groups=_numbered(header.names),
        notes=notes,
        labels=found.labels,
        cycles=found.cycles,
    )


def _above(text: str, first: int) -> list[Line]:
    """Return the last lines above line `first`."""
    return list(enumerate(text.split("\n", first)[: first - 1], start=1))[-_MOST_NOTES:]


def _body(
    lines: list[Line], header: Header, text: str, source: str, checks: list[Check]
) -> list[Line]:
    """Return the lines of data; the header may come again where the recorder was started again."""
    body = lines[header.first :]
    if header.skipped:
        message = f"{header.skipped} lines before the table left out"
        remedy = "give header or comment under [format] if these are data"
        where = f"{source}, line {lines[0][0]}"
        checks.append(Check.of("F16", "warn", message, where=where, remedy=remedy))
    head = text.split("\n")[header.line - 1] if header.line else ""
    if again := [number for number, line in body if head and line == head]:
        body = [line for line in body if line[1] != head]
        comes = f"the header comes again in {len(again)} lines, left out"
        message, where = f"{comes}: the recorder was started again", f"{source}, line {again[0]}"
        remedy = "none where the clock goes on"
        checks.append(Check.of("F16", "warn", message, where=where, remedy=remedy))
    if not body:
        raise InputRejected("T08", "a header, but no sample", where=source, remedy="record again")
    return body


def _without_messages(
    body: list[Line], dialect: Dialect, source: str, checks: list[Check]
) -> list[Line]:
    """F09: leave out a few lines of text between the rows: messages of the recorder.

    A message has words and not the cells of a row. It neither begins nor ends with a number, as the
    rows do: what does so is a damaged row.
    """
    delimiter = dialect.delimiter.strip(" ") or None

    def numeric(cell: str) -> bool:
        return is_number(cell, dialect.decimal) or cell in MISSING

    def message(line: str) -> bool:
        if numeric(line.split(delimiter, 1)[0].strip()) or not _WORD.search(line):
            return False
        cells = cells_of(line, dialect.delimiter)
        ends = numeric(cells[0]) or numeric(cells[-1])
        return len(cells) != dialect.width and not ends and not any(map(FORMULA.fullmatch, cells))

    row = cells_of(body[0][1], dialect.delimiter)
    of_numbers = numeric(row[0]) and numeric(row[-1])
    said = [line for line in body if of_numbers and message(line[1])]
    if not said or len(said) > (1.0 - _LEAST) * len(body):
        return body
    words = f"{len(said)} lines of text between the rows left out"
    words += f", the first is line {said[0][0]}: '{clean(said[0][1], 60)}'"
    remedy = "none where these are messages of the recorder"
    checks.append(Check.of("F09", "warn", words, where=source, remedy=remedy))
    left_out = {number for number, _ in said}
    return [line for line in body if line[0] not in left_out]


def _numbered(names: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Return groups: columns "q_1", "q_2", … may be asked for together as "q"."""
    groups: dict[str, list[str]] = {}
    for name in names:
        stem = name.rstrip("0123456789")
        if stem != name:
            groups.setdefault(stem.removesuffix("_"), []).append(name)
    return {stem: tuple(found) for stem, found in groups.items()}


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
        second = [row[1].strip("[]() ") for row in rows]
        units |= {
            name: unit for name, unit in zip(names, second, strict=True) if unit.strip("[]() -")
        }
    length = min(len(row) - (not row[-1]) for row in rows)
    cells = ("\t".join(row[k].replace(",", ".") for row in rows) for k in range(begin, length))
    body = list(enumerate(cells, start=begin + 1))
    found = _Reader(Dialect("\t", ".", len(rows)), names, source).read(body)
    header = Header(names, units, 0, 0, again, lines[0][0])
    columns = without_repeats(found.columns, header, source)
    message = f"{len(rows)} lines of {length - begin} numbers, read with time along the line"
    remedy = "store one line a sample"
    checks.append(Check.of("S11", "warn", message, where=source, remedy=remedy))
    return RawTable(
        source,
        columns,
        np.arange(length - begin),
        units=units,
        text=found.text,
        checks=tuple(checks),
        groups=_numbered(names),
    )


@dataclass(frozen=True)
class _Found:
    """The columns of a table."""

    columns: dict[str, Array] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)  # behind every number of a column
    text: dict[str, str] = field(default_factory=dict)  # columns of text -> an example
    labels: dict[str, str] = field(default_factory=dict)  # those that never change
    cycles: dict[str, tuple[str, ...]] = field(default_factory=dict)  # those that repeat
    wrong: dict[int, str] = field(default_factory=dict)  # lines (by index) with a bad cell


@dataclass(frozen=True)
class _Reader:
    """The reader of a table's lines."""

    dialect: Dialect
    names: tuple[str, ...]
    source: str

    def read(self, lines: list[Line]) -> _Found:
        """Return the columns: all numbers at once, or cell by cell to find which is no number."""
        # numpy rounds every number correctly; pandas does so only where asked.
        text = "\n".join(line for _, line in lines)
        text = text.replace(",", ".") if self.dialect.decimal == "," else text
        delimiter = self.dialect.delimiter.strip(" ") or None
        try:
            found = np.loadtxt(
                io.StringIO(text), comments=None, delimiter=delimiter, quotechar='"', ndmin=2
            )
        except (ValueError, OverflowError):
            return self._cell_by_cell(lines)
        if found.shape != (len(lines), len(self.names)):
            return self._cell_by_cell(lines)
        return _Found(dict(zip(self.names, map(np.ascontiguousarray, found.T), strict=True)))

    def _cell_by_cell(self, lines: list[Line]) -> _Found:
        rows = [cells_of(line, self.dialect.delimiter) for _, line in lines]
        found = _Found()
        for j, name in enumerate(self.names):
            cells = [row[j] for row in rows]
            number = [is_number(cell, self.dialect.decimal) for cell in cells]
            bad = [i for i, c in enumerate(cells) if not number[i] and c not in MISSING]
            for i in bad:
                self.refuse_formulas(lines[i], [cells[i]], (name,))
            if len(bad) > max(_MOST_DAMAGED, len(cells) // 2) or (bad and len(bad) == len(cells)):
                self._text(name, cells, cells[bad[0]], found)
                continue
            pairs = zip(cells, number, strict=True)
            values = [self._value(c) if is_one else np.nan for c, is_one in pairs]
            found.columns[name] = np.array(values, dtype=np.float64)
            words = f"in column '{name}' is no number"
            found.wrong.update({i: f"'{cells[i][:30]}' {words}" for i in bad})
        if not found.columns:
            remedy = "rrrid import reads CSV and text tables, MAT (v5, v7.3) and NPY"
            raise InputRejected("F16", "no column of numbers", where=self.source, remedy=remedy)
        return found

    def _value(self, cell: str) -> float:
        point = cell.replace(",", ".") if self.dialect.decimal == "," else cell
        return float(cell if "inf" in cell.lower() else re.sub("[dD]", "e", point))

    @staticmethod
    def _text(name: str, cells: list[str], example: str, found: _Found) -> None:
        """Read a column whose cells are times of the day, durations, arrays or text."""
        if (read := _clock_times(cells) or _with_units(cells)) is not None:
            found.columns[name], found.units[name] = read
        elif (arrays := _arrays(cells)) is not None:
            found.columns.update({f"{name}[{k}]": values for k, values in enumerate(arrays.T)})
        else:
            found.text[name] = _lengths(cells) or example[:40]
            # After how many samples it repeats: after one, or after the joints of an arm.
            most = min(_MOST_JOINTS, len(cells) // 2)
            period = next((k for k in range(1, most + 1) if cells[k:] == cells[:-k]), 0)
            if period == 1:
                found.labels[name] = cells[0]
            elif period:
                found.cycles[name] = tuple(cells[:period])

    def refuse_formulas(self, line: Line, cells: list[str], names: tuple[str, ...]) -> None:
        for j, cell in enumerate(cells):
            if FORMULA.fullmatch(cell):
                name = names[j] if j < len(names) else str(j + 1)
                message = f"'{cell[:30]}' in column '{name}' is a spreadsheet's formula or error"
                remedy = "export the recording itself, not an edited sheet"
                where = f"{self.source}, line {line[0]}"
                raise InputRejected("F16", message, where=where, remedy=remedy)


def _numbers(
    body: list[Line], whole: bool, reader: _Reader, checks: list[Check]
) -> tuple[list[Line], _Found]:
    """F09: return the undamaged lines and their columns; little damage is left out and named."""
    delimiter, width, source = reader.dialect.delimiter, reader.dialect.width, reader.source
    damage: dict[int, str] = {}  # by index in the body
    for i, (number, line) in enumerate(body):
        simple = delimiter not in ("", " ") and '"' not in line
        cells = line.count(delimiter) + 1 if simple else len(cells_of(line, delimiter))
        if cells != width:
            reader.refuse_formulas((number, line), cells_of(line, delimiter), reader.names)
            damage[i] = f"{cells} cells, not {width}"
    torn = set(damage)
    if not whole and len(body) - 1 not in torn:
        torn.add(len(body) - 1)
        no_end = "the last line has no line end: whether its last number is whole is not known"
        where = f"{source}, line {body[-1][0]}"
        remedy = "end the recording before the file is copied"
        message = f"{no_end}, it is left out"
        checks.append(Check.of("F09", "warn", message, where=where, remedy=remedy))
    good = [i for i in range(len(body)) if i not in torn]
    if not good:
        remedy = "record again, or copy the file again"
        raise InputRejected("T08", "no whole line of numbers", where=source, remedy=remedy)
    found = reader.read([body[i] for i in good])
    damage |= {good[i]: reason for i, reason in found.wrong.items()}
    if damage:
        first = sorted(damage)[:_MOST_DAMAGED]
        listed = ", ".join(f"line {body[i][0]} ({damage[i]})" for i in first)
        share = f"{len(damage)} of {len(body)} lines"
        if len(damage) > min(_MOST_DAMAGED, max(1, int(_DAMAGED_SHARE * len(body)))):
            message = f"{share} are out of step with the columns: {listed}"
            remedy = "export the file again, or cut the damaged part out"
            raise InputRejected("F09", message, where=source, remedy=remedy)
        message = f"{share} left out: {listed}"
        remedy = "copy or export the file again to have them all"
        checks.append(Check.of("F09", "repair", message, where=source, remedy=remedy))
    keep = [k for k in range(len(good)) if k not in found.wrong]
    columns = {name: np.ascontiguousarray(values[keep]) for name, values in found.columns.items()}
    found.columns.update(columns)
    return [body[good[k]] for k in keep], found


def _with_units(cells: list[str]) -> tuple[Array, str] | None:
    """Return numbers with one known unit behind them, as MATLAB writes a duration: "0.004 sec"."""
    found = [m for cell in cells if (m := WITH_UNIT.fullmatch(cell)) is not None]
    units = {m[2] for m in found}
    if len(found) < len(cells) or len(units) != 1:
        return None
    unit = canonical_unit(units.pop())
    return (np.array([float(m[1]) for m in found]), unit) if unit in UNITS else None


def _arrays(cells: list[str]) -> Array | None:
    """Return arrays of one length in the cells of a column (cells, length): "[0.1, 0.2]"."""
    rows = _lists(cells)
    alike = len({len(row) for row in rows}) == 1
    numbers = alike and all(is_number(number) for row in rows for number in row)
    return np.array(rows, dtype=np.float64) if numbers else None


def _lists(cells: list[str]) -> list[list[str]]:
    """Return the items of arrays in cells, as Python and numpy write them; none without arrays."""
    arrays = all(cell[:1] + cell[-1:] in ("[]", "()") for cell in cells)
    return [re.split(r"[\s,;]+", cell[1:-1].strip(" ,")) for cell in cells] if arrays else []


def _lengths(cells: list[str]) -> str:
    """Return the lengths of arrays in cells where they differ, as of two publishers."""
    found = sorted({len(row) for row in _lists(cells)})
    words = f"arrays of {found[0]} to {found[-1]} items" if len(found) > 1 else ""
    return words and f"{words}: keep the rows of one kind"


def _clock_times(cells: list[str]) -> tuple[Array, str] | None:
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
    day = 86400.0 if hours.max() > 12 or halves else 43200.0
    again = np.diff(seconds) < -0.5 * day
    return seconds + day * np.concatenate([[0.0], np.cumsum(again)]), "s"


def _refuse_further_table(body: list[Line], dialect: Dialect, text: str, source: str) -> None:
    """F16: at a line of other names than those above the table another table begins."""
    for number, line in body:
        if not line.lstrip(" \"'")[:1].isalpha():
            continue
        names = cells_of(line, dialect.delimiter)
        words = [name for name in names if name not in MISSING and not is_number(name)]
        if not 1 < len(names) == len(words) == dialect.width < 2 * len(set(words)):
            continue
        if names in [cells_of(above, dialect.delimiter) for _, above in _above(text, body[0][0])]:
            continue  # the recorder was started again
        message = f"a further table begins, of {', '.join(names[:3])[:60]} …"
        where, remedy = f"{source}, line {number}", "save each table in a file of its own"
        raise InputRejected("F16", message, where=where, remedy=remedy)


Rows = list[tuple[int, list[str]]]  # line number, one text a name


def _labelled_lines(lines: list[Line]) -> tuple[tuple[str, ...], Rows, int] | None:
    """Return names and rows of lines that label their numbers, and the count of other lines.

    None where the text is of another kind.
    """
    known: dict[str, tuple[str, ...]] = {}

    def names_of(line: str) -> tuple[tuple[str, ...], list[str]]:
        pieces = _SPLIT.split(line)  # words and numbers by turns
        found = pieces[1::2]
        pieces[1::2] = [_DAY if ":" in value else _MARK for value in found]
        form = " ".join("".join(pieces).split())
        names = known[form] if form in known else _names(form)
        if len(known) < _MOST_FORMS:
            known[form] = names
        return names, found

    middle = lines[len(lines) // 4 :][:_SEARCHED]
    if any(len(line) > _LONGEST for _, line in lines):
        return None
    forms = [LABELLED_VALUE.sub(_MARK, line) for _, line in middle]
    if not forms or sum(len(_LABEL.findall(form)) for form in forms) < 2 * len(forms):
        return None
    names, count = Counter(names_of(line)[0] for _, line in middle).most_common(1)[0]
    if count < _LEAST * len(middle) or len(set(names)) < max(len(names), 2):
        return None
    read = [(number, *names_of(line)) for number, line in lines]
    rows = [(number, found) for number, said, found in read if said == names]
    return (names, rows, len(lines) - len(rows)) if len(rows) >= _LEAST * len(lines) else None


def _names(form: str) -> tuple[str, ...]:
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
        elif piece in (_MARK, _DAY):
            prefix = f"{labels[-1]}." if labels and labels[-1] not in ("", label) else ""
            found.append("timestamp" if piece == _DAY else prefix + label)
            label = label if labels and labels[-1] == label else ""
        elif tag:
            labels[-1], tag = piece, False
            label = piece
        else:
            label = piece
    times, place = Counter(found), Counter[str]()
    names = []
    for k, name in enumerate(found, start=1):
        several = bool(name) and times[name] > 1
        names.append(f"{name}[{place[name]}]" if several else name or f"column_{k}")
        place[name] += 1
    return tuple(names)


def _labelled(
    names: tuple[str, ...], rows: Rows, others: int, text: str, source: str, checks: list[Check]
) -> RawTable:
    """F09: return the table of labelled lines; lines of another form are notes."""
    if others:
        message = f"{others} lines without the numbers of the others left out"
        remedy = "none where these are notes"
        checks.append(Check.of("F09", "warn", message, where=source, remedy=remedy))
    body = [(number, "\t".join(row)) for number, row in rows]
    found = _Reader(Dialect("\t", ".", len(names)), names, source).read(body)
    keep = [i for i in range(len(body)) if i not in found.wrong]
    return RawTable(
        source,
        {name: values[keep] for name, values in found.columns.items()},
        np.arange(len(keep)),
        text=found.text,
        lines=np.array([body[i][0] for i in keep], dtype=np.int64),
        units=found.units,
        checks=tuple(checks),
        notes=tuple(line for _, line in _above(text, rows[0][0])),
    )
