"""Rows that a friction law can be fitted to, and those of a joint that was driven alone.

Logs in which the other joints stand elsewhere have an inertia and a gravity of their own; friction is the same in all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from pipelines.fit.varpro import Separable
from pipelines.model.friction.law_fit import LawFit
from pipelines.model.friction.laws import Law
from pipelines.model.friction.one_joint import OneJoint, gravity_names
from pipelines.model.friction.postures import nearest, posture_groups
from pipelines.model.friction.weak_form import Stretch, Windows
from pipelines.model.rigid.body import Array, Motion

__all__ = ["Columned", "Equations", "LawEquations", "Predicted"]


@dataclass(frozen=True, eq=False)
class Predicted:
    """What a fit says of rows, and what they measured. (rows,) [N m]"""

    measured: Array
    model: Array

    @property
    def residual(self) -> Array:
        return self.measured - self.model


class Columned(Protocol):
    """What rows are built of: a law, or another torque along the motion of the joint."""

    @property
    def pointwise(self) -> bool: ...

    def columns(self, motion: Motion, arm: OneJoint, theta: Array) -> Array: ...


class Equations(Protocol):
    """Rows of one joint that a law can be fitted to: those of a joint driven alone, or its rows among all joints'."""

    @property
    def y(self) -> Array: ...

    @property
    def largest(self) -> float: ...

    @property
    def width(self) -> int: ...

    @property
    def postures(self) -> tuple[tuple[float, ...], ...]: ...

    @property
    def nodes(self) -> Motion: ...

    def arms(self, beta: Array | None = None) -> tuple[OneJoint, ...]: ...

    @property
    def fixed(self) -> Array: ...

    def build(self, law: Columned, arms: Sequence[OneJoint], theta: Array) -> Array: ...

    def problem(self, law: Law, arms: Sequence[OneJoint]) -> Separable: ...

    def thinned(self, rows: int) -> Equations: ...

    @property
    def rows(self) -> npt.NDArray[np.intp]: ...

    def predicted(self, fit: LawFit) -> Predicted: ...


@dataclass(frozen=True, eq=False)
class LawEquations:
    """Stretches of one joint, posture by posture."""

    stretches: tuple[Stretch, ...]
    joint: OneJoint
    postures: tuple[tuple[float, ...], ...]
    every: int = 1  # so-manieth row only: for a scan

    @classmethod
    def of(cls, stretches: Sequence[Stretch], joint: OneJoint) -> LawEquations:
        return cls(tuple(stretches), joint, posture_groups(stretches))

    @cached_property
    def y(self) -> Array:
        return np.concatenate([stretch.torque[::self.every] for stretch in self.stretches])

    @property
    def largest(self) -> float:
        """Largest mean torque of a window, rests and reversals included [N m]."""
        return max(float(np.abs(np.diff(stretch.impulse[stretch.edges]) / stretch.length).max()) for stretch in self.stretches)

    @cached_property
    def width(self) -> int:
        """Numbers of one posture: J, c, c', and what multiplies the sway of joints that are held."""
        return int(self.stretches[0].rigid.shape[1])

    @cached_property
    def fixed(self) -> Array:
        """(rows, postures × width)"""
        parts = []
        for stretch, k in zip(self.stretches, self.groups, strict=True):
            part = np.zeros((len(stretch.torque[::self.every]), self.width * len(self.postures)))
            part[:, self.width * k:self.width * (k + 1)] = stretch.rigid[::self.every]
            parts.append(part)
        return np.vstack(parts)

    @property
    def nodes(self) -> Motion:
        """Motion of the longest stretch: where searches for shapes look for speeds and travel."""
        return max(self.stretches, key=lambda stretch: len(stretch.t)).nodes

    def thinned(self, rows: int) -> LawEquations:
        """About so many rows, for a scan."""
        return replace(self, every=max(1, len(self.y) // rows))

    @property
    def rows(self) -> npt.NDArray[np.intp]:
        """Which of all rows of the stretches these are."""
        count = [len(stretch.torque) for stretch in self.stretches]
        first = np.cumsum([0, *count[:-1]])
        return np.concatenate([np.arange(k, k + n, self.every) for k, n in zip(first, count, strict=True)])

    @cached_property
    def groups(self) -> tuple[int, ...]:
        """Posture of every stretch."""
        return tuple(nearest(stretch.posture, self.postures) for stretch in self.stretches)

    def arms(self, beta: Array | None = None) -> tuple[OneJoint, ...]:
        """The joint in every posture, with the inertia and gravity that `beta` gives it."""
        if beta is None:
            return (self.joint,) * len(self.postures)
        parts = beta[:self.width * len(self.postures)].reshape(-1, self.width)
        gravity = len(gravity_names(self.joint.revolute))
        return tuple(self.joint.carrying(float(part[0]), tuple(map(float, part[1:1 + gravity]))) for part in parts)

    def build(self, law: Columned, arms: Sequence[OneJoint], theta: Array) -> Array:
        """The law's columns (rows, amplitudes)."""
        parts = []
        for stretch, few, k in zip(self.stretches, self.few, self.groups, strict=True):
            if law.pointwise:
                parts.append(few.means(law.columns(few.nodes, arms[k], theta)))
            else:
                parts.append(stretch.windows.means(law.columns(stretch.nodes, arms[k], theta))[::self.every])
        return np.vstack(parts) if len(parts) > 1 else parts[0]

    @cached_property
    def few(self) -> tuple[Windows, ...]:
        return tuple(stretch.windows if self.every == 1 else stretch.windows.some(self.every) for stretch in self.stretches)

    def problem(self, law: Law, arms: Sequence[OneJoint]) -> Separable:
        lower, upper = law.bounds
        slopes = (lambda theta, own: self.slopes(law, theta, own)) if law.pointwise and law.sloped else None
        return Separable(self.y, self.fixed, lambda theta: self.build(law, arms, theta), lower, upper, slopes)

    def slopes(self, law: Law, theta: Array, amplitudes: Array) -> Array:
        """Of the law's mean torque in every row by θ: (rows, numbers of θ). Of laws that are `pointwise` and `sloped`."""
        parts = []
        for few in self.few:
            bend = law.slopes(few.nodes, theta, amplitudes)
            assert bend is not None
            parts.append(few.means(bend))
        return np.vstack(parts)

    def predicted(self, fit: LawFit) -> Predicted:
        """What `fit`, of these postures or of others, says of these rows; one it does not know takes the nearest's numbers."""
        rigid = fit.found.beta[:fit.rigid_size * len(fit.postures)].reshape(-1, fit.rigid_size)
        own = np.concatenate([rigid[nearest(posture, fit.postures)] for posture in self.postures])
        law = self.build(fit.law, self.arms(own), fit.theta) @ fit.amplitudes
        return Predicted(self.y, self.fixed @ own + law)
