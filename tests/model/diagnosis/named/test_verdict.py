"""What is named, and what is not: near the floor nothing is wrong, far above it without a cause something unknown is."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.model.diagnosis.floor.thresholds import Thresholds
from pipelines.model.diagnosis.named.verdict import excess, explained, much_without_name, rule, unbelieved
from pipelines.model.diagnosis.result import Trial
from pipelines.model.diagnosis.searched.ledger import UNBELIEVABLE
from pipelines.model.effects.backlash import Backlash
from pipelines.model.effects.base import Effect
from pipelines.model.effects.cogging import Cogging
from pipelines.model.effects.contact import Contact
from pipelines.model.effects.gravity_tilt import GravityTilt
from pipelines.model.effects.stribeck import Stribeck
from pipelines.model.effects.torque_gain import TorqueGain
from pipelines.model.effects.viscous_drift import ViscousDrift
from tests.model.diagnosis.made_up import searched

FLOOR = np.array([0.01, 0.01, 0.01])


def left(*rms: float) -> Any:
    return SimpleNamespace(rms=np.array(rms))


def found(nominal: Any, *after: Any, other: Any = None, effects: Sequence[Effect] = ()) -> Any:
    """A search that accepted one cause after the other, with what each left; cogging at joint 2 where nothing else is given."""
    before, steps = nominal, []
    for one, effect in zip_longest(after, effects, fillvalue=Cogging(2)):
        steps.append(SimpleNamespace(before=before, best=SimpleNamespace(done=one, effect=effect), other=None, trials=()))
        before = one
    steps.append(SimpleNamespace(before=before, best=None, other=other, trials=()))
    return SimpleNamespace(nominal=nominal, steps=steps, final=before)


def test_at_the_floor_nothing_is_wrong() -> None:
    assert rule(found(left(0.011, 0.009, 0.012)), FLOOR).verdict == "nothing-wrong"


def test_above_the_floor_without_a_cause_is_unknown() -> None:
    ruling = rule(found(left(0.011, 0.05, 0.01)), FLOOR)
    assert ruling.verdict == "unknown"
    assert "joint 2" in ruling.reason


def test_a_cause_that_comes_down_to_the_floor_is_named() -> None:
    assert rule(found(left(0.01, 0.05, 0.01), left(0.01, 0.011, 0.01)), FLOOR).named == (0,)


def test_a_cause_that_explains_less_than_half_is_not() -> None:
    assert rule(found(left(0.01, 0.05, 0.01), left(0.01, 0.04, 0.01)), FLOOR).verdict == "unknown"


def test_a_poor_explanation_of_what_would_be_no_alarm_without_it_is_none() -> None:
    """1.25 times the floor without a cause is nothing wrong; so it is with one that takes a tenth of that away."""
    nominal = left(0.0125, 0.01, 0.0107)
    assert rule(found(nominal), FLOOR).verdict == "nothing-wrong"
    ruling = rule(found(nominal, left(0.0125, 0.01, 0.0102)), FLOOR)
    assert (ruling.verdict, ruling.named) == ("nothing-wrong", ())
    assert 0 in ruling.doubts


def test_a_little_that_something_else_bears_out_is_named_near_the_floor_only() -> None:
    """Where what is left followed the joint's motion and does not any more, it need not explain half of an uncertain excess."""
    near, after = left(0.0125, 0.01, 0.0107), left(0.0125, 0.01, 0.0102)
    assert rule(found(near, after), FLOOR, mended=True).named == (0,)
    high, little = left(0.05, 0.01, 0.01), left(0.045, 0.01, 0.01)
    assert rule(found(high, little), FLOOR, mended=True).verdict == "unknown"


def test_what_may_be_the_floor_need_not_be_explained() -> None:
    """Ten replicas know the floor to about a tenth: joint 1 is no excess that the cause at joint 3 ought to take away."""
    assert rule(found(left(0.0115, 0.0097, 0.0105), left(0.0115, 0.0097, 0.0098)), FLOOR).named == (0,)


