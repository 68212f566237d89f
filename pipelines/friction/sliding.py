"""Find the rows in which the joint slides, and whether its friction changes in time.

A joint at rest, or one that has turned back and bends its contacts, carries any torque up to the
break-away torque: an inequality |τ - load| ≤ τ_b, not a value of the sliding law (Karnopp 1985;
Armstrong-Hélouvry et al. 1994, Section 2). Each row is ordered by its *travel*: how far the joint
has moved one way since its last rest or reversal, and how far it will until the next, the lesser of
the two. A rest is a speed that its own standard deviation does not tell from zero, so that the
encoder decides. From the longest travel down, a further class of travel is taken in as long as a
free curve

    τ̄ = J (dq(b) - dq(a))/T + gravity + f(v),    f piecewise straight over classes of speed

leaves no more of it than of the first rows, or no more than a law is good for. No law is assumed.

Friction that changes in time is τ_f(v, t) = f(v) + α c(t) g(v), with g = f, v or sign v. c(t) is a
trend 1 - exp(-(t - t0)/T) that begins anew in every log, as a joint warms up, or a step at one
instant. Both are tried on rows that slide, with the same free curve: what a curve can hold is no
drift. The course that leaves least must predict blocks of time that were held out better than no
change does: logarithms of the ratio of their squared errors, in closed form by leverage, against
draws of their signs (estimation/bootstrap.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Array
from pipelines.estimation.bootstrap import by_flips
from pipelines.estimation.varpro import Linear, held_out
from pipelines.friction.config import DriftConfig, SlidingConfig
from pipelines.friction.fit import LawEquations
from pipelines.friction.laws import OneJoint
from pipelines.friction.model_selection import no_worse
from pipelines.friction.weak_form import Course, Mask, Stretch, blocks_of_time

__all__ = ["Sliding", "drift_of", "left_out", "sliding_rows"]

RANK = 1e-7  # numerics: singular values of unit columns below it: two columns that are one
ALIKE = 1e-9  # numerics: relative, of sums of squares over all rows
FINE = 1e-2  # numerics: of the logarithm of a time constant
NEAR = 1e-4  # numerics: relative step of a derivative by a time constant


_CONFIG, _DRIFT = SlidingConfig(), DriftConfig()


@dataclass(frozen=True, eq=False)
class Sliding:
    """Rows that slide, of stretches one after the other."""

    slides: Mask  # (rows,)
    resting: Mask  # (rows,) at rest throughout
    distance: float  # [rad] of travel from which rows slide
    attenuation: float  # noise over acceleration (variances), outside all other columns


def sliding_rows(stretches: Sequence[Stretch], joint: OneJoint) -> Sliding:
    """Order rows by travel and take them in while friction is a function of speed.

    Friction may change slowly in time, or at an instant that explains a class which does not follow
    otherwise.
    """
    equations = LawEquations.of(stretches, joint)
    each = [_travel(stretch) for stretch in stretches]
    travel, rests = (np.concatenate(parts) for parts in zip(*each, strict=True))
    speed = np.concatenate([stretch.middle[1] for stretch in stretches])
    y, rigid = equations.y, equations.fixed.shape[1]
    steady = np.hstack([equations.fixed, _free_curve(speed)])
    columns = np.hstack([steady, _free_course(speed)])
    moving = travel > 0.0
    if not moving.any():
        return Sliding(moving, rests, 0.0, np.inf)
    reach = start = float(np.median(travel[moving]))
    slides = travel >= reach
    while slides.sum() < min(
        _CONFIG.rows * np.any(columns[slides] != 0.0, axis=0).sum(), moving.sum()
    ):
        reach = start = reach / _CONFIG.halving
        slides = moving & (travel >= reach)
    noise = _noise(columns[slides], y[slides])
    while reach > 0.0:
        lower = reach / _CONFIG.halving if (moving & (travel < reach)).any() else 0.0
        wider = moving & (travel >= lower)
        more = wider & ~slides
        if more.any():
            if not _follows(columns[wider], rigid, y[wider], more[wider], noise):
                columns = np.hstack([columns, _late_friction(columns, y, speed, wider)])
                if not _follows(columns[wider], rigid, y[wider], more[wider], noise):
                    break
            slides = wider
        reach = lower
    reach = min(_CONFIG.margin * reach, start)
    slides &= travel >= reach
    attenuation = _attenuation(stretches, steady[slides], slides, len(equations.postures))
    return Sliding(slides, rests, reach, attenuation)


def _noise(columns: Array, y: Array) -> float:
    """Return the median square that least squares leaves by degree of freedom [N² m²]."""
    used = np.any(columns != 0.0, axis=0).sum() / len(y)
    square = np.square(_fitted(columns, y).residual)
    return float(np.median(square) / max(1.0 - used, 1.0 / len(y)))


def _follows(columns: Array, rigid: int, y: Array, more: Mask, noise: float) -> bool:
    """Return whether least squares fits `more` of the rows to their noise, or as well as any law.

    Args:
        columns: (rows, columns) the first `rigid` of them are no friction.
        noise: [N² m²] median square of the rows with the longest travel. It stays: rows that fit a
            little worse, taken in, would let in what fits worse again.
    """
    fit = _fitted(columns, y)
    friction = np.square(columns[:, rigid:] @ fit.beta[rigid:])
    most = max(_CONFIG.worse * noise, _CONFIG.good**2 * float(np.median(friction)))
    return float(np.median(np.square(fit.residual[more]))) <= most


def _late_friction(columns: Array, y: Array, speed: Array, rows: Mask) -> Array:
    """Return Coulomb and viscous friction after the step that explains most of `rows`.

    The columns (all rows, 2) are zero before it.
    """
    row = _step_row(np.sign(speed[rows]), _fitted(columns[rows], y[rows]))
    first = np.flatnonzero(rows)[row]
    late = np.arange(len(y))[:, None] >= first
    return np.where(late, np.stack([np.sign(speed), speed], axis=1), 0.0)


def left_out(stretches: Sequence[Stretch], slides: Mask) -> tuple[Stretch, ...]:
    """Return the stretches without those of their usable rows that do not slide."""
    parts = np.split(slides, np.cumsum([stretch.usable.sum() for stretch in stretches])[:-1])
    return tuple(stretch.only(part) for stretch, part in zip(stretches, parts, strict=True))


def _travel(stretch: Stretch) -> tuple[Array, Mask]:
    """Return the least travel in each row [rad], and whether the joint rests throughout (rows,).

    Travel is zero where the joint rests or turns back.
    """
    side = np.sign(stretch.dq)
    rests = np.abs(stretch.dq) <= _CONFIG.rest * stretch.speed_std
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
    level = np.floor(_CONFIG.classes * np.log10(size) + 1e-9)
    code = 2 * np.maximum(level, -_CONFIG.classes * _CONFIG.decades) + (speed < 0.0)
    columns = []
    for here in (code == each for each in np.unique(code)):
        columns += [here.astype(np.float64), np.where(here, speed - speed[here].mean(), 0.0)]
    return np.stack(columns, axis=1)


def _free_course(speed: Array) -> Array:
    """Return columns of Coulomb and viscous friction that may change in time.

    Hat functions over the rows, in their order.
    """
    place = np.linspace(0.0, _CONFIG.course - 1.0, len(speed))
    hats = np.maximum(1.0 - np.abs(place[:, None] - np.arange(1, _CONFIG.course)), 0.0)
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


def _attenuation(
    stretches: Sequence[Stretch], columns: Array, slides: Mask, postures: int
) -> float:
    """Return the noise variance of (dq(b) - dq(a))/T over that of what no other column holds.

    Errors in variables: least squares takes J (1 - that share) for J (Fuller 1987, Section 1.1.1).
    """
    noise = np.concatenate(
        [2.0 * (stretch.speed_std / stretch.length[stretch.kept]) ** 2 for stretch in stretches]
    )[slides]
    width, shares = stretches[0].rigid.shape[1], []
    for k in range(postures):
        own, others = columns[:, width * k], np.delete(columns, width * k, axis=1)
        outside = _fitted(others, own).residual
        shares.append(float(noise[own != 0.0].sum()) / max(float(outside @ outside), 1e-300))
    return max(shares)


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows of stretches that slide, and all that is fitted with a drift."""

    stretches: Sequence[Stretch]
    speed: Array  # (rows,) [rad/s]
    curve: Array  # (rows, columns) of a free curve of friction
    steady: Linear  # without a drift; the last columns are those of the curve
    y: Array  # (rows,) [N m]
    blocks: npt.NDArray[np.intp]  # (rows,) of time

    def along(self, course: Course) -> Array:
        """Return c(t) of every row (rows,)."""
        return np.concatenate(
            [
                course.at(part, stretch.middle[2] - stretch.t[0])
                for part, stretch in enumerate(self.stretches)
            ]
        )

    def rest(self, fit: Linear) -> Array:
        """Return the residual of every block as the other blocks predict it (rows,)."""
        return held_out(fit.columns @ fit.root, fit.residual, self.blocks)

    def held_out(self, fit: Linear) -> Array:
        """Return Σ r² of that of every block (blocks,)."""
        squares = np.bincount(self.blocks, np.square(self.rest(fit)))
        return np.asarray(np.maximum(squares, 1e-300))


