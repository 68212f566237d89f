"""Run filterpy's Kalman filters sample by sample: the reference for the fast ones.

Labbe, "Kalman and Bayesian Filters in Python". One channel at a time; a missing sample is passed as
None, because a NaN would poison every later state.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.estimation.chain import held_input, transition

__all__ = ["ExtendedTextbook", "Reference", "Textbook"]

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Reference:
    """States (samples, order) and their covariances (samples, order, order)."""

    states: Array
    covariance: Array


@dataclass(frozen=True)
class Textbook:
    """A chain of integrators, Kostić et al. 2004, eq. (18)-(19), in the order update, predict."""

    jerk_std: float  # σ [unit / s^order]
    noise_variance: float  # R [unit²]
    order: int = 3

    def filter(self, t: Array, y: Array, mean: Array, covariance: Array) -> Reference:
        """Return the updated states of one channel `y` (samples,), NaN where missing."""
        means, covariances = self._batch(t, y, mean, covariance)[1]
        return Reference(means, covariances)

    def smooth(self, t: Array, y: Array, mean: Array, covariance: Array) -> Reference:
        """Return those of the Rauch-Tung-Striebel smoother over all samples."""
        kalman, (means, covariances), (f, q) = self._batch(t, y, mean, covariance)
        # filterpy's smoother takes the step from k to k+1 from entry k+1, its filter from entry k
        states, spread, _, _ = kalman.rts_smoother(
            means, covariances, Fs=[f[0], *f[:-1]], Qs=[q[0], *q[:-1]]
        )
        return Reference(states, spread)

    def _batch(
        self, t: Array, y: Array, mean: Array, covariance: Array
    ) -> tuple[Any, tuple[Array, Array], tuple[list[Array], list[Array]]]:
        """Return the filter, its updated means and covariances, and E and Q of every step."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # filterpy imports parts of SciPy that are going away
            from filterpy.kalman import KalmanFilter
        step = np.diff(t, append=2.0 * t[-1] - t[-2])
        reach = held_input(self.order, step) * self.jerk_std
        f, q = list(transition(self.order, step)), list(reach[:, :, None] * reach[:, None, :])
        kalman = KalmanFilter(dim_x=self.order, dim_z=1)
        kalman.H, kalman.R = np.eye(self.order)[:1], np.array([[self.noise_variance]])
        kalman.x, kalman.P = (
            np.array(mean, dtype=np.float64),
            np.array(covariance, dtype=np.float64),
        )
        seen = [value if np.isfinite(value) else None for value in y.tolist()]
        means, covariances, _, _ = kalman.batch_filter(seen, Fs=f, Qs=q, update_first=True)
        return kalman, (means, covariances), (f, q)


@dataclass(frozen=True)
class ExtendedTextbook:
    """filterpy's extended filter of which the first state is measured.

    `advance(x, u)` gives the next states and the rows of the Jacobian of those that move.
    """

    advance: Callable[[Array, float], tuple[Array, Array]]
    process: Array  # (n, n) covariance that every step adds
    noise_variance: float

    def filter(self, y: Array, u: Array, mean: Array, covariance: Array) -> Reference:
        """Return the updated states of `y` (samples,), NaN where missing, under the input `u`."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from filterpy.kalman import ExtendedKalmanFilter
        n, advance = len(mean), self.advance

        class Moving(ExtendedKalmanFilter):  # type: ignore[misc]
            """filterpy's filter with this model in the place of its linear one."""

            x: Array

            def predict_x(self, u: Any = 0) -> None:
                ahead, moving = advance(self.x[:, 0], float(u))
                self.F[: len(moving)] = moving
                self.x = ahead[:, None]

        kalman = Moving(dim_x=n, dim_z=1)
        kalman.x, kalman.P = (
            np.array(mean, dtype=np.float64)[:, None],
            np.array(covariance, dtype=np.float64),
        )
        kalman.Q, kalman.R = self.process, np.array([[self.noise_variance]])
        kalman.F = np.eye(n)
        seen = np.eye(n)[:1]
        states, covariances = np.empty((len(y), n)), np.empty((len(y), n, n))
        for k in range(len(y)):
            if np.isfinite(y[k]):
                kalman.update(np.array([[y[k]]]), lambda x: seen, lambda x: x[:1])
            states[k], covariances[k] = kalman.x[:, 0], kalman.P
            kalman.predict(u[k])
        return Reference(states, covariances)
