"""What is dropped again after a search, on made-up numbers: causes that others do as well, held-out alarms."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.model.diagnosis.believed import mended, pruned
from pipelines.model.diagnosis.named.verdict import Ruling
from pipelines.model.diagnosis.searched.search import Found
from pipelines.model.effects.base import Effect
from tests.model.diagnosis.made_up import FLOOR, effect, left, searched


def twins() -> tuple[str, str]:
    """Two causes that can be mistaken for each other at one joint, whichever they are."""
    from pipelines.model.effects import all_effects

    named = {kind.name: kind for kind in all_effects() if kind.scope == "joint"}
    return next((one, other) for one in sorted(named) for other in named[one].twins if other in named)


def among(*causes: Effect) -> Any:
    there = tuple(SimpleNamespace(cause=one.name, joint=one.joint) for one in causes)
    return SimpleNamespace(families=there, judge=None, blocks=10, white=False, beside=())


@pytest.mark.parametrize(("held_out", "verdict"), [((0.011, 0.012, 0.01), "nothing-wrong"), ((0.01, 0.2, 0.01), "unknown")])
def test_nothing_wrong_is_not_said_where_held_out_logs_show_something(held_out: tuple[float, ...], verdict: str,
                                                                     monkeypatch: pytest.MonkeyPatch) -> None:
    """Six times the floor at joint 2 is far above it; a fifth above it is other motion."""
    monkeypatch.setattr(pruned, "held_out_left", lambda done, judge, blocks: np.array(held_out))
    judge = SimpleNamespace(rms=lambda rms: rms)
    case: Any = SimpleNamespace(judge=judge, blocks=10)
    ruling = pruned._elsewhere(Ruling("nothing-wrong", (), ""), searched(left(0.01, 0.01, 0.01)), case, FLOOR, True)
    assert ruling.verdict == verdict
    assert ("joint 2" in ruling.reason) == (verdict == "unknown")


def test_blocks_of_the_fitted_logs_are_the_same_motion_and_are_not_asked() -> None:
    case: Any = SimpleNamespace(judge=None, blocks=10)
    said = Ruling("nothing-wrong", (), "")
    assert pruned._elsewhere(said, searched(left(0.01, 0.01, 0.01)), case, FLOOR, True) is said


@pytest.mark.parametrize(("torque", "verdict"), [(0.9, "unknown"), (1.5, "nothing-wrong"), (0.01, "nothing-wrong")])
def test_a_model_that_leaves_most_of_the_torque_is_none(torque: float, verdict: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody knows the floor: held out it leaves 0.6 N m of joint 2, more than half, or less; or no more than noise."""
    noise = 1.0 if torque < 0.1 else 1e-3
    monkeypatch.setattr(pruned, "held_out_left", lambda done, judge, blocks: np.array([0.01, 0.6, 0.01]))
    judge = SimpleNamespace(rms=lambda rms: rms, y=np.array([1.0, torque, 1.0]))
    case: Any = SimpleNamespace(judge=judge, blocks=10)
    found = searched(left(0.01, 0.01, 0.01))
    ruling = pruned._elsewhere(Ruling("nothing-wrong", (), ""), found, case, np.full(3, noise), False)
    assert ruling.verdict == verdict
    assert ("67 % of the torque of joint 2" in ruling.reason) == (verdict == "unknown")


def model_of(**numbers: Any) -> Any:
    """A fitted model with one cause, whose numbers it can have."""
    return SimpleNamespace(model=SimpleNamespace(effects=[SimpleNamespace(possible=True)]), **numbers)


