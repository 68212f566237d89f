"""The writing reference of the RRR arm: its joints lead the tip along the letters, exactly, within the arm's limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.dynamics.body import Array
from pipelines.errors import UsageError
from pipelines.io.robot import RobotDescription
from pipelines.io.robot_files import load_robot
from pipelines.writing.inverse_kinematics import Elbow
from pipelines.writing.path import Page
from pipelines.writing.task import WritingReference, WritingTask, demands, writing_task
from pipelines.writing.timing import Pace
from sample_logs.make_model import synthetic_arm
from tests.dynamics.serial_arms import ARMS
from tests.writing.judge import OFFSETS, WEIGHTS, TipJudge

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


def spread(task: WritingTask, samples: int) -> Array:
    """Random times of the task, none within half a millisecond of a corner, a bend or the end of a phase."""
    t = np.sort(np.random.default_rng(5).uniform(0.0, task.duration, samples))
    jumps = np.concatenate([task.passings("corner"), task.passings("bend"), task.rest + task.law.start])
    return t[np.abs(t[:, None] - jumps).min(axis=1) > 5e-4]


@pytest.mark.parametrize("elbow", ["up", "down"])
def test_an_iterative_solution_agrees(robot: RobotDescription, judge: TipJudge, elbow: Elbow) -> None:
    """Pinocchio and Newton's method, from sample to sample, find the same joints to 1e-10 rad. Section III.B."""
    reference = writing_task(robot, TEXT, Page(height=0.1), elbow=elbow).sampled(2e-3)
    q = reference.motion.q
    assert np.abs(judge.inverse(reference.tip.position, q[0]) - q).max() <= 1e-10
    assert np.abs(judge.tip(q) - reference.tip.position).max() <= 1e-14


def test_the_elbow_is_up_or_down(robot: RobotDescription) -> None:
    """With the elbow up it stands above the line from the shoulder to the tip, with the elbow down below."""
    for elbow, above in (("up", 1.0), ("down", -1.0)):
        reference = writing_task(robot, "AB", elbow=elbow).sampled(0.01)  # type: ignore[arg-type]
        q2, tip = reference.motion.q[:, 1], reference.tip.position
        reach = np.sqrt(tip[:, 0]**2 + tip[:, 1]**2 - 0.259**2)
        height = 0.2 * np.sin(q2) - (tip[:, 2] - 0.56) / reach * 0.2 * np.cos(q2)
        assert (above * height > 0).all()


@pytest.mark.parametrize("slow", [0.0, 0.05])
def test_speeds_and_accelerations_are_derivatives(robot: RobotDescription, slow: float) -> None:
    """dq and ddq against eighth-order differences of q and dq: 1e-6 relative to the largest, joint by joint."""
    task, h = writing_task(robot, TEXT, Page(height=0.1), Pace(slow=slow)), 2e-5
    t = spread(task, 4000)
    motion = task.motion(t)
    there = [task.motion(t + k * h) for k in OFFSETS]
    for mine, theirs in ((motion.dq, [m.q for m in there]), (motion.ddq, [m.dq for m in there])):
        differences = sum(w * x for w, x in zip(WEIGHTS, theirs, strict=True)) / h
        assert (np.abs(differences - mine).max(axis=0) <= 1e-6 * np.abs(mine).max(axis=0)).all()


def test_pinocchio_sees_the_tip_move_as_the_letters_ask(judge: TipJudge, reference: WritingReference) -> None:
    """Velocity and acceleration of the tip from q, dq, ddq are those of the path and its time law."""
    rows = slice(None, None, 7)
    motion, tip = reference.motion, reference.tip
    velocity, acceleration = judge.rates(motion.q[rows], motion.dq[rows], motion.ddq[rows])
    assert np.abs(velocity - tip.velocity[rows]).max() <= 1e-12
    assert np.abs(acceleration - tip.acceleration[rows]).max() <= 1e-11


