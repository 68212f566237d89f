"""Define the parts of a report: words, tables and figures of a finished result.

A stage's `report(result)` returns one `Report`; `pipelines.report.render` turns it into one HTML
file and its figures. Nothing here imports matplotlib: a figure carries the function that
will draw it. The cells of a table become text here, for a page and for a terminal alike.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal

from pipelines.report.style import format_decimals, format_number, printable

__all__ = [
    "Cell",
    "Figure",
    "Report",
    "Section",
    "Table",
    "Tone",
    "are_numbers",
    "column_texts",
    "columns_table",
    "figures_in",
    "filled",
]

Tone = Literal["good", "attention", "bad", "neutral"]
Cell = str | int | float | None  # of a table

_NUMBER: Final = re.compile(
    r"\(?[−+-]?\d[\d\s.,]*(e[+-]?\d+)?(\s*±\s*[\d\s.,∞]+)?\)?(\s*×\s*10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?(\s*%)?|[–—-]|"
)
_DIGITS = 3  # numerics: significant digits of a number without a deviation
_FILLED = 6  # numerics: digits of the longest number that is still filled up with decimals


@dataclass(frozen=True)
class Table:
    """Rows under named columns, with the unit in a column's name: "torque [N m]".

    Numbers become text when the table is shown; a column that is empty in every row is left out
    there, unless the table `keeps_empty` ones.
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    caption: str = ""
    tones: tuple[Tone, ...] = ()  # one a row, where rows are good or bad
    keeps_empty: bool = False  # columns are joints or results: an empty one is an answer


@dataclass(frozen=True)
class Figure:
    """One message, one figure: `draw` gets an empty matplotlib Figure of `size`."""

    name: str  # file name without ending
    caption: str  # says what to see
    draw: Callable[[Any], None] = field(compare=False)
    size: tuple[float, float] = (6.0, 3.2)  # [inch]; so wide, its words are legible on a phone
    # SVG and PNG of the figure with this file name, where they are drawn already; else None
    finished: Callable[[str], tuple[str, bytes] | None] = field(
        default=lambda name: None, compare=False
    )


@dataclass(frozen=True)
class Section:
    """A heading, a warning in bold where there is one, paragraphs, tables, figures, parts."""

    title: str
    text: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()
    warning: str = ""
    folded: bool = False  # closed until the reader opens it, and not printed
    parts: tuple[Section, ...] = ()  # below it


@dataclass(frozen=True)
class Report:
    """The verdict first and what to do about it, then the key figures, then the evidence."""

    title: str
    verdict: str  # one sentence, or a line for each cause
    tone: Tone = "neutral"
    key_figures: Table | None = None
    sections: tuple[Section, ...] = ()
    advice: tuple[str, ...] = ()  # what to look at on the machine, a sentence a finding
    # For the terminal: which model, thresholds or earlier result went in; a section has it too.
    basis: tuple[str, ...] = ()


def figures_in(sections: Iterable[Section]) -> Iterator[Figure]:
    """Yield every figure, in the order of the page."""
    for section in sections:
        yield from section.figures
        yield from figures_in(section.parts)


def columns_table(
    columns: Mapping[str, Iterable[Cell]], caption: str = "", tones: tuple[Tone, ...] = ()
) -> Table:
    """A table from its columns: heading -> cells."""
    return Table(tuple(columns), tuple(zip(*columns.values(), strict=True)), caption, tones)


def column_texts(cells: Sequence[Cell], words: Callable[[str], str] = printable) -> list[str]:
    """Cells as text, decimal numbers with equally many decimals where that is short enough.

    Args:
        words: what makes a text of the table one that can be shown.
    """
    texts = [
        words(cell) if isinstance(cell, str) else format_number(cell, _DIGITS) for cell in cells
    ]
    if not any(isinstance(cell, float) for cell in cells) or any("×" in text for text in texts):
        return texts
    numbers = [
        k for k, cell in enumerate(cells) if isinstance(cell, float) and texts[k][-1:].isdigit()
    ]
    decimals = max((len(texts[k].partition(".")[2]) for k in numbers), default=0)
    longest = max((len(texts[k].partition(".")[0]) for k in numbers), default=0)
    if decimals == 0 or longest + decimals > _FILLED:
        return texts
    for k in numbers:
        texts[k] = format_decimals(float(cells[k] or 0.0), decimals)
    return texts


def are_numbers(texts: Sequence[str]) -> bool:
    """Return whether all are numbers, with or without deviation, power of ten, percent sign."""
    return any(texts) and all(_NUMBER.fullmatch(text) for text in texts)


def filled(table: Table) -> Table:
    """`table` without the columns that are empty in every row."""
    if table.keeps_empty or len(table.columns) <= 2 or not table.rows:  # the first of two names it
        return table
    columns = list(zip(*table.rows, strict=True))
    kept = [0, *(k for k in range(1, len(columns)) if any(map(_is_filled, columns[k])))]
    rows = tuple(zip(*(columns[k] for k in kept), strict=True))
    return replace(table, columns=tuple(table.columns[k] for k in kept), rows=rows)


def _is_filled(cell: Cell) -> bool:
    return bool(cell.strip()) if isinstance(cell, str) else format_number(cell) != "–"
