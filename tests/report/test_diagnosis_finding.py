"""What is said of a finding is true of its numbers: what it does to the tip, how large it is, which joints it has to do with."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure as Drawing

from pipelines.diagnosis.result import Answer, Finding, Gain, Rejected, ResidualRms, Value
from pipelines.effects import find_effect
from pipelines.estimation.model_fit import TorqueGain
from pipelines.estimation.residual_analysis import Proof
from pipelines.report.diagnosis_finding import draw_proof_in_time, finding_section
from pipelines.report.diagnosis_report import what_stays
from pipelines.report.finding_words import how_much, taken_in, where
from pipelines.report.frf_figures import posture_words
from pipelines.report.words import together


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


@pytest.mark.parametrize(("low", "said"), [(0.01, True), (-0.01, False)])
def test_a_joint_that_is_worse_off_with_it_is_named(low: float, said: bool) -> None:
    """A coupling that takes most of two wrists and adds to the error of the base."""
    one = finding()
    change = np.array([[low, 0.4], [-0.1, 0.1], [-0.02, -0.01]])
    gain = TorqueGain(np.array([1.59, 0.4, 0.02]), np.array([1.83, 0.4, 0.005]), change)
    text = " ".join(finding_section(1, replace(one, gain=replace(one.gain, validate_torque_rms=gain)), NOMINAL).text)
    assert ("error is larger at joint 1, 1.83 instead of 1.59 N m rms" in text) is said
    assert ("error is larger" in text) is said


@pytest.mark.parametrize(("torque", "left", "most"), [(4.6, 1.6, True), (0.29, 0.29, False), (0.2, 0.16, False)])
def test_what_a_model_without_the_finding_imitates_is_said(torque: float, left: float, most: bool) -> None:
    """A torque far larger than all that is left of its joint was mostly in the model already."""
    one = replace(finding(joint=1), torque_rms=torque)
    assert bool(taken_in(one, np.array([left, 9.0]))) == most
    assert not taken_in(replace(one, joint=None), np.array([left, 9.0]))


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


@pytest.mark.parametrize("told", [True, False])
def test_responses_that_name_a_cause_are_drawn_first(told: bool) -> None:
    """In each posture, with the frequency that the verdict tells; of a cause that residuals name there are none."""
    f = np.linspace(5.0, 100.0, 40)
    answers = tuple(Answer(1, np.array([0.0, q, 0.0]), "1/(kg m^2)", f, 1.0 + 0.1 * np.cos(f), np.full(40, 0.9), np.ones(40))
                    for q in (0.0, 1.0))
    one = finding("base_resonance", None)
    one = replace(one, parameters={"frequency": Value(28.0, 0.1, "Hz")}, origin="frequency responses" if told else "residual",
                  answers=answers if told else ())
    drawn = finding_section(2, one, NOMINAL).figures
    assert [figure.name for figure in drawn] == (["proof-2-response"] if told else [])
    assert all("28 Hz" in figure.caption and "joint 1" in figure.caption for figure in drawn)
    for figure in drawn:
        drawing = Drawing()
        figure.draw(drawing)
        assert "[1/(kg m²)]" in drawing.axes[0].get_ylabel()
        assert [text.get_text() for text in drawing.axes[0].get_legend().get_texts()] == [
            posture_words(one.posture, 1) for one in answers]


@pytest.mark.parametrize(("log", "said"), [("excitation-11", ", 3.34 s into excitation-11"), (None, ", 3.34 s into every log")])
def test_what_happened_once_is_told_with_its_moment(log: str | None, said: str) -> None:
    touch = replace(finding("contact", None, {"start": 3.337846}), log=log)
    assert where(touch) == said
    assert where(replace(touch, parameters={})) == ""


def test_the_other_joint_is_named() -> None:
    """In title and list: crosstalk comes from a joint, a coupled motor turns with one."""
    crossed, coupled = finding("torque_crosstalk", 2, {"from_joint": 1}), finding("transmission_coupling", 6, {"with_joint": 5.0})
    assert (where(crossed), where(coupled), where(finding(joint=None))) == (
        " at joint 2 (from joint 1)", " at joint 6 (with joint 5)", "")
    assert finding_section(1, crossed, NOMINAL).title == "1. Torque of another joint at joint 2 (from joint 1)"
    twice = (crossed, replace(crossed, joint=3, parameters={"from_joint": Value(2, None, "1")}), Rejected("cogging", 1, ""))
    assert [words for _, words in together(twice)] == [
        "torque of another joint at joints 2 (from joint 1) and 3 (from joint 2)", "cogging at joint 1"]


@pytest.mark.parametrize(("high", "sure"), [(-0.001, True), (0.002, False)])
def test_a_gain_that_held_out_logs_leave_open_is_not_offered_as_sure(high: float, sure: bool) -> None:
    """All time may bear out what a few seconds of held-out logs do not: `extend` waits for longer ones, and the report says so."""
    change = np.array([[-0.1, 0.1], [-0.1, 0.1], [-0.004, high]])
    torque = TorqueGain(np.array([0.5, 0.4, 0.02]), np.array([0.5, 0.4, 0.019]), change)
    said = " ".join(finding_section(1, replace(finding(), gain=replace(finding().gain, validate_torque_rms=torque)), NOMINAL).text)
    assert "rrrid extend LOGS --with quadratic_drag:3" in said
    assert ("beyond its 95 % interval" in said) is not sure


def test_several_findings_are_one_extension() -> None:
    """Each by itself, or all: not one after the other into the same folder."""
    change = np.array([[-0.1, -0.05]] * 3)
    gain = replace(finding().gain, validate_torque_rms=TorqueGain(np.array([0.5, 0.4, 0.02]), np.array([0.1, 0.1, 0.019]), change))
    one = replace(finding(), gain=gain)
    two = replace(one, cause="cogging", joint=1)
    said = " ".join(finding_section(1, one, NOMINAL, beside=(one, two, two)).text)
    assert '"rrrid extend LOGS --with quadratic_drag:3 --with cogging:1" that with all' in said
    assert "with all" not in " ".join(finding_section(1, one, NOMINAL, beside=(one,)).text)


def test_a_small_joint_is_not_hidden_by_a_large_one() -> None:
    """All that is wrong with joint 3 is little of what is wrong with the arm; both are said, where they differ."""
    said = " ".join(finding_section(1, finding(), NOMINAL).text)
    assert "accounts for 0.05 % of the residual above the noise floor at all joints together, and 100 % of that of joint 3" in said
    assert "all joints together" not in " ".join(finding_section(1, replace(finding(), explained=0.9), NOMINAL).text)


def test_no_line_is_drawn_over_a_gap_in_time() -> None:
    """Of a drive at its limit a quarter of a second does not count: a straight line over it would be a residual nobody measured."""
    from matplotlib.figure import Figure

    t = np.r_[np.arange(0.0, 0.1, 0.003), np.arange(0.35, 0.5, 0.003)]
    x = np.linspace(0.0, 1.0, 4)
    axes = Figure().subplots()
    draw_proof_in_time(axes, Proof(1, "position", "rad", x, x, x, x, x, t, np.ones_like(t), np.zeros_like(t), np.ones_like(t)))
    for line in axes.get_lines():
        at, y = (np.asarray(values, dtype=float) for values in line.get_data())
        joined = np.isfinite(y[:-1]) & np.isfinite(y[1:])
        assert np.diff(at)[joined].max() < 0.01
        assert np.isfinite(y).sum() == len(t)


@pytest.mark.parametrize(("left", "doubted"), [(0.0307, True), (0.0295, True), (0.0160, False), (0.0170, False)])
def test_what_another_finding_takes_away_again_is_no_doubt(left: float, doubted: bool) -> None:
    """Torque of another joint makes joint 1 worse until the cogging beside it is known too: then the error is as before."""
    before, after = np.array([0.0162, 0.4, 0.92]), np.array([0.0307, 0.4, 0.004])
    interval = np.array([[0.012, 0.017], [-0.01, 0.01], [-0.93, -0.91]])
    one = replace(finding(), gain=Gain(TorqueGain(before, after, interval), None, "closed-loop", None))
    text = " ".join(finding_section(1, one, NOMINAL, left=np.array([left, 0.01, 0.004])).text)
    assert ("larger at joint 1, 0.0307 instead of 0.0162 N m rms" in text) is doubted
    assert "joint 2," not in text
