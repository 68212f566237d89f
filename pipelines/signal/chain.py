"""A chain of integrators driven by a held random input, seen through noise: its stationary Kalman gain in closed form.

Units inside: noise of variance one, and time in units of T / h with h = min(1, Λ^(1/n)), so that the poles of the
observer lie about a unit from the origin however slow it is. Λ = σ T^n / √R is the only number that matters: the
"tracking index" of Kalata 1984, IEEE Trans. Aerosp. Electron. Syst. 20, p. 174.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np
import numpy.typing as npt

from pipelines.errors import UsageError

__all__ = ["ORDERS", "Stationary", "held_input", "input_covariance", "stationary", "transition"]

Array = npt.NDArray[np.float64]

ORDERS = (2, 3, 4)

# |numerator of the held integrator chain|² on the unit circle = Π (1 - w / root), w = 4 sin²(ω T / 2).
# Euler-Frobenius polynomials: (z + 1)/2, (z² + 4 z + 1)/6, (z³ + 11 z² + 11 z + 1)/24. Åström, Hagander & Sternby 1984.
_ZEROS = {2: (4.0,), 3: (6.0, 6.0), 4: (4.0, 12.0, 12.0)}


@dataclass(frozen=True)
class Stationary:
    """The Kalman filter of one chain a joint after its start, in units of (T / h, √R); `joints` is the first axis."""

    order: int
    tracking_index: Array  # Λ (joints,)
    step: Array  # h (joints,)
    poles: npt.NDArray[np.complex128]  # (joints, order) in z
    gain: Array  # k (joints, order)
    remainder: Array  # 1 - k_1 (joints,): what is left of an innovation after the update
    transition: Array  # E (joints, order, order)
    predictor: Array  # A = E (I - k c): from prediction to prediction
    updater: Array  # I - k c
    prior: Array  # P, covariance of the prediction
    posterior: Array  # (I - k c) P, in the form that stays positive

    @property
    def settled(self) -> int:
        """Samples after which a start, a gap or an end is forgotten to 1e-16."""
        radius = float(np.abs(self.poles).max())
        return max(2, int(np.ceil(37.0 / -np.log(max(radius, 1e-12)))))

    def numerator(self, w: Array) -> Array:
        """|c adj(z - E) γ|² at w = 4 sin²(ω T / 2), shape of `w`."""
        return np.real(_numerator(self.order, np.asarray(w, dtype=np.complex128)))


def transition(order: int, step: Array) -> Array:
    """E(h) = Σ_j N^j h^j / j!, exact for any h. Kostić et al. 2004, eq. (19b). Shape (..., order, order)."""
    ahead = np.arange(order) - np.arange(order)[:, None]
    weight = np.array([[1.0 / factorial(max(a, 0)) if a >= 0 else 0.0 for a in row] for row in ahead])
    return np.asarray(weight * np.asarray(step, dtype=np.float64)[..., None, None] ** np.maximum(ahead, 0))


def held_input(order: int, step: Array) -> Array:
    """γ(h) = [h^n / n!, ..., h]: what an input held over h adds. Kostić et al. 2004, eq. (19b). Shape (..., order)."""
    power = np.arange(order, 0, -1)
    return np.asarray(np.asarray(step)[..., None] ** power / np.array([factorial(p) for p in power]))


def input_covariance(order: int, step: Array, count: int, jerk: Array) -> Array:
    """Q_m = σ² Σ_{i<m} (E^i γ)(E^i γ)^T for m = 0 .. count: (joints, count + 1, order, order)."""
    away = transition(order, np.multiply.outer(step, np.arange(count)))  # (joints, count, order, order)
    reach = (away @ held_input(order, step)[:, None, :, None])[..., 0] * jerk[:, None, None]
    total = np.zeros((len(step), count + 1, order, order))
    np.cumsum(reach[..., :, None] * reach[..., None, :], axis=1, out=total[:, 1:])
    return total


def stationary(order: int, tracking_index: Array) -> Stationary:
    """Gain and covariances from the roots of w^n + Λ² |numerator|² = 0, to about full relative precision for any Λ.

    The return difference D(z) D(1/z) S / R = (z - 1)^n (1/z - 1)^n + Λ² |numerator|² depends on w = 2 - z - 1/z alone
    (Kailath, Sayed & Hassibi 2000, ch. 8), so a polynomial of degree n replaces the Riccati equation, and its small roots
    keep their digits where a Riccati solver in z loses them.
    """
    if order not in ORDERS:
        raise UsageError("C02", f"an observer of order {order} is not known", remedy="choose order 2, 3 or 4")
    index = np.atleast_1d(np.asarray(tracking_index, dtype=np.float64))
    if not (np.all(np.isfinite(index)) and np.all(index > 0.0)):
        raise UsageError("C02", "jerk level, noise and sample time of an observer must be positive numbers", remedy="correct them")
    delta = _inside(_spectral_roots(order, index))
    step = np.minimum(1.0, index ** (1.0 / order))
    unit = transition(order, np.ones(1))[0]
    nilpotent, rows = unit - np.eye(order), [unit[0]]
    for _ in range(order - 1):
        rows.append((np.linalg.matrix_power(nilpotent, len(rows)) @ unit)[0])
    # D(δ) = δ^n (1 + c (δ - N)^-1 E k), δ = z - 1: coefficient n-1-i of D is c N^i E k, a triangular system
    product = np.zeros((len(delta), order + 1), dtype=np.complex128)  # Π (δ - δ_i), highest power first
    product[:, 0] = 1.0
    for k in range(order):
        product[:, 1:k + 2] -= delta[:, k, None] * product[:, :k + 1]
    descending = product[:, 1:].real
    gain = np.linalg.solve(np.array(rows), descending.T).T / step[:, None] ** np.arange(order)
    remainder = np.prod(1.0 + delta, axis=1).real
    e = transition(order, step)
    updater = np.broadcast_to(np.eye(order), e.shape).copy()
    updater[:, :, 0] -= gain
    updater[:, 0, 0] = remainder
    a = e @ updater
    jerk = (index / step**order)[:, None, None]
    noise = np.concatenate([e @ gain[..., None], jerk * held_input(order, step)[..., None]], axis=2)
    prior = lyapunov(a, noise @ noise.swapaxes(1, 2))
    posterior = updater @ prior @ updater.swapaxes(1, 2) + gain[:, :, None] * gain[:, None, :]
    return Stationary(order, index, step, 1.0 + delta, gain, remainder, e, a, updater, prior, posterior)


def lyapunov(a: Array, q: Array) -> Array:
    """X = A X A^T + Q, one a joint, by the Kronecker product: exact enough because time is measured in the poles' own unit."""
    joints, n, _ = a.shape
    product = np.einsum("nij,nkl->nikjl", a, a).reshape(joints, n * n, n * n)
    x = np.linalg.solve(np.eye(n * n) - product, q.reshape(joints, n * n, 1)).reshape(joints, n, n)
    return np.asarray(0.5 * (x + x.swapaxes(1, 2)))


