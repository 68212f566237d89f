"""Define the terms of effects.

The arm they act on, the quantities they have, and how they enter a simulation.

    ArmModel      what an effect may ask of the arm
    Quantity      one parameter: unit, range, meaning
    Parameters    those of an effect
    Words         the text about an effect in a report
    SpeedCurve    a torque that follows from speed alone, which a simulation takes by itself
    OwnLoad       one that follows from angle and speed of its joint, in numbers or arrays
    Hooks         how an effect enters the forward simulation

`pipelines.effects.base`, the contract of an effect, hands these on: an effect imports from there
alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, Self

import numpy as np

from pipelines.dynamics.body import Array, Motion, RigidBody
from pipelines.dynamics.functions import ARRAYS, Functions
from pipelines.effects.config import EFFECTS
from pipelines.io.robot import RobotDescription

__all__ = [
    "LARGE", "SAMPLED", "SHARPNESSES", "ArmModel", "Hooks", "OwnDrive", "OwnLoad", "OwnMemory",
    "Parameters", "Predict", "Quantity", "SpeedCurve", "Values", "Words", "friction_at",
    "predicted", "summed", "waves"
]

Values = Mapping[str, float]

# How much torque, force or inertia a cause makes no table says before the logs do, for the slide of
# a gantry rubs with more newtons than a small arm's motor can give.
LARGE = 1e5  # numerics: more than any machine has, of torques, forces and inertias
# How sharply friction may change its sign, over which a search goes.
SHARPNESSES = (10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)  # numerics: [s/rad], a grid
_MANY = 256  # numerics: samples


class ArmModel(Protocol):
    """The arm that an effect acts on, as modelled without this effect."""

    @property
    def robot(self) -> RobotDescription: ...

    @property
    def n_joints(self) -> int: ...

    @property
    def body(self) -> RigidBody: ...

    @property
    def p(self) -> Array:
        """Base parameters (parameters,)."""
        ...

    def torque(self, motion: Motion) -> Array:
        """Predicted torque (samples, joints) [N m]."""
        ...

    def friction_torque(self, motion: Motion) -> Array:
        """Return the part of it (samples, joints) [N m] that the friction laws make."""
        ...

    def friction_curves(self, joint: int) -> tuple[SpeedCurve, ...] | None:
        """Return the friction laws at a joint (1-based) as curves of its speed.

        Returns None where one of them is more than that.
        """
        ...

    def with_body(self, body: RigidBody, p: Array) -> ArmModel:
        """Return the same arm with another rigid body: new geometry, gravity or load."""
        ...


Predict = Callable[[Motion, ArmModel], Array]
# angle [rad] and speed [rad/s] of a joint -> [N m], all numbers or all arrays, as the functions are
OwnLoad = Callable[[Any, Any, Functions], Any]
# command [N m] and speed [rad/s] joint by joint -> what reaches one of them, the same
OwnDrive = Callable[[Any, Any, Functions], Any]


def waves(order: float,
          pairs: Sequence[Sequence[float]]) -> Callable[[Any, Functions], Any]:
    """Return Σ_m a_m sin(m k q) + b_m cos(m k q), m = 1, 2, …, of an order k, as a function of q.

    A harmonic follows from the one before by the addition theorems, for a sine costs most.
    """
    (in_phase, across), *rest = pairs
    while rest and not any(rest[-1]):
        rest = rest[:-1]

    def sum_at(q: Any, m: Functions) -> Any:
        sine, cosine = s, c = m.sin(order * q), m.cos(order * q)
        total = in_phase * s + across * c
        for a, b in rest:
            s, c = s * cosine + c * sine, c * cosine - s * sine
            total = total + a * s + b * c
        return total

    return sum_at


@dataclass(frozen=True)
class OwnMemory:
    """A load of one joint that remembers one number.

    An `OwnLoad` knows angle and speed alone.
    """

    rate: Callable[[Any, Any, Functions], Any]  # memory, speed [rad/s] -> d(memory)/dt
    load: Callable[[Any, Any], Any]  # memory and its rate -> [N m]


@dataclass(frozen=True)
class Quantity:
    """One parameter of an effect.

    Its unit and the range it is expected in before any log is seen.
    """

    name: str
    unit: str
    low: float
    high: float
    meaning: str
    # non-linear: a field of the effect, scanned by `shapes`; otherwise an amplitude
    shape: bool = False
    # a shape that is a whole number, such as another joint: chosen, never moved a little
    discrete: bool = False
    derived: bool = False  # follows from the other parameters
    joint: bool = False  # the number of another joint of the arm, 1-based
    link: bool = False  # the number of a link with a joint beyond it, counted from the base
    # what holds where a model file does not say: the law from before the number was known
    unsaid: float | None = None
    grid: tuple[float, ...] = ()  # a shape: where a search looks, on any motion
    # a shape that a refit does not move from here, where the law is a simpler one
    held: float | None = None
    # a shape that is one number with that of the friction law at its joint, where that has it
    shared: bool = False
    # a shape: one joint may have the effect with several values of it, where the motion goes round
    several: bool = False
    # a shape: end of the angles that it was fitted to, beyond which the fit says nothing
    seen: bool = False
    # the columns compare it with the logged torque itself, where that is a held command
    reads_torque: bool = False
    revolute: bool = False  # only a joint that turns has it
    # of `joint`: the effect is the same with the two joints exchanged, and looked for at the later
    # one
    earlier: bool = False
    # an amplitude that physics gives: screening fits it, a refit holds it
    fixed: float | None = None
    # an amplitude that healthy machines have: 0 none, inf any, a number up to it; None: in small
    healthy: float | None = None
    # of an angle on a circle, rad whether its joint turns or slides: so much more is the same again
    period: float | None = None

    def among(self, own: int | None, n_joints: int) -> tuple[int, ...] | None:
        """Return the joints or links of an arm of `n_joints` joints that it may be.

        The effect is at joint `own`. None: it is neither a joint nor a link.
        """
        if self.joint:
            return tuple(k for k in range(1, n_joints + 1) if k != own)
        return tuple(range(1, n_joints)) if self.link else None

    def found_at(self, own: int | None, n_joints: int) -> bool:
        """Return whether an effect at joint `own` of `n_joints` has a joint or link for it.

        True where the parameter is neither a joint nor a link.
        """
        among = self.among(own, n_joints)
        return among is None or any(not self.earlier or own is None or k < own for k in among)

    def unfit(self, value: float, own: int | None, n_joints: int) -> str:
        """Why no arm of `n_joints` joints can have this value of an effect at joint `own`.

        The text is empty where it can.
        """
        among = self.among(own, n_joints)
        if among is None or value in among:
            return ""
        what = "is no other joint of" if self.joint else "is no link with a joint beyond it on"
        takes = f"; it takes {' or '.join(map(str, among))}" if among else ""
        return f"{self.name} = {value:g} {what} this arm, which has {n_joints}{takes}"

    def unit_at(self, revolute: bool) -> str:
        """Its unit at a joint of this kind.

        A prismatic one has m and N where a revolute one has rad and N m, and waves in 2π m.
        """
        if revolute or self.period is not None:
            return self.unit
        return self.unit.replace("N m",
                                 "N").replace("kg m^2",
                                              "kg").replace("rad",
                                                            "m").replace("1/rev", "1/(2 pi m)")


SAMPLED = Quantity("sample_time", "s", 0.0, 0.02,
                   "of the filter that is the lag, where it is computed once a sample; else 0",
                   shape=True, derived=True, unsaid=0.0)


class Parameters(tuple[Quantity, ...]):
    """The parameters of an effect, in the order in which models and reports list them."""

    def __new__(cls, *quantities: Quantity) -> Self:
        return super().__new__(cls, quantities)

    def complete(self, values: Values) -> dict[str, float]:
        """Return `values`, and the default of each number that is younger and not among them."""
        return {q.name: q.unsaid for q in self if q.unsaid is not None} | dict(values)

    @property
    def fixed(self) -> tuple[float, ...] | None:
        """Amplitudes that physics gives; None where all are fitted."""
        return tuple(q.fixed for q in self if q.fixed is not None) or None

    @property
    def healthy(self) -> float | None:
        """As much of it as healthy machines have: `Quantity.healthy` of the first amplitude."""
        return next((q.healthy for q in self if not q.shape and not q.derived), None)

    def slight(self, sample_time: float = 0.0) -> float:
        """Size of an amplitude that surely is no cause.

        That of a time is at least a tenth of a sample [s].
        """
        known, first = self.healthy, next((q.unit for q in self if not q.shape and not q.derived),
                                          "")
        least = EFFECTS.timing * sample_time if first == "s" else 0.0
        return least if known is None or math.isinf(known) else max(known, least)

    @property
    def reads_torque(self) -> bool:
        """Return whether columns hold the logged torque itself."""
        return any(q.reads_torque for q in self)


@dataclass(frozen=True)
class Words:
    """The text about an effect in a report: sentences, but for the title."""

    title: str
    signature: str  # how it shows
    explanation: str  # what it is
    remedy: str  # what to do about it
    experiment: str  # what to record to be sure
    # the parameter that a verdict gives with the title, if one alone says how much of it there is
    size: str = ""
    falling: bool = False  # there is more of it the smaller that parameter is


@dataclass(frozen=True)
class SpeedCurve:
    """A torque that depends on the speed of its own joint alone.

    τ = constant + viscous v + Σ height tanh(sharpness v).

    What has this form the simulation computes for all joints at once, and for one robot without any
    array.
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
        sigmoids = zip(self.heights, self.sharpnesses, strict=True)
        return self.constant + self.viscous * speed + sum(height * m.tanh(w * speed)
                                                          for height, w in sigmoids)


