"""The structures of well-known robots: the dynamics are Pinocchio's, or a remedy is printed that works when it is followed."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from pipelines.dynamics import chain as serial
from pipelines.dynamics.body import standard_parameters
from pipelines.dynamics.kinematics import serial_chain
from pipelines.errors import UsageError
from pipelines.io.robot import LinkParameters, RobotDescription, format_robot, parse_robot
from pipelines.io.robot_files import load_robot
from tests.io.robot_structures import STRUCTURES, urdf_of

BAR = 1e-11  # of the largest torque
NOTHING = LinkParameters(0.0, (0.0, 0.0, 0.0), (0.0,) * 6)  # a body without <inertial>, as Pinocchio takes it


@pytest.mark.parametrize("name", STRUCTURES)
def test_dynamics_of_a_robot_equal_pinocchio(name: str, tmp_path: Path) -> None:
    """With the joints that are not the arm's locked at zero, every link that a remedy offers gives Pinocchio's torque."""
    path = tmp_path / "arm.urdf"
    path.write_text(urdf_of(name, seed=2))
    arms = _arms(path)
    assert arms
    for robot in arms:
        worst = _difference(robot, path.read_text())
        assert worst <= BAR, (name, robot.tip_link)


def _arms(path: Path) -> list[RobotDescription]:
    """The arm of a URDF, or those that the printed remedies lead to; where one says to change the URDF, it is changed."""
    for _ in range(5):
        try:
            return [load_robot(path)]
        except UsageError as problem:
            if offered := re.findall(r"arm\.urdf:([^\s,;]+)", problem.remedy):
                return [load_robot(f"{path}:{link}") for link in offered]
            _follow(path, problem)
    raise AssertionError("the remedies do not end")


def _follow(path: Path, problem: UsageError) -> None:
    text = path.read_text()
    if 'make it type="fixed"' in problem.remedy:
        joint = re.search(r"joint '(\S+)'", problem.message)
        assert joint is not None
        changed = re.sub(rf'(name="{joint[1]}" type=)"\w+"', r'\1"fixed"', text)
    else:
        loose = re.search(r"delete those without joints: (\w+)", problem.remedy)
        assert loose is not None, problem.remedy
        changed = re.sub(rf'  <link name="{loose[1]}">.*</link>\n', "", text)
    assert changed != text
    path.write_text(changed)


def _difference(robot: RobotDescription, text: str) -> float:
    """The largest difference of the torques at random states, relative to the largest torque."""
    full = pin.buildModelFromXML(re.sub(r'"(-?)inf"', r'"\g<1>1e9"', text))  # its parser refuses "inf"
    names = [joint.name for joint in robot.joints]
    model = pin.buildReducedModel(full, [full.getJointId(name) for name in list(full.names)[1:] if name not in names],
                                  pin.neutral(full))
    assert list(model.names)[1:] == names
    kept = parse_robot(format_robot(robot))  # as it travels in a log
    phi = standard_parameters([joint.link or NOTHING for joint in kept.joints])
    rng = np.random.default_rng(5)
    q, dq, ddq = (rng.uniform(-2.0, 2.0, (20, robot.n_joints)) for _ in range(3))
    ours = serial.inverse_dynamics(serial_chain(kept), q, dq, ddq, phi)
    theirs = np.array([pin.rnea(model, model.createData(), _configuration(model, a), b, c)
                       for a, b, c in zip(q, dq, ddq, strict=True)])
    return float(np.abs(ours - theirs).max() / max(np.abs(theirs).max(), 1e-300))


def _configuration(model: object, q: np.ndarray) -> np.ndarray:
    """Pinocchio has a continuous joint as cosine and sine."""
    return np.concatenate([[np.cos(x), np.sin(x)] if joint.nq == 2 else [x]
                           for x, joint in zip(q, list(model.joints)[1:], strict=True)])  # type: ignore[attr-defined]
