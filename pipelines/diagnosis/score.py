"""Compare models by how they predict blocks of time: the model confidence set.

    block_losses(columns, info, residual, block)   of each block, predicted from all others
    log_scores(losses, rows)            of each block, its noise level unknown
    confidence_set({key: scores})       the models that the data do not tell from the best
    probabilities({key: scores})        how probable each is
    chi2_bound, upper_point             what chance exceeds rarely, by its law or by values seen

A block predicted from all others leaves e_b = (I - J_bᵀ P⁻¹ J_b)⁻¹ r_b, exact for a linear model:
J are the slopes by all numbers, P their information with the prior, r the residual of the fit to
all rows.
Hansen, Lunde & Nason 2011, statistic T_max, with a moving-block bootstrap (Künsch 1989).
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import TypeVar

import numpy as np

from pipelines.diagnosis.arrow import Arrow
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.table import Array, Indices, Table

__all__ = [
    "block_losses",
    "chi2_bound",
    "confidence_set",
    "log_scores",
    "probabilities",
    "upper_point",
]

K = TypeVar("K", bound=Hashable)

_SEED = 1


def block_losses(
    columns: Table, info: Arrow, residual: Sequence[Array], block: Sequence[Indices]
) -> Array:
    """Return the squared error (blocks,) of each block of rows, predicted from all other blocks.

    Args:
        columns: J, slopes by the k numbers.
        info: factor of P (k, k), of all rows and the prior.
        residual: of each joint's rows.
        block: number of the block, of each joint's rows.
    """
    whole = [info.whitened(columns, j) for j in range(len(residual))]
    count = 1 + max(int(b.max()) for b in block if len(b))
    order = [np.argsort(b, kind="stable") for b in block]
    edges = [np.searchsorted(b[o], np.arange(count + 1)) for b, o in zip(block, order, strict=True)]
    out = np.zeros(count)
    for b in range(count):
        rows = [o[e[b] : e[b + 1]] for o, e in zip(order, edges, strict=True)]
        r = np.concatenate([v[own] for v, own in zip(residual, rows, strict=True)])
        shared = np.concatenate(
            [w[:, own] for (_, w), own in zip(whole, rows, strict=True)], axis=1
        )
        inner, first = np.eye(len(r)) - shared.T @ shared, 0
        for (w, _), own in zip(whole, rows, strict=True):
            at = slice(first, first := first + len(own))
            inner[at, at] -= w[:, own].T @ w[:, own]
        error = np.linalg.solve(inner, r)
        out[b] = float(error @ error)
    return out


def log_scores(losses: Array, rows: Array) -> Array:
    """Return n_b ln(loss_b / n_b): minus twice the log likelihood of a block of unknown noise."""
    return np.asarray(rows * np.log(np.maximum(losses, 1e-9) / rows))


def probabilities(scores: Mapping[K, Array], config: DiagnosisConfig) -> dict[K, float]:
    """Return how probable each model is: the mean of exp(-score / 2), normalised, over the bootstrap.

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
    starts = rng.integers(0, blocks, (config.resamples, -(-blocks // length)))
    runs = starts[:, :, None] + np.arange(length)
    return np.asarray(runs.reshape(config.resamples, -1)[:, :blocks] % blocks)


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


def chi2_bound(alpha: float, freedom: int) -> float:
    """Return the value that χ² of as many degrees of freedom exceeds with probability `alpha`."""
    from scipy.stats import chi2

    return float(chi2.isf(alpha, max(freedom, 1)))


def upper_point(values: Sequence[float], alpha: float) -> float:
    """Return the upper `alpha` point of a Gumbel law fitted to maxima by its moments."""
    x = np.asarray(values)
    scale = max(float(x.std(ddof=1)) * np.sqrt(6.0) / np.pi, 1e-12) if len(x) > 1 else 1e-12
    return float(x.mean() - np.euler_gamma * scale - scale * np.log(-np.log1p(-alpha)))
