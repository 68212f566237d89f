"""What the reference logs have as well has not changed, though it may pay little in their motion; nor has what is no more than they
leave of a joint that moves as slowly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.log.experiment import Array, ExperimentLog
from pipelines.model.diagnosis import changed as changed_module
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.believed.unchanged import Before, near_other_motion, no_change
from pipelines.model.diagnosis.changed import _times
from pipelines.model.diagnosis.diagnose import diagnose
from pipelines.model.diagnosis.fitted.nominal import rows_of
from pipelines.model.diagnosis.fitted.refit import refine
from pipelines.model.diagnosis.floor.by_speed import floor_by_speed
from pipelines.model.diagnosis.given.since import _farther, _with, since_reference
from pipelines.model.diagnosis.named.verdict import Ruling
from pipelines.model.diagnosis.reference.standing import Chosen, apart, joined
from pipelines.model.diagnosis.reference.stood import ANYTHING, Share, share_before
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.screened.candidates import Family, lay_one, whole_motion
from pipelines.model.diagnosis.screened.screen import screen
from pipelines.model.effects import effect_names, find_effect
from pipelines.model.effects.base import Effect
from pipelines.model.rigid.body import Motion
from tests.model.diagnosis.arms import arm, hidden

DRAG = 0.4  # [N m s²/rad²] at joint 2
SETTINGS = DiagnosisSettings(without=tuple(name for name in effect_names() if name != "quadratic_drag"), evidence=False,
                             limits=False)


def drag(times: float) -> Callable[[Motion], Array]:
    def load(motion: Motion) -> Array:
        out = np.zeros_like(motion.q)
        out[:, 1] = times * DRAG * motion.dq[:, 1] * np.abs(motion.dq[:, 1])
        return out
    return load


def hump(times: float) -> Callable[[Motion], Array]:
    def load(motion: Motion) -> Array:
        v, out = motion.dq[:, 1], np.zeros_like(motion.q)
        out[:, 1] = times * np.exp(-((v / 0.27) ** 2)) * np.tanh(100.0 * v)
        return out
    return load


def wave(times: float, phase: float) -> Callable[[Motion], Array]:
    """0.1 N m at joint 2, eleven waves a turn."""
    def load(motion: Motion) -> Array:
        out = np.zeros_like(motion.q)
        out[:, 1] = times * 0.1 * np.sin(11.0 * motion.q[:, 1] + phase)
        return out
    return load


def share(effect: Effect, was: Callable[[Motion], Array], now: Callable[[Motion], Array],
          stands: Effect | None = None) -> Share:
    """Of logs with `was`, then `now`; `stands`: what is known of the reference logs."""
    before = replace(hidden(4, was), role="reference", name="before")
    prepared = prepare(Logs((hidden(1, now),), (), (before,)), SETTINGS)
    assert prepared.reference is not None
    data, later = joined(prepared.reference, prepared.data)
    columns = lay_one(data, effect, arm())
    standing = columns[:0] if stands is None else lay_one(data, stands, arm())
    others = apart(rows_of(data, prepared.columns), later)
    return share_before(columns, data, later, others, standing, np.array([50.0, 100.0, 200.0]))


@pytest.mark.slow
@pytest.mark.parametrize(("was", "stood", "doubtful"), [
    (0.0, False, False), (0.1, False, False), (0.4, False, True), (1.0, True, True), (-1.0, False, False)])
def test_one_amplitude(was: float, stood: bool, doubtful: bool) -> None:
    """What was there with the other sign has changed for sure."""
    found = share(find_effect("quadratic_drag")(joint=2), drag(was), drag(1.0))
    assert found.same == pytest.approx(was, abs=0.05)
    assert found.whole == pytest.approx(abs(was), abs=0.05)
    assert found.std < 0.05
    assert (found.stood, found.doubtful) == (stood, doubtful)


def test_as_much_in_another_phase_is_no_change_that_one_can_be_sure_of() -> None:
    cogging = replace(find_effect("cogging")(joint=2), order=11.0)  # type: ignore[call-arg]
    quarter = share(cogging, wave(0.5, 0.6 + 0.5 * np.pi), wave(1.0, 0.6))
    assert quarter.same == pytest.approx(0.0, abs=0.1)
    assert quarter.whole == pytest.approx(0.5, abs=0.1)
    assert (quarter.stood, quarter.doubtful) == (False, True)


def test_of_what_is_known_to_stand_only_the_change_is_asked() -> None:
    """The drag of the reference logs is told by a column of its own: that of the later logs is new, however little it grew."""
    effect = find_effect("quadratic_drag")(joint=2)
    found = share(effect, drag(1.0), drag(1.4), effect)
    assert (found.same, found.whole, found.stood, found.doubtful) == (0.0, 0.0, False, False)


def test_nor_is_more_than_the_change_asked_where_it_stands_in_nearly_this_shape() -> None:
    """A hump that stands by one speed and is found by another: what misfit the reference logs have is no amplitude of it."""
    stands, found = (replace(find_effect("stribeck")(joint=2), speed=speed) for speed in (0.25, 0.3))  # type: ignore[call-arg]
    assert share(found, hump(1.0), hump(1.6), stands) == Share(0.0, 0.0, 0.0)
    assert share(found, hump(1.0), hump(1.0)).stood


def test_where_the_reference_logs_do_not_tell_nothing_stood() -> None:
    unsure = Share(0.9, 1.2, 0.7)
    assert (unsure.stood, unsure.doubtful) == (False, False)


def test_what_was_several_times_as_large_does_not_stand() -> None:
    shrunk = share(find_effect("quadratic_drag")(joint=2), drag(3.0), drag(1.0))
    assert (shrunk.stood, shrunk.doubtful) == (False, True)


def test_what_is_known_to_stand_is_taken_out_of_the_later_logs() -> None:
    """Though the reference logs' own standing set lacks it."""
    logs = Logs((hidden(1, drag(1.0)),), (hidden(2, drag(1.0)),), (replace(hidden(4, drag(1.0)), role="reference"),))
    prepared = prepare(logs, SETTINGS)
    assert prepared.reference is not None
    nothing = replace(SETTINGS, without=effect_names())
    plain = since_reference(prepared, prepared.reference, nothing)
    known = since_reference(prepared, prepared.reference, nothing, stood=(find_effect("quadratic_drag")(joint=2),))
    assert not plain.standing
    (one,) = known.standing
    assert (one.cause, one.joint) == ("quadratic_drag", 2)
    assert one.parameters["coefficient"].value == pytest.approx(DRAG, rel=0.05)
    assert one.explained > 0.5
    assert known.floor[1] < 0.5 * plain.floor[1]
    assert known.case.judge is not None
    assert plain.case.judge is not None
    moved = [one.case.data.y - one.case.model.torque(one.case.data) for one in (plain, known)]
    assert known.case.data.rms(moved[1])[1] < 0.5 * plain.case.data.rms(moved[0])[1]


