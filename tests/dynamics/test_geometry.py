"""Frames of the three conventions against products of elementary transforms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipelines.dynamics.kinematics import forward_kinematics, serial_chain
from pipelines.errors import InputRejected
from pipelines.io.robot import Joint, RobotDescription
from pipelines.io.robot_files import load_robot
from tests.dynamics.serial_arms import GANTRY, PUMA, SEVEN, STANFORD, table


def _turn(axis: str, angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    i, j = {"x": (1, 2), "z": (0, 1)}[axis]
    t = np.eye(4)
    t[i, i] = t[j, j] = c
    t[i, j], t[j, i] = -s, s
    return t


def _shift(x: float, z: float) -> np.ndarray:
    t = np.eye(4)
    t[0, 3], t[2, 3] = x, z
    return t


def _frames(robot: RobotDescription, q: np.ndarray) -> list[np.ndarray]:
    """0T_1, 0T_2, … as the textbooks write them, 4 x 4."""
    t, frames = np.eye(4), []
    for joint, value in zip(robot.joints, q, strict=True):
        moved = value + joint.offset
        theta, d = (moved, joint.d) if joint.revolute else (0.0, joint.d + moved)
        if robot.convention == "dh":
            t = t @ _turn("z", theta) @ _shift(0.0, d) @ _shift(joint.a, 0.0) @ _turn("x", joint.alpha)
        else:
            t = t @ _turn("x", joint.alpha) @ _shift(joint.a, 0.0) @ _turn("z", theta) @ _shift(0.0, d)
        frames.append(t)
    return frames


@pytest.mark.parametrize(("convention", "rows"), [("dh", SEVEN), ("dh", STANFORD), ("mdh", PUMA), ("mdh", GANTRY)])
def test_frames_are_the_textbooks_products(convention: str, rows: list[tuple[str, float, float, float, float]]) -> None:
    """Every link frame is the product of the convention's elementary transforms, offsets and shifts included."""
    robot = table("arm", convention, rows)
    q = np.random.default_rng(1).uniform(-3.0, 3.0, (20, len(rows)))
    ours = forward_kinematics(serial_chain(robot), q)
    for k in range(20):
        theirs = np.array(_frames(robot, q[k]))
        np.testing.assert_allclose(ours.rotation[k], theirs[:, :3, :3], atol=1e-14)
        np.testing.assert_allclose(ours.position[k], theirs[:, :3, 3], atol=1e-14)


def test_tip_of_the_paper_is_eq_A2() -> None:
    """The RRR arm stretched forwards reaches a2 + a3 ahead and d2 + d3 aside, at the height of its shoulder."""
    tip = forward_kinematics(serial_chain(load_robot("rrr")), np.zeros((1, 3))).tip[0]
    np.testing.assert_allclose(tip, [0.615, -0.259, 0.56], atol=1e-15)


_ONE = ('<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="revolute"><parent link="a"/>'
        '<child link="b"/></joint></robot>')


@pytest.mark.parametrize(("joints", "code"), [((Joint("j"), Joint("k")), "RRID-S02"),
                                              ((Joint("j", "prismatic"),), "RRID-C02")])
def test_a_description_that_contradicts_its_urdf_is_refused(joints: tuple[Joint, ...], code: str) -> None:
    """A log whose joint list disagrees in number or type with the URDF it carries is rejected by name."""
    robot = RobotDescription("r", (0.0, 0.0, -9.81), "urdf", joints, urdf_text=_ONE)
    with pytest.raises(InputRejected) as caught:
        serial_chain(robot)
    assert caught.value.code == code
