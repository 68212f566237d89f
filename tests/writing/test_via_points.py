"""Random via points: every move at rest at its ends, within all limits, and as fast as the drives allow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.dynamics.arm import Arm
from pipelines.errors import UsageError
from pipelines.io.robot import RobotDescription
from pipelines.io.robot_files import load_robot
from pipelines.writing.task import demands
from pipelines.writing.via_points import ViaPoints, via_points
from sample_logs.make_model import synthetic_arm


@pytest.fixture(scope="module")
def robot() -> RobotDescription:
    return load_robot("rrr")


@pytest.fixture(scope="module")
def arm() -> Arm:
    return synthetic_arm()


@pytest.fixture(scope="module")
def points(robot: RobotDescription, arm: Arm) -> ViaPoints:
    return via_points(robot, np.random.default_rng(2), moves=8, arm=arm, authority=0.9)


def test_every_move_uses_the_full_authority(robot: RobotDescription, arm: Arm, points: ViaPoints) -> None:
    """In each move some joint comes to 90 % of its limit of speed, acceleration or torque, and none beyond."""
    start = points.rest
    for seconds in points.seconds:
        t = np.linspace(start, start + seconds, 4001)
        share = max(one.share for one in demands(robot, points.at(t), arm))
        assert 0.9 * (1 - 1e-3) <= share <= 0.9 * (1 + 2e-3)
        start += seconds + points.rest


def test_it_rests_at_every_via_point(points: ViaPoints) -> None:
    """At each posture for the rest, and continuous in between: position, speed and acceleration."""
    ends = np.cumsum(points.seconds + points.rest)
    for k, t in enumerate([0.0, *ends.tolist()]):
        motion = points.at(t + np.linspace(0.0, points.rest, 5))
        assert np.abs(motion.q - points.q[k]).max() <= 1e-12
        assert np.abs(motion.dq).max() <= 1e-9
        assert np.abs(motion.ddq).max() <= 1e-6


def test_postures_lie_within_the_ranges(robot: RobotDescription) -> None:
    """A joint with a range stays in it, in the moves too; one without within half a turn; equal seeds give equal motions."""
    narrow = replace(robot, joints=(replace(robot.joints[0], position=(-0.5, 0.2)), *robot.joints[1:]))
    motion = via_points(narrow, np.random.default_rng(3), moves=30).sampled(1e-3)
    assert motion.q[:, 0].min() >= -0.5
    assert motion.q[:, 0].max() <= 0.2
    assert np.abs(motion.q[:, 1:]).max() <= np.pi
    assert np.ptp(motion.q[:, 1]) > np.pi
    again = via_points(narrow, np.random.default_rng(3), moves=30).sampled(1e-3)
    assert again.q.tobytes() == motion.q.tobytes()


def test_drives_too_weak_for_the_arm_are_named(robot: RobotDescription, arm: Arm) -> None:
    weak = replace(robot, joints=(*robot.joints[:1], replace(robot.joints[1], torque=2.0), robot.joints[2]))
    with pytest.raises(UsageError, match="cannot carry the arm's own weight"):
        via_points(weak, np.random.default_rng(1), arm=arm)
