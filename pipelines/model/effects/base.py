"""What every effect offers: a physical cause is data plus one function.

An effect is written by giving its words, its parameters and `columns`; all else has a default in `Effect`.

    Coulomb friction     columns = tanh(w v) on its own row; nothing else
    Cogging              columns = sin kq, cos kq; `shapes` runs over k; `values` gives amplitude and phase
    A clipped drive      columns to screen with; `apply` = clip(predict(motion, arm))
    An encoder fault     columns to screen with; `apply` = predict(corrected motion, arm)
    Tilted gravity       columns to screen with; `apply` = predict(motion, arm.with_body(tilted body, p))

An object is the effect in one place and one shape: `joint` and the *non-linear* numbers (speeds, orders, delays) are
its fields. The *linear* numbers, its amplitudes, stay outside, for they are what a fit solves for:

    torque = columns(motion, arm) @ amplitudes      to first order; exactly for most

Torque is a load: measured torque = torque of the model + torques of the effects. Everything is computed from the motion
and the *predicted* torque, never from measured torque, whose noise would bias it. One exception: what a drive kept back above
its limit only the commanded torque tells, which travels with the motion as `Motion.tau`.

What a search over effects asks, so that it need not know any of them:

    shapes, promising    a grid of non-linear numbers; the few of them that a residual speaks for, where the grid is large
    full                 the form a finding is refitted with: more harmonics, a cubic term. `shapes` are the screening form
    forms                other laws of the same cause, in place of that form where they leave decidedly less
    free                 the non-linear numbers that an exact refit may move; the others are discrete, or follow from these
    shared               non-linear numbers that are those of the friction at its joint: one surface changes sign over one speed
    fixed_amplitudes     amplitudes that physics gives: screening fits them, an exact refit holds them
    possible             whether values lie in their ranges: a lag of negative time is no lag, but perhaps another cause
    per_log              parameters that belong to one log: an event, or a phase where encoders are zeroed at each start
    again                whether one place may have it more than once: waves of several orders along one turn
    acting               the samples in which an effect of a moment acts, which a fit of the arm may leave out
    reported             the parameters as causes.md names them

The columns of an effect need not be independent of each other, nor all seen, on every arm: solve with a rank threshold. Each
motion handed in is one log from its first sample (time in a log counts from motion.t[0]), complete but for gaps.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal, Protocol, Self

import numpy as np
import numpy.typing as npt

from pipelines.log.robot import RobotDescription
from pipelines.model.rigid.body import Array, Motion, RigidBody

__all__ = ["ArmModel", "Effect", "Hooks", "OwnLoad", "Predict", "Quantity", "SpeedCurve", "Values", "friction_at"]

Values = Mapping[str, float]


class ArmModel(Protocol):
    """What an effect may ask of the arm it acts on: the arm as modelled without this effect."""

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
        """The part of it (samples, joints) [N m] that the friction laws make."""
        ...

    def friction_curves(self, joint: int) -> tuple[SpeedCurve, ...] | None:
        """The friction laws at a joint (1-based) as curves of its speed; None where one of them is more than that."""
        ...

    def with_body(self, body: RigidBody, p: Array) -> ArmModel:
        """The same arm with another rigid body: new geometry, gravity or load."""
        ...


Predict = Callable[[Motion, ArmModel], Array]
OwnLoad = Callable[[float, float], float]  # angle [rad], speed [rad/s] -> [N m]


@dataclass(frozen=True)
class Quantity:
    """One parameter of an effect: its unit and the range it is expected in before any log is seen."""

    name: str
    unit: str
    low: float
    high: float
    meaning: str
    shape: bool = False  # non-linear: a field of the effect, scanned by `shapes`; otherwise an amplitude
    discrete: bool = False  # a shape that is a whole number, such as another joint: chosen, never moved a little
    derived: bool = False  # follows from the other parameters
    joint: bool = False  # the number of another joint of the arm, 1-based
    unsaid: float | None = None  # what holds where a model file does not say: the law from before the number was known

    def unfit(self, value: float, own: int | None, n_joints: int) -> str:
        """Why no arm of `n_joints` joints can have this value of an effect at joint `own`; empty where it can."""
        if not self.joint or (value in range(1, n_joints + 1) and value != own):
            return ""
        return f"{self.name} = {value:g} is no other joint of this arm, which has {n_joints}"

    def unit_at(self, revolute: bool) -> str:
        """Its unit at a joint of this kind: a prismatic one has m and N where a revolute one has rad and N m."""
        if revolute:
            return self.unit
        return self.unit.replace("N m", "N").replace("kg m^2", "kg").replace("rad", "m")


@dataclass(frozen=True)
class SpeedCurve:
    """A torque that depends on the speed of its own joint alone: τ = constant + viscous v + Σ height tanh(sharpness v).

    What has this form the simulation computes for all joints at once, and for one robot without any array.
    """

    constant: float = 0.0  # [N m]
    viscous: float = 0.0  # [N m s/rad]
    heights: tuple[float, ...] = ()  # [N m]
    sharpnesses: tuple[float, ...] = ()  # [s/rad]

    def torque(self, speed: Array) -> Array:
        """[N m] at each speed [rad/s]."""
        tau = self.constant + self.viscous * speed
        for height, sharpness in zip(self.heights, self.sharpnesses, strict=True):
            tau += height * np.tanh(sharpness * speed)
        return tau


@dataclass(frozen=True)
class Hooks:
    """How an effect enters the forward simulation. What is left out changes nothing.

    The first axis of every array holds replicas, so that many simulations run at once. `states` numbers of memory each
    replica keeps, zero or `start` at the start; `rate` moves them in continuous time, `update` once per control sample
    (a delay line): after `sensor` was asked, before the command acts. A command is the torque as it reaches this effect:
    of several the last one meets it first. The motion handed in is the true one with ddq
    zero: what multiplies acceleration goes to `inertia` or `arm`. Where a sensor is in error, `settled` says where the arm
    truly is when it reads its first position, so that the run does not begin with a jump; it and `start` are given the first
    acceleration too, as far as that is known.
    """

    load: Callable[[Motion, Array], Array] | None = None  # motion, states -> torque the drive must overcome [N m]
    alone: tuple[int, OwnLoad] | None = None  # the same of one joint (0-based) in plain numbers: `Effect.own_load`
    actuator: Callable[[Array, Motion, Array], Array] | None = None  # command, motion, states -> applied torque [N m]
    sensor: Callable[[Array, Array], Array] | None = None  # true q, states -> measured q [rad]
    inertia: Array | None = None  # (joints, joints) [kg m^2] added to D(q)
    arm: ArmModel | None = None  # the arm as it truly is
    states: int = 0
    settled: Callable[[Motion, Array], Motion] | None = None  # as measured at the first sample, with its torque -> as it truly is
    start: Callable[[Motion, Array], Array] | None = None  # motion and torque at the first sample -> states
    rate: Callable[[Motion, Array, Array], Array] | None = None  # motion, command, states -> d(states)/dt
    update: Callable[[Motion, Array, Array], Array] | None = None  # motion, command, states -> next states
    record: Callable[[Array, Array], Array] | None = None  # t (samples,), command (samples, joints) -> torque as the log has it


@dataclass(frozen=True)
class Effect(ABC):
    """A physical cause at one joint, or of the whole arm."""

    joint: int | None = None  # 1-based; None where scope is "arm"

    name: ClassVar[str]  # identifier of causes.md, and the file's name
    title: ClassVar[str]  # plain words
    scope: ClassVar[Literal["joint", "arm"]] = "joint"
    parameters: ClassVar[tuple[Quantity, ...]]
    signature: ClassVar[str]  # how it shows
    explanation: ClassVar[str]  # what it is
    remedy: ClassVar[str]  # what to do about it
    experiment: ClassVar[str]  # what to record to be sure
    twins: ClassVar[tuple[str, ...]] = ()  # effects it can be mistaken for
    needs: ClassVar[tuple[str, ...]] = ()  # what beyond position and torque it takes to see it: "reference log"
    fixed_amplitudes: ClassVar[tuple[float, ...] | None] = None  # what physics gives; None: all are fitted
    per_log: ClassVar[tuple[str, ...]] = ()  # parameters that belong to one log and not to the arm
    evidence: ClassVar[Literal["residual", "frequency responses", "reversals", "base parameters", "none"]] = "residual"
    # what a diagnosis may name it by; "none": it is a law that a nominal model has, no cause
    shared: ClassVar[tuple[str, ...]] = ()  # shapes that are one number with that of the friction law at its joint, where it has it
    from_motion: ClassVar[bool] = False  # its columns follow from the motion alone, whatever the arm
    last: ClassVar[bool] = False  # it changes the record of what everything else did, whatever was found after it
    in_drive: ClassVar[bool] = False  # all torque of its joint comes through it, whatever was found after it
    misread: ClassVar[bool] = False  # it changes what an encoder says: all but the record is felt where the joint truly is
    passing: ClassVar[tuple[float, ...]] = ()  # amplitudes beyond first order to try, where all torque of its joint passes it
    friction: ClassVar[bool] = False  # every column takes power out of its joint, and is a law of friction

    def __post_init__(self) -> None:
        if (self.scope == "joint") != (self.joint is not None and self.joint >= 1):
            where = "one joint, counted from 1" if self.scope == "joint" else "the whole arm"
            raise ValueError(f"{self.name} belongs to {where}, not to joint {self.joint}")

    @abstractmethod
    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        """Its torque per unit of each amplitude, to first order, (samples, joints, amplitudes)."""

    def several(self, shapes: Sequence[Self], motion: Motion, arm: ArmModel) -> list[Array]:
        """`columns` of several shapes of itself."""
        return [shape.columns(motion, arm) for shape in shapes]

    def own_columns(self, shapes: Sequence[Self], motion: Motion, arm: ArmModel) -> Array:
        """Of several shapes at this joint that act on it alone: (shapes, amplitudes, samples)."""
        return np.stack([shape.columns(motion, arm)[:, self._index].T for shape in shapes])

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """Itself with every combination of non-linear numbers worth trying on this motion."""
        yield self

    def promising(self, motion: Motion, arm: ArmModel, residual: Array) -> Iterator[Self]:
        """Those of its shapes that may explain `residual` (samples, joints) [N m] over `motion`, at most a few tens."""
        yield from self.shapes(motion, arm)

    def full(self) -> Self:
        """The form that a finding is refitted with, where screening uses one with fewer amplitudes."""
        return self

    def forms(self) -> tuple[Self, ...]:
        """Other laws of the same cause, each to be tried in place of this one, which is the most likely."""
        return ()

    def again(self, motion: Motion) -> bool:
        """Whether it may act more than once at its place, in different shapes that this motion tells apart."""
        return False

    def acting(self, motion: Motion) -> npt.NDArray[np.bool_] | None:
        """The samples in which it acts, where it acts for a moment only."""
        return None

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the non-linear numbers that may be moved continuously."""
        return tuple(q.name for q in self.parameters if q.shape and not q.discrete and not q.derived)

    def possible(self, values: Values) -> bool:
        """Whether every parameter lies in its range."""
        return all(q.low <= values[q.name] <= q.high for q in self.parameters)

    def reported(self, values: Values) -> dict[str, float | tuple[float, ...]]:
        """The parameters of a finding, named as in causes.md; whole numbers are integers."""
        return {q.name: int(values[q.name]) if q.discrete else values[q.name] for q in self.parameters}

    def passed(self, amplitude: float, x: Array, t: Array, start: Array | float | None = None, since: int = 0) -> Array:
        """Any torque `x` (…, samples) of its joint as it comes out of it, where `passing` says that all of it goes through.

        Args:
            start: what comes out up to sample `since`; None: as if `x` had been so before.
        """
        return x

    @classmethod
    def everywhere(cls, n_joints: int) -> tuple[Self, ...]:
        """One at every joint, or the one of the whole arm."""
        return tuple(cls(joint=k + 1) for k in range(n_joints)) if cls.scope == "joint" else (cls(),)

    def shape_slopes(self, motion: Motion, amplitudes: Array) -> Array | None:
        """Of its torque on its own joint, by the logarithm of each non-linear number, in order: (samples, numbers) [N m].

        None where nobody wrote it down: then it is found by differences.
        """
        return None

    @property
    def adds(self) -> bool:
        """Whether all it does is to add its columns to the torque, so that nothing else has to be worked out with it."""
        return type(self).apply is Effect.apply and type(self).torque is Effect.torque

    def at(self, values: Values) -> Self:
        """Itself with the non-linear numbers out of `values`."""
        shape: dict[str, Any] = {q.name: values[q.name] for q in self.parameters if q.shape}
        return replace(self, **shape)

    def amplitudes(self, values: Values) -> Array:
        """The amplitudes that belong to `values`, in the order of the columns."""
        return np.array([values[q.name] for q in self.parameters if not q.shape])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        """Every parameter by name; the inverse of `at` and `amplitudes`."""
        linear = iter(amplitudes)
        return {q.name: float(getattr(self, q.name) if q.shape else next(linear)) for q in self.parameters}

    def torque(self, motion: Motion, arm: ArmModel, values: Values) -> Array:
        """Its torque (samples, joints) [N m]."""
        return np.asarray(self.at(values).columns(motion, arm) @ self.amplitudes(values))

    def curve(self, dq: Array, arm: ArmModel, values: Values) -> Array:
        """Its torque (samples,) [N m] on its own joint against speed alone, at rest otherwise: the friction curve."""
        still = np.zeros((len(dq), arm.n_joints))
        motion = Motion(np.zeros(len(dq)), still, self.on_own_row(arm, dq)[..., 0], still)
        return self.own(self.torque(motion, arm, values))

    def apply(self, motion: Motion, arm: ArmModel, values: Values, predict: Predict | None = None) -> Array:
        """The torque (samples, joints) that a log of `motion` shows on an arm that has this effect, exactly.

        `predict` says what it would show without; effects are thus put one around the other. To warp a signal, hand
        another motion to `predict`; to change geometry or gravity, another arm; to clip, treat what it returns.
        """
        without = predict(motion, arm) if predict is not None else arm.torque(motion)
        return np.asarray(without + self.torque(motion, arm, values))

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """How it enters the forward simulation; by default as a load."""
        shaped, amplitudes = self.at(values), self.amplitudes(values)
        return Hooks(load=lambda motion, _: np.asarray(shaped.columns(motion, arm) @ amplitudes))

    def speed_curve(self, values: Values) -> SpeedCurve | None:
        """Its torque as a `SpeedCurve`, where it is one and nothing else: `simulate` then is not asked."""
        return None

    def own_load(self, values: Values) -> OwnLoad | None:
        """What `simulate` has as load, as a function of angle and speed of its own joint, where it follows from these alone.

        A simulation of one robot asks it: plain numbers are several times faster there than arrays.
        """
        return None

    def predicted(self, motion: Motion, arm: ArmModel) -> Array:
        """`arm.torque(motion)`, kept from one effect and shape to the next; not to be written to."""
        return _predicted(arm, motion)

    def own(self, signal: Array) -> Array:
        """Column of its own joint, (samples,)."""
        return np.asarray(signal[..., self._index])

    def goes_round(self, motion: Motion) -> bool:
        """Whether its own joint travels all of a circle but for a fiftieth: what it does there comes back to where it began."""
        return float(np.ptp(self.own(motion.q))) > 0.98 * 2.0 * np.pi

    def on_own_row(self, arm: ArmModel, *columns: Array) -> Array:
        """`columns`, each (samples,), as (samples, joints, columns): they act on its own joint only. Samples lie side by side."""
        rows = np.zeros((arm.n_joints, len(columns), len(columns[0])))
        for k, column in enumerate(columns):
            rows[self._index, k] = column
        return rows.transpose(2, 0, 1)

    @property
    def _index(self) -> int:
        if self.joint is None:
            raise ValueError(f"{self.name} belongs to the whole arm and has no joint of its own")
        return self.joint - 1


