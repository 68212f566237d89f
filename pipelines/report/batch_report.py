"""The report of a batch: what is not in order, how the figures of each robot moved, every item."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipelines.errors import Check
from pipelines.estimation.drift import DriftFigure, RobotDrift, is_drift
from pipelines.report.drift_figures import Panel, drift_figure
from pipelines.report.report import Figure, Report, Section, Table, Tone
from pipelines.report.sections import checks_table
from pipelines.report.style import Rounded, format_number
from pipelines.report.words import figure_in_words, without_keys

__all__ = ["DoneItem", "Problem", "Result", "Status", "batch_report"]

Status = Literal["ok", "found", "rejected", "failed"]

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
    tone: Tone = "good"
    if counts["found"] or drifts:
        tone = "attention"
    if counts["rejected"] or counts["failed"] or result.interrupted:
        tone = "bad"
    sections = []
    order = list(_TONES)
    wrong = sorted(
        (item for item in result.items if item.status != "ok"),
        key=lambda item: -order.index(item.status),
    )
    if wrong:
        sections.append(Section("Not in order", tables=(_items_table(wrong[:most], code=True),)))
    for drift in result.drift:
        if drift.figures or drift.residuals:
            sections.append(_drift_section(drift, figures))
    if result.checks:
        sections.append(Section("Passed over", tables=(checks_table(result.checks),)))
    more = len(result.items) - most
    text = (f"{more} more are in summary.parquet and result.json.",) if more > 0 else ()
    sections.append(Section("All items", text, tables=(_items_table(result.items[:most]),)))
    words = {
        "ok": "in order",
        "found": "something found",
        "rejected": "rejected",
        "failed": "failed",
    }
    key = Table(
        ("items", "number"), tuple((said, counts[status]) for status, said in words.items())
    )
    return Report(f"Batch: {result.stage}", _verdict(result, drifts), tone, key, tuple(sections))


def _items_table(items: Sequence[DoneItem], code: bool = False) -> Table:
    tones = tuple(_TONES[item.status] for item in items)
    if not code:
        rows = tuple((item.name, item.status, item.reason) for item in items)
        return Table(("item", "status", "verdict"), rows, tones=tones)
    codes = [item.error.code.removeprefix("RRID-") if item.error else "" for item in items]
    coded = tuple((i.name, i.status, c, i.reason) for i, c in zip(items, codes, strict=True))
    caption = "What a code stands for is the same in every report."
    return Table(("item", "status", "code", "why"), coded, caption=caption, tones=tones)


def _verdict(result: Result, drifts: Sequence[RobotDrift]) -> str:
    total, found = len(result.items), result.counts["found"]
    wrong = result.counts["rejected"] + result.counts["failed"]
    said = f"{total} items: {total - wrong - found} in order"
    if found:
        said += f", in {found} something was found"
    if wrong:
        how = "rejected, failed or not done" if result.interrupted else "rejected or failed"
        said += f", {wrong} {'was' if wrong == 1 else 'were'} {how}"
    if result.interrupted:
        said = f"Interrupted; what is missing is done with --resume. {said}"
    moved = [(figure, drift) for drift in drifts for figure in drift.figures if figure.moved]
    if not moved:
        return f"{said}."
    figure, drift = max(moved, key=lambda one: max(map(abs, one[0].away)))
    far = int(np.argmax(np.abs(figure.away)))
    of = f" of {drift.robot}" if len(result.drift) > 1 else ""
    by = f"{format_number(abs(figure.away[far]), 2)} std in {figure.items[far]}"
    return f"{said}. What moved most{of} is {figure_in_words(figure.name)}: {by}."


def _drift_section(drift: RobotDrift, figures: bool, most: int = 40, least: int = 10) -> Section:
    """Return how one robot's figures moved, those that moved most first."""
    ranked = sorted(drift.figures, key=lambda one: -max(map(abs, one.away)))
    count, beyond = sum(len(f.items) for f in ranked), sum(len(f.moved) for f in ranked)
    text, tables = [], []
    if ranked:
        text.append(
            "Each figure is compared with the mean of the other items that have not moved, in "
            f"standard deviations of the difference. Of {count} figures {beyond} are beyond 3; "
            f"chance alone would put {count * 0.0027:.1f} there. The probability is that of so "
            "large a χ² if nothing moved."
        )
        listed = ranked[: min(most, max(least, sum(bool(f.moved) for f in ranked)))]
        rows = tuple(
            (
                figure_in_words(f.name),
                _rounded(f.chi_square, 1),
                f.freedom,
                None if f.probability is None else Rounded(f.probability, 2),
                _rounded(max(map(abs, f.away)), 1),
                _rounded(f.trend, 1),
                _first(f.moved),
            )
            for f in listed
        )
        tones = tuple[Tone, ...]("attention" if f.moved else "neutral" for f in listed)
        columns = (
            "figure",
            "χ²",
            "freedom",
            "probability",
            "largest [std]",
            "first to last [std]",
            "moved",
        )
        tables.append(Table(columns, rows, "What moved most stands first.", tones))
    if drift.residuals:
        text.append(
            "A residual has no deviation of its own: it is compared with the median, in deviations "
            "estimated from most of the items; with fewer than five it is not judged."
        )
    drawn = _drawn(drift, ranked) if figures else ()
    return Section(f"Drift of {drift.robot}", tuple(text), tuple(tables), drawn)


def _rounded(x: float | None, digits: int) -> float | None:
    return None if x is None else round(x, digits)


def _first(items: Sequence[str], most: int = 4) -> str:
    more = f" and {len(items) - most} more" if len(items) > most else ""
    return ", ".join(items[:most]) + more


def _drawn(drift: RobotDrift, ranked: Sequence[DriftFigure], most: int = 6) -> tuple[Figure, ...]:
    """Draw the figures that moved most, and the residuals, over the items that most have."""
    drawn = []
    captions = {
        "drift": "The figures that moved most, with one std; those beyond three are red.",
        "residuals": "Residual of torque or motion, item by item.",
    }
    for (name, caption), figures in zip(captions.items(), (ranked, drift.residuals), strict=True):
        if figures:
            items = max((f.items for f in figures), key=len)
            panels = [
                Panel(
                    figure_in_words(f.name),
                    f.unit,
                    np.array(f.value),
                    None if f.std is None else np.array(f.std),
                    np.isin(f.items, f.moved),
                )
                for f in figures
                if f.items == items
            ]
            drawn.append(drift_figure(f"{name}-{drift.robot}", caption, panels[:most], items))
    return tuple(drawn)
