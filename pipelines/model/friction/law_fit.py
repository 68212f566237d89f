"""A fitted friction law: its numbers in their own terms, and its curve, each with its standard deviation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipelines.fit.varpro import SeparableFit
from pipelines.model.friction.laws import Law
from pipelines.model.friction.one_joint import OneJoint, gravity_names
from pipelines.model.friction.postures import nearest
from pipelines.model.friction.weak_form import Stretch
from pipelines.model.rigid.body import Array

__all__ = ["LawFit", "Number"]

_SEEN = 0.9  # share of a number that must lie in directions which the rows show


@dataclass(frozen=True)
class Number:
    """One parameter of a law."""

    name: str  # "stribeck.amplitude"
    value: float
    std: float
    unit: str
    low: float  # what it cannot be below
    seen: float  # 1 where the logs show it, 0 where they say nothing

    @property
    def known(self) -> bool:
        """Return whether the logs tell it from the others; else its value is one of many that give the same curve."""
        return self.seen >= _SEEN


@dataclass(frozen=True, eq=False)
class LawFit:
    """A law with its numbers and their covariance.

    Order of `beta`: J, c, c' and those of the sway, posture by posture, then the law's amplitudes.
    """

    law: Law
    joint: OneJoint  # with the inertia and gravity of the first posture
    postures: tuple[tuple[float, ...], ...]
    found: SeparableFit
    rigid_size: int  # numbers of one posture

    @property
    def theta(self) -> Array:
        return self.found.theta

    @property
    def amplitudes(self) -> Array:
        return self.found.beta[self.rigid_size * len(self.postures):]

    @property
    def inertia(self) -> float:
        return float(self.found.beta[0])

    @property
    def gravity(self) -> tuple[float, ...]:
        return tuple(map(float, self.found.beta[1:1 + len(gravity_names(self.joint.revolute))]))

    def at(self, stretch: Stretch) -> tuple[OneJoint, Array]:
        """The joint as it is in the posture of `stretch`, and what multiplies the sway of the joints beside it (columns,)."""
        rigid = self.found.beta[:self.rigid_size * len(self.postures)].reshape(-1, self.rigid_size)
        own = rigid[nearest(stretch.posture, self.postures)]
        last = 1 + len(gravity_names(self.joint.revolute))
        return self.joint.carrying(float(own[0]), tuple(map(float, own[1:last]))), own[last:]

    @cached_property
    def std(self) -> Array:
        """Of J, c, c' and those of the sway, posture by posture, the amplitudes, and θ."""
        return np.sqrt(np.maximum(np.diag(self.found.covariance), 0.0))

    @cached_property
    def numbers(self) -> tuple[Number, ...]:
        """Every number of the law's effects, in their own terms, with standard deviations by first order."""
        first, count = self.rigid_size * len(self.postures), len(self.amplitudes)
        spread = self.found.covariance[first:, first:]
        names, here = self.law.named(self.theta, self.amplitudes)
        slopes = np.empty((len(here), count + len(self.theta)))
        for i in range(slopes.shape[1]):
            ends = [self.law.named(*self._moved(i, side))[1] for side in (-1.0, 1.0)]
            slopes[:, i] = (ends[1] - ends[0]) / (2.0 * self._step(i))
        std = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", slopes, spread, slopes), 0.0))
        touched = np.abs(slopes) > 1e-9 * np.abs(slopes).max(axis=1, keepdims=True)
        seen = [float(self.found.seen[first:][row].min(initial=1.0)) for row in touched]
        return tuple(Number(f"{effect.name}.{q.name}", float(value), float(sigma), q.unit_at(self.joint.revolute), q.low, share)
                     for (effect, q), value, sigma, share in zip(names, here, std, seen, strict=True))

    def _step(self, i: int) -> float:
        return 1e-4 * max(float(np.abs(self.amplitudes).max()), 1e-12) if i < len(self.amplitudes) else 1e-4

    def _moved(self, i: int, side: float) -> tuple[Array, Array]:
        """θ and amplitudes with the i-th of amplitudes and θ moved by a step."""
        both = np.concatenate([self.amplitudes, self.theta])
        both[i] += side * self._step(i)
        return both[len(self.amplitudes):], both[:len(self.amplitudes)]

    def curve(self, speed: Array) -> Array:
        """Friction torque (samples,) [N m]."""
        return self.law.curve(speed, self.joint, self.theta, self.amplitudes)

    def curve_std(self, speed: Array) -> Array:
        """Its standard deviation, by the first order of the covariance."""
        first = self.rigid_size * len(self.postures)
        slopes = np.stack([self._slope(speed, i) for i in range(len(self.amplitudes) + len(self.theta))], axis=1)
        spread = self.found.covariance[first:, first:]
        return np.asarray(np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", slopes, spread, slopes), 0.0)))

    def _slope(self, speed: Array, i: int) -> Array:
        ends = [self.law.curve(speed, self.joint, *self._moved(i, side)) for side in (-1.0, 1.0)]
        return np.asarray((ends[1] - ends[0]) / (2.0 * self._step(i)))
