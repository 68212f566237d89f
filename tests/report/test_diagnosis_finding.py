"""What is said of a finding is true of its numbers: what it does to the tip, how large it is, which joints it has to do with."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.model.diagnosis.result import Finding, Gain, Rejected, ResidualRms, TorqueGain, Value
from pipelines.model.diagnosis.words import how_much, taken_in, where
from pipelines.model.effects import find_effect
from pipelines.report.diagnosis_finding import finding_section
from pipelines.report.diagnosis_words import together, what_stays


def finding(cause: str = "quadratic_drag", joint: int | None = 3, other: dict[str, float] | None = None) -> Finding:
    """Of three joints, the last of which is much the smallest; it takes all that is wrong off that one."""
    before, after = np.array([0.5, 0.4, 0.02]), np.array([0.5, 0.4, 0.005])
    gain = Gain(TorqueGain(before, after, np.zeros((3, 2))), None, "closed-loop", None)
    return Finding(cause, joint, find_effect(cause).title, {name: Value(x, None, "1") for name, x in (other or {}).items()}, 5e-4,
                   0.9, (), None, gain, "residual", 0.03, float("nan"), None)


NOMINAL = ResidualRms(np.array([0.5, 0.4, 0.02]), np.array([0.5, 0.4, 0.02]), np.full(3, 0.005))


@pytest.mark.parametrize(("origin", "own", "said"), [
    ("twin", True, " Joint 1 stays at 2 times what an arm in order leaves, held out, without a name."),
    ("blocks", False, " Joint 1 stays at 20 times its noise, held out, without a name."), ("twin", False, "")])
def test_what_stays_above_the_floor_is_said(origin: str, own: bool, said: str) -> None:
    left = np.array([0.1, 0.04, 0.02])
    floor = {"twin": np.array([0.09, 0.04, 0.02]), "blocks": np.full(3, 0.005)}[origin]
    rms = ResidualRms(left, left, floor)
    there: Any = SimpleNamespace(floor_origin=origin, after_rms=rms, residual_rms=rms,
                                 held_out_floor=np.array([0.05, 0.04, 0.02]) if own else None)
    assert what_stays(there) == said


@pytest.mark.parametrize(("torque", "left", "most"), [(4.6, 1.6, True), (0.29, 0.29, False), (0.2, 0.16, False)])
def test_what_a_model_without_the_finding_imitates_is_said(torque: float, left: float, most: bool) -> None:
    """A torque far larger than all that is left of its joint was mostly in the model already."""
    one = replace(finding(joint=1), torque_rms=torque)
    assert bool(taken_in(one, np.array([left, 9.0]))) == most
    assert not taken_in(replace(one, joint=None), np.array([left, 9.0]))


@pytest.mark.parametrize(("cause", "name", "said"), [("payload", "mass", " of 0.15 kg"), ("cogging", "amplitude", "")])
def test_a_load_is_told_by_its_mass(cause: str, name: str, said: str) -> None:
    """One number says how much there is of a load; of waves in several orders none does."""
    one = finding(cause)
    assert how_much(replace(one, parameters={name: Value(0.15004, 1e-4, "kg")})) == said
    assert how_much(replace(one, parameters={})) == ""


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
    assert "explains 0.05 % of what stands above the floor at all joints together, and 100 % of that of joint 3" in said
    assert "all joints together" not in " ".join(finding_section(1, replace(finding(), explained=0.9), NOMINAL).text)
