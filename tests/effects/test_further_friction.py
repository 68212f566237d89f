"""Friction laws beside equation (10): each against a solution of its own equation by other means."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.functions import ARRAYS
from pipelines.effects.angle import PositionFriction
from pipelines.effects.drives import LoadFriction
from pipelines.effects.friction import AsymmetricFriction
from pipelines.effects.presliding import Presliding
from sample_logs.make_model import synthetic_arm
from tests.seeds import rarely

DAHL = {"elastic": -1.0, "exponent": 1.0, "inner_loops": 0.0}


def swinging(hz: float = 0.7, samples: int = 4001) -> Motion:
    """Joint 2 swings with two frequencies and reverses many times; the others rest."""
    t = np.linspace(0.0, 4.0, samples)
    w = 2 * np.pi * hz
    q, dq, ddq = (np.zeros((samples, 3)) for _ in range(3))
    q[:, 1] = 0.3 * np.sin(w * t) + 0.05 * np.sin(5.3 * w * t)
    dq[:, 1] = 0.3 * w * np.cos(w * t) + 0.05 * 5.3 * w * np.cos(5.3 * w * t)
    ddq[:, 1] = -0.3 * w**2 * np.sin(w * t) - 0.05 * (5.3 * w) ** 2 * np.sin(5.3 * w * t)
    return Motion(t, q, dq, ddq)


def bristles(motion: Motion, distance: float, breakaway: float = 0.0, slow: float = 0.2) -> Array:
    """du/dt = v - |v| u/h(v) over x_c, by an adaptive integrator over the true speed."""
    w = 2 * np.pi * 0.7

    def rate(t: float, u: Array) -> Array:
        v = 0.3 * w * np.cos(w * t) + 0.05 * 5.3 * w * np.cos(5.3 * w * t)
        return np.asarray((v - abs(v) * u / (1.0 + breakaway * np.exp(-(v / slow) ** 2))) / distance)

    solved = solve_ivp(rate, (0.0, 4.0), [0.0], t_eval=motion.t, rtol=1e-9, atol=1e-11, max_step=2e-3)
    return np.asarray(solved.y[0])


@pytest.mark.parametrize("distance", [0.003, *rarely(0.03, 0.2)])
@pytest.mark.parametrize(("time", "breakaway"), [(0.0, 0.0), (2e-3, 0.6)])
def test_presliding_solves_its_differential_equation(distance: float, time: float, breakaway: float) -> None:
    """Dahl and LuGre, with more friction at standstill and without, along a motion with reversals. Between the samples a turning
    point is missed by a T²/8 of travel at most, there and back."""
    motion, arm = swinging(), synthetic_arm()
    u = bristles(motion, distance, breakaway)
    v = motion.dq[:, 1]
    expected = 2.0 * (u + time * (v - np.abs(v) * u / (1.0 + breakaway * np.exp(-np.square(v / 0.2)))) / distance)
    found = Presliding(2).torque(motion, arm, DAHL | {"amplitude": 2.0, "distance": distance, "damping_time": time,
                                                      "breakaway": breakaway, "breakaway_speed": 0.2})[:, 1]
    missed = 2.0 * np.abs(motion.ddq).max() * 1e-3**2 / 8.0 / distance
    assert np.abs(found - expected).max() < (missed + 1e-4) * np.abs(expected).max()


@pytest.mark.parametrize(("law", "time"), [
    ({}, 0.0), ({}, 1e-3), ({"elastic": 0.5}, 0.0), ({"elastic": 0.5}, 1e-3), ({"elastic": 0.3, "exponent": 0.6}, 0.0),
    ({"elastic": 0.2, "inner_loops": 1.0}, 0.0), ({"breakaway": 0.5, "breakaway_speed": 0.3}, 1e-3)],
    ids=["Dahl", "LuGre", "elastic", "elastic, damped", "abrupt", "slips", "breakaway"])
def test_presliding_simulates_as_it_fits(law: dict[str, float], time: float) -> None:
    """The state of the forward simulation, stepped along the motion, gives the torque of the fit."""
    motion, arm = swinging(), synthetic_arm()
    values = DAHL | {"amplitude": 1.5, "distance": 0.05, "damping_time": time} | law
    hooks = Presliding(2).simulate(arm, values)
    assert hooks.load is not None
    assert hooks.rate is not None
    z, loads = np.zeros((1, hooks.states)), []
    for k in range(1500):
        now = Motion(motion.t[[k]], motion.q[[k]], motion.dq[[k]], motion.ddq[[k]])
        loads.append(hooks.load(now, z)[0, 1])
        ahead = motion.dq[[min(k + 1, len(motion.t) - 1)]]
        for part in (0.125, 0.375, 0.625, 0.875):
            between = replace(now, dq=(1.0 - part) * now.dq + part * ahead)
            half = z + 1.25e-4 * hooks.rate(between, np.zeros((1, 3)), z)
            z = z + 2.5e-4 * hooks.rate(between, np.zeros((1, 3)), half)
    assert np.abs(np.array(loads) - Presliding(2).torque(motion, arm, values)[:1500, 1]).max() < 0.04


@pytest.mark.parametrize("input_side", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("behind", [0.0, 0.6, 1.0])
def test_load_friction_of_the_simulation_is_that_of_the_log(behind: float, input_side: float) -> None:
    """What the drive gives, less what friction takes, is the load: forward and inverse form are one."""
    motion, arm = swinging(), synthetic_arm()
    values = {"mu": 0.2, "sharpness": 80.0, "behind": behind, "input_side": input_side}
    logged = LoadFriction(2).apply(motion, arm, values)
    hooks = LoadFriction(2).simulate(arm, values)
    assert hooks.drive is not None
    carried = hooks.drive[1](logged.T, motion.dq.T, ARRAYS)
    np.testing.assert_allclose(carried, arm.torque(motion)[:, 1], rtol=1e-12, atol=1e-12)


def test_what_rubs_behind_a_gear_loads_it_too() -> None:
    """A gear that loses a tenth of all that passes it: with friction f behind it the drive gives (τ_l + f)(1 ± 0.1)."""
    motion, arm = swinging(), synthetic_arm()
    found = LoadFriction(2).apply(motion, arm, {"mu": 0.1, "sharpness": 80.0, "behind": 1.0})[:, 1]
    passed = arm.torque(motion)[:, 1]
    np.testing.assert_allclose(found, passed * (1.0 + 0.1 * np.sign(passed) * np.tanh(80.0 * motion.dq[:, 1])), rtol=1e-12)


def test_position_friction_is_a_wave_along_the_turn() -> None:
    """Amplitude, order and phase mean A sin(k q + φ) against the direction of motion, and likewise of its harmonics."""
    motion, arm = swinging(), synthetic_arm()
    values = {"amplitude": 0.7, "order": 3.0, "phase": 0.4, "sharpness": 50.0, "amplitude_2": 0.2, "phase_2": -1.0,
              "amplitude_3": 0.1, "phase_3": 2.0}
    found, q = PositionFriction(2).torque(motion, arm, values)[:, 1], motion.q[:, 1]
    waves = 0.7 * np.sin(3.0 * q + 0.4) + 0.2 * np.sin(6.0 * q - 1.0) + 0.1 * np.sin(9.0 * q + 2.0)
    expected = waves * np.tanh(50.0 * motion.dq[:, 1])
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("gradual", [0.0, 1.0])
def test_asymmetric_friction_adds_half_to_each_side(gradual: float) -> None:
    """Fc + ½ ΔFc one way, Fc - ½ ΔFc the other, likewise Fv."""
    values = {"coulomb_difference": 0.6, "viscous_difference": 0.2, "sharpness": 500.0, "gradual": gradual}
    forth, back = AsymmetricFriction(1).curve(np.array([2.0, -2.0]), synthetic_arm(), values)
    assert forth == pytest.approx(0.3 + 0.2)
    assert back == pytest.approx(0.3 + 0.2)
