"""Whether time that a cause was not chosen by bears it out: the rule where no floor says what the model leaves of an arm in order.

    refused = not_borne_out(case, now, screened)    places of those causes, on what a model leaves, to first order
    borne_out(case, one, now, done)                 of the others, which are not linear or happen once, fitted exactly

Without a floor, what a model leaves is more than noise, and among a hundred causes in dozens of shapes one always explains some of
it. The numbers that the rest of the time asks for are not enough then: the shape was chosen by all of it (Stone 1974; Varma & Simon
2006; Cawley & Talbot 2010). So each block is held out of the choice of the shape as well (`blocked`). A cause is borne out where

1.  blocks gain more than they would with signs drawn at random (`fit.flips`): what one or two gain much by is not;
2.  no cause that gains more, and takes much of the same, was refused: of several that mean the same only the greatest is asked,
    or one of them would always pass;
3.  no other one that is borne out takes part of the same, and it is not decidedly better than that, block by block (Vuong 1989).
    Then something is there that neither of them is, and which is greater changes from one stretch of time to the next (Breiman
    1996, instability of a choice). Causes that take nearly all of the same are no argument: the arm is the same by either.

What happens once no other time can bear out: it has to be the greater part of what is left of its log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.fit.flips import by_flips
from pipelines.log.experiment import Array
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.screened.blocked import Blocked
from pipelines.model.diagnosis.screened.candidates import Family
from pipelines.model.diagnosis.screened.screen import Screened, screen_family
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.hypotheses import laid_whole
from pipelines.model.diagnosis.worth.held_out import held_out_left

__all__ = ["borne_out", "not_borne_out"]

_BLOCKS = 20  # of the time: a third of a second and more, which is longer than what a model leaves remembers itself
_CHANCE = 0.05  # at most, that chance gains as much
_PART, _ALL = 0.25, 0.64  # of what a cause takes, that another one takes as well: no rival below, the same torque above
_HALF = 0.5  # of what is left of a log
_SPREAD = 1e-4  # of the largest: directions of c⊥ that are left alone


@dataclass(frozen=True, eq=False)
class _Asked:
    """One cause to first order."""

    place: int
    family: Family
    arm: Arm  # by whose columns
    gains: Array  # (blocks,) held out
    taken: Array  # (rows,) t⊥ what its best shape takes off the weighted residual

    @property
    def there(self) -> bool:
        return by_flips(self.gains) <= _CHANCE


def not_borne_out(case: Case, now: Refined, screened: Sequence[Screened]) -> frozenset[int]:
    """Places of those that other time does not bear out, or not alone; what is not linear, or happens once, waits to be fitted."""
    blocked = Blocked.of(now, _BLOCKS)
    arms = case.arms(now.model)
    linear = [(k, one, arms.of(one.family)) for k, one in enumerate(screened) if _linear(one)]
    asked = [_Asked(k, one.family, arm, blocked.gains(one.family, arm), _taken(now, one)) for k, one, arm in linear]
    asked.sort(key=lambda one: -float(one.gains.sum()))
    there = [one for one in asked if one.there]
    refused: list[_Asked] = []  # for themselves
    out = {one.place for one in asked} - {one.place for one in there}
    for one in asked:
        if one.place in out:
            refused.append(one)
        elif any(_share(now, other, one) > _PART for other in refused):
            out.add(one.place)
        elif any(_instead(now, one, other) for other in there if other is not one):
            refused.append(one)
            out.add(one.place)
    return frozenset(out)


def borne_out(case: Case, screened: Screened, before: Refined, after: Refined) -> bool:
    """Whether other time bears out what `after` has more than `before`, its last effect; what is linear was asked before."""
    if _linear(screened):
        return True
    log = after.model.effects[-1].log
    if log is not None:
        own = before.data.log_of == log - before.data.first
        return float(np.sum(after.residual[own]**2)) < _HALF * float(np.sum(before.residual[own]**2))
    data = after.data if case.judge is None else case.judge
    weights = before.weight[data.joint]
    squares = [np.square(held_out_left(one, case.judge, case.blocks) * weights) for one in (before, after)]
    gains = np.asarray(np.bincount(data.blocks(_BLOCKS), squares[0] - squares[1]), dtype=np.float64)
    return by_flips(gains) <= _CHANCE


def _linear(one: Screened) -> bool:
    return not one.family.event and one.amplitude is None and one.family.shapes[0].fixed_amplitudes is None


def _taken(now: Refined, one: Screened) -> Array:
    c = now.fit.project(laid_whole(now.data, one.shape[0], now.model.arm))
    size = np.linalg.norm(c, axis=1)
    unit = c[size > 0.0] / size[size > 0.0, None]
    solved, *_ = np.linalg.lstsq(unit.T, now.fit.residual, rcond=_SPREAD)
    return np.asarray(solved @ unit)


def _instead(now: Refined, own: _Asked, other: _Asked) -> bool:
    """Whether another cause takes part of the same, and is not decidedly worse."""
    if by_flips(own.gains - other.gains) <= _CHANCE:
        return False
    return _PART < max(_share(now, other, own), _share(now, own, other)) <= _ALL


def _share(now: Refined, family: _Asked, of: _Asked) -> float:
    """Of what one cause takes, that the other one in its best shape takes as well."""
    seen = screen_family(now.data, now.fit, family.family, family.arm, of.taken[None])
    return float(seen.gain[0]) / max(float(of.taken @ of.taken), 1e-300)