def test_the_cause_that_is_missed_least_goes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the first the residual grows by ten thresholds, without the second by half of one: the second is idle."""
    found = searched(left(0.5, 0.05, 0.01), (effect("cogging", 1), left(0.01, 0.05, 0.01)),
                     (effect("torque_offset", 2), left(0.01, 0.01, 0.01)))
    final: Any = SimpleNamespace(rss=100.0, weight=np.ones(3))
    without = {(1,): model_of(rss=200.0), (0,): model_of(rss=105.0)}
    monkeypatch.setattr(pruned, "without", lambda found, kept, case, last: without[tuple(kept)])
    monkeypatch.setattr(pruned, "held_out", lambda done, case: done.rss)
    families = (SimpleNamespace(cause="cogging", joint=1), SimpleNamespace(cause="torque_offset", joint=2))
    thresholds = SimpleNamespace(at=lambda weight: SimpleNamespace(gain=np.array([10.0, 10.0])))
    case: Any = SimpleNamespace(families=families, thresholds=thresholds)
    assert pruned._idle(found, [0, 1], case, final) == 1
    without[0,].model.effects[0].possible = False  # a hump that would have to be a dip without it
    assert pruned._idle(found, [0, 1], case, final) is None
    without[0,].model.effects[0].possible = True
    thresholds.at = lambda weight: SimpleNamespace(gain=np.array([10.0, 1.0]))
    assert pruned._idle(found, [0, 1], case, final) is None


def test_a_cause_that_brings_nothing_held_out_is_idle_however_much_it_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    found = searched(left(0.5, 0.05, 0.01), (effect("cogging", 1), left(0.01, 0.05, 0.01)),
                     (effect("torque_offset", 2), left(0.01, 0.01, 0.01)))
    final: Any = SimpleNamespace(rss=100.0, weight=np.ones(3))
    monkeypatch.setattr(pruned, "without", lambda found, kept, case, last: model_of(rss=1000.0, kept=kept))
    monkeypatch.setattr(pruned, "held_out", lambda done, case: 2.0 if getattr(done, "kept", None) == [1] else 1.0)
    families = (SimpleNamespace(cause="cogging", joint=1), SimpleNamespace(cause="torque_offset", joint=2))
    case: Any = SimpleNamespace(families=families, thresholds=None)
    assert pruned._idle(found, [0, 1], case, final) == 1


@pytest.mark.parametrize("referred", [False, True])
@pytest.mark.parametrize(("missed", "idle"), [(0.5, 1), (20.0, None)])
def test_what_happened_once_is_idle_where_the_others_leave_hardly_more_without_it(missed: float, idle: int | None, referred: bool,
                                                                                  monkeypatch: pytest.MonkeyPatch) -> None:
    """Held-out time says nothing of it; its own threshold, of ten, does: that of the last step where reference logs give it."""
    found = searched(left(0.5, 0.05, 0.01), (effect("cogging", 1), left(0.01, 0.05, 0.01)),
                     (effect("contact", None), left(0.01, 0.01, 0.01)))
    found.final.model.effects[1].log = 0
    final: Any = SimpleNamespace(rss=100.0, weight=np.ones(3))
    others = {(1,): model_of(rss=900.0), (0,): model_of(rss=100.0 + missed)}
    monkeypatch.setattr(pruned, "without", lambda found, kept, case, last: others[tuple(kept)])
    monkeypatch.setattr(pruned, "held_out", lambda done, case: 1.0 if done is not others[1,] else 2.0)
    families = (SimpleNamespace(cause="cogging", joint=1), SimpleNamespace(cause="contact", joint=None))
    thresholds = SimpleNamespace(at=lambda weight: SimpleNamespace(gain=np.array([10.0, 10.0])))
    found.steps.append(SimpleNamespace(best=None, thresholds=thresholds))
    case: Any = SimpleNamespace(families=families, thresholds=None if referred else thresholds)
    assert pruned._idle(found, [0, 1], case, final) == idle


def test_what_gained_no_more_than_chance_is_asked_again_beside_what_was_found_after_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside the third the first is sure; the second, a twin of nothing, still is not."""
    found = searched(left(0.5, 0.5, 0.5), (effect("cogging", 1), left(0.4, 0.5, 0.5)), (effect("cogging", 2), left(0.4, 0.4, 0.5)),
                     (effect("cogging", 3), left(0.4, 0.4, 0.1)))
    monkeypatch.setattr(pruned, "without", lambda found, kept, case, last=None: tuple(kept))
    monkeypatch.setattr(pruned, "no_name", lambda step, before, after, place, *_: (before, after, place) != ((2,), (0, 2), 0))
    assert pruned._asked_again(found, [2], [0, 1], among()) == ([0, 2], (0, 2))
    assert pruned._asked_again(found, [], [0, 1], among()) == ([], ())


def test_a_cause_that_takes_the_ground_from_a_later_one_is_not_taken_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """With it the later one would only mend its shape: one of two names has to go, and the later one was surer."""
    one, other = twins()
    found = searched(left(0.5, 0.01, 0.01), (effect(one, 1), left(0.05, 0.01, 0.01)), (effect(other, 1), left(0.01, 0.01, 0.01)))
    monkeypatch.setattr(mended, "imitated", lambda step, family, case: 0.5)
    monkeypatch.setattr(pruned, "no_name", lambda *_: False)
    monkeypatch.setattr(pruned, "without", lambda found, kept, case, final=None: tuple(kept))
    case = among(effect(one, 1), effect(other, 1))
    kept, final = pruned._asked_again(found, [1], [0], case)
    assert (kept, final) == ([1], (1,))


