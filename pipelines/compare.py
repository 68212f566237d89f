"""Compare two results of the same command: what differs beyond its uncertainty.

Reads    two output folders of one command, or two result.json, or two model.json
Writes   result.json, report.html
Source   Miller, Simultaneous Statistical Inference, 1981: multiple comparisons; cli-contract.md

A law or an effect that only one of the two has comes first. A figure with a standard deviation
differs where it moved farther than chance moves the farthest of so many; an angle on a circle moves
the shorter way around. Each figure counts once: not again where a finding repeats the model, nor
where it follows from another. Residuals have no standard deviation: they are listed, not judged.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pipelines.dynamics.parameter_names import named_in, quantity_of
from pipelines.errors import InputRejected, NothingMatched, UsageError
from pipelines.estimation.bootstrap import limit_of, standardised
from pipelines.io.option import option
from pipelines.io.results import read_result
from pipelines.report.comparison_report import (
    Answer,
    Comparison,
    Figure,
    Residual,
    comparison_report,
)
from pipelines.report.report import Report
from pipelines.report.result_figures import (
    called,
    fitted,
    modelled,
    numbers_of,
    residuals,
    robot_of,
)
from pipelines.stage import Inputs, Request, Stage

_Figures = Mapping[str, tuple[float, float, str]]  # name -> value, std, unit
_Place = tuple[str, int | None]  # cause, joint


@dataclass(frozen=True)
class Settings:
    """Set how strict the comparison is."""

    alpha: float = option(0.01, "How often two results of one arm may be said to differ.")


def read(request: Request, settings: Settings) -> Inputs:
    """Read the two results.

    Raises:
        UsageError: C02, not two of them, or of different commands; C04, no such file.
        InputRejected: F02, F05, S19, what is no result as rrrid wrote it.
    """
    results = [read_result(path) for path in request.paths]
    results = results * 2 if len(results) == 1 else results  # a path given twice is there once
    if len(results) != 2:  # noqa: PLR2004
        remedy = "name two: rrrid compare A B"
        raise UsageError("C02", f"{len(results)} results", where="compare", remedy=remedy)
    a, b = results
    if a.command != b.command:
        words = f"results of different commands: {a.command} and {b.command}"
        remedy = "compare two of one command, or the model.json that both have left"
        raise UsageError("C02", words, where="compare", remedy=remedy)
    robots = {robot for one in (a, b) if (robot := robot_of(one.object))}
    known = {0: "unknown", 1: next(iter(robots), "")}
    return Inputs(
        sources=tuple(dict.fromkeys((a.path, b.path))),
        material=(a, b),
        label="-and-".join(name.replace("/", "-") for name in dict.fromkeys(called(a, b))),
        robot_name=known.get(len(robots), "several"),
    )


def compute(inputs: Inputs, settings: Settings) -> Comparison:
    """Compare figures with their uncertainty, and everything else for equality.

    Raises:
        NothingMatched: C06, the two have nothing in common that could be compared.
        InputRejected: S20, malformed stages or findings.
        UsageError: C02, an alpha that is no probability.
    """
    alpha = settings.alpha
    if not 0.0 < alpha < 1.0:
        remedy = "give a probability between 0 and 1"
        raise UsageError("C02", f"alpha {alpha:g}", where="--alpha", remedy=remedy)
    a, b = inputs.material
    names = called(a, b)
    where = f"{names[0]}, {names[1]}"
    try:
        answers = tuple(_answers(a.object, b.object))
        effects_a, effects_b = _only(a.object, b.object)
        both = modelled(a.object) & modelled(b.object)
        first, second = (_independent(one.object, both) for one in (a, b))
    except (KeyError, TypeError, AttributeError) as problem:
        words = f"not what a result of {a.command} holds ({type(problem).__name__}: {problem})"
        raise InputRejected("S20", words, where=where, remedy="run the command again") from problem
    figures = _figures(first, second, alpha)
    mine, theirs = residuals(a.object), residuals(b.object)
    errors = [Residual(n, unit, x, theirs[n][0]) for n, (x, unit) in mine.items() if n in theirs]
    same = a.object == b.object
    if not (figures or errors or answers or effects_a or effects_b or same):
        words = f"the two results of {a.command} have no figure in common"
        remedy = "compare results of the same robot and the same settings"
        raise NothingMatched("C06", words, where=where, remedy=remedy)
    moved = any(one.beyond for one in figures) or any(one.differs for one in answers)
    compared = {one.name for one in figures}
    only_a, only_b = (tuple(n for n in each if n not in compared) for each in (first, second))
    return Comparison(
        a.command,
        names,
        moved or bool(effects_a or effects_b),
        limit_of(len(figures), alpha),
        alpha,
        figures,
        only_a,
        only_b,
        tuple(errors),
        answers,
        effects_a,
        effects_b,
        same,
        (robot_of(a.object), robot_of(b.object)),
    )


def _independent(result: Mapping[str, Any], held: Container[_Place]) -> _Figures:
    """Return figures that do not follow from others, as the order of a second harmonic does."""
    figures = fitted(result, held)
    kinds = {name: quantity_of(name) for name in figures}
    derived = {name for name, kind in kinds.items() if kind is not None and kind.derived}
    return {name: figure for name, figure in figures.items() if name not in derived}


def _figures(first: _Figures, second: _Figures, alpha: float) -> tuple[Figure, ...]:
    """Compare the figures of both, the farthest first."""
    both = [name for name in first if name in second and first[name][2] == second[name][2]]
    limit = limit_of(len(both), alpha)
    found = []
    for name in both:
        (x, std_x, unit), (y, std_y, _) = first[name], second[name]
        kind = quantity_of(name)
        period = None if kind is None else kind.period
        z = standardised(x, y, std_x, std_y, period)
        beyond = math.isfinite(z) and abs(z) > limit
        found.append(Figure(name, unit, x, std_x, y, std_y, z, beyond, period))
    return tuple(sorted(found, key=lambda one: -abs(one.away)))


def _only(a: Mapping[str, Any], b: Mapping[str, Any]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the laws and effects that one of the two lacks, "cogging:2", where both list theirs.

    The parameters of `estimate-bps` are no list of them: they have not the friction given to it.
    """
    only_a, only_b = set[_Place](), set[_Place]()
    for places in (lambda result: set(modelled(result)), _chosen_laws):
        in_a, in_b = places(a), places(b)
        if in_a and in_b:
            only_a |= in_a - in_b
            only_b |= in_b - in_a
    return _in_order(only_a), _in_order(only_b)


