"""The result of a diagnosis on an independent plant: numbers, gain on held-out logs, limits."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import pytest

from pipelines.diagnosis.answer import answer
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.engine import diagnose_prepared
from pipelines.diagnosis.extension import extend
from pipelines.diagnosis.limits import Limits, limits_of
from pipelines.diagnosis.result import Diagnosis, Extended, Finding
from pipelines.effects import find_effect
from pipelines.estimation.candidate_columns import Wanted
from pipelines.estimation.preparation import Logs, Prepared, prepare
from pipelines.io.files import open_log

_BLOCKS = 10


@dataclass(frozen=True)
class _Arm:
    prepared: Prepared
    told: Diagnosis
    limits: Limits
    extended: Extended | None
    truth: dict[str, float]
    place: tuple[str, int]


def _arm(shared: Path, number: str, names: str = "*") -> _Arm:
    answers = json.loads((shared / "plant-b/answers.json").read_text(encoding="utf-8"))
    (truth,) = answers[f"arm-{number}"]["truth"]
    paths = sorted((shared / f"plant-b/arm-{number}").glob(f"{names}.h5"))
    config = DiagnosisConfig()
    settings = config.recipe()
    prepared = prepare(Logs.by_role([open_log(path).log for path in paths]), settings)
    found = diagnose_prepared(prepared, config)
    told, extended = answer(prepared, found, lambda words: None, _BLOCKS, whole=False)
    limits = limits_of(found.look.later, found.look.selection.end, found.look.baseline)
    return _Arm(prepared, told, limits, extended, truth["parameters"], (truth["cause"], truth["joint"]))


@pytest.fixture(scope="module")
def lagging(shared: Path) -> _Arm:
    """An arm whose drive of joint 2 lags by 5.3 ms, and its excitations."""
    return _arm(shared, "09", "*-1")


def _only(arm: _Arm) -> Finding:
    (finding,) = arm.told.findings
    assert (finding.cause, finding.joint) == arm.place
    return finding


def _within(finding: Finding, name: str, truth: float, stds: float) -> bool:
    told = finding.parameters[name]
    assert isinstance(told.value, float)
    assert isinstance(told.std, float)
    return abs(told.value - truth) < stds * told.std


def test_the_cause_has_its_name_and_its_true_number(lagging: _Arm) -> None:
    finding = _only(lagging)
    assert (lagging.told.verdict, lagging.told.question) == ("cause", "what has changed")
    assert _within(finding, "time_constant", lagging.truth["time_constant"], 2.0)
    assert finding.explained > 0.9


def test_held_out_torque_falls_to_what_the_reference_leaves(lagging: _Arm) -> None:
    gain = _only(lagging).gain.validate_torque_rms
    assert gain.ci95[1, 1] < 0.0
    before, after = lagging.told.residual_rms, lagging.told.after_rms
    assert (after.validate < 1.2 * after.noise_floor).all()
    assert before.validate[1] > 10.0 * after.noise_floor[1]


def test_the_extended_arm_leaves_what_is_told_of_it(lagging: _Arm) -> None:
    arm, judge = lagging.told.extended, lagging.prepared.judge
    assert arm is not None
    assert judge is not None
    left = judge.y - judge.lay(arm.torque)
    assert judge.rms(left) == pytest.approx(lagging.told.after_rms.validate, rel=1e-3)


def test_as_small_a_lag_would_have_been_found_at_the_other_joints(lagging: _Arm) -> None:
    limits = {(one.cause, one.joint): one.minimum.value for one in lagging.limits.detection_limits}
    assert lagging.place not in limits
    for joint in (1, 3):
        smallest = limits["drive_lag", joint]
        assert isinstance(smallest, float)
        assert 0.0 < smallest < 0.1 * lagging.truth["time_constant"]


@pytest.mark.slow
def test_a_cause_that_is_not_there_does_not_extend_the_model(lagging: _Arm) -> None:
    places = (lagging.place, ("spring", 3))
    wanted = [Wanted(find_effect(name)(joint=joint)) for name, joint in places]
    found = extend(lagging.prepared, wanted, DiagnosisConfig(), _BLOCKS)
    assert [(one.cause, one.joint) for one in found.findings] == [lagging.place]
    assert [(one.cause, one.joint) for one in found.rejected] == [("spring", 3)]


@pytest.mark.slow
def test_a_torque_scale_is_right_within_its_deviation(shared: Path) -> None:
    arm = _arm(shared, "05")
    assert _within(_only(arm), "gain_error", arm.truth["gain_error"], 2.0)
    assert (arm.told.after_rms.validate < 1.2 * arm.told.after_rms.noise_floor).all()
