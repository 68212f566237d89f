"""Fit an exact model: every number at once.

    done = refine(model, data, weight)                    Gauss-Newton over everything
    done.residual                                         what is left
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.fitted.dissipation import dissipating, driving
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.linear import covariance, left_out, solved, superfluous
from pipelines.model.diagnosis.fitted.nominal import rigid_rows
from pipelines.model.diagnosis.fitted.slopes import Which, slopes_of
from pipelines.model.diagnosis.rows.data import Data

__all__ = ["Refined", "refine"]

_STEPS = 8
_SHARES = (1.0, 0.4, 0.1)  # of a step, until one leaves less
_RIDGES = (0.0, 1e-4, 1e-2)  # of unit columns: two numbers that do nearly the same would be moved far apart
_GAIN = 1e-5  # of the squared residual: less is no progress
_PARTS = 30  # blocks of time, of about a second: longer than noise remembers
_INVISIBLE = 1e-3  # η below which a number is one that the others are as well


@dataclass(frozen=True, eq=False)
class Refined:
    """A model fitted exactly."""

    model: Exact
    data: Data
    weight: Array  # (joints,)
    left: Array  # (rows,) [N m]
    slopes: Array  # (numbers, rows) unweighted
    names: tuple[Which, ...]  # of the slopes behind those of the base
    known: Array | None = None  # (numbers, numbers) their covariance, where they were fitted to other rows

    @cached_property
    def weights(self) -> Array:
        return np.asarray(self.weight[self.data.joint])

    @property
    def residual(self) -> Array:
        """(rows,) weighted."""
        return np.asarray(self.left * self.weights)

    @cached_property
    def rss(self) -> float:
        """Squared weighted residual."""
        return float(self.residual @ self.residual)

    @property
    def rms(self) -> Array:
        return self.data.rms(self.left)

    def of_effect(self, place: int) -> list[int]:
        """Which slopes belong to effect number `place`."""
        first = len(self.model.beta)
        return [first + k for k, (kind, which, _) in enumerate(self.names) if kind == 1 and which == place]

    @cached_property
    def unseen(self) -> list[int]:
        """Which slopes, of effects, the others are as well: those numbers stay where they were, for these logs do not tell them."""
        if self.known is not None:  # where they were fitted they were held
            return [k for k in range(len(self.model.beta), len(self.slopes)) if self.names[k - len(self.model.beta)][0] == 1
                    and self.known[k, k] == 0.0]
        return _superfluous(self.slopes * self.weights, len(self.model.beta), self.names)

    def covariance(self) -> Array:
        """(numbers, numbers): (JᵀJ)⁻¹ with the residual's own autocorrelation allowed for; zero of what is `unseen` and held.

        Of a number that blocks of time left out in turn move by more than that, what they say is its deviation: noise is not all
        that is left. Not to be written to.
        """
        return self._own_covariance if self.known is None else self.known

    @cached_property
    def _own_covariance(self) -> Array:
        seen = np.ones(len(self.slopes), dtype=bool)
        seen[self.unseen] = False
        table, whole = (self.slopes * self.weights)[seen], np.zeros((len(seen), len(seen)))
        residual = self.residual
        noise = covariance(table, residual)
        std = np.sqrt(np.maximum(np.diag(noise), 1e-300))
        wider = np.maximum(left_out(table, residual, self.data.blocks(_PARTS)) / std, 1.0)
        whole[np.ix_(seen, seen)] = noise * wider * wider[:, None]
        whole.flags.writeable = False
        return whole


def refine(model: Exact, data: Data, weight: Array, steps: int = _STEPS) -> Refined:
    """Gauss-Newton with halved steps until the squared weighted residual no longer falls."""
    with np.errstate(all="ignore"):  # a step too far may run away: it is not taken then
        return _refined(model, data, weight, steps)


def _refined(model: Exact, data: Data, weight: Array, steps: int) -> Refined:
    y, weights = data.y, weight[data.joint]
    rigid = rigid_rows(data, model.columns)
    model = replace(model, beta=dissipating(model.beta, model.columns.laws))
    laid = model.laid(data)
    left = y - model.torque(data, laid)
    now = _power(data, left, weight)
    slopes, names = slopes_of(model, data, rigid, laid)
    for _ in range(steps):
        better, table, y_left = False, slopes * weights, left * weights
        for ridge in _RIDGES:
            try:
                shift = _within(model, names, table, y_left, ridge)
            except np.linalg.LinAlgError:  # of numbers at which nothing can be solved: they stay, and gain nothing
                break
            for share in _SHARES:
                there = model.moved(share * shift, names)
                laid = there.laid(data)
                other = y - there.torque(data, laid)
                power = _power(data, other, weight)
                if power < now:
                    better = True
                    break
            if better:
                break
        if not better:
            break
        gained, model, left, now = 1.0 - power / now, there, other, power
        slopes, names = slopes_of(model, data, rigid, laid)
        if gained < _GAIN:
            break
    return Refined(model, data, weight, left, slopes, tuple(names))


def _power(data: Data, left: Array, weight: Array) -> float:
    residual = left * weight[data.joint]
    return float(residual @ residual)


def _within(model: Exact, names: list[Which], table: Array, y: Array, ridge: float) -> Array:
    """The step for every number. The others do without one that would leave its range, and stays at its end; without friction that
    would drive its joint; and without one of an effect that the rest of the model does as well: rounding would move it anywhere."""
    first = len(model.beta)
    stuck = _superfluous(table, first, names)
    shift = _without(table, y, ridge, stuck)
    beyond = [first + k for k, which in enumerate(names) if _beyond(model, which, float(shift[first + k]))]
    held = driving(model.beta, shift, model.columns.laws)
    while beyond or held:
        shift = _without(table, y + model.beta[held] @ table[held], ridge, [*stuck, *beyond, *held])
        shift[held] = -model.beta[held]
        more = driving(model.beta, shift, model.columns.laws)  # of those that were free until then
        if not more:
            break
        held = sorted({*held, *more})
    return shift


def _superfluous(table: Array, first: int, names: Sequence[Which]) -> list[int]:
    """Of the numbers of effects, whose slopes stand behind the `first` of `table` (numbers, rows)."""
    return superfluous(table, [first + k for k, (kind, _, _) in enumerate(names) if kind == 1], _INVISIBLE)


def _without(table: Array, y: Array, ridge: float, stuck: list[int]) -> Array:
    free = np.ones(len(table), dtype=bool)
    free[stuck] = False
    shift = np.zeros(len(table))
    shift[free] = solved(table[free], y, ridge)
    return shift


def _beyond(model: Exact, which: Which, by: float) -> bool:
    """Return whether a shape stands at the end of its range, and `by` points out of it."""
    kind, place, name = which
    if name.isdigit():
        return False
    effect = model.columns.laws[place] if kind == 0 else model.effects[place].effect
    return effect.at_end(name, by)