def _numerator(order: int, w: npt.NDArray[np.complex128]) -> npt.NDArray[np.complex128]:
    product = np.ones_like(w)
    for root in _ZEROS[order]:
        product = product * (1.0 - w / root)
    return product


def _spectral_roots(order: int, index: Array) -> npt.NDArray[np.complex128]:
    """The n roots w of w^n + Λ² Π (1 - w / root) = 0 for every Λ: companion matrices, then Newton on the factored form."""
    scale = np.minimum(1.0, index ** (2.0 / order))
    weight = index**2 / scale**order
    numerator = np.array([1.0])
    for root in _ZEROS[order]:
        numerator = np.convolve(numerator, [1.0, -1.0 / root])  # ascending powers of w
    companion = np.zeros((len(index), order, order))
    companion[:, 1:, :-1] = np.eye(order - 1)
    companion[:, :, -1] = -weight[:, None] * numerator * scale[:, None] ** np.arange(order)
    v = np.linalg.eigvals(companion).astype(np.complex128)
    for _ in range(4):
        w = v * scale[:, None]
        value = v**order + weight[:, None] * _numerator(order, w)
        slope = order * v ** (order - 1)
        for k, root in enumerate(_ZEROS[order]):
            rest = np.prod([1.0 - w / other for i, other in enumerate(_ZEROS[order]) if i != k] or [np.ones_like(w)], axis=0)
            slope = slope - weight[:, None] * scale[:, None] / root * rest
        v = v - value / slope
    return np.asarray(v * scale[:, None])


def _inside(w: npt.NDArray[np.complex128]) -> npt.NDArray[np.complex128]:
    """δ = z - 1 of the root inside the unit circle of z + 1/z = 2 - w, that is δ² + w δ + w = 0."""
    root = np.sqrt(w * w / 4.0 - w)
    larger = np.where(np.abs(-w / 2.0 + root) > np.abs(-w / 2.0 - root), -w / 2.0 + root, -w / 2.0 - root)
    smaller = w / larger
    return np.where(np.abs(1.0 + larger) < np.abs(1.0 + smaller), larger, smaller)
