"""What a model leaves of rows that it was not fitted to: of the judging logs, or block by block of the fitted ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.rows.data import Data

__all__ = ["cross_validated", "held_out_left"]


def held_out_left(done: Refined, judge: Data | None, blocks: int) -> Array:
    """(rows,) [N m] of the judging logs; of the fitted ones, block by block, where there are none."""
    return cross_validated(done, blocks) if judge is None else judge.y - done.model.torque(judge)


def cross_validated(done: Refined, blocks: int) -> Array:
    """(rows,) [N m] what is left of every stretch of time by the numbers that the rest asks for, to first order.

    What happened once, no other time asks for: the numbers of an event stay as they are. Where rows are steady, the rest asks with
    the ripple in the covariance of its own rows (Woodbury 1950):

        X K⁻¹ y = X y - X F (I + Fᵀ F)⁻¹ Fᵀ y
    """
    once = {k for where, one in enumerate(done.model.effects) if one.log is not None for k in done.of_effect(where)}
    table, residual = np.delete(done.slopes, sorted(once), axis=0) * done.weights, done.residual
    size = np.linalg.norm(table, axis=1)
    unit = table / np.where(size > 0.0, size, 1.0)[:, None]
    place = done.data.blocks(blocks)
    left, gram, moment = np.empty_like(residual), unit @ unit.T, unit @ residual
    waves = [_Waves(rows, f, unit[:, rows], residual[rows], place[rows])
             for rows, f in (() if done.data.ripple is None else done.data.ripple.waves(done.weight))]
    ridge = 1e-9 * np.eye(len(gram))
    for block in range(int(place.max()) + 1):
        held = place == block
        own = unit[:, held]
        square, asked = gram - own @ own.T + ridge, moment - own @ residual[held]
        for one in waves:
            less = one.without(block)
            square, asked = square - less[0], asked - less[1]
        left[held] = residual[held] - np.linalg.solve(square, asked) @ own
    return left / done.weights


@dataclass(frozen=True, eq=False)
class _Waves:
    """The ripple of one joint, in the normal equations of its rows."""

    rows: npt.NDArray[np.intp]
    f: Array  # (rows, waves) weighted
    table: Array  # X (numbers, rows)
    y: Array  # (rows,)
    place: npt.NDArray[np.intp]  # (rows,) block of each

    def without(self, block: int) -> tuple[Array, Array]:
        """What it takes off X Xᵀ and X y of the rows of all other blocks."""
        rest = self.place != block
        f, table = self.f[rest], self.table[:, rest]
        with_f = table @ f
        share = np.linalg.solve(np.eye(f.shape[1]) + f.T @ f, np.column_stack([with_f.T, f.T @ self.y[rest]]))
        return with_f @ share[:, :-1], with_f @ share[:, -1]
