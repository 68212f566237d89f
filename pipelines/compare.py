"""Compare two results of the same command: what differs beyond its uncertainty.

Reads    two folders that a command has left, or two result.json, or two model.json; of a run also the folder of a stage
Writes   result.json, report.html
Source   Miller, Simultaneous Statistical Inference, 1981: many comparisons at a time; cli-contract.md

A law or an effect that only one of the two has is what differs most. A figure with a standard deviation differs where it moved
farther than chance moves the farthest of so many; an angle on a circle moves the shorter way around. Each figure counts once: not
again where a finding says what the model says, nor where it follows from another. Residuals have no standard deviation: they are
laid side by side, and not judged. Verdicts and findings differ where they are others.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pipelines.errors import InputRejected, NothingMatched, UsageError
from pipelines.fit.differences import limit_of, standardised
from pipelines.io.compared import called, label_of, of_other_commands
from pipelines.io.option import option
from pipelines.io.result_figures import fitted, numbers_of, residuals, robot_of
from pipelines.io.result_models import less_findings, modelled
from pipelines.io.run_results import read_any_result
from pipelines.model.parameter_names import named_in, quantity_of
from pipelines.report.comparison_report import (
    Answer,
    Comparison,
    Figure,
    Residual,
    comparison_report,
)
from pipelines.report.report import Report
from pipelines.stage import Inputs, Request, Stage

__all__ = ["STAGE", "Comparison", "Settings", "compute", "read", "report"]

_Figures = Mapping[str, tuple[float, float, str]]  # name -> value, std, unit


@dataclass(frozen=True)
class Settings:
    """`alpha`: how often two results of one and the same arm may be said to differ."""

    alpha: float = option(0.01, "How often two results of one arm may be said to differ.")


def read(request: Request, settings: Settings) -> Inputs:
    """The two results.

    Raises:
        UsageError: C02, not two of them, or of different commands; C04, there is none.
        InputRejected: F02, F05, S19, what is no result as rrrid wrote it.
    """
    paths = request.paths * 2 if len(request.paths) == 1 else request.paths  # what is named twice is named once by now
    if len(paths) != 2:
        raise UsageError("C02", f"{len(paths)} results", where="compare", remedy="name two: rrrid compare A B")
    a, b = (read_any_result(path) for path in paths)
    if a.command != b.command:
        raise of_other_commands(a, b)
    robots = [robot for one in (a, b) if (robot := robot_of(one.object))]
    return Inputs(sources=tuple(dict.fromkeys((a.path, b.path))), material=(a, b), label=label_of(a, b),
                  robot_name=robots[0] if len(set(robots)) == 1 else "several" if robots else "unknown")


def compute(inputs: Inputs, settings: Settings) -> Comparison:
    """What only one has, figures against their uncertainty, residuals side by side, verdicts and findings.

    Raises:
        NothingMatched: C06, the two have nothing in common that could be compared.
        InputRejected: S20, stages or findings that are none.
        UsageError: C02, an alpha that is no probability.
    """
    if not 0.0 < settings.alpha < 1.0:
        raise UsageError("C02", f"alpha {settings.alpha:g}", where="--alpha", remedy="give a probability between 0 and 1")
    a, b = inputs.material
    names = called(a, b)
    try:
        answers = tuple(_answers(a.object, b.object))
        effects_a, effects_b = _only(a.object, b.object)
        both = modelled(a.object) & modelled(b.object)
        first, second = (_counted(less_findings(one.object, both)) for one in (a, b))
    except (KeyError, TypeError, AttributeError) as problem:
        raise InputRejected("S20", f"not what a result of {a.command} holds ({type(problem).__name__}: {problem})",
                            where=f"{names[0]}, {names[1]}", remedy="run the command again") from problem
    figures = _figures(first, second, settings.alpha)
    mine, theirs = residuals(a.object), residuals(b.object)
    left = tuple(Residual(name, unit, before, theirs[name][0]) for name, (before, unit) in mine.items() if name in theirs)
    same = a.object == b.object
    if not (figures or left or answers or effects_a or effects_b or same):
        raise NothingMatched("C06", f"the two results of {a.command} have no figure in common", where=f"{names[0]}, {names[1]}",
                             remedy="compare results of the same robot and the same settings")
    differ = any(one.beyond for one in figures) or any(one.differs for one in answers) or bool(effects_a or effects_b)
    compared = {one.name for one in figures}
    return Comparison(
        a.command, names, differ, limit_of(len(figures), settings.alpha), settings.alpha, figures,
        tuple(name for name in first if name not in compared), tuple(name for name in second if name not in compared), left,
        answers, effects_a, effects_b, same, (robot_of(a.object), robot_of(b.object)))


def _counted(result: Mapping[str, Any]) -> _Figures:
    """Its figures, without those that follow from others: the order of a second harmonic is twice that of the first."""
    return {name: figure for name, figure in fitted(result).items() if (kind := quantity_of(name)) is None or not kind.derived}


def _figures(first: _Figures, second: _Figures, alpha: float) -> tuple[Figure, ...]:
    """What both have, the farthest first."""
    both = [name for name in first if name in second and first[name][2] == second[name][2]]
    limit = limit_of(len(both), alpha)
    found = []
    for name in both:
        (x, std_x, unit), (y, std_y, _) = first[name], second[name]
        kind = quantity_of(name)
        period = None if kind is None else kind.period
        z = standardised(x, y, std_x, std_y, period)
        found.append(Figure(name, unit, x, std_x, y, std_y, z, math.isfinite(z) and abs(z) > limit, period))
    return tuple(sorted(found, key=lambda one: -abs(one.away)))


def _only(a: Mapping[str, Any], b: Mapping[str, Any]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The laws and effects that only one of the two has, "cogging:2", where both say what they have.

    What `estimate-bps` has among its parameters is no list of them: friction that was given to it is not there.
    """
    only = set[tuple[str, int | None]](), set[tuple[str, int | None]]()
    for kind in (_modelled, _chosen):
        has = kind(a), kind(b)
        if all(has):
            for k in (0, 1):
                only[k].update(has[k] - has[1 - k])
    first, second = (tuple(_place({"cause": cause, "joint": joint}) for cause, joint in sorted(
        places, key=lambda one: (one[0], one[1] or 0))) for places in only)
    return first, second


