"""Fit one friction law, the joint's inertia and its gravity to rows of mean torque.

Logs in which the other joints stand elsewhere have an inertia and a gravity of their own; friction
is the same in all. Logs whose locked joints differ by less than encoders and controllers make of
one posture are taken together.

The law's numbers in θ are searched for, the others follow by least squares (variable projection:
Golub & Pereyra 1973). A scan over the grids of the law's effects finds where to begin.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Array, Motion
from pipelines.estimation.varpro import Separable, SeparableFit, fit_separable, scan, search
from pipelines.friction.config import FitConfig
from pipelines.friction.laws import Law, OneJoint, law_named
from pipelines.friction.weak_form import Stretch, Windows

__all__ = ["Columns", "Equations", "LawEquations", "LawFit", "Number", "Value", "fit_law",
           "ranked", "same_posture", "takes_power"]

Columns = Callable[[Motion, OneJoint], Array]  # (nodes, k) of a motion


_CONFIG = FitConfig()


def _distance(a: Sequence[float], b: Sequence[float]) -> float:
    return max((abs(x - y) for x, y in zip(a, b, strict=True)), default=0.0)


def same_posture(a: Sequence[float], b: Sequence[float]) -> bool:
    """Return whether inertia and gravity may be taken as the same."""
    return _distance(a, b) < _CONFIG.alike


def _nearest(posture: Sequence[float], known: Sequence[Sequence[float]]) -> int:
    return min(range(len(known)), key=lambda k: _distance(posture, known[k]))


@dataclass(frozen=True)
class Value:
    """A number with its uncertainty."""

    value: float
    std: float | None
    unit: str


@dataclass(frozen=True)
class Number:
    """One parameter of a law."""

    name: str  # "stribeck.amplitude"
    value: float
    std: float
    unit: str
    low: float  # what it cannot be below
    seen: float  # 1 where the logs show it, 0 where they do not

    @property
    def known(self) -> bool:
        """Return whether the logs show it apart from the others; else many values fit alike."""
        return self.seen >= _CONFIG.seen


@dataclass(frozen=True, eq=False)
class LawFit:
    """A law with its numbers and their covariance.

    Order of `found.beta`: J, c, c' and those of the sway, posture by posture, then the amplitudes.
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
    def _first(self) -> int:
        """Return where the amplitudes begin in `found.beta`."""
        return self.rigid_size * len(self.postures)

    @property
    def amplitudes(self) -> Array:
        return self.found.beta[self._first:]

    @property
    def rigid(self) -> Array:
        """Return J, c, c' and those of the sway (postures, numbers)."""
        return self.found.beta[:self._first].reshape(-1, self.rigid_size)

    @property
    def inertia(self) -> float:
        return float(self.found.beta[0])

    @property
    def gravity(self) -> tuple[float, ...]:
        return self.joint.carrying(self.found.beta).gravity

    def posture_of(self, stretch: Stretch) -> int:
        return _nearest(stretch.posture, self.postures)

    def at(self, stretch: Stretch) -> tuple[OneJoint, Array]:
        """Return the joint in the posture of `stretch`, and the factors of its sway (columns,)."""
        own = self.rigid[self.posture_of(stretch)]
        return self.joint.carrying(own), own[1 + len(self.joint.gravity):]

    @cached_property
    def std(self) -> Array:
        """Return the standard deviations of `found.beta` and θ."""
        return np.sqrt(np.maximum(np.diag(self.found.covariance), 0.0))

    @cached_property
    def numbers(self) -> tuple[Number, ...]:
        """Return the numbers of the law's effects with standard deviations by first order."""
        slopes = self._slopes(lambda *at: np.array(list(self.law.numbers(*at).values())))
        touched = np.abs(slopes) > 1e-9 * np.abs(slopes).max(axis=1, keepdims=True)
        seen = [float(self.found.seen[self._first:][row].min(initial=1.0)) for row in touched]
        values = self.law.numbers(self.theta, self.amplitudes)
        return tuple(Number(f"{effect.name}.{q.name}", value, float(std),
                            q.unit_at(self.joint.revolute), q.low, share)
                     for ((effect, q), value), std, share
                     in zip(values.items(), self._std(slopes), seen, strict=True))

    def curve(self, speed: Array) -> Array:
        """Return the friction torque (samples,) [N m]."""
        return self.law.curve(speed, self.joint, self.theta, self.amplitudes)

    def curve_std(self, speed: Array) -> Array:
        """Return the standard deviation of `curve` by first order."""
        return self._std(self._slopes(lambda *at: self.law.curve(speed, self.joint, *at)))

    def _slopes(self, of: Callable[[Array, Array], Array]) -> Array:
        """Return ∂`of` by amplitudes and θ (values, numbers): central differences."""
        count, both = len(self.amplitudes), np.concatenate([self.amplitudes, self.theta])
        slopes = []
        for i in range(len(both)):
            step = 1e-4
            if i < count:
                step *= max(float(np.abs(self.amplitudes).max()), 1e-12)
            ends = []
            for side in (-step, step):
                there = both.copy()
                there[i] += side
                ends.append(of(there[count:], there[:count]))
            slopes.append((ends[1] - ends[0]) / (2.0 * step))
        return np.stack(slopes, axis=1)

    def _std(self, slopes: Array) -> Array:
        """Return the deviations (values,) of values with `slopes` by amplitudes and θ."""
        spread = self.found.covariance[self._first:, self._first:]
        square = np.einsum("ni,ij,nj->n", slopes, spread, slopes)
        return np.asarray(np.sqrt(np.maximum(square, 0.0)))


