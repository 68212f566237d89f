"""Estimate base parameters and friction from the equations of several logs.

    found = estimate(identify, columns)     fit, covariance, what is visible
    found.convergence()                     how the parameters settled

Kostić et al. 2004, eq. (12)-(15): the equations of all logs stacked, joints weighted by their own residual.

Memory is constant in the samples, but for logs whose motion repeats: the covariance holds a period of equations of each, one
log after the other, so it grows with the period. A kept set of equations is `_KEPT_IN_MEMORY` at most.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pipelines.fit.contrasts import Contrasted
from pipelines.fit.convergence import Convergence, convergence
from pipelines.fit.covariance import Robust, robust_covariance
from pipelines.fit.equations import Block, split
from pipelines.fit.identifiability import (
    Unresolved,
    condition_number,
    typical_size,
    unresolved,
    visible,
)
from pipelines.fit.least_squares import Fit, Solution, fit
from pipelines.fit.statistics import Statistics, gather, gather_growing
from pipelines.model.estimation.cycle import cycle_of
from pipelines.model.estimation.regression import Columns

__all__ = ["Estimate", "Stacked", "estimate"]

Array = npt.NDArray[np.float64]

_KEPT_IN_MEMORY = 4 << 20  # [B] of conditioned equations; longer ones are made again at every pass
_PARTS = 40  # of the convergence series


class Stacked:
    """The equations of several logs, one after the other; kept in memory where they are few."""

    def __init__(self, logs: Sequence[Iterable[Block]]) -> None:
        self.logs = logs
        self._kept: list[tuple[int, Block]] | None = []

    def __iter__(self) -> Iterator[Block]:
        for _, block in self.numbered():
            yield block

    def numbered(self) -> Iterator[tuple[int, Block]]:
        """Each block with the place of its log."""
        if self._kept:
            yield from self._kept
            return
        kept, size = [], 0
        for place, log in enumerate(self.logs):
            for block in log:
                size += sum(v.nbytes for v in block.values)
                if size <= _KEPT_IN_MEMORY:
                    kept.append((place, block))
                else:
                    kept.clear()
                yield place, block
        self._kept = kept if size <= _KEPT_IN_MEMORY else None


@dataclass(frozen=True, eq=False)
class Estimate:
    """Parameters, how well they are known, and how well they explain the equations they were fitted to."""

    columns: Columns
    solution: Solution
    robust: Robust
    statistics: Statistics
    equations: Stacked

    @property
    def beta(self) -> Array:
        return self.solution.beta

    @property
    def std(self) -> Array:
        return self.robust.std

    @cached_property
    def visible(self) -> npt.NDArray[np.bool_]:
        """(k,) whether the logs show the parameter: its value, or that it is small beside its like."""
        units = [column.unit + column.name.partition(":")[0].rstrip("0123456789") for column in self.columns.names]
        known = visible(self.beta, self.std, typical_size(self.beta, self.std, units))
        return np.asarray(known & self.trusted)

    @cached_property
    def unresolved(self) -> Unresolved:
        return unresolved(self.solution, [column.name for column in self.columns.names], float(self.robust.inflation.max()))

    @cached_property
    def trusted(self) -> npt.NDArray[np.bool_]:
        """(k,) whether the logs determine the parameter; the value of any other is the smallest that explains them."""
        lost = set(self.unresolved.parameters)
        return np.asarray([column.name not in lost for column in self.columns.names] & self.solution.determined)

    @cached_property
    def condition_number(self) -> float:
        """Of Φ in (13): rigid columns, unweighted, SI."""
        return condition_number(self.statistics, self.columns.rigid)

    def convergence(self) -> Convergence:
        """How the estimates settle as samples come in, Fig. 12."""
        size = max(1, self.statistics.samples // _PARTS)
        return convergence(gather_growing(split(self.equations, size), _PARTS), self.solution, self.robust.inflation)


def estimate(logs: Sequence[Iterable[Block]], columns: Columns, weighted: bool = True) -> Estimate:
    """Fit the equations of `logs`; without `weighted` every joint counts alike, as in eq. (15)."""
    stacked = Stacked(logs)
    gram = gather(stacked)
    weights = None if weighted else np.ones(columns.body.robot.n_joints)
    fitted = fit(stacked, weights=weights, gram=gram)
    return Estimate(columns, fitted.solution, _robust(stacked, fitted), fitted.statistics, stacked)


def _robust(stacked: Stacked, fitted: Fit) -> Robust:
    """The covariance; where a motion repeats, no smaller than that of its periods one after the other.

    Turned by phases it knows what repeats, but takes a period for all that its noise remembers; in the order of time it is the
    other way round. Each tells too little where the other holds, and where both hold they agree.
    """
    every = robust_covariance(stacked, fitted.solution, fitted.statistics.longest)
    cycles = tuple(map(cycle_of, stacked.logs))
    if all(cycle is None for cycle in cycles):
        return every
    turned = Contrasted(stacked.numbered, cycles)
    return robust_covariance(turned, fitted.solution, turned.longest(fitted.statistics.longest)).at_least(every)
