"""A simulation that shares no line with ours: Pinocchio's articulated-body algorithm, RK4 in fixed steps, controllers written anew.

The observer is the transfer function of `verified.md`, section 5, not the recursion (20).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

Vector = np.ndarray
Friction = Callable[[Vector], Vector]
Law = Callable[[int, Vector], Vector]


@dataclass
class Loop:
    """Pinocchio's arm with friction, moved by a law that is asked once a sample."""

    model: Any
    friction: Friction = np.zeros_like
    sample_time: float = 1e-3
    steps: int = 8  # of RK4, a sample

    def __post_init__(self) -> None:
        self.data = self.model.createData()

    def acceleration(self, q: Vector, dq: Vector, tau: Vector) -> Vector:
        return pin.aba(self.model, self.data, q, dq, tau - self.friction(dq)).copy()

    def advance(self, q: Vector, dq: Vector, tau: Vector) -> tuple[Vector, Vector]:
        h = self.sample_time / self.steps
        for _ in range(self.steps):
            a = self.acceleration(q, dq, tau)
            v = dq + h / 2 * a
            b = self.acceleration(q + h / 2 * dq, v, tau)
            w = dq + h / 2 * b
            c = self.acceleration(q + h / 2 * v, w, tau)
            x = dq + h * c
            d = self.acceleration(q + h * w, x, tau)
            q, dq = q + h / 6 * (dq + 2 * v + 2 * w + x), dq + h / 6 * (a + 2 * b + 2 * c + d)
        return q, dq

    def run(self, q: Vector, dq: Vector, law: Law, samples: int) -> tuple[Vector, Vector, Vector]:
        """q, dq and the torque of every sample, (samples, joints) each."""
        rows = []
        for k in range(samples):
            tau = law(k, q)
            rows.append((q, dq, tau))
            q, dq = self.advance(q, dq, tau)
        return tuple(np.array(column) for column in zip(*rows, strict=True))  # type: ignore[return-value]


def backward_pd(q_ref: Vector, kp: Vector, kd: Vector, sample_time: float = 1e-3) -> Law:
    """τ = -Kp e - Kd (e_k - e_{k-1})/T."""
    last: list[Vector] = []

    def law(k: int, q: Vector) -> Vector:
        e = q - q_ref[k]
        de = (e - last[-1]) / sample_time if last else 0 * e
        last.append(e)
        return -kp * e - kd * de

    return law


def three_sigmoids(heights: Vector, sharpnesses: Vector, viscous: Vector) -> Friction:
    """Eq. (10) in its printed form, Σ f (1 - 2/(exp(2 w v) + 1)) + b v; heights and sharpnesses (joints, 3)."""
    return lambda v: (heights * (1 - 2 / (np.exp(np.minimum(2 * sharpnesses * v[:, None], 700.0)) + 1))).sum(axis=1) + viscous * v


class TransferObserver:
    """Error and its derivative by the difference equation of verified.md, section 5, one joint."""

    def __init__(self, gain: Vector, sample_time: float) -> None:
        a, b, g = gain[0], sample_time * gain[1], sample_time**2 * gain[2]
        self._den = np.array([a + b + g / 2 - 3, 3 - 2 * a - b + g / 2, a - 1])
        self._num_e = np.array([a, b + g / 2 - 2 * a, a - b + g / 2])
        self._num_de = np.array([b, g - 2 * b, b - g]) / sample_time
        self._y, self._e, self._de = np.zeros(3), np.zeros(3), np.zeros(3)

    def __call__(self, y: float) -> tuple[float, float]:
        self._y = np.array([y, *self._y[:2]])
        e = self._num_e @ self._y - self._den @ self._e
        de = self._num_de @ self._y - self._den @ self._de
        self._e, self._de = np.array([e, *self._e[:2]]), np.array([de, *self._de[:2]])
        return float(e), float(de)
