"""By which curve dry friction changes its sign: nobody knows it of a real joint, and no cause is to be found in that.

    wrong_law(found)        one law of friction has a name at several joints, which is no fault but how this make of arm rubs, or
                            bends where dry friction changes its sign
    loosened(prepared)      the same rows, for laws that fit the curve as well

It is asked after a diagnosis by the laws as they are, and not from the start: a torque that is late, or another joint's, bends the
curve as well, and what that takes in is missed as a hump at low speed once the cause has been found.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from pipelines.model.diagnosis.inputs import Prepared
from pipelines.model.diagnosis.result import Diagnosis, Finding
from pipelines.model.effects import find_effect

__all__ = ["loosened", "wrong_law"]

_WIDTHS = 10.0  # by then tanh and the root have come to their level, within half a per cent


def wrong_law(found: Diagnosis) -> bool:
    """Whether the same law of friction was found at two joints or more, or one that bends where dry friction changes its sign;
    not of what has changed, for that it was before as well."""
    if found.question == "what has changed":
        return False
    laws = [one for one in found.findings if find_effect(one.cause).friction]
    return any(count > 1 for count in Counter(one.cause for one in laws).values()) or any(_turning(one, found) for one in laws)


def _turning(law: Finding, found: Diagnosis) -> bool:
    """Whether the speed at which `law` bends is that over which its joint's dry friction changes its sign."""
    sharpness = [one.values["sharpness"] for one in (found.nominal.friction if found.nominal is not None else ())
                 if one.effect.joint == law.joint and "sharpness" in one.values]
    speed = law.parameters.get("speed")
    return speed is not None and any(w * float(np.max(speed.value)) < _WIDTHS for w in sharpness)


def loosened(prepared: Prepared) -> Prepared:
    """The same, the laws that a nominal model has by default in their forms with most numbers: by which curve friction changes its
    sign is fitted too. Where slow samples are left out it is not among the equations, and the laws stay as they are."""
    if any(speed > 0.0 for speed in prepared.recipe.min_speed):
        return prepared
    laws = tuple(next(iter(law.forms()), law) if law.evidence == "none" else law for law in prepared.columns.laws)
    return replace(prepared, columns=replace(prepared.columns, laws=laws))
