"""Leave out the equations of joints that rest, held by dry friction.

    motions = without_stiction(motions, fitted, columns, recipe, weighted)

At rest dry friction takes any value between -F_c and F_c that holds the joint: the equation has an
unknown torque, and no law of friction holds (Armstrong-Hélouvry, Dupont & Canudas de Wit 1994,
sec. 2.1). A joint rests where it neither moves nor accelerates: |dq| and |ddq| both small compared
with what they are in the log. A reversal has no speed but all its acceleration, and counts as
motion.

A joint without stiction has rests like any motion. So the equations at rest are left out only where
they contradict those of the motion: where a model fitted to the motion leaves far more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipelines.estimation.config import RestConfig
from pipelines.estimation.estimate import Recipe, equations_of, fit_logs
from pipelines.estimation.motion import Motions, Reconstructed
from pipelines.estimation.regression import Columns, LogEquations, Rows
from pipelines.io.log import Array
from pipelines.quality.segments import Mask

_CONFIG = RestConfig()


def without_stiction(
    motions: Motions, fitted: int, columns: Columns, recipe: Recipe, weighted: bool = True
) -> Motions:
    """Return the motions, each with the samples in which dry friction holds a joint.

    Args:
        fitted: how many of `motions`, from the first on, are fitted; the others are judged by.
    """
    still = []
    for (log, _), size in zip(motions, slowness([one for _, one in motions]), strict=True):
        period = _CONFIG.memory if recipe.cutoff_hz is None else 1.0 / recipe.cutoff_hz
        reach = math.ceil(period / log.sample_time)
        still.append(lasting(size < _CONFIG.still, reach, reach))
    if not any(mask.any() for mask in still[:fitted]):
        return motions
    equations = equations_of(motions[:fitted], recipe, columns)
    pairs = list(zip(equations, still[:fitted], strict=True))
    moving = [replace(one.rows, slow=one.rows.slow | mask) for one, mask in pairs]
    kept = [replace(one, chosen=rows).counts for one, rows in zip(equations, moving, strict=True)]
    if np.sum(kept, axis=0).min() < _CONFIG.least:
        return motions
    beta = fit_logs(motions[:fitted], columns, recipe, weighted, moving).estimate.beta
    resting = [replace(one.rows, slow=one.rows.slow | ~mask) for one, mask in pairs]
    rest, move = (_rms(equations, rows, beta) for rows in (resting, moving))
    held = rest > _CONFIG.more * move
    return tuple(
        (log, replace(found, stuck=mask & held) if (mask & held).any() else found)
        for (log, found), mask in zip(motions, still, strict=True)
    )


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


def _rms(equations: Sequence[LogEquations], rows: Sequence[Rows], beta: Array) -> Array:
    """Return the rms residual (joints,) of some equations; zero for a joint without equations."""
    power, count = np.zeros((2, equations[0].rows.slow.shape[1]))
    for one, chosen in zip(equations, rows, strict=True):
        for block in replace(one, chosen=chosen):
            power = power + np.sum(block.residual(beta) ** 2, axis=1)
            count = count + block.counts
    return np.asarray(np.sqrt(power / np.maximum(count, 1.0)))
