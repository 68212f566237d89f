"""Fit the nominal model: rigid body and friction, every joint weighted by its own residual.

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

from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.parameter import Parameter
from pipelines.effects.base import ArmModel, Effect, FrictionLaw, Quantity, plainer
from pipelines.estimation.regression import Columns
from pipelines.io.log import Array
from pipelines.model.rows.data import Data

__all__ = ["Fit", "effect_rows", "fit_columns", "fit_nominal", "law_rows", "law_slopes",
           "nominal_arm", "rigid_rows", "rows_of", "several_rows"]

_RANK = 1e-12  # of the largest: smaller eigenvalues of the Gram matrix of unit columns are rounding
_ROUNDS = 6  # of weights
_SETTLED = 1e-3  # of a weight
_STEPS, _FINE, _STEP = 6, 1e-3, 0.01  # of Gauss-Newton; of ln shape where it ends; of a difference


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
        """Weighted columns (…, rows) of unweighted ones, less what the fit can imitate of them."""
        weighted = columns * self.weights
        return np.asarray(weighted - (weighted @ self.basis.T) @ self.basis)


def _orthonormal(table: Array) -> Array:
    """(rank, n) orthonormal rows that span those of `table` (k, n): by the Gram matrix, twice."""
    norm = np.linalg.norm(table, axis=1)
    basis: Array = table[norm > 0.0] / norm[norm > 0.0, None]
    for bound in (_RANK, 0.5):
        if not len(basis):
            break
        values, vectors = np.linalg.eigh(basis @ basis.T)
        keep = values > bound * values[-1] if bound == _RANK else np.ones(len(values), dtype=bool)
        basis = (vectors[:, keep] / np.sqrt(values[keep])).T @ basis
    return np.asarray(basis)


def fit_columns(data: Data, table: Array) -> Fit:
    """Least squares with joints weighted by their own residual, found in turns."""
    target = data.y
    scale = np.linalg.norm(table, axis=1)
    scale = np.where(scale > 0.0, scale, 1.0)
    unit = table / scale[:, None]
    grams = [unit[:, data.joint == j] @ unit[:, data.joint == j].T for j in range(data.n_joints)]
    moments = [unit[:, data.joint == j] @ target[data.joint == j] for j in range(data.n_joints)]
    powers = np.array([np.sum(target[data.joint == j] ** 2) for j in range(data.n_joints)])
    counts = np.maximum(np.bincount(data.joint[data.counts], minlength=data.n_joints), 1)
    w = np.ones(data.n_joints)
    beta = _solved(grams, moments, w)
    for _ in range(_ROUNDS):
        rss = np.array([p - 2.0 * beta @ m + beta @ g @ beta for p, m, g in zip(powers, moments, grams, strict=True)])
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
    size = np.where(size > 0.0, size, np.inf)  # a column of zeros has the number 0, and not rounding over nothing
    values, vectors = np.linalg.eigh(gram / size / size[:, None])
    keep = values > 1e-12 * values[-1]
    return np.asarray((vectors[:, keep] / values[keep]) @ (vectors[:, keep].T @ (moment / size)) / size)


def rows_of(data: Data, columns: Columns) -> Array:
    """(k, rows) of the rigid body and every law."""
    return np.concatenate([rigid_rows(data, columns), *(law_rows(data, law, columns) for law in columns.laws)])


def rigid_rows(data: Data, columns: Columns, times: Array | None = None) -> Array:
    """(k, rows), or (rows,) [N m] with the numbers `times`."""
    kept = list(columns.kept)
    return data.lay_kept((columns.body, columns.kept),
                         lambda motion: columns.body.regressor(motion.q, motion.dq, motion.ddq)[:, :, kept], times)


def law_rows(data: Data, law: Effect, columns: Columns) -> Array:
    """(k, rows)"""
    return effect_rows(data, law, columns.arm)


def effect_rows(data: Data, effect: Effect, arm: ArmModel, times: Array | None = None) -> Array:
    """(k, rows) columns of an effect in one shape, or (rows,) [N m] with the amplitudes `times`."""
    if effect.from_motion:
        return data.lay_kept(effect, lambda motion: effect.columns(motion, arm), times)
    columns = data.lay(lambda motion: effect.columns(motion, arm))
    return columns if times is None else np.asarray(times @ columns)


def several_rows(data: Data, shapes: Sequence[Effect], arm: ArmModel) -> list[Array]:
    """The same of several shapes of an effect, each (k, rows)."""
    if not shapes or shapes[0].from_motion:
        return [effect_rows(data, shape, arm) for shape in shapes]
    laid = data.lay(lambda motion: np.concatenate(shapes[0].several(shapes, motion, arm), axis=2))
    return np.split(laid, len(shapes))


def fit_nominal(data: Data, columns: Columns) -> tuple[Columns, Fit]:
    """The nominal model with the shapes of its laws found, sharpness of Coulomb friction say, and its fit.

    The last columns of the fit are the slopes of its torque by those shapes: whatever is orthogonal to the fit cannot be
    imitated by moving them a little, and a law a hundredth too blunt would look like a second one at low speed.
    """
    rigid = rigid_rows(data, columns)
    tables = [law_rows(data, law, columns) for law in columns.laws]
    laws = list(columns.laws)
    fit = fit_columns(data, np.concatenate([rigid, *tables]))
    for place, law in enumerate(laws):
        if _free(law):
            rest = np.concatenate([rigid, *(t for k, t in enumerate(tables) if k != place)])
            laws[place], tables[place] = _best_of_grid(data, law, columns, replace(fit, table=rest))
    fit = fit_columns(data, np.concatenate([rigid, *tables]))
    return _polished(data, replace(columns, laws=tuple(laws)), rigid, fit)


def _polished(data: Data, columns: Columns, rigid: Array, fit: Fit) -> tuple[Columns, Fit]:
    """Gauss-Newton over the shapes of the laws, Golub & Pereyra 2003: each step solves for shapes and amplitudes together."""
    for _ in range(_STEPS):
        slopes, names = law_slopes(data, columns, fit.beta)
        tables = [law_rows(data, law, columns) for law in columns.laws]
        base = np.concatenate([rigid, *tables])
        fit = fit_columns(data, np.concatenate([base, *slopes]))
        shift = np.clip(fit.beta[len(base):], -0.3, 0.3)
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
    """`law` with one shape multiplied, as far as its range allows."""
    quantity = next(q for q in law.parameters if q.name == name)
    shape: dict[str, Any] = {name: float(np.clip(getattr(law, name) * factor, quantity.low, quantity.high))}
    return replace(law, **shape)


def law_slopes(data: Data, columns: Columns, all_beta: Array) -> tuple[list[Array], list[tuple[int, str]]]:
    """(1, rows) of each shape: the slope of the torque by its logarithm; and which shapes they are."""
    slopes, shapes = [], _shapes_of(columns, all_beta)
    for place, name in shapes:
        law, beta = columns.laws[place], _of_laws(columns, all_beta)[place]
        up, down = (law_rows(data, _moved(law, name, factor), columns) for factor in (1.0 + _STEP, 1.0 - _STEP))
        slopes.append((beta @ (up - down))[None] / (2.0 * _STEP))
    return slopes, shapes


def _shapes_of(columns: Columns, all_beta: Array) -> list[tuple[int, str]]:
    """Places of the laws and names of their free shapes: of a law that takes no torque none, for it has no shape."""
    return [(place, quantity.name) for place, beta in enumerate(_of_laws(columns, all_beta)) if beta.any()
            for quantity in _free(columns.laws[place])]


def _of_laws(columns: Columns, all_beta: Array) -> list[Array]:
    """The amplitudes of each law."""
    counts = [sum(not q.shape for q in law.parameters) for law in columns.laws]
    return np.split(all_beta[len(columns.kept):], np.cumsum(counts))[:-1]


def _best_of_grid(data: Data, law: Effect, columns: Columns, rest: Fit) -> tuple[Effect, Array]:
    """The shape of `law` in its grid that leaves least beside the columns of `rest`; of several terms its own counts as well, for
    between the coarse points of so wide a grid many a search ends where two of them merge."""
    def gain(table: Array) -> float:
        c = rest.project(table)
        solved, *_ = np.linalg.lstsq(c @ c.T, c @ rest.residual, rcond=1e-10)
        return float(solved @ (c @ rest.residual))

    shapes = (*((law,) if plainer(law) else ()), *law.shapes(data.logs[0].motion, columns.arm))
    laid = [(shape, law_rows(data, shape, columns)) for shape in shapes]
    return max(laid, key=lambda one: gain(one[1]))


def nominal_arm(columns: Columns, beta: Array) -> Arm:
    """The arm that the fit describes; `beta` of rigid columns and laws, what follows is of no concern here."""
    place = {i: k for k, i in enumerate(columns.kept)}
    base = tuple(Parameter(p.name, float(beta[place[i]]) if i in place else 0.0, None, p.unit,
                           origin="fitted" if i in place else "assumed") for i, p in enumerate(columns.body.parameters))
    friction: list[Acting] = []
    effects: list[Acting] = []
    first = len(columns.kept)
    turning = columns.body.robot.revolute
    for law in columns.laws:
        count = sum(not q.shape for q in law.parameters)
        acting = Acting.of(law, law.values(beta[first:first + count]), revolute=law.joint is None or turning[law.joint - 1])
        first += count
        (friction if isinstance(law, FrictionLaw) else effects).append(acting)
    return Arm("nominal", columns.body, base, tuple(friction), tuple(effects))
