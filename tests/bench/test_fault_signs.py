"""A fault's answer means what causes.md says: measured torque = model torque + the fault's load, by
Pinocchio.

The load is the logged torque less Pinocchio's inverse dynamics of the true motion and less the
machine's own friction. The column of causes.md, at the parameters of the answer, has to be found in
it with a coefficient near one: exactly where the fault is done as the column has it, roughly where
it is done otherwise on purpose.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from types import SimpleNamespace as Answer

import numpy as np
import pinocchio as pin
import pytest

from bench.config import SAMPLE_TIME
from bench.control import Decentralised
from bench.draw import paper_machine
from bench.faults import fault_names, find_fault, make
from bench.faults.load import Contact
from bench.machine import Fault, Machine, coulomb_viscous
from bench.plant import Recording, run
from tests.bench.machines import sway
from tests.bench.test_rigid import standard_parameters
from tests.dynamics.serial_arms import Arm, by_hand
from tests.seeds import usually

SHARPNESS = 100.0  # [s/rad]
FC, FV = (4.5, 2.4, 0.9), (0.6, 0.3, 0.12)


@lru_cache
def machine() -> Machine:
    """Coulomb and viscous friction, neither noise nor quantisation."""
    friction = tuple(coulomb_viscous(c, v, SHARPNESS) for c, v in zip(FC, FV, strict=True))
    return replace(paper_machine(), friction=friction).ideal


@dataclass(frozen=True, eq=False)
class Measured:
    """Means over each sample, (samples,) or (samples, 3)."""

    t: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    tau: np.ndarray
    rigid: np.ndarray  # Pinocchio's torque
    load: np.ndarray  # torque that neither the rigid arm nor its friction explains


def arm_of(robot: object) -> Arm:
    arm = by_hand(robot)  # type: ignore[arg-type]
    arm.load(standard_parameters(replace(machine(), robot=robot)))  # type: ignore[arg-type]
    return arm


def explained(recording: Recording, arm: Arm) -> Measured:
    """States in the middle of each sample, by the cubic through its ends."""
    (q0, q1), (v0, v1) = ((x[:-1], x[1:]) for x in (recording.true_q, recording.true_dq))
    q, ddq = 0.5 * (q0 + q1) + SAMPLE_TIME / 8.0 * (v0 - v1), (v1 - v0) / SAMPLE_TIME
    v = 1.5 * (q1 - q0) / SAMPLE_TIME - 0.25 * (v0 + v1)
    data = arm.model.createData()
    rigid = np.array(
        [pin.rnea(arm.model, data, arm.offset(a), b, c) for a, b, c in zip(q, v, ddq, strict=True)]
    )
    friction = np.array(FC) * np.tanh(SHARPNESS * v) + np.array(FV) * v
    tau = recording.tau[:-1]
    return Measured(
        recording.t[:-1] + 0.5 * SAMPLE_TIME, q, v, ddq, tau, rigid, tau - rigid - friction
    )


SWAY = sway(2.0, hz=0.6, amplitude=0.7)  # to and fro at up to 3 rad/s


def measured(*faults: Fault) -> Measured:
    return explained(run(machine(), Decentralised(), SWAY, faults), arm_of(machine().robot))


def turned(v: np.ndarray) -> np.ndarray:
    return np.tanh(SHARPNESS * v)


def dahl(m: Measured, j: int, distance: float) -> np.ndarray:
    """du/dq = (sign v - u)/x_c, exactly from sample to sample."""
    u, path = 0.0, []
    for way in np.diff(m.q[:, j], prepend=m.q[0, j]):
        u = np.sign(way) + (u - np.sign(way)) * np.exp(-abs(way) / distance)
        path.append(u)
    return np.array(path)


def drift(m: Measured, j: int, p: Answer) -> np.ndarray:
    return np.asarray(
        p.relative_change * FV[j] * (1.0 - np.exp(-m.t / p.time_constant)) * m.dq[:, j]
    )


Column = Callable[[Measured, int, Answer], np.ndarray]
# The load of causes.md on the fault's own row, and by how much its coefficient may differ from one.
COLUMNS: dict[str, tuple[Column, float]] = {
    "cogging": (lambda m, j, p: p.amplitude * np.sin(p.order * m.q[:, j] + p.phase), 0.15),
    "stribeck": (
        lambda m, j, p: p.amplitude * np.exp(-((m.dq[:, j] / p.speed) ** 2)) * turned(m.dq[:, j]),
        0.15,
    ),
    "concave_friction": (lambda m, j, p: p.amplitude * np.tanh(m.dq[:, j] / p.speed), 0.35),
    "asymmetric_friction": (
        lambda m, j, p: (
            0.5 * p.coulomb_difference * np.abs(turned(m.dq[:, j]))
            + 0.5 * p.viscous_difference * np.abs(m.dq[:, j])
        ),
        0.05,
    ),
    "torque_offset": (lambda m, j, p: np.full(len(m.t), p.offset), 0.01),
    "load_friction": (lambda m, j, p: p.mu * np.abs(m.rigid[:, j]) * turned(m.dq[:, j]), 0.05),
    "presliding": (lambda m, j, p: p.amplitude * dahl(m, j, p.distance), 0.25),
    "quadratic_drag": (lambda m, j, p: p.coefficient * m.dq[:, j] * np.abs(m.dq[:, j]), 0.05),
    "viscous_drift": (drift, 0.02),
    "spring": (lambda m, j, p: p.stiffness * (m.q[:, j] - p.rest_angle), 0.35),
    "torque_gain": (lambda m, j, p: -p.gain_error * m.tau[:, j], 0.01),
    "torque_crosstalk": (lambda m, j, p: p.coefficient * m.tau[:, p.from_joint - 1], 0.01),
    "drive_lag": (lambda m, j, p: -p.time_constant * -np.gradient(m.tau[:, j], SAMPLE_TIME), 0.2),
    "transmission_coupling": (lambda m, j, p: coupled(m, j, p), 0.01),
    "rotor_inertia": (lambda m, j, p: p.inertia * m.ddq[:, j], 0.01),
}


def coupled(m: Measured, j: int, p: Answer) -> np.ndarray:
    i = p.with_joint - 1
    s = m.dq[:, i] + m.dq[:, j]
    return np.asarray(
        p.inertia * (m.ddq[:, i] + m.ddq[:, j]) + p.viscous * s + p.coulomb * turned(s)
    )


def coefficient(load: np.ndarray, column: np.ndarray, nuisance: np.ndarray) -> float:
    """Of the column in the load, after Coulomb and viscous friction have been fitted to both."""
    basis, _ = np.linalg.qr(nuisance)
    left, inside = (x - basis @ (basis.T @ x) for x in (load, column))
    return float(left @ inside / (inside @ inside))


@pytest.mark.parametrize(
    "joint", [pytest.param(1, marks=pytest.mark.slow), 2, pytest.param(3, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize(
    "name",
    usually(
        COLUMNS,
        "cogging",
        "stribeck",
        "presliding",
        "torque_gain",
        "torque_crosstalk",
        "drive_lag",
        "rotor_inertia",
    ),
)
def test_a_load_has_the_sign_and_the_size_of_its_answer(name: str, joint: int) -> None:
    """The column of causes.md at the answer's parameters, coefficient near one."""
    fault = make(name, machine(), joint, seed=2, duration=2.0)
    m, (column, within) = measured(fault), COLUMNS[name]
    j, settled = joint - 1, slice(50, None)
    nuisance = np.column_stack([turned(m.dq[:, j]), m.dq[:, j]])[settled]
    found = coefficient(
        m.load[settled, j], column(m, j, Answer(**fault.parameters()))[settled], nuisance
    )
    assert abs(found - 1.0) < within, found


