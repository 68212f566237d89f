"""What a report consists of: words, tables and figures, drawn from a finished result.

A stage's `report(result)` returns one `Report`; `pipelines.report.render` turns it into one HTML file and the figures
beside it. Nothing here imports matplotlib: a figure carries the function that will draw it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

__all__ = ["Cell", "Figure", "Report", "Section", "Table", "Tone"]

Tone = Literal["good", "attention", "bad", "neutral"]
Cell = str | int | float | None  # of a table


@dataclass(frozen=True)
class Table:
    """Rows under named columns. A unit stands in a column's name: "torque [N m]". Numbers are formatted when drawn.

    A figure that no row has is no column where it is shown, unless it `keeps_empty` ones.
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    caption: str = ""
    tones: tuple[Tone, ...] = ()  # one a row, where rows are good or bad
    keeps_empty: bool = False  # columns are joints, or results side by side: that nothing is known of one is an answer


@dataclass(frozen=True)
class Figure:
    """One message, one figure. `draw(figure)` gets an empty matplotlib Figure of `size` inches and returns nothing."""

    name: str  # file name without ending
    caption: str  # says what to see
    draw: Callable[[Any], None] = field(compare=False)
    size: tuple[float, float] = (6.0, 3.2)  # [inch]; six inches wide: its words are legible on a phone as well
    alt: str = ""  # for readers who do not see it; the caption where empty
    # SVG and PNG of the figure with this file name, where they are drawn already; else None
    finished: Callable[[str], tuple[str, bytes] | None] = field(default=lambda name: None, compare=False)


@dataclass(frozen=True)
class Section:
    """A heading with a warning in bold where there is one, paragraphs, then tables, then figures."""

    title: str
    text: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure, ...] = ()
    warning: str = ""
    leads: bool = False  # drawn before the key figures


@dataclass(frozen=True)
class Report:
    """The verdict first and what to do about it, then the key figures, then the evidence."""

    title: str
    verdict: str  # one sentence
    tone: Tone = "neutral"
    key_figures: Table | None = None
    sections: tuple[Section, ...] = ()
    advice: tuple[str, ...] = ()  # what to look at on the machine, a sentence a finding
    basis: tuple[str, ...] = ()  # for the terminal: which model, thresholds or earlier result went in; a section says so too
