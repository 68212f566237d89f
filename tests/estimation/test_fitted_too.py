"""What shows in held-out logs alone is looked for in them as well, and named."""

from __future__ import annotations

import pytest

from benchmarks.hidden_effects.cases import SealedCase, campaign
from benchmarks.hidden_effects.sessions import record_case
from pipelines.effects.drives import TorqueSaturation
from pipelines.estimation.candidate_columns import Wanted
from pipelines.estimation.preparation import Logs
from tests.diagnosis.asking import answered, extended


def clipping() -> SealedCase:
    """Of the campaign of seed 33: a drive of joint 1 that clips at 25.2 N m, which one of two held-out logs asks for and none of
    those that are fitted."""
    return next(one for one in campaign(33, ("compliance",)) if one.key == "98f0545b59")


@pytest.mark.slow
def test_a_drive_that_clips_in_a_held_out_log_alone_is_named_and_extended_by() -> None:
    logs = Logs.by_role(record_case(clipping()).logs)
    found = answered(logs)
    assert [(one.cause, one.joint) for one in found.findings] == [("torque_saturation", 1)]
    limit = found.findings[0].parameters["limit"]
    assert limit.std is not None
    assert abs(limit.value - 25.204) < 3.0 * limit.std  # type: ignore[operator]
    assert answered(logs, exclude=("torque_saturation",)).verdict == "unknown"
    wider = extended(logs, Wanted(TorqueSaturation(1)))
    assert [(one.cause, one.joint) for one in wider.findings] == [("torque_saturation", 1)]
