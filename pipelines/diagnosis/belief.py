"""What is known of nominal and standing numbers, before the rows are seen and with them.

    belief = Belief(info, moment, base, gram, structure, block)
    belief.cost(theta, residual)          ‖r‖² + (θ - m)ᵀ A (θ - m)
    belief.beside(effects)                factor of the information of all numbers, with effects
    belief.losses(effects, residual)      squared error of each block, predicted from all others

Every candidate is fitted beside the same numbers: what depends on these alone is worked out once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pipelines.diagnosis.arrow import Arrow, Structure
from pipelines.diagnosis.score import Blocks
from pipelines.diagnosis.table import Array, Indices, Table

__all__ = ["RIDGE", "Belief"]

RIDGE = 1e-9  # numerics: of unit columns of an effect, which may be dependent
_FREE = 1e-6  # numerics: of the information along a direction that is freed, or not held


@dataclass(frozen=True, eq=False)
class Belief:
    """θ ~ N(m, A⁻¹), and the rows y = θ B + e that will tell more of it."""

    info: Array  # A (k, k)
    moment: Array  # A m (k,)
    base: Table  # B
    gram: Array  # B Bᵀ
    structure: Structure
    block: tuple[Indices, ...]  # of each joint's rows

    @cached_property
    def _before(self) -> Arrow:
        return Arrow.of(self.info, self.structure)

    @cached_property
    def after(self) -> Arrow:
        """The factor of P = A + B Bᵀ."""
        return Arrow.of(self.info + self.gram, self.structure)

    @cached_property
    def mean(self) -> Array:
        """(k,) m."""
        return self._before.solve(self.moment)

    @cached_property
    def _constant(self) -> float:
        return float(np.sum(self._before.half(self.moment) ** 2))

    def cost(self, theta: Array, residual: Sequence[Array]) -> float:
        """Return ‖r‖² + (θ - m)ᵀ A (θ - m)."""
        away = theta @ self.info @ theta - 2.0 * self.moment @ theta + self._constant
        return float(sum(r @ r for r in residual) + away)

    def slope(self, theta: Array, residual: Sequence[Array]) -> Array:
        """Return the slope (k,) of -cost / 2 by θ."""
        return np.asarray(self.moment - self.info @ theta + self.base.moments(residual))

    def beside(self, effects: Table, damping: float = RIDGE) -> Arrow:
        """Return the factor of [P, B Eᵀ; E Bᵀ, E Eᵀ + damping I], E the columns of effects."""
        own = effects.gram(effects) + damping * np.eye(effects.width)
        return self.after.widened(self.base.gram(effects), own)

    def losses(self, effects: Table, residual: Sequence[Array]) -> Array:
        """Return the squared error (blocks,) of each block of rows, predicted from all others."""
        if not effects.width:
            return self._blocks.losses(residual)
        across = self.base.gram(effects)
        half = self.after.half(across)
        own = effects.gram(effects) + RIDGE * np.eye(effects.width) - half.T @ half
        into = np.linalg.inv(np.linalg.cholesky(own))
        both = Table.stacked([self.base, effects])
        every = np.concatenate([-self.after.solve(across), np.eye(effects.width)]) @ into.T
        return self._blocks.losses(residual, both.times(every))

    @cached_property
    def _blocks(self) -> Blocks:
        return Blocks.of(self.base, self.after, self.block)

    def exactly(self, nominal: Table) -> Belief:
        """Return the same of rows that follow other nominal columns, which are the first ones."""
        first = np.arange(nominal.width)
        rest = self.base.take(np.arange(nominal.width, self.base.width))
        base, gram = Table.stacked([nominal, rest]), self.gram.copy()
        gram[first] = nominal.gram(base)
        gram[:, first] = gram[first].T
        return replace(self, base=base, gram=gram)

    def information(self, effects: Table) -> Array:
        """Return the information of all numbers, whose factor `beside` gives."""
        across, own = self.base.gram(effects), effects.gram(effects) + RIDGE * np.eye(effects.width)
        return np.block([[self.info + self.gram, across], [across.T, own]])

    def freed(self, along: Array) -> Belief:
        """Return the belief that knows nothing along directions (k, d) of unit length."""
        side = self.info @ along
        inner = along.T @ side
        inner = inner + _FREE * np.trace(inner) * np.eye(len(inner))
        free = self.info - side @ np.linalg.solve(inner, side.T)
        free = 0.5 * (free + free.T)
        return replace(self, info=free, moment=free @ self.mean)

    def held(self, at: Indices) -> Belief:
        """Return the belief that knows some of the numbers to be what it takes for their mean."""
        info, moment = self.info.copy(), self.moment.copy()
        tight = np.diag(self.gram)[at] / _FREE
        info[at, at] += tight
        moment[at] += tight * self.mean[at]
        return replace(self, info=info, moment=moment)
