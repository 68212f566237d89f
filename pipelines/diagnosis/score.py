"""Compare models by how they predict blocks of time: the model confidence set.

    Blocks.of(columns, info, block).losses(residual)   of each block, predicted from all others
    log_scores(losses, rows)            of each block, its noise level unknown
    confidence_set({key: scores})       the models that the data do not tell from the best
    probabilities({key: scores})        how probable each is

A block predicted from all others leaves e_b = (I - J_bᵀ P⁻¹ J_b)⁻¹ r_b, exact for a linear model:
J are the slopes by all numbers, P their information with the prior, r the residual of the fit to
all rows.
Hansen, Lunde & Nason 2011, statistic T_max, with a moving-block bootstrap (Künsch 1989).
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.estimation.joint_table import Array, Arrow, Indices, Table

__all__ = ["Blocks", "confidence_set", "log_scores", "probabilities"]

K = TypeVar("K", bound=Hashable)

_SEED = 1  # numerics: of the bootstrap
_RESAMPLES = 400  # numerics: of the bootstrap


@dataclass(frozen=True, eq=False)
class Blocks:
    """Predictors of each block of rows from all others, by the numbers of some columns."""

    rows: tuple[tuple[Indices, ...], ...]  # of each block, of each joint
    inverse: tuple[npt.NDArray[np.float32], ...]  # of each block, (I - J_bᵀ P⁻¹ J_b)⁻¹

    @classmethod
    def of(cls, columns: Table, info: Arrow, block: Sequence[Indices]) -> Blocks:
        """Return the blocks of rows.

        Args:
            columns: J, slopes by the k numbers.
            info: factor of P (k, k), of all rows and the prior.
            block: number of the block, of each joint's rows.
        """
        count = 1 + max(int(b.max()) for b in block if len(b))
        rows = []
        for b in block:
            order = np.argsort(b, kind="stable")
            edges = np.searchsorted(b[order], np.arange(count + 1))
            rows.append(tuple(order[slice(*e)] for e in pairwise(edges)))
        whitened = [info.whitened(columns, j) for j in range(len(block))]
        inverse = []
        for here in zip(*rows, strict=True):
            shared = np.concatenate(
                [w[:, at] for (_, w), at in zip(whitened, here, strict=True)], axis=1
            )
            left, first = np.eye(shared.shape[1]) - shared.T @ shared, 0
            for (own, _), at in zip(whitened, here, strict=True):
                part = slice(first, first + len(at))
                left[part, part] -= own[:, at].T @ own[:, at]
                first += len(at)
            inverse.append(_inverse(left).astype(np.float32))
        return cls(tuple(zip(*rows, strict=True)), tuple(inverse))

    def losses(self, residual: Sequence[Array], more: Sequence[Array] | None = None) -> Array:
        """Return the squared error (blocks,) of each block, predicted from all other blocks.

        With V of further numbers, (A - Vᵀ V)⁻¹ = G + G Vᵀ (I - V G Vᵀ)⁻¹ V G, G = A⁻¹ (Woodbury).

        Args:
            residual: of each joint's rows.
            more: V (m, rows of each joint).
        """
        out = np.zeros(len(self.rows))
        for b, (rows, inverse) in enumerate(zip(self.rows, self.inverse, strict=True)):
            left = np.concatenate([r[at] for r, at in zip(residual, rows, strict=True)])
            if more is None:
                error = inverse @ left
            else:
                v = np.concatenate([w[:, at] for w, at in zip(more, rows, strict=True)], axis=1)
                both = inverse @ np.column_stack([left, v.T])
                error, through = both[:, 0], both[:, 1:]
                error = error + through @ np.linalg.solve(np.eye(len(v)) - v @ through, v @ error)
            out[b] = float(error @ error)
        return out


def _inverse(matrix: Array) -> Array:
    """Return the inverse of a positive definite matrix, by its Cholesky factor.

    A matrix that is so but for rounding has none; it is inverted as any other.
    """
    from scipy.linalg.lapack import dpotrf, dpotri

    lower, failed = dpotrf(matrix, lower=1)
    if failed:
        return np.asarray(np.linalg.inv(matrix), dtype=np.float64)
    inverse = np.tril(dpotri(lower, lower=1)[0])
    return np.asarray(inverse + np.tril(inverse, -1).T)


def log_scores(losses: Array, rows: Array) -> Array:
    """Return n_b ln(loss_b / n_b): minus twice the log likelihood of a block of unknown noise."""
    return np.asarray(rows * np.log(np.maximum(losses, 1e-9) / rows))


def probabilities(scores: Mapping[K, Array], config: DiagnosisConfig) -> dict[K, float]:
    """Return how probable each model is: the bootstrap mean of exp(-score / 2), normalised.

    Yao, Vehtari, Simpson & Gelman 2018, pseudo-BMA+.
    """
    table = np.array(list(scores.values()))
    total = table[:, _drawn(table.shape[1], config)].sum(axis=2)
    weight = np.exp(-0.5 * (total - total.min(axis=0)))
    mean = (weight / weight.sum(axis=0)).mean(axis=1)
    return {key: float(p) for key, p in zip(scores, mean, strict=True)}


def _drawn(blocks: int, config: DiagnosisConfig) -> Indices:
    """Return the blocks (resamples, blocks) of each resample of the moving-block bootstrap."""
    length, rng = min(config.blocks_together, blocks), np.random.default_rng(_SEED)
    starts = rng.integers(0, blocks, (_RESAMPLES, -(-blocks // length)))
    runs = starts[:, :, None] + np.arange(length)
    return np.asarray(runs.reshape(_RESAMPLES, -1)[:, :blocks] % blocks)


def confidence_set(scores: Mapping[K, Array], config: DiagnosisConfig) -> list[K]:
    """Return the models whose scores (blocks,), smaller is better, may be those of the best."""
    keys = list(scores)
    table = np.array([scores[key] for key in keys])
    resampled, mean = table[:, _drawn(table.shape[1], config)].mean(axis=2), table.mean(axis=1)
    alive = list(range(len(keys)))
    while len(alive) > 1:
        distance = mean[alive] - mean[alive].mean()
        spread = resampled[alive] - resampled[alive].mean(axis=0) - distance[:, None]
        std = np.sqrt(np.mean(spread**2, axis=1)) + 1e-12
        t = distance / std
        if np.mean((spread / std[:, None]).max(axis=0) > t.max()) >= config.set_alpha:
            break
        alive.pop(int(np.argmax(t)))
    return [keys[k] for k in alive]
