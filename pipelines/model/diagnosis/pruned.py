"""After the search: what does not repeat on held-out time, or no longer pays beside what was found later, is dropped again."""

from __future__ import annotations

from dataclasses import replace

from pipelines.model.diagnosis.exact import Exact, Refined, refine
from pipelines.model.diagnosis.findings import sure
from pipelines.model.diagnosis.inputs import Prepared
from pipelines.model.diagnosis.search import Case, Found, held_out
from pipelines.model.diagnosis.verdict import Ruling

__all__ = ["settled"]

_PAYS = 0.005  # of the held-out squared error, that a cause takes away at least beside all others


def settled(found: Found, ruling: Ruling, case: Case, prepared: Prepared) -> tuple[Found, Ruling]:
    """The search with a final model of exactly the causes that are named, in the order of their steps."""
    if ruling.verdict != "cause":
        return replace(found, final=found.nominal), replace(ruling, named=())
    doubts = {k: sure(found.steps[k], prepared, case.blocks) for k in ruling.named}
    kept = [k for k in ruling.named if not doubts[k]]
    final = _without(found, kept, case)
    while len(kept) > 1:
        always = [k for k in kept if found.final.model.effects[k].log is None]
        errors = {k: held_out(_without(found, [other for other in kept if other != k], case, final), case) for k in always}
        least = min(errors, key=lambda k: errors[k], default=None)
        if least is None or errors[least] > (1.0 + _PAYS) * held_out(final, case):
            break
        kept.remove(least)
        final = _without(found, kept, case, final)
    if not kept:
        return replace(found, final=found.nominal), Ruling("unknown", (), next(iter(doubts.values())))
    return replace(found, final=final), replace(ruling, named=tuple(kept))


def _without(found: Found, kept: list[int], case: Case, weighted: Refined | None = None) -> Refined:
    """The model with the effects of these steps, fitted anew where some are missing."""
    last = found.final if weighted is None else weighted
    effects = found.final.model.effects
    if len(kept) == len(last.model.effects):
        return last
    model = Exact(found.final.model.columns, found.final.model.beta, tuple(effects[k] for k in kept))
    return refine(model, case.data, last.weight)
