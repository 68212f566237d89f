"""Arms and tasks that several tests design for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.io.robot import Joint, LinkParameters, RobotDescription
from pipelines.io.robot_files import load_robot

__all__ = ["described", "rrr", "six_axes", "sliding"]


def rrr(**changes: float) -> RobotDescription:
    """The paper's arm; `changes` are made to every joint."""
    robot = load_robot("rrr")
    return replace(robot, joints=tuple(replace(joint, **changes) for joint in robot.joints))  # type: ignore[arg-type]


def six_axes() -> RobotDescription:
    """A wrist-partitioned arm with made-up links, modified DH, limits on everything."""
    rng = np.random.default_rng(5)
    rows = ((0.0, 0.0, 0.3), (0.0, -np.pi / 2, 0.0), (0.25, 0.0, 0.03), (0.0, np.pi / 2, 0.24), (0.0, -np.pi / 2, 0.0),
            (0.0, np.pi / 2, 0.06))
    joints = []
    for i, (a, alpha, d) in enumerate(rows):
        mass = float(6.0 / (i + 1))
        com = tuple(float(x) for x in rng.uniform(-0.1, 0.1, 3))
        root = rng.normal(size=(3, 3)) * 0.05
        tensor = mass * (root @ root.T + 0.01 * np.eye(3) + np.dot(com, com) * np.eye(3) - np.outer(com, com))
        inertia = (tensor[0, 0], tensor[1, 1], tensor[2, 2], -tensor[0, 1], -tensor[0, 2], -tensor[1, 2])
        joints.append(Joint(f"axis {i + 1}", a=a, alpha=alpha, d=d, position=(-2.4, 2.6), velocity=4.0, acceleration=30.0,
                            torque=120.0 / (i + 1), link=LinkParameters(mass, com, tuple(map(float, inertia)))))
    return RobotDescription("six axes", (0.0, 0.0, -9.81), "mdh", tuple(joints), tool=(0.0, 0.0, 0.1))


def sliding() -> RobotDescription:
    """A turning base with a sliding arm and a wrist."""
    robot = rrr()
    one, two, three = robot.joints
    return replace(robot, name="sliding", joints=(one, replace(two, type="prismatic", alpha=0.7, position=(-0.3, 0.5)), three))


def described(robot: RobotDescription) -> Arm:
    return Arm.from_links(robot)