def _chosen_laws(result: Mapping[str, Any]) -> set[_Place]:
    """Return the law that a friction fit has chosen for each joint."""
    known = [one for name in numbers_of(result) if (one := named_in(name)) is not None]
    return {(one.cause, one.joint) for one in known if one.of_law}


def _in_order(places: set[_Place]) -> tuple[str, ...]:
    ordered = sorted(places, key=lambda place: (place[0], place[1] or 0))
    return tuple(_named({"cause": cause, "joint": joint}) for cause, joint in ordered)


def _answers(a: Mapping[str, Any], b: Mapping[str, Any]) -> Iterator[Answer]:
    """Yield verdicts, findings, and how the stages of a run ended, in both results."""
    first, second = dict(_words(a)), dict(_words(b))
    for name in dict.fromkeys([*first, *second]):
        yield Answer(name, first.get(name, "–"), second.get(name, "–"))


def _words(result: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    if isinstance(result.get("verdict"), str):
        yield "verdict", result["verdict"]
    for kind in ("findings", "baseline_effects"):
        if isinstance(result.get(kind), list):
            # `extend` writes baseline effects by their names alone
            names = (
                one if kind != "findings" and isinstance(one, str) else _named(one)
                for one in result[kind]
            )
            yield kind, ", ".join(sorted(names)) or "none"
    for one in result.get("stages") or ():
        yield f"{one['name']} ends in", str(one["exit"])


def _named(finding: Mapping[str, Any]) -> str:
    joint = finding.get("joint")
    return str(finding.get("cause")) + ("" if joint is None else f":{joint}")


def report(result: Comparison) -> Report:
    """Return the verdict, what one lacks, every figure by how far it moved, and residuals."""
    return comparison_report(result)


STAGE = Stage(
    "compare",
    "Compare two results",
    Settings,
    compute,
    report,
    read,
    exit_code=lambda result, check: int(check and result.differ),
)
