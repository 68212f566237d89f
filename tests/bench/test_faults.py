"""Each fault does what its name says: closed forms, scipy and Pinocchio are the judges."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
from scipy.signal import lsim

from bench.control import Decentralised, OpenLoop
from bench.draw import paper_machine
from bench.faults.drive import Cogging, DriveLag, TorqueSaturation
from bench.faults.load import Payload
from bench.faults.sensor import EncoderEccentricity, TimeDelay, TorqueLag
from bench.faults.structure import Backlash, BaseResonance, GravityTilt, JointElasticity
from bench.machine import Machine
from bench.motions import at_rest
from bench.plant import run
from tests.bench.machines import CENTRE, Spy, frictionless, sway, turntable, unrounded
from tests.bench.test_rigid import standard_parameters
from tests.dynamics.serial_arms import Arm, by_hand


def pinocchio_arm(machine: Machine) -> Arm:
    arm = by_hand(machine.robot)
    arm.load(standard_parameters(machine))
    return arm


def settled_torque(machine: Machine, *faults: object) -> tuple[np.ndarray, np.ndarray]:
    """Position and torque (3,) after three seconds at rest under stiff control."""
    recording = run(machine, Decentralised(), at_rest(CENTRE, 3.0), faults)  # type: ignore[arg-type]
    return recording.true_q[-1], recording.tau[-1]


def test_payload_weighs_what_it_should() -> None:
    """At rest the torque grows by Jᵀ m g of a mass at the centre of the ball."""
    machine = frictionless(paper_machine().ideal)
    arm, payload = pinocchio_arm(machine), Payload(None, 0.5, (0.02, -0.01, 0.03))
    q, tau = settled_torque(machine, payload)
    place = arm.link_in_joint[-1] * pin.SE3(np.eye(3), np.array(payload.centre))
    arm.model.appendBodyToJoint(3, pin.Inertia(0.5, np.zeros(3), np.eye(3) * 1e-4), place)
    expected = pin.computeGeneralizedGravity(arm.model, arm.model.createData(), q)
    np.testing.assert_allclose(tau, expected, atol=1e-6)


def test_tilted_gravity_pulls_at_the_waist() -> None:
    """At rest the torque is that of Pinocchio under g (sin α cos δ, sin α sin δ, -cos α)."""
    machine = frictionless(paper_machine().ideal)
    arm, alpha, delta = pinocchio_arm(machine), math.radians(5.0), 0.7
    q, tau = settled_torque(machine, GravityTilt(None, alpha, delta))
    arm.model.gravity.linear = 9.8062 * np.array(
        [math.sin(alpha) * math.cos(delta), math.sin(alpha) * math.sin(delta), -math.cos(alpha)]
    )
    expected = pin.computeGeneralizedGravity(arm.model, arm.model.createData(), q)
    np.testing.assert_allclose(tau, expected, atol=1e-6)
    assert abs(tau[0]) > 0.1


def test_cogging_is_a_load_of_two_harmonics() -> None:
    """On a turntable turned by hand, J q̈ = τ - A (sin(kq + φ) + 0.35 sin(2kq + φ2))."""
    machine, fault = turntable(0.8), Cogging(1, 12.0, 0.4, 0.3, 1.1)
    recording = run(
        machine, OpenLoop(np.full((1500, 1), 1.0), (True,)), at_rest(np.zeros(1), 1.5), [fault]
    )
    q, v = recording.true_q[:, 0], recording.true_dq[:, 0]
    work = (
        q
        + 0.4 / 12.0 * (np.cos(12 * q + 0.3) - math.cos(0.3))
        + 0.14 / 24.0 * (np.cos(24 * q + 1.1) - math.cos(1.1))
    )
    np.testing.assert_allclose(0.5 * 0.8 * v**2, work, atol=1e-6)
    assert q[-1] > 1.0


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


def test_delayed_position_is_the_old_truth() -> None:
    """A delay of 5 samples reads what was true 5 samples ago, one of 2.3 samples what a spline of
    the truth says.
    """
    machine = paper_machine().ideal
    recording = run(machine, Decentralised(), sway(0.5), [TimeDelay(2, 5e-3)])
    np.testing.assert_allclose(recording.q[5:, 1], recording.true_q[:-5, 1], atol=1e-12)
    np.testing.assert_array_equal(recording.q[:, 0], recording.true_q[:, 0])
    from scipy.interpolate import CubicHermiteSpline

    recording = run(machine, Decentralised(), sway(0.5), [TimeDelay(2, 2.3e-3)])
    truth = CubicHermiteSpline(recording.t, recording.true_q[:, 1], recording.true_dq[:, 1])
    np.testing.assert_allclose(recording.q[10:, 1], truth(recording.t[10:] - 2.3e-3), atol=1e-7)


def held_through_lag(u: np.ndarray, time_constant: float, parts: int) -> np.ndarray:
    """Means over each of `parts` pieces of every 1 ms hold of the first-order response to held `u`,
    by scipy.
    """
    fine = 50 * parts
    t = np.arange(len(u) * fine + 1) * (1e-3 / fine)
    held = np.append(np.repeat(u, fine), u[-1])
    _, y, _ = lsim(([1.0], [time_constant, 1.0]), held, t, interp=False)
    edges = np.arange(0, len(u) * fine + 1, fine // parts)
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1]))])
    return np.diff(integral[edges]) / (fine // parts)


def test_lagging_drive_is_a_first_order_filter() -> None:
    """Torque at the motor against scipy's response of 1/(T s + 1); the log keeps the command."""
    machine, spy = paper_machine().ideal, Spy()
    recording = run(machine, Decentralised(), sway(0.2), [DriveLag(1, 5e-3), spy])
    applied = np.array(spy.applied)[:, 0]
    np.testing.assert_allclose(
        applied, held_through_lag(recording.tau[:, 0], 5e-3, 4), atol=2e-4 * np.abs(applied).max()
    )


