"""A cause that stayed below its threshold and explains decidedly more than the best of those that did not, at the same joint.

    better = better_than(best, case, now, screened, gate)        it, fitted exactly; None where there is none

Thresholds tell whether anything is there: what noise, or the reference logs, show of a cause that all rows feel may be many times
what they show of one at a single joint. Once something is there, which of two causes it is the same rows tell, fitted and held out:
the lesser one, named because its own threshold is lower, would be a wrong name. What time held out has refused stays out, and where
no floor is known nothing else keeps a cause out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.fit.flips import by_flips
from pipelines.log.experiment import Array
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.screened.screen import Screened
from pipelines.model.diagnosis.searched.case import Case, HeldOut
from pipelines.model.diagnosis.searched.gate import Gate
from pipelines.model.diagnosis.searched.hypotheses import best_form, each_fitted
from pipelines.model.diagnosis.searched.ledger import Tried
from pipelines.model.diagnosis.worth.held_out import held_out_left

__all__ = ["better_than"]

_MORE = 1.2  # times what the best takes away: to first order, fitted exactly, and held out
_ASKED = 2  # of them, those that explain most to first order
_BLOCKS, _CHANCE = 20, 0.05  # of the time; at most, that chance makes one so much better in them, with signs drawn at random


def better_than(best: Tried, case: Case, now: Refined, screened: Sequence[Screened], gate: Gate) -> Tried | None:
    """Of those below their thresholds, the one that leaves least; None where none leaves decidedly less than `best`, an event least
    of all: what happens once others do not explain, whatever else they do."""
    if not case.floored or best.log is not None or best.screened.joint is None:
        return None
    # With reference logs: of what has changed, by which their thresholds are.
    gains = {id(one): float(seen.gain[0]) for one, seen in zip(screened, gate.judged, strict=True)}
    there = {id(one) for one in gate.passed} | gate.refused
    taken = {(e.effect.name, e.effect.joint) for e in now.model.effects}
    more = [one for one in screened if id(one) not in there and one.joint == best.screened.joint and not one.family.event
            and one.family.shapes[0].evidence in case.nameable and (one.cause, one.joint) not in taken
            and gains[id(one)] > _MORE * gains[id(best.screened)]]
    if not more:
        return None
    error = HeldOut.of(now, case)
    tried = each_fitted(case, now, sorted(more, key=lambda one: -gains[id(one)])[:_ASKED], error)
    better = [one for one in tried if one.possible and _decidedly(one, best, case, now, error.weight)]
    return best_form(case, now, min(better, key=lambda one: one.rank), error) if better else None


def _decidedly(one: Tried, best: Tried, case: Case, now: Refined, weight: Array) -> bool:
    """Whether it takes more away, fitted and held out, and so block by block; `weight` (joints,) of what is held out."""
    more = now.rss - one.done.rss > _MORE * (now.rss - best.done.rss) and 1.0 - one.error > _MORE * (1.0 - best.error)
    if not more:  # of what is no number either
        return False
    data = now.data if case.judge is None else case.judge
    left = [np.square(held_out_left(each.done, case.judge, case.blocks) * weight[data.joint]) for each in (best, one)]
    return by_flips(np.asarray(np.bincount(data.blocks(_BLOCKS), left[0] - left[1]), dtype=np.float64)) <= _CHANCE
