"""What is said of a finding is true of its numbers: what it does to the tip, how large it is, which joints it has to do with."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pipelines.diagnosis.result import Finding, Gain, ResidualRms, Value
from pipelines.effects import effect_names, find_effect
from pipelines.estimation.model_fit import TorqueGain
from pipelines.report.diagnosis_finding import finding_section
from pipelines.report.finding_words import headlines, how_much


def finding(cause: str = "quadratic_drag", joint: int | None = 3, other: dict[str, float] | None = None) -> Finding:
    """Of three joints, the last of which is much the smallest; it takes all that is wrong off that one."""
    before, after = np.array([0.5, 0.4, 0.02]), np.array([0.5, 0.4, 0.005])
    gain = Gain(TorqueGain(before, after, np.zeros((3, 2))), None, "closed-loop", None)
    return Finding(cause, joint, find_effect(cause).words.title,
                   {name: Value(x, None, "1") for name, x in (other or {}).items()}, 5e-4,
                   0.9, (), None, gain, "residual", 0.03, float("nan"), None)


NOMINAL = ResidualRms(np.array([0.5, 0.4, 0.02]), np.array([0.5, 0.4, 0.02]), np.full(3, 0.005))


@pytest.mark.parametrize(("cause", "joint", "name", "value", "said"), [
    ("payload", None, "mass", Value(0.15004, 1e-4, "kg"), "0.15004 ± 0.00010 kg"),
    ("torque_gain", 1, "gain_error", Value(-0.1004, 1e-3, "1"), "−10.04 ± 0.10 %"),
    ("time_delay", 1, "delay", Value(0.005, 1e-5, "s"), "5.000 ± 0.010 ms"),
    ("link_length", None, "error", Value(0.012, 1e-4, "m"), "+12.00 ± 0.10 mm"),
    ("gravity_tilt", None, "angle", Value(np.deg2rad(5.0), None, "rad"), "5°"),
    ("torque_gain", 1, "gain_error", Value(float("nan"), None, "1"), "0.03 N m rms")])
def test_the_size_of_a_finding_has_its_usual_unit(cause: str, joint: int | None, name: str, value: Value, said: str) -> None:
    """Where no number is the size, the rms of its torque is."""
    assert how_much(replace(finding(cause, joint), parameters={name: value})) == said


@pytest.mark.parametrize("cause", effect_names())
def test_every_cause_has_a_line_of_its_own(cause: str) -> None:
    """Joint by number and name, probability, gain and share, in at most 240 characters."""
    numbers = {q.name: Value(0.5, 0.01, q.unit) for q in find_effect(cause).parameters if q.name != "start"}
    one = replace(finding(cause, 3), parameters=numbers, probability=0.97, explained=0.98)
    result = SimpleNamespace(findings=(one, one), question="what is wrong", reason="", joints=("waist", "shoulder", "elbow"),
                             rated=(1.0, 1.0, np.inf))
    lines = headlines(result)  # type: ignore[arg-type]
    assert len(lines) == 2
    assert len(lines[0]) <= 240
    assert all(words in lines[0] for words in ("joint 3 (elbow", "(p = 0.97)", "0.02 → 0.005 N m", "98 %"))


def test_several_findings_are_one_extension() -> None:
    """Each by itself, or all: not one after the other into the same folder."""
    change = np.array([[-0.1, -0.05]] * 3)
    gain = replace(finding().gain, validate_torque_rms=TorqueGain(np.array([0.5, 0.4, 0.02]), np.array([0.1, 0.1, 0.019]), change))
    one = replace(finding(), gain=gain)
    two = replace(one, cause="cogging", joint=1)
    said = " ".join(finding_section(1, one, NOMINAL, beside=(one, two, two)).text)
    assert '"rrrid extend LOGS --with quadratic_drag:3 --with cogging:1" that with all' in said
    assert "with all" not in " ".join(finding_section(1, one, NOMINAL, beside=(one,)).text)
