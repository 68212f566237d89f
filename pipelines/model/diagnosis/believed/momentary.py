"""What happened once, and what is there at other times.

    only_then(final, place)        whether effect number `place` of a fitted model acts only while its moments last: it is not told
                                   then from what their laws leave
    at_other_times(final, floor)   whether a model of nothing but moments leaves something far above the floor at other times

A touch is no half sine to the last. What of it stays looks like whatever is great just then: the drive that pushed hardest was
clipped, say. Of a cause that is there all the time a touch sees no more than its share of the time.
Touches enough, wherever it is great, take most of it for all that; what they leave then at other times has no name.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.named.verdict import held_out_high

__all__ = ["AT_OTHER_TIMES", "ONLY_THEN", "at_other_times", "only_then"]

ONLY_THEN = "it acts only while something that happened once lasts, and may be what its law leaves"
AT_OTHER_TIMES = "what takes most of it happened once, and at other times something is left far above the floor"

_MOST = 0.8  # of its power
_ACTS = 1e-3  # of its largest torque: less is the filter's


def only_then(final: Refined, place: int) -> bool:
    """Whether nearly all that effect number `place` does falls into a moment of another effect."""
    model = final.model
    if model.effects[place].log is not None or all(one.log is None for one in model.effects):
        return False
    data, whole = final.data, model.torque(final.data)
    own = np.square((whole - model.without(place).torque(data)) * final.weights)
    return bool(own[_moments(final)].sum() > _MOST * own.sum())


def at_other_times(final: Refined, floor: Array) -> bool:
    """Whether a joint stands far above its floor (joints,) [N m] at other times, where every effect of the model is a moment."""
    if not final.model.effects or any(one.log is None for one in final.model.effects):
        return False
    return bool(held_out_high(final.data.rms(np.where(_moments(final), 0.0, final.left)), floor))


def _moments(final: Refined) -> NDArray[np.bool_]:
    """(rows,) While one of the moments of the model lasts."""
    data, whole = final.data, final.model.torque(final.data)
    then = np.zeros(data.rows, dtype=bool)
    for k, one in enumerate(final.model.effects):
        if one.log is None:
            continue
        torque = np.abs(whole - final.model.without(k).torque(data))
        times = data.t[torque > _ACTS * torque.max()]
        here = data.log_of == one.log - data.first
        then |= here & (data.t >= times.min(initial=np.inf)) & (data.t <= times.max(initial=-np.inf))
    return then
