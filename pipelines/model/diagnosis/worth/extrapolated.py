"""What a model may leave of other motion because its numbers are not known better: fitted to little motion, it foretells little.

    rms = extrapolated(done, judge)        (joints,) [N m]

    E(x̂ᵀ(b̂ - b))² = xᵀ C x        x a row of the other motion, C the covariance of the numbers
"""

from __future__ import annotations

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.fitted.refit import Refined, refine
from pipelines.model.diagnosis.rows.data import Data

__all__ = ["extrapolated"]


def extrapolated(done: Refined, judge: Data) -> Array:
    """(joints,) [N m] root mean square over the rows of `judge` of the standard deviation of the torque that `done` foretells."""
    slopes = refine(done.model, judge, done.weight, steps=0).slopes
    variance = np.einsum("kr,kl,lr->r", slopes, done.covariance(), slopes, optimize=True)
    return judge.rms(np.sqrt(np.maximum(variance, 0.0)))
