"""What a search has found, refitted with the ripple of drives in order among the noise (`ripple`).

    found, case = steadied(found, case)
    found = steady_nominal(found)                 where nothing that was found is believed, or by a second look
    done = steady(done)                           one model

Which causes there are, the search asks of rows weighed alike, as thresholds were made. What each is worth on other logs, and what
the extended model is, hangs on numbers that held-out motion does not stray from.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pipelines.log.shared_work import shared_out
from pipelines.model.diagnosis.fitted.refit import Refined, refine
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.search import Found, Step

__all__ = ["steadied", "steady", "steady_nominal"]


def steadied(found: Found, case: Case) -> tuple[Found, Case]:
    """Every model that was accepted, and the case whose further models are fitted alike. Rows that are cleared of
    ripple have been all along."""
    if case.data.cleared is not None:
        return found, case
    there = replace(case, data=replace(case.data, steady=True), judge=case.judge and replace(case.judge, steady=True))
    again = _refitted(_models(found), there.data)

    def step(one: Step) -> Step:
        if one.best is None:
            return replace(one, before=again[id(one.before)])
        best = replace(one.best, done=again[id(one.best.done)])
        rivals = tuple(best if rival is one.best else replace(rival, done=again[id(rival.done)]) for rival in one.rivals)
        return replace(one, before=again[id(one.before)], best=best, rivals=rivals)

    nominal, final = again[id(found.nominal)], again[id(found.final)]
    return replace(found, nominal=nominal, final=final, steps=tuple(map(step, found.steps))), there


def _models(found: Found) -> list[Refined]:
    """Every one that was accepted, or is a rival of such."""
    tried = (one.done for step in found.steps if step.best is not None for one in (step.best, *step.rivals))
    every = (found.nominal, *(step.before for step in found.steps), found.final, *tried)
    return list({id(one): one for one in every}.values())


def _refitted(models: Sequence[Refined], data: Data) -> dict[int, Refined]:
    """Each, by its id, refitted to `data`, by two processes."""
    _ = data.ripple, data.y  # once, before there are two
    found = shared_out(lambda one: refine(one.model, data, one.weight).lean, models)
    return {id(one): lean.with_rows(data, one.model) for one, lean in zip(models, found, strict=True)}


def steady(done: Refined) -> Refined:
    """The model refitted so, where it was not yet."""
    if done.data.steady or done.data.cleared is not None:
        return done
    return refine(done.model, replace(done.data, steady=True), done.weight)


def steady_nominal(found: Found) -> Found:
    """The same with the nominal model refitted alike; and the final one where it is that."""
    nominal = steady(found.nominal)
    return replace(found, nominal=nominal, final=nominal if found.final is found.nominal else found.final)