def friction_at(arm: ArmModel, joint: int) -> Callable[[Motion, Array], Array]:
    """Friction [N m] (samples,) of a joint (1-based) whose drive turns at a speed of its own: friction(motion, speed).

    Made once for a simulation, which asks it at every step.
    """
    curves = arm.friction_curves(joint)

    def by_curves(motion: Motion, speed: Array) -> Array:
        return np.asarray(sum((curve.torque(speed) for curve in curves or ()), np.zeros(len(speed))))

    def by_laws(motion: Motion, speed: Array) -> Array:
        dq = motion.dq.copy()
        dq[:, joint - 1] = speed
        return np.asarray(arm.friction_torque(replace(motion, dq=dq))[:, joint - 1])

    return by_laws if curves is None else by_curves


_KEPT: list[tuple[ArmModel, Motion, Array]] = []  # the last few, newest first; compared by identity, for a motion is its arrays
_KEEP = 6


def _predicted(arm: ArmModel, motion: Motion) -> Array:
    for place, (other, same, torque) in enumerate(_KEPT):
        if other is arm and same is motion:
            _KEPT.insert(0, _KEPT.pop(place))
            return torque
    torque = arm.torque(motion)
    torque.flags.writeable = False
    _KEPT.insert(0, (arm, motion, torque))
    del _KEPT[_KEEP:]
    return torque
