"""A design keeps its limits when the arm follows it, not on paper alone."""

from __future__ import annotations

import math
import signal
from dataclasses import replace

import numpy as np
import pytest

from pipelines.errors import Interrupted
from pipelines.io.robot import RobotDescription
from pipelines.model.excitation import rehearse as rehearsing
from pipelines.model.excitation.design import Design, Effort, design
from pipelines.model.excitation.rehearse import Rehearsal, rehearse, rehearsed_design
from pipelines.model.excitation.task import Task, Wishes, plan_task
from tests.model.excitation.arms import described, rrr

SHORT = replace(Wishes(), criterion="A", harmonics=(15,))


def designed(wishes: Wishes, robot: RobotDescription, seed: int = 1) -> tuple[Task, Design]:
    task = plan_task(robot, described(robot), wishes)
    return task, design(task, Effort(evaluations=200), seed)


def plain(task: Task, found: Design) -> Rehearsal:
    """The whole motion in simulation, as it stands."""
    assert task.arm is not None
    _, motion = found.trajectory.sampled(task.sample_time)
    return rehearse(task.arm, task.sample_time, motion, task.problem.goal.noise, 1, np.inf)


@pytest.mark.parametrize("rest", [pytest.param(True, marks=pytest.mark.slow), False])
def test_a_plan_at_its_speed_limit_is_made_as_small_as_its_rehearsal_asks(rest: bool) -> None:
    """Without a reserve the loop overshoots by some per cent; so much smaller the motion is, and no more."""
    task, found = designed(replace(SHORT, speed_share=1.0, rest=rest), rrr())
    before = plain(task, found)
    assert {one.quantity for one in before.beyond} == {"speed"}
    overshoot = max(1.0 + one.by for one in before.beyond)
    kept, rehearsal, failed = rehearsed_design(task, found, 1, lambda words: None)
    assert failed == ""
    assert rehearsal is not None
    assert rehearsal.safe
    assert 0.98 < kept.shrunk / found.shrunk * overshoot <= 1.0
    assert plain(task, kept).safe
    assert all(peak.share <= 1.0 for peak in kept.peaks)


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))])
def test_the_reserve_is_what_an_overshoot_takes(seed: int) -> None:
    """A plan to 95 % of the speed limit, which it uses to the full, is followed within the limit: nothing is made smaller."""
    task, found = designed(SHORT, rrr(), seed)
    assert max(peak.share for peak in found.peaks if peak.quantity == "speed") > 0.999
    kept, rehearsal, _ = rehearsed_design(task, found, seed, lambda words: None)
    assert kept is found
    assert rehearsal is not None
    assert 0.95 < max(np.divide(rehearsal.speed_peak, rehearsal.speed_limit)) <= 1.0


@pytest.mark.slow
def test_a_range_is_kept_by_the_arm_as_by_the_plan() -> None:
    """Joints that may turn by a radian each way of the horizontal: sagging, the shoulder leaves the range that a plan uses up."""
    task, found = designed(replace(SHORT, home=(0.0, -0.3, 0.0)), rrr(position=(-1.0, 1.0)))  # type: ignore[arg-type]
    before = plain(task, found)
    assert "position" in {one.quantity for one in before.beyond}
    kept, rehearsal, _ = rehearsed_design(task, found, 1, lambda words: None)
    assert rehearsal is not None
    assert rehearsal.safe
    assert rehearsal.position_beyond is not None
    assert -0.02 < max(rehearsal.position_beyond) <= 0.0
    assert 0.9 < kept.shrunk <= 1.0


def test_without_a_model_nothing_is_rehearsed() -> None:
    task = plan_task(rrr(), None, SHORT)
    found = design(task, Effort(evaluations=100), 1)
    assert rehearsed_design(task, found, 1, lambda words: None) == (found, None, "")


@pytest.mark.slow
def test_a_range_open_on_one_side_is_kept_by_as_little_less() -> None:
    """A shoulder that stands a tenth of a radian from the one end of its range, and sags past it by a tenth of that: it is made
    smaller about where it stands, by a tenth."""
    robot = rrr()
    joints = (robot.joints[0], replace(robot.joints[1], position=(-1.0, math.inf)), robot.joints[2])
    task, found = designed(replace(SHORT, home=(0.0, -0.9, 0.0)), replace(robot, joints=joints))
    before = plain(task, found)
    (past,) = [one for one in before.beyond if one.quantity == "position"]
    assert before.position_nearest is not None
    assert past.by == pytest.approx(-1.0 - before.position_nearest[1])
    kept, rehearsal, _ = rehearsed_design(task, found, 1, lambda words: None)
    assert rehearsal is not None
    assert rehearsal.safe
    assert rehearsal.position_beyond is not None
    assert -0.002 < rehearsal.position_beyond[1] <= 0.0
    assert kept.shrunk / found.shrunk == pytest.approx(1.0 - past.by / 0.1, abs=0.03)


@pytest.mark.parametrize("rest", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_what_no_smaller_motion_mends_stays_as_large_as_it_is(rest: bool) -> None:
    """Torque noise of the size of the limits saturates the drives at a standstill as well: two rehearsals show that, not six."""
    task, found = designed(replace(SHORT, noise=(60.0, 60.0, 20.0), rest=rest), rrr())
    told: list[str] = []
    kept, rehearsal, failed = rehearsed_design(task, found, 1, told.append)
    assert kept is found
    assert rehearsal is not None
    assert rehearsal.torque_peak == plain(task, found).torque_peak
    assert {one.quantity for one in rehearsal.beyond} >= {"torque"}
    assert failed == ""
    assert len(told) == 2


@pytest.mark.slow
def test_of_several_periods_one_is_rehearsed_with_the_way_in_and_out() -> None:
    task, found = designed(replace(SHORT, rest=False, periods=3), rrr())
    _, rehearsal, _ = rehearsed_design(task, found, 1, lambda words: None)
    assert rehearsal is not None
    once = replace(found, trajectory=replace(found.trajectory, periods=1))
    assert rehearsal.position_nearest == plain(task, once).position_nearest
    assert rehearsal.seconds == pytest.approx(10.0 + 2.0 * found.trajectory.run_in, abs=2e-3)


@pytest.mark.parametrize("nth", [1, 2])
def test_who_stops_a_rehearsal_keeps_the_design(nth: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """As it was designed, with what the rehearsal before that did, and the exit code of the signal."""
    task, found = designed(replace(SHORT, speed_share=1.0), rrr())
    count = 0

    def stopped(*given: object) -> Rehearsal:
        nonlocal count
        count += 1
        if count == nth:
            raise Interrupted(signal.SIGINT)
        return rehearse(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(rehearsing, "rehearse", stopped)
    kept, rehearsal, failed = rehearsed_design(task, found, 1, lambda words: None)
    assert kept.trajectory is found.trajectory
    assert (kept.stopped, failed) == (130, "")
    assert (rehearsal is None) == (nth == 1)
