"""The verdict: which of the causes found are named, and why not the others.

A cause is named where the model with all that was found comes down near to the floor; where the best of them explains less than
half of what stands above it, nothing is: the name would be wrong more often than right.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.screened.screen import Screened
from pipelines.model.diagnosis.searched.ledger import UNBELIEVABLE
from pipelines.model.diagnosis.searched.search import Found, Step
from pipelines.model.effects import find_effect
from pipelines.model.words import within

__all__ = ["REST_OF_A_LAW", "REST_UNKNOWN", "Ruling", "at_floor", "excess", "explained", "held_out_high", "mostly_lost",
           "much_without_name", "rule", "seen_in", "stands_high", "takes_most", "too_little", "unbelieved", "without_steps"]

_HALF = 0.5  # of the excess over the floor
_ABOVE = 1.6  # times the floor: what stands higher is not explained
_CLEAR = 1.2  # times the floor: what stands lower may be the floor, which ten replicas know to about a tenth
_FAR = 3.0  # times the floor, on held-out logs: other motion, so that some more is usual
_REST = 0.35  # of a joint's residual that may be left beside a named cause, where it still stands above the floor

_REST_OF_GAP = 0.6  # the same beside a gap: where the link is in it hangs on lubricant and tooth, which no law has to the last

# Without a floor: of the power that stood above the noise. The law of a cause found first is that of the machine to a few
# hundredths of its torque, and what it leaves looks like other causes.
_SHAPE = 1e-3
# What is left of a joint beside its friction is of no known cause, or not all of it, fitted or held out. Of 60 arms whose causes
# were named rightly without a floor the least took 0.4 of its joint held out; wrong ones took 0.09 and 0.199. Of a recorded arm,
# where much has no name, causes that pay in all take 0.2 to 0.3 of theirs.
_FIFTH = 0.2
# The same where what is left stands many times above the noise. Of right causes the most was 10 times, beside .95 taken; a friction
# that drifts took .57 of one that heat of another joint changes, and left 29 times.
_MOST_OF_IT, _TIMES = 0.8, 15.0
_TRIFLE = "it takes away less than what the law of a cause found before it may leave"
REST_UNKNOWN = "most of what stands above the noise where it is seen has no name, and beside that this one is not sure"
REST_OF_A_LAW = "most of what stands above the floor where it is seen has no name, and beside that this one is not sure"
_MISFIT = "beside a gap, where nobody knows how the link lay in it at first, nothing that happened once is told from it"
_LITTLE = "it explains less than half of what stands above the floor, which is so little that it may be the floor"
_NO_FLOOR = ("what is left is more than noise, as it is of every recorded arm; whether more than an arm in order leaves is not "
             "testable without a floor: reference logs, or logs whose controller is known and a twin")


@dataclass(frozen=True)
class Ruling:
    """What is said of the steps of a search."""

    verdict: Literal["cause", "nothing-wrong", "unknown"]
    named: tuple[int, ...]  # places of the steps whose cause is named
    reason: str  # why "unknown", or what "nothing-wrong" cannot vouch for
    doubts: Mapping[int, str] = field(default_factory=dict)  # of steps that were accepted and are not named


def excess(rms: Array, floor: Array) -> float:
    """Sum over the joints of how far the power of a residual stands above its floor, in floors."""
    return float(np.sum(np.maximum(np.square(rms / floor) - 1.0, 0.0)))


def explained(before: Array, after: Array, nominal: Array, floor: Array) -> float:
    """Share of the excess of the nominal residual that is taken away between two models; each (joints,) [N m] rms."""
    whole = excess(nominal, floor)
    return float(np.clip((excess(before, floor) - excess(after, floor)) / max(whole, 1e-12), 0.0, 1.0))


def too_little(nominal: Array, final: Array, floor: Array) -> bool:
    """Whether a model leaves more than half of what the nominal one leaves above the floor, of joints that surely stand above it;
    each (joints,) [N m] rms."""
    sure = nominal > _CLEAR * floor
    return bool(sure.any()) and explained(nominal[sure], final[sure], nominal[sure], floor[sure]) < _HALF


def rule(found: Found, floor: Array, known: bool = True, mended: bool = False) -> Ruling:
    """Which causes are named.

    Args:
        known: whether the floor is that of an arm in order, twin or reference; else it is only the noise, which the models of
            recorded arms never come down to, and what pays on held-out time is named.
        mended: whether something else than the floor tells that what was found explains what was wrong, however little it is.
    """
    return _ruled(found, floor, known, [step for step in found.steps if step.best is not None], mended=mended)


def without_steps(found: Found, floor: Array, known: bool, named: bool = False) -> Ruling:
    """The same where nothing that was found is believed; `named`: what is wrong has a name that the residual does not show."""
    return _ruled(replace(found, final=found.nominal), floor, known, [], known and not named)


def _ruled(found: Found, floor: Array, known: bool, accepted: list[Step], any_share: bool | None = None,
           mended: bool = False) -> Ruling:
    """`any_share`: whether something that gives way counts however little it explains; by default where the floor is known."""
    every = known if any_share is None else any_share
    other = next((step.other for step in found.steps if step.other is not None and (every or _much(step.other, found))), None)
    joints = np.flatnonzero(stands_high(found.final.rms, floor))
    high = _named(joints.tolist())
    gap = any(step.best is not None and step.best.effect.evidence == "reversals" for step in accepted)
    if other is not None and (not accepted or (len(joints) and not gap)):
        where = "the arm or its base" if other.joint is None else f"joint {other.joint} or what carries it"
        return Ruling("unknown", (), f"{where} gives way, of a kind that these logs do not tell: record frequency responses in two "
                      "postures")
    if not accepted:
        if len(joints) and known:
            return Ruling("unknown", (), f"the residual of {high} stands above the floor, and no cause explains it")
        if not known and (why := unbelieved(found, floor)):
            return Ruling("unknown", (), why)
        return Ruling("nothing-wrong", (), _NO_FLOOR if len(joints) else "")
    once = {k: _MISFIT for k, step in enumerate(accepted) if gap and _happened(step)}
    if not known:
        doubts = once | {k: REST_UNKNOWN for k, step in enumerate(accepted) if not seen_in(step, found.nominal.rms,
                                                                                           found.final.rms, floor)}
        doubts |= {k: _TRIFLE for k, step in enumerate(accepted)
                   if _most_taken(step, found, floor) < _SHAPE and not _one_more(step, accepted[:k])}
        named = tuple(k for k in range(len(accepted)) if k not in doubts)
        high = _named(np.flatnonzero(found.final.rms > _TIMES * floor).tolist())
        if not named and high and any(why == REST_UNKNOWN for why in doubts.values()):
            return Ruling("unknown", (), f"the best explanation leaves {high} far above the noise", doubts)
        return Ruling("cause", named, "", doubts)
    near = not stands_high(found.nominal.rms, floor).any()
    if too_little(found.nominal.rms, found.final.rms, floor) and not (near and mended):
        if near:  # without that explanation nothing would be wrong
            return Ruling("nothing-wrong", (), "", dict.fromkeys(range(len(accepted)), _LITTLE))
        return Ruling("unknown", (), "the best explanation leaves more than half of what stands above the floor")
    left = [j for j in joints.tolist() if found.final.rms[j] > (_REST_OF_GAP if gap else _REST) * found.nominal.rms[j]]
    if left:
        return Ruling("unknown", (), f"what was found leaves the residual of {_named(left)} well above the floor")
    doubts = once | {k: REST_OF_A_LAW for k in range(len(accepted)) if _in_the_rest(accepted[:k + 1], found.final.rms, floor)}
    return Ruling("cause", tuple(k for k in range(len(accepted)) if k not in doubts), "", doubts)


def _in_the_rest(steps: Sequence[Step], final: Array, floor: Array) -> bool:
    """Whether the last of `steps`, at a joint where one before it was found, took next to nothing beside what stands there above
    the floor with all that was found: the law of the first is not the machine's, and what that leaves looks like other causes."""
    *before, step = steps
    most = takes_most(step, floor)
    if step.best is None or final[most] <= _ABOVE * floor[most] or all(takes_most(one, floor) != most for one in before):
        return False
    taken = float(step.before.rms[most] ** 2 - step.best.done.rms[most] ** 2)
    return taken < _FIFTH * (taken + float(final[most] ** 2 - floor[most] ** 2))


