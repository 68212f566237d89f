"""What is said of a finding is true of its numbers: what it does to the tip, how large it is, which joints it has to do with."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.diagnosis.result import Finding, Gain, ResidualRms, Value
from pipelines.effects import find_effect
from pipelines.estimation.model_fit import TorqueGain
from pipelines.report.diagnosis_finding import finding_section
from pipelines.report.diagnosis_report import what_stays
from pipelines.report.finding_words import how_much


def finding(cause: str = "quadratic_drag", joint: int | None = 3, other: dict[str, float] | None = None) -> Finding:
    """Of three joints, the last of which is much the smallest; it takes all that is wrong off that one."""
    before, after = np.array([0.5, 0.4, 0.02]), np.array([0.5, 0.4, 0.005])
    gain = Gain(TorqueGain(before, after, np.zeros((3, 2))), None, "closed-loop", None)
    return Finding(cause, joint, find_effect(cause).words.title,
                   {name: Value(x, None, "1") for name, x in (other or {}).items()}, 5e-4,
                   0.9, (), None, gain, "residual", 0.03, float("nan"), None)


NOMINAL = ResidualRms(np.array([0.5, 0.4, 0.02]), np.array([0.5, 0.4, 0.02]), np.full(3, 0.005))


@pytest.mark.parametrize(
    ("origin", "left", "said"),
    [
        (
            "reference logs",
            (0.1, 0.04),
            "Ratio of the remaining held-out residual to the noise floor: joint 1 2.",
        ),
        ("reference logs", (0.06, 0.04), ""),
        (
            "blocks",
            (0.6, 0.04),
            "On held-out motion the residual of joint 1 is above the noise; whether it is above "
            "that of a healthy arm is not known: there are no reference logs.",
        ),
        ("blocks", (0.4, 0.04), ""),  # any arm leaves more than noise at its reversals
    ],
)
def test_what_stays_above_the_floor_is_said(
    origin: str, left: tuple[float, ...], said: str
) -> None:
    floor = np.array([0.05, 0.04])
    rms = ResidualRms(np.array(left), np.array(left), floor)
    found: Any = SimpleNamespace(noise_floor_origin=origin, after_rms=rms, residual_rms=rms)
    assert what_stays(found) == said


@pytest.mark.parametrize(("cause", "joint", "name", "value", "said"), [
    ("payload", None, "mass", Value(0.15004, 1e-4, "kg"), " of 0.15 kg"), ("cogging", 2, "amplitude", Value(0.4, 0.01, "N m"), ""),
    ("base_resonance", None, "frequency", Value(28.02, 0.1, "Hz"), " (28 Hz)"),
    ("torque_gain", 1, "gain_error", Value(-0.1004, 1e-3, "1"), " (-10 %)"),
    ("torque_gain", 1, "gain_error", Value(0.02, 1e-3, "1"), " (+2 %)"),
    ("time_delay", 1, "delay", Value(0.005, 1e-5, "s"), " (5 ms)"),
    ("link_length", None, "error", Value(0.012, 1e-4, "m"), " (+12 mm)"),
    ("gravity_tilt", None, "angle", Value(np.deg2rad(5.0), 1e-3, "rad"), " (5°)"),
    ("encoder_eccentricity", 3, "amplitude", Value(0.004, 1e-4, "rad"), " (4 mrad)"),
    ("rotor_inertia", 3, "inertia", Value(0.006, 1e-4, "kg m^2"), " (0.006 kg m²)"), ("rotor_inertia", 3, "inertia",
                                                                                    Value(5.2, 0.1, "kg"), " (5.2 kg)"),
    ("torque_gain", 1, "gain_error", Value(float("nan"), None, "1"), ""),
    ("torque_saturation", 2, "limit", Value(1253.0, 0.1, "N m"), " (1250 N m)")])
def test_how_much_there_is_is_told_in_usual_units(cause: str, joint: int | None, name: str, value: Value, said: str) -> None:
    """One number says how much there is of a load, and by how much a torque scale is off; of waves none does."""
    one = finding(cause, joint)
    assert how_much(replace(one, parameters={name: value})) == said
    assert how_much(replace(one, parameters={})) == ""


def test_several_findings_are_one_extension() -> None:
    """Each by itself, or all: not one after the other into the same folder."""
    change = np.array([[-0.1, -0.05]] * 3)
    gain = replace(finding().gain, validate_torque_rms=TorqueGain(np.array([0.5, 0.4, 0.02]), np.array([0.1, 0.1, 0.019]), change))
    one = replace(finding(), gain=gain)
    two = replace(one, cause="cogging", joint=1)
    said = " ".join(finding_section(1, one, NOMINAL, beside=(one, two, two)).text)
    assert '"rrrid extend LOGS --with quadratic_drag:3 --with cogging:1" that with all' in said
    assert "with all" not in " ".join(finding_section(1, one, NOMINAL, beside=(one,)).text)
