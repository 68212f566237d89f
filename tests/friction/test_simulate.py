"""The simulated joint against SciPy's integrator, for laws as a table and for laws with memory or load."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipelines.dynamics.body import Array
from pipelines.estimation.varpro import SeparableFit
from pipelines.friction.fit import LawFit
from pipelines.friction.laws import Law, OneJoint, law_named
from pipelines.friction.simulation import simulate_joint
from pipelines.friction.weak_form import Stretch
from tests.friction.one_joint import INERTIA, JOINT, recorded

T = np.arange(500) * 1e-3
TORQUE = 2.0 * np.sin(2 * np.pi * 0.9 * T) + 0.6 * np.sin(2 * np.pi * 2.3 * T)


def known(law: Law, amplitudes: list[float], shapes: list[float]) -> LawFit:
    """A fit whose numbers are given: no gravity."""
    joint = OneJoint.of(recorded("three_sigmoid", 0).robot, JOINT, INERTIA, (0.0, 0.0))
    beta = np.array([INERTIA, 0.0, 0.0, *amplitudes])
    size = len(beta) + len(shapes)
    found = SeparableFit(np.log(shapes), beta, np.zeros((size, size)), np.ones(size), np.zeros(1), np.zeros((1, size)),
                         (False,) * len(shapes))
    return LawFit(law, joint, found, 3)


def stretch(tau: Array = TORQUE) -> Stretch:
    nothing = np.zeros(len(tau))
    return Stretch("given", T, nothing, tau, nothing, nothing, np.zeros(len(tau), dtype=bool), 20, True)


def integrated(acceleration: object, states: int = 2) -> Array:
    """(samples, states) sample by sample, the torque held."""
    x, out = np.zeros(states), np.zeros((len(T), states))
    for k in range(len(T) - 1):
        u = float(TORQUE[k])
        x = solve_ivp(lambda t, z, u=u: acceleration(z, u), (0.0, 1e-3), x, rtol=1e-9, atol=1e-12).y[:, -1]  # type: ignore[operator]
        out[k + 1] = x
    return out


def test_three_sigmoids() -> None:
    law = law_named("three_sigmoid")
    assert law is not None
    fit = known(law, [0.4, 1.2, -0.4, 0.12], [120.0, 60.0, 12.0])

    def rate(x: Array, u: float) -> list[float]:
        v = x[1]
        friction = 0.4 * np.tanh(120 * v) + 1.2 * np.tanh(60 * v) - 0.4 * np.tanh(12 * v) + 0.12 * v
        return [v, (u - friction) / INERTIA]

    expected, found = integrated(rate), simulate_joint(stretch(), fit)
    assert np.abs(found.dq - expected[:, 1]).max() < 1e-3 * np.abs(expected[:, 1]).max()
    assert np.abs(found.q - expected[:, 0]).max() < 1e-3 * np.abs(expected[:, 0]).max()


def test_friction_along_the_turn() -> None:
    law = law_named("position_friction")
    assert law is not None
    fit = known(law, [0.8, 0.1, 0.3, -0.2, 0.0, 0.1, 0.05, 0.0], [50.0, 2.0])  # sharpness, order; sine and cosine of each wave

    def rate(x: Array, u: float) -> list[float]:
        q, v = x
        waves = 0.3 * np.sin(2 * q) - 0.2 * np.cos(2 * q) + 0.1 * np.cos(4 * q) + 0.05 * np.sin(6 * q)
        friction = (0.8 + waves) * np.tanh(50 * v) + 0.1 * v
        return [v, (u - friction) / INERTIA]

    expected, found = integrated(rate), simulate_joint(stretch(), fit)
    assert np.abs(found.dq - expected[:, 1]).max() < 2e-3 * np.abs(expected[:, 1]).max()


def test_presliding_has_a_state() -> None:
    law = law_named("presliding")
    assert law is not None
    fit = known(law, [0.0, 0.1, 0.9], [50.0, 0.02])

    def rate(x: Array, u: float) -> list[float]:
        _, v, z = x
        return [v, (u - 0.9 * z - 0.1 * v) / INERTIA, (v - abs(v) * z) / 0.02]

    expected, found = integrated(rate, 3), simulate_joint(stretch(), fit)
    assert np.abs(found.dq - expected[:, 1]).max() < 5e-3 * np.abs(expected[:, 1]).max()


def test_load_takes_its_part() -> None:
    law = law_named("load_friction")
    assert law is not None
    fit = known(law, [0.6, 0.1, 0.15], [50.0])

    def rate(x: Array, u: float) -> list[float]:
        v = x[1]
        load = u / (1.0 + 0.15 * np.sign(u) * np.tanh(50 * v))
        return [v, (load - 0.6 * np.tanh(50 * v) - 0.1 * v) / INERTIA]

    expected, found = integrated(rate), simulate_joint(stretch(), fit)
    assert np.abs(found.dq - expected[:, 1]).max() < 5e-3 * np.abs(expected[:, 1]).max()


def test_without_friction_it_is_a_free_mass() -> None:
    """v = ∫ τ dt / J, exactly."""
    law = law_named("three_sigmoid")
    assert law is not None
    found = simulate_joint(stretch(), known(law, [0.4, 1.2, -0.4, 0.12], [120.0, 60.0, 12.0]), friction=False)
    np.testing.assert_allclose(found.dq[1:], np.cumsum(TORQUE[:-1]) * 1e-3 / INERTIA, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("inertia", [0.0, -0.1])
def test_a_mass_that_cannot_be_is_not_simulated(inertia: float) -> None:
    law = law_named("viscous")
    assert law is not None
    fit = known(law, [0.1], [])
    beta = fit.found.beta.copy()
    beta[0] = inertia
    assert np.isnan(simulate_joint(stretch(), replace(fit, found=replace(fit.found, beta=beta))).q).all()
