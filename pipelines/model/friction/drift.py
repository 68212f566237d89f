"""Friction that changes in time: whether it does, along which course, and by how much.

    τ_f(v, t) = f(v) + α c(t) g(v),    g = f, v or sign v

c(t) is a trend 1 - exp(-(t - t0)/T) that begins anew in every log, as a joint warms up, or a step at one instant. Both are tried
on rows that slide, beside inertia, gravity and a free curve of friction (sliding.py), so that no law is assumed and what
a curve can hold is no drift. The course that leaves least must predict blocks of time that were held out better than no change
does: logarithms of the ratio of their squared errors, in closed form by leverage, against draws of their signs
(fit/flips.py). A course that costs a number and gains nothing loses there. A step may lie between any two rows; the time
constant of a trend is fitted once more with the law (joint.py).

Logs that visit every speed once, one after the other, show a drift as a part of the friction
curve. A trend that the rows neither show nor exclude is not named; it takes part where the law
chosen without it is better with it (joint.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from pipelines.fit.bounded import least_between
from pipelines.fit.flips import by_flips
from pipelines.fit.varpro import held_out
from pipelines.model.friction.ladder import no_worse
from pipelines.model.friction.weak_form import Course, Stretch, blocks_of_time
from pipelines.model.rigid.body import Array

__all__ = ["DriftConfig", "drift_of", "orthonormal", "step_row"]

_FORMS = ("whole", "coulomb", "viscous")
_ROUNDS = 4  # of scanning for a course and fitting the curve that changes
Index = npt.NDArray[np.intp]

_FINE = 1e-2  # numerics: of the logarithm of a time constant
_RANK = 1e-7  # singular values of unit columns below it: two columns that are one


@dataclass(frozen=True)
class DriftConfig:
    """Numbers that decide whether friction drifts."""

    chance: float = 1e-3  # that a joint without drift gains as much in blocks held out: none in a hundred joints
    block: float = 0.5  # [s] of rows whose errors may depend on one another; .1 s apart they do by .15 (ten joints, one .28)
    fewest: int = 12  # blocks: fewer give no covariance of two numbers to rely on
    rows: int = 3  # for every column beside the drift: fewer leave no residual to judge by
    ends: float = 0.08  # of all rows, that lie before and after a step
    times: tuple[float, ...] = (0.1, 0.2, 0.4, 0.8, 1.5, 5.0)  # over the duration; 5: straight
    least: float = 0.03  # of friction: a smaller change is within what a law is good for
    sure: float = 2.0  # standard deviations beyond which a larger change is excluded: two-sided .05


def drift_of(stretches: Sequence[Stretch], y: Array, rigid: Array, curve: Array, config: DriftConfig) -> Course | None:
    """The course of friction in time that rows show beyond chance, or a trend not excluded.

    Of those shown the first that is not measurably worse than the best: all friction by one share
    comes before a part of it, and a trend before a step. Where the rows show none, a trend of all
    friction that they do not exclude, not named; None where they do.

    Args:
        stretches: whose rows these are; they slide.
        y: (rows,) mean torque [N m].
        rigid: (rows, columns) of inertia, gravity and all else that is no friction.
        curve: (rows, columns) of a free curve of friction.
    """
    known = np.hstack([rigid, curve])
    basis, blocks = orthonormal(known), blocks_of_time(stretches, config.block)
    if blocks.max() + 1 < config.fewest or len(y) < config.rows * basis.shape[1]:
        return None
    rows = _Rows(stretches, y, known, curve, basis, config)
    found = [_best(kind, form, rows) for form in _FORMS for kind in ("trend", "step")]
    best = min(found, key=lambda one: float(one.residual @ one.residual))
    gains = np.log(_held_out(basis, y, blocks) / _held_out(orthonormal(np.column_stack([known, best.column])), y, blocks))
    whole = curve @ _least(np.column_stack([known, best.column]), y)[rigid.shape[1]:-1]
    least = config.least * float(np.median(np.abs(whole)))
    if best.size >= least and by_flips(gains) <= config.chance:
        return next(one.course for one in found if no_worse(one.residual, best.residual))
    most = found[0].size + config.sure * _deviation(found[0], basis, blocks)
    return replace(found[0].course, named=False) if most > least else None


@dataclass(frozen=True, eq=False)
class _Rows:
    """The rows of `drift_of`, and all that is fitted beside a drift."""

    stretches: Sequence[Stretch]
    y: Array  # (rows,) [N m]
    known: Array  # (rows, columns)
    curve: Array  # (rows, columns) the last columns of `known`
    basis: Array  # orthonormal columns of the space of `known`
    config: DriftConfig

    @cached_property
    def left(self) -> Array:
        """What is left of the torque without a drift (rows,) [N m]."""
        return np.asarray(self.y - self.basis @ (self.basis.T @ self.y))

    def course(self, course: Course) -> Array:
        """c(t) of every row (rows,)."""
        parts = [course.at(part, one.middle[2]) for part, one in enumerate(self.stretches)]
        return np.concatenate(parts)

    def gain(self, column: Array) -> float:
        """Return by how much a column (rows,) lowers the sum of squares [N² m²]."""
        outside = column - self.basis @ (self.basis.T @ column)
        return float(np.square(outside @ self.left) / max(float(outside @ outside), 1e-300))


@dataclass(frozen=True, eq=False)
class _Found:
    """The best course of one kind and form."""

    course: Course
    column: Array  # (rows,) c(t) g(v)
    typical: float  # [N m] median of |g(v)|
    change: float  # α
    residual: Array  # (rows,) [N m]

    @property
    def size(self) -> float:
        """By how much it changes friction [N m]."""
        return abs(self.change) * self.typical


def _best(kind: str, form: str, rows: _Rows) -> _Found:
    """The course of this kind and form that leaves least.

    The curve that changes as a whole is itself fitted: scan, fit, scan again.
    """
    speed = np.concatenate([stretch.middle[1] for stretch in rows.stretches])
    shape = speed if form == "viscous" else np.sign(speed)
    beta, width = _least(rows.known, rows.y), rows.known.shape[1]
    for _ in range(_ROUNDS if form == "whole" else 1):
        if form == "whole":
            shape = rows.curve @ beta[width - rows.curve.shape[1]:width]
        course = (_step if kind == "step" else _trend)(form, shape, rows)
        own = rows.course(course) * shape
        columns = np.column_stack([rows.known, own])
        beta = _least(columns, rows.y)
    typical = float(np.median(np.abs(shape)))
    return _Found(course, own, typical, float(beta[-1]), rows.y - columns @ beta)


def _deviation(found: _Found, basis: Array, blocks: Index) -> float:
    """Standard deviation of the size of a drift [N m], errors within a block dependent (White 1984)."""
    outside = found.column - basis @ (basis.T @ found.column)
    scatter = float(np.sqrt(np.sum(np.square(np.bincount(blocks, outside * found.residual)))))
    return found.typical * scatter / max(float(outside @ outside), 1e-300)


def _least(columns: Array, y: Array) -> Array:
    """Least squares over columns of unit length."""
    scale = np.linalg.norm(columns, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    return np.asarray(np.linalg.lstsq(columns / scale, y, rcond=_RANK)[0] / scale)


def orthonormal(columns: Array) -> Array:
    """Orthonormal columns of the same space."""
    scale = np.linalg.norm(columns, axis=0)
    left, size, _ = np.linalg.svd(columns[:, scale > 0.0] / scale[scale > 0.0], full_matrices=False)
    return np.asarray(left[:, size > _RANK * size.max(initial=0.0)])


def _held_out(basis: Array, y: Array, blocks: Index) -> Array:
    """Sum of squares of every block as the other blocks predict it (blocks,)."""
    rest = held_out(basis, y - basis @ (basis.T @ y), blocks)
    return np.asarray(np.maximum(np.bincount(blocks, np.square(rest)), 1e-300))


def _trend(form: str, shape: Array, rows: _Rows) -> Course:
    """The course of a trend with the time constant by which it explains most."""
    starts = tuple(float(stretch.t[0]) for stretch in rows.stretches)
    duration = max(float(stretch.t[-1] - stretch.t[0]) for stretch in rows.stretches)

    def course(time: float) -> Course:
        return Course("trend", form, starts, time * duration, 0.5 * duration, duration)

    def loss(logarithm: float) -> float:
        return -rows.gain(rows.course(course(float(np.exp(logarithm)))) * shape)

    times = np.log(rows.config.times)
    k = int(np.argmin([loss(time) for time in times]))
    ends = (float(times[max(k - 1, 0)]), float(times[min(k + 1, len(times) - 1)]))
    return course(float(np.exp(least_between(loss, *ends, _FINE))))


def _step(form: str, shape: Array, rows: _Rows) -> Course:
    """The course of a step at the instant between two rows from which it explains most."""
    stretches = rows.stretches
    t = np.concatenate([stretch.middle[2] for stretch in stretches])
    log = np.repeat(np.arange(len(stretches)), [stretch.rows for stretch in stretches])
    row = step_row(shape, rows.basis, rows.left, rows.config)
    before, here = int(log[row - 1]), int(log[row])
    starts = tuple(float(stretch.t[0]) for stretch in stretches)
    when = 0.5 * float(t[row - 1] + t[row]) - starts[here] if before == here else 0.0
    return Course("step", form, starts, when, 0.0, when, here)


def step_row(shape: Array, basis: Array, left: Array, config: DriftConfig) -> int:
    """Return the row from which on a column of `shape` (rows,) lowers the sum of squares most (Andrews 1993, sup F).

    Its products with other columns are sums over the later rows. A step that lies within the other columns, but for less
    than a row, is not shown by any.

    Args:
        basis: (rows, columns) orthonormal columns of all else.
        left: (rows,) residual of these.
    """
    after = np.cumsum((shape[:, None] * np.column_stack([left, shape, basis]))[::-1], axis=0)[::-1]
    outside = after[:, 1] - np.square(after[:, 2:]).sum(axis=1)
    shown = outside > after[0, 1] / len(shape)
    rows = np.arange(max(1, int(config.ends * len(shape))), int((1.0 - config.ends) * len(shape)))
    return int(rows[np.argmax(np.where(shown, np.square(after[:, 0]) / np.where(shown, outside, 1.0), 0.0)[rows])])
