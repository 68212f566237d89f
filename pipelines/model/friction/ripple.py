"""What a friction fit leaves that is a torque of the joint's angle, which no law of friction knows.

    r = F δ + Σ_k (a_k sin kq + b_k cos kq) + noise        F = ∂ŷ/∂(β, θ) of the fitted law

Waves are chosen on some blocks of time and judged on the others. They have to explain a good part of what is left there, and
some of it forth and back, slow and fast: friction turns with the motion, an acceleration that is wrong goes with the speed, a
torque of the angle does neither. Magnets, teeth, a spring, a stop: what makes it is not asked here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pipelines.fit.varpro import SeparableFit, fit_separable
from pipelines.model.friction.equations import Equations
from pipelines.model.friction.law_fit import LawFit
from pipelines.model.friction.one_joint import OneJoint, gravity_columns
from pipelines.model.friction.waves import Waves
from pipelines.model.rigid.body import Array, Motion
from pipelines.model.rigid.orders import orders_along

__all__ = ["Along", "Ripple", "RippleConfig", "refitted", "ripple_of"]

_AT_ONCE = 16  # orders: memory
_RANK = 1e-5  # singular values of unit columns below it: two columns that are one


@dataclass(frozen=True)
class RippleConfig:
    """Limits beyond which a torque of the angle is reported.

    Attributes:
        rows: that are looked at, or up to twice as many: more than ten for every order
        folds: blocks of time, each held out in turn (Efron 1979)
        most: waves
        each: of the residual (mean square), the least that a further wave explains
        explained: of the residual of blocks held out (mean square), the least: as much as all else together. Compliance of
            other joints follows the angle too: up to .24 on a healthy arm. Cogging of 4 % of the torque came to .98, an
            outrunner's to .89
        sides: of the same, forth and back, slow and fast, each
        worth: of the joint's torque (rms): what friction laws are good for
        few: rows that each side has at least: a side that was not driven says nothing
        sure: standard deviations of a size, that it has to be: two-sided .003
        classes: of angle, at most, a degree of a turn each
        of_class: rows of one
    """

    rows: int = 4000
    folds: int = 10
    most: int = 8
    each: float = 0.05
    explained: float = 0.5
    sides: float = 0.1
    worth: float = 0.01
    few: int = 100
    sure: float = 3.0
    classes: int = 360
    of_class: int = 8


_CONFIG = RippleConfig()


@dataclass(frozen=True, eq=False)
class Along:
    """What the law leaves beside the waves that explain it, by angle, without gravity. (points,); NaN where no row is."""

    angle: Array  # [rad], of a slide [m]: middle of a class
    forth: Array  # [N m], of a slide [N]: mean of the rows in it that move forth
    back: Array  # the same of rows that move back
    waves: Array  # [N m], of a slide [N]: those that were fitted

    def share_of(self, order: float) -> float:
        """What one of the waves is of all of them (mean square)."""
        whole, turned = self.waves - np.mean(self.waves), order * self.angle
        one = np.stack([np.sin(turned), np.cos(turned), np.ones_like(turned)], axis=1)
        left = whole - one @ np.linalg.lstsq(one, whole, rcond=None)[0]
        return 1.0 - float(left @ left) / max(float(whole @ whole), 1e-300)


@dataclass(frozen=True)
class Ripple:
    """Torque of the joint's angle that is the same at every speed and in both directions."""

    rms: float  # [N m] over the rows, without what the law would take of it
    std: float  # of rms: the blocks left out one by one
    share: float  # of what the law leaves of blocks held out (mean square), what the waves explain
    orders: tuple[float, ...]  # [1/rev] of the waves, the largest first
    along: Along

    @property
    def waves(self) -> Waves:
        return Waves(self.orders)


@dataclass(frozen=True)
class _State:
    """Position and speed, as columns."""

    pointwise: bool = True

    def columns(self, motion: Motion, arm: OneJoint, theta: Array) -> Array:
        return np.hstack([motion.q, motion.dq])


