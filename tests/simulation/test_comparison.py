"""Arms in the loops of logs: each as it moves by itself, and one that cannot be moved is none of the others' business."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipelines.dynamics.arm import Arm
from pipelines.errors import InputRejected
from pipelines.estimation.estimate import Recipe
from pipelines.estimation.exact_model import Exact
from pipelines.estimation.nominal_fit import fit_nominal
from pipelines.estimation.preparation import Logs, Prepared, prepare
from pipelines.simulation.comparison import in_loop, in_loops
from tests.diagnose.sessions import session

SECONDS = 0.4


@pytest.fixture(scope="module")
def prepared() -> Prepared:
    return prepare(Logs(session()), Recipe())


@pytest.fixture(scope="module")
def arm(prepared: Prepared) -> Arm:
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    return Exact.start(columns, fit).arm


def test_a_log_without_a_controller_has_no_loop(arm: Arm, prepared: Prepared) -> None:
    log, motion = prepared.motions[0]
    unknown = replace(log, controller=None)
    assert in_loop(arm, log)
    assert not in_loop(arm, unknown)
    assert not in_loop(arm.with_body(arm.body, -arm.p), log)
    with pytest.raises(InputRejected):
        in_loops([arm], [(unknown, motion)], SECONDS)
