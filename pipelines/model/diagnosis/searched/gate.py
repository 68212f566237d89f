"""What the causes that were screened have to exceed, and which of them do: before any is fitted exactly.

    gate = gate_of(case, now, screened)
    once_more(case, now, screened)      ids of causes that somebody named, found at their places before
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.floor.thresholds import Thresholds, without_twin
from pipelines.model.diagnosis.screened.screen import Screened
from pipelines.model.diagnosis.searched.borne_out import not_borne_out
from pipelines.model.diagnosis.searched.case import Case

__all__ = ["CLOSE", "Gate", "gate_of", "once_more"]

CLOSE = 0.25  # of the best gain: weaker ones are no rivals


@dataclass(frozen=True, eq=False)
class Gate:
    """What the causes that were screened have to exceed."""

    judged: Sequence[Screened]  # with the gains that the thresholds are for
    thresholds: Thresholds
    passed: tuple[Screened, ...]
    refused: frozenset[int]  # ids of those above their thresholds that other time does not bear out


def gate_of(case: Case, now: Refined, screened: Sequence[Screened]) -> Gate:
    """Thresholds of the twin or of the reference logs; without them a share of the residual, and time that bears a cause out."""
    judged: Sequence[Screened] = screened
    if case.changed is not None:
        most = max((one.gain[0] for one in screened), default=0.0)
        judged, thresholds = case.changed(now, [bool(one.gain[0] >= CLOSE**2 * most) for one in screened])
    else:
        thresholds = without_twin(screened, now.rss, now.weight) if case.thresholds is None else case.thresholds.at(now.weight)
    again = once_more(case, now, screened)
    if again:
        bound = without_twin(screened, now.rss, now.weight).gain
        thresholds = replace(thresholds, gain=np.where([id(one) in again for one in screened], bound, thresholds.gain))
    passed = tuple(one for one, seen, bound in zip(screened, judged, thresholds.gain, strict=True)
                   if seen.gain[0] > bound and one.stands_out)
    asked = passed if not case.floored else tuple(one for one in passed if id(one) in again)
    refused = frozenset(id(asked[k]) for k in not_borne_out(case, now, asked)) if asked else frozenset()
    return Gate(judged, thresholds, tuple(one for one in passed if id(one) not in refused), refused)


def once_more(case: Case, now: Refined, screened: Sequence[Screened]) -> frozenset[int]:
    """Ids of the causes that somebody named, and that were found at their places before: nobody said how often they act there."""
    if not case.named:
        return frozenset()
    taken = {(e.effect.name, e.effect.joint) for e in now.model.effects}
    return frozenset(id(one) for one in screened if (one.cause, one.joint) in taken)