@dataclass(frozen=True, eq=False)
class _Normal:
    """Normal equations AᵀA of rows A = [what the law can take, every wave, what it leaves], columns scaled alike for all."""

    gram: Array
    numbers: int  # of the law's

    def places(self, chosen: Sequence[int]) -> npt.NDArray[np.intp]:
        """Of the law's numbers, and of the sines and cosines of the chosen waves."""
        waves = [self.numbers + 2 * k + part for k in chosen for part in (0, 1)]
        return np.array([*range(self.numbers), *waves], dtype=np.intp)

    def outside(self, chosen: Sequence[int]) -> Array:
        """Products of the chosen waves' columns, each without what the law's columns take of it.

        With W the waves and F the law's: Wᵀ W - Wᵀ F (Fᵀ F)⁻¹ Fᵀ W.
        """
        at = self.places(chosen)
        law, waves = at[:self.numbers], at[self.numbers:]
        across = self.gram[np.ix_(law, waves)]
        return np.asarray(self.gram[np.ix_(waves, waves)] - across.T @ _inverse(self.gram[np.ix_(law, law)]) @ across)

    def solution(self, chosen: Sequence[int]) -> Array:
        """Least squares over those places."""
        at = self.places(chosen)
        return np.asarray(_inverse(self.gram[np.ix_(at, at)]) @ self.gram[at, -1])

    def gains(self, chosen: Sequence[int]) -> Array:
        """(orders,) share of what the law and the chosen waves leave (square), that each wave explains beside them.

        With G the products of what of its two columns lies outside, and g theirs with the rest: gᵀ G⁻¹ g.
        """
        at, waves = self.places(chosen), slice(self.numbers, -1)
        inner = _inverse(self.gram[np.ix_(at, at)])
        across = self.gram[at, waves]
        taken = inner @ across
        pairs = (across.reshape(len(at), -1, 2), taken.reshape(len(at), -1, 2))
        whole = self.gram[waves, waves].reshape(pairs[0].shape[1], 2, -1, 2)
        own = np.einsum("kikj->kij", whole) - np.einsum("bki,bkj->kij", *pairs)
        push = (self.gram[waves, -1] - taken.T @ self.gram[at, -1]).reshape(-1, 2)
        left = self.gram[-1, -1] - self.gram[at, -1] @ inner @ self.gram[at, -1]
        return np.asarray(np.einsum("ki,kij,kj->k", push, _inverse(own), push) / left) if left > 0.0 else np.zeros(len(push))


@dataclass(frozen=True, eq=False)
class _Rows:
    """Some of the fitted rows: what the law could still take, every wave, and what it leaves, in this order; scaled."""

    columns: Array  # (rows, numbers + 2 × orders + 1)
    scale: Array  # of the columns
    numbers: int

    @classmethod
    def of(cls, slopes: Array, waves: Array, left: Array) -> _Rows:
        columns = np.hstack([slopes, waves, left[:, None]])
        scale = np.linalg.norm(columns, axis=0)
        scale = np.where(scale > 0.0, scale, 1.0)
        return cls(columns / scale, scale, slopes.shape[1])

    @cached_property
    def parts(self) -> tuple[npt.NDArray[np.intp], ...]:
        """Blocks of time."""
        return tuple(np.array_split(np.arange(len(self.columns)), _CONFIG.folds))

    @cached_property
    def whole(self) -> _Normal:
        return _Normal(self.columns.T @ self.columns, self.numbers)

    @cached_property
    def others(self) -> tuple[_Normal, ...]:
        """Of every block, the normal equations of all blocks but it."""
        return tuple(_Normal(self.whole.gram - self.columns[part].T @ self.columns[part], self.numbers) for part in self.parts)

    def amplitudes(self, normal: _Normal, chosen: Sequence[int]) -> Array:
        """Of the chosen waves (2 × waves,) [N m], sine and cosine in turn."""
        at = normal.places(chosen)
        return np.asarray(normal.solution(chosen) / self.scale[at] * self.scale[-1])[self.numbers:]


def _inverse(gram: Array) -> Array:
    """Of symmetric matrices (…, k, k) of unit columns, over what they show."""
    return np.asarray(np.linalg.pinv(gram, rcond=_RANK**2, hermitian=True), dtype=np.float64)


def ripple_of(equations: Equations, fit: LawFit) -> Ripple | None:
    """Waves along the turn that the fitted rows show beyond chance, and large enough to matter; None where they do not.

    Args:
        equations: that `fit` was fitted to.
    """
    power = float(np.mean(np.square(equations.y)))
    if fit.found.rms**2 <= _CONFIG.worth**2 * power:
        return None
    few, arms = equations.thinned(_CONFIG.rows), equations.arms()
    every = Waves(tuple(orders_along(float(np.ptp(equations.nodes.q[:, 0])), arms[0].revolute)))
    size = len(every.orders)
    parts = [few.build(every.some(range(k, min(k + _AT_ONCE, size))), arms, fit.theta) for k in range(0, size, _AT_ONCE)]
    rows = _Rows.of(fit.found.jacobian[few.rows], np.hstack(parts), fit.found.residual[few.rows])
    state = few.build(_State(), arms, fit.theta)
    chosen = _chosen(rows.whole)
    share = _told(rows, state[:, 1]) if chosen else None
    if share is None:
        return None
    high = np.hypot(*rows.amplitudes(rows.whole, chosen).reshape(-1, 2).T)
    chosen = [chosen[k] for k in np.argsort(-high)]
    rms, std = _size(rows, chosen)
    if rms < max(_CONFIG.worth * np.sqrt(power), _CONFIG.sure * std):
        return None
    waves = every.some(chosen)
    return Ripple(rms, std, share, waves.orders, _along(rows, chosen, state, waves, arms[0]))


