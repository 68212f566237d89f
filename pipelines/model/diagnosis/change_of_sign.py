"""By which curve dry friction changes its sign: nobody knows it of a real joint, and no cause is to be found in that.

    wrong_law(found)        one law of friction has a name at several joints: that is no fault, but how this make of arm rubs
    loosened(prepared)      the same rows, for laws that fit the curve as well

It is asked after a diagnosis by the laws as they are, and not from the start: a torque that is late, or another joint's, bends the
curve as well, and what that takes in is missed as a hump at low speed once the cause has been found.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

from pipelines.model.diagnosis.inputs import Prepared
from pipelines.model.diagnosis.result import Diagnosis
from pipelines.model.effects import find_effect

__all__ = ["loosened", "wrong_law"]


def wrong_law(found: Diagnosis) -> bool:
    """Whether the same law of friction was found at two joints or more; not of what has changed, for that it was before as well."""
    if found.question == "what has changed":
        return False
    places = Counter(one.cause for one in found.findings if find_effect(one.cause).friction)
    return any(count > 1 for count in places.values())


def loosened(prepared: Prepared) -> Prepared:
    """The same, the laws that a nominal model has by default in their forms with most numbers: by which curve friction changes its
    sign is fitted too. Where slow samples are left out it is not among the equations, and the laws stay as they are."""
    if any(speed > 0.0 for speed in prepared.recipe.min_speed):
        return prepared
    laws = tuple(next(iter(law.forms()), law) if law.evidence == "none" else law for law in prepared.columns.laws)
    return replace(prepared, columns=replace(prepared.columns, laws=laws))
