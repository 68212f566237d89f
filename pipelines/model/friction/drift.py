"""Friction that changes in time: whether it does, along which course, and by how much.

    τ_f(v, t) = f(v) + α c(t) g(v),    g = f, v or sign v

c(t) is a trend 1 - exp(-(t - t0)/T) that begins anew in every log, as a joint warms up, or a step at one instant. Both are tried
on rows that slide, beside inertia, gravity and a free curve of friction (sliding.py), so that no law is assumed and what
a curve can hold is no drift. The course that leaves least must predict blocks of time that were held out better than no change
does: logarithms of the ratio of their squared errors, in closed form by leverage, against draws of their signs
(fit/flips.py). A course that costs a number and gains nothing loses there. A step may lie between any two rows; the time
constant of a trend is fitted later with the law (joint.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.fit.flips import by_flips
from pipelines.fit.varpro import held_out
from pipelines.model.friction.ladder import no_worse
from pipelines.model.friction.weak_form import Course, Stretch, blocks_of_time
from pipelines.model.rigid.body import Array

__all__ = ["DriftConfig", "drift_of", "orthonormal", "step_row"]

_FORMS = ("whole", "coulomb", "viscous")
_ROUNDS = 4  # of scanning for a course and fitting the curve that changes
Index = npt.NDArray[np.intp]

_RANK = 1e-7  # singular values of unit columns below it: two columns that are one


@dataclass(frozen=True)
class DriftConfig:
    """Numbers that decide whether friction drifts."""

    chance: float = 1e-3  # that a joint without drift gains as much in blocks held out: none in a hundred joints
    block: float = 0.5  # [s] of rows whose errors may depend on one another; .1 s apart they do by .15 (ten joints, one .28)
    fewest: int = 12  # blocks: fewer give no covariance of two numbers to rely on
    rows: int = 3  # for every column beside the drift: fewer leave no residual to judge by
    ends: float = 0.08  # of all rows, that lie before and after a step
    times: tuple[float, ...] = (0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0, 1.5, 5.0)  # over the duration; 5: straight
    least: float = 0.03  # of friction: a smaller change is within what a law is good for


def drift_of(stretches: Sequence[Stretch], y: Array, rigid: Array, curve: Array, config: DriftConfig) -> Course | None:
    """The course of friction in time, where rows show one beyond chance: the first that is not measurably worse than the best.

    All friction by one share comes before a part of it, and a trend before a step.

    Args:
        stretches: whose rows these are; they slide.
        y: (rows,) mean torque [N m].
        rigid: (rows, columns) of inertia, gravity and all else that is no friction.
        curve: (rows, columns) of a free curve of friction.
    """
    speed = np.concatenate([stretch.middle[1] for stretch in stretches])
    known = np.hstack([rigid, curve])
    basis, blocks = orthonormal(known), blocks_of_time(stretches, config.block)
    if blocks.max() + 1 < config.fewest or len(y) < config.rows * basis.shape[1]:
        return None
    trends = _trends(stretches, config)
    found = [_best(kind, form, stretches, y, known, curve, basis, speed, trends, config)
             for form in _FORMS for kind in ("trend", "step")]
    best = min(found, key=lambda one: float(one.residual @ one.residual))
    gains = np.log(_held_out(basis, y, blocks) / _held_out(orthonormal(np.column_stack([known, best.column])), y, blocks))
    whole = curve @ _least(np.column_stack([known, best.column]), y)[rigid.shape[1]:-1]
    if best.size < config.least * float(np.median(np.abs(whole))) or by_flips(gains) > config.chance:
        return None
    return next(one.course for one in found if no_worse(one.residual, best.residual))


@dataclass(frozen=True, eq=False)
class _Found:
    """The best course of one kind and form."""

    course: Course
    column: Array  # (rows,) c(t) g(v)
    size: float  # [N m] by which it changes friction
    residual: Array  # (rows,) [N m]


def _best(kind: str, form: str, stretches: Sequence[Stretch], y: Array, known: Array, curve: Array, basis: Array,
          speed: Array, trends: Sequence[Course], config: DriftConfig) -> _Found:
    """The course of this kind and form that leaves least.

    The curve that changes as a whole is itself fitted: scan, fit, scan again.
    """
    left = y - basis @ (basis.T @ y)
    shape = speed if form == "viscous" else np.sign(speed)
    beta = _least(known, y)
    for _ in range(_ROUNDS if form == "whole" else 1):
        if form == "whole":
            shape = curve @ beta[known.shape[1] - curve.shape[1]:known.shape[1]]
        if kind == "step":
            course = _step(stretches, form, shape, basis, left, config)
        else:
            course = max((one for one in trends if one.form == form),
                         key=lambda one: _gain(_outside(one, stretches, shape, basis), left))
        own = np.concatenate([course.at(part, stretch.middle[2]) for part, stretch in enumerate(stretches)]) * shape
        columns = np.column_stack([known, own])
        beta = _least(columns, y)
    size = abs(float(beta[-1])) * float(np.median(np.abs(shape)))
    return _Found(course, own, size, y - columns @ beta)


def _least(columns: Array, y: Array) -> Array:
    """Least squares over columns of unit length."""
    scale = np.linalg.norm(columns, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    return np.asarray(np.linalg.lstsq(columns / scale, y, rcond=_RANK)[0] / scale)


def _outside(course: Course, stretches: Sequence[Stretch], shape: Array, basis: Array) -> Array:
    """c(t) g(v) (rows, 1), without what all else could take of it."""
    value = np.concatenate([course.at(part, stretch.middle[2]) for part, stretch in enumerate(stretches)])
    columns = (value * shape)[:, None]
    return np.asarray(columns - basis @ (basis.T @ columns))


def _gain(column: Array, left: Array) -> float:
    """Return by how much a column (rows, 1) lowers the sum of squares."""
    return float(np.square(column[:, 0] @ left) / max(float(np.square(column).sum()), 1e-300))


def orthonormal(columns: Array) -> Array:
    """Orthonormal columns of the same space."""
    scale = np.linalg.norm(columns, axis=0)
    left, size, _ = np.linalg.svd(columns[:, scale > 0.0] / scale[scale > 0.0], full_matrices=False)
    return np.asarray(left[:, size > _RANK * size.max(initial=0.0)])


def _held_out(basis: Array, y: Array, blocks: Index) -> Array:
    """Sum of squares of every block as the other blocks predict it (blocks,)."""
    rest = held_out(basis, y - basis @ (basis.T @ y), blocks)
    return np.asarray(np.maximum(np.bincount(blocks, np.square(rest)), 1e-300))


def _trends(stretches: Sequence[Stretch], config: DriftConfig) -> list[Course]:
    starts = tuple(float(stretch.t[0]) for stretch in stretches)
    duration = max(float(stretch.t[-1] - stretch.t[0]) for stretch in stretches)
    return [Course("trend", form, starts, share * duration, 0.5 * duration, duration) for share in config.times for form in _FORMS]


def _step(stretches: Sequence[Stretch], form: str, shape: Array, basis: Array, left: Array,
          config: DriftConfig) -> Course:
    """The course of a step at the instant between two rows from which it explains most."""
    t = np.concatenate([stretch.middle[2] for stretch in stretches])
    log = np.repeat(np.arange(len(stretches)), [stretch.rows for stretch in stretches])
    row = step_row(shape, basis, left, config)
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