def test_it_starts_and_ends_at_rest(task: WritingTask, reference: WritingReference) -> None:
    """Half a second at rest at both ends, and in every corner; v of eq. (9) has fast and slow phases."""
    motion = reference.motion
    still = (motion.t <= 0.5) | (motion.t >= motion.t[-1] - 0.4985)
    assert (motion.dq[still] == 0.0).all()
    assert (motion.ddq[still] == 0.0).all()
    assert not reference.drawn[still].any()
    assert np.abs(task.motion(task.passings("corner")).dq).max() <= 1e-12
    assert reference.tip.speed.max() == pytest.approx(task.pace.fast, rel=1e-12)


def test_what_jumps_where_the_tip_passes_a_bend(robot: RobotDescription, task: WritingTask) -> None:
    """In corners nothing jumps; in bends the tip's acceleration by slow²/radius at most; with slow = 0 nothing does."""
    def jump(task: WritingTask, t: Array) -> Array:
        return np.linalg.norm(task.tip(t + 1e-9).acceleration - task.tip(t - 1e-9).acceleration, axis=1)

    smallest = min(piece.radius for piece in task.path.pieces)
    assert len(task.passings("bend")) > 10
    assert jump(task, task.passings("corner")).max() <= 1e-6
    assert 1e-3 < jump(task, task.passings("bend")).max() <= 2 * task.pace.slow**2 / smallest * (1 + 1e-6)
    stopping = writing_task(robot, TEXT, Page(height=0.1), Pace(slow=0.0))
    assert jump(stopping, stopping.passings("bend")).max() <= 1e-6


def test_every_sample_knows_its_letter(reference: WritingReference) -> None:
    """Letters come in the order of the text, the spaces are passed over, and each lies where it belongs."""
    seen = [int(k) for k in reference.letter[np.flatnonzero(np.diff(reference.letter, prepend=-1))]]
    assert "".join(TEXT[k] for k in seen) == TEXT.replace(" ", "")
    left = [reference.tip.position[(reference.letter == k) & reference.drawn, 0].min() for k in seen]
    assert (np.diff(left) > 0).all()


def test_the_demand_is_within_the_limits_with_a_model(robot: RobotDescription) -> None:
    """Speed, acceleration and torque of the defaults fit the paper's arm, and are worth the name of a task."""
    arm = synthetic_arm()
    found = demands(robot, writing_task(robot, "RRRID 2004").sampled(1e-3, arm).motion, arm)
    assert {one.quantity for one in found} == {"speed", "acceleration", "torque"}
    assert max(one.share for one in found) <= 1.0
    assert max(one.share for one in found if one.quantity == "torque") > 0.5


@pytest.mark.parametrize(("text", "page", "letter", "why"), [
    ("RRRID", Page(x=0.4), "letter 5, 'D'", "farther"), ("RRRID", Page(z=1.3), "letter 1, 'R'", "farther"),
    ("I", Page(y=-0.2, z=0.96), "letter 1, 'I'", "inside the cylinder"), ("I", Page(y=-0.27), "letter 1, 'I'", "nearer"),
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


@pytest.mark.parametrize(("joint", "limits"), [(2, {"velocity": 1.0}), (3, {"acceleration": 10.0})])
def test_the_remedy_helps(robot: RobotDescription, joint: int, limits: dict[str, object]) -> None:
    """Slowed down to the share that the message names (a per cent less, for its rounding), the task is accepted."""
    slim = limited(robot, joint, **limits)
    with pytest.raises(UsageError, match="Slow the task down") as caught:
        writing_task(slim, "RRRID").sampled(1e-3)
    share = float(caught.value.remedy.split(" %")[0].split()[-1]) / 100 - 0.01
    writing_task(slim, "RRRID", pace=Pace().slowed(share)).sampled(1e-3)


@pytest.mark.parametrize("wrong", [0.0, -1e-3, float("nan"), 1.0])
def test_impossible_sample_times_are_refused(task: WritingTask, wrong: float) -> None:
    with pytest.raises(UsageError, match="sample time"):
        task.sampled(wrong)