@dataclass(frozen=True)
class Hooks:
    """How an effect enters the forward simulation. Hooks left out change nothing.

    The first axis of every array holds replicas, so that many simulations run at once. `states`
    numbers of memory each replica keeps, zero or `start` at the start; `rate` moves them in
    continuous time, `update` once per control sample (a delay line): after `sensor` was asked,
    before the command acts. A command is the torque as it reaches this effect: of several the last
    one meets it first. The motion handed in is the true one with ddq zero: what multiplies
    acceleration goes to `inertia` or `arm`. Where a sensor is in error, `settled` says where the
    arm truly is when it reads its first position, so that the run does not begin with a jump; it
    and `start` are given the first acceleration too, as far as that is known.
    """

    # motion, states -> torque the drive must overcome [N m]
    load: Callable[[Motion, Array], Array] | None = None
    alone: tuple[int, OwnLoad] | None = None  # the same of one joint (0-based): `Effect.own_load`
    # or with one state that begins at zero: `Effect.own_memory`
    remembering: tuple[int, OwnMemory] | None = None
    # command, motion, states -> applied torque [N m]
    actuator: Callable[[Array, Motion, Array], Array] | None = None
    # the same of one joint (0-based), where speeds tell it
    drive: tuple[int, OwnDrive] | None = None
    sensor: Callable[[Array, Array], Array] | None = None  # true q, states -> measured q [rad]
    inertia: Array | None = None  # (joints, joints) [kg m^2] added to D(q)
    arm: ArmModel | None = None  # the arm as it truly is
    states: int = 0
    # as measured at the first sample, with its torque -> as it truly is
    settled: Callable[[Motion, Array], Motion] | None = None
    # motion and torque at the first sample -> states
    start: Callable[[Motion, Array], Array] | None = None
    # motion, command, states -> d(states)/dt
    rate: Callable[[Motion, Array, Array], Array] | None = None
    # motion, command, states -> next states
    update: Callable[[Motion, Array, Array], Array] | None = None
    # t (samples,), command (samples, joints) -> torque as the log has it
    record: Callable[[Array, Array], Array] | None = None


