"""Least squares around a solution: the step, what a number adds to the others, and how sure numbers of dependent rows are.

Columns are brought to unit length first, so that units do not matter; directions that rounding makes are left alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from pipelines.log.experiment import Array

__all__ = ["covariance", "left_out", "solved", "superfluous"]

_LAGS = 20  # rows next to each other that share the noise of the low-pass
_ROUNDING = 1e-11  # of the largest eigenvalue
_ALONE = 1e-9  # the same: what a block alone tells, the others do not move


def solved(table: Array, y: Array, ridge: float = 0.0) -> Array:
    """(k,) coefficients of `table` (k, rows), smallest where rows do not tell; `ridge` of unit columns."""
    unit, size = _unit(table)
    values, vectors = _seen(unit @ unit.T)
    return np.asarray((vectors / (values + ridge)) @ (vectors.T @ (unit @ y)) / size)


def superfluous(table: Array, wanted: Sequence[int], least: float) -> list[int]:
    """Which of the `wanted` columns of `table` (k, rows) the others are as well, but for a part below `least` of their length.

    The one that is seen least goes first, and no longer counts as one of the others: of two columns that are nearly the same one
    stays (pivoting, as in Golub & Van Loan 2013, ch. 5.4).
    """
    unit, _ = _unit(table)
    gram, left = unit @ unit.T, list(wanted)
    gone: list[int] = []
    while left:
        seen = [_apart(gram, place, gone) for place in left]
        lowest = int(np.argmin(seen))
        if seen[lowest] >= least:
            break
        gone.append(left.pop(lowest))
    return gone


def _apart(gram: Array, place: int, gone: Sequence[int]) -> float:
    """Part of one unit column that no combination of the others is, but for those that are gone."""
    others = np.ones(len(gram), dtype=bool)
    others[[place, *gone]] = False
    values, vectors = _seen(gram[np.ix_(others, others)])
    along = vectors.T @ gram[others, place]
    return float(np.sqrt(np.clip(gram[place, place] - float(along @ (along / values)), 0.0, 1.0)))


def covariance(table: Array, residual: Array) -> Array:
    """(k, k) of the coefficients of `table` (k, rows), weighted.

    Newey & West 1987 over the rows of each joint, 20 lags: neighbouring rows share the noise of the low-pass. Their weights
    1 - l / (L + 1) are those of the products of sums over L + 1 rows:

        Σ_l (1 - |l| / (L + 1)) Σ_t s_t s_{t+l}ᵀ = 1 / (L + 1) Σ_t u_t u_tᵀ,    u_t = s_{t-L} + … + s_t
    """
    unit, size = _unit(table)
    values, vectors = _seen(unit @ unit.T)
    bread = (vectors / values) @ vectors.T
    none = np.zeros((len(unit), _LAGS + 1))
    upto = np.cumsum(np.concatenate([none, unit * residual, none[:, :_LAGS]], axis=1), axis=1)
    sums = upto[:, _LAGS + 1:] - upto[:, :-_LAGS - 1]
    meat = sums @ sums.T / (_LAGS + 1)
    return np.asarray(bread @ meat @ bread / size / size[:, None])


def left_out(table: Array, residual: Array, blocks: npt.NDArray[np.intp]) -> Array:
    """Standard deviations (k,) of the same coefficients, by how each moves where one of the `blocks` (rows,) of time is left out:
    the jackknife (Miller 1974), to first order around the solution.

    What a law of the model lacks is no noise: it stays alike for longer than neighbouring rows, and other time asks for other
    numbers. With G = X Xᵀ and s_b = X_b r_b of block b, its leaving moves them by -(G - X_b X_bᵀ)⁻¹ s_b.
    """
    unit, size = _unit(table)
    gram = unit @ unit.T
    moved = []
    for block in range(int(blocks.max()) + 1):
        own = unit[:, blocks == block]
        values, vectors = _seen(gram - own @ own.T, _ALONE)
        moved.append((vectors / values) @ (vectors.T @ (own @ residual[blocks == block])))
    count = len(moved)
    return np.asarray(np.sqrt((count - 1.0) * np.var(moved, axis=0)) / size)


def _unit(table: Array) -> tuple[Array, Array]:
    size = np.linalg.norm(table, axis=1)
    size = np.where(size > 0.0, size, 1.0)
    return table / size[:, None], size


def _seen(gram: Array, least: float = _ROUNDING) -> tuple[Array, Array]:
    values, vectors = np.linalg.eigh(gram)
    keep = values > least * values[-1]
    return values[keep], vectors[:, keep]
