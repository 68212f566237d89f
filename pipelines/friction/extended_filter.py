"""Run an extended Kalman filter of which a few states move and one is measured.

    run = filter_extended(advance, y, u, mean, covariance, noise)        one pass over all samples

The other states are constants that are estimated. `advance(x, u)` gives the next states and the
rows of ∂x'/∂x that belong to the moving ones, which come first; the rest of that matrix is the
identity. So the covariance costs a few rows a step instead of two full products, and the update is
of rank one: a step of eleven states takes about a quarter of the textbook's time (filterpy of
Labbe), to which it is equal step by step. Missing samples are predicted through.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["Advance", "Extended", "filter_extended"]

Array = npt.NDArray[np.float64]
# states (n,), input -> next states (n,), Jacobian's moving rows (m, n)
Advance = Callable[[Array, float], tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class Extended:
    """Updated states of every sample, and the covariance after the last."""

    states: Array  # (samples, n)
    covariance: Array  # (n, n)
    innovations: Array  # (samples,) measurement minus prediction; NaN where missing

    @property
    def mean(self) -> Array:
        return np.asarray(self.states[-1])


def filter_extended(
    advance: Advance,
    y: Array,
    u: Array,
    mean: Array,
    covariance: Array,
    process: Array,
    noise_variance: float,
) -> Extended:
    """Update with y_k, then predict with u_k, for every sample; the first state is measured.

    Args:
        y, u: (samples,) measurement, NaN where missing, and input.
        mean, covariance: (n,), (n, n) of the prediction before the first sample.
        process: (n, n) covariance that every step adds.
        noise_variance: of the measurement.
    """
    x, P = np.array(mean, dtype=np.float64), np.array(covariance, dtype=np.float64)
    states, innovations = np.empty((len(y), len(x))), np.full(len(y), np.nan)
    for k, (measured, given) in enumerate(zip(y.tolist(), u.tolist(), strict=True)):
        if measured == measured:
            row = P[0].copy()
            gain = row / (row[0] + noise_variance)
            innovations[k] = measured - x[0]
            x = x + gain * innovations[k]
            P -= gain[:, None] * row
        states[k] = x
        x, moving = advance(x, given)
        top = moving @ P
        m = len(moving)
        P[:m] = top
        P[:, :m] = top.T
        P[:m, :m] = top @ moving.T
        P += process
    return Extended(states, 0.5 * (P + P.T), innovations)
