"""What a reader of a diagnosis is told is words with units; keys are for files and commands."""

from __future__ import annotations

import math
import re
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from pipelines.diagnosis.result import (
    Alternative,
    BeforeAfter,
    DetectionLimit,
    Finding,
    Gain,
    NotIdentifiable,
    Proof,
    Rejected,
    ResidualRms,
    Result,
    Threshold,
    Trial,
    Value,
)
from pipelines.effects import effect_names, find_effect
from pipelines.estimation.model_fit import TorqueGain
from pipelines.report.diagnosis_finding import (
    finding_section,
    gain_table,
    numbers_section,
    proof_figures,
)
from pipelines.report.diagnosis_report import diagnosis_report, torque_errors
from pipelines.report.words import (
    at_places,
    format_values,
    in_order,
    meaning_of,
    named,
    spoken,
    together,
    without_keys,
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


def test_several_waves_at_a_joint_are_a_row_each() -> None:
    """Two gears, each with three waves: six rows of order, amplitude and phase, and what a row does not have is a dash."""
    one = found("cogging")
    names = [q.name for q in find_effect("cogging").parameters]
    again = {f"{name.partition('_')[0]}_{int(name.partition('_')[2] or 1) + 3}": Value(28.0, None, "1/rev") for name in names}
    del again["phase_6"]
    numbers = numbers_section(1, replace(one, parameters=one.parameters | again)).tables[0]
    assert numbers.columns == ("number", "order [1/rev]", "amplitude [N m]", "phase [rad]")
    assert [row[0] for row in numbers.rows] == [1, 2, 3, 4, 5, 6]
    assert numbers.rows[0][1:] == ("1.00 ± 0.10",) * 3
    assert numbers.rows[5][1:] == ("28", "28", "–")
    assert "waves in one turn" in (numbers.caption or "")


def test_what_is_told_of_parameters_can_be_read_aloud() -> None:
    """Harmonics are counted, pure numbers have no unit, and no two parameters of an effect get the same words."""
    assert format_values([("amplitude_2", Value(0.12, None, "N m")), ("gain_error", Value(0.1, None, "1"))]) == (
        "second amplitude 0.12 N m, gain error 0.1")
    for cause in effect_names():
        names = [spoken(q.name) for q in find_effect(cause).parameters]
        assert len(set(names)) == len(names)


def test_a_stored_reason_is_read_without_keys() -> None:
    """Causes by their titles, with the joint where it is said; a person's name stays capital; other words stay."""
    assert without_keys("absorbed by coulomb:1, p3 and torque_offset:2") == (
        "absorbed by Coulomb friction at joint 1, p3 and torque offset at joint 2")
    assert without_keys("absorbed by p3, coulomb:3:level; needs more") == (
        "absorbed by p3, level of Coulomb friction at joint 3; needs more")
    assert without_keys("spring and friction stay as they are: 3 of 4") == "spring and friction stay as they are: 3 of 4"
    assert named("payload", None) == "payload at the tip"


def test_one_cause_at_several_joints_is_told_once() -> None:
    """Three joints with Stribeck friction need no advice three times."""
    places = (("stribeck", 1), ("payload", None), ("stribeck", 3), ("cogging", 2), ("stribeck", 2))
    found = [Rejected(cause, joint, "") for cause, joint in places]
    assert [words for _, words in together(found)] == ["Stribeck friction at joints 1, 3 and 2", "payload at the tip",
                                                       "cogging at joint 2"]


def test_a_cause_at_a_joint_and_at_all_together_is_a_sentence() -> None:
    """A scale of torque that is wrong at one joint, or at all alike: no joint without its number, in whichever order they come."""
    for joints in ((1, None), (None, 1)):
        said, = (words for _, words in together(Rejected("torque_gain", joint, "") for joint in joints))
        assert said == "wrong torque scale at joint 1 and at all joints together"
    said, = (words for _, words in together(Rejected("torque_gain", joint, "") for joint in (1, None, 3)))
    assert said == "wrong torque scale at joints 1 and 3 and at all joints together"


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


def test_a_change_is_told_in_figures_that_show_its_sign() -> None:
    """The interval of a gain beside the errors it is of: no powers of ten, a decimal more; positions in mrad."""
    torque = TorqueGain(np.array([0.0878, 0.2373]), np.array([0.0876, 0.0221]), np.array([[-4.4e-4, 8.4e-5], [-0.23, -0.2]]))
    gain = Gain(torque, BeforeAfter(np.array([4.87e-5, 2.13e-4]), np.array([4.74e-5, 1.56e-5])), "closed-loop", None)
    rows = gain_table(gain, "").rows
    assert [row[3] for row in rows] == ["−0.0004 to 0.0001", "−0.2300 to −0.2000"]
    assert [row[4:] for row in rows] == [(0.0487, 0.0474), (0.213, 0.0156)]


@pytest.mark.parametrize(("causes", "alternatives", "question", "tone"), [
    (("stribeck", "presliding"), (), "what is wrong", "attention"),
    (("stribeck", "cogging"), (), "what is wrong", "bad"),
    (("presliding",), ("stribeck",), "what is wrong", "attention"),
    (("presliding",), ("backlash",), "what is wrong", "bad"),
    (("stribeck",), (), "what has changed", "bad")])
def test_what_machines_in_order_have_is_no_problem(causes: tuple[str, ...], alternatives: tuple[str, ...], question: str,
                                                   tone: str) -> None:
    """No technician needs to look after a machine for the hump of its friction; where it is new he does, or where it may be a gap.
    """
    near = tuple(Alternative(cause, 2, 0.9, 0.4) for cause in alternatives)
    findings = tuple(replace(found(cause), alternatives=near) for cause in causes)
    there = NOTHING | {"verdict": "cause", "question": question, "findings": findings}
    assert diagnosis_report(Result(**there)).tone == tone


def test_a_threshold_that_nothing_can_exceed_is_no_figure() -> None:
    """No gain is more than the whole residual: 604 % says nothing but that the cause cannot be shown."""
    trials = tuple(Trial(1, "cogging", joint, 0.02, threshold, float("nan"), False, "below its threshold")
                   for joint, threshold in ((1, 0.05), (2, 6.04)))
    bounds = tuple(Threshold("cogging", joint, threshold, "blocks") for joint, threshold in ((1, 0.05), (2, 6.04)))
    page = diagnosis_report(Result(**(NOTHING | {"candidate_causes": trials, "thresholds": bounds})))
    tables = {section.title: section.tables[0] for section in page.sections if section.tables}
    for title, heading in (("Candidate causes", "threshold [%]"), ("What this rests on",
                                                                       "share of the squared residual to exceed [%]")):
        table = tables[title]
        assert [row[table.columns.index(heading)] for row in table.rows] == [5.0, None]
        assert "above 100 % is shown as a dash" in table.caption
    ledger = tables["Candidate causes"]
    assert {"gain in square [%]", "gain in square, fitted exactly [%]"} <= set(ledger.columns)
    assert "squared residual of the fitted logs" in ledger.caption


def test_any_number_of_waves_has_words() -> None:
    """Cogging of three orders with three harmonics each: every number has a name and a meaning of its own, order by order."""
    own = [q.name for q in find_effect("cogging").parameters]
    names = [*own, *(f"{name.removesuffix('_2').removesuffix('_3')}_{3 * k + 1 + (int(name[-1]) - 1 if name[-1] in '23' else 0)}"
                     for k in (1, 2) for name in own)]
    ordered = [name for name, _ in in_order("cogging", {name: Value(1.0, None, "1") for name in sorted(names)})]
    assert ordered == names
    told = [(spoken(name), meaning_of("cogging", name)) for name in names]
    assert len(set(told)) == len(names)
    assert all(meaning for _, meaning in told)
    assert not any(re.search(r"[0-9_]", word) for word, _ in told)
    assert meaning_of("cogging", "order_4").endswith("second one at this joint")
    assert (spoken("order_12"), spoken("order_22"), spoken("w1")) == ("12th order", "22nd order", "w1")


@pytest.mark.parametrize(("reasons", "said"), [
    (("weaker than others",) * 2, "Each of these takes more than its threshold off the residual"),
    (("weaker than others", "weaker than others", "impossible numbers"), "The other one came close, and was not accepted."),
    (("impossible numbers",), "They came close, and were not accepted.")])
def test_what_was_rejected_is_introduced_by_why(reasons: tuple[str, ...], said: str) -> None:
    rejected = tuple(Rejected("cogging", joint, reason) for joint, reason in enumerate(reasons, 1))
    page = diagnosis_report(Result(**(NOTHING | {"rejected": rejected})))
    (section,) = (section for section in page.sections if section.title == "Rejected")
    assert said in section.text[0]
    assert ("not accepted" in section.text[0]) == (reasons[-1] != "weaker than others")


def test_causes_rejected_for_one_reason_share_a_line() -> None:
    """Ten that were merely weaker hide the one that was looked at closely: it comes first, and none of the ten is lost."""
    weaker = [("spring", 2), ("cogging", 1), ("spring", 3), ("payload", None)]
    rejected = (*(Rejected(cause, joint, "weaker than others") for cause, joint in weaker),
                Rejected("stribeck", 1, "the logs do not agree on its size"))
    page = diagnosis_report(Result(**(NOTHING | {"rejected": rejected})))
    (table,) = (section.tables[0] for section in page.sections if section.title == "Rejected")
    assert table.rows == (("Stribeck friction at joint 1", "the logs do not agree on its size"),
                          ("spring at joints 2 and 3; cogging at joint 1; payload at the tip", "weaker than others"))


def test_limits_are_told_for_what_a_technician_can_see() -> None:
    """At how many waves a turn, from which joint: not by which form of a law."""
    at = {"order": Value(106.918, None, "1/rev"), "sharpness": Value(111.0, None, "s/rad"), "inner_loops": Value(0, None, "1")}
    found = (DetectionLimit("cogging", 1, "amplitude", Value(0.1, None, "N m"), at),
             DetectionLimit("cogging", 3, "amplitude", Value(0.1, None, "N"), {"order": Value(40.0, None, "1/(2 pi m)")}),
             DetectionLimit("presliding", 2, "force", Value(0.1, None, "N m"), {"elastic": Value(-1.0, None, "1")}),
             DetectionLimit("stribeck", 2, "amplitude", Value(0.1, None, "N m"), {"speed": Value(0.0341, None, "rad/s")}))
    page = diagnosis_report(Result(**(NOTHING | {"detection_limits": found})))
    (table,) = (section.tables[0] for section in page.sections if section.title == "Detection limits")
    assert [row[table.columns.index("at")] for row in table.rows] == [
        "107 waves a turn", "40 waves in 2π m", "", "speed 0.0341 rad/s"]


@pytest.mark.parametrize(("left", "said"), [
    (0.02, "follows what it predicts"), (0.6, "part of the residual"), (1.0, "most of it stays")])
def test_a_proof_says_what_it_shows(left: float, said: str) -> None:
    """Where the means hardly fall, the figure does not claim that they do."""
    x = np.linspace(0.0, 1.0, 20)
    before = np.where(x < 0.5, 0.5, -0.5)
    proof = Proof(1, "position", "rad", x, before, left * before, before, 0.1 * np.ones(20), x, before, left * before, before)
    caption = proof_figures(1, replace(found("cogging"), proof=proof))[0].caption
    assert said in caption
    assert "0.5 N m rms without the finding" in caption


def test_a_torque_of_any_size_is_told_as_that() -> None:
    """Friction along the turn that the model can take in whole: neither the sentence nor its section gives its size as measured."""
    known = found("position_friction")
    largest = replace(known, parameters=known.parameters | {"amplitude": Value(12.9, np.inf, "N m")})
    small = replace(known, parameters=known.parameters | {"amplitude_3": Value(0.01, np.inf, "N m")})
    for one, open_ in ((known, False), (largest, True), (small, False)):
        page = diagnosis_report(Result(**(NOTHING | {"verdict": "cause", "findings": (one,)})))
        text = " ".join(next(section for section in page.sections if section.title.startswith("1. ")).text)
        assert ("of a size that these logs do not tell" in page.verdict) is open_
        assert ("0.2 N m rms of torque" in page.verdict) is not open_
        assert ("How large its torque is these logs do not tell" in text) is open_


@pytest.mark.parametrize("verdict", ["cause", "no-fault-found", "unknown"])
def test_the_verdict_says_that_no_log_of_its_own_judged(verdict: str) -> None:
    there = NOTHING | {"verdict": verdict, "findings": (found("cogging"),) if verdict == "cause" else ()}
    for held_out in ("logs", "blocks"):
        page = diagnosis_report(Result(**(there | {"held_out": held_out})))
        assert ("Judged by blocks held out of the identification logs" in page.verdict) is (held_out != "logs")
        assert ("none has role validate" in page.verdict) is (held_out == "blocks")


@pytest.mark.parametrize("verdict", ["cause", "no-fault-found", "unknown"])
def test_the_verdict_says_what_was_not_looked_for(verdict: str) -> None:
    """Nothing wrong, but for what nobody looked for, is another answer."""
    there = NOTHING | {"verdict": verdict, "findings": (found("cogging"),) if verdict == "cause" else ()}
    for without in (("presliding", "stribeck"), ("presliding", "coulomb", "stribeck", "presliding")):  # a law is no cause
        page = diagnosis_report(Result(**(there | {"without": without})))
        assert page.verdict.endswith("Not looked for, because you said so: presliding, Stribeck friction.")
    assert "looked for" not in diagnosis_report(Result(**(there | {"without": ("coulomb",)}))).verdict
    assert "looked for" not in diagnosis_report(Result(**there)).verdict


def test_nothing_wrong_says_at_once_of_what_it_says_nothing() -> None:
    """Payload at the tip that these logs cannot tell from the arm is not nothing."""
    beyond = tuple(NotIdentifiable(cause, joint, "why", "what") for cause, joint in (
        ("rotor_inertia", 1), ("rotor_inertia", 2), ("payload", None)))
    said = diagnosis_report(Result(**(NOTHING | {"not_identifiable": beyond}))).verdict
    assert "as far as these logs can tell, and they say nothing of rotor inertia at joints 1 and 2 and payload at the tip;" in said
    one = diagnosis_report(Result(**(NOTHING | {"not_identifiable": beyond[2:]}))).verdict
    assert "they say nothing of payload at the tip;" in one
    assert "nothing of" not in diagnosis_report(Result(**NOTHING)).verdict


def test_several_orders_of_cogging_at_a_joint_name_it_once() -> None:
    """An ODrive's three orders were "cogging at joints 1, 1 and 1"."""
    assert at_places([("cogging", "1")] * 3) == [("cogging", "cogging at joint 1")]
    assert at_places([("cogging", "1"), ("cogging", "1"), ("cogging", "3")]) == [("cogging", "cogging at joints 1 and 3")]
