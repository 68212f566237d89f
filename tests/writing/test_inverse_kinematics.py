"""Writing with arms that have no closed form: four to seven joints, turning and sliding, DH, modified DH and URDF."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipelines.dynamics.kinematics import serial_chain
from pipelines.dynamics.rrr_kinematics import rrr_geometry
from pipelines.errors import UsageError
from pipelines.writing.inverse_kinematics import ClosedForm, Numerical
from pipelines.writing.path import Page
from pipelines.writing.task import WritingTask, writing_task
from pipelines.writing.timing import Pace
from tests.dynamics.serial_arms import ARMS, Arm
from tests.writing.judge import OFFSETS, WEIGHTS, TipJudge

POSTURES = {"tx40": (0.2, 0.4, 0.4, 0.1, 0.5, 0.0), "seven-joints": (0.3, 0.6, 0.2, -1.2, 0.3, 0.8, 0.0),
            "stanford": (0.2, 1.2, 0.2, 0.3, 0.5, 0.2), "puma-mdh": (0.1, -0.5, 0.6, 0.2, 0.5, 0.1),
            "gantry-mdh": (0.1, 0.2, 1.3, 0.2, 0.8), "skew-urdf": (0.1, 0.1, 0.3, 0.5)}
SLOWLY = Pace(fast=0.3, acceleration=3.0, jerk=100.0)


@pytest.fixture(scope="module", params=list(POSTURES))
def written(request: pytest.FixtureRequest, shared: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Arm, WritingTask]:
    """An arm, and a text in front of its tip."""
    arm = ARMS[request.param](shared, tmp_path_factory.mktemp("urdf"))
    posture = POSTURES[request.param]
    x, y, z = TipJudge(arm).tip(np.array([posture]))[0]
    return arm, writing_task(arm.robot, "AB 2", Page(y=y, x=x, z=z, height=0.05), SLOWLY, posture=posture)


def test_pinocchio_sees_the_letters(written: tuple[Arm, WritingTask]) -> None:
    """Tip, velocity and acceleration that Pinocchio computes from the joints are those of the path."""
    arm, task = written
    t = np.linspace(0.0, task.duration, 500)
    motion, tip, judge = task.motion(t), task.tip(t), TipJudge(arm)
    velocity, acceleration = judge.rates(motion.q, motion.dq, motion.ddq)
    assert np.abs(judge.tip(motion.q) - tip.position).max() <= 1e-12
    assert np.abs(velocity - tip.velocity).max() <= 1e-11
    assert np.abs(acceleration - tip.acceleration).max() <= 1e-10


def test_speeds_and_accelerations_are_derivatives(written: tuple[Arm, WritingTask]) -> None:
    """Of arms with joints to spare too: q is a function of the tip alone. Eighth-order differences, 1e-6 relative."""
    _, task = written
    h = 2e-5
    t = np.sort(np.random.default_rng(6).uniform(0.0, task.duration, 600))
    t = t[np.abs(t[:, None] - np.concatenate([task.passings("corner"), task.passings("bend")])).min(axis=1) > 5e-4]
    motion = task.motion(t)
    there = [task.motion(t + k * h) for k in OFFSETS]
    for mine, theirs in ((motion.dq, [m.q for m in there]), (motion.ddq, [m.dq for m in there])):
        differences = sum(w * x for w, x in zip(WEIGHTS, theirs, strict=True)) / h
        assert np.abs(differences - mine).max() <= 1e-6 * np.abs(mine).max()


def test_the_numerical_inverse_agrees_with_the_closed_form(shared: Path, tmp_path: Path) -> None:
    """The RRR arm by both, started near the branch: the same joints to 1e-10 rad, speeds and accelerations likewise."""
    arm = ARMS["rrr"](shared, tmp_path)
    t = np.linspace(0.0, 9.0, 2000)
    task = writing_task(arm.robot, "RRRID")
    tip = task.tip(t)
    signals = (tip.position, tip.velocity, tip.acceleration)
    exact = ClosedForm(rrr_geometry(arm.robot)).motion(*signals)
    assert isinstance(exact, tuple)
    found = Numerical(serial_chain(arm.robot), exact[0][0] + [0.1, -0.1, 0.2]).motion(*signals)
    assert isinstance(found, tuple)
    for mine, theirs in zip(exact, found, strict=True):
        assert np.abs(mine - theirs).max() <= 1e-10 * max(1.0, np.abs(mine).max())


def test_out_of_reach_is_refused(shared: Path, tmp_path: Path) -> None:
    """Half a metre above all that the arm can reach; the letter and the place are named."""
    robot = ARMS["tx40"](shared, tmp_path).robot
    with pytest.raises(UsageError, match=r"out of reach") as caught:
        writing_task(robot, "A", Page(y=0.0, x=0.3, z=1.3), posture=POSTURES["tx40"]).sampled(1e-2)
    assert "letter 1, 'A', of 'A', tip at (" in caught.value.where


def test_a_singular_posture_is_refused(shared: Path, tmp_path: Path) -> None:
    """The TX40 with its elbow all but stretched: within reach, but joint speeds would be fifty times those elsewhere."""
    arm = ARMS["tx40"](shared, tmp_path)
    stretched = (0.2, 0.4, 1.5, 0.0, 0.0, 0.0)
    x, y, z = TipJudge(arm).tip(np.array([stretched]))[0]
    with pytest.raises(UsageError, match="singular or nearly so") as caught:
        writing_task(arm.robot, "I", Page(y=y, x=x, z=z, height=1e-5), posture=stretched).sampled(1e-2)
    assert "letter 1, 'I'" in caught.value.where
