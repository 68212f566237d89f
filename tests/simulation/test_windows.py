"""Short windows, open loop, on motions that Pinocchio made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.dynamics.body import Motion
from pipelines.io.log import Array
from pipelines.simulation import Plant, Windows, simulate_windows
from tests.simulation.arms import KD, KP, TS, rrr, rrr_friction, waving
from tests.simulation.pinocchio_loop import Loop, backward_pd

SAMPLES = 1000


@pytest.fixture(scope="module")
def recorded() -> tuple[Motion, Array]:
    """Motion and held torque of the RRR arm under PD, by Pinocchio."""
    q_ref, dq_ref, _ = waving(SAMPLES)
    q, dq, tau = Loop(rrr().model, rrr_friction(), TS, 8).run(q_ref[0], dq_ref[0], backward_pd(q_ref, KP, KD), SAMPLES)
    return Motion(TS * np.arange(SAMPLES), q, dq, 0 * q), tau


def simulated(motion: Motion, tau: Array, factor: float = 1.0, usable: np.ndarray | None = None, length: int = 100) -> Windows:
    arm = rrr().arm
    heavier = replace(arm.with_body(arm.body, factor * arm.p), friction=arm.friction)
    return simulate_windows(Plant.of(heavier), motion, tau, TS, length, usable)


def test_the_true_arm_stays_where_it_was(recorded: tuple[Motion, Array]) -> None:
    """Windows of 100 ms from the true state: within 1e-6 rad of Pinocchio's motion throughout."""
    motion, tau = recorded
    found = simulated(motion, tau)
    assert found.length == 100
    np.testing.assert_array_equal(found.first, np.arange(0, SAMPLES, 100))
    assert np.abs(found.q - motion.q).max() < 1e-6
    assert np.abs(found.dq - motion.dq).max() < 1e-4


def test_a_wrong_arm_drifts_with_the_square_of_time(recorded: tuple[Motion, Array]) -> None:
    """Ten per cent too heavy: the error after twice the time is about four times as large."""
    motion, tau = recorded
    found = simulated(motion, tau, 1.1)
    off = np.sqrt(np.mean((found.q - motion.q)[found.first[:, None] + np.array([10, 20])] ** 2, axis=0))
    np.testing.assert_allclose(off[1] / off[0], 4.0, rtol=0.2)
    assert off[1].min() > 1e-5


def test_no_window_spans_a_gap(recorded: tuple[Motion, Array]) -> None:
    """What is not usable, not known or not evenly sampled belongs to no window."""
    motion, tau = recorded
    usable = np.ones(SAMPLES, dtype=bool)
    usable[250] = False
    broken, late = tau.copy(), motion.t.copy()
    broken[530] = np.nan
    late[700:] += 0.5
    found = simulated(Motion(late, motion.q, motion.dq, motion.ddq), broken, usable=usable)
    np.testing.assert_array_equal(found.first, [0, 100, 251, 351, 531, 700, 800, 900])
    assert np.isnan(found.q[[250, 530]]).all()
    inside = (found.first[:, None] + np.arange(100)).ravel()
    assert np.abs((found.q - motion.q)[inside]).max() < 1e-6
