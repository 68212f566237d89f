"""What a design is asked for, with everything that was left open decided.

    task = plan_task(robot, arm, wishes)       refuses what cannot be designed, and says why
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.errors import UsageError
from pipelines.fit.design.criteria import CRITERIA
from pipelines.fit.design.goal import Goal
from pipelines.io.robot import RobotDescription
from pipelines.model.arm import Arm
from pipelines.model.excitation.bounds import ParameterBounds
from pipelines.model.excitation.columns import ArmColumns, arm_columns
from pipelines.model.excitation.limits import limits_of
from pipelines.model.excitation.problem import ArmProblem
from pipelines.model.excitation.space import Harmonics, plan_harmonics
from pipelines.model.excitation.verify import TorqueRange, torque_of
from pipelines.model.rigid import rrr
from pipelines.model.rigid.body import Array
from pipelines.model.rigid.choose import rigid_body
from pipelines.model.rigid.geometry import serial_chain

__all__ = ["Task", "Wishes", "home_of", "plan_task"]

_TOP_HZ = 10.0  # highest frequency of a direct drive: the paper's arm does not bend below it (Section IV.C.3)
_GEARED_TOP_HZ = 2.0  # of any other arm, whose gears bend earlier
_SMALL = 0.005  # of the largest of its unit: a parameter below is known to be nearly nothing, and so is compared with this
_NOISE = 0.01  # of the torque limit: standard deviation of the torque where nothing better is known
_SYMMETRIC = ("p4", "p15")  # zero where the links are mirror symmetric (Section IV.C.5)
_COULOMB, _VISCOUS = 0.05, 0.05  # of the torque limit, standstill and full speed: friction where no model says
_FEWEST = 2


@dataclass(frozen=True)
class Wishes:
    """What a user may ask for; None: the default of the arm."""

    criterion: str = "default"
    cond_max: float | None = None  # ceiling on the condition number; the default criterion's is 3
    harmonics: tuple[int, ...] | None = None  # one, or one a joint
    frequency: tuple[float, ...] = (0.1,)  # [Hz] fundamental, one, or one a joint
    stop_band: tuple[tuple[float, float], ...] = ()  # [Hz] bands
    top_hz: float | None = None  # no harmonic above
    rest: bool = True
    home: tuple[float, ...] | None = None  # [rad]
    symmetric: bool = False
    friction: bool | None = None
    noise: tuple[float, ...] | None = None  # [N m] standard deviation of the torque
    torque_share: float = 0.9
    speed_share: float = 0.95
    tip_speed: float | None = None  # [m/s]
    tip_box: tuple[float, ...] | None = None  # [m] x from, to, y from, to, z from, to
    sample_time: float = 1e-3  # [s]
    periods: int = 1


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

    @property
    def torque(self) -> TorqueRange | None:
        """What predicts torque: the model, or bounds on the parameters; None where neither is known."""
        if self.arm is not None:
            return torque_of(self.arm)
        return None if self.problem.beta is None else self.problem.torque_range


def plan_task(robot: RobotDescription, arm: Arm | None, wishes: Wishes, earlier: Array | None = None,
              bounds: ParameterBounds | None = None) -> Task:
    """Decide what was left open.

    Args:
        arm: the model of `robot`, or None where neither a model nor links are known.
        earlier: information of earlier logs (joints, columns, columns), as rowsᵀ rows summed over their samples.
        bounds: of the parameters, where no model is known: they limit the torque.

    Raises:
        UsageError: C02, a value that does not fit; C08, a limit that no motion at all could keep, or is missing.
    """
    body = rigid_body(robot)
    direct = isinstance(body, rrr.RRR)
    friction = wishes.friction if wishes.friction is not None else not direct
    columns = arm_columns(body, friction=friction)
    box = None if wishes.tip_box is None else _box(wishes.tip_box)
    limits = limits_of(robot, torque_share=wishes.torque_share, speed_share=wishes.speed_share, tip_speed=wishes.tip_speed,
                       tip_box=box)
    harmonics = _harmonics(wishes, robot.n_joints, _TOP_HZ if direct else _GEARED_TOP_HZ)
    samples = round(harmonics.period / wishes.sample_time) * wishes.periods
    beta = _beta(columns, arm, robot) if arm is not None else bounds.middle if bounds is not None else None
    typical = bounds.largest if arm is None and bounds is not None else beta
    goal = _goal(wishes, robot, columns, typical, earlier, samples)
    drag = None if arm is None or friction else np.array([_modelled(arm, j, k.velocity) for j, k in enumerate(robot.joints)])
    spread = bounds.half if arm is None and bounds is not None else None
    problem = ArmProblem(columns, serial_chain(robot), limits, beta, goal, drag, spread)
    speed = _speed(robot)
    home = home_of(robot, wishes.home) if wishes.rest or wishes.home is not None else None
    low, high = _ranges(robot)
    middle, half = 0.5 * (low + high), 0.25 * (high - low)
    return Task(robot, arm, problem, harmonics, speed, wishes.rest, home, (middle - half, middle + half), wishes.sample_time,
                wishes.periods)


def home_of(robot: RobotDescription, asked: Sequence[float] | None) -> Array:
    """The posture (joints,) [rad] where a motion starts: asked for, or the zero posture within the limits.

    The paper's arm rests hanging: its joints have no brakes (erratum E13).
    """
    n = robot.n_joints
    if asked is not None:
        if len(asked) != n:
            raise UsageError("C02", f"{len(asked)} positions for {n} joints", where="--home", remedy="give one a joint, in rad")
        home = np.array(asked, dtype=np.float64)
        for j, (value, joint) in enumerate(zip(home, robot.joints, strict=True)):
            if not joint.position[0] < value < joint.position[1]:
                raise UsageError("C08", f"home of joint {j + 1}, {value:g}, is not within its position limits "
                                 f"{joint.position[0]:g} to {joint.position[1]:g}", where="--home", remedy="give another home")
        return home
    if rrr.fits(robot):
        return np.array([0.0, -0.5 * np.pi - robot.joints[1].offset, -robot.joints[2].offset])
    low, high = _ranges(robot)
    return np.clip(np.zeros(n), low + 0.2 * (high - low), high - 0.2 * (high - low))


def _ranges(robot: RobotDescription) -> tuple[Array, Array]:
    """Lowest and highest position (joints,); where a joint turns freely, a turn to each side."""
    low, high = (np.array(side) for side in zip(*(joint.position for joint in robot.joints), strict=True))
    turn = 2.0 * np.pi
    return (np.where(np.isfinite(low), low, np.where(np.isfinite(high), high - 2.0 * turn, -turn)),
            np.where(np.isfinite(high), high, np.where(np.isfinite(low), low + 2.0 * turn, turn)))


def _box(numbers: tuple[float, ...]) -> Array:
    box = np.array(numbers, dtype=np.float64)
    if box.shape != (6,) or not (box.reshape(3, 2)[:, 0] < box.reshape(3, 2)[:, 1]).all():
        raise UsageError("C02", "a box is six numbers, from below to above in x, y and z", where="--tip-box",
                         remedy="write for example --tip-box=-0.5,0.5,-0.5,0.5,0.1,1.2 [m]")
    return box.reshape(3, 2)


def _harmonics(wishes: Wishes, joints: int, top_hz: float) -> Harmonics:
    frequency = _each(wishes.frequency, joints, "--frequency")
    top = top_hz if wishes.top_hz is None else min(top_hz, wishes.top_hz)
    counts = (_each(wishes.harmonics, joints, "--harmonics") if wishes.harmonics is not None
              else tuple(max(_FEWEST, int(top / f + 1e-9)) for f in frequency))
    if wishes.top_hz is not None:
        counts = tuple(min(int(n), int(wishes.top_hz / f + 1e-9)) for n, f in zip(counts, frequency, strict=True))
        if min(counts) < _FEWEST:
            raise UsageError("C08", f"the first mode leaves {wishes.top_hz:.3g} Hz at most, a joint has fewer than {_FEWEST} "
                             "harmonics below", where="--prior-logs", remedy="give a lower --frequency, or a smaller mode_factor")
    return plan_harmonics(frequency, tuple(int(n) for n in counts), wishes.stop_band)


def _each(values: Sequence[float], joints: int, where: str) -> tuple[float, ...]:
    if len(values) not in (1, joints):
        raise UsageError("C02", f"{len(values)} values for {joints} joints", where=where, remedy="give one, or one a joint")
    return tuple(values) * joints if len(values) == 1 else tuple(values)


def _speed(robot: RobotDescription) -> Array:
    """What each joint's amplitudes are scaled by.

    Raises:
        UsageError: C08, nothing bounds a joint's speed.
    """
    speed = np.empty(robot.n_joints)
    for j, joint in enumerate(robot.joints):
        if np.isfinite(joint.velocity):
            speed[j] = joint.velocity
        elif np.isfinite(joint.acceleration):
            speed[j] = joint.acceleration / (2.0 * np.pi * 0.6)
        else:
            place = " in its <limit> in the URDF" if robot.urdf_text else ", and best acceleration and torque, in its [[joint]]"
            raise UsageError("C08", f"joint {j + 1} '{joint.name}' has no limit of speed and none of acceleration",
                             where=robot.name, remedy=f"write velocity{place}")
    return speed


def _goal(wishes: Wishes, robot: RobotDescription, columns: ArmColumns, beta: Array | None, earlier: Array | None,
          samples: int) -> Goal:
    names = columns.names
    if wishes.symmetric and not set(_SYMMETRIC) <= set(names):
        raise UsageError("C02", "only the RRR arm has p4 and p15", where="--symmetric", remedy="leave it out")
    criterion = "A" if wishes.criterion == "default" else wishes.criterion
    if criterion not in CRITERIA:
        raise UsageError("C02", f"'{wishes.criterion}' is no criterion", where="--criterion",
                         remedy=f"one of: default, {', '.join(CRITERIA)}")
    # of other arms no such ceiling is known: a wrist's small columns alone make the number large
    own = 3.0 if wishes.criterion == "default" and rrr.fits(robot) and not columns.friction else None
    ceiling = wishes.cond_max if wishes.cond_max is not None else own
    if ceiling is not None and ceiling <= np.sqrt(1.5) and rrr.fits(robot):
        raise UsageError("C08", f"no motion of this arm has a condition number below {np.sqrt(1.5):.5f}", where="--cond-max",
                         remedy="allow more; 3 is a good ceiling")
    kept = np.array([k for k, name in enumerate(names) if not (wishes.symmetric and name in _SYMMETRIC)], dtype=np.intp)
    sizes = _sizes(columns, beta)
    noise = _noise(wishes, robot)
    shared = None if earlier is None else earlier / samples
    return Goal(criterion, kept, kept, kept, noise, sizes, samples, ceiling, shared)


def _noise(wishes: Wishes, robot: RobotDescription) -> Array:
    if wishes.noise is not None:
        return np.array(_each(wishes.noise, robot.n_joints, "--noise"))
    torque = np.array([joint.torque for joint in robot.joints])
    known = np.isfinite(torque)
    return _NOISE * np.where(known, torque, torque[known].max() if known.any() else 1.0)


def _beta(columns: ArmColumns, arm: Arm, robot: RobotDescription) -> Array:
    """What is believed of every column; friction fitted to the model's curve, or a share of the limits where it has none."""
    beta = np.zeros(len(columns.names))
    beta[:columns.rigid_count] = arm.p
    if columns.friction:
        for j, joint in enumerate(robot.joints):
            level, viscous = _friction(arm, j, joint.torque, joint.velocity)
            beta[columns.rigid_count + 3 * j:columns.rigid_count + 3 * j + 2] = level, viscous
    return beta


