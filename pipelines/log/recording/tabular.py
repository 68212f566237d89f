"""Read a recorded text file: its dialect is found out, its damage is counted, no line is guessed.

A line with the wrong number of cells, or with a cell that is no number, is left out and named, as long as such lines
are few (F09); the last line of a file that does not end in a line end is left out, because whether its last number is
whole cannot be told. Spreadsheet errors and formulas are refused: the numbers around them are not a recording.
"""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipelines.errors import Check, InputRejected
from pipelines.log.experiment import Array
from pipelines.log.limits import FEWEST
from pipelines.log.recording.dialect import (
    MISSING,
    WITH_UNIT,
    Dialect,
    TextFormat,
    cells_of,
    decode,
    find_dialect,
    is_number,
    lines_of,
)
from pipelines.log.recording.header import (
    FORMULA,
    Header,
    find_header,
    names_and_units,
    without_repeats,
)
from pipelines.log.recording.labelled import LabelledLines, labelled_lines
from pipelines.log.recording.raw import RawTable
from pipelines.log.units import UNITS, canonical_unit

__all__ = ["TextFormat", "read_text"]

Line = tuple[int, str]

_MOST_DAMAGED = 10  # lines
_DAMAGED_SHARE = 1e-3
_MOST_JOINTS = 32
_MOST_NOTES = 40  # lines above a table
_WIDEST = 100_000  # cells in a line: a signal of 100 s at 1 kHz, stored along its row
_LONGEST_SIDE = 4  # times the other: a table of numbers is read along it
_TIME_OF_DAY = re.compile(
    r"(?<!\d)(\d{1,2}):([0-5]\d):([0-5]\d)(?:[.,:](\d{1,9}))?(?:\s?([AaPp])\.?[Mm]\b)?"
)


def read_text(data: bytes, source: str, given: TextFormat | None = None) -> RawTable:
    """The table of a CSV or text file.

    Raises:
        InputRejected: F01 nothing in it, F09 too much damage, F16 not a table of numbers, S03 two columns of one name.
    """
    given = given or TextFormat()
    text, checks = decode(data, source, given.encoding)
    if '"[' in text and given == TextFormat():  # numpy breaks the lines of an array within its cell
        parts = text.split('"')
        text = '"'.join(
            part.replace("\n", " ") if k % 2 and part[:1] + part[-1:] == "[]" else part
            for k, part in enumerate(parts)
        )
    lines = lines_of(text, given.comment)
    if not lines:
        remedy = "record again, or copy the file again"
        raise InputRejected("F01", "no line of numbers in the file", where=source, remedy=remedy)
    if given == TextFormat() and (labelled := labelled_lines(lines)) is not None:
        return _labelled(
            labelled, source, checks, tuple(line for _, line in _above(text, labelled.rows[0][0]))
        )
    dialect = find_dialect(lines, source, given)
    if dialect.width > _WIDEST:
        message = f"{dialect.width} cells in a line, {dialect.words}: not a table of columns"
        remedy = "give delimiter and decimal under [format], or one row a sample"
        raise InputRejected("F16", message, where=source, remedy=remedy)
    if (dialect.delimiter, dialect.decimal) not in (
        (",", "."),
        ("\t", "."),
        ("", "."),
    ) and given.delimiter is None:
        message = f"read as: {dialect.words}"
        remedy = "say so under [format] to be sure"
        checks.append(Check.of("F16", "warn", message, where=source, remedy=remedy))
    long = dialect.width >= max(_LONGEST_SIDE * len(lines), FEWEST) and given.header is None
    if long and (turned := _transposed(lines, dialect, source, checks)) is not None:
        return turned
    header = find_header(lines, text, dialect, source, given.header)
    names, units, body = header.names, header.units, lines[header.first :]
    if header.skipped:
        checks.append(
            Check.of(
                "F16",
                "warn",
                f"{header.skipped} lines before the table left out",
                where=f"{source}, line {lines[0][0]}",
                remedy="give header or comment under [format] if these are data",
            )
        )
    if not body:
        raise InputRejected("T08", "a header, but no sample", where=source, remedy="record again")
    head = text.split("\n")[header.line - 1] if header.line else ""
    if again := [number for number, line in body if head and line == head]:
        body = [line for line in body if line[1] != head]
        checks.append(
            Check.of(
                "F16",
                "warn",
                f"the header comes again in {len(again)} lines, left out: the recorder was started "
                "again",
                where=f"{source}, line {again[0]}",
                remedy="none where the clock goes on",
            )
        )
    _refuse_further_table(body, dialect, text, source)
    kept, columns, words, labels = _numbers(
        body, text.endswith("\n"), dialect, names, source, checks
    )
    columns = without_repeats(columns, header, source)
    notes = tuple(line for number, line in _above(text, body[0][0]) if number != header.line)
    lines_kept = np.array([number for number, _ in kept], dtype=np.int64)
    # Counted over the lines of data alone: an empty line or a comment between them loses no sample.
    rows = np.searchsorted(np.array([number for number, _ in body], dtype=np.int64), lines_kept)
    breaks = tuple(int(i) + 1 for i in np.flatnonzero(np.diff(rows) > 1))
    for name in [
        name
        for name, values in columns.items()
        if name.startswith("column_") and np.isnan(values).all()
    ]:
        del columns[name]  # every line ends in a delimiter
    in_cells = {name: labels.pop(name) for name in columns if name in labels}
    return RawTable(
        source,
        columns,
        rows,
        units={**units, **in_cells},
        text=words,
        lines=lines_kept,
        breaks=breaks,
        checks=tuple(checks),
        groups=_numbered(names),
        notes=notes,
        labels={name: label for name, label in labels.items() if isinstance(label, str)},
        cycles={name: label for name, label in labels.items() if isinstance(label, tuple)},
    )


