"""By which curve friction changes its sign, looked for anew beside what was found.

    done = with_curves_anew(done, laws)

A fault bends what the nominal model took for that curve, and its numbers, two that do nearly the same, may then lie where no step
leads back from: what is missed there would pass for another law of friction. So may those of a law of several terms, of which two
have merged: from there the fit has lost the third, and what it left stays in the residual beside the cause.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.fitted.refit import Refined, refine
from pipelines.model.diagnosis.searched.beside import less
from pipelines.model.effects.base import Effect

__all__ = ["with_curves_anew"]

_CLEARLY = 1e-3  # of the squared residual, every joint in units of its own, that the others leave less


def with_curves_anew(done: Refined, laws: Sequence[Effect] = ()) -> Refined:
    """The model with its laws of friction fitted from where they began, less the torque of its effects, where that leaves less.

    Not where no law fits its curve: the laws of a model that was given keep their form, for a number more would pass for what the
    cause explains.

    Args:
        laws: in the shapes that those of several terms began in.
    """
    model = done.model
    begun = tuple(_begun(law, laws) for law in model.columns.laws)
    if not model.effects or all(law is own for law, own in zip(begun, model.columns.laws, strict=True)):
        return done
    columns, fit = fit_nominal(less(done.data, done.of_effects), replace(model.columns, laws=begun))
    least = np.maximum(done.rms, 1e-12)
    other = refine(model.beside(Exact.start(columns, fit)), done.data, 1.0 / least)
    return other if np.mean(np.square(other.rms / least)) < 1.0 - _CLEARLY else done


def _begun(law: Effect, laws: Sequence[Effect]) -> Effect:
    """The form with the same numbers from which `law` was fitted, one of `laws` if of several terms; itself where there is none."""
    if law.plainer:
        return next((one for one in laws if (one.name, one.joint) == (law.name, law.joint)), law)
    return next((form for form in law.forms() if len(law.free) > 1 and form.free == law.free), law)
