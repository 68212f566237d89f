"""What a reader of a diagnosis is told is words with units; keys are for files and commands."""

from __future__ import annotations

import math
import re
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from pipelines.diagnosis.result import (
    Alternative,
    Finding,
    Gain,
    Rejected,
    ResidualRms,
    Result,
    Value,
)
from pipelines.effects import effect_names, find_effect
from pipelines.estimation.model_fit import TorqueGain
from pipelines.report.diagnosis_finding import (
    finding_section,
    numbers_section,
)
from pipelines.report.diagnosis_report import torque_errors
from pipelines.report.words import (
    together,
)

KEY = re.compile(r"[a-z]+_[a-z0-9]+|\b[a-z]+:\d")
COMMAND = re.compile(r'"rrrid [^"]*"')

NOTHING: Any = {field.name: () for field in fields(Result)} | {
    "boundary": None,
    "verdict": "no-fault-found", "question": "what is wrong", "reason": "", "noise_floor_origin": "reference logs",
    "held_out": "logs", "robot": "", "residual_rms": ResidualRms(*(np.ones(3),) * 3),
    "after_rms": ResidualRms(*(np.ones(3),) * 3), "rated": (50.0,) * 3}


def found(cause: str) -> Finding:
    """A finding with every parameter that its effect has."""
    three = np.ones(3)
    gain = Gain(TorqueGain(three, 0.5 * three, np.zeros((3, 2))), None, "none", None)
    parameters = {q.name: Value(1.0, 0.1, q.unit) for q in find_effect(cause).parameters}
    alternatives = (Alternative("torque_offset", 1, 0.9, 0.4),)
    return Finding(cause, 2, find_effect(cause).words.title, parameters, 0.9, 0.8, alternatives, "record more", gain,
                   "residual", 0.2, 0.01, None)


@pytest.mark.parametrize("cause", effect_names())
def test_a_finding_is_told_in_words(cause: str) -> None:
    """Of every effect: no key in what is said of it but in the command that is typed; each number with what it is."""
    said = " ".join(finding_section(1, found(cause), ResidualRms(*(np.ones(3),) * 3)).text)
    assert "torque offset at joint 1" in said
    assert KEY.findall(COMMAND.sub("", said)) == []
    numbers = numbers_section(1, found(cause)).tables[0]
    assert len(numbers.rows) == len(find_effect(cause).parameters)
    for name, _, unit, meaning in numbers.rows:
        assert KEY.findall(f"{name} {meaning}") == []
        assert all((unit, meaning))


def test_one_cause_at_several_joints_is_told_once() -> None:
    """Three joints with Stribeck friction need no advice three times."""
    places = (("stribeck", 1), ("payload", None), ("stribeck", 3), ("cogging", 2), ("stribeck", 2))
    found = [Rejected(cause, joint, "") for cause, joint in places]
    assert [words for _, words in together(found)] == ["Stribeck friction at joints 1, 3 and 2", "payload at the tip",
                                                       "cogging at joint 2"]


def test_a_torque_error_stands_beside_the_noise_floor() -> None:
    """In N m and in percent of the rated torque; where nothing extends the model, no column of an extended one."""
    now, then, floor = np.array([0.3, 0.088]), np.array([0.03, 0.08]), np.array([0.03, 0.075])
    before, after = (ResidualRms(one, one, floor) for one in (now, then))
    table = torque_errors(before, after, (60.0, math.inf), floor, "left by reference logs", "")
    assert table.columns == (
        "joint",
        "torque error now [N m]",
        "extended [N m]",
        "left by reference logs [N m]",
        "now [% of rated]",
        "extended [% of rated]",
    )
    assert table.rows[0] == (1, 0.3, 0.03, 0.03, 0.5, 0.05)
    assert table.rows[1][1:4] == (0.088, 0.08, 0.075)
    same = torque_errors(before, before, (60.0, 60.0), floor, "left by reference logs", "")
    assert not any("extended" in name for name in same.columns)
