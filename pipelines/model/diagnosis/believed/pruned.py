"""After the search: what does not repeat on held-out time, or no longer pays beside what was found later, is dropped again.

What gained no more than chance when it was found is asked again beside all that is believed: what was found after it was noise
to it then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.asked.inputs import Prepared
from pipelines.model.diagnosis.believed.chance import BY_CHANCE, no_name
from pipelines.model.diagnosis.believed.fewer import all_but, family_of, possible, without
from pipelines.model.diagnosis.believed.mended import not_mending, turned
from pipelines.model.diagnosis.believed.momentary import AT_OTHER_TIMES, ONLY_THEN, at_other_times, only_then
from pipelines.model.diagnosis.believed.repeated import at_odds
from pipelines.model.diagnosis.believed.steadied import steadied
from pipelines.model.diagnosis.believed.straying import simulated_steps, strays
from pipelines.model.diagnosis.believed.which_joint import at_which
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.named.verdict import (
    REST_UNKNOWN,
    Ruling,
    at_floor,
    explained,
    held_out_high,
    mostly_lost,
    much_without_name,
    seen_in,
    too_little,
    without_steps,
)
from pipelines.model.diagnosis.searched.case import Case, held_out
from pipelines.model.diagnosis.searched.search import Found, Step
from pipelines.model.diagnosis.worth.gains import Simulation, nearer, worse_log
from pipelines.model.diagnosis.worth.held_out import held_out_left
from pipelines.model.diagnosis.worth.numbers import of_no_size, too_slight
from pipelines.model.effects.base import Effect

__all__ = ["NEAR_THE_FLOOR", "TOO_SLIGHT", "Settled", "settled"]

_PAYS = 0.005  # of the held-out squared error, that a cause takes away at least beside all others
_LEAST = 0.002  # of the squared residual, where nothing else says what a cause has to take away
_NEXT_TO_NOTHING = 0.02  # of what stands above the noise: all that was found is not what is wrong, where that has no name
_SHAPE = "it only mends the shape of what was found before it at the joint, or stood there"
_BESIDE = "most of what is wrong has no name, and beside that this one is not sure"
_IDLE = "beside the others it takes nothing off the held-out error"
_NO_SIZE = "its size is within five standard deviations of none"
_IMPOSSIBLE = "beside the others its numbers, or theirs, are none that it can have"
NEAR_THE_FLOOR = "what can be named explains less than half of what stands above the floor, which is not much, but no noise"
_LAW_WITHOUT_NAME = "follows a law in the fitted logs, far above the noise, that held-out time does not bear out as any cause"
TOO_SLIGHT = ("what explains it best is so slight that arms in order have as much of it: something shows, and it may well be "
              "another cause")
_NO_MODEL = ("it says next to nothing of how this arm moves, so look at the units, the order and the timing of what was recorded, "
             "and whether the logs that are fitted move every joint")
_SO_LITTLE = "it would be so little that arms in order have as much"
_STOOD = "what was found after it at the joint leaves less without it"


@dataclass(frozen=True, eq=False)
class Settled:
    """What is believed of a search."""

    found: Found  # its final model has exactly the causes that are named, in the order of their steps
    ruling: Ruling
    simulated: tuple[Simulation, ...]  # the nominal arm, then the arm after each accepted step; empty where nothing was accepted


def settled(found: Found, ruling: Ruling, case: Case, prepared: Prepared, floor: Array, known: bool = True) -> Settled:
    """Only causes that keep every rule of acceptance; `floor` and `known` as in `rule`."""
    if ruling.verdict != "cause":
        alone = replace(ruling, named=())
        return Settled(replace(found, final=found.nominal), _elsewhere(alone, found, case, floor, known), ())
    plain, (found, case) = found, steadied(found, case)
    simulated = simulated_steps(found, case, prepared)
    there = {k: at_which(plain.steps[k]) for k in ruling.named}
    asked = [k for k in ruling.named if not there[k]]
    doubts = dict(ruling.doubts) | there | _refused(found, plain, asked, simulated, case, prepared, floor)
    last = _believed(found, ruling.named, {k: why for k, why in doubts.items() if why}, case)
    last.drop_idle()
    last.drop_small()
    slight = known and last.drop_slight()
    last.drop_harmful()
    if not known:
        last.drop_unseen(floor)
    elif any(one.log is not None for one in found.final.model.effects):
        last.drop_momentary(floor)
    few = NEAR_THE_FLOOR if known and last.explains_little(floor) else ""
    if few:  # what keeps all the rules is no noise: something is wrong, and not this alone
        last.drop(last.kept, _BESIDE)
    if slight and not last.kept:
        few = few or TOO_SLIGHT
    if last.kept:
        return Settled(replace(found, final=last.final), replace(ruling, named=tuple(last.kept), doubts=last.doubts), simulated)
    return _nothing(found, plain, next((why for why in there.values() if why), ""), last.doubts, case, floor, known, few)


def _refused(found: Found, plain: Found, asked: Sequence[int], simulated: Sequence[Simulation], case: Case, prepared: Prepared,
             floor: Array) -> dict[int, str]:
    """Why steps are not believed, each by itself: empty words for those that are."""
    late = any(step.best is not None and step.best.effect.last for step in found.steps)
    doubts = {k: ONLY_THEN if only_then(found.final, k) else at_odds(found, k, prepared, case) or
              strays(found, plain, k, simulated, prepared, case, late, partial(all_but, found, k, case)) for k in asked}
    if case.floored:  # the search has asked it where there is no floor
        doubts |= {k: BY_CHANCE for k in asked if not doubts[k] and _not_told(found.steps[k], simulated, case, late)}
    return doubts


def _believed(found: Found, named: Sequence[int], doubts: dict[int, str], case: Case) -> _Last:
    """Those of the steps `named` that nothing speaks against, and that are no mended shape of others."""
    believed = [k for k in named if k not in doubts]
    apart = not_mending(found, believed, case)
    kept = turned(found, apart, believed, case)
    doubts |= {k: _STOOD if k in apart else _SHAPE for k in believed if k not in kept}
    kept, final = _asked_again(found, kept, [k for k, why in doubts.items() if why == BY_CHANCE], case)
    return _Last(found, case, kept, final, {k: why for k, why in doubts.items() if k not in kept})


class _Last:
    """The steps that are kept, the model with all of them as long as there are some, and why others are not kept."""

    def __init__(self, found: Found, case: Case, kept: list[int], final: Refined, doubts: dict[int, str]) -> None:
        self._found, self._case = found, case
        self.kept, self.final, self.doubts = kept, final, doubts

    def drop(self, some: Sequence[int], why: str) -> None:
        if some:
            self.doubts |= dict.fromkeys(some, why)
            self.kept = [k for k in self.kept if k not in some]
            if self.kept:
                self.final = without(self._found, self.kept, self._case, self.final)

    def drop_idle(self) -> None:
        while len(self.kept) > 1 and (idle := _idle(self._found, self.kept, self._case, self.final)) is not None:
            self.drop([idle], _IDLE)

    def drop_small(self) -> None:
        self.drop([self.kept[place] for place in of_no_size(self.final)] if self.kept else [], _NO_SIZE)

    def drop_slight(self) -> bool:
        """Those of which machines in order have as much; whether there were any."""
        before = len(self.kept)
        self.drop([self.kept[place] for place in too_slight(self.final)] if self.kept else [], _SO_LITTLE)
        return len(self.kept) < before

    def drop_harmful(self) -> None:
        """The last of them, as long as all together do harm, or have numbers that cannot be."""
        while self.kept and (why := _harm(self._found, self.final, self._case) or ("" if possible(self.final) else _IMPOSSIBLE)):
            self.drop(self.kept[-1:], why)

    def drop_unseen(self, floor: Array) -> None:
        """Those beside which most has no name, where nobody knows the floor."""
        if self.kept:
            self.drop(_unseen(self._found, self.kept, self.final, self._case, floor), REST_UNKNOWN)
        before = self._found.nominal.rms
        if self.kept and explained(before, self.final.rms, before, floor) < _NEXT_TO_NOTHING:
            self.drop(self.kept, _BESIDE)

    def drop_momentary(self, floor: Array) -> None:
        """What happened once, where nothing else is left, and other times show as much of something."""
        if self.kept and at_other_times(self.final, floor):
            self.drop(self.kept, AT_OTHER_TIMES)

    def explains_little(self, floor: Array) -> bool:
        """Whether less was kept than found, and most of what stands above the floor is left."""
        less = 0 < len(self.kept) < len(self._found.final.model.effects) and not at_floor(self.final.rms, floor)
        return less and too_little(self._found.nominal.rms, self.final.rms, floor)


def _nothing(found: Found, plain: Found, elsewhere: str, doubts: dict[int, str], case: Case, floor: Array, known: bool,
             few: str) -> Settled:
    """What is said where no cause is kept.

    Args:
        elsewhere: why one of them may as well act at another joint; empty where none does.
        few: why what keeps all the rules is no noise, and yet is not named; empty where nothing does.
    """
    alone = _elsewhere(without_steps(plain, floor, known), plain, case, floor, known)
    reason = alone.reason
    if alone.verdict == "unknown":
        said = "" if alone.reason.endswith(_NO_MODEL) else next(iter(doubts.values()), "")
        reason = elsewhere or (TOO_SLIGHT if few == TOO_SLIGHT else f"{alone.reason}: {said}" if said else alone.reason)
    if not known and alone.verdict == "nothing-wrong" and (where := much_without_name(found, doubts, floor)):
        alone, reason = replace(alone, verdict="unknown"), f"{where} {_LAW_WITHOUT_NAME}"
    if few and alone.verdict == "nothing-wrong":
        alone, reason = replace(alone, verdict="unknown"), elsewhere or few
    return Settled(replace(plain, final=plain.nominal), replace(alone, reason=reason, doubts=doubts), ())


def _elsewhere(ruling: Ruling, found: Found, case: Case, floor: Array, known: bool) -> Ruling:
    """Nothing wrong in the fitted logs is not enough where the held-out ones show something; or, where nobody knows the floor,
    where the model leaves most of the torque there.
    """
    if ruling.verdict != "nothing-wrong" or (known and case.judge is None):
        return ruling
    rows = case.data if case.judge is None else case.judge
    left = rows.rms(held_out_left(found.nominal, case.judge, case.blocks))
    if not known:
        lost = mostly_lost(left, rows.rms(rows.y), floor)
        return Ruling("unknown", (), f"held out, the model leaves {lost}: {_NO_MODEL}") if lost else ruling
    high = held_out_high(left, floor)
    return Ruling("unknown", (), f"on held-out logs the residual of {high} stands far above the floor") if high else ruling


def _harm(found: Found, final: Refined, case: Case) -> str:
    """Why the model with everything is worse than the nominal one on some held-out log."""
    left = [held_out_left(one, case.judge, case.blocks) for one in (found.nominal, final)]
    return worse_log(case.data if case.judge is None else case.judge, *left)


def _unseen(found: Found, kept: list[int], final: Refined, case: Case, floor: Array) -> list[int]:
    """Those beside which most of what stands above the noise in held-out time has no name."""
    rows = case.data if case.judge is None else case.judge
    nominal, last = (rows.rms(held_out_left(one, case.judge, case.blocks)) for one in (found.nominal, final))
    return [k for k in kept if not seen_in(found.steps[k], nominal, last, floor)]


def _not_told(step: Step, simulated: Sequence[Simulation], case: Case, late: bool) -> bool:
    best = step.best
    if best is None or best.log is not None:
        return False
    lone, place = len(simulated) == 2 and nearer(*simulated, late=late), len(best.done.model.effects) - 1
    return no_name(step, step.before, best.done, place, case.judge, case.blocks, case.white, lone)


def _asked_again(found: Found, kept: list[int], doubted: list[int], case: Case) -> tuple[list[int], Refined]:
    """With those of `doubted` that gain more than chance does beside `kept`, and the model with all of them."""
    final, left = without(found, kept, case), doubted if kept else []
    while left:
        others = []
        for k in left:
            more = sorted((*kept, k))
            there = without(found, more, case, final) if not_mending(found, more, case) == more else None
            if there is None or no_name(found.steps[k], final, there, more.index(k), case.judge, case.blocks, case.white):
                others.append(k)
            else:
                kept, final = more, there
        if len(others) == len(left):
            break
        left = others
    return kept, final


def _idle(found: Found, kept: list[int], case: Case, final: Refined) -> int | None:
    """The cause that is missed least, if it is missed so little that it would not have been found beside the others."""
    least, share = None, 1.0
    error = held_out(final, case)
    bounds = None if case.thresholds is None else case.thresholds.at(final.weight).gain
    for k in kept:
        one = found.final.model.effects[k]
        # With reference logs thresholds go with what was found before: all of it, at the last step.
        own = found.steps[-1].thresholds.at(final.weight).gain if bounds is None and one.log is not None else bounds
        rest = without(found, [other for other in kept if other != k], case, final)
        if not possible(rest):  # what another would have to be without it, it cannot be
            continue
        missed = (rest.rss - final.rss) / max(_bound(case, one.effect, final, own), 1e-300)
        if one.log is None and held_out(rest, case) <= (1.0 + _PAYS) * error:  # what happened once, no other time asks for
            missed = min(missed, 0.999)
        if missed < share:
            least, share = k, missed
    return least


def _bound(case: Case, effect: Effect, final: Refined, bounds: Array | None) -> float:
    """Squared weighted residual that the cause has to take away; `bounds` (families,) where thresholds say so, infinite where it
    was not asked."""
    bound = np.inf if bounds is None else float(bounds[case.families.index(family_of(case, effect))])
    return bound if np.isfinite(bound) else _LEAST * final.rss
