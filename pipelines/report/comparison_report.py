"""The report of a comparison: every figure of two results, the farthest moved first."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from pipelines.report.figures import one_figure
from pipelines.report.report import Figure as Picture
from pipelines.report.report import Report, Section, Table, Tone
from pipelines.report.sentences import paragraphs, sentence
from pipelines.report.style import BLUE, VERMILLION, three_digits, with_std
from pipelines.report.words import at_places, figure_in_words, unit_or_dash, without_keys

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SHOWN = 40  # numerics: lines of a table or a figure
_NAMED = 3  # numerics: figures in the verdict
_VERDICTS = {
    "no-fault-found": "nothing wrong",
    "cause": "a cause is named",
    "unknown": "something wrong without a name",
    "cannot-judge": "cannot be judged",
}

_paragraphs = partial(paragraphs, "comparison")


@dataclass(frozen=True)
class Figure:
    """One number of both results."""

    name: str
    unit: str
    a: float
    a_std: float
    b: float
    b_std: float
    away: float  # [std of the difference] b - a
    beyond: bool  # farther than chance moves the farthest of all
    period: float | None = None  # [unit] of an angle: b - a is the shorter way around


@dataclass(frozen=True)
class Residual:
    """An error that is left, in both results."""

    name: str
    unit: str
    a: float
    b: float


@dataclass(frozen=True)
class Answer:
    """Return the verdicts of both results."""

    what: str
    a: str
    b: str

    @property
    def differs(self) -> bool:
        return self.a != self.b


@dataclass(frozen=True)
class Comparison:
    """Two results of one command, side by side."""

    compared: str  # the command whose results they are
    names: tuple[str, str]
    differ: bool
    limit: float  # [std] beyond which a figure differs
    alpha: float
    figures: tuple[Figure, ...]  # the farthest first
    only_a: tuple[str, ...]  # figures that only one has
    only_b: tuple[str, ...]
    residuals: tuple[Residual, ...]
    answers: tuple[Answer, ...]
    effects_a: tuple[
        str, ...
    ] = ()  # laws and effects that only the first was fitted with, as commands take them
    effects_b: tuple[str, ...] = ()  # that only the second has
    same: bool = False  # both are equal
    robots: tuple[str, str] = ("", "")  # whose results they are; empty where unknown


def comparison_report(result: Comparison) -> Report:
    """The verdict first, then the evidence."""
    tone: Tone = "attention" if result.differ else "good"
    sections = [
        *_effects(result),
        *_answers(result),
        *_figures(result),
        *_residuals(result),
        *_only_one_has(result),
    ]
    title = f"Comparison of two results of {result.compared}"
    return Report(title, _verdict(result), tone, None, tuple(sections))


def _verdict(result: Comparison) -> str:
    (a, b), (one, other) = result.names, result.robots
    sides = ((a, b, result.effects_a), (b, a, result.effects_b))
    beyond = [x for x in result.figures if x.beyond]
    moved = [(figure_in_words(x.name), abs(x.away)) for x in beyond[:_NAMED]]
    conclusions = [
        {"what": x.what, "a": _spoken(x.a), "b": _spoken(x.b)}
        for x in result.answers
        if x.differs and not _follows_from_effects(x, result)
    ]
    return sentence(
        "comparison",
        "verdict",
        result,
        two_robots=bool(one and other and one != other),
        effects=[(mine, of, _in_words(effects)) for mine, of, effects in sides if effects],
        beyond=moved,
        more=len(beyond) - len(moved),
        conclusions=conclusions[:2],
    )


def _in_words(effects: Sequence[str]) -> str:
    """ "Coulomb friction at joints 1 and 3, and cogging at joint 2"."""
    places = (place.partition(":") for place in effects)
    words = [words for _, words in at_places((cause, joint) for cause, _, joint in places)]
    *first, last = words or [""]
    return f"{', '.join(first)}, and {last}" if first else last


def _follows_from_effects(one: Answer, result: Comparison) -> bool:
    """Return whether two lists of findings differ only by effects that one of them has."""
    apart = set(one.a.split(", ")) ^ set(one.b.split(", "))
    return apart - {"none"} <= {*result.effects_a, *result.effects_b}


def _spoken(answer: str) -> str:
    return _VERDICTS.get(answer) or without_keys(answer)


def _effects(result: Comparison) -> list[Section]:
    both = (result.effects_a, result.effects_b)
    if not any(both):
        return []
    rows = tuple((n, _in_words(e) or "none") for n, e in zip(result.names, both, strict=True))
    table = Table(("result", "laws and effects"), rows)
    return [Section("Laws and effects that only one has", _paragraphs("effects"), (table,))]


def _answers(result: Comparison) -> list[Section]:
    if not result.answers:
        return []
    rows = tuple((one.what, _spoken(one.a), _spoken(one.b)) for one in result.answers)
    tones: tuple[Tone, ...] = tuple(
        "attention" if one.differs else "neutral" for one in result.answers
    )
    return [Section("Conclusions", (), (Table(("what", *_heads(result)), rows, tones=tones),))]


def _heads(result: Comparison) -> tuple[str, str]:
    """Names as heads of columns; a bracket would be taken for a unit."""
    a, b = (name.replace(" [", " (").replace("]", ")") for name in result.names)
    return a, b


def _figures(result: Comparison) -> list[Section]:
    if not result.figures:
        return []
    shown, rows, tones = result.figures[:_SHOWN], [], list[Tone]()
    for x in shown:
        values = (with_std(x.a, x.a_std), with_std(x.b, x.b_std), unit_or_dash(x.unit))
        away = round(x.away, 1) if math.isfinite(x.away) else None
        rows.append((figure_in_words(x.name), *values, away, "differs" if x.beyond else ""))
        tones.append("attention" if x.beyond else "neutral")
    circle, more = any(x.period for x in shown), len(result.figures) - len(shown)
    columns = ("figure", *_heads(result), "unit", "away [std]", "verdict")
    table = Table(columns, tuple(rows), "The farthest first.", tuple(tones))
    text = _paragraphs("figures", result, circle, more)
    return [Section("Figures", text, (table,), (_picture(result),))]


def _picture(result: Comparison) -> Picture:
    shown = [one for one in result.figures if math.isfinite(one.away)][:_SHOWN]

    def draw(axes: Axes) -> None:
        rows = range(len(shown))
        axes.axvspan(-result.limit, result.limit, color="0.92", lw=0)
        axes.axvline(0.0, color="0.6", lw=0.8)
        colours = [VERMILLION if one.beyond else BLUE for one in shown]
        axes.scatter([one.away for one in shown], rows, c=colours, s=14, zorder=3)
        axes.set_yticks(list(rows), [figure_in_words(one.name) for one in shown], fontsize=7)
        axes.invert_yaxis()
        axes.margins(y=0.02)
        axes.set_xlabel("moved by [std of the difference]")

    caption = "How far every figure moved; grey is what chance explains."
    return one_figure("moved", caption, draw, 0.8 + 0.17 * max(1, len(shown)))


def _residuals(result: Comparison) -> list[Section]:
    if not result.residuals:
        return []
    changed = sorted(result.residuals, key=lambda one: -abs(_change(one) or 0.0))[:_SHOWN]
    rows = []
    for x in changed:
        values = (three_digits(x.a), three_digits(x.b), unit_or_dash(x.unit))
        rows.append((figure_in_words(x.name), *values, three_digits(_change(x))))
    models = any("extended model" in one.name for one in changed)
    text = _paragraphs("residuals", models, len(result.residuals) - len(changed))
    columns = ("residual", *_heads(result), "unit", "change [%]")
    return [
        Section("Residuals", text, (Table(columns, tuple(rows), "The greatest change first."),))
    ]


def _change(one: Residual) -> float | None:
    return 100.0 * (one.b / one.a - 1.0) if one.a > 0.0 else None


def _only_one_has(result: Comparison) -> list[Section]:
    both = (result.only_a, result.only_b)
    if not any(both):
        return []
    rows = tuple(
        (name, "; ".join(map(figure_in_words, names[:_SHOWN])) or "none")
        for name, names in zip(result.names, both, strict=True)
    )
    return [Section("Figures that only one has", (), (Table(("result", "figures"), rows),))]