@pytest.mark.parametrize("ruled", [(0, 1), (1,)])  # by the search's outcome the first may have been refused before
@pytest.mark.parametrize(("nominal", "rest", "verdict"), [
    (0.1, 0.04, "cause"), (0.1, 0.09, "unknown"),
    (0.015, 0.0138, "unknown"),  # 1.5 floors alone would be nothing wrong, but noise has no cause that keeps every rule
    (0.0125, 0.0118, "cause")])  # that may be the floor, however little it took
def test_what_stays_has_to_explain_half_without_what_was_dropped(nominal: float, rest: float, verdict: str, ruled: tuple[int, ...],
                                                                 monkeypatch: pytest.MonkeyPatch) -> None:
    """Two explain everything, and held-out logs do not bear out the first: what the second leaves then decides."""
    made = searched(left(nominal, 0.01, 0.01), (effect("cogging", 1), left(0.02, 0.01, 0.01)),
                    (effect("spring", 1), left(0.01, 0.01, 0.01)))
    for step in made.steps:
        step.best.effect, step.best.log = SimpleNamespace(last=False), None
        step.other = None
    monkeypatch.setattr(pruned, "simulated_steps", lambda *args: ())
    monkeypatch.setattr(pruned, "steadied", lambda found, case: (found, case))
    monkeypatch.setattr(pruned, "at_which", lambda *_: "")
    monkeypatch.setattr(pruned, "at_odds", lambda found, k, *args: "logs do not agree" if k == 0 else "")
    monkeypatch.setattr(pruned, "strays", lambda *args: "")
    monkeypatch.setattr(pruned, "_not_told", lambda *args: False)
    monkeypatch.setattr(pruned, "_harm", lambda *args: "")
    monkeypatch.setattr(pruned, "of_no_size", lambda done: [])
    monkeypatch.setattr(pruned, "too_slight", lambda done: [])
    monkeypatch.setattr(pruned, "without", lambda *args: left(rest, 0.01, 0.01))
    case: Any = SimpleNamespace(floored=True, blocks=10, judge=None, beside=())
    done = pruned.settled(Found(made.nominal, tuple(made.steps), made.final), Ruling("cause", ruled, ""), case, case, FLOOR)
    assert done.ruling.verdict == verdict
    assert done.ruling.named == ((1,) if verdict == "cause" else ())


def test_a_cause_whose_numbers_are_impossible_in_the_end_has_no_name(monkeypatch: pytest.MonkeyPatch) -> None:
    """Found as it may be; fitted with what was found before it, its amplitude has the wrong sign."""
    made = searched(left(0.1, 0.01, 0.01), (effect("cogging", 1), left(0.02, 0.01, 0.01)),
                    (effect("stribeck", 2), left(0.01, 0.01, 0.01)))
    for step in made.steps:
        step.best.log, step.other = None, None
    for name, answer in {"simulated_steps": (), "at_which": "", "at_odds": "", "strays": "", "_not_told": False, "_harm": "",
                         "of_no_size": [], "too_slight": [], "not_mending": [0, 1], "_idle": None}.items():
        monkeypatch.setattr(pruned, name, lambda *_, answer=answer: answer)
    monkeypatch.setattr(pruned, "turned", lambda found, kept, *_: kept)
    monkeypatch.setattr(pruned, "steadied", lambda found, case: (found, case))
    dip = SimpleNamespace(effects=(SimpleNamespace(possible=True), SimpleNamespace(possible=False)))
    both, one = SimpleNamespace(rms=np.array([0.01, 0.01, 0.01]), model=dip), left(0.02, 0.01, 0.01)
    monkeypatch.setattr(pruned, "without", lambda found, kept, *_: both if len(kept) == 2 else one)
    case: Any = SimpleNamespace(floored=True, blocks=10, judge=None, beside=())
    done = pruned.settled(Found(made.nominal, tuple(made.steps), made.final), Ruling("cause", (0, 1), ""), case, case, FLOOR)
    assert done.ruling.named == (0,)
    assert done.ruling.doubts == {1: pruned._IMPOSSIBLE}


@pytest.mark.parametrize(("much", "slight", "verdict", "named"), [
    (0.015, [], "cause", (0, 1)), (0.0115, [0], "cause", (1,)), (0.015, [0, 1], "unknown", ()),
    (0.04, [0], "unknown", ()), (0.04, [0, 1], "unknown", ())])
