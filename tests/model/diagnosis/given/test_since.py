"""With reference logs only what has changed is a finding; what a load at the tip does to the base parameters is one too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.log.experiment import Array, ExperimentLog
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.diagnose import diagnose
from pipelines.model.diagnosis.given.since import since_reference
from pipelines.model.diagnosis.result import Diagnosis
from pipelines.model.effects import effect_names
from pipelines.model.rigid.body import Motion
from tests.model.diagnosis.arms import arm, hidden
from tests.model.estimation.experiments import motion_of

TRIED = ("quadratic_drag", "torque_offset", "payload")
SETTINGS = DiagnosisSettings(without=tuple(name for name in effect_names() if name not in TRIED), evidence=False, limits=False)
MASS, OFFSET = 0.4, 0.05  # [kg], [N m]
STEP = 15.0 / 2048  # [N m] of the converter of joint 3


def push(motion: Motion) -> Array:
    """A constant torque at joint 3."""
    return np.tile([0.0, 0.0, OFFSET], (len(motion.t), 1))


def weight_at_the_tip(motion: Motion) -> Array:
    """Jᵀ m (a - g) of a point mass at the tip: slopes and accelerations by differences over the 0.2 ms of the samples."""
    body, step = arm().body, float(motion.t[1] - motion.t[0])
    tip = body.tip(motion.q)
    acceleration = np.zeros_like(tip)
    acceleration[1:-1] = np.diff(tip, 2, axis=0) / step**2
    acceleration[[0, -1]] = acceleration[[1, -2]]
    force = MASS * (acceleration - np.array([0.0, 0.0, -9.8062]))
    out = np.zeros_like(motion.q)
    for j in range(3):
        moved = motion.q.copy()
        moved[:, j] += 1e-6
        out[:, j] = np.sum((body.tip(moved) - tip) / 1e-6 * force, axis=1)
    return out


def before(log: ExperimentLog) -> ExperimentLog:
    return replace(log, role="reference", name=f"{log.name}-before")


@pytest.fixture(scope="module")
def loaded() -> Diagnosis:
    """The same offset before and after; after it a mass at the tip as well."""
    def both(motion: Motion) -> Array:
        return np.asarray(push(motion) + weight_at_the_tip(motion))

    return diagnose(Logs((hidden(1, both), hidden(2, both)), (), (before(hidden(4, push)), before(hidden(5, push)))), SETTINGS)


@pytest.mark.slow
def test_a_load_at_the_tip_is_named_by_the_base_parameters(loaded: Diagnosis) -> None:
    """Its mass within 3 %."""
    assert [finding.cause for finding in loaded.findings] == ["payload"]
    mass = loaded.findings[0].parameters["mass"]
    assert mass.value == pytest.approx(MASS, rel=0.03)
    assert loaded.verdict == "cause"
    assert loaded.findings[0].origin == "base parameters"


def test_the_ledger_has_the_load_and_what_the_arm_of_before_leaves_stands_beside_it(loaded: Diagnosis) -> None:
    """Fitted anew the base parameters hide it: half a newton metre and more goes by what they were before."""
    line = loaded.ledger[-1]
    assert (line.cause, line.joint, line.accepted) == ("payload", None, True)
    assert line.gain > line.threshold
    assert line.exact_gain > 0.9
    assert loaded.unmoved_rms is not None
    assert np.linalg.norm(loaded.unmoved_rms.validate) > 5.0 * np.linalg.norm(loaded.residual_rms.validate)
    gain = loaded.findings[0].gain.validate_torque_rms
    assert loaded.unmoved_rms.validate == pytest.approx(gain.before, rel=0.02)


def test_the_load_is_worth_what_it_weighs_and_the_model_has_it_apart(loaded: Diagnosis) -> None:
    """Without it the held-out torque is far off. The model's base parameters are those of the bare arm, the load is an effect."""
    gain = loaded.findings[0].gain.validate_torque_rms
    assert (gain.ci95[:, 1] < 0.0).any()
    assert np.linalg.norm(gain.after) < 0.2 * np.linalg.norm(gain.before)
    assert loaded.extended is not None
    assert loaded.extended.effects[-1].place == "payload"
    motion = hidden_motion()
    true, bare, whole = (one.body.torque(motion.q, motion.dq, motion.ddq, one.p) for one in
                         (arm(), loaded.extended, loaded.extended.with_body(loaded.extended.body, loaded_parameters(loaded))))
    assert np.linalg.norm(bare - true) < 0.02 * np.linalg.norm(true)
    assert np.linalg.norm(whole - true) > 0.1 * np.linalg.norm(true)


