"""Search a landscape with many valleys: islands of starts, the best refined, disturbed and refined again.

An island begins with several starts on a coarse copy of the problem, a fifth of the harmonics on a fifth of the samples, where
an evaluation costs next to nothing. Its best are lifted to the fine problem and refined there while the smooth surrogate is
sharpened and the barrier lowered; then they are disturbed, little and much in turn, as long as that gains. After that the
next island begins. The best point of all counts.

No step looks at a clock: the evaluations alone decide what is done next.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from pipelines.fit.design.budget import Budget, SpentError
from pipelines.fit.design.lbfgs import minimise

__all__ = ["Best", "Landscape", "Round", "polish", "search"]

Array = npt.NDArray[np.float64]


class Landscape(Protocol):
    """A design problem on points x."""

    def value(self, x: Array, sharpness: float, weight: float) -> tuple[float, Array, float]:
        """What is minimised with a barrier of `weight`, its gradient, and the exact figure; infinite outside the limits."""
        ...

    def start(self, rng: np.random.Generator) -> Array:
        """A random point within the limits."""
        ...

    def disturbed(self, x: Array, size: float, rng: np.random.Generator) -> Array:
        """A point near x, within the limits."""
        ...


@dataclass(frozen=True)
class Round:
    """One minimisation in a series of ever sharper ones."""

    sharpness: float
    weight: float  # of the barrier
    iterations: int


@dataclass(eq=False)
class Best:
    """The best point so far, and when it was found."""

    score: float = float("inf")
    x: Array | None = None
    evaluation: int = 0


_COARSE = (Round(4, 2e-2, 30), Round(16, 5e-3, 50), Round(64, 2e-3, 60))
_LIFTED = (Round(32, 4e-3, 40), Round(128, 1e-3, 80), Round(400, 3e-4, 120))
_AGAIN = (Round(32, 2e-3, 40), Round(128, 5e-4, 100), Round(600, 1e-4, 150))
_STARTS = 8
_LIFTED_STARTS = 2
_SIZES = (0.05, 0.15, 0.4)  # of a disturbance, relative to the point
_POOL = 4
_PATIENCE = 2 * len(_SIZES)  # disturbances without a gain worth having before the next island
_GAIN = 1e-3


def search(coarse: Landscape, fine: Landscape, lift: Callable[[Array], Array], budget: Budget, rng: np.random.Generator,
           best: Best) -> None:
    """Search until the budget is spent; `best` holds the best point of `fine` at any moment: an interruption loses nothing."""
    climb = _Climber(fine, budget, best)
    try:
        while True:
            starts = []
            for _ in range(_STARTS):
                local = Best()
                _Climber(coarse, budget, local).descend(coarse.start(rng), _COARSE, 1e-4)
                starts.append(local)
            starts.sort(key=lambda start: start.score)
            _island(climb, [lift(start.x) for start in starts[:_LIFTED_STARTS] if start.x is not None], rng)
    except SpentError:
        return


def _island(climb: _Climber, starts: Sequence[Array], rng: np.random.Generator) -> None:
    pool = sorted((climb.descend(climb.inside(x), _LIFTED, 1e-5) for x in starts), key=lambda member: member[0])
    idle, turn = 0, 0
    while pool and idle < _PATIENCE:
        size = _SIZES[turn % len(_SIZES)]
        # the little disturbance is for the best alone; the larger ones give every member of the pool its turn
        base = pool[0 if turn % len(_SIZES) == 0 else turn % len(pool)]
        found = climb.descend(climb.land.disturbed(base[1], size, rng), _AGAIN, 1e-5)
        idle = 0 if found[0] < pool[0][0] - _GAIN else idle + 1
        pool = sorted([*pool, found], key=lambda member: member[0])[:_POOL]
        turn += 1


def polish(fine: Landscape, x: Array, rounds: Sequence[Round], budget: Budget, best: Best) -> None:
    """Refine one point to the end."""
    try:
        climb = _Climber(fine, budget, best)
        climb.descend(climb.inside(x), rounds, 1e-6)
    except SpentError:
        return


class _Climber:
    """Minimise on one landscape, counting evaluations and keeping the best point."""

    def __init__(self, land: Landscape, budget: Budget, best: Best) -> None:
        self.land, self.budget, self.best = land, budget, best
        self._own = Best()

    def descend(self, x: Array, rounds: Sequence[Round], tolerance: float) -> tuple[float, Array]:
        """The best exact figure met on the way, and its point."""
        self._own = Best()
        for one in rounds:
            def function(at: Array, one: Round = one) -> tuple[float, Array]:
                return self._value(at, one)

            x = minimise(function, x, one.iterations, tolerance).x
        return self._own.score, x if self._own.x is None else self._own.x

    def inside(self, x: Array) -> Array:
        """x, drawn back from the limits until it keeps them."""
        return self.land.disturbed(x, 0.0, np.random.default_rng(0))

    def _value(self, x: Array, one: Round) -> tuple[float, Array]:
        self.budget.spend()
        value, gradient, score = self.land.value(x, one.sharpness, one.weight)
        if np.isfinite(value):
            for best in (self._own, self.best):
                if score < best.score:
                    best.score, best.x, best.evaluation = score, x, self.budget.done
        return value, gradient
