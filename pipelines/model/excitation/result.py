"""What `design-excitation` keeps: figures, courses for drawing, and what is written beside them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipelines.importers.units import ControllerTable
from pipelines.io.log import ExperimentLog
from pipelines.io.results import NOT_STORED
from pipelines.model.excitation.apart import Apart
from pipelines.model.excitation.others import Plan
from pipelines.model.excitation.outcome import Compared, Course, ParameterStd
from pipelines.model.excitation.rehearse import Rehearsal
from pipelines.model.excitation.task import Task
from pipelines.model.excitation.verify import Peak
from pipelines.model.rigid.body import Array

__all__ = ["CostOfLimit", "DrawnPlan", "Result"]

_POINTS = 1200
_NEAR = 0.01  # share of the cost: a limit that costs less is in nobody's way


@dataclass(frozen=True)
class CostOfLimit:
    """How near a limit is approached, and what it costs."""

    joint: int | None  # 1-based; None: of the tip
    quantity: str
    peak: float
    limit: float
    unit: str
    share: float  # 1 is the limit
    cost: float  # of what all limits together cost the criterion


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
    duration: float  # [s]
    plans: tuple[DrawnPlan, ...] = ()
    criterion: str = ""
    ceiling: float | None = None  # on the condition number
    condition_number: float | None = None
    lower_bound: float | None = None
    predicted_relative_std: float | None = None
    frobenius: float | None = None
    smallest_singular_value: float | None = None
    log_determinant: float | None = None
    limits: tuple[CostOfLimit, ...] = ()
    evaluations: int = 0
    found_at: int = 0
    interrupted: bool = False
    stopped: int = field(default=0, metadata=NOT_STORED)  # exit code of the signal that interrupted
    reached: bool = True
    shrunk: float = 1.0
    shrunk_for: tuple[str, ...] = ()  # the limits, in words, that asked for it
    singular_values: tuple[float, ...] = ()
    parameters: tuple[ParameterStd, ...] = ()
    random: Compared | None = None
    course: Course | None = None
    period: float = 0.0  # [s]
    periods: int = 0
    run_in: float = 0.0  # [s]
    home: tuple[float, ...] | None = None  # [rad]
    noise: tuple[float, ...] = ()  # [N m]
    friction_columns: bool = False
    torque_checked: bool = False
    torque_bounded: bool = False  # by bounds on the parameters, for no model is known
    torque_share: float = 1.0
    speed_share: float = 1.0  # of the speed limit that the plan may use
    after: tuple[str, ...] = ()
    first_mode: float | None = None  # [Hz]
    mode_factor: float = 1.0  # times that the top harmonic lies below it, at least
    top_hz: float = 0.0  # [Hz] of the highest harmonic
    rehearsal: Rehearsal | None = None
    rehearsal_failed: str = ""
    rehearsals: tuple[tuple[str, Rehearsal], ...] = ()  # of plans, by name
    robot_from: str = ""  # why this robot, where none was named
    apart: Apart | None = None  # of a design that tells two causes apart
    logs: tuple[tuple[str, ExperimentLog], ...] = field(default=(), metadata=NOT_STORED)
    table: ControllerTable | None = field(default=None, metadata=NOT_STORED)
    coefficients: dict[str, object] | None = field(default=None, metadata=NOT_STORED)

    @property
    def dearest(self) -> str:
        """The limit that costs most, in words; empty where none costs anything worth naming."""
        top = max(self.limits, key=lambda one: one.cost, default=None)
        if top is None or top.cost < _NEAR:
            return ""
        return f"{top.quantity} limit of joint {top.joint}" if top.joint is not None else f"limit of {top.quantity}"

    @classmethod
    def of_plans(cls, task: Task, purpose: str, seed: int, sample_time: float, plans: tuple[Plan, ...],
                 logs: tuple[tuple[str, ExperimentLog], ...], rehearsals: tuple[tuple[str, Rehearsal], ...] = (),
                 failed: str = "") -> Result:
        drawn = tuple(_drawn(plan) for plan in plans)
        return cls(robot=task.robot.name, joints=tuple(joint.name for joint in task.robot.joints), purpose=purpose, seed=seed,
                   sample_time=sample_time, duration=sum(plan.seconds for plan in drawn), plans=drawn, logs=logs,
                   home=None if task.home is None else tuple(map(float, task.home)), torque_checked=task.torque is not None,
                   torque_bounded=task.arm is None and task.torque is not None, rehearsals=rehearsals, rehearsal_failed=failed)


def _drawn(plan: Plan) -> DrawnPlan:
    step = max(1, len(plan.t) // _POINTS)
    return DrawnPlan(plan.name, plan.joint, plan.words, float(plan.t[-1]), plan.t[::step], plan.motion[0].T[::step],
                     float(np.abs(plan.motion[1]).max()), float(np.abs(plan.motion[2]).max()), plan.nearest)