def test_lagging_record_leaves_the_machine_alone() -> None:
    """The motion is the healthy one, bit for bit; the logged torque is the command through 1/(T s +
    1).
    """
    machine = unrounded(paper_machine())
    sick, well = (
        run(machine, Decentralised(), sway(0.3), faults, seed=2)
        for faults in ([TorqueLag(3, 5e-3)], [])
    )
    np.testing.assert_array_equal(sick.q, well.q)
    np.testing.assert_array_equal(sick.tau[:, :2], well.tau[:, :2])
    expected = held_through_lag(well.tau[:, 2], 5e-3, 1)
    np.testing.assert_allclose(sick.tau[:, 2], expected, atol=2e-4 * np.abs(expected).max())


def test_saturated_drive_clips_what_acts_not_what_is_logged() -> None:
    machine, spy = paper_machine().ideal, Spy()
    fault = TorqueSaturation(2, 1.0, 12.0)
    recording = run(machine, Decentralised(), sway(0.8), [fault, spy])
    applied = np.array(spy.applied)[:, 1].reshape(-1, 4)
    assert fault.limit == 0.55 * 12.0
    np.testing.assert_allclose(
        applied[:, 0], np.clip(recording.tau[:, 1], -fault.limit, fault.limit), atol=1e-12
    )
    assert np.abs(recording.tau[:, 1]).max() > fault.limit


def test_eccentric_encoder_reads_a_sine_of_the_angle() -> None:
    """q_measured - q = e sin(q + φ) to first order in e, on its own joint."""
    machine = paper_machine().ideal
    recording = run(
        machine, Decentralised(), sway(0.5, amplitude=0.5), [EncoderEccentricity(3, 4e-3, 0.9)]
    )
    error = recording.q - recording.true_q
    np.testing.assert_allclose(
        error[:, 2], 4e-3 * np.sin(recording.true_q[:, 2] + 0.9), atol=4e-3**2
    )
    assert (error[:, :2] == 0.0).all()
    np.testing.assert_allclose(
        recording.q[0], recording.reference.q[0], atol=1e-12
    )  # it had settled before
