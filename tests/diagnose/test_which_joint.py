"""Two drives of a planar arm: only the ratio of their torques shows, and no joint is blamed for it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.hidden_effects.cases import SealedCase
from benchmarks.hidden_effects.sessions import record_case
from pipelines.diagnosis import engine
from pipelines.diagnosis.result import Diagnosis
from pipelines.estimation.preparation import Logs
from pipelines.io.log import ExperimentLog
from tests.diagnose.sessions import but
from tests.diagnosis.asking import answered

WRONG = 1.1


@pytest.fixture(scope="module")
def planar() -> tuple[ExperimentLog, ...]:
    """A planar arm in order."""
    return record_case(SealedCase("healthy", (), 3, 11, "short", robot="planar")).logs


def scaled(log: ExperimentLog, joint: int) -> ExperimentLog:
    """What the recorder writes where it takes the torque of a joint for a tenth more."""
    tau = log.tau.copy()
    tau[:, joint - 1] *= WRONG
    return replace(log, signals={**log.signals, "tau": replace(log.signals["tau"], values=tau)})


def diagnosed(logs: tuple[ExperimentLog, ...], *causes: str) -> Diagnosis:
    return answered(Logs.by_role(logs), exclude=but(*causes))


@pytest.mark.slow
@pytest.mark.parametrize("joint", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_a_torque_scale_of_one_of_two_joints_is_told_of_neither(planar: tuple[ExperimentLog, ...], joint: int) -> None:
    """Another name that explains it as well would be wrong half of the time; what would tell is said."""
    found = diagnosed(tuple(scaled(log, joint) for log in planar), "torque_gain", "torque_offset")
    assert found.verdict == "unknown"
    assert not found.findings
    assert "at joint 1" in found.reason
    assert "at joint 2" in found.reason
    assert "known load" in found.reason
    assert "reference" in found.reason
    assert f"at joint {joint} (gain_error -0.09" in found.reason


@pytest.mark.slow
@pytest.mark.parametrize("joint", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_reference_logs_tell_at_which_joint_it_is(planar: tuple[ExperimentLog, ...], joint: int) -> None:
    """Masses are what they were: those of the other joint would have had to grow by a tenth."""
    before = tuple(replace(log, name=f"{log.name}-before", role="reference") for log in planar if log.role == "identify")
    found = engine.diagnose((*before, *(scaled(log, joint) for log in planar)))
    assert [one.key for one in found.decision.causes] == [("torque_gain", joint)]
    (scale,) = found.look.selection.end.model.effects
    assert abs(scale.values["gain_error"] - (1.0 / WRONG - 1.0)) < 0.005  # applied is less than logged
