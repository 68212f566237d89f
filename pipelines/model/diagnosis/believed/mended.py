"""Which causes only mend the shape of another at their joint, or of a gap: no law is that of the machine to the last.

    kept = not_mending(found, believed, case)           without what is the rest of a cause found before it
    kept = turned(found, kept, believed, case)          with one in place of the cause that was found before it
"""

from __future__ import annotations

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.believed.fewer import family_of, possible, without
from pipelines.model.diagnosis.believed.mistaken import imitated
from pipelines.model.diagnosis.screened.candidates import Family
from pipelines.model.diagnosis.searched.case import Case, held_out
from pipelines.model.diagnosis.searched.search import Found, Step
from pipelines.model.effects.base import Effect

__all__ = ["not_mending", "turned"]

_MENDS = 0.1  # of the nominal residual's power, by which a twin of an earlier cause is one of its own
_ALIKE = 0.25  # of what a cause took away, that one for which it could be mistaken takes as well: weaker ones are no rivals
_REST = 0.5  # of what the later of two takes, the earlier takes as well in a looser form: then it is the rest of that
_DECIDED = 0.9  # of what one of two leaves, the other leaves at most where it is decidedly better
_TRACE = 0.01  # of the nominal residual's power, by which a law like one that stands at its joint is the rest of that
_REST_OF_GAP = 0.05  # the same, by which what is found beside a gap is what no law of that has


def not_mending(found: Found, kept: list[int], case: Case) -> list[int]:
    """Without what only mends the shape of a cause found before at the same joint, for which it could be mistaken, or of a gap.

    No law of the library is that of the machine to the last: the rest of a great Stribeck hump is no drag.
    """
    out: list[int] = []
    for k in kept:
        step = found.steps[k]
        taken = 0.0 if step.best is None else _power(found, step.before.rms) - _power(found, step.best.done.rms)
        share = taken / max(_power(found, found.nominal.rms), 1e-300)
        own = found.final.model.effects[k].effect
        stood = bool(out) and share <= _TRACE and _stands(own, case)
        gap = share <= _REST_OF_GAP and any(_rest_of_gap(found.final.model.effects[j].effect, own, step) for j in out)
        if not (stood or gap) and (share > _MENDS or not any(_mistaken(found, j, k, case) for j in out)):
            out.append(k)
    return out


def _rest_of_gap(effect: Effect, own: Effect, step: Step) -> bool:
    """Whether what was found at step `step` may be what no law of an earlier gap has: it is at the joint of that, or the gap itself
    takes more of what was left, once more, for its blows are felt at other joints."""
    if effect.evidence != "reversals":
        return False
    gains = {(one.cause, one.joint): float(one.gain[0]) for one in step.screened}
    again, here = (gains.get((one.name, one.joint)) for one in (effect, own))
    return effect.joint == own.joint or (again is not None and here is not None and again > here)


def _stands(own: Effect, case: Case) -> bool:
    """Whether an effect that it is, or could be mistaken for, stands at its joint since before."""
    there = (one.effect for one in case.beside if one.effect.joint == own.joint)
    return own.friction and any(own.name == one.name or own.name in one.twins or one.name in own.twins for one in there)


def turned(found: Found, kept: list[int], believed: list[int], case: Case) -> list[int]:
    """With a cause in place of the one before it at its joint, for which it could be mistaken, where that leaves decidedly less.

    What was found first may have stood for it as long as another cause was not known: an offset, for friction that differs by
    direction under a drag (floating search: Pudil, Novovičová & Kittler 1994).
    """
    for k in (k for k in believed if k not in kept):
        for j in (j for j in kept if j < k and _mistaken(found, j, k, case)):
            other = sorted({*kept, k} - {j})
            here, there = (without(found, some, case) for some in (kept, other))
            if possible(there) and there.rss < _DECIDED * here.rss and held_out(there, case) < _DECIDED * held_out(here, case):
                kept = other
                break
    return kept


def _mistaken(found: Found, earlier: int, later: int, case: Case) -> bool:
    """Whether the later of two causes would have passed for the earlier one, or is what the law of that leaves. Of two that have no
    shape each is what it is: one that is not there takes nothing beside the other, and is dropped for that."""
    own, before = (found.final.model.effects[k].effect for k in (later, earlier))
    if before.joint != own.joint or not (own.name in before.twins or before.name in own.twins):
        return False
    if before.shapeless and own.shapeless:
        return False
    if imitated(found.steps[earlier], family_of(case, own), case) > _ALIKE:
        return True
    loose = before.looser()
    return loose != before and imitated(found.steps[later], Family(loose.name, loose.joint, (loose,)), case) > _REST


def _power(found: Found, rms: Array) -> float:
    """Of a residual, joints in units of what the final model leaves of them."""
    return float(np.sum(np.square(rms / np.maximum(found.final.rms, 1e-12))))
