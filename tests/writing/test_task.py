"""The writing reference of the RRR arm: its joints lead the tip along the letters, exactly, within the arm's limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.errors import UsageError
from pipelines.io.robot import RobotDescription
from pipelines.io.robot_files import load_robot
from pipelines.writing.path import Page
from pipelines.writing.task import Elbow, WritingReference, WritingTask, demands, writing_task
from sample_logs.make_model import synthetic_arm
from tests.dynamics.serial_arms import ARMS
from tests.writing.judge import TipJudge

TEXT = "RRRID 2004 SG"


@pytest.fixture(scope="module")
def robot() -> RobotDescription:
    return load_robot("rrr")


@pytest.fixture(scope="module")
def judge(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> TipJudge:
    return TipJudge(ARMS["rrr"](shared, tmp_path_factory.mktemp("rrr")))


@pytest.fixture(scope="module")
def task(robot: RobotDescription) -> WritingTask:
    return writing_task(robot, TEXT, Page(height=0.1))


@pytest.fixture(scope="module")
def reference(task: WritingTask) -> WritingReference:
    return task.sampled(1e-3)


@pytest.mark.parametrize("elbow", ["up", "down"])
def test_an_iterative_solution_agrees(robot: RobotDescription, judge: TipJudge, elbow: Elbow) -> None:
    """Pinocchio and Newton's method, from sample to sample, find the same joints to 1e-10 rad. Section III.B."""
    reference = writing_task(robot, TEXT, Page(height=0.1), elbow=elbow).sampled(2e-3)
    q = reference.motion.q
    assert np.abs(judge.inverse(reference.tip.position, q[0]) - q).max() <= 1e-10
    assert np.abs(judge.tip(q) - reference.tip.position).max() <= 1e-14


def test_pinocchio_sees_the_tip_move_as_the_letters_ask(judge: TipJudge, reference: WritingReference) -> None:
    """Velocity and acceleration of the tip from q, dq, ddq are those of the path and its time law."""
    rows = slice(None, None, 7)
    motion, tip = reference.motion, reference.tip
    velocity, acceleration = judge.rates(motion.q[rows], motion.dq[rows], motion.ddq[rows])
    assert np.abs(velocity - tip.velocity[rows]).max() <= 1e-12
    assert np.abs(acceleration - tip.acceleration[rows]).max() <= 1e-11


def test_it_starts_and_ends_at_rest(task: WritingTask, reference: WritingReference) -> None:
    """Half a second at rest at both ends; v of eq. (9) reaches the pace."""
    motion = reference.motion
    still = (motion.t <= 0.5) | (motion.t >= motion.t[-1] - 0.4985)
    assert (motion.dq[still] == 0.0).all()
    assert (motion.ddq[still] == 0.0).all()
    assert not reference.drawn[still].any()
    assert reference.tip.speed.max() == pytest.approx(task.pace.fast, rel=1e-12)


def test_the_demand_is_within_the_limits_with_a_model(robot: RobotDescription) -> None:
    """Speed, acceleration and torque of the defaults fit the paper's arm, and are worth the name of a task."""
    arm = synthetic_arm()
    found = demands(robot, writing_task(robot, "RRRID 2004").sampled(1e-3, arm).motion, arm)
    assert {one.quantity for one in found} == {"speed", "acceleration", "torque"}
    assert max(one.share for one in found) <= 1.0
    assert max(one.share for one in found if one.quantity == "torque") > 0.5


@pytest.mark.parametrize(("text", "page", "letter", "why"), [
    ("RRRID", Page(x=0.4), "letter 5, 'D'", "farther"), ("RRRID", Page(z=1.3), "letter 1, 'R'", "farther"),
    ("RRRID", Page(y=-0.262, z=0.96, height=0.02), "letter 1, 'R'", "within 5 mm of a posture that is singular: the tip touches"),
    ("I", Page(y=-0.338, height=0.02), "letter 1, 'I'", "within 5 mm of a posture that is singular: the elbow")])
def test_out_of_reach_is_refused(robot: RobotDescription, text: str, page: Page, letter: str, why: str) -> None:
    """The letter, the place and the reason are named: outside the workspace, inside its cylinder, folded, near a singularity."""
    with pytest.raises(UsageError, match=why) as caught:
        writing_task(robot, text, page).sampled(1e-3)
    assert caught.value.code == "RRID-C02"
    assert letter in caught.value.where
    assert "tip at (" in caught.value.where


def limited(robot: RobotDescription, joint: int, **limits: object) -> RobotDescription:
    joints = list(robot.joints)
    joints[joint - 1] = replace(joints[joint - 1], **limits)  # type: ignore[arg-type]
    return replace(robot, joints=tuple(joints))


@pytest.mark.parametrize(("joint", "limits", "words"), [
    (2, {"velocity": 1.0}, ["speed", "its limit is 1 rad/s"]), (3, {"acceleration": 10.0}, ["acceleration", "limit is 10 rad/s^2"]),
    (2, {"torque": 15.0}, ["torque", "limit is 15 N m"]), (1, {"position": (-1.0, 1.0)}, ["range", "-1.000 to 1.000 rad"])])
def test_beyond_a_limit_is_refused(robot: RobotDescription, joint: int, limits: dict[str, object], words: Sequence[str]) -> None:
    """The joint, the letter, the place and the limit are named."""
    with pytest.raises(UsageError) as caught:
        writing_task(limited(robot, joint, **limits), "RRRID").sampled(1e-3, synthetic_arm())
    assert caught.value.code == "RRID-C02"
    assert "letter " in caught.value.where
    assert "tip at (" in caught.value.where
    assert all(word in caught.value.message for word in (f"joint {joint}, {robot.joints[joint - 1].name}", *words))
