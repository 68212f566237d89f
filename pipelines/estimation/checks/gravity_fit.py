"""Fit the gravity vector of the base by variable projection.

    min over a, φ, f of  Σ_j ν_j/2 log mean (τ_j - (Y_0j + Σ_k a_jk Y_kj) φ - F_j f_j)²

Joints have unknown noise, so the likelihood is concentrated in it. What a joint has for itself is
projected out once (Frisch & Waugh 1933); φ is projected out at every a (Golub & Pereyra 1973),
with Kaufman's Jacobian. Everything is made of one Gram matrix a joint, so that a trial of another
a costs less than a millisecond.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipelines.estimation.checks.config import BoundaryConfig
from pipelines.estimation.checks.torque_rows import Array, TorqueRows

__all__ = ["LOOSE", "GravityFit", "GravityModel"]

_RIDGE = 1e-9  # numerics: of equilibrated columns
_STEPS = 30  # numerics
_ENOUGH = 1e-4  # numerics: gain in log likelihood a step, below which the fit has ended
_ROUNDS = 12  # numerics: of reweighting at most
_SETTLED = 3e-3  # numerics: change of a log variance, at which reweighting ends
LOOSE = BoundaryConfig.loose  # [m/s^2]


@dataclass(frozen=True, eq=False)
class GravityFit:
    """Base parameters and noise under one gravity."""

    gravity: Array  # a (n, 3) [m/s^2], of each joint
    parameters: Array  # φ (p,)
    variance: (
        Array  # (n,) of the residual over that of the torque, with the error that any model has
    )
    residual: Array  # (n,) RMS of the residual over that of the torque
    score: float  # log likelihood


class GravityModel:
    """The Gram matrices of torque rows, and fits of them."""

    def __init__(
        self, rows: TorqueRows, model_error: float, effective: Array | None = None
    ) -> None:
        """`effective` (n,): independent moments of each joint; None: all of them."""
        self.rows = rows
        self.model_error = model_error
        n, moments, p = rows.inertial.shape
        self.whole = np.repeat(
            np.eye(3)[:, None], n, axis=1
        )  # (3, n, 3): one gravity of all joints
        self.effective = np.full(n, float(moments)) if effective is None else effective
        self.size = np.maximum(np.std(rows.tau, axis=1), 1e-12)
        basis, _ = np.linalg.qr(
            rows.own / np.maximum(np.linalg.norm(rows.own, axis=1, keepdims=True), 1e-300)
        )
        full = np.concatenate(
            [rows.inertial, rows.gravity.reshape(n, moments, -1), rows.tau[:, :, None]], axis=2
        )
        full = full / self.size[:, None, None]
        full -= basis @ (basis.transpose(0, 2, 1) @ full)
        self.projected = full  # (n, N, p + 3 m + 1)
        self.gram = full.transpose(0, 2, 1) @ full / moments
        self.alone = self._alone()
        power = np.einsum("jpp->p", self.gram)
        scale = power[:p].copy()
        scale[rows.heavy] += 96.0 * power[p:-1].reshape(3, -1).sum(axis=0)  # at 9.8 m/s^2
        scale = np.sqrt(scale)
        self.scale = np.where(
            scale > 1e-10 * scale.max(initial=1e-300), scale, np.inf
        )  # a parameter without any effect

    def _alone(self) -> Array:
        """Return the variance (n,) of each joint fitted by itself under any gravity: the least that
        a fit of all can leave, from which its weights begin.
        """
        scale = np.sqrt(np.maximum(np.einsum("jpp->jp", self.gram), 1e-300))[:, :-1]
        columns = self.gram[:, :-1, :-1] / (scale[:, :, None] * scale[:, None, :])
        right = self.gram[:, :-1, -1] / scale
        solved = np.linalg.solve(columns + 1e-6 * np.eye(len(scale[0])), right[:, :, None])
        left = self.gram[:, -1, -1] - np.sum(right * solved[:, :, 0], axis=1)
        return np.asarray(np.maximum(left, 0.0) + self.model_error**2)

    def _transform(self, gravity: Array) -> Array:
        """T (P, p) of one gravity (3,): columns of the model = [Y_0 Y_x Y_y Y_z] T."""
        p, m = self.rows.inertial.shape[2], len(self.rows.heavy)
        out = np.zeros((p + 3 * m, p))
        out[np.arange(p), np.arange(p)] = 1.0 / self.scale
        for k in range(3):
            out[p + k * m + np.arange(m), self.rows.heavy] = (
                gravity[k] / self.scale[self.rows.heavy]
            )
        return out

    def fit(self, gravity: Array, variance: Array | None = None) -> GravityFit:
        """Fit the parameters under `gravity`, (3,) or of each joint (n, 3), from the `variance`
        (n,) of a fit nearby.
        """
        each = np.broadcast_to(gravity, (self.rows.n_joints, 3))
        variance = self.alone if variance is None else variance
        together = bool((each == each[0]).all())
        transforms = self._transforms(each, together)
        for _ in range(_ROUNDS):
            parts = list(zip(transforms, self._weighted(1.0 / variance, together), strict=True))
            normal = sum((t.T @ g[:-1, :-1] @ t for t, g in parts), np.zeros(()))
            right = sum((t.T @ g[:-1, -1] for t, g in parts), np.zeros(()))
            phi = np.linalg.solve(normal + _ridge(normal), right)
            model = np.stack([np.append(t @ phi, -1.0) for t, _ in parts])
            model = np.broadcast_to(model, (len(each), model.shape[1]))
            left = np.sum((model[:, None] @ self.gram)[:, 0] * model, axis=1)
            before, variance = variance, np.maximum(left, 0.0) + self.model_error**2
            if np.abs(np.log(variance / before)).max() < _SETTLED:
                break
        score = -0.5 * float(self.effective @ np.log(variance)) - 0.5 * float(np.sum(each**2)) / (
            len(each) * LOOSE**2
        )
        return GravityFit(each, phi / self.scale, variance, np.sqrt(np.maximum(left, 0.0)), score)

    def _transforms(self, each: Array, together: bool) -> list[Array]:
        """Return each joint's T; of joints `together`, which have one gravity, a single one."""
        return [self._transform(gravity) for gravity in (each[:1] if together else each)]

    def _weighted(self, weights: Array, together: bool) -> Array:
        """Return the weighted Gram matrices (n, P, P), or their sum (1, P, P)."""
        if together:
            return np.tensordot(weights, self.gram, 1)[None]
        return np.asarray(weights[:, None, None] * self.gram)

    def _equilibrated(self, fit: GravityFit) -> Array:
        """Return the parameters (p,) of columns at unit length."""
        return fit.parameters * np.where(np.isfinite(self.scale), self.scale, 0.0)

    def curvature(self, fit: GravityFit, groups: Array) -> tuple[Array, Array]:
        """Gradient and Hessian of the log likelihood over the gravity, the parameters projected
        out; its sign such that a step is the Hessian's inverse times the gradient.

        Args:
            groups: (k, n, 3) directions in which the joints' gravity is changed.

        Returns:
            (k,) and (k, k), of independent moments.
        """
        p, m = self.rows.inertial.shape[2], len(self.rows.heavy)
        normal, cross = np.zeros((p, p)), np.zeros((p, len(groups)))
        inner, slope, rest = (
            np.zeros((len(groups), len(groups))),
            np.zeros(len(groups)),
            np.zeros(p),
        )
        weights, theta = self.effective / fit.variance, self._equilibrated(fit)
        same = [(one == one[..., :1, :]).all() for one in (groups, fit.gravity)]
        transforms = self._transforms(fit.gravity, all(same))
        grams = self._weighted(weights, all(same))
        for j, (transform, gram) in enumerate(zip(transforms, grams, strict=True)):
            change = np.zeros((p + 3 * m, len(groups)))
            for k in range(3):
                change[p + k * m : p + (k + 1) * m] = np.outer(
                    fit.parameters[self.rows.heavy], groups[:, j, k]
                )
            onto = gram[:-1, :-1] @ np.column_stack([transform, change])
            normal += transform.T @ onto[:, :p]
            cross += transform.T @ onto[:, p:]
            inner += change.T @ onto[:, p:]
            left = gram[:-1, -1] - onto[:, :p] @ theta
            slope += change.T @ left
            rest += transform.T @ left  # zero but for the reweighting that has not ended
        prior = groups.reshape(len(groups), -1) / (LOOSE * np.sqrt(len(fit.gravity)))
        inward = np.linalg.solve(normal + _ridge(normal), np.column_stack([cross, rest]))
        return (
            slope
            - cross.T @ inward[:, -1]
            - prior @ fit.gravity.ravel() / (LOOSE * np.sqrt(len(fit.gravity))),
            inner - cross.T @ inward[:, :-1] + prior @ prior.T,
        )

    def search(self, start: Array, groups: Array) -> GravityFit:
        """Fit the gravity as well, from `start` (n, 3), along `groups` (k, n, 3)."""

        def stepped(fit: GravityFit, step: Array, along: Array) -> Array:
            return np.asarray(fit.gravity + np.einsum("k,kjx->jx", step, along))

        return self._climb(start, lambda _: groups, stepped)

    def search_direction(self, start: Array, size: float) -> GravityFit:
        """Fit the direction of gravity of `size` [m/s^2], the same at all joints, from `start`."""
        n = self.rows.n_joints

        def across(fit: GravityFit) -> Array:
            return np.repeat(size * np.linalg.svd(fit.gravity[:1])[2][1:, None], n, axis=1)

        def stepped(fit: GravityFit, step: Array, along: Array) -> Array:
            turned = fit.gravity[0] + np.clip(step, -0.5, 0.5) @ along[:, 0]
            return np.asarray(size * turned / np.linalg.norm(turned))

        return self._climb(size * start / np.linalg.norm(start), across, stepped)

    def _climb(
        self,
        start: Array,
        groups_at: Callable[[GravityFit], Array],
        stepped: Callable[[GravityFit, Array, Array], Array],
    ) -> GravityFit:
        """Climb the log likelihood by Levenberg-Marquardt steps."""
        best, damping = self.fit(start), 1e-3
        for _ in range(_STEPS):
            groups = groups_at(best)
            slope, hessian = self.curvature(best, groups)
            diagonal = np.diag(np.diag(hessian) + 1e-12 * np.trace(hessian) + 1e-300)
            step = np.linalg.solve(hessian + damping * diagonal, slope)
            tried = self.fit(stepped(best, np.asarray(step), groups), best.variance)
            if tried.score > best.score:
                gained, best, damping = tried.score - best.score, tried, 0.1 * damping
                if gained < _ENOUGH:
                    break
            else:
                damping *= 10.0
                if damping > 1e6:
                    break
        return best

    def pulls(self, fit: GravityFit) -> Array:
        """Return the torque (n, N, 3) over its size of 1 m/s^2 along each axis, beyond what the
        joints' own columns explain.
        """
        n, m = self.rows.n_joints, len(self.rows.heavy)
        p = self.rows.inertial.shape[2]
        part = self.projected[:, :, p : p + 3 * m].reshape(n, -1, 3, m)
        return np.asarray(part @ fit.parameters[self.rows.heavy])

    def residuals(self, fit: GravityFit) -> Array:
        """(n, N) the residual over the RMS of each joint's torque."""
        theta = self._equilibrated(fit)
        models = np.stack([self._transform(gravity) @ theta for gravity in fit.gravity])
        return np.asarray(
            self.projected[:, :, -1] - (self.projected[:, :, :-1] @ models[:, :, None])[:, :, 0]
        )


def _ridge(normal: Array) -> Array:
    """Return the ridge (p, p) that keeps a normal matrix of equilibrated columns invertible, also
    where all are zero.
    """
    return _RIDGE * max(float(np.trace(normal)) / len(normal), 1.0) * np.eye(len(normal))