def hidden_motion() -> Motion:
    return motion_of(3)(np.arange(2000) * 4e-3)


def loaded_parameters(found: Diagnosis) -> Array:
    """Base parameters of the bare arm and its load together, by the torque that they make."""
    assert found.extended is not None
    motion, body = hidden_motion(), found.extended.body
    torque = found.extended.nominal.extended(found.extended.effects[-1]).torque(motion) - found.extended.friction_torque(motion)
    solved, *_ = np.linalg.lstsq(body.regressor(motion.q, motion.dq, motion.ddq).reshape(-1, len(body.parameters)), torque.ravel(),
                                 rcond=None)
    return np.asarray(solved)


def test_what_was_there_before_stands(loaded: Diagnosis) -> None:
    """As sure as both sessions make it, in the report and in the model: the load pulls what they have in common a little."""
    there = [one for one in loaded.standing if (one.cause, one.joint) == ("torque_offset", 3)]
    assert there
    offset = there[0].parameters["offset"]
    true = round(OFFSET / STEP) * STEP  # as the converter gives it
    assert offset.value == pytest.approx(true, rel=0.1)
    assert isinstance(offset.std, float)
    assert 0.0 < offset.std < 0.2 * OFFSET
    assert abs(offset.value - true) < 3.0 * offset.std
    assert loaded.extended is not None
    assert loaded.extended.parameters["torque_offset:3:offset"].std == offset.std


@pytest.mark.slow
def test_nothing_has_changed() -> None:
    found = diagnose(Logs((hidden(1, push), hidden(2, push)), (), (before(hidden(4, push)), before(hidden(5, push)))), SETTINGS)
    assert found.verdict == "nothing-wrong"
    assert found.question == "what has changed"
    assert not found.findings


@pytest.mark.slow
def test_what_is_new_is_found() -> None:
    found = diagnose(Logs((hidden(1, push), hidden(2, push)), (), (before(hidden(4)), before(hidden(5)))), SETTINGS)
    assert [(one.cause, one.joint) for one in found.findings] == [("torque_offset", 3)]


def test_a_load_cannot_be_told_without_reference_logs() -> None:
    """The base parameters take it in, and the answer says which of them."""
    found = diagnose(Logs((hidden(1, weight_at_the_tip), hidden(2, weight_at_the_tip))), replace(SETTINGS, replicas=0))
    assert not found.findings
    hidden_by = next(one for one in found.not_testable if one.cause == "payload")
    assert "p3" in hidden_by.reason
    assert "reference" in hidden_by.reason


def dragged(motion: Motion) -> Array:
    """Quadratic drag of 0.4 N m s²/rad² at joint 2, before and after."""
    out = np.zeros_like(motion.q)
    out[:, 1] = 0.4 * motion.dq[:, 1] * np.abs(motion.dq[:, 1])
    return out


def test_what_stands_of_friction_frees_the_rest_of_it() -> None:
    """The law that stands is subtracted from the later logs; what is left of friction at its joint may have either sign there."""
    logs = Logs((hidden(1, dragged),), (hidden(2, dragged),), (before(hidden(4, dragged)), before(hidden(5, dragged))))
    prepared = prepare(logs, SETTINGS)
    assert prepared.reference is not None
    since = since_reference(prepared, prepared.reference, SETTINGS)
    assert [(one.cause, one.joint) for one in since.standing] == [("quadratic_drag", 2)]
    assert since.case.data.rubbing == {2}
    assert since.case.judge is not None
    assert since.case.judge.rubbing == {2}
