"""What moved in the base parameters is asked beside the causes that were found: one cause is not told twice."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipelines.model.diagnosis.asked.inputs import Logs
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.diagnose import diagnose
from pipelines.model.diagnosis.result import Diagnosis
from tests.diagnose.sessions import but, healthy_again, session

_FEW = DiagnosisSettings(replicas=0, most=2, without=but("torque_gain", "payload"), evidence=False, limits=False)


def since(cause: str, joint: int | None) -> Diagnosis:
    """The machine with a fault, after reference logs of the same machine without."""
    return diagnose(Logs.by_role((*healthy_again(session()), *session(cause, joint))), _FEW)


@pytest.mark.slow
def test_a_drive_that_pulls_less_is_no_payload() -> None:
    """Its scale is one number; in the base parameters of its row it looks as if links had grown lighter."""
    found = since("torque_gain", 2)
    assert [(one.cause, one.joint) for one in found.findings] == [("torque_gain", 2)]


@pytest.mark.slow
def test_a_payload_is_one() -> None:
    """Half a kilogram at the tip, within 3 %."""
    found = since("payload", None)
    assert [one.cause for one in found.findings] == ["payload"]
    assert found.findings[0].parameters["mass"].value == pytest.approx(0.5, rel=0.03)


@pytest.mark.slow
def test_a_longer_link_is_no_payload_beside() -> None:
    """Twelve millimetres; the masses beyond sit elsewhere then, and base parameters move as if some weight were gone."""
    few = replace(_FEW, without=but("link_length", "payload"))
    found = diagnose(Logs.by_role((*healthy_again(session()), *session("link_length", None))), few)
    assert [one.cause for one in found.findings] == ["link_length"]
    assert "payload" in [one.cause for one in found.rejected]
