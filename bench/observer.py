"""The Kalman observer in the loop, Kostić et al. 2004, eq. (16)-(21), for one joint at a time in plain Python."""

from __future__ import annotations

import numpy as np

__all__ = ["Observer", "observer_gain"]

Gain = tuple[float, float, float]


def observer_gain(sample_time: float, noise_std: float, jerk: float) -> Gain:
    """k of eq. (20), stationary: the Riccati equation iterated from rest until it stands still.

        E, γ of (19b);  P⁻ = E P⁺ Eᵀ + σ_ξ² γ γᵀ;  k = P⁻ c/(cᵀ P⁻ c + R);  P⁺ = (1 - k cᵀ) P⁻

    In units of T and of the noise only Λ = σ_ξ T³/σ_η is left, which keeps the numbers near one.

    Args:
        sample_time: T [s].
        noise_std: σ_η [rad].
        jerk: σ_ξ [rad/s^3].
    """
    e = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    gamma = np.array([1.0 / 6.0, 0.5, 1.0])
    q = (jerk * sample_time**3 / noise_std) ** 2 * np.outer(gamma, gamma)
    after, k = np.zeros((3, 3)), np.zeros(3)
    for _ in range(1_000_000):
        before = e @ after @ e.T + q
        k, last = before[:, 0] / (before[0, 0] + 1.0), k
        keep = np.eye(3)
        keep[:, 0] -= k
        after = keep @ before @ keep.T + np.outer(k, k)  # Joseph's form stays symmetric
        if np.abs(k - last).max() < 1e-15 * k.max():
            break
    k1, k2, k3 = (k / sample_time ** np.arange(3)).tolist()
    return k1, k2, k3


class Observer:
    """The recursion (20) for all joints; it starts with zero error."""

    def __init__(self, gains: tuple[Gain, ...], sample_time: float) -> None:
        self._gains, self._t, self._half = gains, sample_time, 0.5 * sample_time**2
        self.e = [0.0] * len(gains)  # [rad] ē
        self.de = [0.0] * len(gains)  # [rad/s]
        self.nu = [0.0] * len(gains)  # [rad/s^2]
        self._first = True

    def update(self, y: list[float]) -> None:
        """x̂ = E x̄, x̄ = x̂ + k (y - ê); y is measured minus reference position [rad]."""
        t, half = (0.0, 0.0) if self._first else (self._t, self._half)
        self._first = False
        for j, (k1, k2, k3) in enumerate(self._gains):
            nu = self.nu[j]
            e = self.e[j] + t * self.de[j] + half * nu
            de = self.de[j] + t * nu
            innovation = y[j] - e
            self.e[j] = e + k1 * innovation
            self.de[j] = de + k2 * innovation
            self.nu[j] = nu + k3 * innovation
