"""A design is changed until it separates two causes; where that gains nothing, it stays the plain design."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipelines.effects.angle import Spring
from pipelines.effects.friction import TorqueOffset
from pipelines.excitation import discrimination as telling
from pipelines.excitation.discrimination import Pair, best
from pipelines.excitation.optimise import Design, Effort, design, final_problem, finished
from pipelines.excitation.task import Task, Wishes, plan_task
from tests.excitation.arms import described, rrr

PAIR = Pair(Spring(joint=2), TorqueOffset(joint=2))
EFFORT = Effort(evaluations=200)


@pytest.fixture(scope="module")
def task() -> Task:
    return plan_task(rrr(), described(rrr()), replace(Wishes(), harmonics=(8,)))


@pytest.fixture(scope="module")
def plain(task: Task) -> Design:
    return design(task, EFFORT, 1)


def halved(task: Task, found: Design) -> Design:
    space = final_problem(task).space
    return finished(task, space.shrunk(space.point(found.trajectory.series), 0.5), 1, 1, found.stopped)


def test_causes_are_less_alike_within_the_ceiling(task: Task, plain: Design) -> None:
    """Less alike than in the plain design, within the ceiling, and safe in simulation."""
    found = best(task, PAIR, EFFORT, 1, rehearse=True)
    assert found.apart is not None
    assert found.apart.changed
    assert found.rehearsal is not None
    assert found.rehearsal.safe
    assert found.design.reached
    assert found.apart.after.score < found.apart.before.score
    assert found.apart.after.condition_number <= 3.0 * (1.0 + 1e-6)
    assert found.design.trajectory.series.cosine.tobytes() != plain.trajectory.series.cosine.tobytes()


def test_where_nothing_is_better_it_is_the_plain_design(task: Task, plain: Design, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(telling, "finished", lambda task, *given: halved(task, plain))
    after, apart = telling.told_apart(task, plain, PAIR, EFFORT, 1)
    assert after.trajectory is plain.trajectory
    assert (apart.changed, after.reached) == (False, plain.reached)
    assert after.evaluations == plain.evaluations + 200
