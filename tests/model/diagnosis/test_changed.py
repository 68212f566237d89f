"""What has changed since the reference logs does not hang on how many processes look for it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pipelines.log import shared_work
from pipelines.model.diagnosis import changed
from pipelines.model.diagnosis.asked.inputs import Logs
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.believed.steadied import steadied
from pipelines.model.diagnosis.diagnose import diagnose
from pipelines.model.diagnosis.result import Diagnosis
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.search import Found, Step
from pipelines.model.effects import effect_names
from tests.model.diagnosis.arms import hidden, wave

FEW = ("cogging", "quadratic_drag", "torque_offset", "encoder_eccentricity")
SETTINGS = DiagnosisSettings(without=tuple(name for name in effect_names() if name not in FEW), evidence=False)


def diagnosed(two: bool, monkeypatch: pytest.MonkeyPatch) -> Diagnosis:
    monkeypatch.setattr(shared_work, "_second", lambda: two)
    before = replace(hidden(4), role="reference", name="before")
    return diagnose(Logs((hidden(1, wave),), (), (before,)), SETTINGS)


@pytest.mark.slow
def test_limits_stand_on_the_last_look_as_if_all_had_been_fitted_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """The model of the last look, refitted with the ripple among the noise, and what was screened beside it."""
    asked: list[tuple[Step, Step]] = []
    limits = changed._limits

    def noted(found: Found, case: Case, *more: Any) -> Any:
        told: list[Step] = []
        monkeypatch.setattr(changed, "limits_of", lambda last, *_: told.append(last) or ((), ()))
        answer = limits(found, case, *more)
        asked.append((told[0], steadied(found, case)[0].steps[-1]))
        return answer

    monkeypatch.setattr(changed, "_limits", noted)
    diagnosed(False, monkeypatch)
    (own, whole), = asked
    assert whole.before.model.effects
    assert own.before.model.effects == whole.before.model.effects
    np.testing.assert_array_equal(own.before.left, whole.before.left)
    assert own.screened is whole.screened


@pytest.mark.slow
def test_it_is_the_same_with_one_process_and_with_two(monkeypatch: pytest.MonkeyPatch) -> None:
    """Findings, limits, and what is stored for the next time: of every cause, though the limits ask of most of them elsewhere."""
    one, two = (diagnosed(there, monkeypatch) for there in (False, True))
    assert [(f.cause, f.joint, f.parameters) for f in one.findings] == [(f.cause, f.joint, f.parameters) for f in two.findings]
    assert [(f.cause, f.joint) for f in one.findings] == [("cogging", 2)]
    assert one.detectable == two.detectable
    assert len(one.detectable) > 4
    assert one.calibration is not None
    assert two.calibration is not None
    stored = [{(c.cause, c.joint): c.own for c in found.calibration.causes} for found in (one, two) if found.calibration]
    assert stored[0] == pytest.approx(stored[1])
    assert {cause for cause, _ in stored[0]} == set(FEW)
