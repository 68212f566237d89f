"""Models with some only of the causes that a search found, fitted anew.

    done = without(found, kept, case)       with those of the steps `kept`
    done = all_but(found, k, case)          without that of step `k`
"""

from __future__ import annotations

from dataclasses import replace

from pipelines.model.diagnosis.fitted.refit import Refined, refine
from pipelines.model.diagnosis.screened.candidates import Family
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.search import Found
from pipelines.model.effects.base import Effect

__all__ = ["all_but", "family_of", "possible", "without"]


def without(found: Found, kept: list[int], case: Case, weighted: Refined | None = None) -> Refined:
    """The model with the effects of these steps, fitted anew where some are missing."""
    last = found.final if weighted is None else weighted
    effects = found.final.model.effects
    if len(kept) == len(last.model.effects):
        return last
    if kept and kept == list(range(len(kept))):  # it was fitted like this before
        return refine(found.steps[len(kept)].before.model, case.data, last.weight)
    model = replace(found.final.model, effects=tuple(effects[k] for k in kept))
    return refine(model, case.data, last.weight)


def all_but(found: Found, k: int, case: Case) -> Refined:
    """All that was accepted but step `k`."""
    return without(found, [j for j, one in enumerate(found.steps) if one.best is not None and j != k], case)


def possible(done: Refined) -> bool:
    """Whether the numbers of every cause lie in their ranges: fitted beside others, or without them, a hump may become a dip."""
    return all(one.possible for one in done.model.effects)


def family_of(case: Case, effect: Effect) -> Family:
    return next(family for family in case.families if (family.cause, family.joint) == (effect.name, effect.joint))
