"""Causes of the library of which there is neither a finding nor a size to tell: what was seen of each, so that none goes unsaid.

    told = replace(told, without_limit=without_limit(told, frf, without))
"""

from __future__ import annotations

from collections.abc import Collection

from pipelines.model.diagnosis.asked.unasked import WithoutLimit
from pipelines.model.diagnosis.result import Diagnosis
from pipelines.model.effects import all_effects
from pipelines.model.effects.base import Effect
from pipelines.model.effects.kinds import FrictionLaw
from pipelines.model.friction.laws import LADDER

__all__ = ["without_limit"]

_NOMINAL = "it is part of the nominal model, whose friction is fitted to these logs"
_LAW = "it is another law of friction for the nominal model, and no fault: fit-friction chooses among the laws"
_RESPONSES = "the frequency responses show none at the joints that they are of, below the highest frequency that they excite"
_STILL = "the base parameters are not found to have moved since the reference logs as it moves them"
_NOT_ASKED = "it was looked for; no detection limit was computed"


def without_limit(told: Diagnosis, frf: bool, without: Collection[str] = ()) -> tuple[WithoutLimit, ...]:
    """Every cause that none of the other lists has, with what is known of it.

    A law that only stands in for one of more terms is none that anybody asks for: it goes unsaid where the nominal model lacks it.

    Args:
        frf: whether there are frequency responses.
        without: names of causes that were left out.
    """
    there = {one.cause
             for some in (told.findings, told.baseline_effects, told.detection_limits, told.not_identifiable) for one in some}
    laws = set() if told.nominal is None else {law.effect.name for law in told.nominal.friction}
    refused = {one.cause: one.reason for one in told.rejected}
    return tuple(WithoutLimit(kind.name, f"rejected: {refused[kind.name]}" if kind.name in refused else _seen(kind, laws, frf))
                 for kind in all_effects() if kind.name not in there | _stand_ins() - laws and kind.name not in without)


def _stand_ins() -> set[str]:
    """Laws that are the plainer form of another, and on no rung of the ladder of fit-friction."""
    plainer = {name for kind in all_effects() if issubclass(kind, FrictionLaw) for names in kind.plainer for name in names}
    return plainer - {name for law in LADDER for name in law.members}


def _seen(kind: type[Effect], laws: Collection[str], frf: bool) -> str:
    if kind.name in laws:
        return _NOMINAL
    if kind.evidence == "frequency responses" and frf:
        return _RESPONSES
    return {"none": _LAW, "base parameters": _STILL}.get(kind.evidence, _NOT_ASKED)
