"""The adjoint gradient of a design against differences of its value."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.dynamics.base_parameters import BaseArm
from pipelines.dynamics.rrr import rigid_body
from pipelines.excitation.fourier import MotionSpace
from pipelines.excitation.problem import DesignProblem
from pipelines.excitation.regressor import arm_columns
from pipelines.excitation.task import Task, Wishes, plan_task
from pipelines.io.robot import RobotDescription
from tests.excitation.arms import described, rrr, six_axes, sliding

SHARP = 6
WEIGHT = 0.03


def _problem(task: Task, samples: int = 24) -> DesignProblem:
    space = MotionSpace(task.harmonics, task.speed, rest=task.rest, home=task.home)
    return DesignProblem(task.problem, space, samples, task.around)


def _task(robot: RobotDescription, criterion: str, **wishes: object) -> Task:
    given = Wishes(criterion=criterion, frequency=0.5, harmonics=(5,), **wishes)  # type: ignore[arg-type]
    return plan_task(robot, described(robot) if criterion != "condition" else None, given)


BOX = (-2.0, 2.1, -2.2, 2.0, -1.5, 2.5)
TASKS = {
    "RRR, condition": lambda: _task(rrr(), "condition", rest=False, symmetric=True),
    "RRR, A below a ceiling, from rest at home, torque": lambda: _task(rrr(), "default"),
    "RRR, tip": lambda: _task(rrr(), "A", tip_box=BOX, friction=True),
    "six axes, friction, tip": lambda: _task(six_axes(), "A", rest=False, tip_box=BOX),
    "six axes, condition": lambda: _task(six_axes(), "condition", speed_share=1.0),
    "a sliding joint": lambda: _task(sliding(), "A", tip_box=BOX, rest=False),
}


@pytest.mark.parametrize("name", TASKS)
def test_gradient_is_the_slope_of_what_is_minimised(name: str) -> None:
    """Along random directions of the space, by sixth-order differences: to 1e-7, which is how the value rounds."""
    problem, rng = _problem(TASKS[name]()), np.random.default_rng(1)
    x = problem.start(rng)
    _, gradient, _ = problem.value(x, SHARP, WEIGHT)
    origin, h = problem.space.project(np.zeros_like(x)), 1e-3
    for _ in range(3):
        d = problem.space.project(rng.normal(size=x.shape)) - origin
        d = d / np.linalg.norm(d)
        rise = [problem.value(x + k * h * d, SHARP, WEIGHT)[0] - problem.value(x - k * h * d, SHARP, WEIGHT)[0] for k in (1, 2, 3)]
        slope = np.dot([45.0, -9.0, 1.0], rise) / (60.0 * h)
        assert abs(float(gradient @ d) - slope) <= 1e-7 * float(np.linalg.norm(gradient))


@pytest.mark.parametrize("robot", [rrr(), six_axes(), sliding()], ids=lambda robot: robot.name)
def test_rows_are_the_regressor_s(robot: RobotDescription) -> None:
    """Rows for the design are those of the package's regressor, in closed form and by the recursion."""
    rng = np.random.default_rng(2)
    for body in (rigid_body(robot), BaseArm(robot)):
        columns = arm_columns(body, friction=False)
        motion = rng.normal(size=(3, robot.n_joints, 50))
        whole = body.regressor(*(part.T for part in motion))
        for j, (own, row) in enumerate(zip(columns.columns, columns.rows(motion), strict=True)):
            np.testing.assert_allclose(row.T, whole[:, j][:, own], atol=1e-12)
            rest = np.setdiff1d(np.arange(whole.shape[2]), own)
            assert not whole[:, j][:, rest].any()


def test_steps_stay_in_the_space() -> None:
    """Whatever is added along a gradient, the motion starts at rest at home and uses no forbidden harmonic."""
    task = plan_task(rrr(), described(rrr()), replace(Wishes(), harmonics=(30,), stop_band=(1.0, 1.5), home=(0.3, -1.2, 0.4)))
    problem = _problem(task, 400)
    x = problem.start(np.random.default_rng(3))
    _, gradient, _ = problem.value(x, SHARP, WEIGHT)
    moved = problem.space.series(x - 1e-3 * gradient)
    q, dq, ddq = moved.at(np.zeros(1))[:, :, 0]
    np.testing.assert_allclose(q, [0.3, -1.2, 0.4], atol=1e-12)
    np.testing.assert_allclose(np.concatenate([dq, ddq]), 0.0, atol=1e-10)
    hertz = moved.omega / (2 * np.pi)
    inside = (hertz > 1.0 - 1e-9) & (hertz < 1.5 + 1e-9)
    assert inside.sum() == 6
    assert not moved.cosine[:, inside].any()
    assert not moved.sine[:, inside].any()
