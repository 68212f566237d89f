"""One log, every way to reconstruct its motion: parameters, standard deviations and held-out error side by side.

Held-out relative torque error [%] on the same equations, medians over three pairs of simulated logs where there are any;
* measurably worse than the smoother in at least two of three (95 %), none was ever measurably better:

    logs                                             smoother   zero-phase   central differences   observer
    sample logs, RRR, 1 kHz                            0.585        0.585          0.594 *           1.327 *
    Stäubli TX40, recorded, 5 kHz, blocks             13.68        13.68          13.77             13.68
    simulated: 1e-5 rad, 20, 10, 5 mN m, 1 kHz         0.039        0.048 *        0.060 *           0.822 *
    encoder of 1e-3 rad                                0.740        5.474 *       11.761 *           7.984 *
    ten times the torque noise                         0.299        0.300          0.299             0.894 *
    200 Hz                                             0.201        0.219          0.221 *           1.023 *
    200 Hz, 1e-3 rad, ten times the torque noise       1.161        6.606 *        6.748 *          10.408 *

A fine encoder leaves all but the observer alike; a coarse one decides for the smoother. It is the default.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import reduce
from operator import and_

import numpy as np

from pipelines.errors import InputRejected
from pipelines.estimation.mean_period import alike
from pipelines.estimation.motion import reconstruct
from pipelines.estimation.observers import METHODS
from pipelines.fit.bootstrap import apart
from pipelines.model.estimation.blocks import Stretches
from pipelines.model.estimation.logs import (
    Fitted,
    Judged,
    Motions,
    Recipe,
    equations_of,
    fit_logs,
    judge,
)
from pipelines.model.estimation.regression import Rows

__all__ = ["Compared", "compare"]

_NAN = float("nan")
_UNKNOWN = (_NAN, _NAN)
_SEED = 20040509


@dataclass(frozen=True)
class Compared:
    """What one way to reconstruct comes to."""

    method: str
    used: bool  # the one whose estimate is reported
    identify: float  # relative torque error
    validate: float
    apart: tuple[float, float]  # `validate` less that of the one used lies there with 95 %
    tied: bool  # as good as the best of all, as far as these logs can tell
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
    return _beside([_row(method, motions.get(method), common, fitted, blocks, weighted, failed.get(method, ""))
                    for method in METHODS])


def _beside(rows: list[tuple[Compared, Stretches | None]]) -> tuple[Compared, ...]:
    """Which differences of held-out error are more than chance."""
    known = [(row, stretches) for row, stretches in rows if stretches is not None]
    if not known:
        return tuple(row for row, _ in rows)
    best = min(known, key=lambda pair: pair[0].validate)
    used = next((pair for pair in known if pair[0].used), None)
    return tuple(row if stretches is None else
                 replace(row, apart=_UNKNOWN if used is None else _apart(used, (row, stretches)),
                         tied=_apart(best, (row, stretches))[0] <= 0.0) for row, stretches in rows)


def _apart(ours: tuple[Compared, Stretches], theirs: tuple[Compared, Stretches]) -> tuple[float, float]:
    """The interval of the difference of two relative errors; of the whole torque, where a known part was subtracted."""
    if ours[0].method == theirs[0].method:
        return 0.0, 0.0
    one, other = ours[1], theirs[1]
    reduced = one.errors.relative_error
    whole = ours[0].validate / reduced if reduced > 0.0 else 1.0
    low, high = apart(one.rss.sum(axis=1), other.rss.sum(axis=1), one.power.sum(axis=1), np.random.default_rng(_SEED))
    return whole * low, whole * high


def _again(motions: Motions, recipe: Recipe, method: str) -> Motions:
    how = replace(recipe.how, method=method, jerk_std=None, bandwidth=None)
    return tuple((log, reconstruct(log, how, found.good) if found.mean is None else alike(found, how)) for log, found in motions)


def _row(method: str, motions: tuple[Motions, Motions] | None, rows: list[list[Rows]], fitted: Fitted, blocks: int,
         weighted: bool, failed: str) -> tuple[Compared, Stretches | None]:
    used = method == fitted.recipe.how.method
    if motions is None:
        return Compared(method, used, _NAN, _NAN, _UNKNOWN, False, 0, (), (), failed), None
    try:
        other = fit_logs(motions[0], fitted.estimate.columns, fitted.recipe, weighted, rows[0])
        judged = judge(other, motions[1], blocks, rows[1])
    except InputRejected as problem:
        return Compared(method, used, _NAN, _NAN, _UNKNOWN, False, 0, (), (), problem.message), None
    errors = judged.errors
    found, rigid = other.estimate, list(fitted.estimate.columns.rigid)
    row = Compared(method, used, other.errors.relative_error, errors.relative_error, _UNKNOWN, False, int(errors.counts.sum()),
                   tuple(map(float, found.beta[rigid])), tuple(map(float, found.std[rigid])), "")
    return row, judged.stretches
