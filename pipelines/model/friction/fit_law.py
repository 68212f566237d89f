"""Fit one friction law, the joint's inertia and its gravity to the windows of one or several logs.

Logs in which the other joints stand elsewhere have an inertia and a gravity of their own; friction is the same in all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from pipelines.fit.varpro import Separable, SeparableFit, fit_separable, linear_part, search
from pipelines.model.friction.laws import Law, law_named
from pipelines.model.friction.one_joint import OneJoint, gravity_names
from pipelines.model.friction.weak_form import Stretch, Windows
from pipelines.model.rigid.body import Array, Motion

__all__ = ["Equations", "LawEquations", "LawFit", "Number", "Predicted", "alike", "fit_law", "posture_groups", "takes_power"]

_SEEN = 0.9  # share of a number that must lie in directions which the rows show
_ALIKE = 0.02  # [rad] by which locked joints may stand apart and the inertia still be the same
_SCANNED = 120  # rows that a scan for starts looks at
_STARTS = 2
_OTHERS = 8
_CARRIED = 3  # rounds in which a law that depends on the load sees the load of the fit before


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
        """Whether the logs tell it from the others; else its value is one of many that give the same curve."""
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


@dataclass(frozen=True, eq=False)
class Predicted:
    """What a fit says of rows, and what they measured. (rows,) [N m]"""

    measured: Array
    model: Array

    @property
    def residual(self) -> Array:
        return self.measured - self.model


class Equations(Protocol):
    """Rows of one joint that a law can be fitted to: those of a joint driven alone, or its rows among all joints'."""

    @property
    def y(self) -> Array: ...

    @property
    def width(self) -> int: ...

    @property
    def postures(self) -> tuple[tuple[float, ...], ...]: ...

    @property
    def nodes(self) -> Motion: ...

    def arms(self, beta: Array | None = None) -> tuple[OneJoint, ...]: ...

    def build(self, law: Law, arms: Sequence[OneJoint], theta: Array) -> Array: ...

    def problem(self, law: Law, arms: Sequence[OneJoint]) -> Separable: ...

    def thinned(self, rows: int) -> Equations: ...

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

    def build(self, law: Law, arms: Sequence[OneJoint], theta: Array) -> Array:
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
        return Separable(self.y, self.fixed, lambda theta: self.build(law, arms, theta), lower, upper)

    def predicted(self, fit: LawFit) -> Predicted:
        """What `fit`, of these postures or of others, says of these rows; one it does not know takes the nearest's numbers."""
        rigid = fit.found.beta[:fit.rigid_size * len(fit.postures)].reshape(-1, fit.rigid_size)
        own = np.concatenate([rigid[nearest(posture, fit.postures)] for posture in self.postures])
        law = self.build(fit.law, self.arms(own), fit.theta) @ fit.amplitudes
        return Predicted(self.y, self.fixed @ own + law)


def posture_groups(stretches: Sequence[Stretch]) -> tuple[tuple[float, ...], ...]:
    """Postures of the locked joints that are apart."""
    found: list[tuple[float, ...]] = []
    for stretch in stretches:
        if not any(alike(stretch.posture, posture) for posture in found):
            found.append(stretch.posture)
    return tuple(found)


def nearest(posture: tuple[float, ...], known: Sequence[tuple[float, ...]]) -> int:
    return min(range(len(known)), key=lambda k: _apart(posture, known[k]))


def alike(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    """Whether inertia and gravity may be taken as the same."""
    return _apart(a, b) < _ALIKE


def _apart(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    return max((abs(x - y) for x, y in zip(a, b, strict=True)), default=0.0)


def fit_law(equations: Equations, law: Law, starts: Sequence[Array] | None = None, sharpness: float | None = None) -> LawFit:
    """Fit `law` from the best of `starts`, which are otherwise the grids of its effects.

    A law that depends on the load sees that of the fit before, round by round.
    """
    arms = equations.arms()
    if law.sees_load:
        arms = equations.arms(fit_law(equations, law_named("coulomb+viscous") or law, None, sharpness).found.beta)
    if starts is None:
        starts = list(law.starts(equations.nodes, arms[0], sharpness))
    begin = list(starts) if len(starts) == 1 else _best_of(equations, law, arms, starts)
    for _ in range(_CARRIED if law.sees_load else 1):
        found = fit_separable(equations.problem(law, arms), begin)
        if not takes_power(equations, law, arms[0], found):
            found = _other(equations, law, arms, starts, found)
        if not np.array_equal(named := law.canonical(found.theta), found.theta):
            found = fit_separable(equations.problem(law, arms), [named])
        begin, arms = [found.theta], equations.arms(found.beta)
    return LawFit(law, arms[0], equations.postures, found, equations.width)


def takes_power(equations: Equations, law: Law, arm: OneJoint, found: SeparableFit) -> bool:
    """Whether friction is against the motion at every speed up to the fastest; of a curve that is not odd nothing is asked.

    Two sigmoids nearly alike, one up and one down, fit the speeds there are and may do anything between them and zero.
    """
    speed = float(np.abs(equations.nodes.dq).max()) * np.geomspace(1e-6, 1.0, 200)
    forth, back = (law.curve(side * speed, arm, found.theta, found.beta[-law.amplitudes:]) for side in (1.0, -1.0))
    odd = bool(np.allclose(forth, -back, rtol=1e-9, atol=1e-12))
    return not odd or bool(np.all(forth >= -1e-9 * np.abs(forth).max()))


def _other(equations: Equations, law: Law, arms: Sequence[OneJoint], starts: Sequence[Array], found: SeparableFit) -> SeparableFit:
    """The best of other local optima whose curve takes power; `found` where there is none."""
    problem, scan = equations.problem(law, arms), equations.thinned(_SCANNED).problem(law, arms)
    grid = [np.clip(theta, problem.lower, problem.upper) for theta in (
        starts if len(starts) > 1 else law.starts(equations.nodes, arms[0]))]
    ranked = sorted(grid, key=lambda theta: linear_part(scan.columns(theta), scan.y).rss)[:_OTHERS]
    ends = sorted((search(problem, theta) for theta in ranked), key=lambda end: end[1].rss)
    for theta, _ in ends:
        one = fit_separable(problem, [theta])
        if takes_power(equations, law, arms[0], one):
            return one
    return found


def _best_of(equations: Equations, law: Law, arms: Sequence[OneJoint], starts: Sequence[Array]) -> list[Array]:
    """The best few of many starts by some of the rows, then the best end of a search among those."""
    problem = equations.thinned(_SCANNED).problem(law, arms)
    grid = [np.clip(theta, problem.lower, problem.upper) for theta in starts]
    if len(grid) > _STARTS:
        grid = sorted(grid, key=lambda theta: linear_part(problem.columns(theta), problem.y).rss)[:_STARTS]
    ends = sorted((search(problem, theta) for theta in grid), key=lambda end: end[1].rss)
    return [theta for theta, _ in ends[:1]]
