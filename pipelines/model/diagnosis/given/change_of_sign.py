"""By which curve dry friction changes its sign: nobody knows it of a real joint, and no cause is to be found in that.

    of_one_law(causes)          one law of friction is among the greatest causes of several joints
    wrong_law(found, most)      or has a name at several, which is no fault but how this make of arm rubs; or it bends where dry
                                friction changes its sign
    loosened(prepared)          the same rows, for laws that fit the curve as well
    shows(prepared, other)      whether these leave less
    clearly_less(one, other)    whether one model does, and nowhere clearly more
    plainer_of(found, again)    which of the two diagnoses holds

It is asked after a look by the laws as they are, and not from the start: a torque that is late, or another joint's, bends the
curve as well, and what that takes in is missed as a hump at low speed once the cause has been found.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.asked.inputs import Prepared
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.result import Diagnosis, Finding
from pipelines.model.diagnosis.searched.parsimony import different
from pipelines.model.effects import find_effect

__all__ = ["SEVERAL", "clearly_less", "loosened", "of_one_law", "plainer_of", "shows", "wrong_law"]

SEVERAL = 2  # joints
_LESS = 0.95
_WIDTHS = 10.0  # by then tanh and the root have come to their level, within half a per cent


def wrong_law(found: Diagnosis, most: int) -> bool:
    """Whether a diagnosis may have taken the curve for a cause, or miss one for it.

    Of what is wrong: where the same law of friction was found at two joints or more, or one that bends where dry friction changes
    its sign; or is left at two above its threshold by a search that took as many causes as it may, `most`. What has no name in the
    end may be what the law that was found leaves of the curve; or what the curve leaves of other motion, where nothing was found.
    Of what has changed: only where it has no name, or a law bends there, for a curve was the same before; but other motion
    shows more of it.
    """
    laws = [one for one in found.findings if find_effect(one.cause).friction]
    turning = any(_turning(one, found) for one in laws)
    if found.question == "what has changed":
        return turning or found.verdict == "unknown"
    accepted = [one for one in found.ledger if one.accepted]
    tried = found.verdict == "unknown" and (not accepted or any(find_effect(one.cause).friction for one in accepted))
    last = max((one.step for one in found.ledger), default=0)
    ended = different((one.cause, one.joint) for one in accepted) >= most
    left = [(one.cause, one.joint) for one in found.ledger if ended and one.step == last and one.gain > one.threshold]
    return turning or tried or of_one_law([(one.cause, one.joint) for one in laws]) or of_one_law(left)


def of_one_law(causes: Iterable[tuple[str, int | None]]) -> bool:
    """Whether the same law of friction is among these causes and their joints at several joints."""
    places = Counter(name for name, _ in set(causes))
    return any(count >= SEVERAL and find_effect(name).friction for name, count in places.items())


def shows(prepared: Prepared, other: Prepared) -> bool:
    """Whether the `loosened` laws, `other`, leave clearly less of some joint, fitted or held out."""
    return any(bool((less < _LESS * most).any()) for less, most in zip(_left(other), _left(prepared), strict=True))


def _left(prepared: Prepared) -> list[Array]:
    """(joints,) [N m] what the nominal model leaves of the fitted logs, and of those held out where there are any."""
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    judge = prepared.judge
    return [fit.rms, *([] if judge is None else [judge.rms(judge.y - Exact.start(columns, fit).torque(judge))])]


def plainer_of(found: Diagnosis, again: Diagnosis) -> Diagnosis:
    """The one that finds less, and of as much the one whose curve is fitted, `again`, even where that is without a name: what
    was `found` are names that the curve may have given. Where `found` has no name, an answer; where it is what has changed, a
    name, for the curve was the same before. Of the same names, `found` where it leaves clearly less held out: a curve may have been
    fitted to what the law of a cause has."""
    if found.verdict == "unknown":
        return found if again.verdict == "unknown" else again
    if again.verdict == "unknown" and found.question == "what has changed":
        return found
    if _names(found) == _names(again) and clearly_less(found.after_rms.validate, again.after_rms.validate):
        return found
    return min(again, found, key=lambda one: len(one.findings))


def _names(found: Diagnosis) -> set[tuple[str, int | None]]:
    return {(one.cause, one.joint) for one in found.findings}


def clearly_less(one: Array, other: Array) -> bool:
    """Whether one leaves clearly less of some joint, and the other of none; each (joints,) [N m] rms."""
    return bool((one < _LESS * other).any() and not (other < _LESS * one).any())


def _turning(law: Finding, found: Diagnosis) -> bool:
    """Whether the speed at which `law` bends is that over which its joint's dry friction changes its sign."""
    sharpness = [one.values["sharpness"] for one in (found.nominal.friction if found.nominal is not None else ())
                 if one.effect.joint == law.joint and "sharpness" in one.values]
    speed = law.parameters.get("speed")
    return speed is not None and any(w * float(np.max(speed.value)) < _WIDTHS for w in sharpness)


def loosened(prepared: Prepared) -> Prepared:
    """The same, the laws that a nominal model has by default in their forms with most numbers: by which curve friction changes its
    sign is fitted too. Where slow samples are left out it is not among the equations, and the laws stay as they are; so they do
    where they fit it already, or cannot."""
    if any(speed > 0.0 for speed in prepared.recipe.min_speed):
        return prepared
    laws = tuple(next(iter(law.forms()), law) if law.evidence == "none" else law for law in prepared.columns.laws)
    if all(law.free == own.free for law, own in zip(laws, prepared.columns.laws, strict=True)):
        return prepared
    return replace(prepared, columns=replace(prepared.columns, laws=laws))
