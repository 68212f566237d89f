"""URDFs: kinematics, limits and links as Pinocchio reads them; everything dangerous or malformed refused by name."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipelines.errors import InputRejected, UsageError
from pipelines.io.robot import RobotDescription
from pipelines.io.robot_files import load_robot
from pipelines.io.urdf import chain_from_urdf, import_urdf

_LIMIT = '<limit lower="-1" upper="2" effort="5" velocity="3"/>'


def _joint(name: str, parent: str, child: str, kind: str = "revolute", inside: str = '<axis xyz="0 0 1"/>') -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'


def _robot(*parts: str, links: str = "abc") -> str:
    return f'<robot name="r">{"".join(f"<link name={chr(34)}{k}{chr(34)}/>" for k in links)}{"".join(parts)}</robot>'


def _import(tmp_path: Path, text: str | bytes, tip_link: str | None = None) -> RobotDescription:
    path = tmp_path / "arm.urdf"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return import_urdf(path, tip_link)


def _refused(tmp_path: Path, text: str | bytes, tip_link: str | None = None) -> UsageError:
    with pytest.raises(UsageError) as caught:
        _import(tmp_path, text, tip_link)
    assert "arm.urdf" in str(caught.value)
    return caught.value


TWO = _robot(_joint("j1", "a", "b", inside='<axis xyz="0 0 2"/>' + _LIMIT), _joint("j2", "b", "c", "continuous"))


# what is read

def test_tx40_is_read_as_pinocchio_reads_it(shared: Path) -> None:
    """Names, limits and link parameters of the real TX40 are Pinocchio's; its own copy of the text gives them again."""
    path = shared / "real" / "tx40" / "tx40.urdf"
    robot, model = import_urdf(path), pin.buildModelFromUrdf(str(path))
    assert [joint.name for joint in robot.joints] == list(model.names)[1:]
    np.testing.assert_array_equal([j.position for j in robot.joints],
                                  np.stack([model.lowerPositionLimit, model.upperPositionLimit], axis=1))
    np.testing.assert_array_equal([j.velocity for j in robot.joints], model.velocityLimit)
    np.testing.assert_array_equal([j.torque for j in robot.joints], model.effortLimit)
    assert robot.gravity == (0.0, 0.0, -9.81)
    assert robot.tip_link == "tool0"
    _assert_links_equal(robot, model)
    again = pin.buildModelFromXML(robot.urdf_text)
    for mine, theirs in zip(again.jointPlacements, model.jointPlacements, strict=True):
        assert mine.isApprox(theirs, 1e-15)


def _assert_links_equal(robot: RobotDescription, model: object) -> None:
    for joint, inertia in zip(robot.joints, list(model.inertias)[1:], strict=True):  # type: ignore[attr-defined]
        m, mx, my, mz, xx, xy, yy, xz, yz, zz = inertia.toDynamicParameters()
        assert joint.link is not None
        np.testing.assert_allclose(joint.link.mass, m, rtol=1e-15)
        np.testing.assert_allclose(np.array(joint.link.com) * m, [mx, my, mz], atol=1e-15)
        np.testing.assert_allclose(joint.link.inertia, [xx, yy, zz, -xy, -xz, -yz], atol=1e-15)


def test_links_fixed_to_a_moving_one_are_merged_into_it(tmp_path: Path) -> None:
    """A motor bolted on askew, with its own inertial axes, moves as part of its link: Pinocchio's merged inertia."""
    from tests.dynamics.serial_arms import SKEW_URDF, skew

    arm = skew(tmp_path)
    _assert_links_equal(arm.robot, arm.model)
    assert [j.type for j in arm.robot.joints] == ["revolute", "prismatic", "revolute", "revolute"]
    assert "inertial" in SKEW_URDF
    assert "inertial" not in str(arm.robot.urdf_text)


