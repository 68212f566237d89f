"""Fit one friction law, the joint's inertia and its gravity to rows of mean torque.

The law's numbers in θ are searched for, the others follow by least squares (variable projection:
Golub & Pereyra 1973). A scan over the grids of the law's effects finds where to begin.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Protocol

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.estimation.varpro import Separable, SeparableFit, fit_separable, scan, search
from pipelines.friction.config import FRICTION
from pipelines.friction.laws import Law, OneJoint, law_named

__all__ = ["Equations", "LawFit", "Number", "Value", "fit_law", "takes_power"]


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
        return self.seen >= FRICTION.seen


@dataclass(frozen=True, eq=False)
class LawFit:
    """A law with its numbers and their covariance.

    Order of `found.beta`: J, c, c' and other numbers that are no friction, then the amplitudes.
    """

    law: Law
    joint: OneJoint  # with this inertia and gravity
    found: SeparableFit
    width: int  # numbers that are no friction

    @property
    def theta(self) -> Array:
        return self.found.theta

    @property
    def amplitudes(self) -> Array:
        return self.found.beta[self.width :]

    @property
    def inertia(self) -> float:
        return float(self.found.beta[0])

    @property
    def gravity(self) -> tuple[float, ...]:
        return self.joint.carrying(self.found.beta).gravity

    @property
    def more(self) -> Array:
        """Return the factors of `Stretch.more`."""
        return self.found.beta[1 + len(self.joint.gravity) : self.width]

    @cached_property
    def std(self) -> Array:
        """Return the standard deviations of `found.beta` and θ."""
        return np.sqrt(np.maximum(np.diag(self.found.covariance), 0.0))

    @cached_property
    def numbers(self) -> tuple[Number, ...]:
        """Return the numbers of the law's effects with standard deviations by first order."""
        slopes = self._slopes(lambda *at: np.array(list(self.law.numbers(*at).values())))
        touched = np.abs(slopes) > 1e-9 * np.abs(slopes).max(axis=1, keepdims=True)
        shown = self.found.seen[self.width :]
        rows = zip(
            self.law.numbers(self.theta, self.amplitudes).items(),
            self._std(slopes),
            (float(shown[row].min(initial=1.0)) for row in touched),
            strict=True,
        )
        turns = self.joint.revolute
        return tuple(
            Number(f"{effect.name}.{q.name}", value, float(std), q.unit_at(turns), q.low, seen)
            for ((effect, q), value), std, seen in rows
        )

    def curve(self, speed: Array) -> Array:
        """Return the friction torque (samples,) [N m]."""
        return self.law.curve(speed, self.joint, self.theta, self.amplitudes)

    def curve_std(self, speed: Array) -> Array:
        """Return the standard deviation of `curve` by first order."""
        return self._std(self._slopes(lambda *at: self.law.curve(speed, self.joint, *at)))

    def _slopes(self, of: Callable[[Array, Array], Array]) -> Array:
        """Return ∂`of`(θ, amplitudes) by amplitudes and θ (values, numbers), by differences."""
        count, both = len(self.amplitudes), np.concatenate([self.amplitudes, self.theta])
        size = 1e-4 * np.ones(len(both))
        size[:count] *= max(float(np.abs(self.amplitudes).max()), 1e-12)
        slopes = []
        for step in np.diag(size):
            before, after = both - step, both + step
            change = of(after[count:], after[:count]) - of(before[count:], before[:count])
            slopes.append(change / (2.0 * step.sum()))
        return np.stack(slopes, axis=1)

    def _std(self, slopes: Array) -> Array:
        """Return the deviations (values,) of values with `slopes` by amplitudes and θ."""
        spread = self.found.covariance[self.width :, self.width :]
        square = np.einsum("ni,ij,nj->n", slopes, spread, slopes)
        return np.asarray(np.sqrt(np.maximum(square, 0.0)))


class Piece(Protocol):
    """Rows that are thinned on their own, of one log or one part of it."""

    @property
    def torque(self) -> Array: ...  # (rows,) [N m]

    @property
    def rigid(self) -> Array: ...  # (rows, width) columns that are no friction

    @property
    def nodes(self) -> Motion: ...  # (nodes, 1)

    @property
    def largest(self) -> float: ...  # [N m] torque on the joint, rests and reversals included

    # nodes, and the rows of columns (nodes, k) over them: every so-many-th one, of a law that may
    # have memory unless it is pointwise
    def sampler(self, every: int, pointwise: bool) -> tuple[Motion, Callable[[Array], Array]]: ...


