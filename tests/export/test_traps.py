"""Traps of robot files: each is either carried, as Pinocchio reads the original, or told."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from pipelines.dynamics.arm import Arm
from pipelines.errors import UsageError
from pipelines.export.states import random_states
from pipelines.io.urdf import import_urdf
from tests.export.exported import Exported, exported, off

# Two turning joints; a test changes a word of it.
PLAIN = """<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.1 0.02 0"/><mass value="2"/>
    <inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.1 0 0.03"/><mass value="1"/>
    <inertia ixx="0.005" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.3" rpy="0.2 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="1.5" effort="40" velocity="3"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.3 0 0" rpy="0 0.1 0"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="20" velocity="4"/></joint>
</robot>
"""
WEIGHT = """<link name="gripper"><inertial><origin xyz="0.02 0 0.01" rpy="0.3 0 0"/><mass value="0.7"/>
    <inertia ixx="0.002" iyy="0.003" izz="0.004" ixy="0.0002" ixz="0" iyz="0"/></inertial></link>
  <joint name="flange" type="fixed"><parent link="PARENT"/><child link="gripper"/><origin xyz="0.2 0.1 0" rpy="0 1 0.5"/></joint>
</robot>"""
SWAPPED = PLAIN.replace('<joint name="shoulder"', '<joint name="zz"').replace('<joint name="elbow"', '<joint name="aa"')
HEAD, *JOINTS = SWAPPED.split("  <joint ")
CARRIED = {
    "fixed link with mass at the tip": PLAIN.replace("</robot>", WEIGHT.replace("PARENT", "lower")),
    "joints in another order": f"{HEAD}  <joint {JOINTS[1].replace('</robot>', '')}  <joint {JOINTS[0]}</robot>",
    "mirrored axis": PLAIN.replace('<axis xyz="0 1 0"/><limit lower="-1"', '<axis xyz="0 -1 0"/><limit lower="-1"'),
    "skew axis": PLAIN.replace('<axis xyz="0 1 0"/><limit lower="-1"', '<axis xyz="0.48 0.6 0.64"/><limit lower="-1"'),
    "prismatic joint": PLAIN.replace('name="elbow" type="revolute"', 'name="elbow" type="prismatic"'),
    "products of inertia": PLAIN.replace('izz="0.01" ixy="0" ixz="0" iyz="0"', 'izz="0.01" ixy="0.001" ixz="-0.002" iyz="0.0015"'),
    "pitch of ninety degrees": PLAIN.replace('rpy="0 0.1 0"', 'rpy="0.4 1.5707963267948966 0.2"'),
    "no limits": re.sub(r'"revolute"(.*?)<limit [^>]*/>', r'"continuous"\1', PLAIN, flags=re.DOTALL),
    "names with characters of XML": PLAIN.replace('name="elbow"', 'name="a&amp;&quot;b&lt;"'),
}
# Read, and a note of the card says what was made of it.
TOLD = {
    "names with spaces": (PLAIN.replace('name="elbow"', 'name="elbow joint"'), "'elbow joint' is called 'elbow_joint'"),
    "a fixed link on the way": (PLAIN.replace('<parent link="upper"/>', '<parent link="bracket"/>').replace(
        "</robot>", '<link name="bracket"/><joint name="glue" type="fixed"><parent link="upper"/><child link="bracket"/>'
        '<origin xyz="0 0.1 0" rpy="0 0 0.3"/></joint></robot>'), "merged into them: bracket"),
    "no limit of speed": (PLAIN.replace('effort="20" velocity="4"', 'effort="0" velocity="0"'), "'elbow' has no limit of speed or torque"),
}
REFUSED = {
    "mimic joint": (PLAIN.replace('velocity="4"/>', 'velocity="4"/><mimic joint="shoulder"/>'), "mimic of another"),
    "two fingers": (PLAIN.replace("</robot>", "".join(
        f'<link name="{side}"/><joint name="{side}" type="prismatic"><parent link="lower"/><child link="{side}"/>'
        '<limit lower="0" upper="1" effort="1" velocity="1"/></joint>' for side in ("left", "right")) + "</robot>"), "branch off"),
}


def read(text: str, folder: Path) -> Arm:
    (folder / "arm.urdf").write_text(text)
    return Arm.from_links(import_urdf(folder / "arm.urdf"))


def original(text: str, arm: Arm, found: Exported) -> tuple[np.ndarray, np.ndarray]:
    """Torque at the states of the arm, by Pinocchio from the original file; and of the exported one."""
    model, states = pin.buildModelFromXML(text), random_states(arm.robot, None)
    data, n = model.createData(), model.nv
    rows = []
    for q, v, a in zip(states.q, states.dq, states.ddq, strict=True):
        configuration = pin.neutral(model)
        for k, angle in enumerate(q, 1):
            at = model.joints[k].idx_q
            configuration[at:at + model.joints[k].nq] = (np.cos(angle), np.sin(angle)) if model.joints[k].nq > 1 else angle
        rows.append(pin.rnea(model, data, configuration, v[:n], a[:n]))
    return np.array(rows), found.torque(states)


@pytest.mark.parametrize("to", ["urdf", "mjcf", "c"])
@pytest.mark.parametrize("text", CARRIED.values(), ids=CARRIED)
def test_a_trap_is_carried(text: str, to: str, tmp_path: Path) -> None:
    """The exported file has the torque of the original one, which no line of ours has read."""
    arm = read(text, tmp_path)
    theirs, ours = original(text, arm, exported(arm, to))
    assert off(ours, theirs) <= 1e-9


@pytest.mark.parametrize(("text", "note"), TOLD.values(), ids=TOLD)
def test_a_trap_is_told(text: str, note: str, tmp_path: Path) -> None:
    """And the torque is that of the original all the same."""
    arm = read(text, tmp_path)
    found = exported(arm, "urdf")
    assert any(note in one for one in found.notes)
    theirs, ours = original(text, arm, found)
    assert off(ours, theirs) <= 1e-9


@pytest.mark.parametrize(("text", "words"), REFUSED.values(), ids=REFUSED)
def test_a_trap_is_refused(text: str, words: str, tmp_path: Path) -> None:
    """With what to do about it."""
    with pytest.raises(UsageError, match=words) as problem:
        read(text, tmp_path)
    assert problem.value.remedy


def test_gravity_of_a_wall_is_turned_into_the_world(tmp_path: Path) -> None:
    """A URDF knows no gravity: the base hangs from the wall, and Pinocchio's own gravity does the rest."""
    arm = read(PLAIN, tmp_path)
    wall = Arm.from_links(replace(arm.robot, gravity=(9.81, 0.0, 0.0)))
    found, states = exported(wall, "urdf"), random_states(arm.robot, None)
    model = pin.buildModelFromXML(*found.texts.values())
    data = model.createData()
    theirs = [pin.rnea(model, data, q, v, a) for q, v, a in zip(states.q, states.dq, states.ddq, strict=True)]
    assert any("the base hangs turned" in note for note in found.notes)
    assert off(np.array(theirs), wall.torque(states)) <= 1e-9


def test_the_zero_of_the_logs_is_the_zero_of_the_file(tmp_path: Path) -> None:
    """Offsets of the description are in the frames."""
    arm = read(PLAIN, tmp_path)
    joints = tuple(replace(joint, offset=0.3) for joint in arm.robot.joints)
    shifted = Arm.from_links(replace(arm.robot, joints=joints))
    found, states = exported(shifted, "urdf"), random_states(arm.robot, None)
    assert any("zero of 'elbow'" in note for note in found.notes)
    assert off(found.torque(states), shifted.torque(states)) <= 1e-9
    assert off(found.torque(states), arm.torque(states)) > 1e-3
