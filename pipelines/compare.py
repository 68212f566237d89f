"""Compare two results of the same command: what differs beyond its uncertainty.

Reads    two folders that a command has left, or two result.json, or two model.json
Writes   result.json, report.html
Source   Miller, Simultaneous Statistical Inference, 1981: many comparisons at a time; cli-contract.md

A figure with a standard deviation differs where it moved farther than chance moves the farthest of so many. Residuals have no
standard deviation: they are laid side by side, and not judged. Verdicts and findings differ where they are others.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from pipelines.errors import InputRejected, NothingMatched, UsageError
from pipelines.fit.differences import limit_of, standardised
from pipelines.log.result_figures import fitted, residuals, robot_of
from pipelines.log.stored_result import StoredResult, read_result
from pipelines.report.comparison_report import Answer, Comparison, Figure, Residual, comparison_report
from pipelines.report.report import Report
from pipelines.stage import Inputs, Request, Stage

__all__ = ["STAGE", "Comparison", "Settings", "compute", "read", "report"]


@dataclass(frozen=True)
class Settings:
    """`alpha`: how often two results of one and the same arm may be said to differ."""

    alpha: float = 0.01


def read(request: Request, settings: Settings) -> Inputs:
    """The two results.

    Raises:
        UsageError: C02, not two of them, or of different commands; C04, there is none.
        InputRejected: F02, F05, S19, what is no result as rrrid wrote it.
    """
    paths = request.paths * 2 if len(request.paths) == 1 else request.paths  # what is named twice is named once by now
    if len(paths) != 2:
        raise UsageError("C02", f"{len(paths)} results", where="compare", remedy="name two: rrrid compare A B")
    found = tuple(read_result(path) for path in paths)
    if found[0].command != found[1].command:
        raise UsageError("C02", f"results of different commands: {found[0].command} and {found[1].command}", where="compare",
                         remedy="compare two of one command")
    named = replace(request, paths=tuple(one.path.parent for one in found))
    robots = [robot for one in found if (robot := robot_of(one.object))]
    return Inputs(sources=tuple(one.path for one in found), material=found, label=named.paths[1].name,
                  robot_name=robots[0] if len(set(robots)) == 1 else "several" if robots else "unknown")


def compute(inputs: Inputs, settings: Settings) -> Comparison:
    """Figures against their uncertainty, residuals side by side, verdicts and findings.

    Raises:
        NothingMatched: C06, the two have nothing in common that could be compared.
        InputRejected: S20, stages or findings that are none.
        UsageError: C02, an alpha that is no probability.
    """
    if not 0.0 < settings.alpha < 1.0:
        raise UsageError("C02", f"alpha {settings.alpha:g}", where="--alpha", remedy="give a probability between 0 and 1")
    a, b = inputs.material
    names = _names(a, b)
    figures, alone = _figures(a, b, settings.alpha)
    mine, theirs = residuals(a.object), residuals(b.object)
    left = tuple(Residual(name, unit, before, theirs[name][0]) for name, (before, unit) in mine.items() if name in theirs)
    try:
        answers = tuple(_answers(a.object, b.object))
    except (KeyError, TypeError, AttributeError) as problem:
        raise InputRejected("S20", f"not what a result of {a.command} holds ({type(problem).__name__}: {problem})",
                            where=f"{names[0]}, {names[1]}", remedy="run the command again") from problem
    if not (figures or left or answers):
        raise NothingMatched("C06", f"the two results of {a.command} have no figure in common", where=f"{names[0]}, {names[1]}",
                             remedy="compare results of the same robot and the same settings")
    differ = any(one.beyond for one in figures) or any(one.differs for one in answers)
    return Comparison(a.command, names, differ, limit_of(len(figures), settings.alpha), settings.alpha, figures, alone[0], alone[1],
                      left, answers)


def _names(a: StoredResult, b: StoredResult) -> tuple[str, str]:
    """What the two are called: as much of their paths, from the end, as tells them apart; nothing of where they lie."""
    parts = [one.path.parts if one.path.name != "result.json" else one.path.parts[:-1] for one in (a, b)]
    for depth in range(1, 5):
        names = ["/".join(part[-depth:]) for part in parts]
        if names[0] != names[1]:
            return names[0], names[1]
    return f"{parts[0][-1]} (A)", f"{parts[1][-1]} (B)"


def _figures(a: StoredResult, b: StoredResult, alpha: float) -> tuple[tuple[Figure, ...], tuple[tuple[str, ...], tuple[str, ...]]]:
    """What both have, the farthest first; and the names of what only one has."""
    first, second = fitted(a.object), fitted(b.object)
    both = [name for name in first if name in second and first[name][2] == second[name][2]]
    limit = limit_of(len(both), alpha)
    found = []
    for name in both:
        (x, std_x, unit), (y, std_y, _) = first[name], second[name]
        z = standardised(x, y, std_x, std_y)
        found.append(Figure(name, unit, x, std_x, y, std_y, z, math.isfinite(z) and abs(z) > limit))
    found.sort(key=lambda one: -abs(one.away))
    alone = tuple(tuple(name for name in mine if name not in both) for mine in (first, second))
    return tuple(found), (alone[0], alone[1])


def _answers(a: Mapping[str, Any], b: Mapping[str, Any]) -> Iterator[Answer]:
    """What the two say in words: verdicts, findings, and how the stages of a run have ended."""
    said = [dict(_said(one)) for one in (a, b)]
    for what in dict.fromkeys([*said[0], *said[1]]):
        yield Answer(what, said[0].get(what, "–"), said[1].get(what, "–"))


def _said(result: Mapping[str, Any], place: str = "") -> Iterator[tuple[str, str]]:
    if isinstance(result.get("verdict"), str):
        yield f"{place}verdict", result["verdict"]
    for kind in ("findings", "standing"):
        if isinstance(result.get(kind), list):  # what stands is named already where `extend` says it
            places = (one if kind == "standing" and isinstance(one, str) else _place(one) for one in result[kind])
            yield f"{place}{kind}", ", ".join(sorted(places)) or "none"
    for one in result.get("stages") or ():
        yield f"{place}{one['name']} ends in", str(one["exit"])
    for one in result.get("runs") or ():
        yield from _said(one, f"{one['name']}: ")


def _place(finding: Mapping[str, Any]) -> str:
    return f"{finding.get('cause')}:{finding['joint']}" if finding.get("joint") is not None else str(finding.get("cause"))


def report(result: Comparison) -> Report:
    """The verdict, every figure by how far it moved, residuals, what was said."""
    return comparison_report(result)


STAGE = Stage("compare", "Compare two results", Settings, compute, report, read,
              exit_code=lambda result, check: int(check and result.differ))
