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
from pipelines.model.diagnosis.candidates import Family
from pipelines.model.diagnosis.case import Case, held_out
from pipelines.model.diagnosis.chance import BY_CHANCE, no_gain, no_name
from pipelines.model.diagnosis.findings import unlike
from pipelines.model.diagnosis.gains import Simulation, nearer, worse_log
from pipelines.model.diagnosis.held_out import held_out_left
from pipelines.model.diagnosis.inputs import Prepared
from pipelines.model.diagnosis.mistaken import imitated
from pipelines.model.diagnosis.momentary import ONLY_THEN, only_then
from pipelines.model.diagnosis.numbers import of_no_size
from pipelines.model.diagnosis.refit import Refined, refine
from pipelines.model.diagnosis.search import Found, Step
from pipelines.model.diagnosis.steadied import steadied
from pipelines.model.diagnosis.straying import simulated_steps, strays
from pipelines.model.diagnosis.unchanged import near_other_motion, no_change
from pipelines.model.diagnosis.verdict import (
    REST_UNKNOWN,
    Ruling,
    at_floor,
    explained,
    held_out_high,
    much_without_name,
    seen_in,
    too_little,
    without_steps,
)
from pipelines.model.diagnosis.which_joint import at_which
from pipelines.model.effects.base import Effect

__all__ = ["NEAR_THE_FLOOR", "Settled", "at_odds", "settled", "vague"]

_PAYS = 0.005  # of the held-out squared error, that a cause takes away at least beside all others
_MENDS = 0.1  # of the nominal residual's power, by which a twin of an earlier cause is one of its own
_ALIKE = 0.25  # of what a cause took away, that one for which it could be mistaken takes as well: weaker ones are no rivals
_REST = 0.5  # of what the later of two takes, the earlier takes as well in a looser form: then it is the rest of that
_LEAST = 0.002  # of the squared residual, where nothing else says what a cause has to take away
_DECIDED = 0.9  # of what one of two leaves, the other leaves at most where it is decidedly better
_TRACE = 0.01  # of the nominal residual's power, by which a law like one that stands at its joint is the rest of that
_REST_OF_GAP = 0.05  # the same, by which what is found at the joint of a gap is what no law of that has
_NEXT_TO_NOTHING = 0.02  # of what stands above the noise: all that was found is not what is wrong, where that has no name
_SHAPE = "it only mends the shape of what was found before it at the joint, or stood there"
_BESIDE = "most of what is wrong has no name, and beside that this one is not sure"
_NO_SIZE = "its size is within five standard deviations of none"
_IMPOSSIBLE = "beside the others its numbers, or theirs, are none that it can have"
NEAR_THE_FLOOR = "what can be named explains less than half of what stands above the floor, which is not much, but no noise"
_LAW_WITHOUT_NAME = "follows a law in the fitted logs, far above the noise, that held-out time does not bear out as any cause"
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
        alone = near_other_motion(replace(ruling, named=()), found, case, floor)
        return Settled(replace(found, final=found.nominal), _elsewhere(alone, found, case, floor, known), ())
    plain, (found, case) = found, steadied(found, case)
    simulated = simulated_steps(found, case, prepared)
    late = any(step.best is not None and step.best.effect.last for step in found.steps)
    elsewhere = {k: at_which(plain.steps[k], case.shared) for k in ruling.named}
    doubts = {k: ONLY_THEN if only_then(found.final, k) else elsewhere[k] or no_change(found, k, case, floor) or
              at_odds(found, k, prepared, case) or
              strays(found, plain, k, simulated, prepared, case, late, partial(_less, found, k, case)) for k in ruling.named}
    doubts = dict(ruling.doubts) | {k: why for k, why in doubts.items() if why}
    if case.floored:  # the search has asked it where there is no floor
        doubts |= {k: BY_CHANCE for k in ruling.named if k not in doubts and _not_told(found.steps[k], simulated, case, late)}
    believed = [k for k in ruling.named if k not in doubts]
    apart = _apart(found, believed, case)
    kept = _turned(found, apart, believed, case)
    doubts |= {k: _STOOD if k in apart else _SHAPE for k in believed if k not in kept}
    kept, final = _asked_again(found, kept, [k for k, why in doubts.items() if why == BY_CHANCE], case)
    doubts = {k: why for k, why in doubts.items() if k not in kept}
    while len(kept) > 1:
        idle = _idle(found, kept, case, final)
        if idle is None:
            break
        kept.remove(idle)
        doubts[idle] = "beside the others it takes nothing off the held-out error"
        final = _without(found, kept, case, final)
    if kept and (small := of_no_size(final)):
        doubts |= {kept[place]: _NO_SIZE for place in small}
        kept = [k for place, k in enumerate(kept) if place not in small]
        final = _without(found, kept, case, final)
    while kept and (why := _harm(found, final, case) or ("" if _possible(final) else _IMPOSSIBLE)):
        doubts[kept.pop()] = why
        final = _without(found, kept, case, final)
    if not known and kept and (unsure := _unseen(found, kept, final, case, floor)):
        doubts |= dict.fromkeys(unsure, REST_UNKNOWN)
        kept = [k for k in kept if k not in unsure]
        final = _without(found, kept, case, final)
    if not known and kept and explained(found.nominal.rms, final.rms, found.nominal.rms, floor) < _NEXT_TO_NOTHING:
        doubts |= dict.fromkeys(kept, _BESIDE)
        kept = []
    left = known and len(kept) < len(found.final.model.effects) and not at_floor(final.rms, floor)
    few = bool(kept) and left and too_little(found.nominal.rms, final.rms, floor)
    if few:  # what keeps all the rules is no noise: something is wrong, and not this alone
        doubts |= dict.fromkeys(kept, _BESIDE)
        kept = []
    if kept:
        return Settled(replace(found, final=final), replace(ruling, named=tuple(kept), doubts=doubts), simulated)
    alone = _elsewhere(near_other_motion(without_steps(plain, floor, known), plain, case, floor), plain, case, floor, known)
    reason = next((why for why in elsewhere.values() if why), f"{alone.reason}: {next(iter(doubts.values()), '')}")
    reason = reason if alone.verdict == "unknown" else alone.reason
    if not known and alone.verdict == "nothing-wrong" and (where := much_without_name(found, doubts, floor)):
        alone, reason = replace(alone, verdict="unknown"), f"{where} {_LAW_WITHOUT_NAME}"
    if few and alone.verdict == "nothing-wrong" and case.changed is None:  # of what has changed, other motion may leave a little
        alone, reason = replace(alone, verdict="unknown"), next((why for why in elsewhere.values() if why), NEAR_THE_FLOOR)
    return Settled(replace(plain, final=plain.nominal), replace(alone, reason=reason, doubts=doubts), ())


