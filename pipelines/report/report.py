"""Define the parts of a report: words, tables and figures of a finished result.

A stage's `report(result)` returns one `Report`; `pipelines.report.render` turns it into one HTML
file and its figures. Nothing here imports matplotlib: a figure carries the function that
will draw it. The cells of a table become text here, for a page and for a terminal alike.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
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
    "filled",
]

Tone = Literal["good", "attention", "bad", "neutral"]
Cell = str | int | float | None  # of a table

_NUMBER: Final = re.compile(
    r"\(?[−+-]?\d[\d\s.,]*(e[+-]?\d+)?(\s*±\s*[\d\s.,∞]+)?\)?(\s*×\s*10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?(\s*%)?|[–—-]|"
)
_DIGITS = 6  # numerics: of the longest number that is still filled up with decimals


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
    alt: str = ""  # for readers who do not see it; the caption where empty
    # SVG and PNG of the figure with this file name, where they are drawn already; else None
    finished: Callable[[str], tuple[str, bytes] | None] = field(
        default=lambda name: None, compare=False
    )


@dataclass(frozen=True)
class Section:
    """A heading, a warning in bold where there is one, paragraphs, tables, figures."""

    title: str
    text: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()
    warning: str = ""
    leads: bool = False  # drawn before the key figures
    folded: bool = False  # closed until the reader opens it, and not printed


@dataclass(frozen=True)
class Report:
    """The verdict first and what to do about it, then the key figures, then the evidence."""

    title: str
    verdict: str  # one sentence
    tone: Tone = "neutral"
    key_figures: Table | None = None
    sections: tuple[Section, ...] = ()
    advice: tuple[str, ...] = ()  # what to look at on the machine, a sentence a finding
    # For the terminal: which model, thresholds or earlier result went in; a section has it too.
    basis: tuple[str, ...] = ()


def columns_table(
    columns: Mapping[str, Sequence[Cell]], caption: str = "", tones: tuple[Tone, ...] = ()
) -> Table:
    """A table from its columns: heading -> cells."""
    return Table(tuple(columns), tuple(zip(*columns.values(), strict=True)), caption, tones)


def column_texts(cells: Sequence[Cell], words: Callable[[str], str] = printable) -> list[str]:
    """Cells as text; decimal numbers of like size get equally many decimals, point under point.

    Args:
        words: what makes a text of the table one that can be shown.
    """
    texts = [words(cell) if isinstance(cell, str) else format_number(cell) for cell in cells]
    numbers = {
        k: cell
        for k, cell in enumerate(cells)
        if isinstance(cell, float) and texts[k][-1:].isdigit()
    }
    decimals = max((len(texts[k].partition(".")[2]) for k in numbers), default=0)
    longest = max((len(text.partition(".")[0]) for text in texts if text != "–"), default=0)
    if decimals == 0 or longest + decimals > _DIGITS or any("×" in text for text in texts):
        return texts
    return [
        format_decimals(numbers[k], decimals) if k in numbers else text
        for k, text in enumerate(texts)
    ]


def are_numbers(texts: Sequence[str]) -> bool:
    """Return whether all are numbers, with or without deviation, power of ten, percent sign."""
    return any(texts) and all(_NUMBER.fullmatch(text) for text in texts)


def filled(table: Table) -> Table:
    """`table` without the columns that are empty in every row."""
    if table.keeps_empty or len(table.columns) <= 2 or not table.rows:  # the first of two names it
        return table
    kept = [0] + [
        k for k in range(1, len(table.columns)) if any(_is_filled(row[k]) for row in table.rows)
    ]
    return replace(
        table,
        columns=tuple(table.columns[k] for k in kept),
        rows=tuple(tuple(row[k] for k in kept) for row in table.rows),
    )


def _is_filled(cell: Cell) -> bool:
    return bool(cell.strip()) if isinstance(cell, str) else format_number(cell) != "–"
