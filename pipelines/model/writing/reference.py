"""The writing reference: joint motion of a text written at a given pace.

    task = writing_task(robot, "RRRID 2004")
    reference = task.sampled(1e-3)                 q, dq, ddq, exact; tip, its speed, and the letter, sample by sample
    log = planned_log(...)                         for the robot, `planned.py`

Kostić et al. 2004, Section III.B, eq. (9), (A3), Figs. 2 and 3. It starts and ends at rest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.errors import UsageError
from pipelines.io.robot import RobotDescription
from pipelines.model.arm import Arm
from pipelines.model.rigid import rrr
from pipelines.model.rigid.body import Array, Motion
from pipelines.model.rigid.geometry import serial_chain
from pipelines.model.rigid.rrr_kinematics import rrr_geometry
from pipelines.model.writing.inverse import ClosedForm, Elbow, Inverse, Numerical, Obstacle
from pipelines.model.writing.limits import refuse_beyond_limits
from pipelines.model.writing.path import Page, TipPath, lay_out
from pipelines.model.writing.profile import Pace, TimeLaw, time_law

__all__ = ["TipMotion", "WritingReference", "WritingTask", "writing_task"]

_FEWEST_JOINTS = 3


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
    letter: npt.NDArray[np.intp]  # (samples,) place in the text, counted from 0; of a move, that of the letter it leads to
    drawn: npt.NDArray[np.bool_]  # (samples,) false on moves between strokes, and at rest


@dataclass(frozen=True, eq=False)
class WritingTask:
    """A text as a motion of one arm."""

    robot: RobotDescription
    path: TipPath
    pace: Pace
    law: TimeLaw
    inverse: Inverse
    rest: float  # [s] at rest before and after

    @property
    def duration(self) -> float:  # [s]
        return self.law.duration + 2.0 * self.rest

    @property
    def corners(self) -> Array:
        """When the tip stands still in a corner, [s]."""
        return self._passings("corner")

    @property
    def bends(self) -> Array:
        """When the tip passes from one curvature to another, its acceleration jumping by at most slow²/radius, [s]."""
        return self._passings("bend")

    def _passings(self, kind: str) -> Array:
        last = np.array([int(np.flatnonzero(self.law.piece == k)[-1]) for k in range(len(self.path.pieces) - 1)], dtype=int)
        chosen = np.array([joint == kind for joint in self.path.joints], dtype=bool)
        return np.asarray(self.rest + self.law.start[last + 1][chosen])

    def tip(self, t: Array) -> TipMotion:
        """The tip at times t (samples,) [s].

            x = x(s),   ẋ = ṡ x',   ẍ = s̈ x' + ṡ² x''
        """
        s, ds, dds = self.law.at(t - self.rest)
        piece = self._piece(t)
        position, tangent, curvature = (np.empty((len(t), 3)) for _ in range(3))
        for k in np.unique(piece).tolist():
            here = piece == k
            along = np.clip(s[here] - self.path.starts[k], 0.0, self.path.pieces[k].length)
            position[here], tangent[here], curvature[here] = self.path.pieces[k].at(along)
        return TipMotion(position, ds[:, None] * tangent, dds[:, None] * tangent + ds[:, None]**2 * curvature)

    def motion(self, t: Array) -> Motion:
        """The joints at times t (samples,) [s], increasing: q, dq, ddq, exact.

        Raises:
            UsageError: the tip is out of reach or at a singularity; says where.
        """
        return self._joints(t, self.tip(t))

    def sampled(self, sample_time: float, arm: Arm | None = None) -> WritingReference:
        """The reference every `sample_time` [s], within all limits of the robot; with `arm` those of torque too.

        Raises:
            UsageError: out of reach, through a singularity, or beyond a limit: names the letter, the place and the limit.
        """
        if not (math.isfinite(sample_time) and 0.0 < sample_time <= 0.1):
            raise UsageError("C02", f"a sample time of {sample_time:g} s", where="sample time", remedy="give one up to 0.1 s")
        t = np.arange(math.ceil(self.duration / sample_time - 1e-9) + 1, dtype=np.float64) * sample_time
        tip = self.tip(t)
        motion = self._joints(t, tip)
        refuse_beyond_limits(self.robot, motion, arm, lambda k: self._place(t[k], tip.position[k]))
        pieces = self.path.pieces
        piece = self._piece(t)
        moving = (t > self.rest) & (t < self.rest + self.law.duration)
        return WritingReference(motion, tip, np.array([one.letter for one in pieces], dtype=np.intp)[piece],
                                np.array([one.drawn for one in pieces], dtype=bool)[piece] & moving)

    def _joints(self, t: Array, tip: TipMotion) -> Motion:
        found = self.inverse.motion(tip.position, tip.velocity, tip.acceleration)
        if isinstance(found, Obstacle):
            k = found.sample
            raise UsageError("C02", f"the arm cannot follow: {found.why}", where=self._place(t[k], tip.position[k]),
                             remedy=found.remedy)
        return Motion(t, *found)

    def _piece(self, t: Array) -> npt.NDArray[np.intp]:
        return np.asarray(self.law.piece[self.law.phase(t - self.rest)])

    def _place(self, t: float, tip: Array) -> str:
        piece = self.path.pieces[int(self._piece(np.array([t]))[0])]
        x, y, z = tip.tolist()
        return f"{'' if piece.drawn else 'on the way to '}{self.path.place(piece.letter)}, tip at ({x:.3f}, {y:.3f}, {z:.3f}) m"


def writing_task(robot: RobotDescription, text: str, page: Page | None = None, pace: Pace | None = None, *,
                 elbow: Elbow | None = None, posture: Sequence[float] | None = None, rest: float = 0.5) -> WritingTask:
    """`text` as a task for `robot`.

    Args:
        elbow: of the RRR arm, which has a closed form; "up" by default.
        posture: (joints,) [rad] of any other arm, near the task: the numerical inverse starts there, and an arm of more than
            three joints stays near it. By default the middle of each joint's range.
        rest: [s] at rest before and after.

    Raises:
        UsageError: the text, the page or the pace makes no sense; the arm has fewer than three joints; an elbow for an arm
            without a closed form, or a posture for one that has it.
    """
    page, pace = page or Page(), pace or Pace()
    if not (math.isfinite(rest) and rest >= 0.0):
        raise UsageError("C02", f"a rest of {rest:g} s", where="rest", remedy="give at least 0 s")
    path = lay_out(text, page)
    return WritingTask(robot, path, pace, time_law(path, pace), _inverse(robot, elbow, posture), rest)


def _inverse(robot: RobotDescription, elbow: Elbow | None, posture: Sequence[float] | None) -> Inverse:
    if rrr.fits(robot):
        if posture is not None:
            raise UsageError("C02", "a posture for an arm that has a closed form", where=robot.name, remedy="say elbow up or down")
        return ClosedForm(rrr_geometry(robot), elbow or "up")
    if elbow is not None:
        raise UsageError("C02", f"elbow {elbow} of an arm that is not the RRR arm", where=robot.name,
                         remedy="give a posture near the task instead")
    if robot.n_joints < _FEWEST_JOINTS:
        raise UsageError("C02", f"{robot.n_joints} joints cannot write", where=robot.name,
                         remedy="writing takes three joints or more")
    middle = [0.5 * (low + high) if math.isfinite(high - low) else 0.0 for low, high in (joint.position for joint in robot.joints)]
    if posture is not None and len(posture) != robot.n_joints:
        raise UsageError("C02", f"a posture of {len(posture)} joints for an arm of {robot.n_joints}", where="posture",
                         remedy="give one angle a joint")
    return Numerical(serial_chain(robot), np.array(middle if posture is None else posture, dtype=float))