def test_what_arms_in_order_have_as_much_of_has_no_name(much: float, slight: list[int], verdict: str,
                                                        named: tuple[int, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """It keeps every rule, so that it is no noise: alone something else may be what shows, and beside another too where it took
    most of what was wrong."""
    made = searched(left(much, 0.013, 0.01), (effect("torque_gain", 1), left(0.01, 0.013, 0.01)),
                    (effect("torque_gain", 2), left(0.01, 0.01, 0.01)))
    for step in made.steps:
        step.best.log, step.other = None, None
    for name, answer in {"simulated_steps": (), "at_which": "", "at_odds": "", "strays": "", "_not_told": False, "_harm": "",
                         "of_no_size": [], "too_slight": slight, "not_mending": [0, 1], "_idle": None, "possible": True}.items():
        monkeypatch.setattr(pruned, name, lambda *_, answer=answer: answer)
    monkeypatch.setattr(pruned, "turned", lambda found, kept, *_: kept)
    monkeypatch.setattr(pruned, "steadied", lambda found, case: (found, case))
    rest = {(0, 1): made.final, (0,): left(0.01, 0.013, 0.01), (1,): left(much, 0.01, 0.01)}
    monkeypatch.setattr(pruned, "without", lambda found, kept, *_: rest[tuple(kept)])
    case: Any = SimpleNamespace(floored=True, blocks=10, judge=None, beside=())
    done = pruned.settled(Found(made.nominal, tuple(made.steps), made.final), Ruling("cause", (0, 1), ""), case, case, FLOOR)
    assert (done.ruling.verdict, done.ruling.named) == (verdict, named)
    assert [done.ruling.doubts[k] for k in slight] == [pruned._SO_LITTLE] * len(slight)
    assert (done.ruling.reason == pruned.TOO_SLIGHT) is (slight == [0, 1])


@pytest.mark.parametrize(("after", "unseen"), [(0.1, []), (0.17, []), (0.185, [0])])
def test_without_a_floor_a_cause_is_seen_in_what_was_held_out(after: float, unseen: list[int],
                                                              monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 0.2 N m held out at joint 2 it has to take a fifth of the power, however much it takes of what was fitted."""
    found = searched(left(0.5, 0.1, 0.01), (effect("viscous_drift", 2), left(0.5, 0.02, 0.01)))
    held = {id(found.nominal): np.array([0.6, 0.2, 0.02]), id(found.final): np.array([0.6, after, 0.02])}
    monkeypatch.setattr(pruned, "held_out_left", lambda done, judge, blocks: held[id(done)])
    case: Any = SimpleNamespace(judge=SimpleNamespace(rms=lambda rms: rms), blocks=10)
    assert pruned._unseen(found, [0], found.final, case, 0.015 * np.ones(3)) == unseen


@pytest.mark.parametrize(("elsewhere", "named"), [(0.02, (0,)), (0.3, ())])
def test_without_a_floor_a_trifle_beside_what_has_no_name_is_no_answer(elsewhere: float, named: tuple[int, ...],
                                                                       monkeypatch: pytest.MonkeyPatch) -> None:
    """All of the waves of a weak joint are found; what another one leaves, thirty times the noise or twice, has no name."""
    waves = effect("cogging", 3)
    made = searched(left(0.01, elsewhere, 0.03), (waves, left(0.01, elsewhere, 0.01)))
    made.steps[0].best.log, made.steps[0].other = None, None
    for name, answer in {"simulated_steps": (), "at_which": "", "at_odds": "", "strays": "", "_not_told": False, "_harm": "",
                         "of_no_size": [], "too_slight": [], "not_mending": [], "_idle": None, "only_then": False, "possible": True,
                         "_unseen": []}.items():
        monkeypatch.setattr(pruned, name, lambda *_, answer=answer: answer)
    monkeypatch.setattr(pruned, "turned", lambda found, apart, believed, *_: believed)
    monkeypatch.setattr(pruned, "_asked_again", lambda found, kept, *_: (kept, found.final))
    monkeypatch.setattr(pruned, "steadied", lambda found, case: (found, case))
    monkeypatch.setattr(pruned, "held_out_left", lambda done, *_: done.rms)
    torque: Any = SimpleNamespace(rms=lambda rms: rms, y=np.ones(3))
    case: Any = SimpleNamespace(floored=False, blocks=10, judge=None, beside=(), data=torque)
    done = pruned.settled(Found(made.nominal, tuple(made.steps), made.final), Ruling("cause", (0,), ""), case, case, FLOOR, False)
    assert done.ruling.named == named
    assert done.ruling.verdict == ("cause" if named else "nothing-wrong")
