"""The contract of an effect: a physical cause is data plus one function.

An effect is written by giving its words, its parameters and `columns`; the rest has a default.

    Coulomb friction     columns = tanh(w v) on its own row; nothing else
    Cogging              columns = sin kq, cos kq; `shapes` runs over k; `values` gives amplitude, phase
    A clipped drive      columns to screen with; `apply` = clip(predict(motion, arm))
    An encoder fault     columns to screen with; `apply` = predict(corrected motion, arm)
    Tilted gravity       columns to screen with; `apply` = predict(motion, arm.with_body(tilted body, p))

An object is the effect in one place and one shape: `joint` and the *non-linear* parameters (speeds,
orders, delays) are its fields. The *linear* parameters, its amplitudes, are not: a fit solves for them.

    torque = columns(motion, arm) @ amplitudes      to first order; exactly for most

Torque is a load: measured torque = torque of the model + torques of the effects. Columns are computed
from the motion and the *predicted* torque, never from measured torque, whose noise would bias them. One
exception: the torque that a drive keeps back above its limit follows from the commanded torque alone,
which is `Motion.tau`. Columns need not be independent, nor all visible, on every arm: solve with a rank
threshold. Each motion is one log from its first sample (time in a log counts from motion.t[0]).

    terms.py     Quantity: what a parameter may be; Numbered: values by name and amplitudes; the hooks
    placed.py    the row of its own joint
    kinds.py     what friction laws and events have besides
    fast.py      speed-ups, which change no answer
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, ClassVar, Literal, Self, TypeVar

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.model.effects.placed import Placed
from pipelines.model.effects.terms import (
    LARGE,
    SAMPLED,
    SHARPNESSES,
    ArmModel,
    Hooks,
    OwnDrive,
    OwnLoad,
    OwnMemory,
    Parameters,
    Predict,
    Quantity,
    SpeedCurve,
    Values,
    Words,
    friction_at,
    predicted,
    summed,
    waves,
)

__all__ = ["LARGE", "SAMPLED", "SHARPNESSES", "ArmModel", "Effect", "Hooks", "OwnDrive", "OwnLoad", "OwnMemory",
           "Parameters", "Predict", "Quantity", "SpeedCurve", "Values", "Words", "adds", "everywhere",
           "friction_at", "joints_of", "predicted", "waves"]

E = TypeVar("E", bound="Effect")


@dataclass(frozen=True)
class Effect(Placed, ABC):
    """A physical cause at one joint, or of the whole arm."""

    joint: int | None = None  # 1-based; None where scope is "arm"

    name: ClassVar[str]  # identifier of causes.md, and the file's name
    words: ClassVar[Words]
    scope: ClassVar[Literal["joint", "arm"]] = "joint"
    parameters: ClassVar[Parameters]
    acts_on: ClassVar[Literal["load", "encoder", "drive", "record"]] = "load"  # the order in which
    # effects compose; the record, outermost, is a first-order low-pass, its amplitude the time constant [s]
    clock: ClassVar[Literal["none", "session", "log"]] = "none"  # "session": its field `since` [s] is
    # when the session began; "log": it happens once, and its shapes belong to that log
    evidence: ClassVar[Literal["residual", "frequency responses", "reversals", "base parameters",
                               "none"]] = "residual"  # what a diagnosis may name it by; "none": a
    # law that a nominal model has, and no cause

    def __post_init__(self) -> None:
        if (self.scope == "joint") != (self.joint is not None and self.joint >= 1):
            where = "one joint, counted from 1" if self.scope == "joint" else "the whole arm"
            raise ValueError(f"{self.name} belongs to {where}, not to joint {self.joint}")
        for q in self.parameters:  # another joint: the one before, if none is given
            if q.joint and self.joint is not None and not getattr(self, q.name):
                object.__setattr__(self, q.name, float(self.joint - 1 or 2))

    @abstractmethod
    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        """Return the torque per unit of each amplitude, to first order: (samples, joints, amplitudes)."""

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """Return the effect in every shape worth trying on this motion: on the grids of its parameters."""
        places = {q.name: q.grid or q.among(self.joint, arm.n_joints) for q in self.parameters}
        grids = {name: values for name, values in places.items() if values is not None}
        for numbers in product(*grids.values()):
            shape: dict[str, Any] = dict(zip(grids, map(float, numbers), strict=True))
            yield replace(self, **shape)

    def forms(self) -> tuple[Self, ...]:
        """Return the form that a finding is refitted with, then other laws of the same cause."""
        return (self,)

    def nuisance(self, arm: ArmModel) -> Array | None:
        """Return directions (base parameters, k) in which it moves them beyond its columns, unknown how far."""
        return None

    def apply(self, motion: Motion, arm: ArmModel, values: Values, predict: Predict | None = None) -> Array:
        """Return the torque (samples, joints) that a log of `motion` shows on an arm with this effect, exactly.

        `predict` says what it would show without; effects are thus put one around the other. To warp a
        signal, hand another motion to `predict`; to change geometry or gravity, another arm; to clip,
        treat what it returns.
        """
        without = predict(motion, arm) if predict is not None else arm.torque(motion)
        return np.asarray(without + self.torque(motion, arm, values))

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        """Return how it enters the forward simulation; by default as a load."""
        shaped, amplitudes = self.at(values), self.amplitudes(values)
        return Hooks(load=lambda motion, _: summed(shaped.columns(motion, arm), amplitudes))


def adds(effect: Effect) -> bool:
    """Return whether it only adds its columns to the torque, whatever else acts."""
    return type(effect).apply is Effect.apply and type(effect).torque is Effect.torque


def joints_of(kind: type[Effect] | Effect, revolute: Sequence[bool]) -> tuple[int, ...]:
    """Return the joints (1-based) that can have it, of joints that turn (`revolute`) or slide."""
    turning = any(q.revolute for q in kind.parameters)
    return tuple(k for k, turns in enumerate(revolute, 1) if turns or not turning)


def everywhere(kind: type[E], revolute: Sequence[bool]) -> tuple[E, ...]:
    """Return one at every joint where it is looked for; or the one of the whole arm."""
    places = joints_of(kind, revolute) if kind.scope == "joint" else (None,)
    n = len(revolute)
    return tuple(kind(joint=k) for k in places if all(q.found_at(k, n) for q in kind.parameters))
