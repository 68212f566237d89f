"""Leave out the equations of joints that rest, held by dry friction.

    rows = moving_rows(motions, fitted, columns, recipe, weighted)

At rest dry friction takes any value between -F_c and F_c that holds the joint: the equation has an
unknown torque, and no law of friction holds (Armstrong-Hélouvry, Dupont & Canudas de Wit 1994,
sec. 2.1). A joint rests where it neither moves nor accelerates; a reversal has no speed but all its
acceleration. A joint without stiction has rests like any motion: so the equations at rest are left
out only where a model fitted to the motion leaves far more of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipelines.estimation.config import RestConfig
from pipelines.estimation.estimate import Recipe, equations_of, fit_logs
from pipelines.estimation.motion import Motions, Reconstructed
from pipelines.estimation.regression import Columns, Rows
from pipelines.io.log import Array
from pipelines.quality.segments import Mask

_CONFIG = RestConfig()


def moving_rows(
    motions: Motions, fitted: int, columns: Columns, recipe: Recipe, weighted: bool = True
) -> list[Rows]:
    """Return the samples of each log that make equations, without those that dry friction holds.

    Args:
        fitted: how many of `motions`, from the first on, are fitted; the others are judged by.
    """
    equations = equations_of(motions, recipe, columns)
    rows = [one.rows for one in equations]
    still = []
    for (log, _), size in zip(motions, slowness([one for _, one in motions]), strict=True):
        period = _CONFIG.memory if recipe.cutoff_hz is None else 1.0 / recipe.cutoff_hz
        reach = math.ceil(period / log.sample_time)
        still.append(lasting(size < _CONFIG.still, reach, reach))
    moving = [replace(one, slow=one.slow | mask) for one, mask in zip(rows, still, strict=True)]
    pairs = list(zip(equations, moving, strict=True))[:fitted]
    counts = np.sum([replace(one, chosen=own).counts for one, own in pairs], axis=0)
    if not any(mask.any() for mask in still[:fitted]) or counts.min() < _CONFIG.least:
        return rows
    beta = fit_logs(motions[:fitted], columns, recipe, weighted, moving[:fitted]).estimate.beta
    power, count = np.zeros((2, 2, len(counts)))  # at rest, and in motion
    for one, own, mask in zip(equations[:fitted], moving, still, strict=False):
        resting = replace(one.rows, slow=one.rows.slow | ~mask)
        for k, chosen in enumerate((resting, own)):
            for block in replace(one, chosen=chosen):
                power[k] += np.sum(block.residual(beta) ** 2, axis=1)
                count[k] += block.counts
    rest, move = np.sqrt(power / np.maximum(count, 1.0))
    held = rest > _CONFIG.more * move
    return [
        replace(one, slow=one.slow | (mask & held)) for one, mask in zip(rows, still, strict=True)
    ]


def slowness(motions: Sequence[Reconstructed]) -> list[Array]:
    """Return hypot of speed and acceleration (kept samples, joints), over their rms in all."""
    parts = [[x[found.good.kept] for x in (found.motion.dq, found.motion.ddq)] for found in motions]
    rms = [np.sqrt(np.mean(np.vstack(part) ** 2, axis=0)) for part in zip(*parts, strict=True)]
    speed, acceleration = (np.maximum(size, 1e-300) for size in rms)
    return [np.hypot(dq / speed, ddq / acceleration) for dq, ddq in parts]


def lasting(still: Mask, least: float, reach: int, deep: Mask | None = None) -> Mask:
    """Return the stretches (samples, joints) of more than `least` samples, `reach` wider.

    Args:
        deep: of which they shall hold as many samples; by default all.
    """
    deep = still if deep is None else deep
    out = np.zeros(still.shape, dtype=bool)
    for j in range(still.shape[1]):
        count = np.cumsum(np.append(0, deep[:, j]))
        edges = np.flatnonzero(np.diff(np.pad(still[:, j].astype(np.int8), 1))).reshape(-1, 2)
        for start, stop in edges.tolist():
            if count[stop] - count[start] > least:
                out[max(0, start - reach) : stop + reach, j] = True
    return out
