"""Search a landscape with many valleys: many cheap starts, the best lifted, and a small pool refined over and over.

Starts are made on a coarse copy of the problem, a fifth of the harmonics on a fifth of the samples, where an evaluation costs
next to nothing; what they reach there says well what they will reach in the end. The best of them are lifted to the fine
problem and refined while the smooth surrogate is sharpened and the barrier lowered. They join a pool, whose best members
are disturbed a little and refined again. Then come the next starts. The best point of all counts.

No step looks at a clock: the evaluations alone decide what is done next.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from pipelines.errors import Interrupted
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
_POOL = 5
_TURNS = (0, 1, 0, 2)  # which member of the pool is refined, the best being 0
_SIZES = (0.03, 0.03, 0.08, 0.05)  # of the disturbance of each, relative to the point


def search(coarse: Landscape, fine: Landscape, lift: Callable[[Array], Array], budget: Budget, rng: np.random.Generator,
           best: Best) -> None:
    """Search until the budget is spent; `best` holds the best point of `fine` at any moment: an interruption loses nothing."""
    climb, below = _Climber(fine, budget, best), _Climber(coarse, budget, Best())
    pool: list[tuple[float, Array]] = []
    try:
        while True:
            starts = []
            for _ in range(_STARTS):
                score, x = below.descend(coarse.start(rng), _COARSE, 1e-4)
                lifted = climb.inside(lift(x))
                climb.look(lifted)  # so that there is something to keep, however early the search is stopped
                starts.append((score, lifted))
            starts.sort(key=lambda start: start[0])
            pool += [climb.descend(x, _LIFTED, 1e-5) for _, x in starts[:_LIFTED_STARTS]]
            for place, size in zip(_TURNS, _SIZES, strict=True):
                pool = sorted(pool, key=lambda member: member[0])[:_POOL]
                place = min(place, len(pool) - 1)
                found = climb.descend(fine.disturbed(pool[place][1], size, rng), _AGAIN, 1e-5)
                if found[0] < pool[place][0]:
                    pool[place] = found
    except SpentError:
        return


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

    def look(self, x: Array) -> None:
        """Evaluate one point, for it may be the best."""
        self._value(x, Round(4, 1e-3, 1))

    def inside(self, x: Array) -> Array:
        """x, drawn back from the limits until it keeps them."""
        return self.land.disturbed(x, 0.0, np.random.default_rng(0))

    def _value(self, x: Array, one: Round) -> tuple[float, Array]:
        self.budget.spend()
        try:
            value, gradient, score = self.land.value(x, one.sharpness, one.weight)
        except Interrupted:  # it has told nothing: as many evaluations as are counted shall give the same answer again
            self.budget.done -= 1
            raise
        if np.isfinite(value):
            for best in (self._own, self.best):
                if score < best.score:
                    best.score, best.x, best.evaluation = score, x, self.budget.done
        return value, gradient
