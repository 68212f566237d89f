"""Arms in the loops of logs: each as it moves by itself, and one that cannot be moved is none of the others' business."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.dynamics.arm import Acting, Arm
from pipelines.effects.drives import DriveLag
from pipelines.errors import InputRejected
from pipelines.estimation.estimate import Recipe
from pipelines.estimation.exact_model import Exact
from pipelines.estimation.nominal_fit import fit_nominal
from pipelines.estimation.preparation import Logs, Prepared, prepare
from pipelines.io.log import ExperimentLog
from pipelines.simulation import Experiment, Plant, choose_step, simulate
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


def alone(arm: Arm, log: ExperimentLog, first: ExperimentLog) -> np.ndarray:
    """(samples, joints) [rad] of one arm in one log, with the step that suffices in the first."""
    parts = [Experiment.of_log(one) for one in (log, first)]
    part, other = (one.part(0, round(SECONDS / one.sample_time)) for one in parts)
    return simulate(arm, part, step=choose_step(Plant.of(arm), other)).q[0]


@pytest.mark.slow
def test_each_arm_moves_in_each_log_as_by_itself(arm: Arm, prepared: Prepared) -> None:
    """One without arrays, log by log; one whose drive is late, which takes arrays, in both logs at once; between them one that
    cannot be simulated; and what was measured beside them."""
    lag = DriveLag(joint=2)
    late = arm.extended(Acting.of(lag, {q.name: 0.004 if q.unit == "s" else 1.0 for q in lag.parameters}))
    none = arm.with_body(arm.body, -arm.p)  # accelerates against itself
    motions = prepared.motions
    found = in_loops([arm, none, late], motions, SECONDS)
    assert found[1] is None
    for one, each in ((arm, found[0]), (late, found[2])):
        assert each is not None
        for (q, seen, between), (log, _) in zip(each, motions, strict=True):
            np.testing.assert_allclose(q, alone(one, log, motions[0][0]), rtol=0.0, atol=1e-9)
            np.testing.assert_array_equal(seen, log.q[:len(q)])
            assert between == log.sample_time
            assert len(q) == round(SECONDS / between)
    assert found[0] is not None
    assert found[2] is not None
    assert np.abs(found[0][0][0] - found[2][0][0]).max() > 1e-5


def test_a_log_without_a_controller_has_no_loop(arm: Arm, prepared: Prepared) -> None:
    log, motion = prepared.motions[0]
    unknown = replace(log, controller=None)
    assert in_loop(arm, log)
    assert not in_loop(arm, unknown)
    assert not in_loop(arm.with_body(arm.body, -arm.p), log)
    with pytest.raises(InputRejected):
        in_loops([arm], [(unknown, motion)], SECONDS)
