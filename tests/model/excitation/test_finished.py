"""What is left of a motion when its limits hold between samples too: as much as they allow, judged as it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.model.excitation.design import FINISH, Design, Effort, design, finished, landscape
from pipelines.model.excitation.outcome import excitation
from pipelines.model.excitation.task import Task, Wishes, plan_task
from pipelines.model.rigid.base import BaseArm
from pipelines.model.rigid.body import Array
from tests.model.excitation.arms import described, rrr, six_axes

STRETCHED, HANGING = (0.0, 0.0, 0.0), (0.0, -np.pi / 2, 0.0)
SHORT = replace(Wishes(), criterion="A", harmonics=(8,))


def beyond(home: tuple[float, ...], times: float) -> tuple[Task, Design, Array]:
    """A design, and the task in which its torque at joint 2 is so many times what may be asked of it; and its point there."""
    robot, wishes = rrr(), replace(SHORT, home=home)
    task = plan_task(robot, described(robot), wishes)
    found = design(task, Effort(evaluations=300), 1)
    (peak,) = [one for one in found.peaks if (one.quantity, one.joint) == ("torque", 2)]
    weaker = replace(robot.joints[1], torque=robot.joints[1].torque * peak.share / times)
    weak = replace(robot, joints=(robot.joints[0], weaker, robot.joints[2]))
    tight = plan_task(weak, described(weak), wishes)
    return tight, found, landscape(tight, 1, FINISH).space.point(found.trajectory.series)


def torque_share(task: Task, motion: Array) -> float:
    """The largest torque at joint 2 of what may be asked of it, by Newton and Euler."""
    general = BaseArm(task.robot)
    p = general.known_parameters()
    assert p is not None
    q, dq, ddq = (part.T for part in motion)
    return float(np.abs(general.torque(q, dq, ddq, p)[:, 1]).max() / (0.9 * task.robot.joints[1].torque))


@pytest.mark.slow
@pytest.mark.parametrize("times", [pytest.param(1.001, marks=pytest.mark.slow), 1.01])
def test_where_gravity_asks_for_the_torque_a_motion_stays_as_large(times: float) -> None:
    """A stretched arm needs most of its torque at rest: half a motion needs nearly as much. It is moved a little instead."""
    task, found, x = beyond(STRETCHED, times)
    finish = landscape(task, 1, FINISH)
    assert torque_share(task, finish.space.motion(finish.space.shrunk(x, 1.0 / times), 4000)) > 1.0
    kept = finished(task, finish, x, 1, 1, 0)
    assert kept.shrunk > 0.99
    assert all(peak.share <= 1.0 for peak in kept.peaks)
    motion, before = kept.trajectory.series.samples(4000), found.trajectory.series.samples(4000)
    assert 0.99 < torque_share(task, motion) <= 1.0
    assert np.abs(motion[0] - before[0]).max() < 0.02 * np.ptp(before[0])
    np.testing.assert_allclose(motion[:2, :, 0], [STRETCHED, (0.0, 0.0, 0.0)], atol=1e-9)


def test_where_speed_asks_for_the_torque_a_motion_is_made_smaller() -> None:
    """A hanging arm needs none at rest: a hundredth too much is gone when it moves that much less, and the limit is named."""
    task, _, x = beyond(HANGING, 1.01)
    kept = finished(task, landscape(task, 1, FINISH), x, 1, 1, 0)
    assert 0.97 < kept.shrunk < 1.0
    assert kept.shrunk_for == ("torque of joint 2",)
    assert all(peak.share <= 1.0 for peak in kept.peaks)


@pytest.mark.slow
def test_a_ceiling_is_that_of_the_motion_as_it_is() -> None:
    """What half of a motion does is not what the search had reached."""
    task = plan_task(rrr(), described(rrr()), replace(Wishes(), harmonics=(8,)))
    found, finish = design(task, Effort(evaluations=1500), 1), landscape(task, 1, FINISH)
    half = finished(task, finish, finish.space.shrunk(finish.space.point(found.trajectory.series), 0.5), 1, 1, 0)
    assert excitation(task, half, 1).condition_number > 3.0 >= excitation(task, found, 1).condition_number
    assert (found.reached, half.reached) == (True, False)


@pytest.mark.parametrize("room", [0.95, 0.99])
def test_six_axes_are_moved_within_every_limit(room: float) -> None:
    """Of a random motion beyond several of its limits no signal is left beyond the room; one within them is not touched."""
    robot = six_axes()
    task = plan_task(robot, described(robot), replace(Wishes(), criterion="condition", harmonics=(5,)))
    problem = landscape(task)
    x = problem.sized(problem.start(np.random.default_rng(3)), 1.04, 64.0)
    wanted = np.full(len(problem.nearness(x)), room)
    assert problem.nearness(x).max() > 1.0
    moved = problem.moved_within(x, wanted)
    assert moved is not None
    assert problem.nearness(moved).max() <= room
    assert np.linalg.norm(moved - x) < 0.2 * np.linalg.norm(x)
    np.testing.assert_array_equal(problem.moved_within(moved, wanted), moved)
