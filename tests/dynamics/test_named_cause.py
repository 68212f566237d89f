"""Causes as they are written on the command line."""

from __future__ import annotations

import re

import pytest

from pipelines.dynamics.named_cause import acting_cause, wanted_cause
from pipelines.errors import UsageError

REVOLUTE = (True, True, False)


def test_a_cause_with_its_numbers() -> None:
    """Joint, amplitudes and non-linear numbers; what is not given keeps its default."""
    found = acting_cause("coulomb:2:level=1.5", REVOLUTE)
    assert (found.effect.name, found.effect.joint) == ("coulomb", 2)
    assert found.values == {"level": 1.5, "sharpness": 100.0, "roundness": 1.0}
    found = acting_cause("coulomb:1:level=1, sharpness=50", REVOLUTE)
    assert found.values == {"level": 1.0, "sharpness": 50.0, "roundness": 1.0}
    assert {q.origin for q in found.parameters} == {"assumed"}


def test_units_follow_the_kind_of_joint() -> None:
    """A prismatic joint has N where a turning one has N m."""
    assert acting_cause("coulomb:3:level=1", REVOLUTE).parameters[0].unit == "N"


@pytest.mark.parametrize(("text", "code", "words"), [
    ("", "C01", "is not a cause"),
    ("coulom:2:level=1", "C01", "did you mean 'coulomb'"),
    ("coulomb", "C02", "takes a joint"),
    ("coulomb:level=1", "C02", "takes a joint"),
    ("coulomb:2:3:level=1", "C02", "takes a joint"),
    ("coulomb:0:level=1", "C02", "no joint of this arm"),
    ("coulomb:4:level=1", "C02", "no joint of this arm"),
    ("coulomb:-1:level=1", "C02", "no joint of this arm"),
    ("coulomb:x:level=1", "C02", "no joint of this arm"),
    ("coulomb:²:level=1", "C02", "no joint of this arm"),
    ("coulomb:2", "C02", "how strong"),
    ("coulomb:2:", "C02", "takes a joint"),
    ("coulomb:2:lvel=1", "C01", "did you mean 'level'"),
    ("coulomb:2:level", "C02", "takes a joint"),
    ("coulomb:2:level=", "C02", "not a number"),
    ("coulomb:2:level=one", "C02", "not a number"),
    ("coulomb:2:level=nan", "C02", "not a number"),
    ("coulomb:2:level=-1", "C02", "out of range"),
    ("coulomb:2:level=1e9", "C02", "out of range"),
    ("encoder_crosstalk:1:from_joint=9", "C02", "no other joint of this arm, which has 3"),
    ("torque_crosstalk:2:coefficient=0.1,from_joint=2", "C02", "no other joint"),
    ("torque_crosstalk:2:coefficient=0.1,from_joint=1.5", "C02", "no other joint"),
    ("transmission_coupling:2:inertia=0.1,with_joint=7", "C02", "no other joint of this arm, which has 3; it takes 1 or 3"),
    ("transmission_coupling:2:inertia=0.1,with_joint=2", "C02", "no other joint"),
    ("presliding:1:distance=0.03", "C02", "does not say how strong it is"),
    ("contact:force=25", "C02", "force follows from other numbers"),
    ("joint_elasticity:2:frequency=50", "C02", "frequency follows from other numbers"),
    ("cogging:2:order=18", "C02", "does not say how strong it is"),
    ("cogging:2:order=18,phase=1", "C02", "does not say how strong it is"),
    ("gravity_tilt:direction=1", "C02", "does not say how strong it is"),
    ("encoder_eccentricity:3:amplitude=0.001", "C02", "joint 3 slides, and only one that turns"),
    ("link_length:error=0.01,link=9", "C02", "no link with a joint beyond it on this arm, which has 3; it takes 1 or 2"),
    ("link_length:error=0.01,link=3", "C02", "no link with a joint beyond it"),
    ("link_length:error=0.01,link=1.5", "C02", "no link with a joint beyond it"),
])
def test_anything_else_is_refused(text: str, code: str, words: str) -> None:
    """With a code, and a hint where a name is nearly right."""
    with pytest.raises(UsageError, match=words) as refused:
        acting_cause(text, REVOLUTE)
    assert refused.value.code == f"RRID-{code}"
    assert refused.value.remedy


@pytest.mark.parametrize("text", ["torque_saturation:2:limit=9", "backlash:2:gap=0.004"])
def test_an_amplitude_that_physics_gives_need_not_be_given(text: str) -> None:
    """A drive with a limit clips, and a gap is one."""
    assert {p.name: p.value for p in acting_cause(text, REVOLUTE).parameters}["coefficient"] == 1.0


@pytest.mark.parametrize(("text", "remedy"), [
    ("cogging", "cogging:JOINT"), ("cogging:order=6", "cogging:JOINT:order=6"), ("payload:1", "payload"),
    ("payload:1:mass=0.1", "payload:mass=0.1")])
def test_what_to_write_is_no_more_than_what_was_meant(text: str, remedy: str) -> None:
    with pytest.raises(UsageError) as refused:
        wanted_cause(text, REVOLUTE)
    assert refused.value.remedy == f"write {remedy}"


@pytest.mark.parametrize("text", ["transmission_coupling:2:with_joint=7", "transmission_coupling:2:with_joint=2",
                                  "link_length:link=3", "link_length:link=0.5", "encoder_crosstalk:1:from_joint=9"])
def test_a_start_is_held_to_the_arm_as_well(text: str) -> None:
    """What a fit starts from names a joint or a link that there is."""
    with pytest.raises(UsageError, match="RRID-C02"):
        wanted_cause(text, REVOLUTE)
    assert wanted_cause("transmission_coupling:2:with_joint=3", REVOLUTE)[1] == {"with_joint": 3.0}
    assert wanted_cause("link_length:link=2", REVOLUTE)[1] == {"link": 2.0}


def test_a_pure_number_has_no_unit_to_show() -> None:
    """And who is to give a number is told its range."""
    with pytest.raises(UsageError, match=r"coefficient [^,]* to 2(,|\.)") as refused:
        acting_cause("backlash:2", REVOLUTE)
    assert not re.search(r"\d 1\b", refused.value.remedy)


@pytest.mark.parametrize(("command", "of"), [("simulate", {}), ("demo", {"command": "demo"})])
def test_the_command_that_was_called_lists_the_causes(command: str, of: dict[str, str]) -> None:
    with pytest.raises(UsageError) as refused:
        acting_cause("x", REVOLUTE, **of)
    assert refused.value.remedy == f"'rrrid {command} --help' lists all causes"
    with pytest.raises(UsageError) as refused:
        wanted_cause("x", REVOLUTE, "--discriminate")
    assert refused.value.remedy == "'rrrid design-excitation --help' lists all causes"
