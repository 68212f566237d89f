"""Estimate the spread of a fit whose residual is correlated and partly an error of the model.

    Cov = (G-1)/G Σ_b (θ_-b - θ)(θ_-b - θ)ᵀ        θ_-b: the fit without cluster b

The jackknife over clusters (Bell & McCaffrey 2002) holds under correlation of any kind within them,
and for as many parameters as clusters, for which a sandwich of scores is too small.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from pipelines.estimation.checks.gravity_fit import LOOSE, GravityFit, GravityModel
from pipelines.estimation.checks.torque_rows import CLUSTERS, Array

__all__ = ["effective_moments", "gravity_spread", "jackknife"]

_RIDGE = 1e-9  # numerics: of equilibrated columns


def effective_moments(residuals: Array, starts: npt.NDArray[np.intp]) -> Array:
    """Return the number of independent moments (n,) of residuals (n, N), `starts` the first of
    each stretch.

    ν = N / (1 + 2 Σ ρ_k), summed over the initial positive pairs of the autocorrelation (Geyer
    1992).
    """
    n, total = residuals.shape
    edges = [*starts.tolist(), total]
    length = max(b - a for a, b in pairwise(edges))
    size = 1 << (2 * length - 1).bit_length()
    centred = residuals - residuals.mean(axis=1, keepdims=True)
    power = sum(np.abs(np.fft.rfft(centred[:, a:b], size, axis=1)) ** 2 for a, b in pairwise(edges))
    rho = np.fft.irfft(power, size, axis=1)[:, :length]
    rho = rho / np.maximum(rho[:, :1], 1e-300)
    pairs = rho[:, : length // 2 * 2].reshape(n, -1, 2).sum(axis=2)
    positive = np.cumprod(pairs > 0, axis=1)
    correlation = np.maximum(2.0 * np.sum(pairs * positive, axis=1) - 1.0, 1.0)
    return np.asarray(np.maximum(total / correlation, 2.0))


def gravity_spread(
    model: GravityModel, fit: GravityFit, groups: Array
) -> tuple[Array, Array, Array]:
    """Return the spread of the gravity along `groups` (k, n, 3) and of the own coefficients, all
    fitted together.

    Returns:
        covariance (k, k) of the gravity's changes; own coefficients (n, c) and their covariance
        (n c, n c).
    """
    rows = model.rows
    n, moments, p = rows.inertial.shape
    c, k = rows.own.shape[2], len(groups)
    width = k + p + n * c
    gram, right = np.zeros((CLUSTERS, width, width)), np.zeros((CLUSTERS, width))
    naive = np.zeros((width, width))
    flat = groups.reshape(k, -1)
    prior = np.zeros((width, width))
    prior[:k, :k] = flat @ flat.T / (n * LOOSE**2)
    own = slice(k + p, width)  # before any data no law of friction exceeds a joint's torque
    laws = rows.own_rms * (rows.dissipated != 0.0) / model.size[:, None]
    prior[own, own] = np.diag(laws.ravel() ** 2)
    pulls = rows.gravity @ fit.parameters[rows.heavy]  # (n, N, 3)
    for j in range(n):
        rigid = rows.inertial[j].copy()
        rigid[:, rows.heavy] += np.einsum("k,nkm->nm", fit.gravity[j], rows.gravity[j])
        design = np.concatenate([pulls[j] @ groups[:, j].T, rigid, rows.own[j]], axis=1)
        design = design / (model.size[j] * np.sqrt(fit.variance[j]))
        target = rows.tau[j] / (model.size[j] * np.sqrt(fit.variance[j]))
        at = np.r_[0 : k + p, k + p + j * c : k + p + (j + 1) * c]
        for b in range(CLUSTERS):
            part = design[rows.cluster == b]
            gram[b][np.ix_(at, at)] += part.T @ part
            right[b][at] += part.T @ target[rows.cluster == b]
        power = fit.residual[j] ** 2 / fit.variance[j]
        naive[np.ix_(at, at)] += design.T @ design * power * moments / model.effective[j]
    theta, covariance = jackknife(gram, right, prior, naive)
    return covariance[:k, :k], theta[own].reshape(n, c), covariance[own, own]


def jackknife(
    gram: Array, right: Array, prior: Array, naive: Array | None = None
) -> tuple[Array, Array]:
    """Return the weighted least squares fit (w,) and its covariance (w, w).

    Args:
        gram: (G, w, w) normal matrix of each cluster.
        right: (G, w) its right-hand side.
        prior: (w, w) precision before any data, of zero mean.
        naive: (w, w) of the scores, by the number of independent moments: the covariance is no
            smaller than by it.
    """
    normal = gram.sum(axis=0) + prior
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-12 * np.max(np.diag(normal), initial=1e-300)))
    ridge = np.diag(_RIDGE * scale**2)
    theta = np.linalg.solve(normal + ridge, right.sum(axis=0))
    without = normal[None] - gram + ridge
    change = np.linalg.solve(without, (gram @ theta - right)[:, :, None])[:, :, 0]
    count = len(gram)
    covariance = (count - 1.0) / count * change.T @ change
    inverse = np.linalg.inv(normal + ridge)
    if naive is not None:
        plain = inverse @ naive @ inverse
        ratio = np.sqrt(np.maximum(np.diag(plain) / np.maximum(np.diag(covariance), 1e-300), 1.0))
        covariance = covariance * np.outer(ratio, ratio)
    return theta, covariance + inverse @ (prior @ inverse)
