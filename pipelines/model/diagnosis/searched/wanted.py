"""Causes that somebody names, and the families of shapes that they are fitted in.

    wanted_families(case, (Wanted(effect, {"order": 18.0}), …))     one of each place, with all starts that were given there
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from pipelines.model.diagnosis.screened.candidates import Family, families, whole_motion
from pipelines.model.diagnosis.screened.wanted import Wanted, usable
from pipelines.model.diagnosis.searched.case import Case

__all__ = ["wanted_families"]


def wanted_families(case: Case, wanted: Sequence[Wanted]) -> tuple[Family, ...]:
    """One of each place, with all starts that were given there.

    Raises:
        UsageError: C02, a cause that no model of these logs can take up.
    """
    there: dict[str, list[Family]] = {}
    for one in wanted:
        there.setdefault(one.place, []).append(_family(case, one))
    return tuple(replace(some[0], shapes=tuple(dict.fromkeys(shape for family in some for shape in family.shapes)))
                 for some in there.values())


def _family(case: Case, one: Wanted) -> Family:
    every = families(case.model.columns.laws, whole_motion(case.data), case.model.arm)
    mine = next((f for f in every if (f.cause, f.joint) == (one.effect.name, one.effect.joint)), None)
    mine = usable(mine, one, case.model.columns.laws, case.model.arm.robot.revolute)
    shape: dict[str, Any] = dict(one.start)
    return replace(mine, shapes=tuple(dict.fromkeys(replace(s, **shape) for s in mine.shapes)))