def _elsewhere(ruling: Ruling, found: Found, case: Case, floor: Array, known: bool) -> Ruling:
    """Nothing wrong in the fitted logs is not enough where the held-out ones show something.

    Not so of what has changed: motion that the reference logs do not have shows what no law of friction has to the last, and
    would have shown it before.
    """
    if ruling.verdict != "nothing-wrong" or not known or case.judge is None or case.changed is not None:
        return ruling
    high = held_out_high(case.judge.rms(held_out_left(found.nominal, case.judge, case.blocks)), floor)
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


def vague(found: Found, k: int, prepared: Prepared, case: Case) -> bool:
    """Whether step `k` gained no more than chance when it was found, nor does beside all the others."""
    step, others = found.steps[k], [j for j, one in enumerate(found.steps) if one.best is not None and j != k]
    if step.best is None or step.best.log is not None:
        return False
    done = step.best.done
    if not no_gain(step.before, done, len(done.model.effects) - 1, prepared.judge, case.blocks):
        return False
    return not others or no_gain(_without(found, others, case), found.final, k, case.judge, case.blocks)


def at_odds(found: Found, k: int, prepared: Prepared, case: Case) -> str:
    """Why step `k` does not do the same in every log, neither when it was found nor beside all the others; empty where it does.

    What was found after it stood in the residual then, and one log may have more of that than another.
    """
    step, last = found.steps[k], max(j for j, one in enumerate(found.steps) if one.best is not None)
    if step.best is None or step.best.log is not None:
        return ""
    why = unlike(step.before, step.best.done, k, prepared, case.blocks)
    if not why or k == last:
        return why
    return unlike(_less(found, k, case), found.final, k, prepared, case.blocks)


def _asked_again(found: Found, kept: list[int], doubted: list[int], case: Case) -> tuple[list[int], Refined]:
    """With those of `doubted` that gain more than chance does beside `kept`, and the model with all of them."""
    final, left = _without(found, kept, case), doubted if kept else []
    while left:
        others = []
        for k in left:
            more = sorted((*kept, k))
            there = _without(found, more, case, final) if _apart(found, more, case) == more else None
            if there is None or no_name(found.steps[k], final, there, more.index(k), case.judge, case.blocks, case.white):
                others.append(k)
            else:
                kept, final = more, there
        if len(others) == len(left):
            break
        left = others
    return kept, final