def test_toml_beside_a_urdf_embeds_it(tmp_path: Path, shared: Path) -> None:
    """`urdf = "…"` in a TOML file brings joints, limits and links of the URDF, and keeps what the TOML says itself."""
    path = tmp_path / "tx40.toml"
    where = os.path.relpath(shared / "real" / "tx40" / "tx40.urdf", tmp_path)
    path.write_text(f'name = "mine"\ngravity = [0.0, 1.0, -9.7]\n[kinematics]\nconvention = "urdf"\nurdf = "{where}"\n')
    robot, plain = load_robot(path), import_urdf(shared / "real" / "tx40" / "tx40.urdf")
    assert (robot.name, robot.gravity) == ("mine", (0.0, 1.0, -9.7))
    assert robot.joints == plain.joints
    assert robot.urdf_text == plain.urdf_text
    assert load_robot(shared / "real" / "tx40" / "tx40.urdf") == plain


def test_missing_and_zero_limits_are_no_limits(tmp_path: Path) -> None:
    """A joint without limits, or with the zeros that drawing programs write, may turn without end."""
    zero = '<axis xyz="0 0 1"/><limit lower="0" upper="0" effort="0" velocity="0"/>'
    robot = _import(tmp_path, _robot(_joint("j1", "a", "b", inside=zero), _joint("j2", "b", "c")))
    for joint in robot.joints:
        assert joint.position == (-math.inf, math.inf)
        assert (joint.velocity, joint.torque) == (math.inf, math.inf)
    assert robot.joints[0].link is None


@given(st.tuples(*3 * [st.floats(-4.0, 4.0)]))
def test_roll_pitch_yaw_turn_about_fixed_axes(rpy: tuple[float, float, float]) -> None:
    """R = Rz(yaw) Ry(pitch) Rx(roll), as Pinocchio has it."""
    origin = f'<origin rpy="{rpy[0]!r} {rpy[1]!r} {rpy[2]!r}" xyz="1 2 3"/>'
    placed = chain_from_urdf(_robot(_joint("j", "a", "b", inside=origin), links="ab")).joints[0]
    np.testing.assert_allclose(placed.rotation, pin.rpy.rpyToMatrix(*rpy), atol=1e-15)
    np.testing.assert_array_equal(placed.position, [1.0, 2.0, 3.0])


def test_a_branch_needs_a_tip_and_is_then_carried_along(tmp_path: Path) -> None:
    """Two fingers: refused without tip_link; with it the fingers' mass rides on the hand, held at zero."""
    finger = '<link name="{0}"><inertial><mass value="0.5"/><origin xyz="0.1 0 0"/></inertial></link>'
    text = _robot(_joint("j1", "a", "b"), _joint("f1", "b", "left", "prismatic"), _joint("f2", "b", "right", "prismatic"),
                  _joint("weld", "b", "c", "fixed"), finger.format("left"), finger.format("right"))
    problem = _refused(tmp_path, text)
    assert "'f1', 'f2'" in problem.message
    assert "tip_link" in problem.remedy
    robot = _import(tmp_path, text, "c")
    assert [joint.name for joint in robot.joints] == ["j1"]
    assert robot.joints[0].link is not None
    assert robot.joints[0].link.mass == 1.0
    np.testing.assert_allclose(robot.joints[0].link.com, [0.1, 0.0, 0.0])


def test_the_tip_lies_behind_fixed_joints() -> None:
    """The placement of the tip collects every fixed joint after the last moving one."""
    shift = '<origin xyz="0 0 1" rpy="0 1.5707963267948966 0"/>'
    text = _robot(_joint("j", "a", "b"), _joint("w1", "b", "c", "fixed", shift), _joint("w2", "c", "d", "fixed", shift),
                  links="abcd")
    chain = chain_from_urdf(text)
    assert chain.tip_link == "d"
    np.testing.assert_allclose(chain.tip_position, [1.0, 0.0, 1.0], atol=1e-15)


# what is dangerous

