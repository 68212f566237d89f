"""What is left of a residual when all that may be a fault is taken away from it, right or wrong: the noise is measured in that.

    left = clean(explored)        (rows,) [N m]

Noise is in it, and hardly any fault: a fault would pass for noise, and the twin would be too noisy to show anything.
"""

from __future__ import annotations

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.fitted.nominal import orthonormal
from pipelines.model.diagnosis.floor.waves import without_waves
from pipelines.model.diagnosis.searched.hypotheses import laid_whole
from pipelines.model.diagnosis.searched.search import Explored

__all__ = ["clean"]


def clean(explored: Explored, most: int = 8) -> Array:
    """What neither the `most` most promising causes could explain, nor any line along an angle, of which no cause need know."""
    now, fit = explored.before, explored.before.fit
    best = sorted((one for one in explored.screened if not one.family.event), key=lambda one: -one.gain[0])[:most]
    tables = [laid_whole(now.data, one.shape[0].full(), now.model.arm) for one in best]
    basis = orthonormal(np.concatenate([fit.project(table) for table in tables]))
    residual = fit.residual - (basis @ fit.residual) @ basis
    return without_waves(now.data, np.asarray(residual / fit.weights))