@dataclass(frozen=True, eq=False)
class Equations:
    """Rows of one joint that a law can be fitted to."""

    pieces: Sequence[Piece]
    joint: OneJoint
    every: int = 1  # the rows are every `every`-th one of a piece

    @cached_property
    def y(self) -> Array:
        """Return the torque (rows,) [N m]."""
        return np.concatenate([piece.torque[:: self.every] for piece in self.pieces])

    @cached_property
    def fixed(self) -> Array:
        """Return the columns that are no friction (rows, width)."""
        return np.concatenate([piece.rigid[:: self.every] for piece in self.pieces])

    @cached_property
    def nodes(self) -> Motion:
        """Return the motion in which searches look for speeds and travel."""
        return max((piece.nodes for piece in self.pieces), key=lambda nodes: len(nodes.t))

    def thinned(self, rows: int) -> Equations:
        """Return about `rows` of all rows, for a scan."""
        return replace(self, every=max(1, len(self.y) // rows))

    @cached_property
    def _pointwise(self) -> list[tuple[Motion, Callable[[Array], Array]]]:
        return [piece.sampler(self.every, True) for piece in self.pieces]

    def means(self, columns: Callable[[Motion], Array], pointwise: bool) -> Array:
        """Return the rows (rows, k) of columns of the motion."""
        samplers = self._pointwise
        if not pointwise:
            samplers = [piece.sampler(self.every, False) for piece in self.pieces]
        return np.vstack([mean(columns(nodes)) for nodes, mean in samplers])

    def law_columns(self, law: Law, joint: OneJoint, theta: Array) -> Array:
        """Return the law's columns (rows, amplitudes)."""
        return self.means(lambda motion: law.columns(motion, joint, theta), law.pointwise)

    def problem(self, law: Law, joint: OneJoint) -> Separable:
        build = partial(self.law_columns, law, joint)
        known = law.pointwise and law.sloped
        slopes = partial(self._slopes, law) if known else None
        return Separable(self.y, self.fixed, build, *law.bounds, slopes)

    def _slopes(self, law: Law, theta: Array, amplitudes: Array) -> Array:
        return self.means(lambda motion: law.slopes(motion, theta, amplitudes), True)

    def residual(self, fit: LawFit) -> Array:
        """Return the residual of `fit` (rows,) [N m]."""
        rigid = fit.found.beta[: fit.width]
        law = self.law_columns(fit.law, self.joint.carrying(rigid), fit.theta) @ fit.amplitudes
        return np.asarray(self.y - (self.fixed @ rigid + law))


def fit_law(
    equations: Equations,
    law: Law,
    starts: Sequence[Array] | None = None,
    sharpness: float | None = None,
) -> LawFit:
    """Fit `law` from the best of `starts`, which are otherwise the grids of its effects.

    A law that depends on the load sees that of the fit before, round by round.

    Args:
        starts: θ.
        sharpness: of the sign of friction [s/rad], where it is known.
    """
    joint = equations.joint
    if law.sees_load:
        before = fit_law(equations, law_named("coulomb+viscous"), None, sharpness)
        joint = joint.carrying(before.found.beta)
    if starts is None:
        starts = list(law.starts(equations.nodes, joint, sharpness))
    begin = starts[0] if len(starts) == 1 else _best_of(equations, law, joint, starts)
    for _ in range(FRICTION.carried if law.sees_load else 1):
        found = fit_separable(equations.problem(law, joint), [begin])
        if not takes_power(equations, law, joint, found):
            found = _taking_power(equations, law, joint, starts, found)
        named = law.canonical(found.theta)
        if np.abs(named - found.theta).max(initial=0.0) > FRICTION.rounded:
            found = fit_separable(equations.problem(law, joint), [named])
        begin, joint = found.theta, joint.carrying(found.beta)
    return LawFit(law, joint, found, equations.fixed.shape[1])


def takes_power(equations: Equations, law: Law, joint: OneJoint, found: SeparableFit) -> bool:
    """Return whether friction opposes the motion at every speed up to the fastest.

    Two sigmoids nearly alike, one up and one down, fit the speeds there are and may do anything
    between them and zero. A joint that runs came through every lower speed: friction there was no
    more than the largest torque on it, or than that of the fastest rows, which may have been driven
    when friction had drifted. Of a curve that is not odd only this is required.
    """
    speed = float(np.abs(equations.nodes.dq).max()) * np.geomspace(1e-6, 1.0, 200)
    amplitudes = found.beta[-law.amplitudes :]
    both = law.curve(np.concatenate([speed, -speed]), joint, found.theta, amplitudes)
    forth, back = np.split(both, 2)
    weight = float(np.linalg.norm(joint.carrying(found.beta).gravity))
    largest = max(piece.largest for piece in equations.pieces)
    most = max(largest + weight, abs(float(forth[-1])), abs(float(back[-1])))
    if float(np.abs(both).max()) > most:
        return False
    odd = bool(np.allclose(forth, -back, rtol=1e-9, atol=1e-12))
    return not odd or bool(np.all(forth >= -1e-9 * np.abs(forth).max()))


def _taking_power(
    equations: Equations, law: Law, joint: OneJoint, starts: Sequence[Array], found: SeparableFit
) -> SeparableFit:
    """Return the best other local optimum whose curve takes power, else `found`."""
    few = equations.thinned(FRICTION.rough).problem(law, joint)
    grid = list(starts) if len(starts) > 1 else list(law.starts(equations.nodes, joint))
    scanned = equations.thinned(FRICTION.scanned)
    begin = _ranked(scanned, law, joint, grid)[: FRICTION.others]
    ends = sorted((search(few, theta) for theta in begin), key=lambda end: end[1].rss)
    for theta, _ in ends:
        other = fit_separable(equations.problem(law, joint), [theta])
        if takes_power(equations, law, joint, other):
            return other
    return found


def _best_of(equations: Equations, law: Law, joint: OneJoint, starts: Sequence[Array]) -> Array:
    """Return the best end of brief searches from the best few of many starts, by some rows."""
    few = equations.thinned(FRICTION.scanned)
    problem = few.problem(law, joint)
    best = _ranked(few, law, joint, starts)[: FRICTION.starts]
    ends = [search(problem, theta, FRICTION.brief) for theta in best]
    return min(ends, key=lambda end: end[1].rss)[0]


def _ranked(few: Equations, law: Law, joint: OneJoint, starts: Sequence[Array]) -> list[Array]:
    """Return `starts` within the bounds, those first that explain most of the rows."""
    grid = np.clip(np.array(starts), *law.bounds)
    rss = [
        scan(few.y, few.fixed, np.stack([few.law_columns(law, joint, theta) for theta in part]))
        for part in np.array_split(grid, -(-len(grid) // FRICTION.at_once))
    ]
    return list(grid[np.argsort(np.concatenate(rss), kind="stable")])
