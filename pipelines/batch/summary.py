"""Say what came of all items: one verdict, one table, and how the figures of each robot moved."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pipelines.batch.baseline import known_figures
from pipelines.batch.drift import LIMIT, Course, Drift
from pipelines.batch.parts import Part
from pipelines.batch.record import Record, Status
from pipelines.errors import Check
from pipelines.io.model_file import ModelFile
from pipelines.report.drift_figures import Panel, drift_figure
from pipelines.report.report import Figure, Report, Section, Table, Tone
from pipelines.report.sections import checks_table
from pipelines.report.style import Rounded, format_number
from pipelines.report.words import figure_in_words, without_keys

__all__ = ["KINDS", "Summary", "rows_of", "summary_report"]

_TONES: Final[dict[Status, Tone]] = {"ok": "good", "found": "attention", "rejected": "bad", "failed": "bad"}
_ROWS = 2000  # items in one table of the page
_CHANCE = 0.01  # of calling something moved where nothing did, once in so many batches
_QUESTIONS = 2  # that are asked of every figure
_DRAWN = 6  # figures of one robot
_LISTED, _LEAST = 40, 10  # of them in the table at most; where fewer moved
KINDS: Final[dict[str, type]] = {"item": str, "status": str, "exit": int, "code": str, "message": str, "verdict": str,
                                 "robot": str, "recorded": str, "quantity": str, "value": float, "std": float, "unit": str,
                                 "away": float}


@dataclass(frozen=True)
class Summary:
    """Everything about a batch that is known when it ends."""

    stage: str
    records: tuple[Record, ...]  # in the order of the items' names
    drifts: tuple[Drift, ...]
    checks: tuple[Check, ...] = ()
    baseline: ModelFile | None = None
    interrupted: bool = False

    def count(self, *statuses: Status) -> int:
        return sum(record.status in statuses for record in self.records)


def rows_of(summary: Summary) -> list[Mapping[str, str | float | int | None]]:
    """One row for each figure and residual of each item, and one for an item that has none: the table of summary.parquet."""
    away = {(c.name, item): float(far) for d in summary.drifts for c in (*d.figures, *d.residuals)
            for item, far in zip(c.items, c.away, strict=True)}
    rows: list[Mapping[str, str | float | int | None]] = []
    for r in summary.records:
        about: dict[str, str | float | int | None] = {
            "item": r.name, "status": r.status, "exit": r.exit, "code": (r.error or {}).get("code"),
            "message": (r.error or {}).get("message"), "verdict": r.verdict, "robot": r.robot, "recorded": r.recorded}
        numbers = [] if r.part is None else [{**about, **number} for number in _numbers(r, r.part, away)]
        rows += numbers or [about]
    return rows


def _numbers(record: Record, part: Part, away: Mapping[tuple[str, str], float]) -> Iterator[Mapping[str, str | float | None]]:
    """One row for each figure and residual."""
    numbers: list[tuple[str, float, float | None, str]] = [(name, *figure) for name, figure in part.figures.items()]
    numbers += [(name, value, None, unit) for name, (value, unit) in part.residuals.items()]
    for name, value, std, unit in numbers:
        yield {"robot": part.robot, "quantity": name, "value": value, "std": std, "unit": unit,
               "away": away.get((name, record.name))}


def summary_report(summary: Summary, figures: bool = True) -> Report:
    """The page: verdict, counts, what is not in order, drift, every item.

    Args:
        figures: draw them; without, the page is there at once.
    """
    tone: Tone = "bad" if summary.count("rejected", "failed") or summary.interrupted or _unmet(summary) else (
        "attention" if summary.count("found") or any(map(_beyond_chance, summary.drifts)) else "good")
    words: dict[Status, str] = {"ok": "in order", "found": "something found", "rejected": "rejected", "failed": "failed"}
    counts = Table(("items", "number"), tuple((said, summary.count(status)) for status, said in words.items()))
    sections = [*_wrong(summary), *(s for drift in summary.drifts for s in _drift_section(drift, summary.baseline, figures)),
                *_checks(summary), _all(summary)]
    return Report(f"Batch: {summary.stage}", _verdict(summary), tone, counts, tuple(sections))


def _verdict(summary: Summary) -> str:
    total, wrong, found = len(summary.records), summary.count("rejected", "failed"), summary.count("found")
    said = f"{total} items: {total - wrong - found} in order"
    said += f", in {found} something was found" if found else ""
    unjudged = sum(one.status == "found" and one.part is not None and one.part.verdict == "cannot-judge"
                   for one in summary.records)
    said += f" ({unjudged} of these cannot be judged)" if unjudged else ""
    how = "rejected, failed or not done" if summary.interrupted else "rejected or failed"
    said += f", {wrong} {'was' if wrong == 1 else 'were'} {how}" if wrong else ""
    begun = "Interrupted; what is missing is done with --resume. " if summary.interrupted else ""
    begun += "Nothing was held against the baseline. " if _unmet(summary) else ""
    moved = [(c, d) for d in summary.drifts if _beyond_chance(d) for c in d.figures if c.moved]
    if not moved:
        return f"{begun}{said}."
    course, drift = max(moved, key=lambda one: float(np.max(np.abs(one[0].away))))
    far = int(np.argmax(np.abs(course.away)))
    of = f" of {drift.robot}" if len(summary.drifts) > 1 else ""
    by = f"{format_number(abs(float(course.away[far])), 2)} std in {course.items[far]}"
    return f"{begun}{said}. What moved most{of} is {figure_in_words(course.name)}: {by}."


def _beyond_chance(drift: Drift) -> bool:
    """Return whether a robot's figures moved farther than chance moves the farthest of so many (Šidák 1967).

    χ² of the whole course shows many items that moved a little, and hardly a single one among hundreds: the farthest item is asked
    by itself as well, in the two-sided probability of a normal one, and either may speak.
    """
    figures, items = len(drift.figures), sum(len(c.items) for c in drift.figures)
    return any(c.moved and ((c.probability or 0.0) < _single(figures) or _of_normal(float(np.max(np.abs(c.away)))) < _single(items))
               for c in drift.figures)


def _single(numbers: int) -> float:
    """The probability that each of `numbers` may have, where all answers of a robot are wrong once in so many batches."""
    return -math.expm1(math.log1p(-_CHANCE) / (_QUESTIONS * max(1, numbers)))


def _of_normal(far: float) -> float:
    """How often a normal number is so far [std] from its mean, on either side."""
    return math.erfc(far / math.sqrt(2.0))


def _unmet(summary: Summary) -> bool:
    """Return whether the baseline, where there is one, met nothing at all."""
    return any(check.gate for check in summary.checks)


def _wrong(summary: Summary) -> list[Section]:
    """The items that are not in order, the worst first."""
    wrong = sorted((r for r in summary.records if r.status != "ok"), key=lambda r: -list(_TONES).index(r.status))
    if not wrong:
        return []
    rows = tuple((r.name, r.status, (r.error or {}).get("code", "").removeprefix("RRID-"), _why(r)) for r in wrong[:_ROWS])
    table = Table(("item", "status", "code", "why"), rows, caption="What a code stands for is the same in every report.",
                  tones=tuple(_TONES[r.status] for r in wrong[:_ROWS]))
    return [Section("Not in order", tables=(table,))]


def _why(record: Record) -> str:
    if record.error is None:
        return without_keys(record.verdict)
    where = f"{record.error['where']}: " if record.error["where"] not in ("", ".", record.name) else ""
    remedy = f" ({record.error['remedy']})" if record.error["remedy"] else ""
    return f"{where}{record.error['message']}{remedy}"


def _checks(summary: Summary) -> list[Section]:
    return [Section("Beside the items", tables=(checks_table(summary.checks),))] if summary.checks else []


def _all(summary: Summary) -> Section:
    rows = tuple((r.name, r.status, without_keys(r.verdict) or _why(r)) for r in summary.records[:_ROWS])
    more = len(summary.records) - len(rows)
    text = (f"{more} more are in summary.parquet and result.json.",) if more else ()
    return Section("All items", text, tables=(Table(("item", "status", "verdict"), rows, tones=tuple(
        _TONES[r.status] for r in summary.records[:_ROWS])),))


def _drift_section(drift: Drift, baseline: ModelFile | None, figures: bool) -> list[Section]:
    """How one robot's figures moved; nothing for a robot whose items share none."""
    if not drift.figures and not drift.residuals:
        return []
    ranked = sorted(drift.figures, key=lambda one: -float(np.max(np.abs(one.away))))
    numbers = sum(len(course.value) for course in ranked)
    beyond = sum(len(course.moved) for course in ranked)
    text = ["Each figure is compared with the mean of the other items that have not moved, in standard deviations of the "
            "difference. "
            f"Of {numbers} figures {beyond} are beyond {LIMIT:g}; chance alone would put {numbers * 0.0027:.1f} there. "
            "The probability is that of so large a χ² if nothing moved."] if ranked else []
    if drift.residuals:
        text.append("A residual has no deviation of its own: it is compared with the median, in deviations estimated from most of "
                    "the items; with fewer than five it is not judged.")
    tables = (_figure_table(ranked),) if ranked else ()
    return [Section(f"Drift of {drift.robot}", tuple(text), tables, _figures(drift, ranked, baseline) if figures else ())]


