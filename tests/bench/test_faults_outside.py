"""Faults that no candidate describes do what their story says: closed forms and Pinocchio are the
judges.
"""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

from bench.control import Decentralised, OpenLoop
from bench.draw import paper_machine
from bench.faults import fault_names, find_fault
from bench.faults.drive import HuntingDrive
from bench.faults.friction import StickingSeal
from bench.faults.load import RattlingMass, SloshingLoad
from bench.motions import at_rest, times
from bench.plant import run
from tests.bench.machines import CENTRE, Spy, frictionless, sway, turntable
from tests.bench.test_fault_signs import arm_of


def test_at_least_six_kinds_are_outside_the_library() -> None:
    assert len([name for name in fault_names() if not find_fault(name).known]) >= 6


def weight(q: np.ndarray, mass: float, offset: np.ndarray) -> np.ndarray:
    """Torque (3,) of gravity with a point mass at `offset` (3,) from the tip in the last joint's
    frame, by Pinocchio.
    """
    arm = arm_of(paper_machine().robot)
    at = arm.link_in_joint[-1].translation + offset
    arm.model.appendBodyToJoint(
        3, pin.Inertia(mass, np.zeros(3), np.eye(3) * 1e-9), pin.SE3(np.eye(3), at)
    )
    return np.array(pin.computeGeneralizedGravity(arm.model, arm.model.createData(), q))


def test_a_rattling_mass_crosses_its_gap() -> None:
    """While the arm sways fast enough, the torque is not that of a fixed mass: it changes by more
    than its own weight would.
    """
    loose, fixed = (
        run(
            frictionless(paper_machine().ideal),
            Decentralised(),
            sway(1.5, hz=2.0, amplitude=0.25),
            [RattlingMass(None, 0.4, gap, (0.0, 1.0, 0.0))],
        )
        for gap in (0.02, 0.0)
    )
    assert np.abs(loose.tau - fixed.tau)[300:, 1].max() > 0.2


def test_a_sloshing_load_swings_at_its_frequency() -> None:
    """Held still, the arm feels it swing at √(1 - ζ²) 2 Hz after it was let go, and then weighs
    what it should.
    """
    fault = SloshingLoad(None, 0.5, 0.08, (0.0, 0.0, 1.0), (0.0, 1.0, 0.0))
    recording = run(
        frictionless(paper_machine().ideal), Decentralised(), at_rest(CENTRE, 4.0), [fault]
    )
    swing = recording.tau[200:, 1] - recording.tau[200:, 1].mean()
    spectrum = np.abs(np.fft.rfft(swing * np.hanning(swing.size), 1 << 17))
    assert abs(np.fft.rfftfreq(1 << 17, 1e-3)[spectrum.argmax()] - 2.0) < 0.1
    assert np.ptp(swing[:500]) > 1.5 * np.ptp(swing[-500:])


def torn_loose(rest: float) -> np.ndarray:
    """Speed (100,) [rad/s] of a turntable of 0.8 kg m^2, sealed with 1 N m, under 2 N m from `rest`
    [s] on.
    """
    t = times(rest + 0.1)
    torque = np.where(t < rest, 0.0, 2.0)[:, None]
    recording = run(
        turntable(0.8),
        OpenLoop(torque, (True,)),
        at_rest(np.zeros(1), rest + 0.1),
        [StickingSeal(1, 1.0, 100.0)],
    )
    return recording.true_dq[-100:, 0]


def test_a_seal_sticks_the_longer_it_rests() -> None:
    """Motion and bond by scipy: dv/dt = (τ - s tanh 100v)/J, ds/dt = (1 - s)/0.1/(1 + (v/0.05)⁴) -
    s|v|/0.2.
    """

    def rate(_: float, y: np.ndarray) -> list[float]:
        v, s = y
        return [
            (2.0 - s * math.tanh(100.0 * v)) / 0.8,
            (1.0 - s) / 0.1 / (1.0 + (v / 0.05) ** 4) - s * abs(v) / 0.2,
        ]

    speeds = {}
    for rest in (0.0, 0.05, 0.5):
        start = [0.0, 1.0 - math.exp(-rest / 0.1)]
        expected = solve_ivp(rate, (0.0, 0.1), start, t_eval=times(0.1), rtol=1e-9, atol=1e-12).y[0]
        speeds[rest] = torn_loose(rest)
        np.testing.assert_allclose(speeds[rest], expected, atol=2e-4)
    assert speeds[0.5][-1] < 0.8 * speeds[0.0][-1]


@pytest.mark.parametrize("torque", [0.0, 10.0])
def test_a_drive_hunts_faster_under_torque(torque: float) -> None:
    """A sine of A at f (1 + 0.3 u/u_max) on top of the command."""
    spy, machine = Spy(), turntable(0.8)
    run(
        machine,
        OpenLoop(np.full((1000, 1), torque), (True,)),
        at_rest(np.zeros(1), 1.0),
        [HuntingDrive(1, 0.4, 5.0), spy],
    )
    applied = np.array(spy.applied)[:, 0] - torque
    t = (np.arange(len(applied)) + 1) * (1.0 / len(applied))
    rate = 5.0 * (1.0 + 0.3 * torque / machine.torque_limit[0])
    np.testing.assert_allclose(applied, 0.4 * np.sin(2.0 * math.pi * rate * t), atol=1e-6)
