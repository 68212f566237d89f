"""Joints weighted by what a model leaves of them, and its curves of friction looked for anew beside what was found.

    done = reweighted(done, case)
"""

from __future__ import annotations

import numpy as np

from pipelines.model.diagnosis.fitted.refit import Refined, refine
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.curves import with_curves_anew

__all__ = ["reweighted"]

_SETTLED = 0.02  # of a weight
_ROUNDS = 3  # of weights


def reweighted(done: Refined, case: Case) -> Refined:
    """The same model refitted with the weights that follow from it."""
    done = with_curves_anew(done, case.model.columns.laws)
    for _ in range(_ROUNDS):
        weight = 1.0 / np.maximum(done.rms, 1e-12)
        settled = np.abs(weight / done.weight - 1.0).max() < _SETTLED
        done = refine(done.model, done.data, weight)
        if settled:
            break
    return done