def _figure_table(ranked: Sequence[Course]) -> Table:
    listed = min(_LISTED, max(_LEAST, sum(bool(c.moved) for c in ranked)))
    rows = tuple((figure_in_words(c.name), _tenths(c.chi_square), c.freedom, _digits(c.probability),
                  _tenths(float(np.max(np.abs(c.away)))), _tenths(c.trend), _first_four(c.moved)) for c in ranked[:listed])
    tones: tuple[Tone, ...] = tuple("attention" if c.moved else "neutral" for c in ranked[:listed])
    more = "" if len(ranked) <= listed else f" The {len(ranked) - listed} that moved least are in result.json."
    return Table(("figure", "χ²", "freedom", "probability", "largest [std]", "first to last [std]", "moved"), rows,
                 caption=f"What moved most stands first.{more}", tones=tones)


def _first_four(items: Sequence[str]) -> str:
    return ", ".join(items[:4]) + (f" and {len(items) - 4} more" if len(items) > 4 else "")


def _tenths(x: float | None) -> float | None:
    return None if x is None else round(x, 1)


def _digits(x: float | None) -> float | None:
    return None if x is None else Rounded(x, 2)


def _figures(drift: Drift, ranked: Sequence[Course], baseline: ModelFile | None) -> tuple[Figure, ...]:
    drawn = []
    before = {} if baseline is None else known_figures(baseline, [course.name for course in ranked])
    for name, courses, words in (("drift", ranked, "The figures that moved most, with one std; those beyond three are red."),
                                 ("residuals", drift.residuals, "Residual of torque or motion, item by item.")):
        whole = [c for c in courses if courses and len(c.items) == max(len(one.items) for one in courses)]
        same = [c for c in whole if c.items == whole[0].items][:_DRAWN]
        if same:
            panels = [Panel(figure_in_words(c.name), c.unit, c.value, c.std, c.beyond, before.get(c.name)) for c in same]
            grey = " The band is the baseline." if any(panel.before for panel in panels) else ""
            drawn.append(drift_figure(f"{name}-{drift.robot}", words + grey, panels, same[0].items))
    return tuple(drawn)
