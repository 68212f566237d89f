"""The adjoint gradient against the complex step through an arm written again in complex arithmetic; and its speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.dynamics.base_parameters import BaseArm
from pipelines.dynamics.rrr import rigid_body
from pipelines.excitation.config import CONFIG
from pipelines.excitation.fourier import MotionSpace
from pipelines.excitation.problem import DesignProblem
from pipelines.excitation.regressor import arm_columns
from pipelines.excitation.task import Task, Wishes, plan_task
from pipelines.io.robot import RobotDescription
from tests.excitation.arms import described, rrr, six_axes, sliding
from tests.excitation.complex_arm import complex_regressor, complex_tip

SHARP = 6
WEIGHT = 0.03


def _problem(task: Task, samples: int = 24) -> DesignProblem:
    space = MotionSpace(task.harmonics, task.speed, rest=task.rest, home=task.home)
    return DesignProblem(task.problem, space, samples, task.around)


def _complex_value(task: Task, problem: DesignProblem, x: np.ndarray) -> complex:
    """What is minimised, from eq. (22) on, in complex arithmetic."""
    space, goal, columns = problem.space, task.problem.goal, task.problem.columns
    top, n, m = len(space.harmonics.omega), space.joints, problem.samples
    rows = x.reshape(n, -1) * space.scale
    w, t = space.harmonics.omega[:, None], np.arange(m) * space.harmonics.period / m
    a, b = rows[:, 1:1 + top], rows[:, 1 + top:]
    c, s = np.cos(w * t), np.sin(w * t)
    motion = np.stack([rows[:, :1] + a / w.T @ s - b / w.T @ c, a @ c + b @ s, (b * w.T) @ c - (a * w.T) @ s])
    y = complex_regressor(rigid_body(task.robot), motion)
    if columns.friction:
        extra = np.zeros((m, n, 3 * n), dtype=complex)
        for j in range(n):
            extra[:, j, 3 * j:3 * j + 3] = np.stack([np.tanh(CONFIG.sharpness * motion[1, j]), motion[1, j], np.ones(m)], axis=1)
        y = np.concatenate([y, extra], axis=2)
    grams = np.einsum("sja,sjb->jab", y, y) / m
    power = np.linalg.matrix_power
    plain = grams.sum(axis=0)[np.ix_(goal.kept, goal.kept)]
    smooth = 0.5 * (np.log(np.trace(power(plain, SHARP))) + np.log(np.trace(power(np.linalg.inv(plain), SHARP)))) / SHARP
    if goal.criterion == "condition":
        value = smooth
    else:
        weighed = np.tensordot(goal.noise**-2.0, grams, axes=1)[np.ix_(goal.kept, goal.kept)]
        value = 0.5 * np.log(np.sum(np.diag(np.linalg.inv(weighed)) / goal.sizes[goal.kept] ** 2) / len(goal.kept))
    if goal.ceiling is not None:
        value = value + 10.0 * np.log(1.0 + np.exp(SHARP * (smooth - np.log(goal.ceiling)))) / SHARP
    beta = task.problem.beta
    tau = None if beta is None else y @ beta
    place, velocity = complex_tip(rigid_body(task.robot), motion)
    signals = []
    for one in task.problem.limits:
        if one.joint is None:
            speed = one.quantity == "tip speed"
            bounds = (-one.high**2, one.high**2) if speed else (one.low, one.high)
            signals.append(((velocity**2).sum(axis=1) if speed else place[:, "xyz".index(one.quantity[-1])], *bounds))
        elif one.quantity == "torque":
            assert tau is not None
            signals.append((tau[:, one.joint - 1], one.low, one.high))
        else:
            own = motion[("position", "speed", "acceleration").index(one.quantity), one.joint - 1]
            signals.append((own, one.low, one.high))
    walls = sum(-np.log(1.0 - ((y_ - 0.5 * (lo + hi)) / (0.5 * (hi - lo))) ** 2).mean() for y_, lo, hi in signals)
    return complex(value + WEIGHT * walls)


def _task(robot: RobotDescription, criterion: str, **wishes: object) -> Task:
    given = Wishes(criterion=criterion, frequency=(0.5,), harmonics=(5,), **wishes)  # type: ignore[arg-type]
    return plan_task(robot, described(robot) if criterion != "condition" else None, given)


BOX = (-2.0, 2.1, -2.2, 2.0, -1.5, 2.5)
TASKS = {
    "RRR, condition": lambda: _task(rrr(), "condition", rest=False, symmetric=True),
    "RRR, A below a ceiling, from rest at home, torque": lambda: _task(rrr(), "default"),
    "RRR, tip": lambda: _task(rrr(), "A", tip_speed=40.0, tip_box=BOX, friction=True),
    "six axes, friction, tip": lambda: _task(six_axes(), "A", rest=False, tip_speed=40.0, tip_box=BOX),
    # With all of the speed, as the bound below was set: of eight starts this one rounds most, to 0.7 of it (1.4 of it at 0.95).
    "six axes, condition": lambda: _task(six_axes(), "condition", speed_share=1.0),
    "a sliding joint": lambda: _task(sliding(), "A", tip_speed=40.0, tip_box=BOX, rest=False),
}


@pytest.mark.parametrize("name", TASKS)
def test_gradient_against_the_complex_step(name: str) -> None:
    """Value to 1e-10 and derivative along random directions of the space to 1e-8."""
    task = TASKS[name]()
    problem, rng = _problem(task), np.random.default_rng(1)
    x = problem.start(rng)
    value, gradient, _ = problem.value(x, SHARP, WEIGHT)
    assert np.isfinite(value)
    assert _complex_value(task, problem, x.astype(complex)).real == pytest.approx(value, rel=1e-10)
    origin = problem.space.project(np.zeros_like(x))
    for _ in range(3):
        d = problem.space.project(rng.normal(size=x.shape)) - origin
        exact = _complex_value(task, problem, x + 1e-30j * d).imag / 1e-30
        assert abs(float(gradient @ d) - exact) <= 1e-8 * float(np.linalg.norm(gradient) * np.linalg.norm(d))


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
    task = plan_task(rrr(), described(rrr()), replace(Wishes(), harmonics=(30,), stop_band=((1.0, 1.5),), home=(0.3, -1.2, 0.4)))
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
