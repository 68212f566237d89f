"""The contract of an effect: a physical cause is data plus one function.

An effect is written by its entry in causes.toml and `columns`; the rest has a default. Where the
torque is more than columns times amplitudes, one of these says how, exactly:

    torque(motion, arm, values)            a load that is not linear in its amplitudes
    corrected(motion, values)              an encoder: the motion as it truly is
    altered(arm, values)                   gravity, geometry, load: the arm as it truly is
    passed(tau, motion, arm, values)       a drive or a recorder: what the log shows of all torque

An object is the effect in one place and one shape: `joint` and the *non-linear* parameters are its
fields; a fit solves for the *linear* ones, its amplitudes.

    torque = columns(motion, arm) @ amplitudes      to first order; exactly for most

Torque is a load: measured torque = torque of the model + torques of the effects. Columns follow
from motion and *predicted* torque, never from measured torque, whose noise would bias them; but
what a drive keeps back above its limit follows from the commanded torque, `Motion.tau`. Columns
need not be independent, nor all visible: solve with a rank threshold. Each motion is one log from
its first sample.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from operator import mul
from typing import Any, ClassVar, Literal, Self, TypeVar

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.functions import ARRAYS, Functions
from pipelines.effects.hooks import (
    ArmModel,
    Hooks,
    OwnLoad,
    OwnMemory,
    Predict,
    SpeedCurve,
    friction_at,
    predicted,
    summed,
)
from pipelines.effects.parameters import Parameters, Quantity, Values, Words, causes

__all__ = [
    "ArmModel",
    "Effect",
    "Event",
    "FrictionLaw",
    "Hooks",
    "OwnLoad",
    "OwnMemory",
    "Parameters",
    "Pointwise",
    "Predict",
    "Quantity",
    "SpeedCurve",
    "Values",
    "Words",
    "adds",
    "everywhere",
    "friction_at",
    "joints_of",
    "plainer",
    "predicted",
    "summed",
]

E = TypeVar("E", bound="Effect")
_BEYOND = 0.1  # numerics: share of the range in which it was seen; farther out it is not known


class _FromTable:
    """A field that the table of causes holds for an effect by its name."""

    def __set_name__(self, owner: type, name: str) -> None:
        self.field = name

    def __get__(self, effect: Effect | None, kind: type[Effect]) -> Any:
        return getattr(causes()[kind.name], self.field)


@dataclass(frozen=True)
class Effect(ABC):
    """A physical cause at one joint, or of the whole arm."""

    joint: int | None = None  # 1-based; None where scope is "arm"

    name: ClassVar[str]  # identifier of causes.md and causes.toml
    words: ClassVar[Words] = _FromTable()  # type: ignore[assignment]
    parameters: ClassVar[Parameters] = _FromTable()  # type: ignore[assignment]
    scope: ClassVar[Literal["joint", "arm"]] = "joint"
    # the order in which effects compose; the record, outermost, is a first-order low-pass, its
    # amplitude the time constant [s]
    acts_on: ClassVar[Literal["load", "encoder", "drive", "record"]] = "load"
    # "session": its field `since` [s] is when the session began; "log": it happens once
    clock: ClassVar[Literal["none", "session", "log"]] = "none"
    # what a diagnosis may name it by; "none": a law that a nominal model has, and no cause
    evidence: ClassVar[
        Literal["residual", "frequency responses", "reversals", "base parameters", "none"]
    ] = "residual"
    from_motion: ClassVar[bool] = False  # its columns follow from the motion alone, on any arm

    def __post_init__(self) -> None:
        if (self.scope == "joint") != (self.joint is not None and self.joint >= 1):
            where = "one joint, counted from 1" if self.scope == "joint" else "the whole arm"
            raise ValueError(f"{self.name} belongs to {where}, not to joint {self.joint}")
        for q in self.parameters:  # another joint: the one before, if none is given
            if q.joint and self.joint is not None and not getattr(self, q.name):
                object.__setattr__(self, q.name, float(self.joint - 1 or 2))

    @abstractmethod
    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        """Return the torque per unit of each amplitude, to first order.

        The array is (samples, joints, amplitudes).
        """

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """Return the effect in every shape worth trying: all combinations of its grids."""
        places = {q.name: q.grid or q.among(self.joint, arm.n_joints) for q in self.parameters}
        grids = {name: values for name, values in places.items() if values is not None}
        for numbers in product(*grids.values()):
            shape: dict[str, Any] = dict(zip(grids, map(float, numbers), strict=True))
            yield replace(self, **shape)

    def forms(self) -> tuple[Self, ...]:
        """Return the form that a finding is refitted with, then other laws of the same cause."""
        return (self,)

    def nuisance(self, arm: ArmModel) -> Array | None:
        """Return directions (base parameters, k) in which it moves them, how far is unknown."""
        return None

    def apply(
        self, motion: Motion, arm: ArmModel, values: Values, predict: Predict | None = None
    ) -> Array:
        """Return the torque (samples, joints) that a log shows with this effect, exactly.

        `predict` says what it would show without: effects are put one around the other.
        """
        true, other = self.corrected(motion, values), self.altered(arm, values)
        tau = predict(true, other) if predict is not None else other.torque(true)
        return self.passed(tau, motion, arm, values)

    def corrected(self, motion: Motion, values: Values) -> Motion:
        """Return the motion as it truly is."""
        return motion

    def altered(self, arm: ArmModel, values: Values) -> ArmModel:
        """Return the arm as it truly is."""
        return arm

    def passed(self, tau: Array, motion: Motion, arm: ArmModel, values: Values) -> Array:
        """Return what the log shows of the torque `tau` that is needed without; may write to it."""
        return np.asarray(tau + self.torque(motion, arm, values))

    def torque(self, motion: Motion, arm: ArmModel, values: Values) -> Array:
        """Return the torque (samples, joints) [N m] that it adds."""
        return summed(self.at(values).columns(motion, arm), self.amplitudes(values))

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Return how it enters the forward simulation; by default as a load."""
        shaped, amplitudes = self.at(values), self.amplitudes(values)
        return Hooks(load=lambda motion, _: summed(shaped.columns(motion, arm), amplitudes))

    # numbers: a law may give others than it is fitted by

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the shapes that a refit moves continuously."""
        return tuple(
            q.name
            for q in self.parameters
            if q.shape
            and not q.discrete
            and not q.derived
            and (q.held is None or getattr(self, q.name) != q.held)
        )

    def at_end(self, name: str, by: float) -> bool:
        """Return whether a shape is at the end of its range, and `by` points out of it."""
        own = [q for q in self.parameters if q.name == name]  # none: an amplitude, by its number
        return any(
            (getattr(self, name) <= q.low and by < 0.0)
            or (getattr(self, name) >= q.high and by > 0.0)
            for q in own
        )

    def within(self, name: str, value: float) -> float:
        """Return a number, or the end of the range of parameter `name` that is nearest to it."""
        quantity = next(q for q in self.parameters if q.name == name)
        return float(np.clip(value, quantity.low, quantity.high))

    def at(self, values: Values) -> Self:
        """Return the effect with the shapes out of `values`."""
        known = self.parameters.complete(values)
        shape: dict[str, Any] = {q.name: known[q.name] for q in self.parameters if q.shape}
        return replace(self, **shape)  # type: ignore[type-var]

    def amplitudes(self, values: Values) -> Array:
        """Return the amplitudes that belong to `values`, in the order of the columns."""
        return np.array([values[q.name] for q in self.parameters if not q.shape])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        """Return every parameter by name; the inverse of `at` and `amplitudes`."""
        linear = iter(amplitudes)
        return {
            q.name: float(getattr(self, q.name) if q.shape else next(linear))
            for q in self.parameters
        }

    def possible(self, values: Values) -> bool:
        """Return whether every parameter lies in its range."""
        return all(q.low <= values[q.name] <= q.high for q in self.parameters)

    def reported(self, values: Values) -> dict[str, float | tuple[float, ...]]:
        """Return the parameters of a finding, named as in causes.md; whole numbers are integers."""
        return {
            q.name: int(values[q.name]) if q.discrete else values[q.name] for q in self.parameters
        }

    # its own joint, and how that moves

    @property
    def index(self) -> int:
        """Its joint, from 0."""
        if self.joint is None:
            raise ValueError(f"{self.name} belongs to the whole arm and has no joint of its own")
        return self.joint - 1

    def own(self, signal: Array) -> Array:
        """Column of its own joint, (samples,)."""
        return np.asarray(signal[..., self.index])

    def fastest(self, motion: Motion) -> float:
        """[rad/s] of its own joint; 1 where it rests."""
        return float(np.abs(self.own(motion.dq)).max(initial=0.0)) or 1.0

    def goes_round(self, motion: Motion, but: float = 0.02) -> bool:
        """Return whether its own joint travels all of a circle but for a fiftieth, or for `but`."""
        return float(np.ptp(self.own(motion.q))) > (1.0 - but) * 2.0 * np.pi

    def goes_beyond(self, motions: Sequence[Motion], known: Sequence[Motion]) -> bool:
        """Return whether its joint leaves its range of angles in `known` by more than a tenth."""
        now, then = (
            np.concatenate([self.own(motion.q) for motion in some]) for some in (motions, known)
        )
        return bool(max(now.max() - then.max(), then.min() - now.min()) > _BEYOND * np.ptp(then))

    def curve(self, dq: Array, arm: ArmModel, values: Values) -> Array:
        """Return its torque (samples,) [N m] on its own joint against speed alone, all at rest."""
        still = np.zeros((len(dq), arm.n_joints))
        motion = Motion(np.zeros(len(dq)), still, self.on_own_row(arm, dq)[..., 0], still)
        return self.own(self.torque(motion, arm, values))

    def on_own_row(self, arm: ArmModel, *columns: Array) -> Array:
        """`columns`, each (samples,), as (samples, joints, columns) of its own joint only."""
        rows = np.zeros((arm.n_joints, len(columns), len(columns[0])))
        for k, column in enumerate(columns):
            rows[self.index, k] = column
        return rows.transpose(2, 0, 1)

    # speed: without these every answer is the same, and takes longer

    def several(self, shapes: Sequence[Self], motion: Motion, arm: ArmModel) -> list[Array]:
        """Return `columns` of several shapes of itself."""
        return [shape.columns(motion, arm) for shape in shapes]

    def own_columns(self, shapes: Sequence[Self], motion: Motion, arm: ArmModel) -> Array:
        """Return those of shapes that act on this joint alone: (shapes, amplitudes, samples)."""
        return np.stack([shape.columns(motion, arm)[:, self.index].T for shape in shapes])

    def shape_slopes(self, motion: Motion, amplitudes: Array) -> Array | None:
        """Return the slopes (samples, shapes) of its torque by their logarithms, if known."""
        return None

    def speed_curve(self, values: Values) -> SpeedCurve | None:
        """Return its torque as a `SpeedCurve`, where it is one; `simulate` then is not asked."""
        return None

    def own_load(self, values: Values) -> OwnLoad | None:
        """Return the load of `simulate` by angle and speed of its own joint, where these tell."""
        return None

    def own_memory(self, values: Values) -> OwnMemory | None:
        """Return the load of `simulate` where it has one state, moved by its own joint's speed."""
        return None


