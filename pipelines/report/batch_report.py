"""The report of a batch: what is not in order, how the figures of each robot moved, every item."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from pipelines.errors import Check
from pipelines.estimation.drift import DriftFigure, RobotDrift, is_drift
from pipelines.report import style
from pipelines.report.document import document
from pipelines.report.figures import Look, rows_figure
from pipelines.report.report import Figure, Report, Tone
from pipelines.report.sections import checks_table
from pipelines.report.style import format_unit, printable
from pipelines.report.words import figure_in_words, without_keys

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["DoneItem", "Problem", "Result", "Status", "batch_report"]

Status = Literal["ok", "found", "rejected", "failed"]

_PANELS = 6  # numerics: of a figure
_NAMED = 8  # numerics: items whose names have room below the axis
_LETTERS = 14  # numerics: of a name there
_TONES: dict[str, Tone] = {"ok": "good", "found": "attention", "rejected": "bad", "failed": "bad"}


@dataclass(frozen=True)
class Problem:
    """Why an item was rejected or failed."""

    code: str
    where: str
    message: str
    remedy: str


@dataclass(frozen=True)
class DoneItem:
    """One item."""

    name: str  # its path below the root; with the session, where the folder holds several
    status: Status
    error: Problem | None
    verdict: str
    exit: int  # what its own command would have ended in, with --check
    robot: str
    recorded: str | None  # the earliest of its logs
    folder: str | None  # of its own result; None without a result

    @property
    def reason(self) -> str:
        """The verdict, or the error in its place."""
        if self.error is None:
            return without_keys(self.verdict)
        place, remedy = self.error.where, self.error.remedy
        where = f"{place}: " if place not in ("", ".", self.name) else ""
        return f"{where}{self.error.message}{f' ({remedy})' if remedy else ''}"


@dataclass(frozen=True)
class Result:
    """A batch."""

    stage: str
    items: tuple[DoneItem, ...]
    counts: dict[str, int]  # of each status
    drift: tuple[RobotDrift, ...]
    checks: tuple[Check, ...]

    @property
    def interrupted(self) -> bool:
        """True if a signal ended it before the last item."""
        ends = [item.error.message for item in self.items if item.error]
        return any("the batch was interrupted" in message for message in ends)


def batch_report(result: Result, most: int = 2000, figures: bool = True) -> Report:
    """Return the page of a batch.

    Args:
        most: items in one table.
        figures: draw them; without, the page is written at once.
    """
    counts, drifts = Counter(result.counts), [one for one in result.drift if is_drift(one)]
    tone: Tone = "attention" if counts["found"] or drifts else "good"
    if counts["rejected"] or counts["failed"] or result.interrupted:
        tone = "bad"
    order = list(_TONES)
    wrong = [item for item in result.items if item.status != "ok"]
    moved = [
        (abs(away), drift.robot, one.name, item)
        for drift in drifts
        for one in drift.figures
        for item, away in zip(one.items, one.away, strict=True)
        if one.moved
    ]
    return document(
        "batch",
        tone,
        result=result,
        counts=counts,
        tones=_TONES,
        most=most,
        wrong=sorted(wrong, key=lambda item: -order.index(item.status)),
        farthest=max(moved, default=None),
        ranked=_ranked,
        words=figure_in_words,
        figures=_drawn if figures else lambda drift: (),
        checks_table=checks_table,
    )


def _ranked(drift: RobotDrift) -> list[DriftFigure]:
    """The figures of a robot, those that moved most first."""
    return sorted(drift.figures, key=lambda one: -max(map(abs, one.away)))


def _drawn(drift: RobotDrift) -> tuple[Figure, ...]:
    """Draw the figures that moved most, and the residuals, over the items that most have."""
    drawn = []
    captions = {
        "drift": "The figures that moved most, with one std; those beyond three are red.",
        "residuals": "Residual of torque or motion, item by item.",
    }
    every = (_ranked(drift), drift.residuals)
    for (name, caption), figures in zip(captions.items(), every, strict=True):
        if figures:
            items = max((f.items for f in figures), key=len)
            panels = [f for f in figures if f.items == items][:_PANELS]
            drawn.append(_drift_figure(f"{name}-{drift.robot}", caption, panels, items))
    return tuple(drawn)


def _drift_figure(
    name: str, caption: str, panels: Sequence[DriftFigure], items: Sequence[str]
) -> Figure:
    """One row a figure over the items, by their names where there is room for them."""
    place = np.arange(1, len(items) + 1)

    def draw_row(axes: Axes, k: int) -> None:
        one, value = panels[k], np.array(panels[k].value)
        moved = np.isin(one.items, one.moved)
        axes.plot(place, value, color=style.BLUE, linewidth=0.6, alpha=0.5)
        for wanted, colour in ((~moved, style.BLUE), (moved, style.VERMILLION)):
            bars = None if one.std is None else np.array(one.std)[wanted]
            look: Look = {"markersize": 3.0, "color": colour, "linewidth": 0.9}
            axes.errorbar(place[wanted], value[wanted], bars, fmt="o", **look)
        if len(items) <= _NAMED:
            short = [n if len(n) <= _LETTERS else f"…{n[-_LETTERS + 1 :]}" for n in items]
            axes.set_xticks(place, [printable(label, 40) for label in short], rotation=20)

    units = ("" if one.unit in ("1", "") else f" [{format_unit(one.unit)}]" for one in panels)
    names = [figure_in_words(one.name) + unit for one, unit in zip(panels, units, strict=True)]
    x = "item, in the order of recording"
    return rows_figure(name, caption, names, draw_row, "", x=x, row=1.15)
