"""The shapes of what stands, fitted exactly to the reference logs beside the nominal laws.

    standing, columns, beta = fitted_shapes(standing, columns, fit)

The standing set is chosen among the few shapes of a screening. What a law leaves there it leaves of the later logs too: it hides
what has changed, and makes the extended model worse than the logs allow. So the shapes are moved with those of the nominal laws
until the reference logs leave least, and a law that has other forms with as many amplitudes is given one where that leaves
decidedly less of its joint. Where numbers come out that a cause cannot have, all stays as it was chosen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipelines.log.experiment import Array
from pipelines.log.shared_work import shared_out
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import Fit
from pipelines.model.diagnosis.fitted.refit import Refined, refine
from pipelines.model.diagnosis.reference.standing import Chosen
from pipelines.model.diagnosis.screened.candidates import lay_one
from pipelines.model.effects.base import Effect
from pipelines.model.estimation.regression import Columns

__all__ = ["fitted_shapes"]

_DECIDED = 0.9  # of the squared residual of its joint, that another form of a law leaves at most


def fitted_shapes(standing: Sequence[Chosen], columns: Columns, fit: Fit) -> tuple[tuple[Chosen, ...], Columns, Array]:
    """The set, the nominal laws, and the numbers of the nominal model, each in the shapes that fit the reference logs best."""
    start = Exact.start(columns, fit)
    as_chosen = tuple(standing), columns, fit.beta
    if not standing:
        return as_chosen
    model = start
    for one in standing:
        model = model.with_effect(one.effect, one.amplitudes)
    done = refine(model, fit.data, fit.weight)
    for place in range(len(standing)):
        done = _in_its_form(done, place)
    if not all(one.possible for one in done.model.effects):
        return as_chosen
    found = tuple(replace(one, effect=own.effect, amplitudes=np.array(own.amplitudes))
                  for one, own in zip(standing, done.model.effects, strict=True))
    return found, done.model.columns, done.model.beta


def _in_its_form(done: Refined, place: int) -> Refined:
    """By another form of effect number `place`, where that leaves decidedly less of its joint."""
    own = done.model.effects[place]
    if own.effect.joint is None:
        return done
    width, arm = len(own.amplitudes), done.model.nominal
    forms: list[Effect] = [form for form in own.effect.forms() if len(lay_one(done.data, form, arm)) == width]
    best, joint = done, own.effect.joint - 1

    def fitted(form: Effect) -> Refined:
        effects = list(done.model.effects)
        effects[place] = replace(own, effect=form)
        return refine(replace(done.model, effects=tuple(effects)), done.data, done.weight).lean

    for lean in shared_out(fitted, forms):
        other = lean.with_rows(done.data, done.model)
        if all(one.possible for one in other.model.effects) and other.rms[joint] ** 2 < _DECIDED * best.rms[joint] ** 2:
            best = other
    return best
