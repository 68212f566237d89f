"""Friction that changes in time: whether it does, along which course, and by how much.

    τ_f(v, t) = f(v) + c(t) (α f(v) + β v)

c(t) is a trend 1 - exp(-(t - t0)/T) that begins anew in every log, as a joint warms up, or a step at one instant. Both are tried
on rows that slide, beside inertia, gravity and a smooth curve of friction, each way apart, so that no law is assumed and
what a curve can hold is no drift. The test of no change is that of Wald with a covariance of blocks of time (Liang & Zeger 1986;
small numbers of blocks by F, Bell & McCaffrey 2002), at one family-wise error for all courses (Bonferroni).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from pipelines.model.friction.weak_form import Course, Stretch
from pipelines.model.rigid.body import Array

__all__ = ["DriftConfig", "drift_of", "smooth_curve"]

_PULLED = 1e-3  # the least that 1 - leverage may be
_RANK = 1e-7  # singular values of unit columns below it: two columns that are one


@dataclass(frozen=True)
class DriftConfig:
    """Numbers that decide whether friction drifts."""

    error: float = 1e-3  # family-wise, of all courses of a joint: none in a hundred healthy joints, with room for their number
    block: float = 1.0  # [s] of rows whose errors may depend on one another
    fewest: int = 12  # blocks: fewer give no covariance of two numbers to rely on
    humps: tuple[float, ...] = (0.03, 0.1, 0.3)  # of the fastest speed, widths of what falls from standstill
    rows: int = 3  # for every column beside the drift: fewer leave no residual to judge by
    steps: int = 40  # instants of a step that are tried
    ends: float = 0.08  # of all rows, that lie before and after a step
    times: tuple[float, ...] = (0.1, 0.15, 0.25, 0.4, 0.6, 1.0, 1.6, 5.0)  # time constants of a trend over the duration; 5: straight
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
    friction = np.stack([np.sign(speed), speed], axis=1)
    courses = [*_trends(stretches, config), *_steps(stretches, t, log, config)]
    columns = [_outside(course, stretches, friction, basis) for course in courses]
    rests = [_rest(one, left) for one in columns]
    best = int(np.argmin(rests))
    chance, change = _wald(columns[best], left, basis, blocks)
    level = float(np.median(np.abs(friction @ np.linalg.lstsq(friction, y, rcond=None)[0])))
    size = abs(courses[best].whole) * float(np.median(np.abs(friction @ change)))
    sure = chance * len(courses) <= config.error
    return courses[best] if sure and size >= config.least * level else None


def smooth_curve(speed: Array, config: DriftConfig) -> Array:
    """Columns of any smooth curve of friction, each way apart (rows, columns): 1, |v|, v², and humps exp(-(v/v_s)²)."""
    share = np.abs(speed) / max(float(np.abs(speed).max()), 1e-12)
    parts = [np.ones_like(share), share, share**2, *(np.exp(-((share / width) ** 2)) for width in config.humps)]
    return np.stack([part * side for side in (speed > 0.0, speed <= 0.0) for part in parts], axis=1)


def _outside(course: Course, stretches: Sequence[Stretch], friction: Array, basis: Array) -> Array:
    """c(t) by Coulomb and viscous friction (rows, 2), without what all else could take of it."""
    value = np.concatenate([course.at(part, stretch.middle[2]) for part, stretch in enumerate(stretches)])
    columns = value[:, None] * friction
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


def _wald(columns: Array, left: Array, basis: Array, blocks: Array) -> tuple[float, Array]:
    """Chance of as large a change without any, and the change (2,).

    Each block enters with what it leaves when it is left out, (I - H_bb)⁻¹ e_b, H over all columns: CR3 of Bell & McCaffrey
    2002, Survey Methodology 28, p. 169. The freedom is that of as many blocks as share the evidence
    evenly, (Σ i_b)²/Σ i_b²: a change that few blocks show is not sure, however little these leave.
    """
    count, size = int(blocks.max()) + 1, columns.shape[1]
    bread = np.linalg.pinv(columns.T @ columns, rcond=_RANK**2, hermitian=True)
    change = bread @ (columns.T @ left)
    rest = left - columns @ change
    whole = np.hstack([basis, _basis(columns)])
    meat, shares = np.zeros((size, size)), np.zeros(count)
    for block in range(count):
        here = blocks == block
        values, vectors = np.linalg.eigh(whole[here].T @ whole[here])
        pulled = np.maximum(1.0 - values, _PULLED)
        alone = rest[here] + whole[here] @ (vectors @ ((vectors.T @ (whole[here].T @ rest[here])) / pulled))
        score = columns[here].T @ alone
        meat += np.outer(score, score)
        shares[block] = float(np.sum((columns[here] @ bread) * columns[here]))
    covariance = bread @ meat @ bread
    statistic = float(change @ np.linalg.pinv(covariance, rcond=_RANK**2, hermitian=True) @ change)
    freedom = max(float(shares.sum() ** 2 / max(float(shares @ shares), 1e-300)) - size, 1.0)
    return float(stats.f.sf(statistic * freedom / (size * (freedom + size - 1.0)), size, freedom)), change


def _trends(stretches: Sequence[Stretch], config: DriftConfig) -> list[Course]:
    starts = tuple(float(stretch.t[0]) for stretch in stretches)
    duration = max(float(stretch.t[-1] - stretch.t[0]) for stretch in stretches)
    return [Course("trend", starts, share * duration, 0.5 * duration, duration) for share in config.times]


def _steps(stretches: Sequence[Stretch], t: Array, log: Array, config: DriftConfig) -> list[Course]:
    """Steps between rows; a step lasts until the end of the last log."""
    starts = tuple(float(stretch.t[0]) for stretch in stretches)
    rows = np.unique(np.linspace(config.ends * len(t), (1.0 - config.ends) * (len(t) - 1), config.steps).astype(np.intp))
    return [Course("step", starts, float(t[row] - starts[log[row]]), 0.0, float(t[row] - starts[log[row]]), int(log[row]))
            for row in rows]
