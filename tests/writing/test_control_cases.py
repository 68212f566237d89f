"""The control cases: what the tip does, measured by Pinocchio and MuJoCo, and simulated where nobody recorded it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.dynamics.arm import Arm
from pipelines.estimation.motion import Reconstruction, reconstruct
from pipelines.estimation.result import torques
from pipelines.io.files import open_log
from pipelines.io.log import ExperimentLog
from pipelines.io.model_file import read_model
from pipelines.writing.control_cases import (
    CASES,
    case_of,
    measured_cases,
    simulated_cases,
    tip_std,
)
from pipelines.writing.validation import residual
from tests.dynamics.serial_arms import ARMS
from tests.healthy import rows, with_signal
from tests.writing.judge import TipJudge

SAMPLES = 2200  # of the writing logs: the first letter


@pytest.fixture(scope="module")
def logs(samples: Path) -> list[ExperimentLog]:
    """The six cases as the bench recorded them."""
    return [rows(open_log(samples / f"rrr-healthy/writing-{k}.h5").log, slice(0, SAMPLES)) for k in range(1, 7)]


def test_every_case_is_recognised(logs: list[ExperimentLog]) -> None:
    """By law and feed-forward alone; any other law is none of the six."""
    assert [case_of(log) for log in logs] == [1, 2, 3, 4, 5, 6]
    controller = logs[0].controller
    assert controller is not None
    for other in ({"law": "computed-torque"}, {"law": "unknown"}, {"law": "pd+feedforward", "feedforward": ("gravity",)}):
        assert case_of(replace(logs[0], controller=replace(controller, **other))) is None  # type: ignore[arg-type]
    assert case_of(replace(logs[0], controller=None)) is None


def test_the_error_of_the_tip_is_what_pinocchio_says(logs: list[ExperimentLog], shared: Path,
                                                     tmp_path_factory: pytest.TempPathFactory) -> None:
    """Standard deviation in x, y, z; a constant offset of the tip does not count."""
    judge = TipJudge(ARMS["rrr"](shared, tmp_path_factory.mktemp("rrr")))
    log = rows(logs[0], slice(None, None, 5))
    off = judge.tip(log.q) - judge.tip(log["q_ref"])
    np.testing.assert_allclose(tip_std(log, log.q), off.std(axis=0), rtol=1e-9)


def test_several_logs_of_a_case_are_pooled(logs: list[ExperimentLog]) -> None:
    """The mean square of two logs of case 1, one of which follows its reference exactly."""
    motion = reconstruct(logs[0], Reconstruction())
    exact = with_signal(logs[0], q_ref=motion.motion.q)
    alone = measured_cases([(logs[0], motion)])[1].tip_error_std.values
    both = measured_cases([(logs[0], motion), (exact, motion)])[1]
    np.testing.assert_allclose(both.tip_error_std.values, np.array(alone) / np.sqrt(2.0), rtol=1e-12)
    assert (both.origin, len(both.logs), both.feedforward) == ("measured", 2, CASES[0])


@pytest.fixture(scope="module")
def simulated(logs: list[ExperimentLog]) -> dict[int, tuple[float, float, float]]:
    """All six on the controller of case 1, by a model whose links and friction are up to a fifth off those of the bench's arm."""
    arm = Arm.from_model(read_model("rrr"))
    uncertain = replace(arm, base=tuple(replace(p, std=0.03 * max(abs(p.value), 0.02)) for p in arm.base))
    motion = reconstruct(logs[0], Reconstruction())
    left = residual(logs[0], motion, torques(arm, logs[0], motion))
    found = simulated_cases(logs[0], uncertain, left, range(1, 7), 3, 1)
    assert {one.origin for one in found.values()} == {"simulated"}
    return {case: one.tip_error_std.values for case, one in found.items()}


def test_the_plant_does_what_the_arm_did(logs: list[ExperimentLog], simulated: dict[int, tuple[float, float, float]]) -> None:
    """The wrong model with its replayed residual is the bench's arm: under PD alone its tip errs as MuJoCo's did."""
    measured = measured_cases([(logs[0], reconstruct(logs[0], Reconstruction()))])[1].tip_error_std.values
    np.testing.assert_allclose(simulated[1], measured, rtol=0.02)


def test_the_order_of_the_cases_is_that_of_the_bench(logs: list[ExperimentLog],
                                                     simulated: dict[int, tuple[float, float, float]]) -> None:
    """Simulated and measured agree on which case errs more, wherever two measured ones are clearly apart; 6 is not perfect."""
    pairs = [(log, reconstruct(log, Reconstruction())) for log in logs]
    measured = {case: one.tip_error_std.values for case, one in measured_cases(pairs).items()}
    for a in range(1, 7):
        for b in range(1, 7):
            for k in range(3):
                if measured[a][k] > 1.5 * measured[b][k]:
                    assert simulated[a][k] > simulated[b][k]
    assert min(simulated[6]) > 1e-5
