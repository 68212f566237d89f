"""The contract of an effect: a physical cause is data plus one function.

An effect is written by giving its words, its parameters and `columns`; all else has a default in `Effect`.

    Coulomb friction     columns = tanh(w v) on its own row; nothing else
    Cogging              columns = sin kq, cos kq; `shapes` runs over k; `values` gives amplitude and phase
    A clipped drive      columns to screen with; `apply` = clip(predict(motion, arm))
    An encoder fault     columns to screen with; `apply` = predict(corrected motion, arm)
    Tilted gravity       columns to screen with; `apply` = predict(motion, arm.with_body(tilted body, p))

An object is the effect in one place and one shape: `joint` and the *non-linear* parameters (speeds, orders, delays) are
its fields. The *linear* parameters, its amplitudes, are not: a fit solves for them.

    torque = columns(motion, arm) @ amplitudes      to first order; exactly for most

Torque is a load: measured torque = torque of the model + torques of the effects. Columns are computed from the motion and the
*predicted* torque, never from measured torque, whose noise would bias them. One exception: the torque that a drive keeps back
above its limit follows from the commanded torque alone, which is `Motion.tau`.

What a diagnosis reads:

    shapes, promising    a grid of non-linear parameters; the event windows that a residual suggests
    full, forms          the form that is refitted, with more amplitudes than the one screened; other laws of the same cause
    free, shared         non-linear parameters that a refit may move; those that equal the friction law's at the same joint
    fixed_amplitudes     amplitudes given by physics: screening fits them, a refit holds them; `words.size` then tells how much
    possible, at_end     whether values lie in their ranges, and whether a step would leave them
    per_log              parameters that belong to one log: the window of an event, the phase of encoders zeroed at each start
    moving               directions in which the effect changes base parameters beyond its columns (nuisance)
    beyond               whether logs contain motion that the fit of the effect says nothing of
    again                whether one place may have it more than once: cogging of several orders
    reads_torque         whether its columns hold the logged torque
    healthy, slight      what healthy machines have in small
    acts_on              load, encoder, drive or record: effects compose in this order, the record outermost
    passed, mixing       torque after the record's filter; the matrix by which drives mix the torques of one instant
    reported             the parameters as causes.md names them

Speed-ups are in `fast`. Columns need not be independent, nor all visible, on every arm: solve with a rank threshold. Each motion
is one log from its first sample (time in a log counts from motion.t[0]), complete but for gaps.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal, Self

import numpy as np

from pipelines.model.effects.placed import Placed
from pipelines.model.effects.terms import (
    LARGE,
    ArmModel,
    Formula,
    Hooks,
    OwnLoad,
    OwnMemory,
    PlainDrive,
    Predict,
    Quantity,
    SpeedCurve,
    Values,
    Words,
    friction_at,
    predicted,
    summed,
)
from pipelines.model.rigid.body import Array, Motion

__all__ = ["LARGE", "ArmModel", "Effect", "Formula", "Hooks", "OwnLoad", "OwnMemory", "PlainDrive", "Predict", "Quantity",
           "SpeedCurve", "Values", "Words",
           "friction_at", "predicted"]


@dataclass(frozen=True)
class Effect(Placed, ABC):
    """A physical cause at one joint, or of the whole arm."""

    joint: int | None = None  # 1-based; None where scope is "arm"

    name: ClassVar[str]  # identifier of causes.md, and the file's name
    words: ClassVar[Words]
    scope: ClassVar[Literal["joint", "arm"]] = "joint"
    parameters: ClassVar[tuple[Quantity, ...]]
    fixed_amplitudes: ClassVar[tuple[float, ...] | None] = None  # what physics gives; None: all are fitted
    per_log: ClassVar[tuple[str, ...]] = ()  # parameters that belong to one log and not to the arm
    evidence: ClassVar[Literal["residual", "frequency responses", "reversals", "base parameters", "none"]] = "residual"
    # what a diagnosis may name it by; "none": it is a law that a nominal model has, no cause
    shared: ClassVar[tuple[str, ...]] = ()  # shapes that are one number with that of the friction law at its joint, where it has it
    acts_on: ClassVar[Literal["load", "encoder", "drive", "record"]] = "load"  # also the order in which effects compose
    plainer: ClassVar[tuple[tuple[str, ...], ...]] = ()  # the same law with fewer terms, from most of them to fewest, each by the
    # names of what it consists of: taken in its place where logs do not tell its terms apart
    reads_torque: ClassVar[bool] = False  # its columns hold the logged torque itself, where that is a held command
    friction: ClassVar[bool] = False  # every column takes power out of its joint, and is a law of friction
    slight: ClassVar[float] = 0.0  # of its only amplitude: what surely is less, arms in order have as well
    healthy: ClassVar[Literal["first shape", "every shape", "never"]] = "first shape"  # that healthy machines have in small
    ordinary: ClassVar[bool] = False  # machines in order have it: a model lacks it, and nothing need be broken

    def __post_init__(self) -> None:
        if (self.scope == "joint") != (self.joint is not None and self.joint >= 1):
            where = "one joint, counted from 1" if self.scope == "joint" else "the whole arm"
            raise ValueError(f"{self.name} belongs to {where}, not to joint {self.joint}")

    @abstractmethod
    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        """Its torque per unit of each amplitude, to first order, (samples, joints, amplitudes)."""

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """Itself with every combination of non-linear numbers worth trying on this motion."""
        yield self

    def promising(self, motion: Motion, arm: ArmModel, residual: Array) -> Iterator[Self]:
        """Those of its shapes that may explain `residual` (samples, joints) [N m] over `motion`, at most a few tens."""
        yield from self.shapes(motion, arm)

    def in_session(self, start: float) -> Self:
        """Itself with the clock of a session that began at `start` [s]; most effects know no time."""
        return self

    def full(self) -> Self:
        """The form that a finding is refitted with, where screening uses one with fewer amplitudes."""
        return self

    def forms(self) -> tuple[Self, ...]:
        """Other laws of the same cause, each to be tried in place of this one, which is the most likely."""
        return ()

    def again(self, motion: Motion) -> bool:
        """Return whether it may act more than once at its place, in different shapes that this motion tells apart."""
        return False

    def moving(self, arm: ArmModel) -> Array | None:
        """(base parameters, k): directions in which it moves them beyond its columns, each by a number that nobody knows."""
        return None

    def beyond(self, motions: Sequence[Motion], known: Sequence[Motion]) -> bool:
        """Return whether `motions` go where those it was fitted to, `known`, say nothing of it."""
        return False

    @property
    def strength(self) -> float:
        """How much of it there is, by `words.size`, where physics gives the amplitudes; negative for what grows as that falls."""
        return float(getattr(self, self.words.size)) if self.fixed_amplitudes else 0.0

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the non-linear numbers that may be moved continuously."""
        return tuple(q.name for q in self.parameters if q.shape and not q.discrete and not q.derived)

    def at_end(self, name: str, by: float) -> bool:
        """Return whether a number of the shape is at the end of its range, and `by` points out of it."""
        quantity = next(q for q in self.parameters if q.name == name)
        here = float(getattr(self, name))
        return (here <= quantity.low and by < 0.0) or (here >= quantity.high and by > 0.0)

    def possible(self, values: Values) -> bool:
        """Return whether every parameter lies in its range."""
        return all(q.low <= values[q.name] <= q.high for q in self.parameters)

    def reported(self, values: Values) -> dict[str, float | tuple[float, ...]]:
        """The parameters of a finding, named as in causes.md; whole numbers are integers."""
        return {q.name: int(values[q.name]) if q.discrete else values[q.name] for q in self.parameters}

    def passed(self, amplitude: float, x: Array, t: Array, start: Array | float | None = None, since: int = 0) -> Array:
        """Return any torque `x` (…, samples) of its joint as it is recorded, of an effect that acts on the record.

        Args:
            start: the output up to sample `since`; None: as if `x` had been constant before.
        """
        return x

    @classmethod
    def everywhere(cls, revolute: Sequence[bool]) -> tuple[Self, ...]:
        """One at every joint that can have it, of joints that turn (`revolute`) or slide; or the one of the whole arm."""
        return tuple(cls(joint=k) for k in cls.joints(revolute)) if cls.scope == "joint" else (cls(),)

    @classmethod
    def joints(cls, revolute: Sequence[bool]) -> tuple[int, ...]:
        """Those that can have it, 1-based."""
        return tuple(range(1, len(revolute) + 1))

    @property
    def adds(self) -> bool:
        """Return whether all it does is to add its columns to the torque, so that nothing else has to be worked out with it."""
        return type(self).apply is Effect.apply and type(self).torque is Effect.torque

    def at(self, values: Values) -> Self:
        """Itself with the non-linear numbers out of `values`."""
        known = self.complete(values)
        shape: dict[str, Any] = {q.name: known[q.name] for q in self.parameters if q.shape}
        return replace(self, **shape)

    def complete(self, values: Values) -> dict[str, float]:
        """`values`, and what holds of a number that they do not say, where the law was known before the number was."""
        return {q.name: q.unsaid for q in self.parameters if q.unsaid is not None} | dict(values)

    def amplitudes(self, values: Values) -> Array:
        """The amplitudes that belong to `values`, in the order of the columns."""
        return np.array([values[q.name] for q in self.parameters if not q.shape])

    def values(self, amplitudes: Sequence[float] | Array) -> dict[str, float]:
        """Every parameter by name; the inverse of `at` and `amplitudes`."""
        linear = iter(amplitudes)
        return {q.name: float(getattr(self, q.name) if q.shape else next(linear)) for q in self.parameters}

    def torque(self, motion: Motion, arm: ArmModel, values: Values) -> Array:
        """Its torque (samples, joints) [N m]."""
        return summed(self.at(values).columns(motion, arm), self.amplitudes(values))

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

    def mixing(self, values: Values, n_joints: int) -> Array | None:
        """(joints, joints) M, where `apply` gives M times the torque of the moment without it, whatever the motion."""
        return None

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """How it enters the forward simulation; by default as a load."""
        shaped, amplitudes = self.at(values), self.amplitudes(values)
        return Hooks(load=lambda motion, _: summed(shaped.columns(motion, arm), amplitudes))
