"""Solve separable least squares: y = Z α + A(θ) β, linear in all but a few numbers θ.

    problem = Separable(y, Z, build, lower, upper)       build(θ) -> A(θ)
    found = fit_separable(problem, starts)               the best of several starts

For every θ the linear part has a closed solution, so the search is over θ only (variable
projection: Golub & Pereyra 1973). Its Gauss-Newton step takes Kaufman's Jacobian 1975,
-P⊥ (∂A/∂θ_i) β, with P⊥ the projection off [Z, A]; Levenberg-Marquardt keeps it from running away.
Rows are taken as equally good; the memory of their noise goes into the covariance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pipelines.io.log import Array

_RANK = 1e-5  # numerics: singular values of unit columns: two columns that are one in any log
_STEP = 1e-4  # numerics: of a finite difference in θ
_GAIN = 1e-6  # numerics: of the sum of squares: a thousandth of what noise is worth
_MOST = 40  # numerics: steps
_DAMPING = 1e-3  # numerics
_PULLED = 0.1  # numerics: the least that 1 - leverage may be
_FREEDOM = 2.0  # numerics: the least: below it t has no variance
# in 1/freedom: quantile of t over 2, where the normal one is 2 (Fisher & Cornish 1960)
_STUDENT = (1.43, 1.53, 1.25, 1.0)  # numerics
_NOTHING = 1e-100  # numerics: length of a column whose square is lost
_UNSHOWN = 1e-9  # numerics: of the largest slope's square: what hardly shows is held


@dataclass(frozen=True, eq=False)
class Separable:
    """Rows y (m,), fixed columns Z (m, z), and columns A(θ) (m, k) of θ within its bounds."""

    y: Array
    fixed: Array
    build: Callable[[Array], Array]
    lower: Array  # (p,)
    upper: Array
    # of θ and β (k,): (m, p) (∂A/∂θ_i) β; None: by differences
    slopes: Callable[[Array, Array], Array] | None = None

    def columns(self, theta: Array) -> Array:
        return np.hstack([self.fixed, self.build(theta)])


@dataclass(frozen=True, eq=False)
class Linear:
    """The linear part at one θ."""

    columns: Array  # (m, z + k)
    beta: Array  # (z + k,) the smallest that explains y, where columns depend on one another
    residual: Array  # (m,)
    root: Array  # (z + k, rank) columns @ root is orthonormal

    @property
    def rss(self) -> float:
        return float(self.residual @ self.residual)

    def beside(self, others: Array) -> Array:
        """Return what of `others` (m, …) lies outside all columns."""
        inside = self.root @ (self.root.T @ (self.columns.T @ others))
        return np.asarray(others - self.columns @ inside)


@dataclass(frozen=True, eq=False)
class SeparableFit:
    """θ and β = (α, β) with their joint covariance, in this order: linear ones first."""

    theta: Array  # (p,)
    beta: Array  # (z + k,)
    covariance: Array  # (z + k + p, z + k + p); nothing of directions that no row shows
    seen: Array  # (z + k + p,) share of each number in directions that the rows show
    residual: Array  # (m,)
    jacobian: Array  # (m, z + k + p) ∂ŷ/∂(β, θ)
    at_bound: tuple[bool, ...]  # (p,) θ rests on a bound

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(np.square(self.residual))))

    @classmethod
    def rough(cls, theta: Array, now: Linear) -> SeparableFit:
        """Return an end of a search without covariance: that holds NaN."""
        size = len(now.beta) + len(theta)
        unknown, none = np.full((size, size), np.nan), np.zeros((0, size))
        free = (False,) * len(theta)
        return cls(theta, now.beta, unknown, np.zeros(size), now.residual, none, free)


def linear_part(columns: Array, y: Array) -> Linear:
    """Solve least squares with columns of unit length, cut off below `_RANK`."""
    root = _root((columns.T @ columns)[None])[0]
    beta = root @ (root.T @ (columns.T @ y))
    return Linear(columns, beta, y - columns @ beta, root)


def _root(gram: Array) -> Array:
    """Return W (…, k, k) with W Wᵀ the inverse of Gram matrices over what they show; else zero."""
    scale = np.sqrt(np.diagonal(gram, axis1=-2, axis2=-1))
    scale = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(gram / scale[..., :, None] / scale[..., None, :])
    kept = values > _RANK**2 * values[..., -1:]
    inverse = np.where(kept, 1.0 / np.sqrt(np.where(kept, values, 1.0)), 0.0)
    return np.asarray(vectors * inverse[..., None, :] / scale[..., :, None])


def scan(y: Array, fixed: Array, own: Array) -> Array:
    """Return Σ residual² (θ,) of many θ at once, by Gram matrices alone.

    Args:
        y, fixed: (m,) and (m, z).
        own: columns of each θ (θ, m, k).
    """
    fixed = np.broadcast_to(fixed, (len(own), *fixed.shape))
    whole = np.concatenate([fixed, own], axis=2)
    turned = whole.swapaxes(1, 2)
    root = _root(turned @ whole).swapaxes(1, 2)
    project = (root @ (turned @ y)[..., None])[..., 0]
    return np.asarray(y @ y - np.square(project).sum(axis=1))


def fit_separable(
    problem: Separable, starts: Iterable[Array], lags: int | None = None, most: int = _MOST
) -> SeparableFit:
    """Return the best of the local optima that `starts` lead to.

    Args:
        lags: rows over which noise may remember itself; by default Newey and West's rule.
        most: steps of each search.
    """
    ends = (_search(problem, start, most) for start in starts)
    theta, now, slope = min(ends, key=lambda end: end[1].rss)
    slope = _slopes(problem, theta, now) if slope is None else slope
    return _with_covariance(problem, theta, now, slope, lags)


def search(problem: Separable, start: Array, most: int = _MOST) -> tuple[Array, Linear]:
    """Search θ from one start by Levenberg-Marquardt, within the bounds; `most` steps."""
    return _search(problem, start, most)[:2]


def _search(problem: Separable, start: Array, most: int) -> tuple[Array, Linear, Array | None]:
    """Search, and return the slopes (m, p) at its end as well, where it took them last."""
    theta = np.clip(start, problem.lower, problem.upper)
    now = linear_part(problem.columns(theta), problem.y)
    damping = _DAMPING
    for _ in range(most if theta.size else 0):
        steep = _slopes(problem, theta, now)
        slope = now.beside(steep)
        normal, downhill = slope.T @ slope, slope.T @ now.residual
        size = np.diag(normal)
        if not size.any():  # no row shows any of θ
            break
        weight = np.diag(np.maximum(size, _UNSHOWN * size.max()))
        gain = 0.0
        while damping < 1e8:
            shift = np.linalg.solve(normal + damping * weight, downhill)
            # twice what the step would gain were the problem linear
            if downhill @ shift < _GAIN * now.rss:
                return theta, now, steep
            there = np.clip(theta + np.clip(shift, -1.0, 1.0), problem.lower, problem.upper)
            other = linear_part(problem.columns(there), problem.y)
            if other.rss <= now.rss:
                gain = 1.0 - other.rss / max(now.rss, 1e-300)
                theta, now, damping = there, other, damping / 5.0
                break
            damping *= 5.0
        if gain < _GAIN:
            break
    return theta, now, None


def _slopes(problem: Separable, theta: Array, now: Linear) -> Array:
    """(m, p) (∂A/∂θ_i) β: as given, or by differences, backward ones at an upper bound."""
    own = now.beta[problem.fixed.shape[1] :]
    if problem.slopes is not None:
        return problem.slopes(theta, own)
    here = now.columns[:, problem.fixed.shape[1] :] @ own
    slopes = np.empty((len(problem.y), len(theta)))
    for i in range(len(theta)):
        moved = theta.copy()
        step = _STEP if theta[i] + _STEP <= problem.upper[i] else -_STEP
        moved[i] += step
        slopes[:, i] = (problem.build(moved) @ own - here) / step
    return slopes


def _with_covariance(
    problem: Separable, theta: Array, now: Linear, slopes: Array, lags: int | None
) -> SeparableFit:
    """Return the fit with the sandwich B M B, B = (FᵀF)⁻¹ over what the rows show.

    M allows for rows that depend on one another. Newey & West 1987: M = Σ_l w_l Σ_i (f_i r_i)
    (f_{i+l} r_{i+l})ᵀ with falling weights w_l keeps M positive. A row that alone shows a number
    draws the fit to itself; r_i / (1 - h_i), h_i its leverage, is what it leaves when it is left
    out: HC3 of MacKinnon & White 1985, J. Econometrics 29, p. 305. Inertia hangs on the few rows in
    which a joint is sped up.
    """
    jacobian = np.hstack([now.columns, slopes])
    scale = np.linalg.norm(jacobian, axis=0)
    scale = np.where(scale > _NOTHING, scale, np.inf)  # a number that no row shows
    unit = jacobian / scale
    values, vectors = np.linalg.eigh(unit.T @ unit)
    kept = values > _RANK**2 * values[-1]
    bread = (vectors[:, kept] / values[kept]) @ vectors[:, kept].T
    leverage = np.square(unit @ (vectors[:, kept] / np.sqrt(values[kept]))).sum(axis=1)
    scores = unit * (now.residual / np.maximum(1.0 - leverage, _PULLED))[:, None]
    rows = len(scores)
    reach = int(4.0 * (rows / 100.0) ** (2.0 / 9.0)) if lags is None else lags
    meat = scores.T @ scores
    for lag in range(1, min(reach, rows - 1) + 1):
        cross = scores[lag:].T @ scores[:-lag]
        meat += (1.0 - lag / (reach + 1.0)) * (cross + cross.T)
    inverse = np.where(np.isinf(scale), 0.0, 1.0 / scale)
    covariance = bread @ meat @ bread * inverse * inverse[:, None]
    seen = np.where(np.isinf(scale), 0.0, np.square(vectors[:, kept]).sum(axis=1))
    bounds = (theta <= problem.lower + 1e-9) | (theta >= problem.upper - 1e-9)
    bounded = tuple(map(bool, bounds))
    return SeparableFit(theta, now.beta, covariance, seen, now.residual, jacobian, bounded)


def with_block_covariance(found: SeparableFit, blocks: npt.NDArray[np.intp]) -> SeparableFit:
    """Return `found` with a covariance that lets all errors within a block depend on each other.

    Each block enters with the residual that it has when it is left out, (I - H_bb)⁻¹ r_b: CR3, the
    jackknife over blocks, of Bell & McCaffrey 2002, Survey Methodology 28, p. 169. A direction that
    few blocks decide has a variance of few degrees of freedom, (Σ s²)²/Σ s⁴ by Satterthwaite 1946:
    it is widened so that two standard deviations cover what those of Student's t do. One block
    shows no scatter: `found` is returned as it is.

    Args:
        blocks: (m,) number of the block of every row, from 0.
    """
    if not blocks.any():
        return found
    scale = np.linalg.norm(found.jacobian, axis=0)
    scale = np.where(scale > _NOTHING, scale, np.inf)
    turn = _root((found.jacobian / scale).T @ (found.jacobian / scale))
    basis = found.jacobian / scale @ turn
    rest = held_out(basis, found.residual, blocks)
    sums = np.zeros((int(blocks.max()) + 1, basis.shape[1]))
    np.add.at(sums, blocks, basis * rest[:, None])
    size, axes = np.linalg.eigh(sums.T @ sums)
    shares = np.square(sums @ axes)
    freedom = np.square(shares.sum(axis=0)) / np.maximum(np.square(shares).sum(axis=0), 1e-300)
    wide = np.polyval(_STUDENT, 1.0 / np.maximum(freedom, _FREEDOM))
    back = turn @ (axes * wide * np.sqrt(np.maximum(size, 0.0))) / scale[:, None]
    return replace(found, covariance=back @ back.T * (len(sums) - 1.0) / len(sums))


def held_out(basis: Array, residual: Array, blocks: npt.NDArray[np.intp]) -> Array:
    """Return the residual (m,) of each block as the others predict it: (I - U_b U_bᵀ)⁻¹ r_b.

    Args:
        basis: (m, k) orthonormal columns U of the same space as the regressors.
        residual: (m,) of least squares over all rows.
        blocks: (m,) number of the block of every row, from 0.
    """
    rest, order = residual.copy(), np.argsort(blocks, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(blocks[order])) + 1):
        own = basis[rows]
        size, axes = np.linalg.eigh(own.T @ own)
        part = (axes.T @ (own.T @ residual[rows])) / np.maximum(1.0 - size, _PULLED)
        rest[rows] += own @ (axes @ part)
    return rest
