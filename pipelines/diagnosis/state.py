"""Store a fit to the later rows: a model, its numbers, and its residual.

state.cost, state.losses, state.factor      cost, squared error of each block, information
state.fit                                   the same without the columns of all numbers
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipelines.diagnosis.prior import Belief
from pipelines.estimation.exact_model import Exact
from pipelines.estimation.joint_table import Array, Arrow, Indices, Table

__all__ = ["Fit", "State"]


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted model, its cost and its residual."""

    model: Exact
    cost: float
    residual: tuple[Array, ...]  # of each joint, in units of the noise


@dataclass(frozen=True, eq=False)
class State:
    """A model, its numbers, and what it leaves."""

    model: Exact
    theta: Array  # nominal and standing numbers, scaled
    belief: Belief  # before the rows
    exact: Callable[[], Belief]  # the same with the slopes of this model
    residual: tuple[Array, ...]  # of each joint, in units of the noise
    effects: Table  # slopes by the numbers of the effects, of unit length
    lasting: Indices  # of these, numbers that hold for all time, not for the moment of an event
    read_off: float = 0.0  # price of rows that effects take from the log itself

    @property
    def fit(self) -> Fit:
        """The fit without the columns of all numbers, which take the most memory."""
        return Fit(self.model, self.cost, self.residual)

    @cached_property
    def known(self) -> Belief:
        """The belief with the slopes by nominal numbers as drives and drift make them."""
        return self.exact()

    @property
    def squares(self) -> Array:
        """(joints,) sum of squares."""
        return np.array([float(r @ r) for r in self.residual])

    @property
    def rss(self) -> float:
        return float(self.squares.sum())

    @cached_property
    def cost(self) -> float:
        """‖r‖² + (θ - m)ᵀ A (θ - m), and the price of rows that are read off."""
        return self.belief.cost(self.theta, self.residual) + self.read_off

    @cached_property
    def losses(self) -> Array:
        """(blocks,) squared error of each block, predicted from all the others.

        The numbers of an event cannot be predicted from other times: they are taken as known, and
        the selection charges them. Slopes by nominal numbers are those without effects, whose
        blocks are known: effects change them by the share that they add.
        """
        return self.belief.losses(self.effects.take(self.lasting), self.residual)

    @property
    def slope(self) -> Array:
        """(k,) of -cost / 2 by all numbers."""
        own = self.known.slope(self.theta, self.residual)
        return np.asarray(np.r_[own, self.effects.moments(self.residual)])

    @cached_property
    def factor(self) -> Arrow:
        """The factor of the information P of all numbers, with the rows."""
        return self.known.beside(self.effects)

    @property
    def mean_squares(self) -> Array:
        """(joints,)"""
        return np.array([float(np.mean(r**2)) for r in self.residual])
