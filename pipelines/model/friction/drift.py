"""Friction that changes in time: whether it does, along which course, and by how much.

    τ_f(v, t) = f(v) + α c(t) g(v),    g = f, v or sign v

c(t) is a trend 1 - exp(-(t - t0)/T) that begins anew in every log, as a joint warms up, or a step at one instant. Both are tried
on rows that slide, beside inertia, gravity and a free curve of friction (sliding.py), so that no law is assumed and what
a curve can hold is no drift. The course that leaves least must predict blocks of time that were held out better than no change
does: logarithms of the ratio of their squared errors, in closed form by leverage, against draws of their signs
(fit/flips.py). A course that costs a number and gains nothing loses there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.fit.flips import by_flips
from pipelines.model.friction.weak_form import Course, Stretch
from pipelines.model.rigid.body import Array

__all__ = ["DriftConfig", "drift_of"]

_FORMS = ("whole", "viscous", "coulomb")
_PULLED = 1e-3  # the least that 1 - leverage may be
_RANK = 1e-7  # singular values of unit columns below it: two columns that are one


@dataclass(frozen=True)
class DriftConfig:
    """Numbers that decide whether friction drifts."""

    chance: float = 1e-3  # that a joint without drift gains as much in blocks held out: none in a hundred joints
    block: float = 1.0  # [s] of rows whose errors may depend on one another
    fewest: int = 12  # blocks: fewer give no covariance of two numbers to rely on
    rows: int = 3  # for every column beside the drift: fewer leave no residual to judge by
    steps: int = 40  # instants of a step that are tried
    ends: float = 0.08  # of all rows, that lie before and after a step
    times: tuple[float, ...] = (0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0, 1.5, 5.0)  # over the duration; 5: straight
    least: float = 0.03  # of friction: a smaller change is within what a law is good for


def drift_of(stretches: Sequence[Stretch], y: Array, known: Array, config: DriftConfig) -> Course | None:
    """The course of friction that rows show beyond chance; None where they show none.

    Args:
        stretches: whose rows these are; they slide.
        y: (rows,) mean torque [N m].
        known: (rows, columns) of all that is beside the drift: inertia, gravity, and a curve of friction, free or fitted.
    """
    speed, t = (np.concatenate([stretch.middle[k] for stretch in stretches]) for k in (1, 2))
    log = np.repeat(np.arange(len(stretches)), [stretch.rows for stretch in stretches])
    basis = _basis(known)
    left = y - basis @ (basis.T @ y)
    blocks = _blocks(t, log, config.block)
    if blocks.max() + 1 < config.fewest or len(y) < config.rows * basis.shape[1]:
        return None
    side = np.stack([np.sign(speed), speed], axis=1)
    level = np.linalg.lstsq(side, y, rcond=None)[0]
    shapes = {"whole": side @ level, "viscous": speed, "coulomb": np.sign(speed)}
    courses = [*_trends(stretches, config), *_steps(stretches, t, log, config)]
    columns = [_outside(course, stretches, shapes[course.form], basis) for course in courses]
    rests = [_rest(one, left) for one in columns]
    best = int(np.argmin(rests))
    own = columns[best]
    gains = np.log(_held_out(basis, y, blocks) / _held_out(np.hstack([basis, _basis(own)]), y, blocks))
    change = np.linalg.lstsq(own, left, rcond=_RANK)[0]
    size = abs(courses[best].whole) * float(np.median(np.abs(shapes[courses[best].form] * change)))
    large = size >= config.least * float(np.median(np.abs(shapes["whole"])))
    return courses[best] if large and by_flips(gains) <= config.chance else None


def _outside(course: Course, stretches: Sequence[Stretch], shape: Array, basis: Array) -> Array:
    """c(t) g(v) (rows, 1), without what all else could take of it."""
    value = np.concatenate([course.at(part, stretch.middle[2]) for part, stretch in enumerate(stretches)])
    columns = (value * shape)[:, None]
    return np.asarray(columns - basis @ (basis.T @ columns))


def _rest(columns: Array, left: Array) -> float:
    """Sum of squares that is left."""
    own = _basis(columns)
    return float(left @ left - np.square(own.T @ left).sum())


def _basis(columns: Array) -> Array:
    """Orthonormal columns of the same space."""
    scale = np.linalg.norm(columns, axis=0)
    left, size, _ = np.linalg.svd(columns[:, scale > 0.0] / scale[scale > 0.0], full_matrices=False)
    return np.asarray(left[:, size > _RANK * size.max(initial=0.0)])


def _blocks(t: Array, log: Array, length: float) -> Array:
    """Number of the block of time of every row (rows,)."""
    code = log * 10**7 + np.floor(t / length).astype(np.intp)
    return np.unique(code, return_inverse=True)[1]


def _held_out(basis: Array, y: Array, blocks: Array) -> Array:
    """Sum of squares of every block as the other blocks predict it (blocks,): e_b = (I - H_bb)⁻¹ r_b, H over `basis`."""
    rest, found = y - basis @ (basis.T @ y), []
    for block in range(int(blocks.max()) + 1):
        own, here = basis[blocks == block], rest[blocks == block]
        values, vectors = np.linalg.eigh(own.T @ own)
        push = (vectors.T @ (own.T @ here)) / np.maximum(1.0 - values, _PULLED)
        found.append(float(np.sum(np.square(here + own @ (vectors @ push)))))
    return np.maximum(np.array(found), 1e-300)


def _trends(stretches: Sequence[Stretch], config: DriftConfig) -> list[Course]:
    starts = tuple(float(stretch.t[0]) for stretch in stretches)
    duration = max(float(stretch.t[-1] - stretch.t[0]) for stretch in stretches)
    return [Course("trend", form, starts, share * duration, 0.5 * duration, duration) for share in config.times for form in _FORMS]


def _steps(stretches: Sequence[Stretch], t: Array, log: Array, config: DriftConfig) -> list[Course]:
    """Steps between rows; a step lasts until the end of the last log."""
    starts = tuple(float(stretch.t[0]) for stretch in stretches)
    rows = np.unique(np.linspace(config.ends * len(t), (1.0 - config.ends) * (len(t) - 1), config.steps).astype(np.intp))
    since = [float(t[row] - starts[log[row]]) for row in rows]
    return [Course("step", form, starts, when, 0.0, when, int(log[row]))
            for row, when in zip(rows, since, strict=True) for form in _FORMS]
