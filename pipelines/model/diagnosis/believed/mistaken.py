"""For what a cause that was found could have been mistaken: how much of what it took away another one does as well.

    imitated(step, family, case)            share of the squared residual, from 0 to 1

With t⊥ what the accepted cause took off the weighted residual, less what the model before it can imitate, it is the share of |t⊥|²
that the other cause in its best shape takes off t⊥. Names alone do not tell: a ripple of thirty waves a turn is no spring.
"""

from __future__ import annotations

from pipelines.model.diagnosis.screened.candidates import Family
from pipelines.model.diagnosis.screened.screen import screen_family
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.search import Step

__all__ = ["imitated"]


def imitated(step: Step, family: Family, case: Case) -> float:
    """Share of what the cause of `step` took away that `family` would take instead; 1 of what happens once, which has no shape."""
    if step.best is None or family.event:
        return 1.0
    before = step.before
    taken = before.fit.project(before.left - step.best.done.left)
    whole = float(taken @ taken)
    seen = screen_family(case.data, before.fit, family, case.arms(before.model).of(family), taken[None])
    return float(seen.gain[0]) / max(whole, 1e-300)
