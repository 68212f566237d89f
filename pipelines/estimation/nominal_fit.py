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

from pipelines.effects.base import ArmModel, Effect, Quantity, plainer
from pipelines.estimation.regression import Columns
from pipelines.estimation.rows import Data
from pipelines.io.log import Array

_RANK = 1e-12  # numerics: of the largest eigenvalue of the Gram matrix of unit columns
_ROUNDS = 6  # numerics: of weights
_SETTLED = 1e-3  # numerics: of a weight
_STEPS = 6  # numerics: of Gauss-Newton
_FINE = 1e-3  # numerics: of ln shape, where it ends
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
        y = self.y * self.weights
        return np.asarray(y - (self.basis @ y) @ self.basis)

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
    for first in (True, False):
        if not len(basis):
            break
        values, vectors = np.linalg.eigh(basis @ basis.T)
        keep = values > _RANK * values[-1] if first else np.ones(len(values), dtype=bool)
        basis = (vectors[:, keep] / np.sqrt(values[keep])).T @ basis
    return np.asarray(basis)


def fit_columns(data: Data, table: Array) -> Fit:
    """Solve least squares with joints weighted by their own residual, found in turns."""
    target, joints = data.y, range(data.n_joints)
    scale = np.linalg.norm(table, axis=1)
    scale = np.where(scale > 0.0, scale, 1.0)
    unit = table / scale[:, None]
    grams = [unit[:, data.joint == j] @ unit[:, data.joint == j].T for j in joints]
    moments = [unit[:, data.joint == j] @ target[data.joint == j] for j in joints]
    powers = np.array([np.sum(target[data.joint == j] ** 2) for j in joints])
    counts = np.maximum(np.bincount(data.joint[data.counts], minlength=data.n_joints), 1)
    w = np.ones(data.n_joints)
    beta = _solved(grams, moments, w)
    for _ in range(_ROUNDS):
        parts = zip(powers, moments, grams, strict=True)
        rss = np.array([p - 2.0 * beta @ m + beta @ g @ beta for p, m, g in parts])
        sigma = np.sqrt(np.maximum(rss, 1e-12 * powers) / counts)
        before, w = w, 1.0 / np.maximum(sigma, 1e-12 * (sigma.max() or 1.0))
        beta = _solved(grams, moments, w)
        if np.abs(w / before - 1.0).max() < _SETTLED:
            break
    return Fit(data, table, target, w, beta / scale)


def _solved(grams: list[Array], moments: list[Array], weight: Array) -> Array:
    gram = sum(w**2 * g for w, g in zip(weight, grams, strict=True))
    moment = sum(w**2 * m for w, m in zip(weight, moments, strict=True))
    size = np.sqrt(np.diag(gram))
    size = np.where(size > 0.0, size, np.inf)  # a column of zeros has the number 0
    values, vectors = np.linalg.eigh(gram / size / size[:, None])
    keep = values > _RANK * values[-1]
    projected = vectors[:, keep].T @ (moment / size)
    return np.asarray((vectors[:, keep] / values[keep]) @ projected / size)


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
        base = np.concatenate([rigid, *(law_rows(data, law, columns) for law in columns.laws)])
        fit = fit_columns(data, np.concatenate([base, *slopes]))
        shift = np.clip(fit.beta[len(base) :], -0.3, 0.3)
        if not len(shift) or np.abs(shift).max() < _FINE:
            break
        laws = list(columns.laws)
        for (place, name), by in zip(names, shift, strict=True):
            laws[place] = _moved(laws[place], name, float(np.exp(by)))
        columns = replace(columns, laws=tuple(laws))
    return columns, fit


def _free(law: Effect) -> list[Quantity]:
    return [q for q in law.parameters if q.name in law.free and q.low > 0.0]


def _moved(law: Effect, name: str, factor: float) -> Effect:
    """Return `law` with one shape multiplied, as far as its range allows."""
    quantity = next(q for q in law.parameters if q.name == name)
    value = np.clip(getattr(law, name) * factor, quantity.low, quantity.high)
    shape: dict[str, Any] = {name: float(value)}
    return replace(law, **shape)


def law_slopes(
    data: Data, columns: Columns, all_beta: Array
) -> tuple[list[Array], list[tuple[int, str]]]:
    """Return the slope (1, rows) of the torque by the logarithm of each free shape, and which.

    Of a law that takes no torque none, for it has no shape.
    """
    counts = [sum(not q.shape for q in law.parameters) for law in columns.laws]
    amplitudes = np.split(all_beta[len(columns.kept) :], np.cumsum(counts))[:-1]
    slopes, shapes = list[Array](), list[tuple[int, str]]()
    for place, (law, beta) in enumerate(zip(columns.laws, amplitudes, strict=True)):
        for quantity in _free(law) if beta.any() else ():
            moved = (_moved(law, quantity.name, factor) for factor in (1.0 + _STEP, 1.0 - _STEP))
            up, down = (law_rows(data, one, columns) for one in moved)
            slopes.append((beta @ (up - down))[None] / (2.0 * _STEP))
            shapes.append((place, quantity.name))
    return slopes, shapes


def _best_of_grid(data: Data, law: Effect, columns: Columns, rest: Fit) -> tuple[Effect, Array]:
    """Return the shape of `law` in its grid that leaves least with the columns of `rest`.

    Of a law of several terms its own shape counts as well, for between the coarse points of so wide
    a grid many a search ends where two of them merge.
    """

    def gain(table: Array) -> float:
        c = rest.project(table)
        solved, *_ = np.linalg.lstsq(c @ c.T, c @ rest.residual, rcond=1e-10)
        return float(solved @ (c @ rest.residual))

    grid = law.shapes(data.logs[0].motion, columns.arm)
    shapes = (law, *grid) if plainer(law) else grid
    laid = [(shape, law_rows(data, shape, columns)) for shape in shapes]
    return max(laid, key=lambda one: gain(one[1]))
