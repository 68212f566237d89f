"""How sure the numbers of a linear fit are whose rows depend on one another."""

from __future__ import annotations

import numpy as np

from pipelines.log.experiment import Array

__all__ = ["deviations"]

_LAGS = 20  # rows next to each other that share the noise of the low-pass


def deviations(table: Array, residual: Array) -> Array:
    """Standard deviations (k,) of the coefficients of `table` (k, rows), weighted: Newey & West 1987, 20 lags."""
    size = np.linalg.norm(table, axis=1)
    unit = table / np.where(size > 0.0, size, 1.0)[:, None]
    values, vectors = np.linalg.eigh(unit @ unit.T)
    keep = values > 1e-11 * values[-1]
    bread = (vectors[:, keep] / values[keep]) @ vectors[:, keep].T
    scores = unit * residual
    meat = scores @ scores.T
    for lag in range(1, _LAGS + 1):
        cross = scores[:, lag:] @ scores[:, :-lag].T
        meat += (1.0 - lag / (_LAGS + 1.0)) * (cross + cross.T)
    return np.asarray(np.sqrt(np.maximum(np.diag(bread @ meat @ bread), 0.0)) / np.where(size > 0.0, size, 1.0))