@dataclass(frozen=True)
class Pointwise(Effect):
    """An effect whose torque on its own joint follows from that joint's angle and speed."""

    from_motion = True

    @abstractmethod
    def parts(self, q: Any, v: Any, m: Functions) -> Sequence[Any]:
        """Return the torque per unit of each amplitude, in numbers or arrays."""

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm, *self.parts(self.own(motion.q), self.own(motion.dq), ARRAYS))

    def own_load(self, values: Values) -> OwnLoad:
        parts, amplitudes = self.at(values).parts, self.amplitudes(values).tolist()
        if len(amplitudes) == 1:
            (one,) = amplitudes
            return lambda q, v, m: one * parts(q, v, m)[0]
        return lambda q, v, m: sum(map(mul, amplitudes, parts(q, v, m)))


@dataclass(frozen=True)
class FrictionLaw(Effect):
    """A law of friction: every column takes power out of its joint."""

    # the same law with fewer terms, from most to fewest, each by the names of its laws: for logs
    # that do not tell the terms apart
    plainer: ClassVar[tuple[tuple[str, ...], ...]] = ()


@dataclass(frozen=True)
class Event(Effect):
    """An effect whose shapes are a window of time [s] from the start of its log."""

    clock = "log"

    @abstractmethod
    def promising(self, motion: Motion, arm: ArmModel, residual: Array) -> Iterator[Self]:
        """Return a few tens of windows that may explain `residual` (samples, joints) [N m]."""

    @abstractmethod
    def course(self, t: Array) -> Array:
        """Return how large it is (samples,) at `t` since the start of the log, of its largest."""


def plainer(law: Effect) -> tuple[tuple[str, ...], ...]:
    """Return the names of laws with fewer terms; none where `law` is no law of friction."""
    return law.plainer if isinstance(law, FrictionLaw) else ()


def adds(effect: Effect) -> bool:
    """Return whether it only adds its columns to the torque of the other effects."""
    kept = ("apply", "corrected", "altered", "passed", "torque")
    return all(getattr(type(effect), name) is getattr(Effect, name) for name in kept)


def joints_of(kind: type[Effect] | Effect, revolute: Sequence[bool]) -> tuple[int, ...]:
    """Return the joints (1-based) that can have it, of joints that turn (`revolute`) or slide."""
    turning = any(q.revolute for q in kind.parameters)
    return tuple(k for k, turns in enumerate(revolute, 1) if turns or not turning)


def everywhere(kind: type[E], revolute: Sequence[bool]) -> tuple[E, ...]:
    """Return one at every joint where it is looked for; or the one of the whole arm."""
    places = joints_of(kind, revolute) if kind.scope == "joint" else (None,)
    n = len(revolute)
    return tuple(kind(joint=k) for k in places if all(q.found_at(k, n) for q in kind.parameters))
