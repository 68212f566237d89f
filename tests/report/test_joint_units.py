"""A joint that slides has N and m in every heading, one that turns N m and rad; an arm with both says both."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from pipelines.diagnosis.result import Diagnosis, ResidualRms
from pipelines.estimation.residual_analysis import Curve, Evidence
from pipelines.report.words import each, units_in

NOTHING: Any = {field.name: None for field in fields(Evidence)}
RMS = ResidualRms(np.ones(2), np.ones(2), 0.5 * np.ones(2))


def diagnosis(*units: str) -> Diagnosis:
    """One that has seen joints of these units of position."""
    x = np.zeros(3)
    curves = tuple(Curve(j, against, unit, x, x, x, 0.5) for j, unit in enumerate(units, 1)
                   for against in ("position", "speed"))
    whole: Any = {field.name: None for field in fields(Diagnosis)}
    return Diagnosis(**(whole | {"evidence": (Evidence(**(NOTHING | {"curves": curves})),), "residual_rms": RMS}))


def test_a_diagnosis_says_which_joints_slide() -> None:
    for own, torque, small in ((("rad", "rad"), "N m", "mrad"), (("m", "m"), "N", "mm"), (("m", "rad"), "N or N m", "mm or mrad")):
        units = units_in(diagnosis(*own))
        assert (units.torque, units.thousandths) == (torque, small)
    assert [units.at(joint).torque for joint in (1, 2, None)] == ["N", "N m", "N or N m"]
    assert each("rad or m", "/s") == "rad/s or m/s"
