"""Read a recorded text file: its dialect is found out, its damage is counted, no line is guessed.

A line with the wrong number of cells, or with a cell that is no number, is left out and named, as long as such lines
are few (F09); the last line of a file that does not end in a line end is left out, because whether its last number is
whole cannot be told. Spreadsheet errors and formulas are refused: the numbers around them are not a recording.
"""

from __future__ import annotations

import io
import re
from dataclasses import dataclass

import numpy as np

from pipelines.errors import Check, InputRejected
from pipelines.log.experiment import Array
from pipelines.log.recording.dialect import MISSING, Dialect, TextFormat, cells_of, decode, find_dialect, is_number, lines_of
from pipelines.log.recording.raw import RawTable, header_unit

__all__ = ["TextFormat", "read_text"]

Line = tuple[int, str]

_MOST_DAMAGED = 10  # lines
_DAMAGED_SHARE = 1e-3
_WIDEST = 100_000  # cells in a line: a signal of 100 s at 1 kHz, stored along its row
_FORMULA = re.compile(r"\s*(#(REF|DIV/0|N/A|NAME|VALUE|NUM|NULL)[!?]?|=.+|@.+)\s*")


def read_text(data: bytes, source: str, given: TextFormat | None = None) -> RawTable:
    """The table of a CSV or text file.

    Raises:
        InputRejected: F01 nothing in it, F09 too much damage, F16 not a table of numbers, S03 two columns of one name.
    """
    given = given or TextFormat()
    text, checks = decode(data, source, given.encoding)
    lines = lines_of(text, given.comment)
    if not lines:
        raise InputRejected("F01", "no line of numbers in the file", where=source, remedy="record again, or copy the file again")
    dialect = find_dialect(lines, source, given)
    if dialect.width > _WIDEST:
        raise InputRejected("F16", f"{dialect.width} cells in a line, {dialect.words}: not a table of columns", where=source,
                            remedy="give delimiter and decimal under [format], or one row a sample")
    if (dialect.delimiter, dialect.decimal) not in ((",", "."), ("\t", "."), ("", ".")) and given.delimiter is None:
        checks.append(Check.of("F16", "warn", f"read as: {dialect.words}", where=source, remedy="say so under [format] to be sure"))
    names, units, body = _header(lines, text, dialect, source, given, checks)
    if not body:
        raise InputRejected("T08", "a header, but no sample", where=source, remedy="record again")
    kept, columns, words = _numbers(body, text.endswith("\n"), dialect, names, source, checks)
    lines_kept = np.array([number for number, _ in kept], dtype=np.int64)
    # Counted over the lines of data alone: an empty line or a comment between them loses no sample.
    rows = np.searchsorted(np.array([number for number, _ in body], dtype=np.int64), lines_kept)
    breaks = tuple(int(i) + 1 for i in np.flatnonzero(np.diff(rows) > 1))
    return RawTable(source, columns, rows, units=units, text=words, lines=lines_kept, breaks=breaks, checks=tuple(checks),
                    groups=_numbered(names))


