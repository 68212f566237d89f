"""A design keeps its limits when the arm follows it, not on paper alone."""

from __future__ import annotations

import signal
from dataclasses import replace

import pytest

from pipelines.errors import Interrupted
from pipelines.excitation import rehearsal as rehearsing
from pipelines.excitation.optimise import Design, Effort, design
from pipelines.excitation.rehearsal import Rehearsal, rehearsed_design
from pipelines.excitation.task import Task, Wishes, plan_task
from pipelines.io.robot import RobotDescription
from tests.excitation.arms import described, rrr

SHORT = replace(Wishes(), criterion="A", harmonics=(15,))


def designed(wishes: Wishes, robot: RobotDescription, seed: int = 1) -> tuple[Task, Design]:
    task = plan_task(robot, described(robot), wishes)
    return task, design(task, Effort(evaluations=800), seed)


def test_what_goes_beyond_a_limit_is_named() -> None:
    """Without a reserve the loop overshoots the speed limit by some per cent; torque noise of the size of the limits saturates the
    drives. The design stays as it is."""
    for wishes, quantity in ((replace(SHORT, speed_share=1.0), "speed"), (replace(SHORT, noise=(60.0, 60.0, 20.0)), "torque")):
        task, found = designed(wishes, rrr())
        kept, rehearsal, failed = rehearsed_design(task, found, 1, lambda words: None)
        assert (kept is found, failed) == (True, "")
        assert rehearsal is not None
        assert quantity in {one.quantity for one in rehearsal.beyond}


def test_who_stops_a_rehearsal_keeps_the_design(monkeypatch: pytest.MonkeyPatch) -> None:
    """As it was designed, with the exit code of the signal."""
    task, found = designed(SHORT, rrr())

    def stopped(*given: object) -> Rehearsal:
        raise Interrupted(signal.SIGINT)

    monkeypatch.setattr(rehearsing, "rehearse", stopped)
    kept, rehearsal, failed = rehearsed_design(task, found, 1, lambda words: None)
    assert kept.trajectory is found.trajectory
    assert (kept.stopped, rehearsal, failed) == (130, None, "")
