"""Whether logs tell at which joint a cause is; a name at the wrong one is worse than none.

    why = at_which(step)        empty where they do
"""

from __future__ import annotations

from pipelines.model.diagnosis.searched.elsewhere import as_good_elsewhere
from pipelines.model.diagnosis.searched.ledger import Tried
from pipelines.model.diagnosis.searched.search import Step
from pipelines.model.words import within

__all__ = ["at_which"]


def at_which(step: Step) -> str:
    """Why the cause that `step` has found cannot be told at its joint; empty where it can."""
    best = step.best
    others = [] if best is None else as_good_elsewhere(best, step.rivals, step.before)
    if best is None or not others:
        return ""
    places = " or ".join(f"at joint {one.effect.joint}{_number(one)}" for one in (best, *others))
    return (f"{within(best.effect.title)} {places} explains it, and these logs do not tell at which. {best.effect.remedy} "
            f"To tell: give logs from before it happened, of role reference; or {within(best.effect.experiment)}")


def _number(one: Tried) -> str:
    """What it would be there: its first number."""
    effect = one.done.model.effects[-1]
    value = effect.values.get(effect.effect.parameters[0].name)
    return "" if value is None else f" ({effect.effect.parameters[0].name} {value:.3g})"