def _modelled(result: Mapping[str, Any]) -> set[tuple[str, int | None]]:
    """What its models have."""
    return set(modelled(result))


def _chosen(result: Mapping[str, Any]) -> set[tuple[str, int | None]]:
    """The law that a friction fit has chosen for each joint."""
    return {(one.cause, one.joint) for name in numbers_of(result) if (one := named_in(name)) is not None and one.of_law}


def _answers(a: Mapping[str, Any], b: Mapping[str, Any]) -> Iterator[Answer]:
    """What the two say in words: verdicts, findings, and how the stages of a run have ended."""
    said = [dict(_said(one)) for one in (a, b)]
    for what in dict.fromkeys([*said[0], *said[1]]):
        yield Answer(what, said[0].get(what, "–"), said[1].get(what, "–"))


def _said(result: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    if isinstance(result.get("verdict"), str):
        yield "verdict", result["verdict"]
    for kind in ("findings", "baseline_effects"):
        if isinstance(result.get(kind), list):  # what stands is named already where `extend` says it
            places = (one if kind == "baseline_effects" and isinstance(one, str) else _place(one) for one in result[kind])
            yield kind, ", ".join(sorted(places)) or "none"
    for one in result.get("stages") or ():
        yield f"{one['name']} ends in", str(one["exit"])


def _place(finding: Mapping[str, Any]) -> str:
    return f"{finding.get('cause')}:{finding['joint']}" if finding.get("joint") is not None else str(finding.get("cause"))


def report(result: Comparison) -> Report:
    """The verdict, what only one has, every figure by how far it moved, residuals, what was said."""
    return comparison_report(result)


STAGE = Stage("compare", "Compare two results", Settings, compute, report, read,
              exit_code=lambda result, check: int(check and result.differ))