def _numbered(names: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Columns "q_1", "q_2", … may be asked for together as "q"."""
    groups: dict[str, list[str]] = {}
    for name in names:
        stem = name.rstrip("0123456789")
        if stem != name:
            groups.setdefault(stem.removesuffix("_"), []).append(name)
    return {stem: tuple(found) for stem, found in groups.items()}


def _header(lines: list[Line], text: str, dialect: Dialect, source: str, given: TextFormat,
            checks: list[Check]) -> tuple[tuple[str, ...], dict[str, str], list[Line]]:
    """Names, units and the lines of data."""
    at = next((i for i, (_, line) in enumerate(lines) if len(cells_of(line, dialect.delimiter)) == dialect.width), 0)
    cells = cells_of(lines[at][1], dialect.delimiter)
    is_data = given.header is False or all(is_number(cell, dialect.decimal) or cell in MISSING for cell in cells)
    if at > 0:
        checks.append(Check.of("F16", "warn", f"{at} lines before the table left out", where=f"{source}, line {lines[0][0]}",
                               remedy="give header or comment under [format] if these are data"))
    if is_data:
        names = _comment_header(text, lines[at][0], dialect) or tuple(f"column_{j + 1}" for j in range(dialect.width))
        return *_named(names, source, lines[at][0]), lines[at:]
    body = lines[at + 1 :]
    names, units = _named(tuple(cells), source, lines[at][0])
    if len(body) > 1 and _is_unit_row(body[0][1], body[1][1], dialect):
        row = (cell.strip("[]() ") for cell in cells_of(body[0][1], dialect.delimiter))
        units |= {name: unit for name, unit in zip(names, row, strict=True) if unit}
        body = body[1:]
    return names, units, body


def _is_unit_row(line: str, following: str, dialect: Dialect) -> bool:
    """A second line of the header: one word a column, no number, and numbers below it."""
    cells = cells_of(line, dialect.delimiter)
    return (len(cells) == dialect.width and not any(is_number(cell, dialect.decimal) or _FORMULA.fullmatch(cell) for cell in cells)
            and any(is_number(cell, dialect.decimal) for cell in cells_of(following, dialect.delimiter)))


def _comment_header(text: str, first: int, dialect: Dialect) -> tuple[str, ...] | None:
    """numpy.savetxt and many loggers write the names into the last comment above the numbers."""
    above = [line for line in text.split("\n")[: first - 1] if line.strip()]
    if not above:
        return None
    cells = cells_of(above[-1].lstrip().lstrip("#%/").strip(), dialect.delimiter)
    return tuple(cells) if len(cells) == dialect.width and not any(is_number(cell) for cell in cells) else None


def _named(cells: tuple[str, ...], source: str, line: int) -> tuple[tuple[str, ...], dict[str, str]]:
    """S03: names and units; two columns of one name are refused, both named."""
    pairs = [header_unit(cell) for cell in cells]
    names = tuple(name or f"column_{j + 1}" for j, (name, _) in enumerate(pairs))
    first: dict[str, int] = {}
    for j, name in enumerate(names):
        if first.setdefault(name, j) != j:
            raise InputRejected("S03", f"columns {first[name] + 1} and {j + 1} are both named '{name[:80]}'",
                                where=f"{source}, line {line}",
                                remedy="rename one of them in the file")
    return names, {name: unit for name, (_, unit) in zip(names, pairs, strict=True) if unit}


@dataclass(frozen=True)
class _Damage:
    index: int  # in the body
    line: int
    reason: str


def _numbers(body: list[Line], whole: bool, dialect: Dialect, names: tuple[str, ...], source: str,
             checks: list[Check]) -> tuple[list[Line], dict[str, Array], dict[str, str]]:
    widths = [line.count(dialect.delimiter) + 1 if dialect.delimiter not in ("", " ") and '"' not in line
              else len(cells_of(line, dialect.delimiter)) for _, line in body]
    damage = [_Damage(i, body[i][0], f"{width} cells, not {dialect.width}") for i,
              width in enumerate(widths) if width != dialect.width]
    for found in damage:
        _refuse_formulas(body[found.index], cells_of(body[found.index][1], dialect.delimiter), names, source)
    torn = {found.index for found in damage}
    if not whole and len(body) - 1 not in torn:
        torn.add(len(body) - 1)
        checks.append(Check.of("F09", "warn",
                               "the last line has no line end: whether its last number is whole cannot be told, it is left out",
                               where=f"{source}, line {body[-1][0]}", remedy="end the recording before the file is copied"))
    good = [i for i in range(len(body)) if i not in torn]
    if not good:
        raise InputRejected("T08", "no whole line of numbers", where=source, remedy="record again, or copy the file again")
    columns, words, wrong = _parse([body[i] for i in good], dialect, names, source)
    damage += [_Damage(good[i], body[good[i]][0], reason) for i, reason in wrong.items()]
    _judge(damage, len(body), source, checks)
    keep = np.array([i not in wrong for i in range(len(good))], dtype=bool)
    return ([body[i] for i, kept in zip(good, keep, strict=True) if kept],
            {name: np.ascontiguousarray(values[keep]) for name, values in columns.items()}, words)


def _parse(lines: list[Line], dialect: Dialect, names: tuple[str, ...], source: str) -> tuple[dict[str, Array], dict[str, str],
                                                                                              dict[int, str]]:
    """Columns of numbers, columns of text with an example, and the lines (by index) with a cell that is no number."""
    # numpy rounds every number correctly; pandas does so only where asked, and newer ones refuse to be asked.
    text = "\n".join(line for _, line in lines)
    try:
        found = np.loadtxt(io.StringIO(text.replace(",", ".") if dialect.decimal == "," else text), dtype=np.float64, comments=None,
                           delimiter=dialect.delimiter.strip(" ") or None, quotechar='"', ndmin=2)
        if found.shape == (len(lines), len(names)):
            return {name: np.ascontiguousarray(found[:, j]) for j, name in enumerate(names)}, {}, {}
    except (ValueError, OverflowError):
        pass
    return _parse_slowly(lines, dialect, names, source)


def _parse_slowly(lines: list[Line], dialect: Dialect, names: tuple[str, ...], source: str) -> tuple[dict[str, Array],
                                                                                                     dict[str, str],
                                                                                                     dict[int, str]]:
    """Cell by cell, to find out which cell is no number."""
    cells = [cells_of(line, dialect.delimiter) for _, line in lines]
    columns: dict[str, Array] = {}
    words: dict[str, str] = {}
    wrong: dict[int, str] = {}
    for j, name in enumerate(names):
        values = np.full(len(cells), np.nan)
        bad: list[int] = []
        for i, row in enumerate(cells):
            if is_number(row[j], dialect.decimal):
                values[i] = float(re.sub("[dD]", "e", row[j].replace(",", ".") if dialect.decimal == "," else row[j])
                                  if "inf" not in row[j].lower() else row[j])
            elif row[j] not in MISSING:
                bad.append(i)
        for i in bad:
            _refuse_formulas(lines[i], [cells[i][j]], (name,), source)
        if len(bad) > max(_MOST_DAMAGED, len(cells) // 2) or (bad and len(bad) == len(cells)):
            words[name] = cells[bad[0]][j][:40]
        else:
            columns[name] = values
            wrong |= {i: f"'{cells[i][j][:30]}' in column '{name}' is no number" for i in bad}
    if not columns:
        raise InputRejected("F16", "no column of numbers", where=source,
                            remedy="rrrid import reads CSV and text tables, MAT (v5, v7.3) and NPY")
    return columns, words, wrong


def _refuse_formulas(line: Line, cells: list[str], names: tuple[str, ...], source: str) -> None:
    for j, cell in enumerate(cells):
        if _FORMULA.fullmatch(cell):
            name = names[j] if j < len(names) else str(j + 1)
            raise InputRejected("F16", f"'{cell[:30]}' in column '{name}' is a spreadsheet's formula or error",
                                where=f"{source}, line {line[0]}",
                                remedy="export the recording itself, not an edited sheet")


def _judge(damage: list[_Damage], total: int, source: str, checks: list[Check]) -> None:
    """F09: little damage is left out and named, much of it is refused."""
    if not damage:
        return
    damage = sorted(damage, key=lambda found: found.index)
    listed = ", ".join(f"line {found.line} ({found.reason})" for found in damage[:_MOST_DAMAGED])
    if len(damage) > min(_MOST_DAMAGED, max(1, int(_DAMAGED_SHARE * total))):
        raise InputRejected("F09", f"{len(damage)} of {total} lines are out of step with the columns: {listed}", where=source,
                            remedy="export the file again, or cut the damaged part out")
    checks.append(Check.of("F09", "repair", f"{len(damage)} of {total} lines left out: {listed}", where=source,
                           remedy="copy or export the file again to have them all"))
