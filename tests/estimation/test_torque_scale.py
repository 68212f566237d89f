"""A torque in another scale than the described links need, or a controller commands, is told;
arms with faults of their drives are left to `diagnose`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipelines.estimation.checks.plausibility import plausibility
from pipelines.io.files import open_log
from pipelines.io.log import ExperimentLog
from pipelines.quality.checks import Subject
from tests.faulty import healthy_without_reference
from tests.healthy import good_log, with_signal
from tests.seeds import rarely, seeds


@pytest.fixture(scope="module")
def excited(samples: Path) -> ExperimentLog:
    return open_log(samples / "rrr-healthy/excitation-1.h5").log


def scaled(log: ExperimentLog, joint: int, factor: float) -> ExperimentLog:
    return with_signal(log, tau=log.tau * np.where(np.arange(log.n_joints) == joint, factor, 1.0))


@pytest.mark.parametrize("joint", [0, *rarely(1), 2])
@pytest.mark.parametrize("factor", [0.1, *rarely(0.25), 4.0])
def test_a_torque_in_another_scale_is_measured(excited: ExperimentLog, joint: int, factor: float) -> None:
    (check,) = [c for c in plausibility(Subject(scaled(excited, joint, factor))) if c.code == "RRID-S15"]
    assert check.gate
    assert check.message.startswith(f"tau of joint {joint + 1} is ")
    assert "times what the controller of this log commands" in check.message


@pytest.mark.parametrize("joint", range(3))
@pytest.mark.parametrize("factor", [0.8, 1.0, 1.3])
def test_a_gain_is_left_to_diagnose(excited: ExperimentLog, joint: int, factor: float) -> None:
    found = plausibility(Subject(scaled(excited, joint, factor)))
    assert [c for c in found if c.code == "RRID-S15" and c.level != "ok"] == []


@pytest.mark.parametrize("seed", seeds(6, 2))
def test_an_encoder_in_another_scale_is_no_torque(seed: int) -> None:
    """The angle of joint 1 bends nothing, but its square in the others' centrifugal torque tells it from a torque."""
    log = healthy_without_reference(good_log(seed))
    wrong = with_signal(log, q=log.q * [2.0, 1.0, 1.0])
    (check,) = [c for c in plausibility(Subject(wrong)) if c.code == "RRID-S15"]
    assert check.message.startswith("q of joint 1 fits if multiplied by 0.5")


@pytest.mark.parametrize("factor", [0.1, 8.0])
def test_a_waist_that_pushes_too_hard_is_not_blamed_on_its_encoder(excited: ExperimentLog, factor: float) -> None:
    (check,) = [c for c in plausibility(Subject(scaled(excited, 0, factor))) if c.code == "RRID-S15"]
    assert check.message.startswith("tau of joint 1 is")
