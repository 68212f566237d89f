"""Find the rows in which the joint slides: where friction is a function of its speed.

A joint at rest, or one that has turned back and bends its contacts, carries any torque up to the break-away torque: an
inequality |τ - load| ≤ τ_b, not a value of the sliding law (Karnopp 1985; Armstrong-Hélouvry et al. 1994, Section 2). Each row
is ordered by its *travel*: how far the joint has moved one way since its last rest or reversal, and how far it will until
the next, the lesser of the two. A rest is a speed that its own standard deviation does not tell from zero, so that the
encoder decides. From the longest travel down, a further class of travel is taken in as long as a free curve

    τ̄ = J (dq(b) - dq(a))/T + gravity + f(v),    f piecewise straight over classes of speed, each way apart

leaves no more of it than of the first rows, or no more than a law is good for; f may change slowly in time, or at an instant
that explains a class which does
not follow otherwise. No law is assumed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.model.friction.drift import DriftConfig, orthonormal, step_row
from pipelines.model.friction.equations import LawEquations
from pipelines.model.friction.one_joint import OneJoint
from pipelines.model.friction.weak_form import Stretch
from pipelines.model.rigid.body import Array

__all__ = ["Sliding", "SlidingConfig", "free_curve", "left_out", "sliding_rows"]

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class SlidingConfig:
    """Numbers that decide which rows slide; judged on seeds never seen before by benchmarks.friction_nuisances."""

    rest: float = 3.0  # standard deviations: a slower speed may be zero (two-sided .003)
    worse: float = 4.0  # median square of a class over that of the first rows: 3 std of the logarithm of the median square of
    # 25 normal errors, exp(3 · 2.34/√25) (Kendall & Stuart 1977, eq. 10.29)
    good: float = 0.03  # of friction: what a law is good for (DriftConfig.least); with `margin`, its fourth power, 1e-6, remains
    rows: int = 3  # for every column of the free curve, that the first class has at least
    margin: float = 4.0  # times the travel from which rows follow the curve: bristles straighten as exp(-travel) (Dahl 1968), 2 %
    classes: int = 5  # of speed, a decade: friction runs straight over a factor of 1.6
    decades: int = 4  # of speed; slower rows are one class
    course: int = 8  # knots of a change of friction in time: what drifts still is a function of speed
    halving: float = 2.0  # of travel, from class to class
    windows: tuple[float, ...] = (1.0, 2.0, 4.0, 8.0, 16.0)  # times the shortest, tried in turn
    attenuation: float = 2e-3  # noise variance of the acceleration over its own: the relative bias of the inertia


@dataclass(frozen=True, eq=False)
class Sliding:
    """Rows that slide, of stretches one after the other."""

    slides: Mask  # (rows,)
    resting: Mask  # (rows,) at rest throughout
    travel: Array  # (rows,) [rad] since the last rest or reversal, or until the next
    distance: float  # [rad] of travel from which rows slide
    attenuation: float  # noise of the acceleration over acceleration (variance), outside all other columns


def sliding_rows(stretches: Sequence[Stretch], joint: OneJoint, config: SlidingConfig) -> Sliding:
    """Order rows by travel and take them in while friction is a function of speed."""
    equations = LawEquations.of(stretches, joint)
    travel, rests = (np.concatenate([of(stretch, config)[stretch.kept] for stretch in stretches]) for of in (_travel, _rests))
    speed = np.concatenate([stretch.middle[1] for stretch in stretches])
    rigid, steady = equations.fixed.shape[1], np.hstack([equations.fixed, free_curve(speed, config)])
    columns = np.hstack([steady, _free_course(speed, config)])
    moving = travel > 0.0
    if not moving.any():
        return Sliding(moving, rests, travel, 0.0, np.inf)
    reach = start = float(np.median(travel[moving]))
    slides = travel >= reach
    while slides.sum() < min(config.rows * np.any(columns[slides] != 0.0, axis=0).sum(), moving.sum()):
        reach = start = reach / config.halving
        slides = moving & (travel >= reach)
    noise = _noise(columns[slides], equations.y[slides])
    while reach > 0.0:
        lower = reach / config.halving if (moving & (travel < reach)).any() else 0.0
        wider = moving & (travel >= lower)
        more = wider & ~slides
        if more.any():
            if not _follows(columns[wider], rigid, equations.y[wider], more[wider], noise, config):
                columns = np.hstack([columns, _step(columns, equations.y, speed, wider)])
                if not _follows(columns[wider], rigid, equations.y[wider], more[wider], noise, config):
                    break
            slides = wider
        reach = lower
    reach = min(config.margin * reach, start)
    slides &= travel >= reach
    return Sliding(slides, rests, travel, reach,
                   _attenuation(stretches, steady[slides], slides, len(equations.postures)))


def _noise(columns: Array, y: Array) -> float:
    """Return the median square [N² m²] that least squares leaves, over the share of its degrees of freedom."""
    used = np.any(columns != 0.0, axis=0).sum() / len(y)
    return float(np.median(np.square(_least_squares(columns, y)[1])) / max(1.0 - used, 1.0 / len(y)))


def _follows(columns: Array, rigid: int, y: Array, more: Mask, noise: float, config: SlidingConfig) -> bool:
    """Return whether least squares fits `more` of the rows to within their `noise`, or as well as any law does.

    Args:
        columns: (rows, columns) the first `rigid` of them are no friction.
        noise: [N² m²] median square of the rows with the longest travel. It stays: rows that fit a little worse, taken in,
            would let in what fits worse again.
    """
    beta, residual = _least_squares(columns, y)
    friction = np.square(columns[:, rigid:] @ beta[rigid:])
    most = max(config.worse * noise, config.good**2 * float(np.median(friction)))
    return float(np.median(np.square(residual[more]))) <= most


def _step(columns: Array, y: Array, speed: Array, rows: Mask) -> Array:
    """Columns of Coulomb and viscous friction from the row on that explains most of `rows` (all rows, 2)."""
    basis = orthonormal(columns[rows])
    left = y[rows] - basis @ (basis.T @ y[rows])
    first = np.flatnonzero(rows)[step_row(np.sign(speed[rows]), basis, left, DriftConfig())]
    return np.where(np.arange(len(y))[:, None] >= first, np.stack([np.sign(speed), speed], axis=1), 0.0)


def left_out(stretches: Sequence[Stretch], slides: Mask) -> tuple[Stretch, ...]:
    """The stretches without those of their usable rows that do not slide."""
    parts = np.split(slides, np.cumsum([stretch.usable.sum() for stretch in stretches])[:-1])
    return tuple(stretch.only(part) for stretch, part in zip(stretches, parts, strict=True))


def _travel(stretch: Stretch, config: SlidingConfig) -> Array:
    """(windows,) the least travel within each window; zero where the joint rests or turns back."""
    side = np.sign(stretch.dq)
    rests = np.abs(stretch.dq) <= config.rest * stretch.speed_std
    path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(stretch.q)))])
    turns = np.concatenate([[True], side[1:] != side[:-1]])
    since = path - np.maximum.accumulate(np.where(rests | turns, path, -np.inf))
    until = np.where(rests | np.append(turns[1:], True), path, np.inf)
    travel = np.minimum(since, np.minimum.accumulate(until[::-1])[::-1] - path)
    edges = stretch.edges
    within = np.minimum.reduceat(travel, edges)[:len(edges) - 1]
    return np.asarray(np.minimum(within, travel[edges[1:]]))


def _rests(stretch: Stretch, config: SlidingConfig) -> Mask:
    """Return a mask (windows,): the speed does not differ from zero throughout."""
    moves = np.abs(stretch.dq) > config.rest * stretch.speed_std
    return ~np.logical_or.reduceat(moves, stretch.edges)[:len(stretch.edges) - 1]


def free_curve(speed: Array, config: SlidingConfig) -> Array:
    """Columns of a curve that runs straight in every class of speed, each way apart (rows, columns)."""
    fastest = max(float(np.abs(speed).max()), 1e-12)
    lowest = -config.classes * config.decades
    level = np.floor(config.classes * np.log10(np.maximum(np.abs(speed) / fastest, 1e-12)) + 1e-9)
    code = 2 * np.maximum(level, lowest) + (speed < 0.0)
    columns = []
    for one in np.unique(code):
        here = code == one
        columns += [here.astype(np.float64), np.where(here, speed - speed[here].mean(), 0.0)]
    return np.stack(columns, axis=1)


def _free_course(speed: Array, config: SlidingConfig) -> Array:
    """Columns of Coulomb and viscous friction that may change in time: hat functions over the rows, in their order."""
    place = np.linspace(0.0, config.course - 1.0, len(speed))
    hats = np.maximum(1.0 - np.abs(place[:, None] - np.arange(1, config.course)), 0.0)
    return np.hstack([hats * np.sign(speed)[:, None], hats * speed[:, None]])


def _least_squares(columns: Array, y: Array) -> tuple[Array, Array]:
    """Return coefficients (columns,) and residual (rows,)."""
    scale = np.linalg.norm(columns, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    beta = np.asarray(np.linalg.lstsq(columns / scale, y, rcond=1e-9)[0] / scale)
    return beta, y - columns @ beta


def _attenuation(stretches: Sequence[Stretch], columns: Array, slides: Mask, postures: int) -> float:
    """Variance of the noise of (dq(b) - dq(a))/T over what of that column lies outside the others.

    Errors in variables: least squares takes J (1 - that share) for J (Fuller 1987, Section 1.1.1).
    """
    noise = np.concatenate([np.broadcast_to(2.0 * (stretch.speed_std / stretch.length[stretch.kept]) ** 2, stretch.rows)
                            for stretch in stretches])[slides]
    width = stretches[0].rigid.shape[1]
    shares = []
    for k in range(postures):
        own = columns[:, width * k]
        others = np.delete(columns, width * k, axis=1)
        outside = _least_squares(others, own)[1]
        shares.append(float(noise[own != 0.0].sum()) / max(float(outside @ outside), 1e-300))
    return max(shares)
