"""Other gravity, another length, a body at the tip: on arms of every kind, against Pinocchio's model altered by hand."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from pipelines.dynamics.altered import (
    carry_over,
    gravity_torque,
    standard_of,
    tip_parameters,
    with_gravity,
    with_longer_link,
)
from pipelines.dynamics.body import RigidBody
from pipelines.dynamics.rrr import rigid_body
from tests.dynamics.serial_arms import Arm, physical_links

SAMPLES = 60


def torque_of(arm: Arm) -> np.ndarray:
    """Pinocchio's, (samples, n)."""
    q, dq, ddq = arm.states(SAMPLES, 5)
    data = arm.model.createData()
    return np.array([pin.rnea(arm.model, data, *state) for state in zip(arm.offset(q), dq, ddq, strict=True)])


def fitted(body: RigidBody, arm: Arm, tau: np.ndarray) -> tuple[np.ndarray, float]:
    """Base parameters of these torques, and the largest torque that they leave."""
    y = body.regressor(*arm.states(SAMPLES, 5))
    p = np.linalg.lstsq(y.reshape(tau.size, -1), tau.ravel(), rcond=1e-11)[0]
    return p, float(np.abs(y @ p - tau).max())


@pytest.fixture
def loaded(arm: Arm) -> Arm:
    arm.load(physical_links(arm.n, np.random.default_rng(3)))
    return arm


def test_other_gravity(loaded: Arm) -> None:
    """The same base parameters carried over give the torque under tilted gravity: but for the weight that an upright joint 1
    carries, which no level arm tells and which is a sine and a cosine of its angle."""
    body = rigid_body(loaded.robot)
    p, left = fitted(body, loaded, torque_of(loaded))
    assert left < 1e-8
    other, before = np.array([3.0, -2.0, -8.5]), loaded.model.gravity.linear.copy()
    loaded.model.gravity.linear = other
    wanted = torque_of(loaded)
    loaded.model.gravity.linear = before
    tilted = with_gravity(body, other)
    q, dq, ddq = loaded.states(SAMPLES, 5)
    missed = wanted - tilted.torque(q, dq, ddq, carry_over(body, tilted) @ p)
    scale = np.abs(wanted).max()
    assert np.abs(missed[:, 1:]).max() < 1e-9 * scale
    waist = np.stack([np.sin(q[:, 0]), np.cos(q[:, 0])], axis=1)
    upright = np.allclose(loaded.robot.gravity[:2], 0.0)
    rest = missed[:, 0] - (waist @ np.linalg.lstsq(waist, missed[:, 0], rcond=None)[0] if upright else 0.0)
    assert np.abs(rest).max() < 1e-9 * scale
    assert np.abs(wanted - torque_of(loaded)).max() > 0.01 * scale
    still = np.zeros_like(q)
    weight = tilted.torque(q, still, still, carry_over(body, tilted) @ p)
    np.testing.assert_allclose(gravity_torque(body, q, standard_of(body, p), other)[:, 1:], weight[:, 1:], atol=1e-9 * scale)


def test_a_body_at_the_tip(loaded: Arm) -> None:
    """Its ten parameters, about the tip in axes of the last frame, change the base parameters as a body changes the torque."""
    body = rigid_body(loaded.robot)
    p, _ = fitted(body, loaded, torque_of(loaded))
    ten = physical_links(1, np.random.default_rng(8))
    m, mx, my, mz, xx, yy, zz, xy, xz, yz = ten
    place = pin.SE3(loaded.link_in_joint[-1].rotation, loaded.tip_in_joint.translation)
    held = place.act(pin.Inertia.FromDynamicParameters(np.array([m, mx, my, mz, xx, -xy, yy, -xz, -yz, zz])))
    loaded.model.inertias[loaded.n] = loaded.model.inertias[loaded.n] + held
    wanted = torque_of(loaded)
    found = body.torque(*loaded.states(SAMPLES, 5), p + tip_parameters(body) @ ten)
    np.testing.assert_allclose(found, wanted, atol=1e-9 * np.abs(wanted).max())


def test_a_longer_link(loaded: Arm) -> None:
    """Each link but the last, 3 cm longer: the body of the new geometry explains the torque to rounding."""
    body = rigid_body(loaded.robot)
    for link in range(1, loaded.n):
        place = loaded.model.jointPlacements[link + 1]
        before = place.translation.copy()
        length = np.linalg.norm(before)
        towards = before / length if loaded.robot.convention == "urdf" and length > 0.0 else np.array([1.0, 0.0, 0.0])
        loaded.model.jointPlacements[link + 1].translation = before + 0.03 * towards
        wanted = torque_of(loaded)
        loaded.model.jointPlacements[link + 1].translation = before
        longer = with_longer_link(body, link, 0.03)
        assert fitted(longer, loaded, wanted)[1] < 1e-9 * np.abs(wanted).max()
        p, _ = fitted(body, loaded, torque_of(loaded))
        carried = longer.torque(*loaded.states(SAMPLES, 5), carry_over(body, longer) @ p)
        assert fitted(longer, loaded, carried)[1] < 1e-9 * np.abs(wanted).max()
    with pytest.raises(ValueError, match="no joint beyond"):
        with_longer_link(body, loaded.n, 0.01)
