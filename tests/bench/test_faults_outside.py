"""Faults that no candidate describes do what their story says: closed forms and Pinocchio are the
judges.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

from bench.control import Decentralised, OpenLoop
from bench.draw import paper_machine
from bench.faults.friction import StickingSeal
from bench.faults.load import SloshingLoad
from bench.motions import at_rest, times
from bench.plant import run
from tests.bench.machines import CENTRE, frictionless, turntable


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
