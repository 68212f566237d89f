"""A cause that is taken out of the library leaves something without a name: no arm in order."""

from __future__ import annotations

import pytest

from pipelines.diagnosis.result import Diagnosis
from pipelines.estimation.preparation import Logs
from tests.diagnose.sessions import but, session
from tests.diagnosis.asking import answered

_LIBRARY = but("torque_offset", "stribeck")  # neither is like what is hidden here


def diagnosed(cause: str = "", joint: int | None = None) -> Diagnosis:
    return answered(Logs.by_role(session(cause, joint, 4.0, 3)), exclude=_LIBRARY)


@pytest.mark.slow
@pytest.mark.parametrize(("cause", "joint"), [
    ("encoder_eccentricity", 1),  # 1.4 times the floor: within what an arm in order may leave, but no noise
    ("cogging", 3)])  # a line along the angle had passed for noise of the drive, and the floor stood high
def test_something_is_wrong_that_has_no_name(cause: str, joint: int) -> None:
    found = diagnosed(cause, joint)
    assert found.verdict == "unknown"
    assert f"joint {joint}" in found.reason


@pytest.mark.slow
def test_nothing_is_wrong_with_the_same_arm_in_order() -> None:
    assert diagnosed().verdict == "no-fault-found"