def test_what_leaves_much_of_a_joint_is_not_named() -> None:
    """Half of the amplitude is left: three quarters of the power are explained, and yet it is another cause."""
    assert rule(found(left(0.01, 0.08, 0.01), left(0.01, 0.04, 0.01)), FLOOR).verdict == "unknown"


@pytest.mark.parametrize(("rest", "named"), [(0.026, (0,)), (0.018, (0, 1)), (0.0255, (0,))])
def test_what_is_found_in_the_rest_of_a_law_that_is_not_the_machines_has_no_name(rest: float, named: tuple[int, ...]) -> None:
    """Friction that differs by direction is told as an offset where the library lacks it, which leaves 2.8 floors; cogging then
    takes a tenth of that. What takes more of it is named, though the joint stays above its floor."""
    ruling = rule(found(left(0.1, 0.01, 0.01), left(0.028, 0.01, 0.01), left(rest, 0.01, 0.01),
                        effects=(Cogging(1), Cogging(1))), FLOOR)
    assert (ruling.verdict, ruling.named) == ("cause", named)
    assert set(ruling.doubts) == {0, 1} - set(named)


@pytest.mark.parametrize(("rest", "effects"), [
    ((0.0150, 0.0148), (Cogging(1), Cogging(1))),  # the joint comes down to its floor
    ((0.0600, 0.0550, 0.0165), (Cogging(1), Cogging(1), Stribeck(1)))])  # what is found later explains most of it
def test_beside_a_great_cause_that_is_explained_a_small_one_keeps_its_name(rest: tuple[float, ...], effects: Any) -> None:
    """It takes a tenth of what the joint shows at first."""
    after = [left(one, 0.01, 0.01) for one in rest]
    assert rule(found(left(0.1, 0.01, 0.01), *after, effects=effects), FLOOR).named == tuple(range(len(rest)))


def test_a_cause_elsewhere_leaves_no_rest_at_a_joint() -> None:
    """The greater one was found at joint 3: what joint 1 keeps is not what its law leaves."""
    after = (left(0.05, 0.01, 0.01), left(0.0475, 0.01, 0.01), left(0.017, 0.01, 0.01))
    assert rule(found(left(0.05, 0.01, 0.5), *after, effects=(Cogging(3), Cogging(1), Stribeck(1))), FLOOR).named == (0, 1, 2)


def test_the_reason_names_the_joints_that_are_not_explained() -> None:
    """Joint 1 stands a little above its floor as well, but it is explained for the most part."""
    ruling = rule(found(left(0.1, 0.04, 0.01), left(0.017, 0.03, 0.01)), FLOOR)
    assert (ruling.verdict, "joint 2" in ruling.reason, "joint 1" in ruling.reason) == ("unknown", True, False)


def test_what_gives_way_is_not_named_by_the_residual() -> None:
    ruling = rule(found(left(0.01, 0.05, 0.01), other=SimpleNamespace(joint=2)), FLOOR)
    assert ruling.verdict == "unknown"
    assert "frequency responses" in ruling.reason


def test_two_causes_share_what_stands_above_the_floor() -> None:
    """Each joint's excess is that of its own cause."""
    case = found(left(0.01, 0.05, 0.03), left(0.01, 0.01, 0.03), left(0.01, 0.01, 0.01))
    shares = [explained(step.before.rms, step.best.done.rms, case.nominal.rms, FLOOR) for step in case.steps[:2]]
    assert shares == pytest.approx([24.0 / 32.0, 8.0 / 32.0])
    assert rule(case, FLOOR).named == (0, 1)


@pytest.mark.parametrize(("rest", "known"), [(0.03, True), (0.011, True), (0.03, False)])
def test_beside_a_gap_no_event_is_named(rest: float, known: bool) -> None:
    """Where the link is in a gap, at the start of a log above all, no law has to the last: at some moments more is left, as after a
    touch. That is so where all else is explained, too."""
    case = found(left(0.01, 0.3, 0.01), left(0.01, 0.05, 0.01), left(0.01, rest, 0.01))
    for step, (effect, happened) in zip(case.steps, ((Backlash(2), False), (Contact(), True)), strict=False):
        step.best.effect = effect
        step.best.screened = SimpleNamespace(family=SimpleNamespace(event=happened))
    ruling = rule(case, FLOOR, known)
    assert ruling.named == (0,)
    assert set(ruling.doubts) == {1}


