"""What follows from the rigid body alone is laid again only for another rigid body."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest

from pipelines.model.arm import Acting, Arm
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.screened.arms_alike import _KNOWN, _MOST, Asked, moving_alike, remember
from pipelines.model.diagnosis.screened.arms_alike import alike as alike_of
from pipelines.model.diagnosis.screened.candidates import Arms, Family
from pipelines.model.diagnosis.screened.screen import screen
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.effects import all_effects
from pipelines.model.effects.backlash import Backlash
from pipelines.model.effects.base import Effect
from pipelines.model.effects.gravity_tilt import GravityTilt
from pipelines.model.effects.joint_elasticity import JointElasticity
from pipelines.model.effects.quadratic_drag import QuadraticDrag
from pipelines.model.effects.rotor_inertia import RotorInertia
from pipelines.model.effects.torque_crosstalk import TorqueCrosstalk
from pipelines.model.effects.torque_lag import TorqueLag
from pipelines.model.rigid.body import Motion
from tests.model.diagnosis.arms import hidden
from tests.model.effects.test_every_effect import arm, drawn, motion, placed

__all__ = ["arm", "motion"]


def start() -> tuple[Exact, Data]:
    """Of logs of its own: what is remembered belongs to them."""
    prepared = prepare(Logs((hidden(1),)), DiagnosisSettings())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    return Exact.start(columns, fit), prepared.data


def asked(data: Data, model: Exact) -> Asked:
    return Asked.of(data, model, model.torque(data))


def alike(data: Data, model: Exact) -> tuple[Asked, ...]:
    return alike_of(data, asked(data, model))


def moving(data: Data, model: Exact) -> list[Arm]:
    return [one.arm for one in moving_alike(data, asked(data, model))]


def scaled(model: Exact, factor: float) -> Exact:
    kept = len(model.columns.kept)
    return replace(model, beta=np.concatenate([factor * model.beta[:kept], model.beta[kept:]]))


@pytest.mark.parametrize(("moved", "same"), [(5e-4, True), (2e-3, False)])
def test_an_arm_that_is_nearly_the_same_stands_for_it(moved: float, same: bool) -> None:
    """By the torque of each joint, to a thousandth; the first of those remembered, so that small moves do not add up."""
    model, data = start()
    remember(data, alike(data, model))
    other = scaled(model, 1.0 + moved)
    found = alike(data, other)
    assert [one.arm is (model.arm if same else other.arm) for one in found] == [True] * 4
    remember(data, found)
    assert not any(one.arm is model.arm for one in alike(data, scaled(model, 1.0 + 2.5 * moved)))


def test_each_joint_by_itself() -> None:
    """One joint's base parameters move; the whole arm is another one then, and so is what hangs on that joint."""
    model, data = start()
    remember(data, alike(data, model))
    names = [model.columns.names[k].name for k in range(len(model.columns.kept))]
    beta = model.beta.copy()
    beta[names.index("p7")] *= 1.5  # inertia about the waist: no torque of another joint
    other = replace(model, beta=beta)
    assert [one.arm is model.arm for one in alike(data, other)] == [False, True, True, False]


def test_friction_is_none_of_it() -> None:
    model, data = start()
    remember(data, alike(data, model))
    beta = model.beta.copy()
    beta[len(model.columns.kept):] *= 3.0
    assert all(one.arm is model.arm for one in alike(data, replace(model, beta=beta)))


def test_what_acts_at_another_joint_changes_no_encoder_of_this_one() -> None:
    """Friction found at joint 2: what hangs on the motion of the others, and of the arm, is that of the arm as it was."""
    model, data = start()
    remember(data, [asked(data, model)])
    rubbing = model.with_effect(QuadraticDrag(2), np.array([0.7]))
    assert [one is model.arm for one in moving(data, rubbing)] == [True, False, True]
    assert all(one.arm is model.arm for one in alike(data, rubbing))


@pytest.mark.parametrize(("other", "same"), [(TorqueCrosstalk(1, from_joint=2.0), [0.1, 0.1001]),
                                             (TorqueCrosstalk(1, from_joint=2.0), [0.3, 0.02]),
                                             (TorqueCrosstalk(1, from_joint=3.0), [0.3, 0.3])])
def test_as_much_of_what_changes_the_torque_of_others(other: Effect, same: list[float]) -> None:
    """Wherever it is felt: in another number, or from another joint, it is another arm for every joint."""
    model, data = start()
    there = model.with_effect(TorqueCrosstalk(1, from_joint=2.0), np.array(same[:1]))
    remember(data, [asked(data, there)])
    own = model.with_effect(other, np.array(same[1:]))
    assert [one is there.arm for one in moving(data, own)] == [same[1] == 0.1001] * 3


def test_inertia_that_a_rotor_has_taken_over_is_another_rigid_body() -> None:
    """Though all of the torque is that of the start: what hangs on the rigid body alone, whatever it does, is laid anew."""
    model, data = start()
    names = [model.columns.names[k].name for k in range(len(model.columns.kept))]
    beta = model.beta.copy()
    taken = 0.5 * beta[names.index("p12")]
    beta[names.index("p12")] -= taken
    own = replace(model, beta=beta).with_effect(RotorInertia(2), np.array([taken]))
    np.testing.assert_allclose(data.rms(own.torque(data) - model.torque(data)), 0.0, atol=1e-6 * data.rms(model.torque(data)).max())
    case = Case(data, None, model, np.ones(3), (), None)
    remember(data, case.arms(model).asked)
    arms = case.arms(own)
    for effect in (JointElasticity(2), Backlash(2, gap=1e-3)):
        assert arms.of(Family(effect.name, effect.joint, (effect,))) is own.arm