def friction_at(arm: ArmModel, joint: int) -> Callable[[Motion, Array], Array]:
    """Friction [N m] (samples,) of a joint (1-based) whose drive turns at a speed of its own.

    It is called as friction(motion, speed), and made once for a simulation, which asks it at every
    step.
    """
    curves = arm.friction_curves(joint)

    def by_curves(motion: Motion, speed: Array) -> Array:
        return np.asarray(sum((curve.torque(speed) for curve in curves or ()),
                              np.zeros(len(speed))))

    def by_laws(motion: Motion, speed: Array) -> Array:
        dq = motion.dq.copy()
        dq[:, joint - 1] = speed
        return np.asarray(arm.friction_torque(replace(motion, dq=dq))[:, joint - 1])

    return by_laws if curves is None else by_curves


def summed(columns: Array, amplitudes: Array) -> Array:
    """`columns` (samples, joints, k) times `amplitudes` (k,).

    Of many samples, which lie side by side, a matrix product takes two to twenty times as long.
    """
    if len(columns) < _MANY or not len(amplitudes):
        return np.asarray(columns @ amplitudes)
    parts = zip(np.moveaxis(columns, -1, 0), amplitudes.tolist(), strict=True)
    return np.asarray(sum(amplitude * column for column, amplitude in parts))


def predicted(arm: ArmModel, motion: Motion) -> Array:
    """Return `arm.torque(motion)`, kept with the motion; not to be written to."""
    return motion.kept(("predicted", arm), lambda: arm.torque(motion))
