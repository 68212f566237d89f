"""Arms of every kind, each with a Pinocchio model built without a line of our own geometry."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from pipelines.io.robot import Joint, RobotDescription
from pipelines.io.robot_files import load_robot
from pipelines.io.urdf import import_urdf

HALF = math.pi / 2
TX40 = Path("real") / "tx40" / "tx40.urdf"
GRAVITY = (0.4, -1.1, -9.7)  # not along z: a base may stand on a slope

# (type, alpha, a, d, offset) of each joint
SEVEN = [("revolute", -HALF, 0.0, 0.34, 0.0), ("revolute", HALF, 0.0, 0.0, 0.3), ("revolute", HALF, 0.02, 0.4, 0.0),
         ("revolute", -HALF, 0.0, 0.0, 0.0), ("revolute", -HALF, -0.03, 0.4, -0.7), ("revolute", HALF, 0.0, 0.0, 0.0),
         ("revolute", 0.0, 0.05, 0.126, 0.0)]
STANFORD = [("revolute", -HALF, 0.0, 0.412, 0.0), ("revolute", HALF, 0.0, 0.154, 0.0),
            ("prismatic", 0.0, 0.0, 0.1, 0.4), ("revolute", -HALF, 0.0, 0.0, 0.0), ("revolute", HALF, 0.0, 0.0, 0.1),
            ("revolute", 0.0, 0.0, 0.263, 0.0)]
PUMA = [("revolute", 0.0, 0.0, 0.0, 0.0), ("revolute", -HALF, 0.0, 0.0, 0.2), ("revolute", 0.0, 0.4318, 0.1501, 0.0),
        ("revolute", -HALF, 0.0203, 0.4318, 0.0), ("revolute", HALF, 0.0, 0.0, 0.0),
        ("revolute", -HALF, 0.0, 0.0, -0.4)]
GANTRY = [("prismatic", 0.0, 0.0, 0.2, 0.05), ("prismatic", -HALF, 0.1, 0.0, 0.0), ("revolute", 0.7, 0.2, 0.1, 0.0),
          ("prismatic", HALF, 0.3, 0.0, -0.1), ("revolute", -1.1, 0.05, 0.2, 0.3)]

# Skew axes, a shift, links fixed in the middle and at the end, an inertial with its own axes.
SKEW_URDF = """<?xml version="1.0"?>
<robot name="skew">
  <link name="world"/><link name="stand"/>
  <joint name="bolt" type="fixed"><parent link="world"/><child link="stand"/><origin xyz="0.1 0 0.3" rpy="0.2 0 0"/></joint>
  <joint name="j1" type="continuous"><parent link="stand"/><child link="a"/><origin xyz="0 0.2 0" rpy="0.1 -0.3 0.5"/>
    <axis xyz="1 2 3"/></joint>
  <link name="a"><inertial><mass value="3"/><origin xyz="0.1 0.2 -0.1" rpy="0.3 0.2 0.1"/>
    <inertia ixx="0.04" iyy="0.05" izz="0.06" ixy="0.003" ixz="-0.002" iyz="0.004"/></inertial></link>
  <joint name="j2" type="prismatic"><parent link="a"/><child link="b"/><origin xyz="0.2 0 0.1" rpy="0 0.4 0"/>
    <axis xyz="0 -1 0"/><limit lower="-0.5" upper="0.4" effort="200" velocity="1.5"/></joint>
  <link name="b"><inertial><mass value="2"/><origin xyz="0 0.05 0.1"/>
    <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="glue" type="fixed"><parent link="b"/><child link="motor"/><origin xyz="0 0.1 0.2" rpy="1 2 3"/></joint>
  <link name="motor"><inertial><mass value="1.5"/><origin xyz="0.01 0.02 0.03" rpy="0.5 0 0"/>
    <inertia ixx="0.003" iyy="0.004" izz="0.005" ixy="0.0005" ixz="0" iyz="0"/></inertial></link>
  <joint name="j3" type="revolute"><parent link="motor"/><child link="c"/><origin xyz="0.3 0 0"/>
    <axis xyz="1 0 0"/><limit lower="-2" upper="2" effort="20" velocity="3"/></joint>
  <link name="c"><inertial><mass value="1"/><origin xyz="0.1 0 0"/>
    <inertia ixx="0.001" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="j4" type="revolute"><parent link="c"/><child link="d"/><origin xyz="0.2 0 0" rpy="0 0 1"/>
    <axis xyz="0 0 -2"/><limit lower="-1" upper="2" effort="10" velocity="3"/></joint>
  <link name="d"><inertial><mass value="0.4"/><origin xyz="0 0 0.05"/>
    <inertia ixx="0.001" iyy="0.001" izz="0.0005" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="flange" type="fixed"><parent link="d"/><child link="tool0"/><origin xyz="0 0.1 0.2" rpy="0 1 0"/></joint>
  <link name="tool0"/>