def _apart(found: Found, kept: list[int], case: Case) -> list[int]:
    """Without what only mends the shape of a cause found before at the same joint, for which it could be mistaken.

    No law of the library is that of the machine to the last: the rest of a great Stribeck hump is no drag.
    """
    out: list[int] = []
    for k in kept:
        step = found.steps[k]
        taken = 0.0 if step.best is None else _power(found, step.before.rms) - _power(found, step.best.done.rms)
        share = taken / max(_power(found, found.nominal.rms), 1e-300)
        own = found.final.model.effects[k].effect
        stood = bool(out) and share <= _TRACE and _stands(own, case)
        gap = share <= _REST_OF_GAP and any(_gap_at(found.final.model.effects[j].effect, own.joint) for j in out)
        if not (stood or gap) and (share > _MENDS or not any(_mistaken(found, j, k, case) for j in out)):
            out.append(k)
    return out


def _gap_at(effect: Effect, joint: int | None) -> bool:
    return effect.evidence == "reversals" and effect.joint == joint


def _stands(own: Effect, case: Case) -> bool:
    """Whether an effect that it is, or could be mistaken for, stands at its joint since before."""
    there = (one.effect for one in case.beside if one.effect.joint == own.joint)
    return own.friction and any(own.name == one.name or own.name in one.twins or one.name in own.twins for one in there)


def _turned(found: Found, kept: list[int], believed: list[int], case: Case) -> list[int]:
    """With a cause in place of the one before it at its joint, for which it could be mistaken, where that leaves decidedly less.

    What was found first may have stood for it as long as another cause was not known: an offset, for friction that differs by
    direction under a drag (floating search: Pudil, Novovičová & Kittler 1994).
    """
    for k in (k for k in believed if k not in kept):
        for j in (j for j in kept if j < k and _mistaken(found, j, k, case)):
            other = sorted({*kept, k} - {j})
            here, there = (_without(found, some, case) for some in (kept, other))
            if _possible(there) and there.rss < _DECIDED * here.rss and held_out(there, case) < _DECIDED * held_out(here, case):
                kept = other
                break
    return kept


def _mistaken(found: Found, earlier: int, later: int, case: Case) -> bool:
    """Whether the later of two causes would have passed for the earlier one, or is what the law of that leaves."""
    own, before = (found.final.model.effects[k].effect for k in (later, earlier))
    if before.joint != own.joint or not (own.name in before.twins or before.name in own.twins):
        return False
    if imitated(found.steps[earlier], _family(case, own), case) > _ALIKE:
        return True
    loose = before.looser()
    return loose != before and imitated(found.steps[later], Family(loose.name, loose.joint, (loose,)), case) > _REST


def _power(found: Found, rms: Array) -> float:
    """Of a residual, joints in units of what the final model leaves of them."""
    return float(np.sum(np.square(rms / np.maximum(found.final.rms, 1e-12))))


def _idle(found: Found, kept: list[int], case: Case, final: Refined) -> int | None:
    """The cause that is missed least, if it is missed so little that it would not have been found beside the others."""
    least, share = None, 1.0
    error = held_out(final, case)
    bounds = None if case.thresholds is None else case.thresholds.at(final.weight).gain
    for k in kept:
        one = found.final.model.effects[k]
        if one.log is not None:
            continue
        rest = _without(found, [other for other in kept if other != k], case, final)
        if not _possible(rest):  # what another would have to be without it, it cannot be
            continue
        missed = (rest.rss - final.rss) / max(_bound(case, one.effect, final, bounds), 1e-300)
        if held_out(rest, case) <= (1.0 + _PAYS) * error:
            missed = min(missed, 0.999)
        if missed < share:
            least, share = k, missed
    return least


def _possible(done: Refined) -> bool:
    """Whether the numbers of every cause lie in their ranges: fitted beside others, or without them, a hump may become a dip."""
    return all(one.possible for one in done.model.effects)


def _bound(case: Case, effect: Effect, final: Refined, bounds: Array | None) -> float:
    """Squared weighted residual that the cause has to take away; `bounds` (families,) where thresholds say so."""
    return _LEAST * final.rss if bounds is None else float(bounds[case.families.index(_family(case, effect))])


def _family(case: Case, effect: Effect) -> Family:
    return next(family for family in case.families if (family.cause, family.joint) == (effect.name, effect.joint))


def _less(found: Found, k: int, case: Case) -> Refined:
    """All that was accepted but step `k`."""
    return _without(found, [j for j, one in enumerate(found.steps) if one.best is not None and j != k], case)


def _without(found: Found, kept: list[int], case: Case, weighted: Refined | None = None) -> Refined:
    """The model with the effects of these steps, fitted anew where some are missing."""
    last = found.final if weighted is None else weighted
    effects = found.final.model.effects
    if len(kept) == len(last.model.effects):
        return last
    if kept and kept == list(range(len(kept))):  # it was fitted like this before
        return refine(found.steps[len(kept)].before.model, case.data, last.weight)
    model = replace(found.final.model, effects=tuple(effects[k] for k in kept))
    return refine(model, case.data, last.weight)
