"""What a sample is beyond what the samples before it tell: errors of the best linear prediction, which are white.

    weights = prediction_weights(covariance)        (p + 1, p + 1) from an autocovariance (p + 1,)
    prediction_errors(weights, x)                   (channels, samples) of signals that begin with their first sample

With r_k the autocovariance of a stationary signal, the prediction of x_i by the k samples before it has weights a with

    R a = (r_1 … r_k),    R = toeplitz(r_0 … r_{k-1}),    σ_k² = r_0 - a · (r_1 … r_k)       (Yule 1927, Walker 1931)

and √r_0 (x_i - Σ_j a_j x_{i-j}) / σ_k has the power of x. The first p samples are predicted by as many as there are (Durbin 1960),
the others by p.
"""

from __future__ import annotations

import numpy as np

from pipelines.io.log import Array

__all__ = ["prediction_errors", "prediction_weights"]


def prediction_weights(covariance: Array, ridge: float = 0.0) -> Array:
    """(p + 1, p + 1), of a sample and of those before it, predicted by none, by one, … by p; of a signal that is zero, ones of it.

    Args:
        covariance: (p + 1,) at lags 0 … p.
        ridge: white power added, as a share of the signal's: that of what a smooth signal lacks rises by no more than 1 / ridge.
    """
    from scipy.linalg import solve_toeplitz

    out = np.zeros((len(covariance), len(covariance)))
    if covariance[0] <= 0.0:
        out[:, 0] = 1.0
        return out
    r = covariance / covariance[0]
    r[0] += ridge
    for order in range(len(r)):
        a = solve_toeplitz(r[:order], r[1:order + 1]) if order else np.zeros(0)
        left = r[0] - a @ r[1:order + 1]
        out[order, :order + 1] = np.concatenate([[1.0], -a]) / np.sqrt(max(left, ridge))
    return out


def prediction_errors(weights: Array, x: Array) -> Array:
    """(channels, samples) of `x` (channels, samples)."""
    from scipy.ndimage import convolve1d

    middle = len(weights) // 2  # of the taps, where a filter that looks both ways has its origin
    out = np.asarray(convolve1d(x, weights[-1], 1, np.float64, "constant", origin=-middle))
    for sample in range(min(len(weights) - 1, x.shape[1])):
        out[:, sample] = x[:, sample::-1] @ weights[sample, :sample + 1]
    return out
