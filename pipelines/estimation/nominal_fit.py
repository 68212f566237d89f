"""Fit the nominal model to rows: rigid body and friction, joints weighted by their residual.

    columns, fit = fit_nominal(data, columns)       shapes of the friction laws included
    fit.residual, fit.project(columns)              the residual, and that of other columns
    effect_rows(data, effect, arm)                  columns of an effect over the rows

Kostić et al. 2004, eq. (12)-(15).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from pipelines.effects.base import ArmModel, Effect, plainer
from pipelines.estimation.regression import Columns
from pipelines.estimation.rows import Data
from pipelines.io.log import Array

_RANK = 1e-12  # numerics: of the largest eigenvalue of the Gram matrix of unit columns
_ROUNDS = 6  # numerics: of weights
_SETTLED = 1e-3  # numerics: of a weight
_STEPS = 6  # numerics: of Gauss-Newton
_FINE = 1e-3  # numerics: of ln shape, where it ends
_FARTHEST = 0.3  # numerics: of the same, in a step
_STEP = 0.01  # numerics: of a difference


@dataclass(frozen=True, eq=False)
class Fit:
    """Columns fitted to torque, joints weighted by their residual."""

    data: Data
    table: Array  # (k, rows) columns, unweighted
    y: Array  # (rows,) torque
    weight: Array  # (joints,) [1/(N m)]
    beta: Array  # (k,)

    @cached_property
    def weights(self) -> Array:
        """(rows,) of every row."""
        return np.asarray(self.weight[self.data.joint])

    @cached_property
    def basis(self) -> Array:
        """(rank, rows) orthonormal rows that span the weighted columns."""
        return _orthonormal(self.table * self.weights)

    @cached_property
    def residual(self) -> Array:
        """(rows,) weighted."""
        return self.project(self.y)

    @cached_property
    def left(self) -> Array:
        """(rows,) [N m] unweighted."""
        return np.asarray(self.residual / self.weights)

    @property
    def rms(self) -> Array:
        """(joints,) [N m]."""
        return self.data.rms(self.left)

    def project(self, columns: Array) -> Array:
        """Return columns (…, rows), weighted, less what the fit can imitate of them."""
        weighted = columns * self.weights
        return np.asarray(weighted - (weighted @ self.basis.T) @ self.basis)


def _orthonormal(table: Array) -> Array:
    """Return orthonormal rows (rank, n) that span those of `table`: by the Gram matrix, twice."""
    norm = np.linalg.norm(table, axis=1)
    basis: Array = table[norm > 0.0] / norm[norm > 0.0, None]
    for rank in (_RANK, 0.0):
        if len(basis):
            values, vectors = np.linalg.eigh(basis @ basis.T)
            keep = values > rank * values[-1]
            basis = (vectors[:, keep] / np.sqrt(values[keep])).T @ basis
    return basis


def fit_columns(data: Data, table: Array) -> Fit:
    """Solve least squares with joints weighted by their own residual, found in turns."""
    y, joints = data.y, [data.joint == j for j in range(data.n_joints)]
    scale = np.linalg.norm(table, axis=1)
    scale = np.where(scale > 0.0, scale, 1.0)
    unit = table / scale[:, None]
    grams = np.array([unit[:, own] @ unit[:, own].T for own in joints])
    moments = np.array([unit[:, own] @ y[own] for own in joints])
    powers = np.array([y[own] @ y[own] for own in joints])
    counts = np.maximum(np.bincount(data.joint[data.counts], minlength=data.n_joints), 1)
    weight, before = np.ones(data.n_joints), np.full(data.n_joints, np.inf)
    for left in reversed(range(_ROUNDS + 1)):
        gram = np.tensordot(weight**2, grams, 1)
        size = np.sqrt(np.diag(gram))
        size = np.where(size > 0.0, size, np.inf)  # a column of zeros has the number 0
        values, vectors = np.linalg.eigh(gram / size / size[:, None])
        keep = values > _RANK * values[-1]
        projected = vectors[:, keep].T @ (weight**2 @ moments / size)
        beta = (vectors[:, keep] / values[keep]) @ projected / size
        if not left or np.abs(weight / before - 1.0).max() < _SETTLED:
            break
        rss = powers - 2.0 * moments @ beta + grams @ beta @ beta
        sigma = np.sqrt(np.maximum(rss, 1e-12 * powers) / counts)
        before, weight = weight, 1.0 / np.maximum(sigma, 1e-12 * (sigma.max() or 1.0))
    return Fit(data, table, y, weight, np.asarray(beta / scale))


def rows_of(data: Data, columns: Columns) -> Array:
    """(k, rows) of the rigid body and every law."""
    laws = (law_rows(data, law, columns) for law in columns.laws)
    return np.concatenate([rigid_rows(data, columns), *laws])


def rigid_rows(data: Data, columns: Columns, times: Array | None = None) -> Array:
    """(k, rows), or (rows,) [N m] with the numbers `times`."""
    body, kept = columns.body, list(columns.kept)
    key = (body, columns.kept)
    return data.lay_kept(key, lambda m: body.regressor(m.q, m.dq, m.ddq)[:, :, kept], times)


def law_rows(data: Data, law: Effect, columns: Columns) -> Array:
    """(k, rows) of one law."""
    return effect_rows(data, law, columns.arm)


def effect_rows(data: Data, effect: Effect, arm: ArmModel, times: Array | None = None) -> Array:
    """(k, rows) columns of an effect in one shape, or (rows,) [N m] with amplitudes `times`."""
    if effect.from_motion:
        return data.lay_kept(effect, lambda motion: effect.columns(motion, arm), times)
    columns = data.lay(lambda motion: effect.columns(motion, arm))
    return columns if times is None else np.asarray(times @ columns)


def several_rows(data: Data, shapes: Sequence[Effect], arm: ArmModel) -> list[Array]:
    """Return the columns (k, rows) of several shapes of an effect."""
    if not shapes or shapes[0].from_motion:
        return [effect_rows(data, shape, arm) for shape in shapes]
    several = shapes[0].several
    laid = data.lay(lambda motion: np.concatenate(several(shapes, motion, arm), axis=2))
    return np.split(laid, len(shapes))


def fit_nominal(data: Data, columns: Columns) -> tuple[Columns, Fit]:
    """Return the nominal model with the shapes of its laws found, and its fit.

    The last columns of the fit are the slopes of its torque by those shapes: whatever is orthogonal
    to the fit cannot be imitated by moving them a little, and a law a hundredth too blunt would
    look like a second one at low speed. Shapes by Gauss-Newton, Golub & Pereyra 2003: each step
    solves for shapes and amplitudes together.
    """
    rigid, laws = rigid_rows(data, columns), list(columns.laws)
    tables = [law_rows(data, law, columns) for law in laws]
    fit = fit_columns(data, np.concatenate([rigid, *tables]))
    for place, law in enumerate(laws):
        if _free(law):
            others = (t for k, t in enumerate(tables) if k != place)
            rest = replace(fit, table=np.concatenate([rigid, *others]))
            laws[place], tables[place] = _best_of_grid(data, law, columns, rest)
    fit = fit_columns(data, np.concatenate([rigid, *tables]))
    columns = replace(columns, laws=tuple(laws))
    for _ in range(_STEPS):
        slopes, names = law_slopes(data, columns, fit.beta)
        fit = fit_columns(data, np.concatenate([rows_of(data, columns), *slopes]))
        shift = np.clip(fit.beta[len(columns.names) :], -_FARTHEST, _FARTHEST)
        if not len(shift) or np.abs(shift).max() < _FINE:
            break
        laws = list(columns.laws)
        for (place, name), by in zip(names, shift, strict=True):
            laws[place] = _times(laws[place], name, float(np.exp(by)))
        columns = replace(columns, laws=tuple(laws))
    return columns, fit


def _free(law: Effect) -> list[str]:
    return [q.name for q in law.parameters if q.name in law.free and q.low > 0.0]


def with_shape(effect: Effect, name: str, value: float) -> Effect:
    """Return the effect with one shape changed, as far as its range allows."""
    shape: dict[str, Any] = {name: effect.within(name, value)}
    return replace(effect, **shape)


def _times(law: Effect, name: str, factor: float) -> Effect:
    return with_shape(law, name, factor * float(getattr(law, name)))


def law_slopes(
    data: Data, columns: Columns, beta: Array
) -> tuple[list[Array], list[tuple[int, str]]]:
    """Return the slope (1, rows) of the torque by the logarithm of each free shape, and which.

    Of a law that takes no torque none, for it has no shape.
    """
    slopes, shapes = list[Array](), list[tuple[int, str]]()
    for place, (law, part) in enumerate(zip(columns.laws, columns.parts, strict=True)):
        for name in _free(law) if beta[part].any() else ():
            moved = (_times(law, name, factor) for factor in (1.0 + _STEP, 1.0 - _STEP))
            up, down = (law_rows(data, one, columns) for one in moved)
            slopes.append((beta[part] @ (up - down))[None] / (2.0 * _STEP))
            shapes.append((place, name))
    return slopes, shapes


def _best_of_grid(data: Data, law: Effect, columns: Columns, rest: Fit) -> tuple[Effect, Array]:
    """Return the shape of `law` in its grid that leaves least with the columns of `rest`.

    Of a law of several terms its own shape counts as well, for between the coarse points of so wide
    a grid many a search ends where two of them merge.
    """

    def gain(table: Array) -> float:
        c = rest.project(table)
        moment = c @ rest.residual
        return float(np.linalg.lstsq(c @ c.T, moment, rcond=1e-10)[0] @ moment)

    grid = law.shapes(data.logs[0].motion, columns.arm)
    shapes = (law, *grid) if plainer(law) else grid
    laid = [(shape, law_rows(data, shape, columns)) for shape in shapes]
    return max(laid, key=lambda one: gain(one[1]))
