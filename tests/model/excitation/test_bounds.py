"""A design whose torque is known by bounds on the parameters alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.io.robot_files import load_robot
from pipelines.model.arm import Arm
from pipelines.model.excitation.bounds import ParameterBounds
from pipelines.model.excitation.design import landscape
from pipelines.model.excitation.task import Wishes, plan_task


def test_the_gradient_follows_the_value() -> None:
    """Against central differences along random directions, where torque with its spread is what limits the motion."""
    robot = load_robot("rrr")
    p = Arm.from_links(robot).p
    robot = replace(robot, joints=tuple(replace(joint, link=None, velocity=1e3, acceleration=1e5) for joint in robot.joints))
    half = 0.2 * np.abs(p) + 0.01
    task = plan_task(robot, None, Wishes("D", harmonics=(6,)), bounds=ParameterBounds(p - half, p + half))
    problem, rng = landscape(task), np.random.default_rng(5)
    x = problem.start(rng)
    nearest = task.problem.listed[int(problem.nearness(x).argmax())]
    assert nearest.quantity == "torque"
    weight = 10.0  # what the barrier tells outweighs the rest
    _, gradient, _ = problem.value(x, 8.0, weight)
    rest = problem.space.project(np.zeros_like(x))
    for _ in range(4):
        d = problem.space.project(rng.normal(size=x.shape)) - rest
        d /= np.linalg.norm(d)
        high, low = (problem.value(x + step * d, 8.0, weight)[0] for step in (1e-6, -1e-6))
        np.testing.assert_allclose(gradient @ d, (high - low) / 2e-6, rtol=1e-4, atol=1e-4 * float(np.linalg.norm(gradient)))
