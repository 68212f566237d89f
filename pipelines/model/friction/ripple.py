"""Find a torque of the joint's angle in what a friction fit leaves, which no law of friction knows.

    r = F δ + Σ_k (a_k sin kq + b_k cos kq) + noise        F = ∂ŷ/∂(β, θ) of the fitted law

k waves in a turn; of a slide, in 2π m. They are chosen on some blocks of time and judged on the
others. They have to explain a good part of the residual there, and some of it forth and back, slow
and fast: friction turns with the motion, an acceleration that is wrong goes with the speed, a
torque of the angle does neither. Magnets, teeth, a spring, a stop: what makes it is not asked here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.orders import orders_along
from pipelines.fit.varpro import fit_separable
from pipelines.model.effects.base import ArmModel, Parameters, Quantity
from pipelines.model.effects.fast import Fast
from pipelines.model.friction.fit import Columns, Equations, LawFit, Value
from pipelines.model.friction.laws import gravity_columns

__all__ = ["Along", "Ripple", "RippleConfig", "Wave", "ripple_of", "with_inertia"]

_AT_ONCE = 16  # orders: memory
_RANK = 1e-5  # singular values of unit columns below it: two columns that are one


@dataclass(frozen=True)
class RippleConfig:
    """Limits beyond which a torque of the angle is reported."""

    rows: int = 4000  # looked at, or up to twice as many: more than ten for every order
    folds: int = 10  # blocks of time, each held out in turn (Efron 1979)
    most: int = 8  # waves
    each: float = 0.05  # of the residual (mean square), the least that a further wave explains
    # Of the residual of blocks held out, the least: as much as all else together. Compliance of
    # other joints follows the angle too: up to .24 on a healthy arm. Cogging of 4 % of the torque
    # came to .98, an outrunner's to .89
    explained: float = 0.5
    sides: float = 0.1  # of the same, forth and back, slow and fast, each
    worth: float = 0.01  # of the joint's torque (rms): what friction laws are good for
    few: int = 100  # rows that each side has at least: one that was not driven shows nothing
    sure: float = 3.0  # standard deviations of a size, that it has to be: two-sided .003
    classes: int = 360  # of angle, at most, a degree of a turn each
    of_class: int = 8  # rows of one


_CONFIG = RippleConfig()


@dataclass(frozen=True)
class Wave(Fast):
    """a sin kq + b cos kq at one joint, one of the laws of an arm."""

    order: float = 1.0  # k [1/rev]

    name = "wave"
    parameters = Parameters(
        Quantity("order", "1/rev", 0.0, 1000.0, "waves in one turn of the joint", shape=True),
        Quantity("sine", "N m", -np.inf, np.inf, "of the sine of the angle"),
        Quantity("cosine", "N m", -np.inf, np.inf, "of its cosine"))
    from_motion = True

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm, *_waves(self.own(motion.q), (self.order,)).T)


def _waves(angle: Array, orders: Sequence[float]) -> Array:
    """Return the sine and the cosine of each order in turn (points, 2 × orders) at angles [rad]."""
    wave = np.exp(1j * angle[:, None] * np.array(orders))
    return np.stack([wave.imag, wave.real], axis=2).reshape(len(angle), -1)


def _along_angle(orders: Sequence[float]) -> Columns:
    return lambda motion, arm: _waves(motion.q[:, 0], orders)


@dataclass(frozen=True, eq=False)
class Along:
    """Residual of the law, and the waves that explain it, by angle, without gravity (points,).

    NaN where no row is.
    """

    angle: Array  # [rad], of a slide [m]: middle of a class
    forth: Array  # [N m], of a slide [N]: mean of the rows in it that move forth
    back: Array  # the same of rows that move back
    waves: Array  # [N m], of a slide [N]: those that were fitted

    def share_of(self, order: float) -> float:
        """Return what one of the waves is of all of them (mean square)."""
        whole = self.waves - np.mean(self.waves)
        columns = np.hstack([_waves(self.angle, (order,)), np.ones((len(whole), 1))])
        rest = whole - columns @ np.linalg.lstsq(columns, whole, rcond=None)[0]
        return _explained(whole, rest)


@dataclass(frozen=True)
class Ripple:
    """Torque that depends on the angle of the joint alone: no law of friction holds it."""

    rms: Value  # [N m], of a slide [N]: rms of what it explains of what the law leaves
    share: float  # of what the law leaves of blocks held out (mean square)
    orders: tuple[float, ...]  # [1/rev] waves in a turn, of a slide [1/(2π m)] in 2π m; the largest first
    inertia: Value | None  # of the joint, with the ripple known; null where the law was fitted by another method
    along: Along
    largest_share: float = math.nan  # of the largest wave in all of them (mean square); not known of results stored before it was


@dataclass(frozen=True, eq=False)
class _Rows:
    """Some of the fitted rows A = [what the law can take, every wave, what it leaves], scaled.

    A normal matrix is AᵀA of all of them, or of all blocks of time but one.
    """

    columns: Array  # (rows, numbers + 2 × orders + 1)
    scale: Array  # of the columns
    numbers: int  # of the law's

    @cached_property
    def parts(self) -> list[npt.NDArray[np.intp]]:
        """Return blocks of time."""
        return np.array_split(np.arange(len(self.columns)), _CONFIG.folds)

    @cached_property
    def whole(self) -> Array:
        """Return the normal matrix of all rows."""
        return np.asarray(self.columns.T @ self.columns)

    @cached_property
    def others(self) -> tuple[Array, ...]:
        """Return, of every block, the normal matrix of all blocks but it."""
        return tuple(self.whole - self.columns[part].T @ self.columns[part] for part in self.parts)

    def places(self, chosen: Sequence[int]) -> npt.NDArray[np.intp]:
        """Return where the law's numbers, and sines and cosines of the chosen waves, are."""
        waves = [self.numbers + 2 * k + part for k in chosen for part in (0, 1)]
        return np.array([*range(self.numbers), *waves], dtype=np.intp)

    def solution(self, normal: Array, chosen: Sequence[int]) -> Array:
        """Return least squares over these columns."""
        at = self.places(chosen)
        return np.asarray(_inverse(normal[np.ix_(at, at)]) @ normal[at, -1])

    def gains(self, normal: Array, chosen: Sequence[int]) -> Array:
        """Return the share of the residual that each wave explains (orders,).

        With G the products of what of its two columns lies outside the law and the chosen waves,
        and g theirs with what these leave: gᵀ G⁻¹ g.
        """
        at, waves = self.places(chosen), slice(self.numbers, -1)
        inner, across = _inverse(normal[np.ix_(at, at)]), normal[at, waves]
        taken = inner @ across
        whole = normal[waves, waves].reshape(taken.shape[1] // 2, 2, -1, 2)
        pairs = (across.reshape(len(at), -1, 2), taken.reshape(len(at), -1, 2))
        own = np.einsum("kikj->kij", whole) - np.einsum("bki,bkj->kij", *pairs)
        push = (normal[waves, -1] - taken.T @ normal[at, -1]).reshape(-1, 2)
        left = normal[-1, -1] - normal[at, -1] @ inner @ normal[at, -1]
        if left <= 0.0:
            return np.zeros(len(push))
        return np.asarray(np.einsum("ki,kij,kj->k", push, _inverse(own), push) / left)

    def choice(self, normal: Array) -> list[int]:
        """Return waves, that first which explains most, while each explains a good part."""
        chosen: list[int] = []
        while len(chosen) < _CONFIG.most:
            gains = self.gains(normal, chosen)
            best = int(np.argmax(gains))
            if gains[best] < _CONFIG.each or best in chosen:
                break
            chosen.append(best)
        return chosen

    def amplitudes(self, normal: Array, chosen: Sequence[int]) -> Array:
        """Return sine and cosine of the chosen waves in turn (2 × waves,) [N m]."""
        scale = self.scale[-1] / self.scale[self.places(chosen)]
        return np.asarray(self.solution(normal, chosen) * scale)[self.numbers:]

    def rest(self, normal: Array, chosen: Sequence[int],
             rows: npt.NDArray[np.intp] | slice) -> Array:
        """Return the residual of the law and the chosen waves in some rows, scaled (rows,)."""
        here = self.columns[rows]
        return here[:, -1] - here[:, self.places(chosen)] @ self.solution(normal, chosen)


def _inverse(gram: Array) -> Array:
    """Return the inverse of symmetric matrices (…, k, k) of unit columns, over what they show."""
    return np.asarray(np.linalg.pinv(gram, rcond=_RANK**2, hermitian=True), dtype=np.float64)


def ripple_of(equations: Equations, fit: LawFit) -> Ripple | None:
    """Return waves along the turn that rows show beyond chance, large enough to matter; else None.

    Args:
        equations: that `fit` was fitted to.
    """
    power = float(np.mean(np.square(equations.y)))
    if fit.found.rms**2 <= _CONFIG.worth**2 * power:
        return None
    few, arms = equations.thinned(_CONFIG.rows), equations.arms()
    orders = tuple(orders_along(float(np.ptp(equations.nodes.q[:, 0])), arms[0].revolute))
    parts = [few.means(_along_angle(orders[k:k + _AT_ONCE]), arms)
             for k in range(0, len(orders), _AT_ONCE)]
    law, left = fit.found.jacobian[few.rows], fit.found.residual[few.rows]
    columns = np.hstack([law, *parts, left[:, None]])
    scale = np.linalg.norm(columns, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    rows = _Rows(columns / scale, scale, law.shape[1])
    q, dq = few.means(lambda motion, arm: np.hstack([motion.q, motion.dq]), arms).T
    chosen = rows.choice(rows.whole)
    share = _held_out(rows, dq) if chosen else None
    if share is None:
        return None
    high = np.hypot(*rows.amplitudes(rows.whole, chosen).reshape(-1, 2).T)
    chosen = [chosen[k] for k in np.argsort(-high)]
    rms, std = _size(rows, chosen)
    if rms < max(_CONFIG.worth * np.sqrt(power), _CONFIG.sure * std):
        return None
    waves = tuple(orders[k] for k in chosen)
    along = _along(rows, chosen, q, dq, waves, arms[0].revolute)
    return Ripple(Value(rms, std, arms[0].units[0]), share, waves, None, along,
                  along.share_of(waves[0]))


def _held_out(rows: _Rows, speed: Array) -> float | None:
    """Return the share that waves chosen on the other blocks explain of blocks held out.

    None where it is too little, in all or on a side. Of a joint that goes one way friction is a
    torque of its angle too.
    """
    quick = np.abs(speed) > np.median(np.abs(speed))
    sides = (speed > 0.0, speed < 0.0, quick, ~quick)
    if min(int(side.sum()) for side in sides) < _CONFIG.few:
        return None
    before, after = np.empty(len(speed)), np.empty(len(speed))
    for part, others in zip(rows.parts, rows.others, strict=True):
        before[part] = rows.rest(others, [], part)
        after[part] = rows.rest(others, rows.choice(others), part)
    whole = _explained(before, after)
    least = min(_explained(before[side], after[side]) for side in sides)
    return whole if whole >= _CONFIG.explained and least >= _CONFIG.sides else None


def _explained(before: Array, after: Array) -> float:
    return 1.0 - float(after @ after) / max(float(before @ before), 1e-300)


def _size(rows: _Rows, chosen: Sequence[int]) -> tuple[float, float]:
    """Return the rms of what of the waves lies outside the law [N m], and its standard deviation.

    Waves and law cancel where they are nearly one, a slow wave and gravity, and either alone is as
    large as it pleases: what lies outside, Wᵀ W - Wᵀ F (Fᵀ F)⁻¹ Fᵀ W with W the waves, is what they
    explain, and never more than is left. Efron 1979, the jackknife over blocks of time; at least
    what white noise as large as the rest would make.
    """
    normal, count = rows.whole, len(rows.columns)
    law, waves = np.split(rows.places(chosen), [rows.numbers])
    across, inner = normal[np.ix_(law, waves)], _inverse(normal[np.ix_(law, law)])
    outside = normal[np.ix_(waves, waves)] - across.T @ inner @ across

    def size(normal: Array) -> float:
        own = rows.amplitudes(normal, chosen) * rows.scale[waves]
        return float(np.sqrt(max(float(own @ outside @ own), 0.0) / count))

    rest = rows.rest(rows.whole, chosen, slice(None))
    white = rows.scale[-1] * float(np.linalg.norm(rest)) / count
    jackknife = np.sqrt(_CONFIG.folds - 1.0) * np.std([size(others) for others in rows.others])
    return size(rows.whole), max(float(jackknife), white)


def _along(rows: _Rows, chosen: Sequence[int], q: Array, dq: Array, orders: Sequence[float],
           revolute: bool) -> Along:
    """Return means by classes of angle, without what the law would take were the waves known.

    What of the waves gravity could be, a + c sin q + c' cos q, no row tells from it: that is taken
    out of all.
    """
    law = rows.columns[:, :rows.numbers] @ rows.solution(rows.whole, chosen)[:rows.numbers]
    left = (rows.columns[:, -1] - law) * rows.scale[-1]
    classes = int(np.clip(len(q) // _CONFIG.of_class, 10, _CONFIG.classes))
    edges = np.linspace(float(q.min()), float(q.max()), classes + 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    place = np.clip(np.searchsorted(edges, q, side="right") - 1, 0, classes - 1)
    whole = _waves(middle, orders) @ rows.amplitudes(rows.whole, chosen)
    weight = np.hstack([np.ones((classes, 1)), gravity_columns(middle, revolute)])
    taken = weight @ np.linalg.lstsq(weight, whole, rcond=None)[0]
    means = []
    for side in (dq > 0.0, dq < 0.0):
        count = np.bincount(place[side], minlength=classes)
        mean = np.bincount(place[side], left[side], classes) / np.maximum(count, 1)
        means.append(np.where(count > 0, mean, np.nan) - taken)
    return Along(middle, means[0], means[1], whole - taken)


def with_inertia(ripple: Ripple, equations: Equations, fit: LawFit) -> Ripple:
    """Return `ripple` with the inertia of the same law where its waves are known."""
    waves = equations.means(_along_angle(ripple.orders), equations.arms())
    problem = equations.problem(fit.law, equations.arms(fit.found.beta))
    problem = replace(problem, fixed=np.hstack([problem.fixed, waves]))
    found = fit_separable(problem, [fit.theta])
    std = float(np.sqrt(max(found.covariance[0, 0], 0.0)))
    return replace(ripple, inertia=Value(float(found.beta[0]), std, fit.joint.units[2]))