@dataclass(frozen=True, eq=False)
class _Drift:
    """The best course of one kind and form."""

    course: Course
    fit: Linear  # the last column is c(t) g(v)
    shape: Array  # (rows,) g(v)

    @property
    def size(self) -> float:
        """Return by how much it changes friction [N m]."""
        return abs(float(self.fit.beta[-1])) * float(np.median(np.abs(self.shape)))


def drift_of(stretches: Sequence[Stretch], joint: OneJoint) -> Course | None:
    """Return the course of friction in time that rows show, or None.

    Of several the first that is not measurably worse than the best: all friction by one share
    comes before a part of it, and a trend before a step. A course that costs a number and gains
    nothing loses in blocks held out. A step may lie between any two rows.

    Args:
        stretches: they slide.
    """
    equations = LawEquations.of(stretches, joint)
    speed = np.concatenate([stretch.middle[1] for stretch in stretches])
    curve = _free_curve(speed)
    rows = _Rows(
        stretches,
        speed,
        curve,
        _fitted(np.hstack([equations.fixed, curve]), equations.y),
        equations.y,
        blocks_of_time(stretches, _DRIFT.block),
    )
    few = len(speed) < _DRIFT.rows * rows.steady.root.shape[1]
    if few or rows.blocks.max() + 1 < _DRIFT.fewest:
        return None
    drifts = [
        _best(kind, form, rows)
        for form in ("whole", "coulomb", "viscous")
        for kind in ("trend", "step")
    ]
    best = min(drifts, key=lambda drift: float(drift.fit.residual @ drift.fit.residual))
    gains = np.log(rows.held_out(rows.steady) / rows.held_out(best.fit))
    whole = curve @ best.fit.beta[-1 - curve.shape[1] : -1]
    least = _DRIFT.least * float(np.median(np.abs(whole)))
    if best.size >= least and by_flips(gains) <= _DRIFT.chance:
        chosen = next(drift for drift in drifts if no_worse(drift.fit.residual, best.fit.residual))
        return replace(chosen.course, time_std=_time_std(chosen, rows))
    return None


