"""The same cause at another joint, where it would explain as much by another torque.

    others = as_good_elsewhere(best, tried, before)

Of two joints' torque scales only the ratio shows: a drive that gives a tenth too little is the other that gives a ninth too much,
and masses that nobody knows fit either. Masses do not change by themselves: with reference logs it is where one set of base
parameters for before and after leaves least. What is the same torque by whichever joint it is told, a motor that turns with two of
them, is no such case.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.searched.ledger import Tried

__all__ = ["as_good_elsewhere"]

_AS_LITTLE = 0.01  # of what the best leaves, fitted and held out, another leaves more at most
_AS_MUCH = 0.05  # of what the best takes away, another takes less at most
_ONE_TORQUE = 0.9  # cosine from which two are the same torque


def as_good_elsewhere(best: Tried, tried: Sequence[Tried], before: Refined) -> list[Tried]:
    """Those of `tried` that are the same cause as `best` at other joints, as good beside what `before` holds."""
    if best.log is not None or best.effect.joint is None:
        return []
    return [one for one in tried if _elsewhere(one, best) and _as_good(one, best, before) and not _one_torque(one, best)]


def _elsewhere(one: Tried, best: Tried) -> bool:
    return one.effect.name == best.effect.name and one.effect.joint != best.effect.joint and one.log is None and one.possible


def _as_good(one: Tried, best: Tried, before: Refined) -> bool:
    """Whether it leaves hardly more, of the fitted rows and of those held out."""
    fitted, gain = one.done.rss - best.done.rss, before.rss - best.done.rss
    held_out = one.error - best.error
    return (fitted <= min(_AS_LITTLE * best.done.rss, _AS_MUCH * gain)
            and held_out <= min(_AS_LITTLE * best.error, _AS_MUCH * (1.0 - best.error)))


def _one_torque(one: Tried, best: Tried) -> bool:
    mine, theirs = (_torque(each) for each in (best, one))
    return float(mine @ theirs) > _ONE_TORQUE * float(np.linalg.norm(mine) * np.linalg.norm(theirs))


def _torque(one: Tried) -> Array:
    """(rows,) [N m] of the hypothesis alone."""
    model, data = one.done.model, one.done.data
    return np.asarray(model.torque(data) - model.without(len(model.effects) - 1).torque(data))
