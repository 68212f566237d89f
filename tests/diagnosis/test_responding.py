"""What frequency responses name enters the model, and is judged by held-out motion: a soft base on the test bench, its responses'
numbers given (that they are found is tested in test_compliance). With reference logs only a base that became soft is news."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from bench.draw import draw_machine
from bench.faults import make
from pipelines.diagnosis import engine, extension
from pipelines.diagnosis.compliance import Compliance
from pipelines.dynamics.arm import Acting, Arm
from pipelines.effects.soft import BaseResonance
from pipelines.estimation.candidate_columns import Wanted
from pipelines.estimation.preparation import Logs
from pipelines.io.log import ExperimentLog
from tests.diagnose.sessions import but, session
from tests.diagnosis.asking import answered, extended

FEW = but("base_resonance", "torque_offset")


def base(frequency: float | None = None, std: float = 0.02) -> Acting:
    """The bench's soft base at full strength as responses would tell it, or one of another frequency."""
    true = make("base_resonance", draw_machine(7, "fault"), None, 1, 1.0).parameters()
    values = {name: float(value) for name, value in true.items() if isinstance(value, float)}
    values |= {"frequency": frequency} if frequency else {}
    return Acting.of(BaseResonance(), values, {name: std * value for name, value in values.items()})


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> None:
    def compliance(logs: Sequence[ExperimentLog], arm: Arm, without: Sequence[str] = ()) -> Compliance | None:
        return Compliance((base(),), "") if logs else None

    for module in (engine, extension):
        monkeypatch.setattr(module, "compliance", compliance)


@pytest.mark.slow
@pytest.mark.usefixtures("told")
def test_what_responses_name_has_to_win_on_the_rows_as_well() -> None:
    """Responses name a soft base where motion shows a firm one: it is no finding, and the ledger says why."""
    fitted, judging = session(seed=3)
    found = answered(Logs((fitted,), (judging,), (), (fitted,)), exclude=FEW)
    assert not found.findings
    assert "base_resonance" in [one.cause for one in found.rejected]


@pytest.mark.slow
@pytest.mark.usefixtures("told")
def test_the_extension_takes_the_responses_numbers() -> None:
    """Nothing but the base: its frequency is that of the responses, within their deviation."""
    fitted, judging = session("base_resonance", None)
    found = extended(Logs((fitted,), (judging,), (), (fitted,)), Wanted(BaseResonance()))
    assert [one.cause for one in found.findings] == ["base_resonance"]
    assert not found.rejected
    assert found.arm is not None
    assert found.arm.effects[0].values["frequency"] == pytest.approx(base().values["frequency"], rel=0.06)
    assert np.all(found.after.validate <= 1.05 * found.before.validate)