def _best(kind: str, form: str, rows: _Rows) -> _Drift:
    """Return the course of this kind and form that leaves least.

    The curve that changes as a whole is itself fitted: scan, fit, scan again.
    """
    fit, shape = rows.steady, rows.speed if form == "viscous" else np.sign(rows.speed)
    width, last = rows.curve.shape[1], fit.columns.shape[1]
    for _ in range(_DRIFT.rounds if form == "whole" else 1):
        if form == "whole":
            shape = rows.curve @ fit.beta[last - width : last]
        course = (_step if kind == "step" else _trend)(form, shape, rows)
        own = rows.along(course) * shape
        fit = _fitted(np.column_stack([rows.steady.columns, own]), rows.y)
    return _Drift(course, fit, shape)


def _trend(form: str, shape: Array, rows: _Rows) -> Course:
    """Return the course of a trend with the time constant by which it explains most."""
    from scipy.optimize import minimize_scalar

    duration = max(float(stretch.t[-1] - stretch.t[0]) for stretch in rows.stretches)

    def course(logarithm: float) -> Course:
        time = float(np.exp(logarithm)) * duration
        return Course("trend", form, time, 0.5 * duration, duration)

    def loss(logarithm: float) -> float:
        outside = rows.steady.beside(rows.along(course(logarithm)) * shape)
        gain = np.square(outside @ rows.steady.residual)
        return -float(gain / max(float(outside @ outside), 1e-300))

    times = np.log(_DRIFT.times)
    k = int(np.argmin([loss(time) for time in times]))
    low, high = float(times[max(k - 1, 0)]), float(times[min(k + 1, len(times) - 1)])
    options = {"xatol": FINE}  # Brent 1973
    found = minimize_scalar(loss, bounds=(low, high), method="bounded", options=options)
    return course(float(found.x))


