"""Decide everything that a request for a design leaves open.

    task = plan_task(robot, arm, wishes)       refuses what cannot be designed, and says why
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.dynamics import rrr
from pipelines.dynamics.arm import Arm
from pipelines.dynamics.body import Array
from pipelines.dynamics.kinematics import serial_chain
from pipelines.dynamics.rrr import rigid_body
from pipelines.errors import UsageError
from pipelines.excitation.config import CONFIG
from pipelines.excitation.constraints import limits_of
from pipelines.excitation.criteria import CRITERIA, Goal
from pipelines.excitation.fourier import Harmonics, plan_harmonics
from pipelines.excitation.problem import ArmProblem
from pipelines.excitation.regressor import ArmColumns, arm_columns
from pipelines.excitation.verify import Peak, peaks
from pipelines.io.option import option
from pipelines.io.robot import RobotDescription

__all__ = ["LOWER_BOUND", "Task", "Wishes", "plan_task"]

LOWER_BOUND = 1.5**0.5  # numerics: no motion of the RRR arm has a smaller condition number
SYMMETRIC = ("p4", "p15")  # zero where the links are mirror symmetric (Section IV.C.5)


@dataclass(frozen=True)
class Wishes:
    """Collect the options of a design; None: the default of the arm."""

    criterion: str = option("default", "default (A with condition 3), condition, D or A.")
    cond_max: float | None = option(None, "Ceiling on the condition number. [default: 3]")
    harmonics: tuple[int, ...] | None = option(None, "Harmonics: one number, or one a joint.")
    frequency: float = option(0.1, "Fundamental [Hz].")
    stop_band: tuple[float, ...] = option((), "Bands without harmonics [Hz]: 4,6 or 4,6,11,13.")
    symmetric: bool = option(False, "Mirror-symmetric links: p4 = p15 = 0.")
    home: tuple[float, ...] | None = option(
        None, "Posture to start from [rad], one a joint: 0,-1.57,0.")
    rest: bool = option(True, "In motion at both ends, with run-in and run-out.", "--no-rest")
    periods: int = option(1, "How often the period is repeated.")
    sample_time: float = 1e-3  # [s]
    friction: bool | None = option(
        None, "Count columns of friction as well. [on every arm but the RRR arm]",
        "--friction/--no-friction")
    noise: tuple[float, ...] | None = None  # [N m] std of the torque; None: 1 % of its limit
    torque_share: float = option(0.9, "Share of the torque limits that the motion may use.")
    # a loop overshoots by up to 4 %
    speed_share: float = option(0.95, "Share of the speed limits that the motion may use.")
    tip_box: tuple[float, ...] | None = option(
        None, "Box for the tip [m]: x from,to, y from,to, z from,to.")


@dataclass(frozen=True, eq=False)
class Task:
    """A design problem, decided."""

    robot: RobotDescription
    arm: Arm | None  # what predicts torque; friction included
    problem: ArmProblem
    harmonics: Harmonics
    speed: Array  # (joints,) [rad/s] that scales each joint's amplitudes
    rest: bool
    home: Array | None
    around: tuple[Array, Array]  # postures between which random motions are centred
    sample_time: float
    periods: int

    def peaks(self, motion: Array, *, periodic: bool) -> tuple[Peak, ...]:
        """Return the peaks of motion (3, joints, samples) on the grid of `verify`."""
        return peaks(self.problem.limits, self.problem.chain, motion, self.arm, periodic=periodic)


def plan_task(robot: RobotDescription, arm: Arm | None, wishes: Wishes,
              earlier: Array | None = None) -> Task:
    """Decide what was left open.

    Args:
        arm: the model of `robot`, or None where neither a model nor links are known.
        earlier: information of earlier logs (joints, columns, columns), as rowsᵀ rows summed over
            their samples.

    Raises:
        UsageError: C02, a value that does not fit; C08, a limit that no motion could keep, or that
            is missing.
    """
    body = rigid_body(robot)
    direct = isinstance(body, rrr.RRR)
    friction = wishes.friction if wishes.friction is not None else not direct
    columns = arm_columns(body, friction=friction)
    box = None if wishes.tip_box is None else _box(wishes.tip_box)
    limits = limits_of(robot, torque=arm is not None, torque_share=wishes.torque_share,
                       speed_share=wishes.speed_share, tip_box=box)
    harmonics = _harmonics(wishes, robot.n_joints, direct)
    samples = round(harmonics.period / wishes.sample_time) * wishes.periods
    beta = drag = None
    if arm is not None:
        beta = _beta(columns, arm)
        if not friction:
            drag = np.array([_modelled(arm, j, k.velocity) for j, k in enumerate(robot.joints)])
    goal = replace(_goal(wishes, robot, columns, beta), samples=samples,
                   earlier=None if earlier is None else earlier / samples)
    problem = ArmProblem(columns, serial_chain(robot), limits, beta, goal, drag)
    low, high = _ranges(robot)
    middle, half = 0.5 * (low + high), 0.25 * (high - low)
    home = _home(robot, wishes.home) if wishes.rest or wishes.home is not None else None
    return Task(robot, arm, problem, harmonics, _speed(robot), wishes.rest, home,
                (middle - half, middle + half), wishes.sample_time, wishes.periods)


def _home(robot: RobotDescription, asked: Sequence[float] | None) -> Array:
    """Return the posture (joints,) [rad] asked for, or zero within the limits.

    The paper's arm rests hanging: its joints have no brakes (erratum E13).
    """
    if asked is not None:
        if len(asked) != robot.n_joints:
            raise UsageError("C02", f"{len(asked)} positions for {robot.n_joints} joints",
                             where="--home", remedy="give one a joint, in rad")
        for j, (value, joint) in enumerate(zip(asked, robot.joints, strict=True), 1):
            low, high = joint.position
            if not low < value < high:
                raise UsageError(
                    "C08", f"home of joint {j}, {value:g}, is not within its position limits "
                    f"{low:g} to {high:g}", where="--home", remedy="give another home")
        return np.array(asked, dtype=np.float64)
    if rrr.fits(robot):
        return np.array([0.0, -0.5 * np.pi - robot.joints[1].offset, -robot.joints[2].offset])
    lowest, highest = _ranges(robot)
    room = 0.2 * (highest - lowest)
    return np.clip(np.zeros(robot.n_joints), lowest + room, highest - room)


def _ranges(robot: RobotDescription) -> tuple[Array, Array]:
    """Return lowest and highest position (joints,); a turn to each side of a joint without."""
    low, high = np.array([joint.position for joint in robot.joints]).T
    turn = 2.0 * np.pi
    below = np.where(np.isfinite(high), high - 2.0 * turn, -turn)
    above = np.where(np.isfinite(low), low + 2.0 * turn, turn)
    return np.where(np.isfinite(low), low, below), np.where(np.isfinite(high), high, above)


def _box(numbers: tuple[float, ...]) -> Array:
    box = np.array(numbers, dtype=np.float64)
    if box.size != 6 or not (box[::2] < box[1::2]).all():  # noqa: PLR2004
        raise UsageError("C02", "a box is six numbers, from below to above in x, y and z",
                         where="--tip-box",
                         remedy="write for example --tip-box=-0.5,0.5,-0.5,0.5,0.1,1.2 [m]")
    return box.reshape(3, 2)


def _harmonics(wishes: Wishes, joints: int, direct: bool) -> Harmonics:
    top = CONFIG.top_hz if direct else CONFIG.geared_top_hz
    counts: tuple[float, ...] = wishes.harmonics or ()
    if not counts and wishes.frequency > 0.0:
        counts = (max(CONFIG.fewest_harmonics, int(top / wishes.frequency + 1e-9)),)
    counts = _each(counts or (1,), joints, "--harmonics")
    return plan_harmonics(wishes.frequency, [int(n) for n in counts], wishes.stop_band)


def _each(values: Sequence[float], joints: int, where: str) -> tuple[float, ...]:
    if len(values) not in (1, joints):
        raise UsageError("C02", f"{len(values)} values for {joints} joints", where=where,
                         remedy="give one, or one a joint")
    return tuple(values) * joints if len(values) == 1 else tuple(values)


def _speed(robot: RobotDescription) -> Array:
    """Return the speed [rad/s] (joints,) by which amplitudes are scaled."""
    speed = np.array([joint.velocity for joint in robot.joints])
    slow = np.array([joint.acceleration for joint in robot.joints])
    speed = np.where(np.isfinite(speed), speed, slow / (2.0 * np.pi * CONFIG.knee_hz))
    for j in np.flatnonzero(~np.isfinite(speed)):
        place = (" in its <limit> in the URDF" if robot.urdf_text
                 else ", and best acceleration and torque, in its [[joint]]")
        raise UsageError("C08", f"joint {j + 1} '{robot.joints[j].name}' has no limit of speed and "
                         "none of acceleration", where=robot.name, remedy=f"write velocity{place}")
    return speed


def _goal(wishes: Wishes, robot: RobotDescription, columns: ArmColumns,
          beta: Array | None) -> Goal:
    if wishes.symmetric and not set(SYMMETRIC) <= set(columns.names):
        raise UsageError("C02", "only the RRR arm has p4 and p15", where="--symmetric",
                         remedy="leave it out")
    criterion = "A" if wishes.criterion == "default" else wishes.criterion
    if criterion not in CRITERIA:
        raise UsageError("C02", f"'{wishes.criterion}' is no criterion", where="--criterion",
                         remedy=f"one of: default, {', '.join(CRITERIA)}")
    ceiling = wishes.cond_max
    # of other arms no such ceiling is known: a wrist's small columns alone make the number large
    own = rrr.fits(robot) and not columns.friction
    if ceiling is None and wishes.criterion == "default" and own:
        ceiling = CONFIG.ceiling
    if ceiling is not None and ceiling <= LOWER_BOUND and rrr.fits(robot):
        raise UsageError("C08", f"no motion of this arm has a condition number below "
                         f"{LOWER_BOUND:.5f}", where="--cond-max",
                         remedy=f"allow more; {CONFIG.ceiling:g} is a good ceiling")
    left_out = SYMMETRIC if wishes.symmetric else ()
    kept = np.flatnonzero([name not in left_out for name in columns.names])
    if wishes.noise is not None:
        noise = np.array(_each(wishes.noise, robot.n_joints, "--noise"))
    else:
        torque = np.array([joint.torque for joint in robot.joints])
        known = torque[np.isfinite(torque)]
        most = known.max() if known.size else 1.0
        noise = CONFIG.noise * np.where(np.isfinite(torque), torque, most)
    return Goal(criterion, kept, noise, _sizes(columns, beta), 1, ceiling)


def _beta(columns: ArmColumns, arm: Arm) -> Array:
    """Return the model's value of every column; friction as a straight line, or of the limits."""
    beta = np.zeros(len(columns.names))
    beta[:columns.rigid_count] = arm.p
    if columns.friction:
        for j, joint in enumerate(arm.robot.joints):
            fast = joint.velocity if np.isfinite(joint.velocity) else 1.0
            friction = (0.0, 0.0)
            if any(law.effect.joint == j + 1 for law in arm.friction):
                friction = _modelled(arm, j, joint.velocity)
            elif np.isfinite(joint.torque):
                friction = (CONFIG.coulomb * joint.torque, CONFIG.viscous * joint.torque / fast)
            first = columns.rigid_count + 3 * j
            beta[first:first + 2] = friction
    return beta


def _modelled(arm: Arm, j: int, velocity: float) -> tuple[float, float]:
    """Return level and slope of the line nearest to the friction curve of joint j, from 0."""
    speeds = np.linspace(0.05, 1.0, 40) * (velocity if np.isfinite(velocity) else 1.0)
    laws = [law for law in arm.friction if law.effect.joint == j + 1]
    curve = sum((law.effect.curve(speeds, arm, law.values) for law in laws), np.zeros(len(speeds)))
    slope, level = np.polyfit(speeds, curve, 1)
    return float(level), float(slope)


def _sizes(columns: ArmColumns, beta: Array | None) -> Array:
    """Return what each standard deviation is compared with; 1 where nothing is known."""
    if beta is None:
        return np.ones(len(columns.names))
    units = np.array(columns.units)
    largest = np.array([np.abs(beta[units == unit]).max() for unit in units])
    return np.maximum(np.abs(beta), CONFIG.small * np.where(largest > 0.0, largest, 1.0))