def test_without_a_floor_what_is_left_is_no_alarm() -> None:
    """Of every recorded arm more than noise is left; what the answer cannot vouch for is said."""
    ruling = rule(found(left(0.011, 0.05, 0.01)), FLOOR, known=False)
    assert ruling.verdict == "nothing-wrong"
    assert "not testable without a floor" in ruling.reason


def test_excess_counts_no_joint_below_its_floor() -> None:
    assert excess(np.array([0.005, 0.02, 0.01]), FLOOR) == pytest.approx(3.0)


def test_thresholds_follow_the_weights() -> None:
    """A gain is squared weighted torque: twice the weight is four times the gain; of the whole arm the largest counts."""
    one = Thresholds(np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3]), "", np.array([1.0, 1.0]), (1, 2, None))
    np.testing.assert_allclose(one.at(np.array([2.0, 1.0])).gain, [4.0, 2.0, 12.0])


def test_without_a_floor_a_trifle_beside_a_great_cause_has_no_name() -> None:
    """A drift of 1 N m at joint 1 whose law leaves 0.02: what takes a tenth off that may mend the law; at joint 2 it is a cause."""
    first, floor = left(0.02, 0.05, 0.01), 4e-3 * np.ones(3)
    nominal = left(1.0, 0.05, 0.01)
    other = (ViscousDrift(1), Stribeck(1))
    assert rule(found(nominal, first, left(0.018, 0.05, 0.01), effects=other), floor, known=False).named == (0,)
    assert rule(found(nominal, first, left(0.02, 0.04, 0.01), effects=other), floor, known=False).named == (0, 1)


def test_without_a_floor_a_further_wave_has_a_name_however_small() -> None:
    """Magnets, teeth and poles have orders of their own, and one wave is no part of another."""
    first, floor = left(0.02, 0.05, 0.01), 1e-3 * np.ones(3)
    waves = (Cogging(1), Cogging(1))
    assert rule(found(left(1.0, 0.05, 0.01), first, left(0.018, 0.05, 0.01), effects=waves), floor, known=False).named == (0, 1)


def test_without_a_floor_a_joint_that_stands_in_the_noise_makes_no_cause_of_a_trifle() -> None:
    """Joint 3 has its noise and nothing else: a millionth of it taken away says nothing of a cause at joint 1."""
    first, floor = left(0.02, 0.05, 1e-3), 1e-3 * np.ones(3)
    nominal = left(1.0, 0.05, 1e-3 + 1e-12)
    other = (ViscousDrift(1), Stribeck(1))
    assert rule(found(nominal, first, left(0.018, 0.05, 1e-3 - 1e-12), effects=other), floor, known=False).named == (0,)


@pytest.mark.parametrize(("rest", "named"), [(0.02, (0,)), (0.044, (0,)), (0.046, ()), (0.049, ())])
def test_without_a_floor_a_name_takes_a_fifth_of_its_joint(rest: float, named: tuple[int, ...]) -> None:
    """Of 0.05 N m, 0.044 are less than four fifths of the power, 0.046 more: most of what is wrong there is something else."""
    ruling = rule(found(left(0.01, 0.05, 0.01), left(0.01, rest, 0.01)), 4e-3 * np.ones(3), known=False)
    assert ruling.named == named
    assert (0 in ruling.doubts) is not bool(named)


