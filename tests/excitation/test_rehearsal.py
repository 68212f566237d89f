"""A design keeps its limits when the arm follows it, not on paper alone."""

from __future__ import annotations

import signal
from dataclasses import replace

import numpy as np
import pytest

from pipelines.errors import Interrupted
from pipelines.excitation import rehearsal as rehearsing
from pipelines.excitation.optimise import Design, Effort, design
from pipelines.excitation.rehearsal import Rehearsal, rehearse, rehearsed_design
from pipelines.excitation.task import Task, Wishes, plan_task
from pipelines.io.robot import RobotDescription
from tests.excitation.arms import described, rrr

SHORT = replace(Wishes(), criterion="A", harmonics=(15,))


def designed(wishes: Wishes, robot: RobotDescription, seed: int = 1) -> tuple[Task, Design]:
    task = plan_task(robot, described(robot), wishes)
    return task, design(task, Effort(evaluations=800), seed)


def plain(task: Task, found: Design) -> Rehearsal:
    """The whole motion in simulation, as it stands."""
    assert task.arm is not None
    _, motion = found.trajectory.sampled(task.sample_time)
    return rehearse(task.arm, task.sample_time, motion, task.problem.goal.noise, 1)


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))])
def test_the_reserve_is_what_an_overshoot_takes(seed: int) -> None:
    """A plan to 95 % of the speed limit, which it uses to the full, is followed within the limit: nothing is made smaller."""
    task, found = designed(SHORT, rrr(), seed)
    assert max(peak.share for peak in found.peaks if peak.quantity == "speed") > 0.99
    kept, rehearsal, _ = rehearsed_design(task, found, seed, lambda words: None)
    assert kept is found
    assert rehearsal is not None
    assert 0.95 < max(np.divide(rehearsal.speed_peak, rehearsal.speed_limit)) <= 1.0


def test_without_a_model_nothing_is_rehearsed() -> None:
    task = plan_task(rrr(), None, SHORT)
    found = design(task, Effort(evaluations=100), 1)
    assert rehearsed_design(task, found, 1, lambda words: None) == (found, None, "")


@pytest.mark.slow
def test_of_several_periods_one_is_rehearsed_with_the_way_in_and_out() -> None:
    task, found = designed(replace(SHORT, rest=False, periods=3), rrr())
    _, rehearsal, _ = rehearsed_design(task, found, 1, lambda words: None)
    assert rehearsal is not None
    once = replace(found, trajectory=replace(found.trajectory, periods=1))
    assert rehearsal.position_nearest == plain(task, once).position_nearest
    assert rehearsal.seconds == pytest.approx(10.0 + 2.0 * found.trajectory.run_in, abs=2e-3)


def test_what_goes_beyond_a_limit_is_named() -> None:
    """Without a reserve the loop overshoots the speed limit by some per cent; torque noise of the size of the limits saturates the
    drives. The design stays as it is."""
    for wishes, quantity in ((replace(SHORT, speed_share=1.0), "speed"), (replace(SHORT, noise=(60.0, 60.0, 20.0)), "torque")):
        task, found = designed(wishes, rrr())
        kept, rehearsal, failed = rehearsed_design(task, found, 1, lambda words: None)
        assert (kept is found, failed) == (True, "")
        assert rehearsal is not None
        assert quantity in {one.quantity for one in rehearsal.beyond}


def test_a_joint_that_sags_leaves_its_range() -> None:
    """A shoulder held a ten-thousandth of a radian above the lower end of its range: under its weight it goes beyond."""
    arm = described(rrr(position=(-0.3001, 1.0)))  # type: ignore[arg-type]
    motion = np.zeros((3, 3, 500))
    motion[0, 1] = -0.3
    rehearsal = rehearse(arm, 1e-3, motion, np.zeros(3), 1)
    assert rehearsal.position_nearest is not None
    (past,) = [one for one in rehearsal.beyond if (one.joint, one.quantity) == (1, "position")]
    assert past.by == pytest.approx(-0.3001 - rehearsal.position_nearest[1])
    assert past.by > 1e-3


def test_who_stops_a_rehearsal_keeps_the_design(monkeypatch: pytest.MonkeyPatch) -> None:
    """As it was designed, with the exit code of the signal."""
    task, found = designed(SHORT, rrr())

    def stopped(*given: object) -> Rehearsal:
        raise Interrupted(signal.SIGINT)

    monkeypatch.setattr(rehearsing, "rehearse", stopped)
    kept, rehearsal, failed = rehearsed_design(task, found, 1, lambda words: None)
    assert kept.trajectory is found.trajectory
    assert (kept.stopped, rehearsal, failed) == (130, None, "")
