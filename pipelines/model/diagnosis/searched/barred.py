"""A cause that stayed below its threshold and explains decidedly more than the best of those that did not, at the same joint.

    better = better_than(best, case, now, screened, passed)        it, fitted exactly; None where there is none

Thresholds tell whether anything is there: what noise, or the reference logs, show of a cause that all rows feel may be many times
what they show of one at a single joint. Once something is there, which of two causes it is the same rows tell, fitted and held out:
the lesser one, named because its own threshold is lower, would be a wrong name.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.fit.flips import by_flips
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.screened.screen import Screened
from pipelines.model.diagnosis.searched.case import Case, HeldOut
from pipelines.model.diagnosis.searched.hypotheses import best_form, fitted
from pipelines.model.diagnosis.searched.ledger import Tried
from pipelines.model.diagnosis.worth.held_out import held_out_left

__all__ = ["better_than"]

_MORE = 1.2  # times what the best takes away: to first order, fitted exactly, and held out
_ASKED = 2  # of them, those that explain most to first order
_BLOCKS, _CHANCE = 20, 0.05  # of the time; at most, that chance makes one so much better in them (Vuong 1989)


def better_than(best: Tried, case: Case, now: Refined, screened: Sequence[Screened], passed: Sequence[Screened]) -> Tried | None:
    """Of those that did not pass, the one that leaves least; None where none leaves decidedly less than `best`, an event least of
    all: what happens once others do not explain, whatever else they do."""
    if best.log is not None or best.screened.joint is None:
        return None
    there = {id(one) for one in passed}
    taken = {(e.effect.name, e.effect.joint) for e in now.model.effects}
    more = [one for one in screened if id(one) not in there and one.joint == best.screened.joint and not one.family.event
            and one.family.shapes[0].evidence in case.nameable and (one.cause, one.joint) not in taken
            and one.gain[0] > _MORE * best.screened.gain[0]]
    if not more:
        return None
    error = HeldOut.of(now, case)
    tried = [fitted(case, now, one, error) for one in sorted(more, key=lambda one: -one.gain[0])[:_ASKED]]
    better = [one for one in tried if one.possible and _decidedly(one, best, case, now)]
    return best_form(case, now, min(better, key=lambda one: one.rank), error) if better else None


def _decidedly(one: Tried, best: Tried, case: Case, now: Refined) -> bool:
    """Whether it takes more away, fitted and held out, and so block by block."""
    if (now.rss - one.done.rss <= _MORE * (now.rss - best.done.rss)) or 1.0 - one.error <= _MORE * (1.0 - best.error):
        return False
    data = now.data if case.judge is None else case.judge
    weights = now.weight[data.joint]
    left = [np.square(held_out_left(each.done, case.judge, case.blocks) * weights) for each in (best, one)]
    return by_flips(np.asarray(np.bincount(data.blocks(_BLOCKS), left[0] - left[1]), dtype=np.float64)) <= _CHANCE
