"""Find the rows in which the joint slides, and whether its friction drifts.

A joint at rest, or one that has turned back and bends its contacts, carries any torque up to the
break-away torque: an inequality |τ - load| ≤ τ_b, not a value of the sliding law (Karnopp 1985;
Armstrong-Hélouvry et al. 1994, Section 2). Each row is ordered by its *travel*: how far the joint
has moved one way since its last rest or reversal, and how far it will until the next, the lesser of
the two. A rest is a speed that its own standard deviation does not tell from zero, so that the
encoder decides. From the longest travel down, a further class of travel is taken in as long as a
free curve

    τ̄ = J (dq(b) - dq(a))/T + gravity + f(v),    f piecewise straight over classes of speed

leaves no more of it than of the first rows, or no more than a law is good for. No law is assumed.

Friction that drifts is τ_f(v, t) = f(v) (1 + α c(t)), c(t) a trend 1 - exp(-(t - t0)/T) that begins
anew in every log, as a joint warms up. It is fitted to rows that slide, with the same free curve:
what a curve can hold is no drift. It must predict blocks of time that were held out better than no
change does: logarithms of the ratio of their squared errors, in closed form by leverage, against
draws of their signs (estimation/bootstrap.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.dynamics.body import Array
from pipelines.estimation.bootstrap import by_flips
from pipelines.estimation.varpro import Linear, held_out
from pipelines.friction.config import FRICTION
from pipelines.friction.fit import Equations
from pipelines.friction.laws import OneJoint
from pipelines.friction.weak_form import Course, Mask, Stretch, blocks_of_time

__all__ = ["Sliding", "drift_of", "left_out", "sliding_rows"]

RANK = 1e-7  # numerics: singular values of unit columns below it: two columns that are one
FINE = 1e-2  # numerics: of the logarithm of a time constant
NEAR = 1e-4  # numerics: relative step of a derivative by a time constant


@dataclass(frozen=True, eq=False)
class Sliding:
    """Rows that slide, of stretches one after the other."""

    slides: Mask  # (rows,)
    resting: Mask  # (rows,) at rest throughout
    distance: float  # [rad] of travel from which rows slide
    attenuation: float  # noise over acceleration (variances), outside all other columns


def sliding_rows(stretches: Sequence[Stretch], joint: OneJoint) -> Sliding:
    """Order rows by travel and take them in while friction is a slowly varying curve of speed."""
    equations = Equations(stretches, joint)
    parts = zip(*(_travel(stretch) for stretch in stretches), strict=True)
    travel, rests = (np.concatenate(each) for each in parts)
    speed = np.concatenate([stretch.middle[0] for stretch in stretches])
    y, rigid = equations.y, equations.fixed.shape[1]
    steady = np.hstack([equations.fixed, _free_curve(speed)])
    columns = np.hstack([steady, _free_course(speed)])
    moving = travel > 0.0
    if not moving.any():
        return Sliding(moving, rests, 0.0, np.inf)
    reach = start = float(np.median(travel[moving]))
    slides = travel >= reach
    while slides.sum() < min(
        FRICTION.rows * np.any(columns[slides] != 0.0, axis=0).sum(), moving.sum()
    ):
        reach = start = reach / FRICTION.halving
        slides = moving & (travel >= reach)
    used = np.any(columns[slides] != 0.0, axis=0).sum() / slides.sum()
    square = np.square(_fitted(columns[slides], y[slides]).residual)
    # The noise stays: rows that fit a little worse, taken in, would let in what fits worse again.
    noise = float(np.median(square) / max(1.0 - used, 1.0 / slides.sum()))
    while reach > 0.0:
        lower = reach / FRICTION.halving if (moving & (travel < reach)).any() else 0.0
        wider = moving & (travel >= lower)
        more = (wider & ~slides)[wider]
        if more.any():
            fit = _fitted(columns[wider], y[wider])
            friction = np.square(fit.columns[:, rigid:] @ fit.beta[rigid:])
            most = max(FRICTION.worse * noise, FRICTION.good**2 * float(np.median(friction)))
            if np.median(np.square(fit.residual[more])) > most:
                break
            slides = wider
        reach = lower
    reach = min(FRICTION.margin * reach, start)
    slides &= travel >= reach
    return Sliding(slides, rests, reach, _attenuation(stretches, steady[slides], slides))


def left_out(stretches: Sequence[Stretch], slides: Mask) -> tuple[Stretch, ...]:
    """Return the stretches without those of their usable rows that do not slide."""
    parts = np.split(slides, np.cumsum([stretch.usable.sum() for stretch in stretches])[:-1])
    return tuple(stretch.only(part) for stretch, part in zip(stretches, parts, strict=True))


def _travel(stretch: Stretch) -> tuple[Array, Mask]:
    """Return the least travel in each row [rad], and whether the joint rests throughout (rows,).

    Travel is zero where the joint rests or turns back.
    """
    side = np.sign(stretch.dq)
    rests = np.abs(stretch.dq) <= FRICTION.rest * stretch.speed_std
    path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(stretch.q)))])
    turns = np.concatenate([[True], side[1:] != side[:-1]])
    since = path - np.maximum.accumulate(np.where(rests | turns, path, -np.inf))
    until = np.where(rests | np.append(turns[1:], True), path, np.inf)
    travel = np.minimum(since, np.minimum.accumulate(until[::-1])[::-1] - path)
    edges, windows = stretch.edges, len(stretch.edges) - 1
    least = np.minimum(np.minimum.reduceat(travel, edges)[:windows], travel[edges[1:]])
    throughout = np.logical_and.reduceat(rests, edges)[:windows]
    return least[stretch.kept], throughout[stretch.kept]


def _free_curve(speed: Array) -> Array:
    """Return columns of a curve that runs straight in every class of speed, each way apart."""
    fastest = max(float(np.abs(speed).max()), 1e-12)
    size = np.maximum(np.abs(speed) / fastest, 1e-12)
    level = np.floor(FRICTION.classes * np.log10(size) + 1e-9)
    code = 2 * np.maximum(level, -FRICTION.classes * FRICTION.slowest) + (speed < 0.0)
    columns = []
    for here in (code == each for each in np.unique(code)):
        columns += [here.astype(np.float64), np.where(here, speed - speed[here].mean(), 0.0)]
    return np.stack(columns, axis=1)


def _free_course(speed: Array) -> Array:
    """Return columns of Coulomb and viscous friction that may change in time.

    Hat functions over the rows, in their order.
    """
    place = np.linspace(0.0, FRICTION.course - 1.0, len(speed))
    hats = np.maximum(1.0 - np.abs(place[:, None] - np.arange(1, FRICTION.course)), 0.0)
    return np.hstack([hats * np.sign(speed)[:, None], hats * speed[:, None]])


def _fitted(columns: Array, y: Array) -> Linear:
    """Fit y (rows,) by columns (rows, columns) of which some may be one."""
    scale = np.linalg.norm(columns, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    left, size, right = np.linalg.svd(columns / scale, full_matrices=False)
    kept = size > RANK * size.max(initial=0.0)
    basis, root = left[:, kept], right[kept].T / size[kept] / scale[:, None]
    projected = basis.T @ y
    return Linear(columns, root @ projected, y - basis @ projected, root)


def _attenuation(stretches: Sequence[Stretch], columns: Array, slides: Mask) -> float:
    """Return the noise variance of (dq(b) - dq(a))/T over that of what no other column holds.

    Errors in variables: least squares takes J (1 - that share) for J (Fuller 1987, Section 1.1.1).
    """
    each = [2.0 * (one.speed_std / one.length[one.kept]) ** 2 for one in stretches]
    outside = _fitted(columns[:, 1:], columns[:, 0]).residual
    return float(np.concatenate(each)[slides].sum()) / max(float(outside @ outside), 1e-300)


def drift_of(stretches: Sequence[Stretch], joint: OneJoint) -> Course | None:
    """Return the trend of friction in time that rows show, or None.

    The curve that changes is itself fitted: scan, fit, scan again.

    Args:
        stretches: they slide.
    """
    equations = Equations(stretches, joint)
    y, speed = equations.y, np.concatenate([stretch.middle[0] for stretch in stretches])
    since = np.concatenate([stretch.middle[1] for stretch in stretches])
    duration = max(float(stretch.t[-1] - stretch.t[0]) for stretch in stretches)
    blocks, curve = blocks_of_time(stretches, FRICTION.block), _free_curve(speed)
    steady = _fitted(np.hstack([equations.fixed, curve]), y)
    few = len(y) < FRICTION.rows * steady.root.shape[1]
    if few or blocks.max() + 1 < FRICTION.few_blocks:
        return None
    place = slice(equations.fixed.shape[1], steady.columns.shape[1])
    fit = steady
    for _ in range(FRICTION.rounds):
        shape = curve @ fit.beta[place]
        course = _trend(steady, shape, since, duration)
        fit = _fitted(np.column_stack([steady.columns, course.at(since) * shape]), y)

    def rest(of: Linear) -> Array:
        return held_out(of.columns @ of.root, of.residual, blocks)

    def squares(of: Linear) -> Array:
        return np.maximum(np.bincount(blocks, np.square(rest(of))), 1e-300)

    change = abs(float(fit.beta[-1])) * float(np.median(np.abs(shape)))
    least = FRICTION.least * float(np.median(np.abs(curve @ fit.beta[place])))
    gains = np.log(squares(steady) / squares(fit))
    if change < least or by_flips(gains) > FRICTION.chance:
        return None
    # The deviation of T to first order, f as it was fitted. Blocks of time enter with the residual
    # that the others leave of them: CR3, the jackknife over blocks (Bell & McCaffrey 2002, p. 169).
    longer = replace(course, time=(1.0 + NEAR) * course.time)
    slope = (longer.at(since) - course.at(since)) / (NEAR * course.time)
    outside = fit.beside(float(fit.beta[-1]) * slope * shape)
    left = rest(_fitted(np.column_stack([fit.columns, outside]), y))
    std = float(np.linalg.norm(np.bincount(blocks, outside * left)) / (outside @ outside))
    return replace(course, time_std=std)


def _trend(steady: Linear, shape: Array, since: Array, duration: float) -> Course:
    """Return the trend with the time constant by which it explains most of the residual."""
    from scipy.optimize import minimize_scalar

    def course(logarithm: float) -> Course:
        return Course(float(np.exp(logarithm)) * duration, 0.5 * duration, duration)

    def loss(logarithm: float) -> float:
        outside = steady.beside(course(logarithm).at(since) * shape)
        gain = np.square(outside @ steady.residual)
        return -float(gain / max(float(outside @ outside), 1e-300))

    times = np.log(FRICTION.times)
    k = int(np.argmin([loss(time) for time in times]))
    bounds = float(times[max(k - 1, 0)]), float(times[min(k + 1, len(times) - 1)])
    options = {"xatol": FINE}  # Brent 1973
    found = minimize_scalar(loss, bounds=bounds, method="bounded", options=options)
    return course(float(found.x))
