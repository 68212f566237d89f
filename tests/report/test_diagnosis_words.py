"""What a reader of a diagnosis is told is words with units; keys are for files and commands."""

from __future__ import annotations

import re

import numpy as np
import pytest

from pipelines.diagnosis.result import (
    Alternative,
    Finding,
    Gain,
    ResidualRms,
    Value,
)
from pipelines.effects import effect_names, find_effect
from pipelines.estimation.model_fit import TorqueGain
from pipelines.report import words
from pipelines.report.diagnosis_report import finding_context
from pipelines.report.document import sections_of
from pipelines.report.words import Units

KEY = re.compile(r"[a-z]+_[a-z0-9]+|\b[a-z]+:\d")
COMMAND = re.compile(r'"rrrid [^"]*"')


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
    told = finding_context(1, found(cause), ResidualRms(*(np.ones(3),) * 3), Units())
    told |= {"folded": False, "command": "", "every": ""}
    (section,) = sections_of("finding", item=told, words=words, units=Units())
    said = " ".join(section.text)
    assert "torque offset at joint 1" in said
    assert KEY.findall(COMMAND.sub("", said)) == []
    numbers = section.tables[0]
    assert len(numbers.rows) == len(find_effect(cause).parameters)
    for name, _, unit, meaning in numbers.rows:
        assert KEY.findall(f"{name} {meaning}") == []
        assert all((unit, meaning))