@pytest.mark.slow
@pytest.mark.parametrize(("before", "moved", "early"), [(1.0, True, True), (0.0, True, False), (1.0, False, False)])
def test_what_stood_is_seen_beside_what_is_far_greater(before: float, moved: bool, early: bool) -> None:
    """A drag at joint 2 of before and after, and a spring at joint 1 of the later logs alone: the drag ends the search before it
    has begun, in the shape that is there. Not where the drag is new; nor where nothing is greater, for then it is found first."""
    def later(motion: Motion) -> Array:
        out = drag(1.0)(motion)
        out[:, 0] += (3.0 if moved else 0.0) * motion.q[:, 0]
        return out

    logs = Logs((hidden(1, later),), (hidden(2, later),), (replace(hidden(4, drag(before)), role="reference"),))
    prepared = prepare(logs, SETTINGS)
    assert prepared.reference is not None
    case = since_reference(prepared, prepared.reference, replace(SETTINGS, without=effect_names())).case
    now = refine(case.model, case.data, case.weight)
    motion = whole_motion(case.data)
    some = [find_effect("spring")(joint=1), find_effect("quadratic_drag")(joint=2)]
    families = [Family(one.name, one.joint, tuple(one.shapes(motion, case.model.arm))) for one in some]
    passed = screen(case.data, now.fit, families, case.arms(now.model))
    asked = Before(case)
    assert asked.shown(now, passed) is early
    assert [(one.name, one.joint) for one in asked.early] == ([("quadratic_drag", 2)] if early else [])
    assert not Before(case, again=False).shown(now, passed)


