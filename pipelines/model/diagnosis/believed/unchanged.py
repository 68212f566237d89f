"""What was found beside reference logs and is no change since then.

    asked = Before(case)                   how much of what a search finds the reference logs have
    asked.shown(now, passed)               whether something stood before of what is seen beside what is greater: asked.early
    asked.ended(done)                      whether what was found last stood before: it is searched again beside that
    asked.stood(done)                      what did, and may be taken out with the rest that stands
    no_change(found, k, case, floor)       why step `k` is not believed to have changed
    near_other_motion(ruling, ...)         nothing gives way where no more is left than of such a motion
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pipelines.log.experiment import Array
from pipelines.log.shared_work import shared_out
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.named.verdict import Ruling, at_floor, takes_most
from pipelines.model.diagnosis.reference.stood import Share
from pipelines.model.diagnosis.screened.screen import Screened
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.hypotheses import as_seen
from pipelines.model.diagnosis.searched.search import Found
from pipelines.model.effects.base import Effect

__all__ = ["Before", "near_other_motion", "no_change"]

_AS_MUCH = "its joint moves at other speeds than in the reference logs, and no more is left of it than they leave at such speeds"
_UNCHANGED = "the reference logs may have had it: fitted to them alone, some of it is there as well"


class Before:
    """What the reference logs have of what one search finds; each effect of each model is asked for once."""

    def __init__(self, case: Case, again: bool = True) -> None:
        """`again`: whether there is another search, beside what stood before."""
        self._case, self._again = case, again and case.before is not None
        self.early: list[Effect] = []
        self._known: dict[tuple[int, int], tuple[Refined, Share]] = {}  # by model, which keeps its id, and place

    def shown(self, now: Refined, passed: Sequence[Screened]) -> bool:
        """Whether something stood before, at another joint than the greatest of the causes that `passed`: before these are fitted,
        which would be in vain. What a change makes of itself at other joints the reference logs have not."""
        own = [one for one in passed if one.joint is not None and not one.family.event and one.amplitude is None]
        if not own or not self._again:
            return False
        first = max(passed, key=lambda one: one.gain[0]).joint
        for joint in sorted({one.joint for one in own if one.joint is not None} - {first}):
            best = max((one for one in own if one.joint == joint), key=lambda one: one.gain[0])
            for exactly in (False, True):  # to first order most of what is none is told
                done = as_seen(self._case, now, best, exactly)
                last = len(done.model.effects) - 1
                if last not in self._able(done) or not self._share(done, last).stood:
                    break
            else:
                self.early.append(done.model.effects[last].effect)
        return bool(self.early)

    def ended(self, done: Refined) -> bool:
        """Whether the effect that was found last stood before."""
        last = len(done.model.effects) - 1
        return last in self._able(done) and self._share(done, last).stood

    def stood(self, done: Refined) -> list[Effect]:
        """Effects that stood before, and may be taken out with the rest that stands."""
        if self.early:
            return self.early
        able = self._able(done)
        found = shared_out(lambda place: self._share(done, place), able)
        self._known |= {(id(done), place): (done, share) for place, share in zip(able, found, strict=True)}
        return [done.model.effects[place].effect for place, share in zip(able, found, strict=True) if share.stood]

    def told(self, done: Refined) -> Case:
        """The case with the answers for this model as those for any that has the same effects in its places: as steady rows have
        them, say."""
        ask = self._case.before
        if ask is None:
            return self._case
        places = _places(done)
        return replace(self._case, before=lambda other, place: self._share(done, place) if _places(other) == places else
                       ask(other, place))

    def _share(self, done: Refined, place: int) -> Share:
        if (id(done), place) not in self._known and self._case.before is not None:
            self._known[id(done), place] = done, self._case.before(done, place)
        return self._known[id(done), place][1]

    def _able(self, done: Refined) -> list[int]:
        """Places of effects which the standing set may have."""
        every = enumerate(done.model.effects if self._again else ())
        return [k for k, one in every if one.log is None and one.possible and not one.effect.needs]


def _places(done: Refined) -> list[tuple[str, int | None]]:
    return [(one.effect.name, one.effect.joint) for one in done.model.effects]


def no_change(found: Found, k: int, case: Case, floor: Array) -> str:
    """Why step `k` may be no change; empty where it is one."""
    best = found.steps[k].best
    if case.before is None or best is None or best.log is not None:
        return ""
    own = takes_most(found.steps[k], floor) if best.effect.joint is None else best.effect.joint - 1
    if own in case.unlike and found.steps[k].before.rms[own] <= floor[own]:
        return _AS_MUCH
    if best.effect.needs:  # with columns of what stands a scale of torque is told apart from itself
        return ""
    return _UNCHANGED if case.before(found.final, k).doubtful else ""


def near_other_motion(ruling: Ruling, found: Found, case: Case, floor: Array) -> Ruling:
    """Nothing wrong, instead of something that gives way, where joints move at other speeds than in the reference logs, and no more
    is left than these leave at such speeds: chance is known of their own motion."""
    if ruling.verdict != "unknown" or not case.unlike or not at_floor(found.nominal.rms, floor):
        return ruling
    return replace(ruling, verdict="nothing-wrong", reason="")