def seen_in(step: Step, nominal: Array, final: Array, floor: Array) -> bool:
    """Whether all that was found takes enough of the power above the noise off the joint where a step takes most: a weak drive is
    seen at the joint before it. A joint that stands in the noise has none.

    Args:
        nominal: (joints,) [N m] what the nominal model leaves; `final`: with all that was found.
    """
    before, after = np.square(nominal), np.square(final)
    above = before - np.square(floor)
    share = np.divide(before - after, above, out=np.zeros(len(above)), where=above > 0.0)
    most = takes_most(step, floor)
    return bool(share[most] >= (_MOST_OF_IT if final[most] > _TIMES * floor[most] else _FIFTH))


def takes_most(step: Step, floor: Array) -> int:
    """The joint (from 0) at which what a step found takes most power, in floors."""
    done = step.before if step.best is None else step.best.done
    taken = np.square(step.before.rms) - np.square(done.rms)
    return int(np.argmax(taken / np.maximum(np.square(floor), 1e-300)))


def much_without_name(found: Found, doubts: Mapping[int, str], floor: Array) -> str:
    """The joints that stand far above the noise, and of whose power a cause took most before held-out time did not bear it out."""
    joints = set()
    for k, step in enumerate(found.steps):
        if step.best is None or k not in doubts:
            continue
        before, after = np.square(step.before.rms), np.square(step.best.done.rms)
        joints |= set(np.flatnonzero((before - after > _HALF * before) & (step.before.rms > _TIMES * floor)).tolist())
    return _named(sorted(joints))


