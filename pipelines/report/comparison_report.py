"""The report of a comparison: the verdict, what only one has, every figure by how far it moved, residuals, what was said."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pipelines.report.diagnosis_words import at_places, unit_or_dash, without_keys
from pipelines.report.figure_words import figure_in_words
from pipelines.report.report import Figure as Picture
from pipelines.report.report import Report, Section, Table, Tone
from pipelines.report.style import BLUE, VERMILLION, format_number, three_digits, with_std

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

__all__ = ["Answer", "Comparison", "Figure", "Residual", "comparison_report"]

_SHOWN = 40  # lines of a table or a figure
_VERDICTS = {"no-fault-found": "nothing wrong", "cause": "a cause is named", "unknown": "something wrong without a name",
             "cannot-judge": "cannot be judged"}
_CIRCLE = "A phase or a direction is the same again after a whole turn: it is away by the shorter way around."
_MODELS = "The nominal model is the one before any extension; the extended model has the findings and the baseline effects as well."


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
    period: float | None = None  # [unit] of an angle on a circle, of which b - a is the shorter way around; None: of no circle


@dataclass(frozen=True)
class Residual:
    """An error that is left, in both results."""

    name: str
    unit: str
    a: float
    b: float


@dataclass(frozen=True)
class Answer:
    """What both say in words."""

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
    effects_a: tuple[str, ...] = ()  # laws and effects that only the first was fitted with, as commands take them
    effects_b: tuple[str, ...] = ()  # that only the second was fitted with
    same: bool = False  # the two are one, to the last digit
    robots: tuple[str, str] = ("", "")  # whose results they are; empty where one does not say


def comparison_report(result: Comparison) -> Report:
    """The verdict first, then the evidence."""
    tone: Tone = "attention" if result.differ else "good"
    sections = (_effects(result), _answers(result), _figures(result), _residuals(result), _alone(result))
    return Report(f"Comparison of two results of {result.compared}", _verdict(result), tone, None,
                  tuple(section for section in sections if section))


def _verdict(result: Comparison) -> str:
    a, b = result.names
    if result.same:
        return f"{a} and {b} are the same result, digit by digit: there is nothing to compare."
    one, other = result.robots
    two = bool(one and other and one != other)
    apart = f"They are of two robots, {one} and {other}: a difference is no change of one machine." if two else ""
    if not result.differ:
        agree = f"{a} and {b} agree: none of {len(result.figures)} figures differs beyond its uncertainty."
        return " ".join(filter(None, (agree, apart)))
    has = [f"{mine} has {words}, which {other} has not." for mine, other, words in (
        (a, b, _in_words(result.effects_a)), (b, a, _in_words(result.effects_b))) if words]
    beyond, words = [one for one in result.figures if one.beyond], []
    if beyond:
        named = ", ".join(f"{figure_in_words(one.name)} by {format_number(abs(one.away), 2)} std" for one in beyond[:3])
        more = f" and {len(beyond) - 3} more" if len(beyond) > 3 else ""
        words.append(f"{len(beyond)} of {len(result.figures)} figures differ beyond their uncertainty: {named}{more}")
    told = [f"{one.what} ({_spoken(one.a)} in {a}, {_spoken(one.b)} in {b})" for one in result.answers
            if one.differs and not _said_by(one, result)]
    if told:
        words.append(f"their conclusions differ: {'; '.join(told[:2])}")
    rest = "; ".join(words)
    return " ".join(filter(None, (f"{a} and {b} differ.", apart, *has, f"{rest[:1].upper()}{rest[1:]}." if rest else "")))


def _in_words(effects: Sequence[str]) -> str:
    """"Coulomb friction at joints 1 and 3, and cogging at joint 2"."""
    places = (place.partition(":") for place in effects)
    *first, last = [words for _, words in at_places((cause, joint) for cause, _, joint in places)] or [""]
    return f"{', '.join(first)}, and {last}" if first else last


def _said_by(one: Answer, result: Comparison) -> bool:
    """Return whether two lists of findings differ by nothing but the effects that only one was fitted with."""
    apart = set(one.a.split(", ")) ^ set(one.b.split(", "))
    return apart - {"none"} <= {*result.effects_a, *result.effects_b}


def _spoken(answer: str) -> str:
    return _VERDICTS.get(answer) or without_keys(answer)


def _effects(result: Comparison) -> Section | None:
    if not (result.effects_a or result.effects_b):
        return None
    rows = tuple((name, _in_words(effects) or "none")
                 for name, effects in zip(result.names, (result.effects_a, result.effects_b), strict=True))
    text = ("They weigh more than any figure: what the other numbers of such a joint mean changes with them. A Coulomb level "
            "beside Stribeck friction is not the one without.",)
    return Section("Laws and effects that only one has", text, (Table(("result", "laws and effects"), rows),))


def _answers(result: Comparison) -> Section | None:
    if not result.answers:
        return None
    rows = tuple((one.what, _spoken(one.a), _spoken(one.b)) for one in result.answers)
    tones: tuple[Tone, ...] = tuple("attention" if one.differs else "neutral" for one in result.answers)
    return Section("Conclusions", (), (Table(("what", *_heads(result)), rows, tones=tones),))


def _heads(result: Comparison) -> tuple[str, str]:
    """Names as heads of columns; a bracket would be taken for a unit."""
    a, b = (name.replace(" [", " (").replace("]", ")") for name in result.names)
    return a, b


def _figures(result: Comparison) -> Section | None:
    if not result.figures:
        return None
    shown = result.figures[:_SHOWN]
    rows = tuple((figure_in_words(one.name), with_std(one.a, one.a_std), with_std(one.b, one.b_std), unit_or_dash(one.unit),
                  round(one.away, 1) if math.isfinite(one.away) else None, "differs" if one.beyond else "") for one in shown)
    tones: tuple[Tone, ...] = tuple("attention" if one.beyond else "neutral" for one in shown)
    more = len(result.figures) - len(shown)
    text = (f"A figure differs where it moved by more than {format_number(result.limit, 3)} std of the difference. Where nothing "
            f"has changed, that happens to any of these {len(result.figures)} with a probability of "
            f"{format_number(100.0 * result.alpha, 2)} % at most; the errors of the two are taken to be independent, and the "
            "stated standard deviations to be right.", *((_CIRCLE,) if any(one.period for one in shown) else ()),
            *((f"{more} more, all nearer, are in result.json.",) if more > 0 else ()))
    table = Table(("figure", *_heads(result), "unit", "away [std]", "verdict"), rows, "The farthest first.", tones)
    return Section("Figures", text, (table,), (_picture(result),))


def _picture(result: Comparison) -> Picture:
    shown = [one for one in result.figures if math.isfinite(one.away)][:_SHOWN]

    def draw(drawing: Drawing) -> None:
        axes = drawing.subplots()
        places = range(len(shown))
        axes.axvspan(-result.limit, result.limit, color="0.92", lw=0)
        axes.axvline(0.0, color="0.6", lw=0.8)
        colours = [VERMILLION if one.beyond else BLUE for one in shown]
        axes.scatter([one.away for one in shown], places, c=colours, s=14, zorder=3)
        axes.set_yticks(list(places), [figure_in_words(one.name) for one in shown], fontsize=7)
        axes.invert_yaxis()
        axes.margins(y=0.02)
        axes.set_xlabel("moved by [std of the difference]")

    height = 0.8 + 0.17 * max(1, len(shown))
    return Picture("moved", "How far every figure moved; grey is what chance explains.", draw, (6.0, height))


def _residuals(result: Comparison) -> Section | None:
    if not result.residuals:
        return None
    changed = sorted(result.residuals, key=lambda one: -abs(_change(one) or 0.0))[:_SHOWN]
    rows = tuple((figure_in_words(one.name), three_digits(one.a), three_digits(one.b), unit_or_dash(one.unit),
                  three_digits(_change(one))) for one in changed)
    more = len(result.residuals) - len(changed)
    text = ("No standard deviation is known of these, so that they are not judged.",
            *((_MODELS,) if any("extended model" in one.name for one in changed) else ()),
            *((f"{more} more are in result.json.",) if more > 0 else ()))
    table = Table(("residual", *_heads(result), "unit", "change [%]"), rows, "The greatest change first.")
    return Section("Residuals", text, (table,))


def _change(one: Residual) -> float | None:
    return 100.0 * (one.b / one.a - 1.0) if one.a > 0.0 else None


def _alone(result: Comparison) -> Section | None:
    if not (result.only_a or result.only_b):
        return None
    both = zip(result.names, (result.only_a, result.only_b), strict=True)
    rows = tuple((name, "; ".join(map(figure_in_words, names[:_SHOWN])) or "none") for name, names in both)
    return Section("Figures that only one has", (), (Table(("result", "figures"), rows),))
