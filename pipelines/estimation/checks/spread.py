"""Estimate the spread of a fit whose residual is correlated and partly an error of the model.

    Cov = H⁻¹ (Σ_b s_b s_bᵀ) H⁻¹        s_b: score of a block of time over all joints (Liang & Zeger 1986)

That holds under correlation of any kind within the blocks. Where it is smaller, the variance of as many independent moments as the
residual's correlation leaves is used instead.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from pipelines.estimation.checks.gravity_fit import LOOSE, GravityFit, GravityModel
from pipelines.estimation.checks.torque_rows import Array

__all__ = ["effective_moments", "friction_spread", "gravity_spread"]

_RIDGE = 1e-9  # of the largest eigenvalue of an equilibrated information matrix: below is rounding
_BLOCKS = 20  # of all logs together


def effective_moments(residuals: Array, starts: npt.NDArray[np.intp]) -> Array:
    """Return the number of independent moments (n,) of residuals (n, N), `starts` the first of each log.

    ν = N / (1 + 2 Σ ρ_k), summed over the initial positive pairs of the autocorrelation (Geyer 1992).
    """
    n, total = residuals.shape
    edges = [*starts.tolist(), total]
    length = max(b - a for a, b in pairwise(edges))
    size = 1 << (2 * length - 1).bit_length()
    centred = residuals - residuals.mean(axis=1, keepdims=True)
    power = sum(np.abs(np.fft.rfft(centred[:, a:b], size, axis=1)) ** 2 for a, b in pairwise(edges))
    rho = np.fft.irfft(power, size, axis=1)[:, :length]
    rho = rho / np.maximum(rho[:, :1], 1e-300)
    pairs = rho[:, :length // 2 * 2].reshape(n, -1, 2).sum(axis=2)
    positive = np.cumprod(pairs > 0, axis=1)
    correlation = np.maximum(2.0 * np.sum(pairs * positive, axis=1) - 1.0, 1.0)
    return np.asarray(np.maximum(total / correlation, 2.0))


def gravity_spread(model: GravityModel, fit: GravityFit, groups: Array) -> Array:
    """Return the covariance (k, k) of the gravity's changes along `groups` (k, n, 3), all else fitted with it."""
    k = len(groups)
    designs = [np.concatenate([_pulls(model, fit, j) @ groups[:, j].T, model.rigid(j, fit)], axis=1)
               for j in range(len(fit.gravity))]
    prior = np.zeros((designs[0].shape[1],) * 2)
    flat = groups.reshape(k, -1)
    prior[:k, :k] = flat @ flat.T / (len(fit.gravity) * LOOSE**2)
    _, covariance = _clustered(model, fit, designs, list(model.residuals(fit)), prior)
    return covariance[:k, :k]


def friction_spread(model: GravityModel, fit: GravityFit) -> tuple[Array, Array]:
    """Return the own coefficients (n, c) of all joints and their covariance (n c, n c), the gravity that of `fit`."""
    rows = model.rows
    n, moments, p = rows.inertial.shape
    c = rows.own.shape[2]
    designs = []
    for j in range(n):
        design = np.zeros((moments, p + n * c))
        design[:, :p] = rows.inertial[j]
        design[:, rows.heavy] += np.einsum("k,nkm->nm", fit.gravity[j], rows.gravity[j])
        design[:, p + j * c:p + (j + 1) * c] = rows.own[j]
        designs.append(design / model.size[j])
    theta, covariance = _clustered(model, fit, designs, [rows.tau[j] / model.size[j] for j in range(n)])
    return theta[p:].reshape(n, c), covariance[p:, p:]


def _pulls(model: GravityModel, fit: GravityFit, joint: int) -> Array:
    """(N, 3) torque of 1 m/s^2 along each axis, beyond what the joint's own columns explain."""
    p, m = model.rows.inertial.shape[2], len(model.rows.heavy)
    part = model.projected[joint, :, p:p + 3 * m].reshape(-1, 3, m)
    return np.asarray(part @ fit.parameters[model.rows.heavy])


def _clustered(model: GravityModel, fit: GravityFit, designs: list[Array], targets: list[Array],
               prior: Array | float = 0.0) -> tuple[Array, Array]:
    """Weighted least squares over all joints, and its covariance."""
    width, moments = designs[0].shape[1], designs[0].shape[0]
    normal, naive = np.zeros((width, width)) + prior, np.zeros((width, width)) + prior
    right = np.zeros(width)
    for j, design in enumerate(designs):
        gram = design.T @ design / fit.variance[j]
        normal += gram
        naive += gram * moments / model.effective[j]
        right += design.T @ targets[j] / fit.variance[j]
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-12 * np.max(np.diag(normal))))
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    half = vectors / np.sqrt(np.maximum(values, _RIDGE * values[-1])) / scale[:, None]
    inverse = half @ half.T
    theta = inverse @ right
    scores = np.zeros((_BLOCKS, width))
    edges = np.linspace(0, moments, _BLOCKS + 1).astype(int)[:-1]
    for j, design in enumerate(designs):
        left = (targets[j] - design @ theta) / fit.variance[j]
        scores += np.add.reduceat(design * left[:, None], edges, axis=0)
    root = scores @ inverse * np.sqrt(_BLOCKS / (_BLOCKS - 1.0))
    clustered, plain = root.T @ root, inverse @ naive @ inverse
    ratio = np.sqrt(np.maximum(np.diag(plain) / np.maximum(np.diag(clustered), 1e-300), 1.0))
    return theta, clustered * np.outer(ratio, ratio)
