"""The base parameters: as many as the physics has, standing for what they say, the same every time."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from pipelines.dynamics import chain as serial
from pipelines.dynamics import rrr
from pipelines.dynamics.base_parameters import BaseArm, base_set
from pipelines.dynamics.kinematics import serial_chain
from pipelines.io.robot import LinkParameters, RobotDescription
from pipelines.io.robot_files import load_robot
from pipelines.io.urdf import import_urdf
from tests.dynamics.serial_arms import TX40, Arm, physical_links


def _pinocchio_rank(arm: Arm) -> tuple[int, float]:
    """Rank of Pinocchio's equilibrated regressor on random states, and the gap behind it."""
    q, dq, ddq = arm.states(300, seed=41)
    data = arm.model.createData()
    w = np.vstack([pin.computeJointTorqueRegressor(arm.model, data, p, dq[k], ddq[k])
                   for k, p in enumerate(arm.offset(q))])
    norms = np.linalg.norm(w, axis=0)
    w = w[:, norms > 1e-8 * norms.max()]
    values = np.linalg.svd(w / np.linalg.norm(w, axis=0), compute_uv=False)
    rank = int((values > 1e-8 * values[0]).sum())
    return rank, values[rank - 1] / values[min(rank, len(values) - 1)]


def _with_links(robot: RobotDescription, phi: np.ndarray) -> RobotDescription:
    links = [LinkParameters(v[0], tuple(v[1:4] / v[0]), tuple(v[4:])) for v in phi.reshape(-1, 10)]
    return replace(robot, joints=tuple(replace(j, link=k) for j, k in zip(robot.joints, links, strict=True)))


def test_there_are_as_many_as_pinocchios_regressor_has_rank(arm: Arm) -> None:
    """The base set has the rank of Pinocchio's regressor, which has a clear gap behind it."""
    rank, gap = _pinocchio_rank(arm)
    assert gap > 1e5
    assert len(BaseArm(arm.robot).parameters) == rank


def test_known_counts(shared: Path) -> None:
    """15 for the paper's arm (eq. A4), 36 for an anthropomorphic six-joint arm (a PUMA's: Mayeda, Yoshida & Osuka 1990)."""
    assert len(BaseArm(load_robot("rrr")).parameters) == 15
    assert len(BaseArm(import_urdf(shared / TX40)).parameters) == 36


def test_rrr_spans_what_the_closed_form_spans() -> None:
    """The numerical base set and the paper's p1 … p15 describe the same torques: together they have rank 15 still."""
    robot = load_robot("rrr")
    states = np.random.default_rng(42).normal(size=(3, 200, 3))
    both = np.concatenate([BaseArm(robot).regressor(*states), rrr.RRR(robot).regressor(*states)], axis=2)
    values = np.linalg.svd(both.reshape(600, 30), compute_uv=False)
    assert values[14] > 1e-3 * values[0]
    assert values[15] < 1e-13 * values[0]


def test_base_parameters_give_the_torque_of_all_link_parameters(arm: Arm) -> None:
    """On states never used to find it, Y_b p is Pinocchio's torque of the full links, and so is the recursion's."""
    phi = physical_links(arm.n, np.random.default_rng(43))
    arm.load(phi)
    body = BaseArm(_with_links(arm.robot, phi))
    p = body.known_parameters()
    assert p is not None
    q, dq, ddq = arm.states(200, seed=44)
    data = arm.model.createData()
    theirs = np.array([pin.rnea(arm.model, data, x, dq[k], ddq[k]) for k, x in enumerate(arm.offset(q))])
    # angles written with twelve digits bend the TX40 by 5e-12 rad, which its base set cannot and should not show
    bar = 2e-10 * np.abs(theirs).max()
    np.testing.assert_allclose(body.regressor(q, dq, ddq) @ p, theirs, atol=bar)
    np.testing.assert_allclose(body.torque(q, dq, ddq, p), theirs, atol=bar)


def test_parts_add_up_and_mean_what_they_say(arm: Arm) -> None:
    """Inertial, Coriolis and gravity torque add up to the torque; inertia is D q̈; gravity is all there is at rest."""
    body = BaseArm(arm.robot)
    p = body.base.combine @ physical_links(arm.n, np.random.default_rng(45))
    q, dq, ddq = arm.states(100, seed=46)
    parts, tau = body.torque_parts(q, dq, ddq, p), body.torque(q, dq, ddq, p)
    atol = 1e-12 * np.abs(tau).max()
    np.testing.assert_allclose(parts.inertia + parts.coriolis + parts.gravity, tau, atol=atol)
    np.testing.assert_allclose(parts.inertia, np.einsum("sij,sj->si", body.mass_matrix(q, p), ddq), atol=atol)
    still = np.zeros_like(q)
    np.testing.assert_allclose(parts.gravity, body.torque(q, still, still, p), atol=atol)
    np.testing.assert_allclose(body.torque_parts(q, 2.0 * dq, ddq, p).coriolis, 4.0 * parts.coriolis, atol=4.0 * atol)


def test_the_set_does_not_depend_on_the_draw(arm: Arm) -> None:
    """Other random states choose the same parameters, in the same words."""
    chain = serial_chain(arm.robot)
    first, second = (base_set(chain, np.random.default_rng(seed)) for seed in (1, 2))
    assert first.chosen == second.chosen
    assert [p.combination for p in first.parameters] == [p.combination for p in second.parameters]


def test_combinations_say_what_the_numbers_are(arm: Arm) -> None:
    """Read aloud, "Ixx2 - Iyy2 + 0.0506 m3" gives the value of the parameter for any links."""
    phi = physical_links(arm.n, np.random.default_rng(49))
    body = BaseArm(arm.robot)
    p = body.base.combine @ phi
    for parameter, value in zip(body.parameters, p, strict=True):
        assert parameter.combination.startswith(parameter.name)
        terms = re.findall(r"(?:(^|[+-]) ?)(?:([\d.e-]+) )?([mI][xyz]*)(\d+)", parameter.combination)
        read = sum((-1.0 if sign == "-" else 1.0) * float(size or 1.0)
                   * phi[10 * (int(link) - 1) + serial.STANDARD.index(name)] for sign, size, name, link in terms)
        assert value == pytest.approx(read, abs=2e-5 * np.abs(phi).max())
