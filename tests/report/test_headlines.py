"""The verdict is one line a cause: joint, size, probability, gain and share, never longer than a line that is read at once."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.diagnosis.result import Alternative, Finding, Gain, Value
from pipelines.effects import effect_names, find_effect
from pipelines.estimation.model_fit import TorqueGain
from pipelines.report.finding_words import headlines, how_much


def finding(cause: str, joint: int | None = 3) -> Finding:
    """A finding with every number that its effect has."""
    before, after = np.array([0.5, 0.4, 0.02]), np.array([0.5, 0.4, 0.005])
    gain = Gain(TorqueGain(before, after, np.full((3, 2), -0.01)), None, "closed-loop", None)
    numbers = {q.name: Value(0.5, 0.01, q.unit) for q in find_effect(cause).parameters if q.name != "start"}
    return Finding(cause, joint, find_effect(cause).words.title, numbers, 0.98, 0.9, (), "Record more.", gain, "residual",
                   0.03, float("nan"), None, probability=0.97)


def lines(*findings: Finding) -> tuple[str, ...]:
    found: Any = SimpleNamespace(findings=findings, question="what is wrong", reason="", joints=("waist", "shoulder", "elbow"),
                                 rated=(1.0, 1.0, np.inf))
    return headlines(found)


@pytest.mark.parametrize("cause", effect_names())
def test_every_cause_has_a_line_of_its_own(cause: str) -> None:
    said = lines(finding(cause), finding(cause))
    assert len(said) == 2
    assert len(said[0]) <= 240
    assert all(words in said[0] for words in ("joint 3 (elbow", "(p = 0.97)", "0.02 → 0.005 N m", "98 %"))


def test_a_cause_within_chance_is_no_headline_of_equal_rank() -> None:
    weak = finding("payload", None)
    torque = replace(weak.gain.validate_torque_rms, ci95=np.array([[-0.01, 0.01]] * 3))
    first, second = lines(finding("cogging"), replace(weak, gain=replace(weak.gain, validate_torque_rms=torque)))
    assert first.startswith("Cogging at joint 3 (elbow")
    assert second.startswith("Possible as well, but its gain on held-out time is not beyond chance: Payload")


@pytest.mark.parametrize("cause", effect_names())
def test_alternatives_stand_in_the_line(cause: str) -> None:
    others = tuple(Alternative(name, 2, 0.9, 0.2, {}) for name in ("transmission_coupling", "torque_offset", "spring"))
    (said,) = lines(replace(finding(cause), alternatives=others))
    assert len(said) <= 240
    assert "or coupled transmission at joint 2 (shoulder) (p = 0.20), or 2 more: these logs do not separate them." in said


def test_a_sliding_joint_has_forces() -> None:
    """The numbers of a finding there are in N, and so are its errors."""
    (said,) = lines(replace(finding("torque_offset"), parameters={"offset": Value(0.5, 0.01, "N")}))
    assert "0.500 ± 0.010 N (p" in said
    assert "0.02 → 0.005 N, 98 %" in said


@pytest.mark.parametrize(("cause", "joint", "name", "value", "said"), [
    ("payload", None, "mass", Value(0.15004, 1e-4, "kg"), "0.15004 ± 0.00010 kg"),
    ("torque_gain", 1, "gain_error", Value(-0.1004, 1e-3, "1"), "−10.04 ± 0.10 %"),
    ("time_delay", 1, "delay", Value(0.005, 1e-5, "s"), "5.000 ± 0.010 ms"),
    ("link_length", None, "error", Value(0.012, 1e-4, "m"), "+12.00 ± 0.10 mm"),
    ("gravity_tilt", None, "angle", Value(np.deg2rad(5.0), None, "rad"), "5°"),
    ("torque_gain", 1, "gain_error", Value(float("nan"), None, "1"), "0.03 N m rms")])
def test_the_size_of_a_finding_has_its_usual_unit(cause: str, joint: int | None, name: str, value: Value, said: str) -> None:
    assert how_much(replace(finding(cause, joint), parameters={name: value})) == said