def _time_std(drift: _Drift, rows: _Rows) -> float | None:
    """Return the standard deviation [s] of a trend's time constant T, None of a step.

    To first order in T, g(v) as it was fitted. Blocks of time enter with the residual that the
    others leave of them: CR3, the jackknife over blocks (Bell & McCaffrey 2002, p. 169).
    """
    course = drift.course
    if course.kind == "step":
        return None
    longer = replace(course, time=(1.0 + NEAR) * course.time)
    change = (rows.along(longer) - rows.along(course)) / (NEAR * course.time)
    outside = drift.fit.beside(float(drift.fit.beta[-1]) * change * drift.shape)
    rest = rows.rest(_fitted(np.column_stack([drift.fit.columns, outside]), rows.y))
    return float(np.linalg.norm(np.bincount(rows.blocks, outside * rest)) / (outside @ outside))


def _step(form: str, shape: Array, rows: _Rows) -> Course:
    """Return the course of a step at the instant between two rows from which it explains most."""
    t = np.concatenate([stretch.middle[2] for stretch in rows.stretches])
    log = np.repeat(np.arange(len(rows.stretches)), [stretch.rows for stretch in rows.stretches])
    row = _step_row(shape, rows.steady)
    before, here = int(log[row - 1]), int(log[row])
    start = float(rows.stretches[here].t[0])
    when = 0.5 * float(t[row - 1] + t[row]) - start if before == here else 0.0
    return Course("step", form, when, 0.0, when, here)


def _step_row(shape: Array, fit: Linear) -> int:
    """Return the row from which on `shape` (rows,) lowers Σ r² of `fit` most (Andrews 1993, sup F).

    Its products with other columns are sums over the later rows. A step that lies within the other
    columns, but for less than a row, is not shown by any.
    """
    products = shape[:, None] * np.column_stack([fit.residual, shape, fit.columns @ fit.root])
    after, count = np.cumsum(products[::-1], axis=0)[::-1], len(shape)
    outside = after[:, 1] - np.square(after[:, 2:]).sum(axis=1)
    shown = outside > after[0, 1] / count
    gain = np.where(shown, np.square(after[:, 0]) / np.where(shown, outside, 1.0), 0.0)
    rows = np.arange(max(1, int(_DRIFT.ends * count)), int((1.0 - _DRIFT.ends) * count))
    # of rows that are alike but for rounding the first
    return int(rows[np.argmax(gain[rows] > (1.0 - ALIKE) * gain[rows].max())])
