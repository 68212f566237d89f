"""The report of a comparison: every figure of two results, the farthest moved first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pipelines.report.document import document
from pipelines.report.report import Report
from pipelines.report.words import at_places, figure_in_words, unit_or_dash, without_keys

_SHOWN = 40  # numerics: lines of a table
_NAMED = 3  # numerics: figures in the verdict
_VERDICTS = {
    "no-fault-found": "nothing wrong",
    "cause": "a cause is named",
    "unknown": "something wrong without a name",
    "cannot-judge": "cannot be judged",
}


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

    @property
    def change(self) -> float | None:
        """[%] from the first to the second."""
        return 100.0 * (self.b / self.a - 1.0) if self.a > 0.0 else None


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
    (a, b), (one, other) = result.names, result.robots
    sides = ((a, b, result.effects_a), (b, a, result.effects_b))
    return document(
        "comparison",
        "attention" if result.differ else "good",
        result=result,
        heads=[name.replace(" [", " (").replace("]", ")") for name in result.names],
        two_robots=bool(one and other and one != other),
        effects=[(mine, of, _in_words(effects)) for mine, of, effects in sides],
        beyond=[x for x in result.figures if x.beyond],
        named=_NAMED,
        conclusions=[
            (x.what, _spoken(x.a), _spoken(x.b))
            for x in result.answers
            if x.differs and not _follows_from_effects(x, result)
        ],
        spoken=_spoken,
        words=figure_in_words,
        unit=unit_or_dash,
        most=_SHOWN,
        residuals=sorted(result.residuals, key=lambda x: -abs(x.change or 0.0)),
    )


def _in_words(effects: Sequence[str]) -> str:
    """ "Coulomb friction at joints 1 and 3, and cogging at joint 2"."""
    places = (place.partition(":") for place in effects)
    words = [words for _, words in at_places((cause, joint) for cause, _, joint in places)]
    return ", and ".join(filter(None, (", ".join(words[:-1]), *words[-1:])))


def _follows_from_effects(one: Answer, result: Comparison) -> bool:
    """Return whether two lists of findings differ only by effects that one of them has."""
    apart = set(one.a.split(", ")) ^ set(one.b.split(", "))
    return apart - {"none"} <= {*result.effects_a, *result.effects_b}


def _spoken(answer: str) -> str:
    return _VERDICTS.get(answer) or without_keys(answer)
