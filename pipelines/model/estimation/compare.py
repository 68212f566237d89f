"""One log, every way to reconstruct its motion: parameters, standard deviations and held-out error side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pipelines.errors import InputRejected
from pipelines.log.experiment import ExperimentLog
from pipelines.model.estimation.logs import Fitted, fit_logs, judge
from pipelines.model.estimation.regression import Columns
from pipelines.model.tuned import METHODS

__all__ = ["Compared", "compare"]


@dataclass(frozen=True)
class Compared:
    """What one way to reconstruct comes to."""

    method: str
    used: bool  # the one whose estimate is reported
    identify: float  # relative torque error
    validate: float
    value: tuple[float, ...]  # rigid parameters
    std: tuple[float, ...]
    failed: str  # why it gave none; empty where it did


def compare(identify: Sequence[ExperimentLog], validate: Sequence[ExperimentLog], columns: Columns, fitted: Fitted,
            blocks: int) -> tuple[Compared, ...]:
    """Fit and judge by every method, on the same equations: cut-off and decimation are those of the estimate."""
    rows = []
    for method in METHODS:
        used = method == fitted.recipe.how.method
        how = fitted.recipe.how if used else replace(fitted.recipe.how, method=method, jerk_std=None, bandwidth=None)
        try:
            other = fitted if used else fit_logs(identify, columns, replace(fitted.recipe, how=how))
            found, errors = other.estimate, judge(other, validate, blocks).errors
        except InputRejected as problem:  # a zero-phase filter cannot pass a gap, say
            rows.append(Compared(method, used, float("nan"), float("nan"), (), (), problem.message))
            continue
        rigid = list(columns.rigid)
        rows.append(Compared(method, used, other.errors.relative_error, errors.relative_error,
                             tuple(map(float, found.beta[rigid])), tuple(map(float, found.std[rigid])), ""))
    return tuple(rows)
