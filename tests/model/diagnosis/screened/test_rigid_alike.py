"""What follows from the rigid body alone is laid again only for another rigid body."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest

from pipelines.model.arm import Arm
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.screened.candidates import Arms, Family
from pipelines.model.diagnosis.screened.rigid_alike import _KNOWN, alike, remember
from pipelines.model.diagnosis.screened.screen import screen
from pipelines.model.effects import all_effects
from pipelines.model.effects.backlash import Backlash
from pipelines.model.effects.base import Effect
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
    assert [one is (model.arm if same else other.arm) for one, _ in found] == [True] * 4
    remember(data, found)
    assert not any(one is model.arm for one, _ in alike(data, scaled(model, 1.0 + 2.5 * moved)))


def test_each_joint_by_itself() -> None:
    """One joint's base parameters move; the whole arm is another one then, and so is what hangs on that joint."""
    model, data = start()
    remember(data, alike(data, model))
    names = [model.columns.names[k].name for k in range(len(model.columns.kept))]
    beta = model.beta.copy()
    beta[names.index("p7")] *= 1.5  # inertia about the waist: no torque of another joint
    other = replace(model, beta=beta)
    assert [one is model.arm for one, _ in alike(data, other)] == [False, True, True, False]


def test_friction_is_none_of_it() -> None:
    model, data = start()
    remember(data, alike(data, model))
    beta = model.beta.copy()
    beta[len(model.columns.kept):] *= 3.0
    assert all(one is model.arm for one, _ in alike(data, replace(model, beta=beta)))


def test_some_of_the_logs_are_other_rows() -> None:
    """What a second log did to an arm is nothing that the first knows of."""
    prepared = prepare(Logs((hidden(1), hidden(2))), DiagnosisSettings())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit)
    remember(prepared.data, alike(prepared.data, model))
    for place in (0, 1):
        one = replace(prepared.data, logs=prepared.data.logs[place:place + 1])
        assert alike(one, scaled(model, 1.0 + 5e-4))[0][0] is not model.arm


def test_the_oldest_is_forgotten_and_the_store_with_its_logs() -> None:
    model, data = start()
    for k in range(9):
        remember(data, alike(data, scaled(model, 1.0 + 0.01 * k)))
    assert alike(data, model)[0][0] is model.arm
    assert alike(data, scaled(model, 1.01))[0][0] is not model.arm
    kept, known = weakref.ref(data.logs[0].kept), len(_KNOWN)
    del data
    gc.collect()
    assert kept() is None
    assert len(_KNOWN) < known


def test_nothing_is_taken_from_an_arm_whose_record_is_changed() -> None:
    model, data = start()
    late = model.with_effect(TorqueLag(2), np.array([0.01]))
    remember(data, alike(data, late))
    assert all(one is model.arm for one, _ in alike(data, model))
    remember(data, alike(data, model))
    assert all(one is late.arm for one, _ in alike(data, late))


def test_gaps_are_not_followed_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """And the gain is that of the columns of the arm as it was."""
    model, data = start()
    fit = fit_nominal(data, model.columns)[1]
    family = Family("backlash", 2, tuple(Backlash(2, gap=gap) for gap in (1e-3, 2e-3)))
    before = alike(data, model)
    first, = screen(data, fit, [family], Arms(model.arm, model.arm, before))
    remember(data, before)
    other = scaled(model, 1.0 + 5e-4)
    monkeypatch.setattr(Backlash, "several", None)
    again, = screen(data, fit, [family], Arms(other.arm, other.arm, alike(data, other)))
    np.testing.assert_array_equal(again.gain, first.gain)


@pytest.mark.parametrize("kind", [kind for kind in all_effects() if kind.from_body], ids=lambda kind: kind.name)
def test_who_says_so_follows_from_the_rigid_body_alone(kind: type[Effect], arm: Arm, motion: Motion) -> None:
    """Without friction, or any effect, its columns are the same. A new file inherits this."""
    shape = placed(kind).at(drawn(placed(kind), 3))
    bare = replace(arm, friction=(), effects=())
    np.testing.assert_array_equal(shape.columns(motion, arm), shape.columns(motion, bare))
    assert shape.adds
