"""What was found beside reference logs and is no change since then.

    stood_before(found, case)              effects that stood before, and may be taken out with the rest that stands
    no_change(found, k, case, floor)       why step `k` is not believed to have changed
    near_other_motion(ruling, ...)         nothing gives way where no more is left than of such a motion
"""

from __future__ import annotations

from dataclasses import replace

from pipelines.log.experiment import Array
from pipelines.log.shared_work import shared_out
from pipelines.model.diagnosis.named.verdict import Ruling, at_floor, takes_most
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.search import Found
from pipelines.model.effects.base import Effect

__all__ = ["near_other_motion", "no_change", "stood_before"]

_AS_MUCH = "its joint moves at other speeds than in the reference logs, and no more is left of it than they leave at such speeds"
_UNCHANGED = "the reference logs may have had it: fitted to them alone, some of it is there as well"


def stood_before(found: Found, case: Case) -> list[Effect]:
    """What was found of which the reference logs have as much, and which the standing set may have."""
    every = () if case.before is None else tuple(enumerate(found.final.model.effects))
    able = [(k, one.effect) for k, one in every if one.log is None and one.possible and not one.effect.needs]
    stood = shared_out(lambda one: case.before is not None and case.before(found.final, one[0]).stood, able)
    return [effect for (_, effect), before in zip(able, stood, strict=True) if before]


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
