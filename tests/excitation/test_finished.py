"""A motion whose limits hold between samples too: as large as they allow, judged as it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.excitation.discrimination import Found
from pipelines.excitation.optimise import Effort, design, final_problem, finished
from pipelines.excitation.result import judged
from pipelines.excitation.task import Wishes, plan_task
from tests.excitation.arms import described, rrr

STRETCHED, HANGING = (0.0, 0.0, 0.0), (0.0, -np.pi / 2, 0.0)
SHORT = replace(Wishes(), criterion="A", harmonics=(8,))


@pytest.mark.parametrize("home", [STRETCHED, HANGING])
def test_the_search_leaves_room_for_what_lies_between_samples(home: tuple[float, ...]) -> None:
    """Where gravity asks for the torque as well, a stretched arm: nearly nothing has to be made smaller."""
    task = plan_task(rrr(), described(rrr()), replace(SHORT, home=home))
    found = design(task, Effort(evaluations=800), 1)
    assert found.shrunk > 0.997
    assert 0.99 < max(peak.share for peak in found.peaks) <= 1.0


def test_where_speed_asks_for_the_torque_a_motion_is_made_smaller() -> None:
    """A hanging arm needs none at rest: a hundredth too much is gone when it moves that much less, and the limit is named."""
    robot, wishes = rrr(), replace(SHORT, home=HANGING)
    task = plan_task(robot, described(robot), wishes)
    found = design(task, Effort(evaluations=300), 1)
    (peak,) = [one for one in found.peaks if (one.quantity, one.joint) == ("torque", 2)]
    weaker = replace(robot.joints[1], torque=robot.joints[1].torque * peak.share / 1.01)
    weak = replace(robot, joints=(robot.joints[0], weaker, robot.joints[2]))
    tight = plan_task(weak, described(weak), wishes)
    kept = finished(tight, final_problem(tight).space.point(found.trajectory.series), 1, 1, 0)
    assert 0.97 < kept.shrunk < 1.0
    assert kept.shrunk_for == ("torque of joint 2",)
    assert all(one.share <= 1.0 for one in kept.peaks)


@pytest.mark.slow
def test_a_ceiling_is_that_of_the_motion_as_it_is() -> None:
    """What half of a motion does is not what the search had reached."""
    task = plan_task(rrr(), described(rrr()), replace(Wishes(), harmonics=(8,)))
    found, space = design(task, Effort(evaluations=1500), 1), final_problem(task).space
    half = finished(task, space.shrunk(space.point(found.trajectory.series), 0.5), 1, 1, 0)
    assert judged(task, Found(half), 1).condition_number > 3.0 >= judged(task, Found(found), 1).condition_number
    assert (found.reached, half.reached) == (True, False)
