"""Torques, regressor and mass matrix of every kind of arm against Pinocchio and against the laws of mechanics."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipelines.dynamics import chain as serial
from pipelines.dynamics.kinematics import serial_chain
from tests.dynamics.serial_arms import ARMS, HALF, Arm, by_hand, physical_links, table

BAR = 1e-11  # of the largest torque


def test_regressor_and_recursion_equal_pinocchio(arm: Arm) -> None:
    """On 250 random states, each with other links, Y φ and the recursion give Pinocchio's torque to 1e-11 of the largest.

    A new random φ for every state makes every column count: no error in one can hide behind another.
    """
    rng = np.random.default_rng(21)
    q, dq, ddq = arm.states(250, seed=22)
    chain, data = serial_chain(arm.robot), arm.model.createData()
    y = serial.regressor(chain, q, dq, ddq)
    theirs, ours, recursive = (np.empty((250, arm.n)) for _ in range(3))
    for k, posture in enumerate(arm.offset(q)):
        phi = physical_links(arm.n, rng)
        arm.load(phi)
        theirs[k] = pin.rnea(arm.model, data, posture, dq[k], ddq[k])
        ours[k] = y[k] @ phi
        recursive[k] = serial.inverse_dynamics(chain, q[k:k + 1], dq[k:k + 1], ddq[k:k + 1], phi)[0]
    largest = np.abs(theirs).max()
    assert np.abs(ours - theirs).max() <= BAR * largest
    assert np.abs(recursive - theirs).max() <= BAR * largest


_ANGLES = st.sampled_from([0.0, HALF, -HALF, math.pi]) | st.floats(-3.0, 3.0)
_LENGTHS = st.just(0.0) | st.floats(-0.5, 0.5)
_ROW = st.tuples(st.sampled_from(["revolute", "prismatic"]), _ANGLES, _LENGTHS, _LENGTHS, _ANGLES)


@given(st.lists(_ROW, min_size=1, max_size=5), st.sampled_from(["dh", "mdh"]), st.integers(0, 2**31))
@settings(max_examples=60, deadline=None)
def test_any_table_equals_pinocchio(rows: list[tuple[str, float, float, float, float]], convention: str,
                                    seed: int) -> None:
    """Whatever the table, distal or modified, turning or sliding: Pinocchio's torque, and a mass matrix like its own."""
    arm = by_hand(table("any", convention, rows))
    phi = physical_links(arm.n, np.random.default_rng(seed))
    arm.load(phi)
    q, dq, ddq = arm.states(5, seed)
    chain, data = serial_chain(arm.robot), arm.model.createData()
    theirs = np.array([pin.rnea(arm.model, data, p, dq[k], ddq[k]) for k, p in enumerate(arm.offset(q))])
    bar = BAR * max(np.abs(theirs).max(), 1.0)
    assert np.abs(serial.regressor(chain, q, dq, ddq) @ phi - theirs).max() <= bar
    assert np.abs(serial.inverse_dynamics(chain, q, dq, ddq, phi) - theirs).max() <= bar
    d = serial.mass_matrix(chain, q, phi)
    np.testing.assert_allclose(d, d.transpose(0, 2, 1), atol=1e-12 * np.abs(d).max())


@pytest.mark.parametrize("name", ["tx40", "puma-mdh", "gantry-mdh", "skew-urdf"])
def test_regressor_columns_equal_pinocchio_where_frames_coincide(name: str, shared: Path, tmp_path: Path) -> None:
    """Where our link frame is Pinocchio's joint frame, the two regressors agree column by column."""
    arm = ARMS[name](shared, tmp_path)
    assert all(link.isIdentity() for link in arm.link_in_joint)
    q, dq, ddq = arm.states(1000, seed=23)
    y, data = serial.regressor(serial_chain(arm.robot), q, dq, ddq), arm.model.createData()
    ours_in_theirs = np.array([0, 1, 2, 3, 4, 6, 9, 5, 7, 8])  # theirs: m, h, xx, xy, yy, xz, yz, zz
    sign = np.array([1, 1, 1, 1, 1, 1, 1, -1, -1, -1])  # ours: products positive
    order = np.concatenate([10 * i + ours_in_theirs for i in range(arm.n)])
    theirs = np.array([pin.computeJointTorqueRegressor(arm.model, data, p, dq[k], ddq[k])[:, order]
                       for k, p in enumerate(arm.offset(q))]) * np.tile(sign, arm.n)
    assert np.abs(y - theirs).max() <= BAR * np.abs(theirs).max()


def test_mass_matrix_equals_pinocchio(arm: Arm) -> None:
    """D(q) is Pinocchio's, symmetric and positive definite, on 100 random postures."""
    phi = physical_links(arm.n, np.random.default_rng(24))
    arm.load(phi)
    q, _, _ = arm.states(100, seed=25)
    ours, data = serial.mass_matrix(serial_chain(arm.robot), q, phi), arm.model.createData()
    for k, posture in enumerate(arm.offset(q)):
        theirs = np.triu(pin.crba(arm.model, data, posture))
        theirs = theirs + np.triu(theirs, 1).T
        np.testing.assert_allclose(ours[k], theirs, atol=1e-12 * np.abs(theirs).max())
        assert np.linalg.eigvalsh(ours[k]).min() > 0.0
