"""The diagnosis on an independent plant, recorded elsewhere."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipelines.diagnosis.engine import Diagnosis, diagnose
from pipelines.errors import InputRejected
from pipelines.io.files import open_log
from pipelines.io.log import ExperimentLog
from tests.healthy import with_signal

# one cause, not to be mistaken
_ALONE = ("01", "03", "05", "06", "07", "08", "09", "10", "12", "15", "16")


def _found(shared: Path, arm: str, names: str = "*") -> tuple[Diagnosis, dict[str, Any]]:
    answers = json.loads((shared / "plant-b/answers.json").read_text(encoding="utf-8"))
    logs = [open_log(path).log for path in sorted((shared / f"plant-b/arm-{arm}").glob(f"{names}.h5"))]
    return diagnose(logs), answers[f"arm-{arm}"]


@pytest.mark.slow
@pytest.mark.parametrize("arm", _ALONE)
def test_a_cause_is_named_with_its_joint(shared: Path, arm: str) -> None:
    found, answer = _found(shared, arm)
    (truth,) = answer["truth"]
    assert found.decision.verdict == "cause"
    key = found.decision.causes[0].key
    assert key[0] == truth["cause"]
    assert key[1] in (truth["joint"], None)  # the joint of a link stands among its numbers


@pytest.mark.parametrize("names", ["*-1", pytest.param("*", marks=pytest.mark.slow)])
def test_a_healthy_arm_has_no_fault(shared: Path, names: str) -> None:
    """By its excitations, and by all of its logs."""
    found, _ = _found(shared, "14", names)
    assert found.decision.verdict == "no-fault-found"


@pytest.mark.slow
def test_an_effect_outside_the_library_has_no_name(shared: Path) -> None:
    found, _ = _found(shared, "13")
    assert found.decision.verdict == "unknown"
    assert not found.decision.causes


def _healthy_with(shared: Path, more: Callable[[ExperimentLog], np.ndarray]) -> Diagnosis:
    """Diagnose a healthy arm whose logs have more torque [N m] (samples, joints)."""
    logs = [open_log(path).log for path in sorted((shared / "plant-b/arm-14").glob("*.h5"))]
    return diagnose([with_signal(log, tau=log.tau + more(log)) for log in logs])


@pytest.mark.slow
def test_friction_that_stood_before_may_drift_as_friction_does(shared: Path) -> None:
    def asymmetric(log: ExperimentLog) -> np.ndarray:
        out = np.zeros_like(log.tau)
        drift = 1.0 if log.role == "reference" else 1.06
        speed = np.gradient(log.q[:, 1], log.t)
        out[:, 1] = 0.8 * drift * (speed > 0.02) * (1.0 - np.exp(-np.abs(speed) / 0.05))
        return out

    assert _healthy_with(shared, asymmetric).decision.verdict == "no-fault-found"


def test_a_joint_that_the_reference_never_moves_is_refused(shared: Path) -> None:
    logs = [open_log(path).log for path in sorted((shared / "plant-b/arm-14").glob("*.h5"))]
    held = [
        with_signal(log, q=np.column_stack([np.full(log.n_samples, log.q[0, 0]), log.q[:, 1:]]))
        if log.role == "reference"
        else log
        for log in logs
    ]
    with pytest.raises(InputRejected, match="joint 1 is held"):
        diagnose(held)


@pytest.mark.slow
def test_no_torque_scale_of_a_recorded_arm_is_named_that_may_be_none(shared: Path) -> None:
    """Its logs fit -6 % at joint 6, with a standard deviation of 5 % that holds what healthy joints have in small."""
    found = diagnose([open_log(path).log for path in sorted((shared / "real/panda/logs").glob("*.h5"))])
    assert found.decision.verdict == "unknown"
    assert not found.decision.causes
    assert any("torque_gain:6 may be none" in one.stopped for one in found.look.selection.rounds)