@pytest.mark.parametrize(
    "joint", [pytest.param(1, marks=pytest.mark.slow), 2, pytest.param(3, marks=pytest.mark.slow)]
)
def test_the_main_harmonic_of_wear_is_the_answers(joint: int) -> None:
    """Friction over one whole turn in one direction: its Fourier coefficient at the order has the
    amplitude and phase told.
    """
    fault, j = make("position_friction", machine(), joint, seed=3), joint - 1
    recording = run(machine(), Decentralised(), sway(3.0, hz=0.2, amplitude=3.3), [fault])
    m = explained(recording, arm_of(machine().robot))
    moving = np.flatnonzero(m.dq[:, j] > 0.1)
    forth = slice(
        moving[0], moving[np.append(np.diff(moving) > 1, True)][0]
    )  # from the start to the first reversal
    start = m.q[forth, j][0]
    angle = start + 2.0 * np.pi * np.arange(720) / 720
    assert m.q[forth, j][-1] > angle[-1]
    friction = np.interp(angle, m.q[forth, j], (m.load[:, j] / turned(m.dq[:, j]))[forth])
    p = Answer(**fault.parameters())
    found = 2.0 * np.mean(friction * np.exp(-1j * p.order * angle))  # of A sin(kq + φ): -i A e^(iφ)
    assert abs(found - -1j * p.amplitude * np.exp(1j * p.phase)) < 0.02 * p.amplitude


