"""Screen a cause that all torque of its joint passes through: a lag of the logged torque, fitted whole, not to first order.

    gain, amplitude = passed_through(data, fit, effect, residuals)

A lag slower than the motion hides most of the torque from the nominal model, inertia above all: the model that was fitted without
it is so wrong that its derivative says nothing. So every column of the model goes through the lag, and amplitudes are solved
anew, Golub & Pereyra 2003: gain = |r|² - min |y - H(Y β)|². Once for each lag on a grid; an exact refit then moves it.

H changes the rows of one joint. With Q an orthonormal basis of the model, which r is orthogonal to, and d = Yβ - H(Yβ) the rest
follows from those rows alone, marked j: HQ (HQ)ᵀ = 1 - Q_j Q_jᵀ + HQ_j (HQ_j)ᵀ and HQ (r + d) = HQ_j (r + d)_j - Q_j r_j.
"""

from __future__ import annotations

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import Fit
from pipelines.model.diagnosis.fitted.record import passed_rows
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.effects.base import Effect

__all__ = ["beyond_first_order", "passed_through"]

_RANK = 1e-12  # of the largest eigenvalue: what is smaller is rounding


def passed_through(data: Data, fit: Fit, effect: Effect, residuals: Array) -> tuple[Array, Array] | None:
    """What the best amplitude takes off each squared weighted residual, and which it is.

    Args:
        residuals: (m, rows) weighted and orthogonal to the fit.

    Returns:
        Gains (m,) and amplitudes (m,); None where nothing passes through the effect, or the rows have gaps that it would smear.
    """
    if effect.joint is None or not effect.passing or not data.counts.all():
        return None
    own = data.joint == effect.joint - 1
    weight, basis, rest = float(fit.weight[effect.joint - 1]), fit.basis[:, own], residuals[:, own]
    others, power = np.eye(len(basis)) - basis @ basis.T, np.sum(np.square(rest), axis=1)
    gains = []
    for amplitude in effect.passing:
        passed = passed_rows(data, effect, amplitude, fit.basis[:, own], own=True)
        modelled = passed_rows(data, effect, amplitude, fit.modelled[own], own=True, whole=True)
        left = rest + weight * (fit.modelled[own] - modelled)
        moment = left @ passed.T - rest @ basis.T
        values, vectors = np.linalg.eigh(others + passed @ passed.T)
        turned = (moment @ vectors)[:, values > _RANK * values[-1]]
        imitated = np.sum(np.square(turned) / values[values > _RANK * values[-1]], axis=1)
        gains.append(power - np.sum(np.square(left), axis=1) + imitated)
    best = np.argmax(gains, axis=0)
    return np.max(gains, axis=0), np.array(effect.passing)[best]


def beyond_first_order(now: Refined, effect: Effect, amplitude: float) -> Exact:
    """The model with the effect at `amplitude`, everything linear in it solved anew for what passes through the effect."""
    count = len(now.model.beta)
    linear = [*range(count), *(count + k for k, (kind, _, name) in enumerate(now.names) if kind == 1 and name.isdigit())]
    table = passed_rows(now.data, effect, amplitude, now.slopes[linear]) * now.weights
    modelled = now.fit.modelled
    left = (now.left + modelled - passed_rows(now.data, effect, amplitude, modelled, whole=True)) * now.weights
    size = np.linalg.norm(table, axis=1)
    size = np.where(size > 0.0, size, 1.0)
    shift = np.zeros(len(now.slopes))
    shift[linear] = np.linalg.lstsq((table / size[:, None]).T, left, rcond=1e-6)[0] / size
    return now.model.moved(shift, list(now.names)).with_effect(effect, np.array([amplitude]))
