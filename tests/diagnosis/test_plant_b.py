"""The diagnosis on an independent plant, recorded elsewhere."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipelines.diagnosis.engine import Diagnosis, diagnose
from pipelines.errors import InputRejected
from pipelines.log.hdf5 import read_parts
from tests.healthy import with_signal

_ALONE = (
    "01",
    "05",
    "06",
    "07",
    "08",
    "09",
    "12",
    "15",
    "16",
)  # one cause, not to be mistaken


def _found(shared: Path, arm: str) -> tuple[Diagnosis, dict[str, Any]]:
    answers = json.loads((shared / "plant-b/answers.json").read_text(encoding="utf-8"))
    logs = [read_parts(path)[0] for path in sorted((shared / f"plant-b/arm-{arm}").glob("*.h5"))]
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


def test_a_healthy_arm_has_no_fault(shared: Path) -> None:
    found, _ = _found(shared, "14")
    assert found.decision.verdict == "no-fault-found"


@pytest.mark.slow
def test_an_effect_outside_the_library_has_no_name(shared: Path) -> None:
    found, _ = _found(shared, "13")
    assert found.decision.verdict == "unknown"
    assert not found.decision.causes


@pytest.mark.slow
def test_indistinguishable_causes_are_reported_together(shared: Path) -> None:
    found, _ = _found(shared, "10")
    assert found.decision.verdict == "unknown"
    (cause,) = found.decision.causes
    assert ("stribeck", 1) in (cause.key, *cause.alternatives)


@pytest.mark.slow
def test_a_verdict_does_not_depend_on_what_was_asked_before(shared: Path) -> None:
    first, _ = _found(shared, "12")
    _found(shared, "08")
    again, _ = _found(shared, "12")
    assert again.decision == first.decision


def test_a_joint_that_the_reference_never_moves_is_refused(shared: Path) -> None:
    logs = [read_parts(path)[0] for path in sorted((shared / "plant-b/arm-14").glob("*.h5"))]
    held = [
        with_signal(log, q=np.column_stack([np.full(log.n_samples, log.q[0, 0]), log.q[:, 1:]]))
        if log.role == "reference"
        else log
        for log in logs
    ]
    with pytest.raises(InputRejected, match="joint 1 is held"):
        diagnose(held)