def _friction(arm: Arm, j: int, torque: float, velocity: float) -> tuple[float, float]:
    """(Coulomb, viscous) of joint j, from 0."""
    if any(law.effect.joint == j + 1 for law in arm.friction):
        return _modelled(arm, j, velocity)
    fast = velocity if np.isfinite(velocity) else 1.0
    return (_COULOMB * torque, _VISCOUS * torque / fast) if np.isfinite(torque) else (0.0, 0.0)


def _modelled(arm: Arm, j: int, velocity: float) -> tuple[float, float]:
    """The straight line nearest to the model's friction curve of joint j, from 0."""
    speeds = np.linspace(0.05, 1.0, 40) * (velocity if np.isfinite(velocity) else 1.0)
    laws = [law for law in arm.friction if law.effect.joint == j + 1]
    curve = sum((law.effect.curve(speeds, arm, law.values) for law in laws), np.zeros(len(speeds)))
    level, slope = np.linalg.lstsq(np.stack([np.ones_like(speeds), speeds], axis=1), curve, rcond=None)[0]
    return float(level), float(slope)


def _sizes(columns: ArmColumns, beta: Array | None) -> Array:
    """What each parameter's standard deviation is compared with; 1 where nothing is known."""
    if beta is None:
        return np.ones(len(columns.names))
    units = np.array(columns.units)
    largest = np.array([np.abs(beta[units == unit]).max() for unit in units])
    typical = np.where(largest > 0.0, largest, 1.0)
    return np.maximum(np.abs(beta), _SMALL * typical)
