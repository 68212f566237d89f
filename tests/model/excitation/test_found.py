"""Of the design for the parameters and the one that tells causes apart the better is kept, as both stand at the end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from pipelines.model.effects.spring import Spring
from pipelines.model.effects.torque_offset import TorqueOffset
from pipelines.model.excitation import apart as telling
from pipelines.model.excitation import found as finding
from pipelines.model.excitation.apart import Apart, Pair
from pipelines.model.excitation.design import FINISH, Design, Effort, design, finished, landscape
from pipelines.model.excitation.found import Found, best
from pipelines.model.excitation.rehearse import Rehearsal
from pipelines.model.excitation.task import Task, Wishes, plan_task
from tests.model.excitation.arms import described, rrr
from tests.seeds import rarely

PAIR = Pair(Spring(joint=2), TorqueOffset(joint=2))
EFFORT = Effort(evaluations=200)
Rehearse = Callable[..., tuple[Design, Rehearsal | None, str]]


@pytest.fixture(scope="module")
def task() -> Task:
    return plan_task(rrr(), described(rrr()), replace(Wishes(), harmonics=(8,)))


@pytest.fixture(scope="module")
def plain(task: Task) -> Design:
    return design(task, EFFORT, 1)


def halved(task: Task, found: Design) -> Design:
    finish = landscape(task, 1, FINISH)
    return finished(task, finish, finish.space.shrunk(finish.space.point(found.trajectory.series), 0.5), 1, 1, found.stopped)


def sought(task: Task, monkeypatch: pytest.MonkeyPatch, rehearsal: Rehearse) -> Found:
    monkeypatch.setattr(finding, "rehearsed_design", rehearsal)
    return best(task, PAIR, EFFORT, 1, rehearse=True)


def test_what_is_rehearsed_safely_is_kept(task: Task, plain: Design) -> None:
    """Less alike than in the plain design, within the ceiling, and safe in simulation."""
    found = best(task, PAIR, EFFORT, 1, rehearse=True)
    assert found.apart is not None
    assert found.apart.changed
    assert found.safe
    assert found.design.reached
    assert found.apart.after.score < found.apart.before.score
    assert found.apart.after.condition_number <= 3.0 * (1.0 + 1e-6)
    assert found.design.trajectory.series.cosine.tobytes() != plain.trajectory.series.cosine.tobytes()


@pytest.mark.slow
def test_a_design_that_its_rehearsal_spoils_gives_way_to_the_plain_one(task: Task, plain: Design,
                                                                      monkeypatch: pytest.MonkeyPatch) -> None:
    """Half as large it tells less than the plain design as large as that may be: the plain one is returned, and said to be it."""
    def rehearsal(task: Task, found: Design, *given: object) -> tuple[Design, Rehearsal | None, str]:
        same = found.trajectory.series.cosine.tobytes() == plain.trajectory.series.cosine.tobytes()
        return (found if same else halved(task, found)), None, ""

    found = sought(task, monkeypatch, rehearsal)
    assert found.design.trajectory.series.cosine.tobytes() == plain.trajectory.series.cosine.tobytes()
    assert found.design.reached
    assert found.apart is not None
    assert not found.apart.changed
    assert found.apart.after == found.apart.before


@pytest.mark.parametrize("nth", [*rarely(1), 2])
def test_who_stops_keeps_the_best_by_then(task: Task, plain: Design, nth: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped while causes are told apart, and spoilt by its rehearsal: the plain design; stopped in its rehearsal: as it was. The
    exit code is the signal's either way, and nothing is rehearsed after the second."""
    count = 0

    def rehearsal(task: Task, found: Design, *given: object) -> tuple[Design, Rehearsal | None, str]:
        nonlocal count
        count += 1
        if nth == 2:
            return replace(found, stopped=130), None, ""
        return (halved(task, found) if count == 1 else found), None, ""

    def stopped(task: Task, *given: object) -> tuple[Design, Apart]:
        after, apart = telling.told_apart(task, *given)  # type: ignore[arg-type]
        return (replace(after, stopped=130) if nth == 1 else after), apart

    monkeypatch.setattr(finding, "told_apart", stopped)
    found = sought(task, monkeypatch, rehearsal)
    assert found.design.stopped == 130
    assert found.apart is not None
    assert (found.apart.changed, count) == ((False, 2) if nth == 1 else (True, 1))
    same = found.design.trajectory.series.cosine.tobytes() == plain.trajectory.series.cosine.tobytes()
    assert same == (nth == 1)


@pytest.mark.slow
def test_both_are_compared_as_their_rehearsals_leave_them(task: Task, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where both are made half as large, what is returned is no worse than the plain design so, and its ceiling is its own."""
    found = sought(task, monkeypatch, lambda task, found, *given: (halved(task, found), None, ""))
    assert found.apart is not None
    assert found.apart.after.score <= found.apart.before.score
    assert not found.design.reached
    assert found.apart.after.condition_number > 3.0


def test_a_motion_that_its_limits_spoil_gives_way_to_one_on_the_way(task: Task, plain: Design,
                                                                    monkeypatch: pytest.MonkeyPatch) -> None:
    """The end of the search cannot be used: a motion that it passed is, which still tells more than the plain design."""
    calls: list[int] = []

    def first_halved(task: Task, *given: object) -> Design:
        calls.append(1)
        made = finished(task, *given)  # type: ignore[arg-type]
        return halved(task, made) if len(calls) == 1 else made

    monkeypatch.setattr(telling, "finished", first_halved)
    after, apart = telling.told_apart(task, plain, PAIR, 1.0, 200, 1, lambda words: None)
    assert len(calls) == 2
    assert apart.changed
    assert apart.after.score < apart.before.score
    assert after.reached


def test_where_nothing_is_better_it_is_the_plain_design(task: Task, plain: Design, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(telling, "finished", lambda task, *given: halved(task, plain))
    after, apart = telling.told_apart(task, plain, PAIR, 1.0, 200, 1, lambda words: None)
    assert after.trajectory is plain.trajectory
    assert (apart.changed, after.reached) == (False, plain.reached)
    assert after.evaluations == plain.evaluations + 200
