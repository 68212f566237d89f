"""Friction takes power out of a joint, whatever else is wrong with a fit. SciPy's bounded least squares judges."""

from __future__ import annotations

import numpy as np
from scipy.optimize import lsq_linear

from pipelines.effects.friction import Coulomb, TorqueOffset, Viscous
from pipelines.estimation.estimate import Recipe
from pipelines.estimation.exact_model import Exact
from pipelines.estimation.model_fit import Refined, dissipating, driving, refine
from pipelines.estimation.nominal import fit_nominal
from pipelines.estimation.preparation import Logs, prepare
from tests.diagnosis.rotor import turned


def fitted(waves: dict[float, float], lag: float) -> tuple[float, Refined]:
    """Viscous friction of the linear fit, and the model that dissipates."""
    prepared = prepare(Logs((turned(3, waves, lag),)), Recipe(cutoff_hz=40.0))
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    start = Exact.start(columns, fit)
    return float(start.beta[2]), refine(start, prepared.data, fit.weight)


def test_no_fit_has_friction_that_drives() -> None:
    """A ripple, logged late, that the model does not have bends viscous friction below zero; the bounded optimum is found."""
    viscous, done = fitted({7.0: 0.05}, 0.3)
    assert viscous < 0.0
    beta = done.model.beta
    assert (beta[1:] >= 0.0).all()
    low = np.full(len(done.slopes), -np.inf)
    low[1:len(beta)] = -beta[1:] - 1e-12
    again = lsq_linear((done.slopes * done.weights).T, done.residual, (low, np.full(len(low), np.inf)))
    assert 2.0 * again.cost > 0.999 * (done.residual @ done.residual)


def test_what_dissipates_is_as_it_was() -> None:
    viscous, done = fitted({7.0: 0.0}, 0.0)
    assert viscous > 0.0
    assert abs(done.model.beta[2] - 0.004) < 2e-4


def test_only_laws_of_friction_are_held() -> None:
    laws = (Coulomb(1), Viscous(1), TorqueOffset(1))
    assert dissipating(np.array([-1.0, 2.0, -3.0, -4.0]), laws).tolist() == [-1.0, 2.0, 0.0, -4.0]
    assert driving(np.array([0.0, 1.0, 0.5, 1.0]), np.array([-9.0, -0.5, -0.6, -9.0, -9.0]), laws) == [2]
