"""What a designed excitation tells and costs: the figures that a report shows and a result keeps."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipelines.model.excitation.design import Design, landscape
from pipelines.model.excitation.problem import grams_of
from pipelines.model.excitation.task import Task
from pipelines.model.rigid import rrr
from pipelines.model.rigid.body import Array, Motion

__all__ = ["Compared", "Course", "Excitation", "ParameterStd", "excitation"]

_RANDOM = 20  # motions that a design is compared with
_DRAWN = 1000  # points of a course


@dataclass(frozen=True)
class ParameterStd:
    """How well one parameter will be known."""

    name: str
    unit: str
    value: float | None  # what is believed of it
    std: float  # predicted, of one experiment
    rigid: bool


@dataclass(frozen=True)
class Compared:
    """Random motions within the same limits: medians, and the best of them."""

    count: int
    condition_median: float
    condition_best: float
    relative_std_median: float


@dataclass(frozen=True, eq=False)
class Course:
    """One period for figures, each (points, joints); and its spectrum."""

    t: Array  # [s]
    q: Array  # [rad]
    dq: Array  # [rad/s]
    ddq: Array  # [rad/s^2]
    tau: Array | None  # [N m] of the model
    hertz: Array  # (harmonics,)
    amplitude: Array  # (harmonics, joints) [rad/s] of the speed


@dataclass(frozen=True, eq=False)
class Excitation:
    """Everything computed of a designed excitation."""

    condition_number: float
    lower_bound: float | None  # no motion of this arm can have a smaller one
    frobenius: float
    smallest_singular_value: float
    log_determinant: float
    predicted_relative_std: float
    singular_values: tuple[float, ...]  # of Φ/√n
    parameters: tuple[ParameterStd, ...]
    random: Compared
    course: Course


def excitation(task: Task, found: Design, seed: int) -> Excitation:
    """Judge a design on all samples of its period, beside random motions."""
    goal, columns = task.problem.goal, task.problem.columns
    series = found.trajectory.series
    motion = series.samples(max(round(series.period / task.sample_time), 2 * series.harmonics + 2))
    grams = grams_of(columns.columns, columns.rows(motion), len(columns.names))
    figures, std = goal.figures(grams), goal.std(grams)
    beta = task.problem.beta
    kept = [k for k in range(len(columns.names)) if np.isfinite(std[k])]
    return Excitation(
        figures.condition_number, math.sqrt(1.5) if rrr.fits(task.robot) and goal.earlier is None else None, figures.frobenius,
        figures.smallest_singular_value, figures.log_determinant, figures.relative_std,
        tuple(float(s) for s in goal.singular_values(grams)),
        tuple(ParameterStd(columns.names[k], columns.units[k], None if beta is None else float(beta[k]), float(std[k]),
                           k < columns.rigid_count) for k in kept),
        _random(task, seed), _course(task, found, motion))


def _random(task: Task, seed: int) -> Compared:
    problem, rng = landscape(task), np.random.default_rng([seed, 1])
    columns, goal = task.problem.columns, task.problem.goal
    condition, std = [], []
    for _ in range(_RANDOM):
        motion = problem.space.motion(problem.start(rng, 0.999), problem.samples)
        figures = goal.figures(grams_of(columns.columns, columns.rows(motion), len(columns.names)))
        condition.append(figures.condition_number)
        std.append(figures.relative_std)
    return Compared(_RANDOM, float(np.median(condition)), float(np.min(condition)), float(np.median(std)))


def _course(task: Task, found: Design, motion: Array) -> Course:
    series = found.trajectory.series
    step = max(1, motion.shape[2] // _DRAWN)
    q, dq, ddq = (part.T[::step] for part in motion)
    t = np.arange(motion.shape[2])[::step] * (series.period / motion.shape[2])
    tau = None if task.arm is None else task.arm.torque(Motion(t, q, dq, ddq))
    return Course(t, q, dq, ddq, tau, series.omega / (2.0 * np.pi), np.hypot(series.cosine, series.sine).T)
