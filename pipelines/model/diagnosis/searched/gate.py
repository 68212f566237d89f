"""What the causes that were screened have to exceed, and which of them do: before any is fitted exactly.

    gate = gate_of(case, now, screened)
    gate.asked                          those that do, and those near it that only an exact fit tells
    once_more(case, now, screened)      ids of causes that somebody named, found at their places before

To first order little may be left of a cause that changes a number of the laws as well: the more of a hump at low speed the nominal
dry friction makes up for, the slower it changes its sign, and beside it the hump takes off a twentieth of what both do, fitted
together. Where no floor is known, a threshold is a share of the residual and has nothing to do with noise; so what comes near it,
at a joint at which nothing else passes, is fitted too, and has to take off most of what that joint leaves.
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
from pipelines.model.diagnosis.searched.ledger import Tried

__all__ = ["CLOSE", "Gate", "gate_of", "once_more"]

CLOSE = 0.25  # of the best gain: weaker ones are no rivals
_NEAR = 0.5  # of its threshold
_MOST = 0.5  # of the squared residual of its joint


@dataclass(frozen=True, eq=False)
class Gate:
    """What the causes that were screened have to exceed."""

    judged: Sequence[Screened]  # with the gains that the thresholds are for
    thresholds: Thresholds
    passed: tuple[Screened, ...]
    refused: frozenset[int]  # ids of those above their thresholds that other time does not bear out
    near: tuple[Screened, ...] = ()  # that only an exact fit tells

    @property
    def asked(self) -> tuple[Screened, ...]:
        """Those that are fitted exactly."""
        return (*self.passed, *self.near)

    def told(self, one: Tried, before: Refined) -> bool:
        """Whether a cause that was fitted passes: where only that tells, by most of what `before` leaves of its joint."""
        if not any(one.screened is other for other in self.near):
            return any(one.screened is other for other in self.passed)
        joint = one.screened.joint or 1
        left = [float(done.data.rms(done.left)[joint - 1]) for done in (before, one.done)]
        return left[1]**2 < (1.0 - _MOST) * left[0]**2


def gate_of(case: Case, now: Refined, screened: Sequence[Screened]) -> Gate:
    """Thresholds of the twin; without them a share of the residual, and time that bears a cause out."""
    thresholds = without_twin(screened, now.rss, now.weight) if case.thresholds is None else case.thresholds.at(now.weight)
    again = once_more(case, now, screened)
    if again:
        bound = without_twin(screened, now.rss, now.weight).gain
        thresholds = replace(thresholds, gain=np.where([id(one) in again for one in screened], bound, thresholds.gain))
    passed = tuple(one for one, bound in zip(screened, thresholds.gain, strict=True)
                   if one.gain[0] > bound and one.stands_out)
    asked = passed if not case.floored else tuple(one for one in passed if id(one) in again)
    refused = frozenset(id(asked[k]) for k in not_borne_out(case, now, asked)) if asked else frozenset()
    stay = tuple(one for one in passed if id(one) not in refused)
    return Gate(screened, thresholds, stay, refused, () if case.floored else _near(case, now, screened, thresholds, stay))


def _near(case: Case, now: Refined, screened: Sequence[Screened], thresholds: Thresholds,
          passed: Sequence[Screened]) -> tuple[Screened, ...]:
    """Of the joints at which nothing passes, causes that change numbers of the laws, near their thresholds and borne out."""
    there = {one.joint for one in passed}
    near = [one for one, bound in zip(screened, thresholds.gain, strict=True)
            if one.joint is not None and one.joint not in there and one.family.shapes[0].shared
            and _NEAR * bound < one.gain[0] <= bound]
    out = not_borne_out(case, now, near) if near else frozenset()
    return tuple(one for k, one in enumerate(near) if k not in out)


def once_more(case: Case, now: Refined, screened: Sequence[Screened]) -> frozenset[int]:
    """Ids of the causes that somebody named, and that were found at their places before: nobody said how often they act there."""
    if not case.named:
        return frozenset()
    taken = {(e.effect.name, e.effect.joint) for e in now.model.effects}
    return frozenset(id(one) for one in screened if (one.cause, one.joint) in taken)