BILLION = ('<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;">]>'
           '<robot name="&c;"><link name="a"/></robot>')
EXTERNAL = '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="&x;"><link name="a"/></robot>'


@pytest.mark.parametrize("text", [
    BILLION, EXTERNAL, BILLION.encode("utf-16"), '<!DOCTYPE robot SYSTEM "http://example.invalid/a.dtd">' + TWO,
    '<!DOCTYPE r [<!ENTITY % p SYSTEM "file:///etc/passwd"> %p;]>' + TWO, "<!DOCTYPE robot>" + TWO,
], ids=["bomb", "external", "bomb-utf16", "dtd", "parameter-entity", "plain-doctype"])
def test_every_document_type_is_refused(tmp_path: Path, text: str | bytes) -> None:
    """No entity is declared, expanded or fetched: the document type alone is refused, in any encoding."""
    problem = _refused(tmp_path, text)
    assert problem.code == "RRID-X13"
    assert "DOCTYPE" in problem.message


@pytest.mark.parametrize("text", [
    '<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro"><xacro:include filename="/etc/passwd"/></robot>',
    _robot(_joint("j", "a", "b", inside='<origin xyz="${length} 0 0"/>'), links="ab"),
])
def test_xacro_is_refused_with_the_way_out(tmp_path: Path, text: str) -> None:
    """A macro file is never run; the message says how to expand it."""
    problem = _refused(tmp_path, text)
    assert problem.code == "RRID-X13"
    assert "xacro arm.urdf.xacro > arm.urdf" in problem.remedy


def test_huge_and_deep_files_are_refused(tmp_path: Path) -> None:
    """More than 16 MB, or elements nested without end, are refused before they cost memory."""
    assert _refused(tmp_path, TWO + " " * 17_000_000).code == "RRID-X13"
    assert _refused(tmp_path, "<robot>" + "<a>" * 100_000).code == "RRID-X13"


# what is malformed


@pytest.mark.parametrize(("text", "words"), [
    ("<robot", "not well-formed"), ("", "not well-formed"), (b"\xff\xfe\x00", "not well-formed"),
    ("<robot/>", "hangs"), (_robot(links="ab"), "a, b hang on nothing"), (_robot(links="a"), "no joint moves"),
    (_robot(_joint("j", "a", "nope"), links="ab"), "'nope', which is not defined"),
    (_robot(_joint("j", "a", "b"), _joint("j", "b", "c")), "two joints are called 'j'"),
    (_robot(_joint("j", "a", "b", "ball"), links="ab"), "type 'ball'"),
    (_robot(_joint("j", "a", "b", "planar"), links="ab"), "is planar"),
    (_robot(_joint("j", "a", "b", inside='<mimic joint="k"/>'), links="ab"), "is a mimic"),
    (_robot(_joint("j", "a", "b", inside='<axis xyz="0 0 0"/>'), links="ab"), "axis without direction"),
    (_robot(_joint("j", "a", "b", inside='<origin xyz="0 1e300 0"/>'), links="ab"), "absurdly large"),
    (_robot(_joint("j", "a", "b", inside='<limit lower="2" upper="1"/>'), links="ab"), "lower above upper"),
    (_robot('<joint name="j" type="revolute"><parent link="a"/></joint>'), "lacks its parent or child"),
    (_robot('<link name="d"><inertial><mass value="-1"/></inertial></link>', _joint("j", "a", "d"), links="a"),
     "negative mass"),
])
def test_malformed_urdfs_are_refused_in_words(tmp_path: Path, text: str | bytes, words: str) -> None:
    """Each fault is named, with the element it is in; no traceback, and inside a log it rejects the log."""
    problem = _refused(tmp_path, text)
    assert problem.code == "RRID-S17"
    assert words in problem.message
    if isinstance(text, str) and "mass" not in text:  # a log's kinematics hold no inertials
        with pytest.raises(InputRejected):
            chain_from_urdf(text)
