"""Design a task for the robot: a text, or random via points with full authority of the drives.

    designed, log, motion = design_text(robot, arm, wishes)

Kostić et al. 2004, Section III.B, Figs. 2 and 3.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.errors import UsageError
from pipelines.io.log import Array, ExperimentLog
from pipelines.io.robot import RobotDescription
from pipelines.model.arm import Arm
from pipelines.model.rigid import rrr
from pipelines.model.rigid.body import Motion
from pipelines.model.rigid.geometry import serial_chain
from pipelines.model.rigid.kinematics import tip_position
from pipelines.model.writing.inverse import Elbow
from pipelines.model.writing.limits import demands
from pipelines.model.writing.path import Page
from pipelines.model.writing.planned import planned_log
from pipelines.model.writing.profile import Pace
from pipelines.model.writing.reference import writing_task
from pipelines.model.writing.via_points import via_points

__all__ = ["Designed", "Plan", "Share", "Wishes", "plan"]

_POINTS = 3000  # of a figure


@dataclass(frozen=True)
class Wishes:
    """What the task shall be; None: the default of the page or the pace."""

    text: str | None = None
    plane_y: float = Page.y  # [m]
    x: float = Page.x  # [m]
    z: float = Page.z  # [m]
    size: float = Page.height  # [m]
    lift: float = Page.lift  # [m]
    speed: float = Pace.fast  # [m/s]
    slow: float = Pace.slow  # [m/s]
    acceleration: float = Pace.acceleration  # [m/s^2] of the tip; the jerk goes with it
    elbow: Elbow | None = None
    posture: tuple[float, ...] | None = None  # [rad]
    via_points: int | None = None  # so many moves instead of a text
    seed: int = 1
    sample_time: float = 1e-3  # [s]


@dataclass(frozen=True)
class Share:
    """What the task asks most of one joint, beside its limit."""

    joint: int
    quantity: str
    peak: float
    limit: float
    unit: str
    share: float
    t: float  # [s]


@dataclass(frozen=True)
class Designed:
    """The task in figures; series are thinned."""

    kind: str  # "text" | "via points"
    text: str
    inverse: str  # how the joints were found, in words
    duration: float  # [s]
    sample_time: float  # [s]
    page: tuple[tuple[str, float, str], ...]  # what it was designed with: name, value, unit
    limits: tuple[Share, ...]
    torque_checked: bool
    t: Array  # [s] (points,)
    q: Array  # [rad] (points, joints)
    dq: Array
    ddq: Array
    tip: Array  # [m] (points, 3)
    drawn: Array  # (points,) 1 where a letter is written, 0 on the way
    tip_speed: Array  # [m/s] (points,)
    units: tuple[str, ...]  # of each joint's position


@dataclass(frozen=True, eq=False)
class Plan:
    """The task, its log for the robot, and its joints at any time."""

    designed: Designed
    log: ExperimentLog
    at: Callable[[Array], Array]  # times (samples,) -> q (samples, joints)


def plan(robot: RobotDescription, arm: Arm | None, wishes: Wishes) -> Plan:
    """The task, within every limit of the robot; those of torque only with an `arm`.

    Raises:
        UsageError: C02, wishes that make no sense, or a task out of reach, through a singularity or beyond a limit: names the
            letter, the place and the limit.
    """
    return _text(robot, arm, wishes) if wishes.via_points is None else _via_points(robot, arm, wishes, wishes.via_points)


def _text(robot: RobotDescription, arm: Arm | None, wishes: Wishes) -> Plan:
    page = Page(wishes.plane_y, wishes.x, wishes.z, wishes.size, lift=wishes.lift)
    jerk = Pace.jerk * wishes.acceleration / Pace.acceleration
    pace = Pace(wishes.speed, min(wishes.slow, wishes.speed), wishes.acceleration, jerk)
    task = writing_task(robot, wishes.text or "", page, pace, elbow=wishes.elbow, posture=wishes.posture)
    reference = task.sampled(wishes.sample_time, arm)
    closed = rrr.fits(robot)
    designed = _designed(robot, arm, wishes, reference.motion, reference.drawn, "text",
                         f"in closed form, elbow {wishes.elbow or 'up'}" if closed else "numerically, by Newton's method",
                         (("plane at y", page.y, "m"), ("middle at x", page.x, "m"), ("middle at z", page.z, "m"),
                          ("height of a letter", page.height, "m"), ("fast phases", pace.fast, "m/s"),
                          ("slow phases", pace.slow, "m/s"), ("largest acceleration of the tip", pace.acceleration, "m/s^2")))
    log = planned_log(f"{robot.name} writing {wishes.text}", robot, reference.motion)
    return Plan(designed, log, lambda t: task.motion(np.minimum(t, task.duration)).q)


def _via_points(robot: RobotDescription, arm: Arm | None, wishes: Wishes, moves: int) -> Plan:
    """Random via points; `free` motion, no letters."""
    if wishes.text is not None:
        raise UsageError("C02", "a text and via points", where="--text, --via-points", remedy="give one of them")
    if not (math.isfinite(wishes.sample_time) and 0.0 < wishes.sample_time <= 0.1):
        raise UsageError("C02", f"a sample time of {wishes.sample_time:g} s", where="sample_time", remedy="give one up to 0.1 s")
    points = via_points(robot, np.random.default_rng([11, wishes.seed]), moves, arm=arm)
    motion = points.at(np.arange(math.ceil(points.duration / wishes.sample_time) + 1, dtype=np.float64) * wishes.sample_time)
    still = (motion.dq == 0.0).all(axis=1)
    designed = _designed(robot, arm, wishes, motion, ~still, "via points", "none is needed: postures are drawn",
                         (("moves", float(moves), "1"), ("seed", float(wishes.seed), "1")))
    log = planned_log(f"{robot.name} via points {wishes.seed}", robot, motion, "free")
    return Plan(designed, log, lambda t: points.at(t).q)


def _designed(robot: RobotDescription, arm: Arm | None, wishes: Wishes, motion: Motion, drawn: npt.NDArray[np.bool_], kind: str,
              inverse: str, page: tuple[tuple[str, float, str], ...]) -> Designed:
    rows = slice(None, None, max(1, -(-len(motion.t) // _POINTS)))
    tip = tip_position(serial_chain(robot), motion.q)
    speed = np.linalg.norm(np.gradient(tip, wishes.sample_time, axis=0), axis=1)
    shares = tuple(Share(one.joint, one.quantity, one.peak, one.limit, one.unit, one.share, float(motion.t[one.sample]))
                   for one in demands(robot, motion, arm))
    return Designed(kind, wishes.text or "", inverse, float(motion.t[-1]), wishes.sample_time, page, shares, arm is not None,
                    motion.t[rows], motion.q[rows], motion.dq[rows], motion.ddq[rows], tip[rows],
                    np.asarray(drawn, dtype=np.float64)[rows], speed[rows],
                    tuple("rad" if joint.revolute else "m" for joint in robot.joints))
