"""What a model leaves of rows that it was not fitted to: block by block of the fitted ones."""

from __future__ import annotations

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.fitted.refit import Refined

__all__ = ["cross_validated"]


def cross_validated(done: Refined, blocks: int) -> Array:
    """(rows,) [N m] what is left of every stretch of time by the numbers that the rest asks for, to first order.

    What happened once, no other time asks for: the numbers of an event stay as they are.
    """
    once = {k for where, one in enumerate(done.model.effects) if one.log is not None for k in done.of_effect(where)}
    table, residual = np.delete(done.slopes, sorted(once), axis=0) * done.weights, done.residual
    size = np.linalg.norm(table, axis=1)
    unit = table / np.where(size > 0.0, size, 1.0)[:, None]
    place = done.data.blocks(blocks)
    left, gram, moment = np.empty_like(residual), unit @ unit.T, unit @ residual
    ridge = 1e-9 * np.eye(len(gram))
    for block in range(int(place.max()) + 1):
        held = place == block
        own = unit[:, held]
        square, asked = gram - own @ own.T + ridge, moment - own @ residual[held]
        left[held] = residual[held] - np.linalg.solve(square, asked) @ own
    return left / done.weights
