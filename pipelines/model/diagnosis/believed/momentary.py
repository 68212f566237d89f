"""Whether a cause acts only while something that happened once lasts: it is not told then from what the law of that leaves.

    only_then(final, place)        effect number `place` of a fitted model, beside the moments that the model has

A touch is no half sine to the last. What of it stays looks like whatever is great just then: the drive that pushed hardest was
clipped, say. Of a cause that is there all the time a touch sees no more than its share of the time.
"""

from __future__ import annotations

import numpy as np

from pipelines.model.diagnosis.fitted.refit import Refined

__all__ = ["ONLY_THEN", "only_then"]

ONLY_THEN = "it acts only while something that happened once lasts, and may be what its law leaves"

_MOST = 0.8  # of its power
_ACTS = 1e-3  # of its largest torque: less is the filter's


def only_then(final: Refined, place: int) -> bool:
    """Whether nearly all that effect number `place` does falls into a moment of another effect."""
    model = final.model
    moments = [k for k, one in enumerate(model.effects) if one.log is not None]
    if model.effects[place].log is not None or not moments:
        return False
    data, whole = final.data, model.torque(final.data)
    own = np.square((whole - model.without(place).torque(data)) * final.weights)
    then = np.zeros(data.rows, dtype=bool)
    for k in moments:
        torque = np.abs(whole - model.without(k).torque(data))
        times = data.t[torque > _ACTS * torque.max()]
        here = data.log_of == (model.effects[k].log or 0) - data.first
        then |= here & (data.t >= times.min(initial=np.inf)) & (data.t <= times.max(initial=-np.inf))
    return bool(own[then].sum() > _MOST * own.sum())
