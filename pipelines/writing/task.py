"""Design the joint motion of a text that the RRR arm writes at a given pace.

    task = writing_task(robot, "RRRID 2004")
    reference = task.sampled(1e-3)          q, dq, ddq, exact; tip, its speed, and the letter
    log = planned_log("writing", robot, reference.motion)

Kostić et al. 2004, Section III.B, eq. (9), (A3), Figs. 2 and 3. It starts and ends at rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from pipelines.dynamics import rrr
from pipelines.dynamics.arm import Arm
from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.rrr_kinematics import (
    BRANCHES,
    Geometry,
    Reach,
    inverse,
    joint_rates,
    rrr_geometry,
)
from pipelines.errors import UsageError
from pipelines.io import schema
from pipelines.io.log import ExperimentLog, Signal
from pipelines.io.robot import RobotDescription, format_robot
from pipelines.writing.config import CONFIG
from pipelines.writing.path import Page, TipPath, lay_out
from pipelines.writing.timing import Pace, TimeLaw, time_law

__all__ = [
    "Demand",
    "Designed",
    "Elbow",
    "TipMotion",
    "WritingReference",
    "WritingTask",
    "demands",
    "designed",
    "planned_log",
    "writing_task",
]

Elbow = Literal["up", "down"]

ROUNDING = 1e-9  # numerics: share of a limit above it at which it still is met


@dataclass(frozen=True, eq=False)
class TipMotion:
    """The tip in the base frame, each (samples, 3)."""

    position: Array  # [m]
    velocity: Array  # [m/s]
    acceleration: Array  # [m/s^2]

    @property
    def speed(self) -> Array:
        """v (samples,) [m/s]. Kostić et al. 2004, eq. (9)."""
        return np.asarray(np.linalg.norm(self.velocity, axis=1))


@dataclass(frozen=True, eq=False)
class WritingReference:
    """A writing task sampled in time."""

    motion: Motion
    tip: TipMotion
    letter: npt.NDArray[np.intp]  # (samples,) place in the text from 0; of a move, its next letter
    drawn: npt.NDArray[np.bool_]  # (samples,) false on moves between strokes, and at rest


@dataclass(frozen=True, eq=False)
class WritingTask:
    """A text as a motion of one arm."""

    robot: RobotDescription
    path: TipPath
    pace: Pace
    law: TimeLaw
    geometry: Geometry
    elbow: Elbow
    rest: float  # [s] at rest before and after

    @property
    def duration(self) -> float:  # [s]
        return self.law.duration + 2.0 * self.rest

    def tip(self, t: Array) -> TipMotion:
        """Return the tip at times t (samples,) [s].

        x = x(s),   ẋ = ṡ x',   ẍ = s̈ x' + ṡ² x''
        """
        s, ds, dds = self.law.at(t - self.rest)
        piece = self._piece(t)
        position, tangent, curvature = (np.empty((len(t), 3)) for _ in range(3))
        for k in np.unique(piece).tolist():
            here = piece == k
            along = np.clip(s[here] - self.path.starts[k], 0.0, self.path.pieces[k].length)
            position[here], tangent[here], curvature[here] = self.path.pieces[k].at(along)
        acceleration = dds[:, None] * tangent + ds[:, None] ** 2 * curvature
        return TipMotion(position, ds[:, None] * tangent, acceleration)

    def motion(self, t: Array, tip: TipMotion | None = None) -> Motion:
        """Return the joints at increasing times t (samples,) [s], exact.

        Raises:
            UsageError: C02, the tip is out of reach or at a singularity; names the letter.
        """
        tip = tip or self.tip(t)
        self._refuse_unreachable(t, tip.position)
        # one branch of eq. (A3) throughout: branches meet only at singular postures
        branch = BRANCHES.index((1, -1 if self.elbow == "up" else 1))
        q = np.unwrap(inverse(self.geometry, tip.position).q[branch], axis=0)
        return Motion(t, q, *joint_rates(self.geometry, q, tip.velocity, tip.acceleration))

    def _refuse_unreachable(self, t: Array, tip: Array) -> None:
        """Refuse the first tip out of reach, or the first too near to the border."""
        arm, status = self.geometry, inverse(self.geometry, tip).status
        beyond, height = np.hypot(tip[:, 0], tip[:, 1]) - abs(arm.d), tip[:, 2] - arm.d1
        r = np.sqrt(np.maximum(beyond, 0.0) * (beyond + 2 * abs(arm.d)) + height**2)
        room = {
            Reach.SHOULDER: beyond,
            Reach.ELBOW: np.minimum(r - abs(arm.a3 - arm.a2), arm.a2 + arm.a3 - r),
        }
        out = np.flatnonzero(status >= Reach.INSIDE_CYLINDER)
        near = np.flatnonzero(np.minimum(*room.values()) < CONFIG.border)
        if out.size:
            k = int(out[0])
            why = Reach(int(status[k])).words
        elif near.size:
            k = int(near[0])
            kind = min(room, key=lambda reach: float(room[reach][k]))
            why = f"within {CONFIG.border * 1e3:g} mm of a posture that is {kind.words}"
        else:
            return
        raise UsageError(
            "C02",
            f"the arm cannot follow: {why}",
            where=self._place(t[k], tip[k]),
            remedy="move the text, or make it smaller",
        )

    def sampled(self, sample_time: float, arm: Arm | None = None) -> WritingReference:
        """Return the reference every `sample_time` [s]; with `arm` its torque is checked too.

        Raises:
            UsageError: C02, out of reach, through a singularity, or beyond a limit: names the
                letter, the place and the limit.
        """
        if not 0.0 < sample_time <= CONFIG.longest_sample_time:
            raise UsageError(
                "C02",
                f"a sample time of {sample_time:g} s",
                where="sample time",
                remedy=f"give one up to {CONFIG.longest_sample_time:g} s",
            )
        samples = math.ceil(self.duration / sample_time - ROUNDING) + 1
        t = np.arange(samples, dtype=np.float64) * sample_time
        tip = self.tip(t)
        motion = self.motion(t, tip)
        _refuse_beyond_limits(self.robot, motion, arm, lambda k: self._place(t[k], tip.position[k]))
        piece = self._piece(t)
        moving = (t > self.rest) & (t < self.rest + self.law.duration)
        letter = np.array([one.letter for one in self.path.pieces], dtype=np.intp)[piece]
        drawn = np.array([one.drawn for one in self.path.pieces], dtype=bool)[piece] & moving
        return WritingReference(motion, tip, letter, drawn)

    def _piece(self, t: Array) -> npt.NDArray[np.intp]:
        return np.asarray(self.law.piece[self.law.phase(t - self.rest)])

    def _place(self, t: float, tip: Array) -> str:
        piece = self.path.pieces[int(self._piece(np.array([t]))[0])]
        x, y, z = tip.tolist()
        way = "" if piece.drawn else "on the way to "
        return f"{way}{self.path.place(piece.letter)}, tip at ({x:.3f}, {y:.3f}, {z:.3f}) m"


def writing_task(
    robot: RobotDescription,
    text: str,
    page: Page | None = None,
    pace: Pace | None = None,
    *,
    elbow: Elbow | None = None,
    rest: float = 0.5,
) -> WritingTask:
    """Return `text` as a task for `robot`.

    Args:
        elbow: "up" by default.
        rest: [s] at rest before and after.

    Raises:
        UsageError: C02, the text makes no sense, or the arm is not the RRR arm.
    """
    if not (math.isfinite(rest) and rest >= 0.0):
        raise UsageError("C02", f"a rest of {rest:g} s", where="rest", remedy="give at least 0 s")
    if not rrr.fits(robot):
        raise UsageError(
            "C02",
            "a text is laid out for the RRR arm alone",
            where=robot.name,
            remedy="any other log of role validate judges a model as well: record an "
            "excitation that no fit uses",
        )
    path, pace = lay_out(text, page or Page()), pace or Pace()
    law = time_law(path, pace)
    return WritingTask(robot, path, pace, law, rrr_geometry(robot), elbow or "up", rest)


@dataclass(frozen=True)
class Demand:
    """The peak of one quantity of a joint over a motion, and its limit."""

    joint: int  # counted from 1
    quantity: str  # "speed", "acceleration", "torque"
    peak: float
    limit: float
    unit: str
    share: float  # peak over limit
    t: float  # [s] of the peak


def demands(robot: RobotDescription, motion: Motion, arm: Arm | None = None) -> tuple[Demand, ...]:
    """Return the peaks of speed, acceleration and, with a model, torque of each joint."""
    signals = [
        ("speed", "velocity", motion.dq, "rad/s", "m/s"),
        ("acceleration", "acceleration", motion.ddq, "rad/s^2", "m/s^2"),
    ]
    if arm is not None:
        signals.append(("torque", "torque", arm.torque(motion), "N m", "N"))
    found = []
    for quantity, key, values, turning, sliding in signals:
        for j, joint in enumerate(robot.joints):
            sample = int(np.argmax(np.abs(values[:, j])))
            peak, limit = float(abs(values[sample, j])), float(getattr(joint, key))
            unit = turning if joint.revolute else sliding
            found.append(
                Demand(j + 1, quantity, peak, limit, unit, peak / limit, float(motion.t[sample]))
            )
    return tuple(found)


def _refuse_beyond_limits(
    robot: RobotDescription, motion: Motion, arm: Arm | None, place: Callable[[int], str]
) -> None:
    """Refuse a motion beyond a limit; `place` says in words where a sample is."""
    for j, joint in enumerate(robot.joints):
        low, high = joint.position
        outside = np.flatnonzero((motion.q[:, j] < low) | (motion.q[:, j] > high))
        if outside.size:
            k = int(outside[0])
            unit = "rad" if joint.revolute else "m"
            raise UsageError(
                "C02",
                f"joint {j + 1}, {joint.name}, would be at {motion.q[k, j]:.3f} {unit} at "
                f"{motion.t[k]:.3f} s; its range is {low:.3f} to {high:.3f} {unit}",
                where=place(k),
                remedy="move the task, or shrink it",
            )
    found = demands(robot, motion, arm)
    for quantity, power in (("speed", 1), ("acceleration", 2), ("torque", 0)):
        of = [one for one in found if one.quantity == quantity]
        worst = max(of, key=lambda one: one.share, default=None)
        if worst is None or worst.share <= 1.0 + ROUNDING:
            continue
        remedy = "slow the task down, or move it to where the arm's own weight asks for less"
        if power:
            slower = 100.0 * worst.share ** (-1.0 / power)
            remedy = f"slow the task down to {slower:.0f} % of its speed, or move it"
        raise UsageError(
            "C02",
            f"joint {worst.joint}, {robot.joints[worst.joint - 1].name}, would need "
            f"{quantity} {worst.peak:.4g} {worst.unit} at {worst.t:.3f} s; its limit is "
            f"{worst.limit:.4g} {worst.unit}",
            remedy=remedy,
            where=place(int(np.searchsorted(motion.t, worst.t))),
        )


def planned_log(
    name: str,
    robot: RobotDescription,
    motion: Motion,
    experiment: str = "writing",
    role: str = "validate",
) -> ExperimentLog:
    """Return the log that carries `motion` (two samples or more, even) as its reference."""
    values = {"t": motion.t, "q_ref": motion.q, "dq_ref": motion.dq, "ddq_ref": motion.ddq}
    signals = {
        key: Signal(value, schema.unit_of(key), schema.SIGNALS[key][1])
        for key, value in values.items()
    }
    sample_time = float(motion.t[-1] - motion.t[0]) / (len(motion.t) - 1)
    return ExperimentLog(
        name=name,
        experiment=experiment,
        role=role,
        origin="planned",
        robot_name=robot.name,
        sample_time=sample_time,
        robot_text=format_robot(robot),
        signals=signals,
    )


@dataclass(frozen=True)
class Designed:
    """A task in figures; series are thinned."""

    text: str
    duration: float  # [s]
    limits: tuple[Demand, ...]
    torque_checked: bool
    t: Array  # [s] (points,)
    q: Array  # [rad] (points, joints)
    dq: Array
    ddq: Array
    tip: Array  # [m] (points, 3)
    drawn: Array  # (points,) 1 where a letter is written, 0 on the way
    tip_speed: Array  # [m/s] (points,)
    units: tuple[str, ...]  # of each joint's position


def designed(
    robot: RobotDescription, reference: WritingReference, arm: Arm | None, text: str
) -> Designed:
    """Return the figures of a reference that writes `text`."""
    motion, tip = reference.motion, reference.tip
    rows = slice(None, None, max(1, -(-len(motion.t) // CONFIG.points)))
    return Designed(
        text,
        float(motion.t[-1]),
        demands(robot, motion, arm),
        arm is not None,
        motion.t[rows],
        motion.q[rows],
        motion.dq[rows],
        motion.ddq[rows],
        tip.position[rows],
        reference.drawn[rows].astype(float),
        tip.speed[rows],
        ("rad",) * robot.n_joints,
    )
