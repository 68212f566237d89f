"""Judge a design: the figures of its report, the warnings, and the files for the robot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipelines.dynamics import rrr
from pipelines.dynamics.body import Array, Motion
from pipelines.errors import Check
from pipelines.estimation.motion import Reconstruction, reconstruct
from pipelines.excitation.config import CONFIG
from pipelines.excitation.discrimination import Apart
from pipelines.excitation.fourier import Trajectory
from pipelines.excitation.optimise import Design
from pipelines.excitation.other_plans import Plan
from pipelines.excitation.regressor import ArmColumns, grams_of
from pipelines.excitation.task import LOWER_BOUND, Task
from pipelines.excitation.verify import Peak
from pipelines.importers.controller import ControllerTable
from pipelines.io.log import ExperimentLog, Signal
from pipelines.io.results import NOT_STORED
from pipelines.writing.task import planned_log

__all__ = ["Course", "DrawnPlan", "ParameterStd", "Result", "coefficients", "doubts",
           "gentle_log", "information_of", "judged", "log_of", "planned"]

BLOCK = 4096  # numerics: samples whose rows are computed at once


@dataclass(frozen=True)
class ParameterStd:
    """How well one parameter will be known."""

    name: str
    unit: str
    value: float | None  # of the model
    std: float  # predicted, of one experiment
    rigid: bool


@dataclass(frozen=True, eq=False)
class Course:
    """One period for figures, each (points, joints)."""

    t: Array  # [s]
    q: Array  # [rad]
    dq: Array  # [rad/s]
    ddq: Array  # [rad/s^2]
    tau: Array | None  # [N m] of the model


@dataclass(frozen=True, eq=False)
class DrawnPlan:
    """One of the other experiments, for a figure and a row of a table."""

    name: str
    joint: int | None
    words: str
    seconds: float
    t: Array  # [s] (points,)
    q: Array  # [rad] (points, joints)
    speed_peak: float  # [rad/s]
    acceleration_peak: float  # [rad/s^2]
    nearest: Peak | None = None  # the limit that it comes nearest to


@dataclass(frozen=True, eq=False)
class Result:
    """Of an excitation everything; of other purposes the plans alone."""

    robot: str
    joints: tuple[str, ...]
    purpose: str
    seed: int
    sample_time: float  # [s]
    duration: float = 0.0  # [s]
    plans: tuple[DrawnPlan, ...] = ()
    criterion: str = ""
    ceiling: float | None = None  # on the condition number
    condition_number: float | None = None
    lower_bound: float | None = None  # no motion of this arm can have a smaller one
    predicted_relative_std: float | None = None
    limits: tuple[Peak, ...] = ()
    evaluations: int = 0
    found_at: int = 0
    interrupted: bool = False
    stopped: int = field(default=0, metadata=NOT_STORED)  # exit code of the signal
    reached: bool = True
    shrunk: float = 1.0
    parameters: tuple[ParameterStd, ...] = ()
    course: Course | None = None
    period: float = 0.0  # [s]
    periods: int = 0
    run_in: float = 0.0  # [s]
    home: tuple[float, ...] | None = None  # [rad]
    noise: tuple[float, ...] = ()  # [N m]
    torque_checked: bool = False
    torque_share: float = 1.0
    speed_share: float = 1.0  # of the speed limit that the plan may use
    after: tuple[str, ...] = ()
    top_hz: float = 0.0  # [Hz] of the highest harmonic
    robot_from: str = ""  # why this robot, where none was named
    apart: Apart | None = None  # of a design that tells two causes apart
    turning: tuple[int, ...] = ()  # joints, from 1, that turn by more than a whole turn
    logs: tuple[tuple[str, ExperimentLog], ...] = field(default=(), metadata=NOT_STORED)
    # file name -> its content
    tables: Mapping[str, ControllerTable] = field(default_factory=dict, metadata=NOT_STORED)
    coefficients: dict[str, object] | None = field(default=None, metadata=NOT_STORED)


def _of_task(task: Task, purpose: str, seed: int) -> Result:
    return Result(task.robot.name, tuple(joint.name for joint in task.robot.joints), purpose, seed,
                  task.sample_time, torque_checked=task.arm is not None,
                  home=None if task.home is None else tuple(map(float, task.home)))


def planned(task: Task, purpose: str, seed: int, plans: Sequence[Plan]) -> Result:
    """Return the result of the other experiments, with their logs."""
    drawn = []
    for plan in plans:
        rows = slice(None, None, max(1, len(plan.t) // CONFIG.points))
        speed, acceleration = (float(np.abs(part).max()) for part in plan.motion[1:])
        drawn.append(DrawnPlan(plan.name, plan.joint, plan.words, float(plan.t[-1]), plan.t[rows],
                               plan.motion[0].T[rows], speed, acceleration, plan.nearest))
    logs = []
    for plan in plans:
        log = log_of(task, plan.name, plan.t, plan.motion, plan.experiment)
        signals = dict(log.signals)
        if plan.v is not None:
            signals["v"] = Signal(plan.v, "rad/s^2", "injected excitation")
        logs.append((plan.name, replace(log, signals=signals, joint=plan.joint,
                                        posture=plan.posture, period=plan.period)))
    return replace(_of_task(task, purpose, seed), plans=tuple(drawn), logs=tuple(logs),
                   duration=sum(plan.seconds for plan in drawn))


def judged(task: Task, design: Design, apart: Apart | None, seed: int) -> Result:
    """Judge a design on all samples of its period."""
    problem, goal = task.problem, task.problem.goal
    trajectory, columns = design.trajectory, problem.columns
    series = trajectory.series
    samples = max(round(series.period / task.sample_time), 2 * series.harmonics + 2)
    motion = series.samples(samples)
    grams = grams_of(columns, motion)
    figures, std = goal.figures(grams), goal.std(grams)
    parameters = tuple(
        ParameterStd(columns.names[k], columns.units[k],
                     None if problem.beta is None else float(problem.beta[k]), float(std[k]),
                     bool(k < columns.rigid_count)) for k in goal.kept.tolist())
    rows = slice(None, None, max(1, samples // CONFIG.points))
    q, dq, ddq = (part.T[rows] for part in motion)
    t = np.arange(samples, dtype=np.float64)[rows] * (series.period / samples)
    tau = None if task.arm is None else task.arm.torque(Motion(t, q, dq, ddq))
    bounded = rrr.fits(task.robot) and goal.earlier is None
    used = np.flatnonzero(task.harmonics.used.any(axis=0))
    return replace(
        _of_task(task, "excitation", seed), **vars(figures), limits=design.peaks,
        ceiling=goal.ceiling, lower_bound=LOWER_BOUND if bounded else None,
        evaluations=design.evaluations, found_at=design.found_at, interrupted=design.stopped > 0,
        stopped=design.stopped, reached=goal.meets(figures.condition_number),
        shrunk=design.shrunk, parameters=parameters,
        course=Course(t, q, dq, ddq, tau),
        period=series.period, periods=trajectory.periods, run_in=trajectory.run_in,
        duration=trajectory.duration, noise=tuple(map(float, goal.noise)),
        top_hz=float(used[-1] + 1) / series.period, apart=apart, turning=_turning(task, trajectory),
        coefficients=coefficients(task, trajectory))


def _turning(task: Task, trajectory: Trajectory) -> tuple[int, ...]:
    """Return the joints, from 1, that move over more than a turn."""
    q = trajectory.sampled(task.sample_time)[1][0]
    pairs = enumerate(zip(task.robot.joints, np.ptp(q, axis=1), strict=True), 1)
    return tuple(j for j, (joint, way) in pairs if joint.revolute and way > 2.0 * np.pi)


def doubts(result: Result) -> tuple[Check, ...]:
    """Return C08 where a ceiling was not reached, or a joint turns right round."""
    found = []
    if not result.reached:
        words = f"a condition number of {result.ceiling:g} was not reached"
        remedy = "search longer, give more harmonics, or widen the limits that it uses up"
        found.append(Check.of("C08", "warn", words, result.robot, gate=True, remedy=remedy))
    for joint in result.turning:
        words = f"joint {joint} turns by more than a whole turn"
        remedy = "see that its cables allow it, or describe its position limits"
        found.append(Check.of("C08", "warn", words, result.robot, remedy=remedy))
    return tuple(found)


def gentle_log(task: Task, trajectory: Trajectory, share: float) -> ExperimentLog:
    """Return the planned log of the same path at `share` of the speed: q(s t), s q̇, s² q̈."""
    count = round(trajectory.duration / share / task.sample_time) + 1
    t = task.sample_time * np.arange(count, dtype=np.float64)
    motion = trajectory.at(share * t) * np.array([1.0, share, share**2])[:, None, None]
    return log_of(task, "gentle first run", t, motion, "free")


def log_of(task: Task, name: str, t: Array, motion: Array, experiment: str) -> ExperimentLog:
    """Return the planned log of a motion (3, joints, samples) at times t (samples,) [s]."""
    q, dq, ddq = (np.ascontiguousarray(part.T) for part in motion)
    return planned_log(f"{task.robot.name} {name}", task.robot, Motion(t, q, dq, ddq), experiment,
                       "identify")


def coefficients(task: Task, trajectory: Trajectory) -> dict[str, object]:
    """Return eq. (22) of Kostić et al. 2004, joint by joint, at the harmonics each one has."""
    series, joints = trajectory.series, []
    for j, joint in enumerate(task.robot.joints):
        own = np.flatnonzero(task.harmonics.used[j])
        joints.append({"joint": j + 1, "name": joint.name, "q0": float(series.offset[j]),
                       "harmonics": (own + 1).tolist(), "a": series.cosine[j, own].tolist(),
                       "b": series.sine[j, own].tolist()})
    formula = "q = q0 + sum_j (a_j sin(w_j t) - b_j cos(w_j t))/w_j, w_j = 2 pi j / period"
    return {"formula": formula, "period": series.period, "run_in": trajectory.run_in,
            "units": {"period": "s", "q0": "rad", "a": "rad/s", "b": "rad/s"},
            "periods": trajectory.periods, "joints": joints}


def information_of(logs: Iterable[ExperimentLog], columns: ArmColumns) -> Array:
    """Return rowsᵀ rows (joints, columns, columns) summed over every sample of the logs."""
    count = len(columns.names)
    total = np.zeros((len(columns.columns), count, count))
    for log in logs:
        motion = reconstruct(log, Reconstruction()).motion
        whole = np.stack([motion.q.T, motion.dq.T, motion.ddq.T])
        for first in range(0, whole.shape[2], BLOCK):
            block = np.ascontiguousarray(whole[:, :, first:first + BLOCK])
            total += grams_of(columns, block) * block.shape[2]
    return total