</robot>
"""


@dataclass(frozen=True)
class Arm:
    """A robot, Pinocchio's model of it, and where Pinocchio's joint frame has our link frame and the tip."""

    robot: RobotDescription
    model: Any
    link_in_joint: list[Any]
    tip_in_joint: Any

    @property
    def n(self) -> int:
        return self.robot.n_joints

    def states(self, samples: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        rng = np.random.default_rng(seed)
        return (rng.uniform(-math.pi, math.pi, (samples, self.n)), rng.uniform(-6.0, 6.0, (samples, self.n)),
                rng.uniform(-40.0, 40.0, (samples, self.n)))

    def offset(self, q: np.ndarray) -> np.ndarray:
        """Pinocchio knows no offsets."""
        return q + np.array([joint.offset for joint in self.robot.joints])

    def load(self, phi: np.ndarray) -> None:
        """Give Pinocchio's links our standard parameters (joints * 10,), through its own change of frame."""
        for i, values in enumerate(phi.reshape(self.n, 10)):
            m, mx, my, mz, xx, yy, zz, xy, xz, yz = values
            # Pinocchio's order is m, h, Ixx, Ixy, Iyy, Ixz, Iyz, Izz of the tensor, whose products are negative
            theirs = pin.Inertia.FromDynamicParameters(np.array([m, mx, my, mz, xx, -xy, yy, -xz, -yz, zz]))
            self.model.inertias[i + 1] = self.link_in_joint[i].act(theirs)


def physical_links(n: int, rng: np.random.Generator) -> np.ndarray:
    """Standard parameters (n * 10,) of bodies made of six random point masses each."""
    phi = []
    for _ in range(n):
        m, (x, y, z) = rng.uniform(0.1, 2.0, 6), rng.uniform(-0.3, 0.3, (3, 6))
        phi += [m.sum(), m @ x, m @ y, m @ z, m @ (y**2 + z**2), m @ (x**2 + z**2), m @ (x**2 + y**2),
                m @ (x * y), m @ (x * z), m @ (y * z)]
    return np.array(phi)


def _elementary(alpha: float, a: float, d: float) -> tuple[Any, Any, Any]:
    return (pin.SE3(pin.utils.rotate("x", alpha), np.zeros(3)), pin.SE3(np.eye(3), np.array([a, 0.0, 0.0])),
            pin.SE3(np.eye(3), np.array([0.0, 0.0, d])))


def table(name: str, convention: str, rows: list[tuple[str, float, float, float, float]]) -> RobotDescription:
    joints = tuple(Joint(f"j{i}", kind, a=a, alpha=alpha, d=d, offset=offset)
                   for i, (kind, alpha, a, d, offset) in enumerate(rows))
    return RobotDescription(name, GRAVITY, convention, joints, tool=(0.03, -0.02, 0.1))


def by_hand(robot: RobotDescription) -> Arm:
    """Joint by joint from the table, with Pinocchio's transforms."""
    model, behind, links = pin.Model(), pin.SE3.Identity(), []
    for i, joint in enumerate(robot.joints):
        turn, along_x, along_z = _elementary(joint.alpha, joint.a, joint.d)
        if robot.convention == "dh":
            place, link = behind, along_z * along_x * turn
        else:
            place, link = turn * along_x * along_z, pin.SE3.Identity()
        behind = link
        model.addJoint(i, pin.JointModelRZ() if joint.revolute else pin.JointModelPZ(), place, joint.name)
        links.append(link)
    model.gravity.linear = np.array(robot.gravity)
    tip = links[-1] * pin.SE3(np.eye(3), np.array(robot.tool))
    return Arm(robot, model, links, tip)


def _from_urdf(robot: RobotDescription, model: Any, tip_frame: str) -> Arm:
    model.gravity.linear = np.array(robot.gravity)
    tip = model.frames[model.getFrameId(tip_frame)].placement * pin.SE3(np.eye(3), np.array(robot.tool))
    return Arm(robot, model, [pin.SE3.Identity()] * robot.n_joints, tip)


def skew(folder: Path) -> Arm:
    path = folder / "skew.urdf"
    path.write_text(SKEW_URDF)
    model = pin.buildModelFromXML(SKEW_URDF.replace('type="continuous"', 'type="revolute"').replace(
        '<axis xyz="1 2 3"/>', '<axis xyz="1 2 3"/><limit lower="-9" upper="9" effort="9" velocity="9"/>'))
    return _from_urdf(replace(import_urdf(path), gravity=GRAVITY, tool=(0.1, 0.0, 0.2)), model, "tool0")


def tx40(shared: Path) -> Arm:
    return _from_urdf(import_urdf(shared / TX40), pin.buildModelFromUrdf(str(shared / TX40)), "tool0")


ARMS: dict[str, Callable[[Path, Path], Arm]] = {
    "rrr": lambda shared, folder: by_hand(load_robot("rrr")),
    "tx40": lambda shared, folder: tx40(shared),
    "seven-joints": lambda shared, folder: by_hand(table("seven", "dh", SEVEN)),
    "stanford": lambda shared, folder: by_hand(table("stanford", "dh", STANFORD)),
    "puma-mdh": lambda shared, folder: by_hand(table("puma", "mdh", PUMA)),
    "gantry-mdh": lambda shared, folder: by_hand(table("gantry", "mdh", GANTRY)),
    "skew-urdf": lambda shared, folder: skew(folder),
}