@pytest.mark.parametrize(("rest", "verdict"), [(0.5, "cause"), (1.0, "unknown"), (1.8, "unknown")])
def test_without_a_floor_what_leaves_a_joint_far_above_the_noise_takes_nearly_all_of_it(rest: float, verdict: str) -> None:
    """Of 2 N m in 0.02 of noise, half and more is left of something that has no name: it stands 50 times above the noise."""
    ruling = rule(found(left(0.02, 2.0, 0.02), left(0.02, rest, 0.02)), 0.02 * np.ones(3), known=False)
    assert ruling.verdict == verdict
    assert ruling.named == ((0,) if verdict == "cause" else ())
    assert ("joint 2 far above the noise" in ruling.reason) == (verdict == "unknown")


def test_without_a_floor_a_joint_in_the_noise_is_no_fifth_of_what_the_arm_shows() -> None:
    """A tilt takes a hundredth off joint 2; that joint 3 was in its noise and still is says nothing of it."""
    case = found(left(0.01, 0.05, 0.9e-3), left(0.01, 0.0497, 0.89e-3), effects=(GravityTilt(),))
    ruling = rule(case, 1e-3 * np.ones(3), known=False)
    assert (ruling.named, set(ruling.doubts)) == ((), {0})


def test_without_a_floor_a_weak_drive_is_asked_where_it_is_seen() -> None:
    """A drive of joint 2 that gives too little looks there like a lighter arm, and is seen at joint 1 alone."""
    case = found(left(0.16, 0.9e-3, 0.01), left(0.003, 0.9e-3, 0.01), effects=(TorqueGain(2),))
    assert rule(case, 1e-3 * np.ones(3), known=False).named == (0,)


@pytest.mark.parametrize(("before", "after", "doubted", "where"), [
    (0.3, 0.05, True, "joint 2"), (0.3, 0.05, False, ""), (0.3, 0.25, True, ""), (0.14, 0.02, True, "")])
def test_what_follows_a_law_far_above_the_noise_is_no_arm_in_order(before: float, after: float, doubted: bool, where: str) -> None:
    """A rotor's periodic torque, 30 times its noise, of which held-out time does not bear out the orders; a third of the power may
    be what friction has beside its law, and near the noise every arm has something."""
    made = searched(left(0.01, before, 0.01), (Cogging(2), left(0.01, after, 0.01)))
    assert much_without_name(made, {0: "not sure"} if doubted else {}, FLOOR) == where


@pytest.mark.parametrize(("rest", "gain", "reason", "said"), [
    (0.3, 0.98, UNBELIEVABLE, "torque that is clipped at joint 2 would explain 98 % of what is left"),
    (0.3, 0.98, "weaker than others", ""), (0.3, 0.2, UNBELIEVABLE, ""), (0.05, 0.98, UNBELIEVABLE, "")])
def test_a_drive_that_is_clipped_nearly_all_the_time_is_no_arm_in_order(rest: float, gain: float, reason: str, said: str) -> None:
    """Its limit is told from no other cause, for next to no torque came out below; that nothing is wrong would be worse said."""
    trial = Trial(1, "torque_saturation", 2, gain, 0.02, 0.2, gain, False, reason)
    nothing: Any = left(0.01, rest, 0.01)
    made: Any = SimpleNamespace(final=nothing, steps=[SimpleNamespace(best=None, trials=(trial,))])
    told = unbelieved(made, FLOOR)
    assert told.startswith(said)
    assert bool(told) == bool(said)


@pytest.mark.parametrize(("joint", "verdict"), [(2, "unknown"), (3, "nothing-wrong")])
def test_what_no_arm_could_have_moved_with_is_said_where_it_stands_high(joint: int, verdict: str) -> None:
    """At joint 2 thirty times the noise is left. A refused cause at joint 3, where noise is left, says nothing of that."""
    trial = Trial(1, "torque_saturation", joint, 0.98, 0.02, 0.2, 0.98, False, UNBELIEVABLE)
    step = SimpleNamespace(best=None, trials=(trial,), other=None, before=left(0.01, 0.3, 0.01))
    made: Any = SimpleNamespace(nominal=left(0.01, 0.3, 0.01), final=left(0.01, 0.3, 0.01), steps=[step])
    assert rule(made, FLOOR, False).verdict == verdict
