"""Each fault does what its name says: closed forms, scipy and Pinocchio are the judges."""

from __future__ import annotations

import math

import numpy as np

from bench.control import OpenLoop
from bench.faults.structure import Backlash, BaseResonance, JointElasticity
from bench.motions import at_rest
from bench.plant import run
from tests.bench.machines import turntable


def test_elastic_joint_rings_at_its_free_resonance() -> None:
    """Motor and link of a turntable, free of each other but for the spring: ω² = k (1/J_m + 1/J_l),
    and their mean motion is that of the whole inertia.
    """
    machine, motor, k = turntable(0.8), 0.1, 2000.0
    torque = np.zeros((2000, 1))
    torque[:5] = 10.0
    recording = run(
        machine,
        OpenLoop(torque, (True,)),
        at_rest(np.zeros(1), 2.0),
        [JointElasticity(1, k, 0.0, motor, 0.7)],
    )
    speed = recording.true_dq[5:, 0]
    spectrum = np.abs(np.fft.rfft((speed - speed.mean()) * np.hanning(speed.size), 1 << 18))
    found = np.fft.rfftfreq(1 << 18, 1e-3)[spectrum.argmax()]
    expected = math.sqrt(k * (1 / motor + 1 / 0.7)) / (2 * math.pi)
    assert abs(found - expected) < 2e-3 * expected
    assert abs(speed.mean() - 10.0 * 5e-3 / 0.8) < 0.02 * speed.mean()


def test_a_soft_base_rings_at_its_own_pole() -> None:
    """After a kick the table turns against its base, which rings as e^(-ζωt) sin(ω√(1-ζ²) t),
    with any inertia of the table.
    """
    w, zeta, inertia, kick = 2 * math.pi * 28.0, 0.08, 8.0, 10.0 * 1e-3
    torque = np.zeros((300, 1))
    torque[0] = 10.0
    for table in (0.4, 0.8):
        recording = run(
            turntable(table),
            OpenLoop(torque, (True,)),
            at_rest(np.zeros(1), 0.3),
            [BaseResonance(None, 28.0, zeta, inertia)],
        )
        t = recording.t[1:] - 5e-4  # the middle of the kick
        wd = w * math.sqrt(1 - zeta**2)
        base = -kick / (inertia * wd) * np.exp(-zeta * w * t) * np.sin(wd * t)
        np.testing.assert_allclose(
            recording.true_q[1:, 0], kick / table * t - base, atol=2e-3 * kick / (inertia * wd)
        )


def test_in_the_gap_the_motor_is_alone() -> None:
    """Torque u drives J_m alone until half the gap is crossed, from then on motor and link
    together.
    """
    machine, motor, gap, u = turntable(0.8), 0.1, 0.02, 1.0
    recording = run(
        machine,
        OpenLoop(np.full((500, 1), u), (True,)),
        at_rest(np.zeros(1), 0.5),
        [Backlash(1, gap, 3e5, 300.0, 0.0, motor, 0.7)],
    )
    q, t = recording.true_q[:, 0], recording.t
    free = t < 0.95 * math.sqrt(gap * motor / u)
    np.testing.assert_allclose(q[free], 0.5 * u / motor * t[free] ** 2, atol=1e-12)
    assert (
        abs((recording.true_dq[-1, 0] - recording.true_dq[300, 0]) / (t[-1] - t[300]) - u / 0.8)
        < 0.02 * u / 0.8
    )