def unbelieved(found: Found, floor: Array) -> str:
    """Which cause would take most of what stands far above the noise, where the arm could not have moved so with it; in words, and
    empty where there is none. Something is wrong then: a drive, say, that is clipped so often that its limit shows in no log."""
    high = found.final.rms > _TIMES * floor
    refused = [one for step in found.steps for one in step.trials if one.reason == UNBELIEVABLE and one.exact_gain > _HALF
               and (high.any() if one.joint is None else high[one.joint - 1])]
    return "; ".join(f"{within(find_effect(one.cause).title)}{'' if one.joint is None else f' at joint {one.joint}'} would explain "
                     f"{100.0 * one.exact_gain:.0f} % of what is left, and yet {UNBELIEVABLE}" for one in refused[:1])


def _one_more(step: Step, before: Sequence[Step]) -> bool:
    """Whether the same cause was found at the joint already: a further wave, of another order, mends no wave's shape."""
    own = None if step.best is None else step.best.effect
    return any(one.best is not None and own is not None and (one.best.effect.name, one.best.effect.joint) == (own.name, own.joint)
               for one in before)


def _most_taken(step: Step, found: Found, floor: Array) -> float:
    """Largest share that a step takes of what the nominal model leaves of any joint above the noise: of its power. Of a joint that
    stands in the noise there is no more to take than noise."""
    noise = np.square(floor)
    whole = np.maximum(np.maximum(np.square(found.nominal.rms) - noise, noise), 1e-300)
    after = step.before if step.best is None else step.best.done
    return float(np.max((np.square(step.before.rms) - np.square(after.rms)) / whole))


def _happened(step: Step) -> bool:
    """Whether what it found is an event."""
    return step.best is not None and step.best.screened.family.event


def at_floor(rms: Array, floor: Array) -> bool:
    """Whether every joint stands so low that it may be the floor."""
    return bool((rms <= _CLEAR * floor).all())


def stands_high(rms: Array, floor: Array) -> NDArray[np.bool_]:
    """(joints,) Whether each stands so high that it is not explained."""
    return rms > _ABOVE * floor


def held_out_high(rms: Array, floor: Array, times: float = _FAR) -> str:
    """Which joints stand far above the floor on held-out logs; empty where none does."""
    return _named(np.flatnonzero(rms > times * floor).tolist())


def mostly_lost(rms: Array, torque: Array, noise: Array) -> str:
    """How much a model leaves of the torque of which joints, where that is more than half and no noise; empty where of none.

    Args:
        rms, torque, noise: (joints,) [N m] what it leaves, what there is, and the noise in what it leaves.
    """
    joints = np.flatnonzero((rms > _HALF * torque) & (rms > _TIMES * noise)).tolist()
    return ", ".join(f"{100.0 * rms[j] / max(torque[j], 1e-300):.0f} % of the torque of joint {j + 1}" for j in joints)


def _named(joints: Iterable[int]) -> str:
    return ", ".join(f"joint {j + 1}" for j in joints)


def _much(other: Screened, found: Found) -> bool:
    """Whether what gives way would explain half of what its joint leaves, or all joints."""
    residual, joint = found.nominal.residual, other.joint
    own = residual if joint is None else residual[found.nominal.data.joint == joint - 1]
    return float(other.gain[0]) > _HALF * float(own @ own)