@dataclass(frozen=True, eq=False, kw_only=True)
class Equations(ABC):
    """Rows of one joint that a law can be fitted to."""

    y: Array  # (rows,) torque [N m]
    fixed: Array  # (rows, postures × numbers of one) columns that are no friction
    parts: tuple[npt.NDArray[np.intp], ...]  # all rows, by what is thinned on its own
    nodes: Motion  # (nodes, 1) in which searches look for speeds and travel
    largest: float  # [N m] torque on the joint, rests and reversals included
    joint: OneJoint
    postures: tuple[tuple[float, ...], ...] = ((),)
    every: int = 1  # the rows are every `every`-th one of a part

    @property
    def rows(self) -> npt.NDArray[np.intp]:
        """Return which of all rows these are."""
        return np.concatenate([part[::self.every] for part in self.parts])

    def thinned(self, rows: int) -> Self:
        """Return about `rows` of all rows, for a scan."""
        few = replace(self, every=max(1, len(self.y) // rows))
        return replace(few, y=self.y[few.rows], fixed=self.fixed[few.rows])

    @property
    def width(self) -> int:
        """Return how many numbers of one posture are no friction."""
        return int(self.fixed.shape[1]) // len(self.postures)

    @abstractmethod
    def arms(self, beta: Array | None = None) -> tuple[OneJoint, ...]:
        """Return the joint in every posture, with the inertia and gravity that `beta` gives it."""

    @abstractmethod
    def means(self, columns: Columns, arms: Sequence[OneJoint], pointwise: bool = True) -> Array:
        """Return the rows (rows, k) of columns of the motion; `pointwise` ones have no memory."""

    def slopes(self, law: Law) -> Callable[[Array, Array], Array] | None:
        """Return the slopes of the law's rows by θ; None: by differences."""
        return None

    def law_columns(self, law: Law, arms: Sequence[OneJoint], theta: Array) -> Array:
        """Return the law's columns (rows, amplitudes)."""
        return self.means(lambda motion, arm: law.columns(motion, arm, theta), arms, law.pointwise)

    def problem(self, law: Law, arms: Sequence[OneJoint]) -> Separable:
        return Separable(self.y, self.fixed, lambda theta: self.law_columns(law, arms, theta),
                         *law.bounds, self.slopes(law))

    def residual(self, fit: LawFit) -> Array:
        """Return the residual of `fit` (rows,) [N m]; an unknown posture takes the nearest."""
        own = fit.rigid[[_nearest(posture, fit.postures) for posture in self.postures]].ravel()
        law = self.law_columns(fit.law, self.arms(own), fit.theta) @ fit.amplitudes
        return np.asarray(self.y - (self.fixed @ own + law))


@dataclass(frozen=True, eq=False, kw_only=True)
class LawEquations(Equations):
    """Windows of stretches of a joint that was driven alone."""

    stretches: tuple[Stretch, ...]
    groups: tuple[int, ...]  # posture of every stretch

    @classmethod
    def of(cls, stretches: Sequence[Stretch], joint: OneJoint) -> LawEquations:
        postures: list[tuple[float, ...]] = []
        for stretch in stretches:
            if not any(same_posture(stretch.posture, known) for known in postures):
                postures.append(stretch.posture)
        groups = tuple(_nearest(stretch.posture, postures) for stretch in stretches)
        ends = np.cumsum([stretch.rows for stretch in stretches])
        width = stretches[0].rigid.shape[1]
        parts = tuple(np.split(np.arange(ends[-1]), ends[:-1]))
        fixed = np.zeros((ends[-1], width * len(postures)))
        for stretch, rows, k in zip(stretches, parts, groups, strict=True):
            fixed[rows, width * k:width * (k + 1)] = stretch.rigid
        means = (np.diff(one.impulse[one.edges]) / one.length for one in stretches)
        return cls(y=np.concatenate([stretch.torque for stretch in stretches]),
                   fixed=fixed, parts=parts,
                   nodes=max(stretches, key=lambda stretch: len(stretch.t)).nodes,
                   largest=max(float(np.abs(mean).max()) for mean in means), joint=joint,
                   postures=tuple(postures), stretches=tuple(stretches), groups=groups)

    @cached_property
    def _few(self) -> tuple[Windows, ...]:
        return tuple(stretch.windows.thinned(self.every) for stretch in self.stretches)

    def arms(self, beta: Array | None = None) -> tuple[OneJoint, ...]:
        if beta is None:
            return (self.joint,) * len(self.postures)
        rigid = beta[:self.fixed.shape[1]].reshape(len(self.postures), -1)
        return tuple(self.joint.carrying(part) for part in rigid)

    def means(self, columns: Columns, arms: Sequence[OneJoint], pointwise: bool = True) -> Array:
        parts = []
        for stretch, few, k in zip(self.stretches, self._few, self.groups, strict=True):
            if pointwise:
                parts.append(few.means(columns(few.nodes, arms[k])))
            else:
                whole = stretch.windows.means(columns(stretch.nodes, arms[k]))
                parts.append(whole[::self.every])
        return np.vstack(parts) if len(parts) > 1 else parts[0]

    def slopes(self, law: Law) -> Callable[[Array, Array], Array] | None:
        if not (law.pointwise and law.sloped):
            return None
        return lambda theta, amplitudes: np.vstack([
            few.means(np.asarray(law.slopes(few.nodes, theta, amplitudes))) for few in self._few])


def fit_law(equations: Equations, law: Law, starts: Sequence[Array] | None = None,
            sharpness: float | None = None) -> LawFit:
    """Fit `law` from the best of `starts`, which are otherwise the grids of its effects.

    A law that depends on the load sees that of the fit before, round by round.

    Args:
        starts: θ.
        sharpness: of the sign of friction [s/rad], where it is known.
    """
    arms = equations.arms()
    if law.sees_load:
        before = fit_law(equations, law_named("coulomb+viscous"), None, sharpness)
        arms = equations.arms(before.found.beta)
    if starts is None:
        starts = list(law.starts(equations.nodes, arms[0], sharpness))
    begin = starts[0] if len(starts) == 1 else _best_of(equations, law, arms, starts)
    for _ in range(_CONFIG.carried if law.sees_load else 1):
        found = fit_separable(equations.problem(law, arms), [begin])
        if not takes_power(equations, law, arms[0], found):
            found = _taking_power(equations, law, arms, starts, found)
        named = law.canonical(found.theta)
        if np.abs(named - found.theta).max(initial=0.0) > _CONFIG.rounded:
            found = fit_separable(equations.problem(law, arms), [named])
        begin, arms = found.theta, equations.arms(found.beta)
    return LawFit(law, arms[0], equations.postures, found, equations.width)


def takes_power(equations: Equations, law: Law, arm: OneJoint, found: SeparableFit) -> bool:
    """Return whether friction opposes the motion at every speed up to the fastest.

    Two sigmoids nearly alike, one up and one down, fit the speeds there are and may do anything
    between them and zero. A joint that runs came through every lower speed: friction there was no
    more than the largest torque on it, or than that of the fastest rows, which may have been driven
    when friction had drifted. Of a curve that is not odd only this is required.
    """
    speed = float(np.abs(equations.nodes.dq).max()) * np.geomspace(1e-6, 1.0, 200)
    both = law.curve(np.concatenate([speed, -speed]), arm, found.theta,
                     found.beta[-law.amplitudes:])
    forth, back = np.split(both, 2)
    weight = max(float(np.linalg.norm(one.gravity)) for one in equations.arms(found.beta))
    most = max(equations.largest + weight, abs(float(forth[-1])), abs(float(back[-1])))
    if float(np.abs(both).max()) > most:
        return False
    odd = bool(np.allclose(forth, -back, rtol=1e-9, atol=1e-12))
    return not odd or bool(np.all(forth >= -1e-9 * np.abs(forth).max()))


def _taking_power(equations: Equations, law: Law, arms: Sequence[OneJoint],
                  starts: Sequence[Array], found: SeparableFit) -> SeparableFit:
    """Return the best other local optimum whose curve takes power, else `found`."""
    whole = equations.problem(law, arms)
    few = equations.thinned(_CONFIG.rough).problem(law, arms)
    grid = list(starts) if len(starts) > 1 else list(law.starts(equations.nodes, arms[0]))
    begin = ranked(equations.thinned(_CONFIG.scanned), law, arms, grid)[:_CONFIG.others]
    ends = sorted((search(few, theta) for theta in begin), key=lambda end: end[1].rss)
    for theta, _ in ends:
        other = fit_separable(whole, [theta])
        if takes_power(equations, law, arms[0], other):
            return other
    return found


def _best_of(equations: Equations, law: Law, arms: Sequence[OneJoint],
             starts: Sequence[Array]) -> Array:
    """Return the best end of brief searches from the best few of many starts, by some rows."""
    few = equations.thinned(_CONFIG.scanned)
    problem = few.problem(law, arms)
    ends = [search(problem, theta, _CONFIG.brief)
            for theta in ranked(few, law, arms, starts)[:_CONFIG.starts]]
    return min(ends, key=lambda end: end[1].rss)[0]


def ranked(few: Equations, law: Law, arms: Sequence[OneJoint],
           starts: Sequence[Array]) -> list[Array]:
    """Return `starts` within the bounds, those first that explain most of the rows."""
    grid = np.clip(np.array(starts), *law.bounds)
    rss = [scan(few.y, few.fixed, np.stack([few.law_columns(law, arms, theta) for theta in part]))
           for part in np.array_split(grid, -(-len(grid) // _CONFIG.at_once))]
    return list(grid[np.argsort(np.concatenate(rss), kind="stable")])