def test_a_coupled_motor_loads_both_rows_alike() -> None:
    m = measured(make("transmission_coupling", machine(), 3, seed=2))
    moving = (np.abs(m.dq) > 0.1).all(axis=1)
    np.testing.assert_allclose(m.load[moving, 1], m.load[moving, 2], atol=4e-3)
    assert np.abs(m.load[:, 2]).max() > 0.1


def test_a_push_takes_torque_off_every_joint_by_the_jacobian() -> None:
    """Load = -Jᵀ F while it lasts, J by Pinocchio; nothing before and after."""
    fault, arm = Contact(None, 0.5, 0.25, 25.0, (0.6, 0.0, 0.8)), arm_of(machine().robot)
    m, data = measured(fault), arm.model.createData()
    push = 25.0 * np.sin(np.pi * np.clip((m.t - 0.5) / 0.25, 0.0, 1.0))
    expected = []
    for q, size in zip(m.q, push, strict=True):
        pin.computeJointJacobians(arm.model, data, arm.offset(q))
        tip = data.oMi[3] * arm.link_in_joint[-1]
        jacobian = pin.getJointJacobian(arm.model, data, 3, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        lever = np.cross(tip.translation - data.oMi[3].translation, np.array(fault.direction))
        expected.append(
            -size * (jacobian[:3].T @ np.array(fault.direction) + jacobian[3:].T @ lever)
        )
    moving = np.abs(m.dq) > 0.1
    np.testing.assert_allclose(
        np.where(moving, m.load, 0.0)[20:], np.where(moving, expected, 0.0)[20:], atol=1e-2
    )
    assert (np.abs(expected).max(axis=0) > 0.5).all()


def test_an_encoder_follows_its_neighbour() -> None:
    """q_2 as read = q_2 + c q_1, and the run begins where it reads its reference."""
    fault = make("encoder_crosstalk", machine(), 2, seed=2)
    recording = run(machine(), Decentralised(), sway(0.3), [fault])
    c = fault.parameters()["coefficient"]
    np.testing.assert_allclose(
        recording.q[:, 1] - recording.true_q[:, 1], c * recording.true_q[:, 0], atol=1e-12
    )
    np.testing.assert_array_equal(recording.q[:, [0, 2]], recording.true_q[:, [0, 2]])
    np.testing.assert_allclose(recording.q[0], recording.reference.q[0], atol=1e-12)


def test_a_fault_of_the_library_answers_with_the_names_of_causes() -> None:
    """Every known fault has the parameters that a finding of its cause reports."""
    asked = {
        "cogging": {"order", "amplitude", "phase"},
        "stribeck": {"amplitude", "speed"},
        "concave_friction": {"amplitude", "speed"},
        "asymmetric_friction": {"coulomb_difference", "viscous_difference"},
        "torque_offset": {"offset"},
        "load_friction": {"mu"},
        "position_friction": {"amplitude", "order", "phase"},
        "presliding": {"distance", "amplitude"},
        "quadratic_drag": {"coefficient"},
        "viscous_drift": {"relative_change", "time_constant"},
        "spring": {"stiffness", "rest_angle"},
        "torque_gain": {"gain_error"},
        "torque_saturation": {"limit"},
        "torque_crosstalk": {"coefficient", "from_joint"},
        "drive_lag": {"time_constant"},
        "torque_lag": {"time_constant"},
        "time_delay": {"delay"},
        "encoder_eccentricity": {"amplitude", "phase"},
        "encoder_crosstalk": {"coefficient", "from_joint"},
        "transmission_coupling": {"with_joint", "inertia", "viscous", "coulomb"},
        "payload": {"mass", "first_moment"},
        "gravity_tilt": {"angle", "direction"},
        "link_length": {"error", "link"},
        "rotor_inertia": {"inertia"},
        "joint_elasticity": {"stiffness", "damping", "frequency", "motor_inertia"},
        "base_resonance": {"frequency", "damping_ratio", "inertia"},
        "backlash": {"gap"},
        "contact": {"start", "duration", "force"},
    }
    known = {name for name in fault_names() if find_fault(name).known}
    assert known == set(asked)
    for name in known:
        assert asked[name] <= set(make(name, machine(), 2).parameters()), name
    arm_wide = {"gravity_tilt", "base_resonance", "contact", "payload", "link_length"}
    assert {name for name in known if find_fault(name).scope == "arm"} == arm_wide
