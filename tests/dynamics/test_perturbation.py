"""What torque becomes when a joint is not where it was measured: Pinocchio's derivatives and scipy's integrator judge."""

from __future__ import annotations

from functools import partial

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.perturbation import perturbed_torque, shifted
from pipelines.effects.soft import deflection, oscillation
from tests.dynamics.rrr_arms import random_states
from tests.simulation.arms import Case, rrr


@pytest.fixture(scope="module")
def case() -> Case:
    return rrr(friction=False)


@pytest.mark.parametrize("index", [0, 1, 2])
def test_a_perturbed_torque_is_pinocchios_derivative(case: Case, index: int) -> None:
    """P_j(d) = K_j d + C_j ḋ + M_j d̈ on 200 random states, K, C, M by Pinocchio: 1e-7 of the largest."""
    rng = np.random.default_rng(5)
    motion = Motion(np.arange(200.0), *random_states(rng, 200))
    d, rate, second = rng.normal(size=(3, 200)) * np.array([[0.01], [0.1], [5.0]])
    found = perturbed_torque(case.arm.torque, motion, index, d, rate, second)
    data, expected = case.model.createData(), []
    for k in range(200):
        slopes = pin.computeRNEADerivatives(case.model, data, motion.q[k], motion.dq[k], motion.ddq[k])
        stiffness, damping, upper = (np.asarray(x) for x in slopes)
        mass = np.triu(upper) + np.triu(upper, 1).T
        expected.append(stiffness[:, index] * d[k] + damping[:, index] * rate[k] + mass[:, index] * second[k])
    assert np.abs(found - expected).max() <= 1e-7 * np.abs(expected).max()


def coefficients(t: Array) -> tuple[Array, Array, Array, Array]:
    """m, c, k, f that vary as those of a moving arm do."""
    m, c = 0.4 + 0.1 * np.sin(5.0 * t), 3.0 + np.cos(7.0 * t)
    k = 14000.0 + 200.0 * np.sin(3.0 * t)
    return m, c, k, 5.0 * (1.0 - np.cos(40.0 * t)) * np.sin(11.0 * t)


def test_an_oscillation_of_varying_coefficients_is_integrated() -> None:
    """A link of 28 Hz on its spring, force up to 8 Hz, one second at 1 kHz, against scipy's DOP853: 0.3 % of the largest."""
    t = np.linspace(0.0, 1.0, 1001)
    x, rate, second = oscillation(t, *coefficients(t))

    def slope(at: float, state: Array) -> list[float]:
        m, c, k, f = (float(z) for z in coefficients(np.asarray(at)))
        return [state[1], (f - c * state[1] - k * state[0]) / m]

    judge = solve_ivp(slope, (0.0, 1.0), [x[0], rate[0]], method="DOP853", t_eval=t, rtol=1e-10, atol=1e-14).y
    m, c, k, f = coefficients(t)
    for found, true in ((x, judge[0]), (rate, judge[1]), (second, (f - c * judge[1] - k * judge[0]) / m)):
        assert np.abs(found - true).max() <= 3e-3 * np.abs(true).max()


@pytest.mark.parametrize("inertia", [-0.05, 8.0])
def test_a_deflection_fulfils_its_equation(case: Case, inertia: float) -> None:
    """k x + d ẋ + I (q̈ + ẍ or ẍ) + τ_j = 0, τ_j by Pinocchio at the deflected motion: to 1e-9 of the torque."""
    t = np.linspace(0.0, 0.5, 501)
    phase = np.outer(t, [5.0, 8.0, 11.0])
    motion = Motion(t, 0.4 * np.sin(phase), 0.4 * np.cos(phase) * [5.0, 8.0, 11.0], -0.4 * np.sin(phase) * [25.0, 64.0, 121.0])
    index, k, d = (0, 2.5e5, 100.0) if inertia > 0.0 else (1, 14000.0, 4.0)
    x, rate, second = deflection(case.arm.body, case.arm.p, motion, index, k, d, inertia)
    there = shifted(motion, index, x, rate, second)
    torque = partial(pin.rnea, case.model, case.model.createData())
    tau = np.array([torque(*row)[index] for row in zip(there.q, there.dq, there.ddq, strict=True)])
    own = second if inertia > 0.0 else motion.ddq[:, index] + second
    assert np.abs(k * x + d * rate + inertia * own + tau).max() <= 1e-9 * np.abs(tau).max()
    assert np.abs(k * x).max() > 0.1