@pytest.mark.parametrize("effect", [GravityTilt(), TorqueCrosstalk(1, from_joint=2.0)], ids=lambda effect: effect.name)
def test_what_changes_the_torque_of_others_makes_another_arm(effect: Effect) -> None:
    """However little of it there is: an encoder that is not true has it on all rows."""
    model, data = start()
    remember(data, [asked(data, model)])
    other = model.with_effect(effect, 1e-9 * np.ones(effect.columns(data.logs[0].motion, model.arm).shape[2]))
    assert all(one is other.arm for one in moving(data, other))


def test_another_rigid_body_is_another_arm_for_all_encoders() -> None:
    model, data = start()
    remember(data, [asked(data, model)])
    other = scaled(model, 1.0 + 2e-3)
    assert all(one is other.arm for one in moving(data, other))


@pytest.mark.parametrize(("left", "factor", "same"), [(0.5, 1.005, True), (0.5, 1.02, False), (0.01, 1.005, False)])
def test_where_much_is_left_unexplained_smooth_columns_may_be_those_of_an_arm_that_differs_by_less(
        left: float, factor: float, same: bool) -> None:
    """A great cause is yet to be found: a tilt's columns are those of an arm half a percent heavier, a gap's are laid anew."""
    model, data = start()
    torque = model.torque(data)
    more = replace(data, known=data.y - (1.0 + left) * torque)  # what is left is `left` of the torque, at every joint
    remember(more, [Asked.of(more, model, torque)])
    other = scaled(model, factor)
    found = alike_of(more, Asked.of(more, other, other.torque(more)))
    assert [one.arm is model.arm for one in found] == [False] * 3 + [same]


def test_some_of_the_logs_are_other_rows() -> None:
    """What a second log did to an arm is nothing that the first knows of."""
    prepared = prepare(Logs((hidden(1), hidden(2))), DiagnosisSettings())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit)
    remember(prepared.data, alike(prepared.data, model))
    for place in (0, 1):
        one = replace(prepared.data, logs=prepared.data.logs[place:place + 1])
        assert alike(one, scaled(model, 1.0 + 5e-4))[0].arm is not model.arm


def test_the_oldest_is_forgotten_and_the_store_with_its_logs() -> None:
    model, data = start()
    for k in range(_MOST + 1):
        remember(data, alike(data, scaled(model, 1.0 + 0.01 * k)))
    assert alike(data, model)[0].arm is model.arm
    assert alike(data, scaled(model, 1.01))[0].arm is not model.arm
    kept, known = weakref.ref(data.logs[0].kept), len(_KNOWN)
    del data
    gc.collect()
    assert kept() is None
    assert len(_KNOWN) < known


def test_nothing_is_taken_from_an_arm_whose_record_is_changed() -> None:
    model, data = start()
    late = model.with_effect(TorqueLag(2), np.array([0.01]))
    remember(data, alike(data, late))
    assert all(one.arm is model.arm for one in alike(data, model))
    remember(data, alike(data, model))
    assert all(one.arm is late.arm for one in alike(data, late))


def test_gaps_are_not_followed_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """And the gain is that of the columns of the arm as it was."""
    model, data = start()
    fit = fit_nominal(data, model.columns)[1]
    family = Family("backlash", 2, tuple(Backlash(2, gap=gap) for gap in (1e-3, 2e-3)))
    before = alike(data, model)
    first, = screen(data, fit, [family], Arms(model.arm, model.arm, before[:-1]))
    remember(data, before)
    other = scaled(model, 1.0 + 5e-4)
    monkeypatch.setattr(Backlash, "several", None)
    again, = screen(data, fit, [family], Arms(other.arm, other.arm, alike(data, other)[:-1]))
    np.testing.assert_array_equal(again.gain, first.gain)


@pytest.mark.parametrize("kind", [kind for kind in all_effects() if kind.from_body], ids=lambda kind: kind.name)
def test_who_says_so_follows_from_the_rigid_body_alone(kind: type[Effect], arm: Arm, motion: Motion) -> None:
    """Without friction, or any effect, its columns are the same. A new file inherits this."""
    shape = placed(kind).at(drawn(placed(kind), 3))
    bare = replace(arm, friction=(), effects=())
    np.testing.assert_array_equal(shape.columns(motion, arm), shape.columns(motion, bare))


@pytest.mark.parametrize("kind", [kind for kind in all_effects() if kind.from_own_joint], ids=lambda kind: kind.name)
def test_who_says_so_does_not_feel_what_adds_its_torque_to_others(kind: type[Effect], arm: Arm, motion: Motion) -> None:
    """A joint beside it that rubs more changes nothing; its own does. A new file inherits this."""
    shape = placed(kind).at(drawn(placed(kind), 3))
    there, beside = (arm.extended(Acting.of(QuadraticDrag(joint), {"coefficient": 0.7}))
                     for joint in (shape.joint, shape.joint % arm.n_joints + 1))
    plain = shape.columns(motion, arm)
    np.testing.assert_allclose(shape.columns(motion, beside), plain, atol=1e-6 * np.abs(plain).max())
    assert not np.allclose(shape.columns(motion, there), plain, atol=1e-6 * np.abs(plain).max())
