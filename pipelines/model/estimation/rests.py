"""Leave out the equations of joints that rest, held by dry friction.

    motions = without_stiction(motions, fitted, columns, recipe, weighted)

At rest dry friction takes any value between -F_c and F_c that holds the joint: the equation has
an unknown torque, and no law of friction holds (Armstrong-Hélouvry, Dupont & Canudas de Wit 1994,
sec. 2.1). A joint rests where it neither moves nor accelerates: |dq| and |ddq| both small beside
what they are in the log. A reversal has no speed but all its acceleration, and counts as motion.

A joint without stiction has rests like any motion. So the equations at rest are left out only
where they contradict those of the motion: where a model fitted to the motion leaves far more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.dynamics.body import Array
from pipelines.estimation.motion import Reconstructed
from pipelines.model.estimation.logs import Motions, Recipe, equations_of, fit_logs
from pipelines.model.estimation.regression import Columns, LogEquations, Rows
from pipelines.quality.segments import Mask

__all__ = ["RestConfig", "rests", "without_stiction"]


@dataclass(frozen=True)
class RestConfig:
    """Limits of a rest, and of leaving it out."""

    still: float = 0.2  # hypot of speed and acceleration over their rms; .1 to .3 are alike
    memory: float = 0.05  # [s] a rest lasts at least, where no low-pass has a longer period
    more: float = 2.0  # times the residual of the motion, that a rest held by friction leaves
    least: int = 20  # equations of a joint that have to remain


def without_stiction(motions: Motions, fitted: int, columns: Columns, recipe: Recipe,
                     weighted: bool = True, config: RestConfig | None = None) -> Motions:
    """Return the motions, each with the samples in which dry friction holds a joint.

    Args:
        fitted: how many of `motions`, from the first on, are fitted; the others are judged by.
    """
    config = config or RestConfig()
    still = rests([found for _, found in motions], recipe.cutoff_hz, config)
    if not any(mask.any() for mask in still[:fitted]):
        return motions
    equations = equations_of(motions[:fitted], recipe, columns)
    moving = [replace(one.rows, slow=one.rows.slow | mask)
              for one, mask in zip(equations, still[:fitted], strict=True)]
    kept = np.sum([_counts(one, rows) for one, rows in zip(equations, moving, strict=True)], axis=0)
    if kept.min() < config.least:
        return motions
    beta = fit_logs(motions[:fitted], columns, recipe, weighted, moving).estimate.beta
    resting = [replace(one.rows, slow=one.rows.slow | ~mask)
               for one, mask in zip(equations, still[:fitted], strict=True)]
    rest, move = (_rms(equations, rows, beta) for rows in (resting, moving))
    held = rest > config.more * move
    return tuple((log, replace(found, stuck=mask & held) if (mask & held).any() else found)
                 for (log, found), mask in zip(motions, still, strict=True))


def rests(motions: Sequence[Reconstructed], cutoff_hz: float | None,
          config: RestConfig | None = None) -> list[Mask]:
    """Return where each joint rests for a period of the low-pass or longer: (samples, joints).

    The period to either side, over which the low-pass spreads the torque of the rest, belongs
    to it. Speed and acceleration are measured by their rms in all of `motions`.
    """
    config = config or RestConfig()
    parts = [[x[found.good.kept] for x in (found.motion.dq, found.motion.ddq)] for found in motions]
    speed, acceleration = (np.sqrt(np.mean(np.vstack(part) ** 2, axis=0)) for part in zip(*parts, strict=True))
    masks = []
    for found, (dq, ddq) in zip(motions, parts, strict=True):
        size = np.hypot(dq / np.maximum(speed, 1e-300), ddq / np.maximum(acceleration, 1e-300))
        period = config.memory if cutoff_hz is None else 1.0 / cutoff_hz
        reach = math.ceil(period / found.good.log.sample_time)
        masks.append(np.stack([_lasting(column, reach) for column in (size < config.still).T], 1))
    return masks


def _lasting(still: Mask, reach: int) -> Mask:
    """Return the stretches of more than `reach` samples, and as many samples to either side."""
    out = np.zeros(len(still), dtype=bool)
    edges = np.flatnonzero(np.diff(np.pad(still.astype(np.int8), 1))).reshape(-1, 2)
    for start, stop in edges[np.diff(edges, axis=1)[:, 0] > reach].tolist():
        out[max(0, start - reach):stop + reach] = True
    return out


def _counts(one: LogEquations, rows: Rows) -> Array:
    return np.asarray(replace(one, chosen=rows).counts, dtype=np.float64)


def _rms(equations: Sequence[LogEquations], rows: Sequence[Rows], beta: Array) -> Array:
    """Return the rms residual (joints,) of some equations; zero for a joint without equations."""
    power, count = np.zeros((2, equations[0].rows.slow.shape[1]))
    for one, chosen in zip(equations, rows, strict=True):
        for block in replace(one, chosen=chosen):
            power = power + np.sum(block.residual(beta) ** 2, axis=1)
            count = count + block.counts
    return np.asarray(np.sqrt(power / np.maximum(count, 1.0)))
