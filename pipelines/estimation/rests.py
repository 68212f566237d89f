"""Leave out the equations of joints that rest, held by dry friction.

    rows = moving_rows(motions, fitted, columns, recipe, weighted)

At rest dry friction takes any value between -F_c and F_c that holds the joint: the equation has an
unknown torque, and no law of friction holds (Armstrong-Hélouvry, Dupont & Canudas de Wit 1994,
sec. 2.1). A joint rests where it neither moves nor accelerates; a reversal has no speed but all its
acceleration. A joint without stiction has rests
like any motion: so the equations at rest are left out only where a model fitted to the motion
leaves far more of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipelines.estimation.config import FitConfig
from pipelines.estimation.estimate import Recipe, Stacked, equations_of
from pipelines.estimation.least_squares import fit
from pipelines.estimation.motion import Motions
from pipelines.estimation.regression import Columns, Rows
from pipelines.io.log import Array
from pipelines.quality.segments import Mask, blocks

_CONFIG = FitConfig()


def moving_rows(
    motions: Motions,
    fitted: int,
    columns: Columns,
    recipe: Recipe,
    weighted: bool = True,
    held: Sequence[Mask] | None = None,
) -> list[Rows]:
    """Return the samples of each log that make equations, without those that dry friction holds.

    Args:
        fitted: how many of `motions`, from the first on, are fitted; the others are judged by.
        held: (joints,) of each log: joints of which no sample makes an equation.
    """
    equations = equations_of(motions, recipe, columns)
    rows = [one.rows for one in equations]
    if held is not None:
        rows = [replace(one, slow=one.slow | own) for one, own in zip(rows, held, strict=True)]
    still = _rests(motions, recipe.cutoff_hz)
    moving = [replace(one, slow=one.slow | mask) for one, mask in zip(rows, still, strict=True)]
    own = [replace(one, chosen=part) for one, part in zip(equations, moving, strict=True)][:fitted]
    counts = np.sum([one.counts for one in own], axis=0)
    if not any(mask.any() for mask in still[:fitted]) or counts.min() < _CONFIG.fewest_of_joint:
        return rows
    weights = None if weighted else np.ones(len(counts))
    beta = fit(Stacked(own), weights=weights).solution.beta
    power, count = np.zeros((2, 2, len(counts)))  # at rest, and in motion
    for one, every, mask in zip(own, rows, still, strict=False):
        resting = replace(one, chosen=replace(every, slow=every.slow | ~mask))
        for k, part in enumerate((resting, one)):
            for block in part:
                power[k] += np.sum(block.residual(beta) ** 2, axis=1)
                count[k] += block.counts
    rest, move = np.sqrt(power / np.maximum(count, 1.0))
    stuck = rest > _CONFIG.more * move
    return [
        replace(one, slow=one.slow | (mask & stuck)) for one, mask in zip(rows, still, strict=True)
    ]


def _rests(motions: Motions, cutoff_hz: float | None) -> list[Mask]:
    """Return the samples (samples, joints) of each log where a joint stands for a period of the
    low-pass, and for another one to either side, over which that spreads what held it.
    """
    speeds = [found.motion.dq[found.good.kept] for _, found in motions]
    accelerations = [found.motion.ddq[found.good.kept] for _, found in motions]
    usual = [_rms(speeds), _rms(accelerations)]
    found_rests = []
    for (log, _), dq, ddq in zip(motions, speeds, accelerations, strict=True):
        period = _CONFIG.memory if cutoff_hz is None else 1.0 / cutoff_hz
        least = math.ceil(period / log.sample_time)
        slow = np.hypot(dq / usual[0], ddq / usual[1]) < _CONFIG.resting
        out = np.zeros(slow.shape, dtype=bool)
        for j in range(slow.shape[1]):
            for start, stop in blocks(slow[:, j]):
                if stop - start > least:
                    out[max(0, start - least) : stop + least, j] = True
        found_rests.append(out)
    return found_rests


def _rms(parts: Sequence[Array]) -> Array:
    return np.asarray(np.maximum(np.sqrt(np.mean(np.vstack(parts) ** 2, axis=0)), 1e-300))
