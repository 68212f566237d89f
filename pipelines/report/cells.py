"""Cells of a table as text, for a page and for a terminal alike.

    texts = column_texts(cells)             equally many decimals, so that numbers stand point under point
    if are_numbers(texts): …                set to the right
    filled(table)                           without the figures that no row has
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

from pipelines.report.report import Cell, Table
from pipelines.report.style import format_decimals, format_number, printable

__all__ = ["are_numbers", "column_texts", "filled"]

_NUMBER: Final = re.compile(r"\(?[−+-]?\d[\d\s.,]*(e[+-]?\d+)?(\s*±\s*[\d\s.,∞]+)?\)?(\s*×\s*10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?(\s*%)?|[–—-]|")
_DIGITS = 6  # of the longest number that is still filled up with decimals


def column_texts(cells: Sequence[Cell], words: Callable[[str], str] = printable) -> list[str]:
    """Cells as text; decimal numbers of like size get equally many decimals.

    Args:
        words: what makes a text of the table one that can be shown.
    """
    texts = [words(cell) if isinstance(cell, str) else format_number(cell) for cell in cells]
    decimals = [len(text.partition(".")[2]) if isinstance(cell, float) and text[-1:].isdigit() else None
                for cell, text in zip(cells, texts, strict=True)]
    wanted = max((count for count in decimals if count is not None), default=0)
    if wanted == 0 or any("×" in text or len(text.partition(".")[0]) + wanted > _DIGITS for text in texts if text != "–"):
        return texts
    return [text if count is None else format_decimals(cell, wanted)  # type: ignore[arg-type]  # a float, by `decimals`
            for cell, text, count in zip(cells, texts, decimals, strict=True)]


def are_numbers(texts: Sequence[str]) -> bool:
    """Return whether a column is one of numbers, with or without a deviation, a power of ten, a percent sign."""
    return any(texts) and all(_NUMBER.fullmatch(text) for text in texts)


def filled(table: Table) -> Table:
    """`table` as it is shown: a column that is empty in every row says nothing, and takes room from those that do."""
    if table.keeps_empty or len(table.columns) <= 2 or not table.rows:  # of two columns the first names what the second says
        return table
    kept = [0, *(place for place in range(1, len(table.columns)) if any(_says_something(row[place]) for row in table.rows))]
    return replace(table, columns=tuple(table.columns[place] for place in kept),
                   rows=tuple(tuple(row[place] for place in kept) for row in table.rows))


def _says_something(cell: Cell) -> bool:
    return bool(cell.strip()) if isinstance(cell, str) else format_number(cell) != format_number(None)
