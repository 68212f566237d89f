"""Fit the gravity vector of the base, with an honest spread; find the order of the columns.

    min over a, φ, f of  Σ_j ν_j/2 log mean (τ_j - (Y_0j + Σ_k a_k Y_kj) φ - F_j f_j)²

Joints have unknown noise, so the likelihood is concentrated in it. What a joint has for itself is
projected out once (Frisch & Waugh 1933); φ is projected out at every a (Golub & Pereyra 1973),
with Kaufman's Jacobian. Everything is made of one Gram matrix a joint. The residual is correlated
and partly an error of the model, so the spread is the jackknife over clusters of moments (Bell &
McCaffrey 2002). Every order of columns is scored by the same likelihood, under the described
gravity.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np

from pipelines.dynamics.chain import regressor
from pipelines.estimation.checks.rows import GenericArm, RowFilter, Sampled, TorqueRows, own_columns
from pipelines.estimation.config import BoundaryConfig
from pipelines.io.log import Array

_RIDGE = 1e-9  # numerics: of equilibrated columns
_STEPS = 30  # numerics
_ENOUGH = 1e-4  # numerics: gain in log likelihood a step, below which the fit has ended
_ROUNDS = 12  # numerics: of reweighting at most
_SETTLED = 3e-3  # numerics: change of a log variance, at which reweighting ends
_CONFIG = BoundaryConfig()


@dataclass(frozen=True, eq=False)
class GravityFit:
    """Base parameters and noise under one gravity."""

    gravity: Array  # a (3,) [m/s^2]
    parameters: Array  # φ (p,)
    variance: Array  # (n,) of the residual over that of the torque, with the error of any model
    residual: Array  # (n,) RMS of the residual over that of the torque
    score: float  # log likelihood

    @property
    def power(self) -> float:
        return float(np.sum(self.residual**2))

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.residual**2)))


class GravityModel:
    """The Gram matrices of torque rows, and fits of them."""

    def __init__(self, rows: TorqueRows, model_error: float) -> None:
        self.rows, self.model_error = rows, model_error
        n, moments, p = rows.inertial.shape
        self.effective = np.full(n, float(moments))  # independent moments of each joint
        self.size = np.maximum(np.std(rows.tau, axis=1), 1e-12)
        lengths = np.maximum(np.linalg.norm(rows.own, axis=1, keepdims=True), 1e-300)
        basis, _ = np.linalg.qr(rows.own / lengths)
        pulled = rows.gravity.reshape(n, moments, -1)
        full = np.concatenate([rows.inertial, pulled, rows.tau[:, :, None]], axis=2)
        full = full / self.size[:, None, None]
        full -= basis @ (basis.transpose(0, 2, 1) @ full)
        self.projected = full  # (n, N, p + 3 m + 1)
        self.gram = full.transpose(0, 2, 1) @ full / moments
        power = np.einsum("jpp->p", self.gram)
        scale = power[:p].copy()
        scale[rows.heavy] += 96.0 * power[p:-1].reshape(3, -1).sum(axis=0)  # at 9.8 m/s^2
        scale = np.sqrt(scale)
        # infinite: a parameter without any effect
        self.scale = np.where(scale > 1e-10 * scale.max(initial=1e-300), scale, np.inf)
        # variance (n,) of each joint fitted by itself under any gravity: the least that a fit of
        # all can leave, from which its weights begin
        unit = np.sqrt(np.maximum(np.einsum("jpp->jp", self.gram), 1e-300))[:, :-1]
        columns = self.gram[:, :-1, :-1] / (unit[:, :, None] * unit[:, None, :])
        right = self.gram[:, :-1, -1] / unit
        solved = np.linalg.solve(columns + 1e-6 * np.eye(len(unit[0])), right[:, :, None])
        alone = self.gram[:, -1, -1] - np.sum(right * solved[:, :, 0], axis=1)
        self.alone = np.maximum(alone, 0.0) + model_error**2

    def _transform(self, gravity: Array) -> Array:
        """T (P, p) of one gravity (3,): columns of the model = [Y_0 Y_x Y_y Y_z] T."""
        first = np.diag(1.0 / self.scale)
        return np.concatenate([first, *(a * first[self.rows.heavy] for a in gravity)])

    def _scaled(self, fit: GravityFit) -> Array:
        return fit.parameters * np.where(np.isfinite(self.scale), self.scale, 0.0)

    def fit(self, gravity: Array, variance: Array | None = None) -> GravityFit:
        """Fit the parameters under `gravity` (3,), from the `variance` (n,) of a fit nearby."""
        variance = self.alone if variance is None else variance
        turn = self._transform(gravity)
        for _ in range(_ROUNDS):
            gram = np.tensordot(1.0 / variance, self.gram, 1)
            normal = turn.T @ gram[:-1, :-1] @ turn
            phi = np.linalg.solve(normal + _ridge(normal), turn.T @ gram[:-1, -1])
            model = np.append(turn @ phi, -1.0)
            left = self.gram @ model @ model
            before, variance = variance, np.maximum(left, 0.0) + self.model_error**2
            if np.abs(np.log(variance / before)).max() < _SETTLED:
                break
        score = -0.5 * float(self.effective @ np.log(variance))
        score -= 0.5 * float(gravity @ gravity) / _CONFIG.loose**2
        residual = np.sqrt(np.maximum(left, 0.0))
        return GravityFit(gravity, phi / self.scale, variance, residual, score)

    def curvature(self, fit: GravityFit, along: Array) -> tuple[Array, Array]:
        """Gradient (k,) and Hessian (k, k) of the log likelihood over the gravity, the parameters
        projected out; its sign such that a step is the Hessian's inverse times the gradient.

        Args:
            along: (k, 3) directions in which the gravity is changed.
        """
        p, heavy = self.rows.inertial.shape[2], self.rows.heavy
        change = np.zeros((p + 3 * len(heavy), len(along)))
        change[p:] = np.einsum("gk,m->kmg", along, fit.parameters[heavy]).reshape(-1, len(along))
        gram = np.tensordot(self.effective / fit.variance, self.gram, 1)
        turn = self._transform(fit.gravity)
        onto_turn, onto_change = gram[:-1, :-1] @ turn, gram[:-1, :-1] @ change
        normal, cross = turn.T @ onto_turn, turn.T @ onto_change
        left = gram[:-1, -1] - onto_turn @ self._scaled(fit)
        # turnᵀ left is zero but for the reweighting that has not ended
        inward = np.linalg.solve(normal + _ridge(normal), np.column_stack([cross, turn.T @ left]))
        loose = _CONFIG.loose**2
        slope = change.T @ left - cross.T @ inward[:, -1] - along @ fit.gravity / loose
        return slope, change.T @ onto_change - cross.T @ inward[:, :-1] + along @ along.T / loose

    def search(self, start: Array, size: float | None = None) -> GravityFit:
        """Fit the gravity as well, from `start` (3,), by Levenberg-Marquardt steps.

        Args:
            size: [m/s^2] of gravity, where only its direction is searched.
        """
        best = self.fit(start if size is None else size * start / np.linalg.norm(start))
        damping = 1e-3
        for _ in range(_STEPS):
            along = np.eye(3)
            if size is not None:
                along = size * np.linalg.svd(best.gravity[None])[2][1:]
            slope, hessian = self.curvature(best, along)
            diagonal = np.diag(np.diag(hessian) + 1e-12 * np.trace(hessian) + 1e-300)
            step = np.linalg.solve(hessian + damping * diagonal, slope)
            if size is None:
                moved = best.gravity + step
            else:
                moved = best.gravity + np.clip(step, -0.5, 0.5) @ along
                moved = size * moved / np.linalg.norm(moved)
            tried = self.fit(moved, best.variance)
            if tried.score > best.score:
                gained, best, damping = tried.score - best.score, tried, 0.1 * damping
                if gained < _ENOUGH:
                    break
            else:
                damping *= 10.0
                if damping > 1e6:
                    break
        return best

    def count_independent(self, fit: GravityFit) -> None:
        """Set the number of independent moments of each joint by the residual of a fit.

        ν = N / (1 + 2 Σ ρ_k), summed over the initial positive pairs of the autocorrelation (Geyer
        1992).
        """
        model = self._transform(fit.gravity) @ self._scaled(fit)
        residuals = self.projected[:, :, -1] - self.projected[:, :, :-1] @ model
        n, total = residuals.shape
        edges = list(pairwise([*self.rows.start.tolist(), total]))
        length = max(b - a for a, b in edges)
        size = 1 << (2 * length - 1).bit_length()
        centred = residuals - residuals.mean(axis=1, keepdims=True)
        power = sum(np.abs(np.fft.rfft(centred[:, a:b], size, axis=1)) ** 2 for a, b in edges)
        rho = np.fft.irfft(power, size, axis=1)[:, :length]
        rho = rho / np.maximum(rho[:, :1], 1e-300)
        pairs = rho[:, : length // 2 * 2].reshape(n, -1, 2).sum(axis=2)
        positive = np.cumprod(pairs > 0, axis=1)
        correlation = np.maximum(2.0 * np.sum(pairs * positive, axis=1) - 1.0, 1.0)
        self.effective = np.asarray(np.maximum(total / correlation, 2.0))

    def spread(self, fit: GravityFit) -> tuple[Array, Array, Array]:
        """Return the spread of the gravity and of the joints' own coefficients, all fitted.

        Returns:
            covariance (3, 3) of the gravity; own coefficients (n, c) and their covariance
            (n c, n c).
        """
        rows, heavy, clusters = self.rows, self.rows.heavy, _CONFIG.clusters
        (n, moments, p), c = rows.inertial.shape, rows.own.shape[2]
        width = 3 + p + n * c
        gram, right = np.zeros((clusters, width, width)), np.zeros((clusters, width))
        scores, prior = np.zeros((width, width)), np.zeros((width, width))
        prior[:3, :3] = np.eye(3) / _CONFIG.loose**2
        own = slice(3 + p, width)  # before any data no law of friction exceeds a joint's torque
        laws = rows.own_rms * (rows.dissipated != 0.0) / self.size[:, None]
        prior[own, own] = np.diag(laws.ravel() ** 2)
        for j in range(n):
            rigid = rows.inertial[j].copy()
            rigid[:, heavy] += np.einsum("k,nkm->nm", fit.gravity, rows.gravity[j])
            pulls = rows.gravity[j] @ fit.parameters[heavy]  # (N, 3)
            scale = self.size[j] * np.sqrt(fit.variance[j])
            design = np.concatenate([pulls, rigid, rows.own[j]], axis=1) / scale
            at = np.r_[0 : 3 + p, 3 + p + j * c : 3 + p + (j + 1) * c]
            for b in range(clusters):
                there = rows.cluster == b
                gram[b][np.ix_(at, at)] += design[there].T @ design[there]
                right[b][at] += design[there].T @ (rows.tau[j][there] / scale)
            power = fit.residual[j] ** 2 / fit.variance[j] * moments / self.effective[j]
            scores[np.ix_(at, at)] += design.T @ design * power
        theta, covariance = _jackknife(gram, right, prior, scores)
        return covariance[:3, :3], theta[own].reshape(n, c), covariance[own, own]


def _jackknife(gram: Array, right: Array, prior: Array, scores: Array) -> tuple[Array, Array]:
    """Return the weighted least squares fit (w,) and its covariance (w, w).

    Args:
        gram: (G, w, w) normal matrix of each cluster.
        right: (G, w) its right-hand side.
        prior: (w, w) precision before any data, of zero mean.
        scores: (w, w) covariance of the scores by the number of independent moments: the
            covariance is no smaller than by it.
    """
    normal = gram.sum(axis=0) + prior
    scale = np.maximum(np.diag(normal), 1e-12 * np.max(np.diag(normal), initial=1e-300))
    ridge = np.diag(_RIDGE * scale)
    theta = np.linalg.solve(normal + ridge, right.sum(axis=0))
    without = normal[None] - gram + ridge
    change = np.linalg.solve(without, (gram @ theta - right)[:, :, None])[:, :, 0]
    covariance = (len(gram) - 1.0) / len(gram) * change.T @ change
    inverse = np.linalg.inv(normal + ridge)
    plain = np.diag(inverse @ scores @ inverse)
    ratio = np.sqrt(np.maximum(plain / np.maximum(np.diag(covariance), 1e-300), 1.0))
    return theta, covariance * np.outer(ratio, ratio) + inverse @ (prior @ inverse)


def _ridge(normal: Array) -> Array:
    """Return the ridge (p, p) that keeps a normal matrix of equilibrated columns invertible, also
    where all are zero.
    """
    return _RIDGE * max(float(np.trace(normal)) / len(normal), 1.0) * np.eye(len(normal))


Order = tuple[int, ...]
_SIGNALS = ("q and tau", "tau", "q")
_BEAM = 8  # numerics: orders that are kept at each exchange
_REWEIGHTED = 4  # numerics: of reweighting, from what each joint by itself leaves


@dataclass(frozen=True)
class ColumnOrder:
    """Joint j takes column order[j] of the log, of the signals named."""

    signal: str  # "q and tau", "q" or "tau"
    order: Order

    @property
    def q(self) -> Order:
        """The order of the positions."""
        return self.order if "q" in self.signal else tuple(range(len(self.order)))

    @property
    def tau(self) -> Order:
        """The order of the torques."""
        return self.order if "tau" in self.signal else tuple(range(len(self.order)))

    @property
    def listed(self) -> str:
        return ",".join(str(k + 1) for k in self.order)


def search_orders(
    arm: GenericArm,
    motion: Sampled,
    gravity: Array,
    moving: Sequence[int],
    logged: GravityFit,
    config: BoundaryConfig,
) -> tuple[ColumnOrder, ...]:
    """Return the best orders other than the logged one, best first.

    Orders are reached by exchanges of two columns, from the best ones at each exchange.

    Args:
        gravity: (3,) [m/s^2] under which orders are compared.
        moving: joints that move; the others keep their place.
        logged: the best fit of the columns as they are.
    """
    explained = logged.residual.max() < config.suspect
    # go on where no exchange fits better than the log
    every = logged.rms > config.lost or (len(moving) <= config.few and not explained)
    least = -0.5 * float(np.sum(np.log(logged.variance))) - len(logged.variance)  # hopeless below
    score = _scorer(arm, motion.every(max(1, len(motion.t) // config.order_rows)), gravity, config)
    same: Order = tuple(range(len(arm.chain.revolute)))
    scores: dict[ColumnOrder, float] = {}
    for signal in _SIGNALS[:1] if explained else _SIGNALS:
        own = {same: score(ColumnOrder(signal, same))}
        beam: list[Order] = []
        for _ in range(len(moving) - 1):
            best = sorted(own, key=lambda order: -own[order])[:_BEAM]
            if best == beam or (beam and best[0] == same and not every):
                break
            beam = best
            near = {_exchanged(order, a, b) for order in beam for a, b in combinations(moving, 2)}
            own |= {order: score(ColumnOrder(signal, order)) for order in near - own.keys()}
        scores |= {ColumnOrder(signal, order): x for order, x in own.items() if order != same}
    ranked = sorted(scores.items(), key=lambda item: -item[1])[: config.orders]
    return tuple(order for order, x in ranked if x > least)


def _exchanged(order: Order, a: int, b: int) -> Order:
    swapped = list(order)
    swapped[a], swapped[b] = order[b], order[a]
    return tuple(swapped)


def _scorer(
    arm: GenericArm, motion: Sampled, gravity: Array, config: BoundaryConfig
) -> Callable[[ColumnOrder], float]:
    """Return the log likelihood a moment of an order."""
    chain, smooth = replace(arm.chain, gravity=gravity), RowFilter([motion])
    error = config.model_error**2
    own = smooth(own_columns(motion.dq, motion.ddq, motion.coulomb))
    torque = smooth(motion.tau.T[:, :, None])[:, :, 0].T
    sizes = np.maximum(np.std(torque, axis=0), 1e-12)
    own /= np.maximum(np.linalg.norm(own, axis=1, keepdims=True), 1e-300)
    basis = np.linalg.qr(own)[0]  # of each column of the positions
    # torque (n, N, n) less what each column's own explains
    tau = torque - basis @ (basis.transpose(0, 2, 1) @ torque)
    rows: dict[Order, tuple[Array, Array]] = {}

    def rows_of(order: Order) -> tuple[Array, Array]:
        """Return Gram matrices (n, p, p) and products with every torque (n, p, n) of positions."""
        if order not in rows:
            at = list(order)
            y = regressor(chain, motion.q[:, at], motion.dq[:, at], motion.ddq[:, at], arm.columns)
            columns = smooth(y.transpose(1, 0, 2))
            columns = columns - basis[at] @ (basis[at].transpose(0, 2, 1) @ columns)
            turned = columns.transpose(0, 2, 1) / columns.shape[1]
            rows[order] = turned @ columns, turned @ tau[at]
        return rows[order]

    def score(one: ColumnOrder) -> float:
        gram, cross = rows_of(one.q)
        joints, torques = np.arange(len(one.order)), list(one.tau)
        size = sizes[torques]
        total = np.mean(tau[list(one.q), :, torques] ** 2, axis=1) / size**2
        gram = gram / size[:, None, None] ** 2
        right = cross[joints, :, torques] / size[:, None] ** 2
        scale = np.sqrt(np.maximum(np.einsum("jpp->p", gram), 1e-300))
        scale[scale < 1e-10 * scale.max()] = np.inf
        gram, right = gram / np.outer(scale, scale), right / scale
        count = gram.shape[1]
        ridge = 1e-6 * np.eye(count) * np.einsum("jpp->j", gram)[:, None, None] / count
        alone = np.linalg.solve(gram + ridge, right[:, :, None])[:, :, 0]  # each joint by itself
        variance = np.maximum(total - np.sum(right * alone, axis=1), 0.0) + error
        for _ in range(_REWEIGHTED):
            normal = np.tensordot(1.0 / variance, gram, 1)
            normal += _RIDGE * np.trace(normal) / count * np.eye(count)
            phi = np.linalg.solve(normal, right.T @ (1.0 / variance))
            rest = total - 2.0 * right @ phi + gram @ phi @ phi
            variance = np.maximum(rest, 0.0) + error
        return -0.5 * float(np.sum(np.log(variance)))

    return score
