"""Frames and Jacobians of every kind of arm against Pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from pipelines.dynamics.kinematics import forward_kinematics, jacobian, serial_chain, tip_position
from tests.dynamics.serial_arms import Arm


def test_all_frames_equal_pinocchio(arm: Arm) -> None:
    """Every link frame and the tip lie where Pinocchio puts them, on 100 random postures."""
    q, _, _ = arm.states(100, seed=11)
    ours, data = forward_kinematics(serial_chain(arm.robot), q), arm.model.createData()
    for k, posture in enumerate(arm.offset(q)):
        pin.forwardKinematics(arm.model, data, posture)
        for i, link in enumerate(arm.link_in_joint):
            theirs = data.oMi[i + 1] * link
            np.testing.assert_allclose(ours.rotation[k, i], theirs.rotation, atol=1e-13)
            np.testing.assert_allclose(ours.position[k, i], theirs.translation, atol=1e-13)
        np.testing.assert_allclose(ours.tip[k], (data.oMi[arm.n] * arm.tip_in_joint).translation, atol=1e-13)


def test_jacobian_equals_pinocchio(arm: Arm) -> None:
    """The geometric Jacobian of the tip, in base axes, equals Pinocchio's on 100 random postures."""
    q, _, _ = arm.states(100, seed=12)
    model = arm.model.copy()
    frame = model.addFrame(pin.Frame("tip", arm.n, arm.tip_in_joint, pin.FrameType.OP_FRAME))
    data, ours = model.createData(), jacobian(serial_chain(arm.robot), q)
    for k, posture in enumerate(arm.offset(q)):
        theirs = pin.computeFrameJacobian(model, data, posture, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(ours[k], theirs, atol=1e-13)


def test_jacobian_is_the_derivative_of_the_tip(arm: Arm) -> None:
    """Moving the joints a little moves the tip by J dq, to second order."""
    q, dq, _ = arm.states(20, seed=13)
    chain, h = serial_chain(arm.robot), 1e-6
    moved = (tip_position(chain, q + h * dq) - tip_position(chain, q - h * dq)) / (2.0 * h)
    np.testing.assert_allclose(np.einsum("sij,sj->si", jacobian(chain, q)[:, :3], dq), moved, atol=1e-7)
