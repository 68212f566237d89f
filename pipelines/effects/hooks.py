"""The arm that effects act on, and how they enter its forward simulation.

ArmModel      what an effect may ask of the arm
SpeedCurve    a torque that follows from speed alone
OwnLoad       one that follows from angle and speed of its joint, in numbers or arrays
OwnMemory     one that remembers one number as well
Hooks         all ways in which an effect enters the forward simulation
DriveApart    those of a drive that turns apart from its link
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from pipelines.dynamics.body import Array, Motion, RigidBody
from pipelines.dynamics.functions import ARRAYS, Functions
from pipelines.io.robot import RobotDescription

__all__ = [
    "ArmModel",
    "DriveApart",
    "Hooks",
    "OwnDrive",
    "OwnLoad",
    "OwnMemory",
    "Predict",
    "SpeedCurve",
    "friction_at",
    "predicted",
    "sign_curve",
    "summed",
]

_MANY = 256  # numerics: samples
# x/√(1 + x²) and (2/π) arctan x as sigmoids, within 0.0012 of them at every x: sharpnesses, as
# parts of w, and heights. tanh is a sigmoid itself.
_TANH = ((1.0, 1.0),)  # numerics: exact
_ROOT = ((1.307, 0.608), (0.563, 0.344), (0.1505, 0.048))  # numerics: within 0.0012
_ARCTAN = (  # numerics: within 0.0012
    (1.1537, 0.3622),
    (0.4719, 0.4021),
    (0.1463, 0.1731),
    (0.0335, 0.052),
    (0.004, 0.0106),
)


class ArmModel(Protocol):
    """The arm that an effect acts on, as modelled without this effect."""

    @property
    def robot(self) -> RobotDescription: ...

    @property
    def n_joints(self) -> int: ...

    @property
    def body(self) -> RigidBody: ...

    @property
    def p(self) -> Array: ...  # base parameters (parameters,)

    def torque(self, motion: Motion) -> Array: ...  # predicted (samples, joints) [N m]

    def friction_torque(self, motion: Motion) -> Array: ...  # its part by the friction laws

    # the friction laws at a joint (1-based) by its speed; None where one is more than a curve
    def friction_curves(self, joint: int) -> tuple[SpeedCurve, ...] | None: ...

    # the same arm with another rigid body: new geometry, gravity or load
    def with_body(self, body: RigidBody, p: Array) -> ArmModel: ...


Predict = Callable[[Motion, ArmModel], Array]
# angle [rad] and speed [rad/s] of a joint -> [N m], all numbers or all arrays, as the functions are
OwnLoad = Callable[[Any, Any, Functions], Any]
# command [N m] and speed [rad/s] joint by joint -> what reaches one of them, the same
OwnDrive = Callable[[Any, Any, Functions], Any]


@dataclass(frozen=True)
class OwnMemory:
    """A load of one joint that remembers one number."""

    rate: Callable[[Any, Any, Functions], Any]  # memory, speed [rad/s] -> d(memory)/dt
    load: Callable[[Any, Any], Any]  # memory and its rate -> [N m]


@dataclass(frozen=True)
class SpeedCurve:
    """A torque that depends on the speed of its own joint alone.

    τ = constant + viscous v + Σ height tanh(sharpness v)
    """

    constant: float = 0.0  # [N m]
    viscous: float = 0.0  # [N m s/rad]
    heights: tuple[float, ...] = ()  # [N m]
    sharpnesses: tuple[float, ...] = ()  # [s/rad]

    def torque(self, speed: Array) -> Array:
        """[N m] at each speed [rad/s]."""
        return np.asarray(self.of(speed, ARRAYS))

    def of(self, speed: Any, m: Functions) -> Any:
        """[N m] at a speed, a number or an array."""
        bent: Any = 0.0
        for height, w in zip(self.heights, self.sharpnesses, strict=True):
            bent = bent + height * m.tanh(w * speed)
        return self.constant + self.viscous * speed + bent

    @staticmethod
    def total(curves: Sequence[SpeedCurve], amplitudes: Sequence[float]) -> SpeedCurve:
        """Return the sum of `curves`, each so many times."""
        pairs = list(zip(curves, amplitudes, strict=True))
        return SpeedCurve(
            sum(a * curve.constant for curve, a in pairs),
            sum(a * curve.viscous for curve, a in pairs),
            tuple(a * height for curve, a in pairs for height in curve.heights),
            tuple(w for curve in curves for w in curve.sharpnesses),
        )


def sign_curve(level: float, sharpness: float, roundness: float = 1.0) -> SpeedCurve:
    """Return dry friction of a level [N m], by sharpness w [s/rad] and roundness r: `Coulomb`."""
    share = roundness - 1.0
    if share == 0.0:
        return SpeedCurve(heights=(level,), sharpnesses=(sharpness,))
    sharper: Sequence[tuple[float, float]] = _TANH
    rounder: Sequence[tuple[float, float]] = _ROOT
    if share > 1.0:
        share, sharper, rounder = share - 1.0, _ROOT, _ARCTAN
    heights = [level * (1.0 - share) * height for _, height in sharper]
    heights += [level * share * height for _, height in rounder]
    sharpnesses = tuple(sharpness * part for part, _ in (*sharper, *rounder))
    return SpeedCurve(heights=tuple(heights), sharpnesses=sharpnesses)


@dataclass(frozen=True)
class Hooks:
    """How an effect enters the forward simulation. Hooks left out change nothing.

    The first axis of every array holds replicas. `states` numbers of memory each replica keeps,
    zero or `start` at the start; `rate` moves them in continuous time, `update` once per control
    sample, after `sensor` was asked and before the command acts. A command is the torque as it
    reaches this effect: of several the last one meets it first. The motion handed in is the true
    one with ddq zero: what multiplies acceleration goes to `inertia` or `arm`. `settled` says where
    the arm truly is when its sensor reads the first position; it and `start` are given the first
    acceleration where known.
    """

    # motion, states -> torque the drive must overcome [N m]
    load: Callable[[Motion, Array], Array] | None = None
    alone: tuple[int, OwnLoad] | None = None  # the same of one joint (0-based): `Effect.own_load`
    # or with one state that begins at zero: `Effect.own_memory`
    remembering: tuple[int, OwnMemory] | None = None
    # command, motion, states -> applied torque [N m]
    actuator: Callable[[Array, Motion, Array], Array] | None = None
    drive: tuple[int, OwnDrive] | None = None  # the same of one joint, where speeds tell it
    sensor: Callable[[Array, Array], Array] | None = None  # true q, states -> measured q [rad]
    inertia: Array | None = None  # (joints, joints) [kg m^2] added to D(q)
    arm: ArmModel | None = None  # the arm as it truly is
    states: int = 0
    # as measured at the first sample, with its torque -> as it truly is
    settled: Callable[[Motion, Array], Motion] | None = None
    start: Callable[[Motion, Array], Array] | None = None  # of the same -> states
    rate: Callable[[Motion, Array, Array], Array] | None = None  # motion, command, states
    update: Callable[[Motion, Array, Array], Array] | None = None  # the same -> next states
    # t (samples,), command (samples, joints) -> torque as the log has it
    record: Callable[[Array, Array], Array] | None = None


@dataclass(frozen=True)
class DriveApart:
    """A drive that turns apart from its link.

    J_m θ̈ = τ - τ_friction(θ̇) - τ_passed(θ - q, θ̇ - q̇)

    The arm that is simulated is the links, q; the angle θ - q by which the drive is ahead and its
    speed θ̇ are two memories. Encoder and friction sit on the drive, whose inertia feels its own
    joint's acceleration alone.
    """

    index: int  # joint, from 0
    inertia: float  # J_m [kg m^2], which the rigid arm counts with the link
    friction: Callable[[Motion, Array], Array]  # motion and speed of the drive -> [N m]
    # angle and speed of the drive ahead of its link -> torque on the link [N m]
    passed: Callable[[Array, Array], Array]
    ahead: Callable[[Array], Array]  # that torque -> angle by which the drive then rests ahead

    def hooks(self, n_joints: int) -> Hooks:
        """Return how it enters the simulation of an arm of `n_joints` joints."""
        less = np.zeros((n_joints, n_joints))
        less[self.index, self.index] = -self.inertia  # the rigid arm's matrix becomes the links'
        return Hooks(
            actuator=self.actuator,
            sensor=self.sensor,
            inertia=less,
            states=2,
            settled=self.settled,
            start=self.start,
            rate=self.rate,
        )

    def actuator(self, command: Array, motion: Motion, states: Array) -> Array:
        """Return what reaches the link: friction is given back that the plant takes off there."""
        reached, speed = command.copy(), motion.dq[:, self.index]
        passed = self.passed(states[:, 0], states[:, 1] - speed)
        reached[:, self.index] = passed + self.friction(motion, speed)
        return reached

    def rate(self, motion: Motion, command: Array, states: Array) -> Array:
        angle, speed = states.T
        ahead = speed - motion.dq[:, self.index]
        left = command[:, self.index] - self.friction(motion, speed) - self.passed(angle, ahead)
        return np.stack([ahead, left / self.inertia], axis=-1)

    def sensor(self, q: Array, states: Array) -> Array:
        seen = q.copy()
        seen[:, self.index] += states[:, 0]
        return seen

    def settled(self, motion: Motion, tau: Array) -> Motion:
        """Return where the links are when the drive rests at the first position under `tau`."""
        q = motion.q.copy()
        q[:, self.index] -= self._rests(motion, tau)
        return replace(motion, q=q)

    def start(self, motion: Motion, tau: Array) -> Array:
        return np.stack([self._rests(motion, tau), motion.dq[:, self.index]], axis=-1)

    def _rests(self, motion: Motion, tau: Array) -> Array:
        """Return the angle ahead under what of `tau` reaches the link, did that not change."""
        lost = self.friction(motion, motion.dq[:, self.index])
        return self.ahead(tau[:, self.index] - lost - self.inertia * motion.ddq[:, self.index])


def friction_at(arm: ArmModel, joint: int) -> Callable[[Motion, Array], Array]:
    """Return the friction [N m] (samples,) of a joint (1-based) by motion and its own speed."""
    curves = arm.friction_curves(joint)

    def by_laws(motion: Motion, speed: Array) -> Array:
        dq = motion.dq.copy()
        dq[:, joint - 1] = speed
        return np.asarray(arm.friction_torque(replace(motion, dq=dq))[:, joint - 1])

    if curves is None:
        return by_laws
    whole = SpeedCurve.total(curves, [1.0] * len(curves))
    return lambda motion, speed: whole.torque(speed)


def summed(columns: Array, amplitudes: Array) -> Array:
    """Return `columns` (samples, joints, k) times `amplitudes` (k,); of many samples one by one."""
    if len(columns) < _MANY or not len(amplitudes):
        return np.asarray(columns @ amplitudes)
    parts = zip(np.moveaxis(columns, -1, 0), amplitudes.tolist(), strict=True)
    return np.asarray(sum(amplitude * column for column, amplitude in parts))


def predicted(arm: ArmModel, motion: Motion) -> Array:
    """Return `arm.torque(motion)`, kept with the motion; not to be written to."""
    return motion.kept(("predicted", arm), lambda: arm.torque(motion))