def _above(text: str, first: int) -> list[Line]:
    """The last lines above line `first` with their numbers."""
    return list(enumerate(text.split("\n", first)[: first - 1], start=1))[-_MOST_NOTES:]


def _labelled(
    found: LabelledLines, source: str, checks: list[Check], notes: tuple[str, ...]
) -> RawTable:
    """F09: lines of another form are left out; they are notes between the samples."""
    if found.others:
        message = f"{found.others} lines without the numbers of the others left out"
        remedy = "none where these are notes"
        checks.append(Check.of("F09", "warn", message, where=source, remedy=remedy))
    body = [(number, "\t".join(row)) for number, row in found.rows]
    columns, words, wrong, units = _parse(
        body, Dialect("\t", ".", len(found.names)), found.names, source
    )
    keep = np.array([i not in wrong for i in range(len(body))], dtype=bool)
    lines = np.array([number for number, _ in body], dtype=np.int64)[keep]
    columns = {name: values[keep] for name, values in columns.items()}
    return RawTable(
        source,
        columns,
        np.arange(lines.size),
        text=words,
        lines=lines,
        units={name: units[name] for name in columns if name in units},
        checks=tuple(checks),
        notes=notes,
    )


def _numbered(names: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Columns "q_1", "q_2", … may be asked for together as "q"."""
    groups: dict[str, list[str]] = {}
    for name in names:
        stem = name.rstrip("0123456789")
        if stem != name:
            groups.setdefault(stem.removesuffix("_"), []).append(name)
    return {stem: tuple(found) for stem, found in groups.items()}


def _transposed(
    lines: list[Line], dialect: Dialect, source: str, checks: list[Check]
) -> RawTable | None:
    """S11: a table of few, long lines holds one signal a line; a name and a unit may come before its numbers.

    None where some line does not hold numbers from the same cell on.
    """
    rows = [cells_of(line, dialect.delimiter) for _, line in lines]
    begin = next(
        (
            k
            for k in range(3)
            if all(len(row) > k and is_number(row[k], dialect.decimal) for row in rows)
        ),
        None,
    )
    if begin is None:
        return None
    for (number, _), row in zip(lines, rows, strict=True):
        if abs(len(row) - dialect.width) > 1:
            message = f"{len(row)} cells, not {dialect.width}"
            remedy = "export the file again, one line a sample"
            raise InputRejected("F09", message, where=f"{source}, line {number}", remedy=remedy)
    names, units, again = names_and_units(
        [row[0] if begin else f"line_{i}" for i, row in enumerate(rows, start=1)]
    )
    if begin > 1:
        units |= {
            name: row[1].strip("[]() ")
            for name, row in zip(names, rows, strict=True)
            if row[1].strip("[]() -")
        }
    length = min(len(row) - (not row[-1]) for row in rows)
    body = [
        (k + 1, "\t".join(row[k].replace(",", ".") for row in rows)) for k in range(begin, length)
    ]
    columns, words, _, _ = _parse(body, Dialect("\t", ".", len(rows)), names, source)
    columns = without_repeats(columns, Header(names, units, 0, 0, again, lines[0][0]), source)
    samples = length - begin
    message = f"{len(rows)} lines of {samples} numbers, read with time along the line"
    checks.append(Check.of("S11", "warn", message, where=source, remedy="store one line a sample"))
    return RawTable(
        source,
        columns,
        np.arange(samples),
        units=units,
        text=words,
        checks=tuple(checks),
        groups=_numbered(names),
    )


@dataclass(frozen=True)
class _Damage:
    index: int  # in the body
    line: int
    reason: str


def _numbers(
    body: list[Line],
    whole: bool,
    dialect: Dialect,
    names: tuple[str, ...],
    source: str,
    checks: list[Check],
) -> tuple[list[Line], dict[str, Array], dict[str, str], _Labels]:
    widths = [
        line.count(dialect.delimiter) + 1
        if dialect.delimiter not in ("", " ") and '"' not in line
        else len(cells_of(line, dialect.delimiter))
        for _, line in body
    ]
    damage = [
        _Damage(i, body[i][0], f"{width} cells, not {dialect.width}")
        for i, width in enumerate(widths)
        if width != dialect.width
    ]
    for found in damage:
        _refuse_formulas(
            body[found.index], cells_of(body[found.index][1], dialect.delimiter), names, source
        )
    torn = {found.index for found in damage}
    if not whole and len(body) - 1 not in torn:
        torn.add(len(body) - 1)
        checks.append(
            Check.of(
                "F09",
                "warn",
                "the last line has no line end: whether its last number is whole is not known, it is left out",
                where=f"{source}, line {body[-1][0]}",
                remedy="end the recording before the file is copied",
            )
        )
    good = [i for i in range(len(body)) if i not in torn]
    if not good:
        remedy = "record again, or copy the file again"
        raise InputRejected("T08", "no whole line of numbers", where=source, remedy=remedy)
    columns, words, wrong, labels = _parse([body[i] for i in good], dialect, names, source)
    damage += [_Damage(good[i], body[good[i]][0], reason) for i, reason in wrong.items()]
    _judge(damage, len(body), source, checks)
    keep = np.array([i not in wrong for i in range(len(good))], dtype=bool)
    return (
        [body[i] for i, kept in zip(good, keep, strict=True) if kept],
        {name: np.ascontiguousarray(values[keep]) for name, values in columns.items()},
        words,
        labels,
    )


_Labels = dict[str, Any]
_Parsed = tuple[dict[str, Array], dict[str, str], dict[int, str], _Labels]


def _parse(lines: list[Line], dialect: Dialect, names: tuple[str, ...], source: str) -> _Parsed:
    """Columns of numbers, columns of text with an example, the lines (by index) with a cell that is no number, and labels:
    the text of a column that never changes, the texts that one goes through, the unit behind the numbers of one."""
    # numpy rounds every number correctly; pandas does so only where asked, and newer ones refuse to be asked.
    text = "\n".join(line for _, line in lines)
    try:
        found = np.loadtxt(
            io.StringIO(text.replace(",", ".") if dialect.decimal == "," else text),
            dtype=np.float64,
            comments=None,
            delimiter=dialect.delimiter.strip(" ") or None,
            quotechar='"',
            ndmin=2,
        )
        if found.shape == (len(lines), len(names)):
            return (
                {name: np.ascontiguousarray(found[:, j]) for j, name in enumerate(names)},
                {},
                {},
                {},
            )
    except (ValueError, OverflowError):
        pass
    return _parse_slowly(lines, dialect, names, source)


def _parse_slowly(
    lines: list[Line], dialect: Dialect, names: tuple[str, ...], source: str
) -> _Parsed:
    """Cell by cell, to find out which cell is no number."""
    cells = [cells_of(line, dialect.delimiter) for _, line in lines]
    labels: _Labels = {}
    columns: dict[str, Array] = {}
    words: dict[str, str] = {}
    wrong: dict[int, str] = {}
    for j, name in enumerate(names):
        values = np.full(len(cells), np.nan)
        bad: list[int] = []
        for i, row in enumerate(cells):
            if is_number(row[j], dialect.decimal):
                values[i] = float(
                    re.sub(
                        "[dD]", "e", row[j].replace(",", ".") if dialect.decimal == "," else row[j]
                    )
                    if "inf" not in row[j].lower()
                    else row[j]
                )
            elif row[j] not in MISSING:
                bad.append(i)
        for i in bad:
            _refuse_formulas(lines[i], [cells[i][j]], (name,), source)
        if len(bad) > max(_MOST_DAMAGED, len(cells) // 2) or (bad and len(bad) == len(cells)):
            if (
                read := _clock_times([row[j] for row in cells])
                or _with_units([row[j] for row in cells])
            ) is not None:
                columns[name], labels[name] = read
                continue
            if (arrays := _arrays([row[j] for row in cells])) is not None:
                columns |= {f"{name}[{k}]": values for k, values in enumerate(arrays.T)}
                continue
            words[name] = _lengths([row[j] for row in cells]) or cells[bad[0]][j][:40]
            if (period := _period([row[j] for row in cells])) is not None:
                labels[name] = (
                    cells[0][j] if period == 1 else tuple(row[j] for row in cells[:period])
                )
        else:
            columns[name] = values
            wrong |= {i: f"'{cells[i][j][:30]}' in column '{name}' is no number" for i in bad}
    if not columns:
        remedy = "rrrid import reads CSV and text tables, MAT (v5, v7.3) and NPY"
        raise InputRejected("F16", "no column of numbers", where=source, remedy=remedy)
    return columns, words, wrong, labels


def _period(cells: list[str]) -> int | None:
    """The number of samples after which a column of text repeats, up to that of the joints of an arm; 1 where it never changes."""
    return next(
        (k for k in range(1, min(_MOST_JOINTS, len(cells) // 2) + 1) if cells[k:] == cells[:-k]),
        None,
    )


def _with_units(cells: list[str]) -> tuple[Array, str] | None:
    """Numbers that have one known unit behind them, as MATLAB writes a duration: "0.004 sec"."""
    found = [WITH_UNIT.fullmatch(cell) for cell in cells]
    units = {m[2] for m in found if m is not None}
    if not all(found) or len(units) != 1 or (unit := canonical_unit(units.pop())) not in UNITS:
        return None
    return np.array([float(m[1]) for m in found if m is not None]), unit


def _arrays(cells: list[str]) -> Array | None:
    """Arrays of one length in the cells of a column, as Python and numpy write them: "[0.1, 0.2]". (cells, length)"""
    rows = _lists(cells)
    alike = len({len(row) for row in rows}) == 1 and all(
        is_number(number) for row in rows for number in row
    )
    return np.array(rows, dtype=np.float64) if alike else None


def _lists(cells: list[str]) -> list[list[str]]:
    """The items of arrays in cells, none where a cell is no array."""
    arrays = all(cell[:1] + cell[-1:] in ("[]", "()") for cell in cells)
    return [re.split(r"[\s,;]+", cell[1:-1].strip(" ,")) for cell in cells] if arrays else []


def _lengths(cells: list[str]) -> str:
    """Say of how many items the arrays in cells are where that differs, as where two publishers share a topic."""
    found = sorted({len(row) for row in _lists(cells)})
    return (
        f"arrays of {found[0]} to {found[-1]} items: keep the rows of one kind"
        if len(found) > 1
        else ""
    )


def _clock_times(cells: list[str]) -> tuple[Array, str] | None:
    """Seconds of the day of texts such as "2024-05-17T11:30:00.125Z" or "1:30:00 PM", going on over midnight. [s]

    Hours that stay below 13 and start again after noon are of a clock of 12 hours.
    """
    found = [_TIME_OF_DAY.search(cell) for cell in cells]
    if not all(found):
        return None
    hours = [
        int(m[1]) % 12 + 12 * (m[5] in "Pp") if m[5] else int(m[1]) for m in found if m is not None
    ]
    seconds = np.array(
        [60.0 * int(m[2]) + float(f"{m[3]}.{m[4] or 0}") for m in found if m is not None]
    ) + 3600.0 * np.array(hours)
    half = (
        1.0 if max(hours) > 12 or any(m[5] for m in found if m is not None) else 0.5
    )  # of a day, after which they start again
    again = np.diff(seconds) < -0.5 * half * 86400.0
    return seconds + half * 86400.0 * np.concatenate([[0.0], np.cumsum(again)]), "s"


def _refuse_further_table(body: list[Line], dialect: Dialect, text: str, source: str) -> None:
    """F16: a line of other names than those above the table is no damage, a table of other columns begins at it."""
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
        remedy = "save each table in a file of its own"
        raise InputRejected("F16", message, where=f"{source}, line {number}", remedy=remedy)


def _refuse_formulas(line: Line, cells: list[str], names: tuple[str, ...], source: str) -> None:
    for j, cell in enumerate(cells):
        if FORMULA.fullmatch(cell):
            name = names[j] if j < len(names) else str(j + 1)
            message = f"'{cell[:30]}' in column '{name}' is a spreadsheet's formula or error"
            remedy = "export the recording itself, not an edited sheet"
            raise InputRejected("F16", message, where=f"{source}, line {line[0]}", remedy=remedy)


def _judge(damage: list[_Damage], total: int, source: str, checks: list[Check]) -> None:
    """F09: little damage is left out and named, much of it is refused."""
    if not damage:
        return
    damage = sorted(damage, key=lambda found: found.index)
    listed = ", ".join(f"line {found.line} ({found.reason})" for found in damage[:_MOST_DAMAGED])
    if len(damage) > min(_MOST_DAMAGED, max(1, int(_DAMAGED_SHARE * total))):
        message = f"{len(damage)} of {total} lines are out of step with the columns: {listed}"
        remedy = "export the file again, or cut the damaged part out"
        raise InputRejected("F09", message, where=source, remedy=remedy)
    message = f"{len(damage)} of {total} lines left out: {listed}"
    remedy = "copy or export the file again to have them all"
    checks.append(Check.of("F09", "repair", message, where=source, remedy=remedy))
