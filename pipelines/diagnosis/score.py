"""Compare models by how they predict blocks of time: the model confidence set.

    log_scores(losses, rows)            of each block, its noise level unknown
    confidence_set({key: scores})       the models that the data do not tell from the best

Hansen, Lunde & Nason 2011, statistic T_max, with a moving-block bootstrap (Künsch 1989).
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import TypeVar

import numpy as np

from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.table import Array

__all__ = ["confidence_set", "log_scores"]

K = TypeVar("K", bound=Hashable)

_SEED = 1


def log_scores(losses: Array, rows: Array) -> Array:
    """Return n_b ln(loss_b / n_b): minus twice the log likelihood of a block of unknown noise."""
    return np.asarray(rows * np.log(np.maximum(losses, 1e-9) / rows))


def confidence_set(scores: Mapping[K, Array], config: DiagnosisConfig) -> list[K]:
    """Return the models whose scores (blocks,), smaller is better, may be those of the best."""
    keys = list(scores)
    table = np.array([scores[key] for key in keys])
    blocks, length = table.shape[1], min(config.blocks_together, table.shape[1])
    rng = np.random.default_rng(_SEED)
    starts = rng.integers(0, blocks, (config.resamples, -(-blocks // length)))
    drawn = (starts[:, :, None] + np.arange(length)).reshape(config.resamples, -1)[:, :blocks] % blocks
    resampled, mean = table[:, drawn].mean(axis=2), table.mean(axis=1)
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