@pytest.mark.parametrize(("answers", "searched"), [([""], 1), (["a", ""], 2), (["a", "b", ""], 3), (list("abcdefgh"), 5)])
def test_it_searches_until_nothing_more_stood(answers: list[str], searched: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """And there is an end to it."""
    told, count, known = iter(answers), list[Any](), list[Any]()

    def since_with(*given: Any) -> Any:
        known.append(given[-2])
        return SimpleNamespace(case=len(known), stood=given[-2], of_reference=given[-1])

    class Asked:
        def __init__(self, case: int, again: bool) -> None:
            self.case, self.again, self.ended, self.shown = case, again, None, None

        def stood(self, _: object) -> list[str]:
            return list(next(told)) if self.again else []

        def told(self, _: object) -> int:
            return self.case

    def searched_for(case: int, _: int, ends: object, vain: object) -> Any:
        count.append(case)
        return SimpleNamespace(final=None)

    monkeypatch.setattr(changed_module, "search", searched_for)
    monkeypatch.setattr(changed_module, "Before", Asked)
    monkeypatch.setattr(changed_module, "since_reference", since_with)
    first: Any = SimpleNamespace(held=SimpleNamespace(case=SimpleNamespace(beside=()), prepared=None), nameable=lambda case: case)
    memory: Any = SimpleNamespace(instead=lambda *_: None)
    start: Any = SimpleNamespace(case=0, stood=(), of_reference="the reference logs alone")
    found = changed_module._compared(first, start, None, SETTINGS, memory, lambda since: since.case)  # type: ignore[arg-type]
    assert count == list(range(searched))
    assert known == [tuple(answers[:k]) for k in range(1, searched)]
    assert (found.case, found.noise, found.since.of_reference) == (searched - 1, searched - 1, "the reference logs alone")


def test_a_wave_of_another_order_stays_beside_the_one_that_stood() -> None:
    logs = Logs((hidden(1),), (), (replace(hidden(4), role="reference"),))
    prepared = prepare(logs, SETTINGS)
    assert prepared.reference is not None
    waves = [replace(find_effect("cogging")(joint=2), order=order) for order in (6.0, 11.0, 11.02)]  # type: ignore[call-arg]
    there = [Chosen(waves[0], 0.4, np.zeros(2)), Chosen(waves[1], 0.3, np.zeros(2))]
    found = _with(there, waves[2:], prepared.reference, arm())
    assert [one.effect for one in found] == [waves[0], waves[2]]


def test_a_floor_of_nothing_multiplies_nothing() -> None:
    assert _times(np.array([2.0, 0.0]), np.array([1.0, 0.0])).tolist() == [4.0, 1.0]


@pytest.mark.slow
@pytest.mark.parametrize(("now", "named"), [(1.0, []), (1.4, [("quadratic_drag", 2)]), (2.0, [("quadratic_drag", 2)])])
def test_what_stood_and_has_grown_has_changed(now: float, named: list[tuple[str, int]]) -> None:
    """By what it has grown."""
    before = replace(hidden(4, drag(1.0)), role="reference", name="before")
    found = diagnose(Logs((hidden(1, drag(now)),), (), (before,)), SETTINGS)
    assert [(one.cause, one.joint) for one in found.findings] == named
    if named:
        assert found.findings[0].parameters["coefficient"].value == pytest.approx((now - 1.0) * DRAG, rel=0.1)


@pytest.mark.parametrize(("whole", "left", "unlike", "why"), [
    (0.0, 0.02, False, ""), (0.4, 0.02, False, "the reference logs may have had it"), (0.0, 0.02, True, ""),
    (0.0, 0.011, True, "moves at other speeds"), (0.0, 0.011, False, "")])
def test_why_it_is_no_change(whole: float, left: float, unlike: bool, why: str) -> None:
    """So much may have been there; or of a joint of another motion no more is left than the floor of that motion, 0.012 N m."""
    step = SimpleNamespace(best=SimpleNamespace(log=None, effect=SimpleNamespace(name="drag", joint=2, needs=())),
                           before=SimpleNamespace(rms=np.array([0.5, left, 0.5])))
    found: Any = SimpleNamespace(steps=[step], final=None)
    case: Any = SimpleNamespace(before=lambda final, k: Share(whole, whole, 0.01), unlike={1} if unlike else set(), beside=())
    assert why in (said := no_change(found, 0, case, np.array([0.1, 0.012, 0.1])))
    assert bool(said) == bool(why)


@pytest.mark.parametrize(("name", "joint", "to", "unknown"), [
    ("spring", 2, 2.35, False), ("spring", 2, 2.8, True), ("spring", 3, 2.8, False), ("quadratic_drag", 2, 2.8, False)])
def test_what_stands_is_known_as_far_as_the_reference_logs_went(name: str, joint: int, to: float, unknown: bool) -> None:
    """From 0.7 to 2.3 rad: a spring of later logs that reach 2.8 rad may be what stands at that joint."""
    def over(first: float, last: float) -> Any:
        q = np.linspace(first, last, 10)[:, None] * np.ones(3)
        return SimpleNamespace(logs=(SimpleNamespace(motion=Motion(np.arange(10.0), q, 0.0 * q, 0.0 * q)),))

    stands = Chosen(find_effect("spring")(joint=2), 0.4, np.zeros(2))
    found = find_effect(name)(joint=joint)
    assert _farther(found, [stands], over(1.0, to), over(0.7, 2.3)) is unknown
    assert not _farther(found, [], over(1.0, to), over(0.7, 2.3))
    assert ANYTHING.doubtful
    assert not ANYTHING.stood


def test_what_only_others_show_in_the_reference_logs_is_no_amplitude_of_it() -> None:
    """One of two columns is nothing but what the others make of it there: rounding is all they leave. By all coefficients at once,
    smallest where rows do not tell, NumPy says the same of the other one."""
    rng = np.random.default_rng(3)
    data = rows(hidden(1))
    later = np.arange(data.rows) >= data.rows // 3
    others = rng.normal(size=(5, data.rows))
    columns = rng.normal(size=(2, data.rows))
    columns[1, ~later] = rng.normal(size=5) @ others[:, ~later]
    others = apart(others, later)
    weight = np.array([50.0, 100.0, 200.0])
    was, now = np.array([0.6, 0.0]), np.array([1.0, 0.8])
    torque = np.where(later, now @ columns, was @ columns) + 0.01 * rng.normal(size=data.rows)
    made: Any = SimpleNamespace(joint=data.joint, y=torque)
    found = share_before(columns, made, later, others, others[:0], weight)
    table = np.concatenate([others, np.where(later, 0.0, columns)[:1], np.where(later, columns, 0.0)])
    beta = np.linalg.lstsq((table * weight[data.joint]).T, torque * weight[data.joint], rcond=None)[0]
    left = (table[-2:] - (np.linalg.lstsq(table[:-3].T, table[-2:].T, rcond=None)[0].T @ table[:-3]))
    assert beta[-3] == pytest.approx(0.6, abs=0.01)
    gram = left @ left.T
    same = float(np.array([beta[-3], 0.0]) @ gram @ beta[-2:] / (beta[-2:] @ gram @ beta[-2:]))
    assert found.same == pytest.approx(same, rel=0.05)
    assert found.std < 0.1


def rows(log: ExperimentLog) -> Data:
    return prepare(Logs((log,)), SETTINGS).data


def test_where_joints_move_slowly_the_floor_is_what_is_left_at_low_speed() -> None:
    """Of reference logs that leave three times as much of joint 2 below 0.3 rad/s."""
    reference = prepare(Logs((hidden(4), hidden(6), hidden(7))), SETTINGS).data
    speed = np.concatenate([np.abs(one.at_rows(one.motion.dq)) for one in reference.logs])
    slow = np.zeros(reference.rows, dtype=bool)
    slow[reference.joint == 1] = speed[:, 1] < 0.3
    left = np.where(slow, 0.03, 0.01)
    floor = reference.rms(left)
    assert floor_by_speed(reference, left, reference) == pytest.approx(floor)
    crawl = rows(slowed(hidden(1), 24.0))
    found = floor_by_speed(reference, left, crawl)
    assert found[[0, 2]] == pytest.approx(floor[[0, 2]])
    assert found[1] == pytest.approx(0.03)
    rest = rows(slowed(hidden(1), 1e5))  # as slowly as hardly a row of the reference logs
    assert floor_by_speed(reference, left, rest) == pytest.approx(floor)


def slowed(log: ExperimentLog, times: float) -> ExperimentLog:
    """The same angles less far from where they begin: every speed is so many times lower."""
    q = log.signals["q"].values
    less = replace(log.signals["q"], values=q[0] + (q - q[0]) / times)
    return replace(log, signals={**log.signals, "q": less})


@pytest.mark.parametrize(("left", "unlike", "verdict"), [
    (0.011, True, "nothing-wrong"), (0.011, False, "unknown"), (0.02, True, "unknown")])
def test_what_gives_way_near_the_floor_of_another_motion_is_no_alarm(left: float, unlike: bool, verdict: str) -> None:
    found: Any = SimpleNamespace(nominal=SimpleNamespace(rms=np.array([0.01, left, 0.01])))
    case: Any = SimpleNamespace(unlike={1} if unlike else set())
    said = near_other_motion(Ruling("unknown", (), "the base gives way"), found, case, np.full(3, 0.01))
    assert said.verdict == verdict
    assert bool(said.reason) == (verdict == "unknown")
