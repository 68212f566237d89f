"""One log, every way to reconstruct its motion: parameters, standard deviations and held-out error side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import and_

from pipelines.errors import InputRejected
from pipelines.log.experiment import ExperimentLog
from pipelines.model.estimation.logs import Fitted, Judged, Motions, Recipe, equations_of, fit_logs, judge, motions_of
from pipelines.model.estimation.regression import Rows
from pipelines.model.tuned import METHODS

__all__ = ["Compared", "compare"]

_NAN = float("nan")


@dataclass(frozen=True)
class Compared:
    """What one way to reconstruct comes to."""

    method: str
    used: bool  # the one whose estimate is reported
    identify: float  # relative torque error
    validate: float
    equations: int  # that it was judged by: the same of all
    value: tuple[float, ...]  # rigid parameters
    std: tuple[float, ...]
    failed: str  # why it gave none; empty where it did


def compare(fitted: Fitted, judged: Judged, blocks: int, weighted: bool = True) -> tuple[Compared, ...]:
    """Fit and judge by every method, on the same equations: of the samples that all of them know.

    Cut-off and decimation are those of the estimate. A filter leaves out what it knows badly, others do not know what
    they know badly: each is judged by what is left of all.
    """
    columns, recipe = fitted.estimate.columns, fitted.recipe
    motions: dict[str, tuple[Motions, Motions]] = {}
    failed: dict[str, str] = {}
    rows: list[tuple[list[Rows], list[Rows]]] = []
    for method in METHODS:
        try:
            one = ((fitted.motions, judged.motions) if method == recipe.how.method else
                   (_again(fitted.motions, recipe, method), _again(judged.motions, recipe, method)))
            chosen = tuple([equations.rows for equations in equations_of(part, recipe, columns)] for part in one)
        except InputRejected as problem:  # a zero-phase filter cannot pass a gap, say
            failed[method] = problem.message
            continue
        motions[method] = one
        rows.append((chosen[0], chosen[1]))
    common = [[reduce(and_, of_log) for of_log in zip(*(part[k] for part in rows), strict=True)] for k in (0, 1)]
    return tuple(_row(method, motions.get(method), common, fitted, blocks, weighted, failed.get(method, "")) for method in METHODS)


def _again(motions: Motions, recipe: Recipe, method: str) -> Motions:
    logs: Sequence[ExperimentLog] = [log for log, _ in motions]
    return motions_of(logs, replace(recipe.how, method=method, jerk_std=None, bandwidth=None))


def _row(method: str, motions: tuple[Motions, Motions] | None, rows: list[list[Rows]], fitted: Fitted, blocks: int,
         weighted: bool, failed: str) -> Compared:
    used = method == fitted.recipe.how.method
    if motions is None:
        return Compared(method, used, _NAN, _NAN, 0, (), (), failed)
    try:
        other = fit_logs(motions[0], fitted.estimate.columns, fitted.recipe, weighted, rows[0])
        errors = judge(other, motions[1], blocks, rows[1]).errors
    except InputRejected as problem:
        return Compared(method, used, _NAN, _NAN, 0, (), (), problem.message)
    found, rigid = other.estimate, list(fitted.estimate.columns.rigid)
    return Compared(method, used, other.errors.relative_error, errors.relative_error, int(errors.counts.sum()),
                    tuple(map(float, found.beta[rigid])), tuple(map(float, found.std[rigid])), "")
