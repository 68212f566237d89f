"""By which curve friction changes its sign, looked for anew beside what was found.

    done = with_curves_anew(done)

A fault bends what the nominal model took for that curve, and its numbers, two that do nearly the same, may then lie where no step
leads back from: what is missed there would pass for another law of friction.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.model.diagnosis.beside import less
from pipelines.model.diagnosis.exact import Exact
from pipelines.model.diagnosis.nominal import fit_nominal
from pipelines.model.diagnosis.refit import Refined, refine
from pipelines.model.effects.base import Effect

__all__ = ["with_curves_anew"]

_CLEARLY = 1e-3  # of the squared residual, every joint in units of its own, that the others leave less


def with_curves_anew(done: Refined) -> Refined:
    """The model with its laws of friction fitted from where they began, less the torque of its effects, where that leaves less.

    Not where no law fits its curve: the laws of a model that was given keep their form, for a number more would pass for what the
    cause explains.
    """
    model = done.model
    if not model.effects or all(_begun(law) is law for law in model.columns.laws):
        return done
    begun = tuple(map(_begun, model.columns.laws))
    columns, fit = fit_nominal(less(done.data, done.of_effects), replace(model.columns, laws=begun))
    least = np.maximum(done.rms, 1e-12)
    other = refine(model.beside(Exact.start(columns, fit)), done.data, 1.0 / least)
    return other if np.mean(np.square(other.rms / least)) < 1.0 - _CLEARLY else done


def _begun(law: Effect) -> Effect:
    """The form with the same numbers from which `law` was fitted; itself where there is none."""
    return next((form for form in law.forms() if len(law.free) > 1 and form.free == law.free), law)