def _chosen(normal: _Normal) -> list[int]:
    """Waves one after the other, that which explains most first, as long as each explains a good part of the rest."""
    chosen: list[int] = []
    while len(chosen) < _CONFIG.most:
        gains = normal.gains(chosen)
        best = int(np.argmax(gains))
        if gains[best] < _CONFIG.each or best in chosen:
            break
        chosen.append(best)
    return chosen


def _told(rows: _Rows, speed: Array) -> float | None:
    """Share that waves chosen on the other blocks explain of blocks held out; None where it is too little, in all or on a side."""
    quick = np.abs(speed) > np.median(np.abs(speed))
    sides = (speed > 0.0, speed < 0.0, quick, ~quick)
    if min(int(side.sum()) for side in sides) < _CONFIG.few:  # of a joint that goes one way friction is a torque of its angle too
        return None
    before, after = np.empty(len(speed)), np.empty(len(speed))
    for part, rest in zip(rows.parts, rows.others, strict=True):
        here = rows.columns[part]
        for into, chosen in ((before, []), (after, _chosen(rest))):
            into[part] = here[:, -1] - here[:, rest.places(chosen)] @ rest.solution(chosen)
    whole = _share(before, after)
    least = min(_share(before[side], after[side]) for side in sides)
    return whole if whole >= _CONFIG.explained and least >= _CONFIG.sides else None


def _share(before: Array, after: Array) -> float:
    return 1.0 - float(after @ after) / max(float(before @ before), 1e-300)


def _size(rows: _Rows, chosen: Sequence[int]) -> tuple[float, float]:
    """Root mean square over the rows of what of the waves lies outside the law [N m], and its standard deviation.

    Waves and law cancel where they are nearly one, a slow wave and gravity, and either alone is as large as it pleases: what lies
    outside is what the waves explain, and never more than is left. Efron 1979, the jackknife over blocks of time; at least what
    white noise as large as the rest would make.
    """
    outside = rows.whole.outside(chosen)
    scale = rows.scale[rows.whole.places(chosen)][rows.numbers:]

    def size(normal: _Normal) -> float:
        own = rows.amplitudes(normal, chosen) * scale
        return float(np.sqrt(max(float(own @ outside @ own), 0.0) / len(rows.columns)))

    rest = rows.columns[:, -1] - rows.columns[:, rows.whole.places(chosen)] @ rows.whole.solution(chosen)
    white = rows.scale[-1] * float(np.linalg.norm(rest)) / len(rows.columns)
    jackknife = float(np.sqrt(_CONFIG.folds - 1.0) * np.std([size(others) for others in rows.others]))
    return size(rows.whole), max(jackknife, white)


def _along(rows: _Rows, chosen: Sequence[int], state: Array, waves: Waves, arm: OneJoint) -> Along:
    """Means by classes of angle, without what the law would take of them were the waves known.

    What of the waves gravity could be, a + c sin q + c' cos q, no row tells from it: that is taken out of all.
    """
    q, dq = state.T
    solution = rows.whole.solution(chosen)
    left = (rows.columns[:, -1] - rows.columns[:, :rows.numbers] @ solution[:rows.numbers]) * rows.scale[-1]
    classes = int(np.clip(len(q) // _CONFIG.of_class, 10, _CONFIG.classes))
    edges = np.linspace(float(q.min()), float(q.max()), classes + 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    place = np.clip(np.searchsorted(edges, q, side="right") - 1, 0, classes - 1)
    whole = waves.at(middle) @ rows.amplitudes(rows.whole, chosen)
    weight = np.hstack([np.ones((classes, 1)), gravity_columns(middle, arm.revolute)])
    taken = weight @ np.linalg.lstsq(weight, whole, rcond=None)[0]
    means = []
    for side in (dq > 0.0, dq < 0.0):
        count = np.bincount(place[side], minlength=classes)
        means.append(np.where(count > 0, np.bincount(place[side], left[side], classes) / np.maximum(count, 1), np.nan) - taken)
    return Along(middle, means[0], means[1], whole - taken)


def refitted(equations: Equations, fit: LawFit, ripple: Ripple) -> SeparableFit:
    """The same law with the waves beside it: what the other numbers are where the ripple is known. Rigid numbers come first."""
    waves = equations.build(ripple.waves, equations.arms(), fit.theta)
    problem = equations.problem(fit.law, equations.arms(fit.found.beta))
    return fit_separable(replace(problem, fixed=np.hstack([problem.fixed, waves])), [fit.theta])
