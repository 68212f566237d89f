"""A joint that slides has N and m in every heading, one that turns N m and rad; an arm with both says both."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from pipelines.diagnosis.result import BeforeAfter, Diagnosis, Extension, Gain, ResidualRms
from pipelines.estimation.model_fit import TorqueGain
from pipelines.estimation.residual_analysis import Curve, Evidence
from pipelines.excitation.constraints import Limit
from pipelines.report.diagnosis_finding import gain_table
from pipelines.report.diagnosis_report import torque_errors
from pipelines.report.words import Units, each, unit_of, units_in

NOTHING: Any = {field.name: None for field in fields(Evidence)}
RMS = ResidualRms(np.ones(2), np.ones(2), 0.5 * np.ones(2))
NOW = ResidualRms(np.ones(2), 0.5 * np.ones(2), 0.5 * np.ones(2))


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


def test_an_extension_says_it_also_where_it_has_no_model() -> None:
    """The newtons that a slide's refused cause leaves are no newton metres."""
    whole: Any = {field.name: None for field in fields(Extension)}
    assert units_in(Extension(**(whole | {"revolute": (False, True)}))).torque == "N or N m"


def test_headings_bear_the_units_of_the_arm() -> None:
    """Torque errors and gains of a gantry in N and mm, of an arm in N m and mrad: no heading has the other's."""
    gain = Gain(TorqueGain(np.ones(2), np.ones(2), np.zeros((2, 2))), BeforeAfter(np.ones(2), np.ones(2)), "closed-loop", None)
    for turning, torque, small in (((False, False), "[N]", "[mm]"), ((True, True), "[N m]", "[mrad]")):
        errors = torque_errors(RMS, NOW, (50.0, 50.0), RMS.noise_floor, "noise", "", Units(turning)).columns
        gains = gain_table(gain, "", Units(turning)).columns
        assert [head.count(torque) for head in (*errors[1:4], *gains[1:4])] == [1] * 6
        assert [head.count(small) for head in gains[4:]] == [1, 1]


def test_a_designed_motion_says_it_by_its_limits() -> None:
    limits = [Limit("position", 1, -1.0, 1.0, "m"), Limit("position", 2, -1.0, 1.0, "rad"), Limit("tip x", None, 0.0, 1.0, "m")]
    assert unit_of(limits, "position") == "m or rad"
    assert unit_of(limits, "acceleration") == "rad/s^2"
