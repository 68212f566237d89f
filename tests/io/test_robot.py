"""A robot's description in TOML: what is missing, or cannot be in the unit it must have, is said once and completely."""

from __future__ import annotations

import pytest

from pipelines.errors import InputRejected, UsageError
from pipelines.io.robot import parse_robot

HEAD = 'name = "arm"\ngravity = [0.0, 0.0, -9.81]\n[kinematics]\nconvention = "{}"\n'
JOINT = '[[joint]]\nname = "elbow"\ntype = "revolute"\na = 0.4\nalpha = 0.0\nd = 0.0\noffset = 0.0\n'


def test_all_missing_keys_of_a_joint_are_named_at_once() -> None:
    """Nobody finds them one run at a time, and the remedy is a joint that is complete."""
    with pytest.raises(UsageError) as caught:
        parse_robot(HEAD.format("dh") + JOINT + '[[joint]]\nname = "hand"\na = 0.1\n')
    assert caught.value.code == "RRID-C02"
    assert caught.value.message == "robot description, joint[2]: type, alpha, d, offset are missing"
    listed = caught.value.remedy.removeprefix("write at least: [[joint]] ").removesuffix(", a line each")
    assert parse_robot(HEAD.format("mdh") + "[[joint]]\n" + listed.replace(", ", "\n")).n_joints == 1


@pytest.mark.parametrize(("line", "said"), [
    ("alpha = 90.0", "alpha: is 90 rad: looks like degrees"), ("alpha = -180", "alpha: is -180 rad: looks like degrees"),
    ("a = 415.0", "a: is 415 m: looks like mm"), ("d = -169.0", "d: is -169 m: looks like mm"),
])
def test_degrees_and_millimetres_are_seen(line: str, said: str) -> None:
    """Lengths and twists that no arm has are another unit's; out of a log it is the input that is rejected."""
    key = line.split()[0]
    text = HEAD.format("dh") + "".join(f"{line if row.split(' ')[0] == key else row}\n" for row in JOINT.splitlines())
    for inside, kind in ((False, UsageError), (True, InputRejected)):
        with pytest.raises(kind, match=rf"RRID-C02 robot description, joint\[1\]\.{said}"):
            parse_robot(text, inside_log=inside)


def test_long_and_turned_joints_that_exist_are_no_mistake() -> None:
    """A boom of 60 m and a twist written as -3π/2 are read as they are."""
    text = HEAD.format("dh") + JOINT.replace("a = 0.4", "a = 60.0").replace("alpha = 0.0", "alpha = -4.71238898038469")
    assert parse_robot(text).joints[0].a == 60.0
