"""RRR arms for tests: the shipped one, the ones of the reference vectors, and states to try them in."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pipelines.dynamics.body import Array
from pipelines.io.robot import LinkParameters, RobotDescription
from pipelines.io.robot_files import load_robot


def robot_with(links: list[dict[str, float]]) -> RobotDescription:
    """The shipped RRR arm with the links of a reference case."""
    robot = load_robot("rrr")
    described = [LinkParameters(link["m"], (link["x"], link["y"], link["z"]),
                                tuple(link[k] for k in ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")))  # type: ignore[arg-type]
                 for link in links]
    joints = tuple(replace(joint, link=link) for joint, link in zip(robot.joints, described, strict=True))
    return replace(robot, joints=joints)


def column(case: dict[str, Any], key: str) -> Array:
    return np.array([state[key] for state in case["states"]])


def random_states(rng: np.random.Generator, samples: int) -> tuple[Array, Array, Array]:
    """States as wide as the paper's arm moves."""
    return (rng.uniform(-np.pi, np.pi, (samples, 3)), rng.uniform(-3 * np.pi, 3 * np.pi, (samples, 3)),
            rng.uniform(-60, 60, (samples, 3)))
