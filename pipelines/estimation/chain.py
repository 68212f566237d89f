"""Design the stationary Kalman filter of a chain of integrators in closed form, and run recursions.

A chain of integrators is driven by a held random input and seen through noise (Kostić et al. 2004,
eq. (18)-(20)). Units inside: noise of variance one, and time in units of T / h with
h = min(1, Λ^(1/n)), so that the poles of the observer lie about a unit from the origin however slow
it is. Λ = σ T^n / √R is the only number that matters: the "tracking index" of Kalata 1984, IEEE
Trans. Aerosp. Electron. Syst. 20, p. 174.

A recursion x_{k+1} = A x_k + b u_k over many samples is cut into blocks of B samples. Within a
block everything is one small matrix applied to the B inputs and the state at its start; between
blocks x_{b+1} = A^B x_b + s_b is a recursion over N / B states, solved by doubling (Hillis & Steele
1986, p. 1173), which ends as soon as A^(B 2^j) has died out.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np
import numpy.typing as npt

from pipelines.errors import UsageError

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

ORDERS = (2, 3, 4)  # numerics: of the chain
# |numerator of the held integrator chain|² on the unit circle = Π (1 - w / root),
# w = 4 sin²(ω T / 2). Euler-Frobenius polynomials: (z + 1)/2, (z² + 4 z + 1)/6,
# (z³ + 11 z² + 11 z + 1)/24. Åström, Hagander & Sternby 1984.
_ZEROS = {2: (4.0,), 3: (6.0, 6.0), 4: (4.0, 12.0, 12.0)}


@dataclass(frozen=True)
class Stationary:
    """The Kalman filter of a chain for each joint after its start, in units of (T / h, √R)."""

    order: int
    tracking_index: Array  # Λ (joints,)
    step: Array  # h (joints,)
    poles: Complex  # (joints, order) in z
    gain: Array  # k (joints, order)
    remainder: Array  # 1 - k_1 (joints,): the rest of an innovation after the update
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

    def position_gain(self, angle: Array) -> Array:
        """|1 - (1 - k_1) Π (z - 1) / (z - p_i)| at z = e^{j angle}, broadcast against joints."""
        ahead = 2j * np.sin(angle / 2.0) * np.exp(0.5j * angle)  # z - 1, exact near zero
        ratio = np.prod(ahead[..., None] / (ahead[..., None] + 1.0 - self.poles), axis=-1)
        return np.asarray(np.abs(1.0 - self.remainder * ratio))

    def numerator(self, w: Array) -> Array:
        """Return |c adj(z - E) γ|² at w = 4 sin²(ω T / 2), shape of `w`."""
        return np.real(_numerator(self.order, np.asarray(w, dtype=np.complex128)))


def transition(order: int, step: Array) -> Array:
    """E(h) = Σ_j N^j h^j / j! (..., order, order), for any h. Kostić et al. 2004, eq. (19b)."""
    ahead = np.arange(order) - np.arange(order)[:, None]
    weight = [[1.0 / factorial(max(a, 0)) if a >= 0 else 0.0 for a in row] for row in ahead]
    step = np.asarray(step, dtype=np.float64)[..., None, None]
    return np.asarray(np.array(weight) * step ** np.maximum(ahead, 0))


def held_input(order: int, step: Array) -> Array:
    """γ(h) = [h^n / n!, ..., h] (..., order): what an input held over h adds. Eq. (19b)."""
    power = np.arange(order, 0, -1)
    return np.asarray(np.asarray(step)[..., None] ** power / [factorial(p) for p in power])


def input_covariance(order: int, step: Array, count: int, jerk: Array) -> Array:
    """Q_m = σ² Σ_{i<m} (E^i γ)(E^i γ)^T for m = 0 .. count: (joints, count + 1, order, order)."""
    away = transition(order, np.multiply.outer(step, np.arange(count)))
    reach = (away @ held_input(order, step)[:, None, :, None])[..., 0] * jerk[:, None, None]
    total = np.zeros((len(step), count + 1, order, order))
    np.cumsum(reach[..., :, None] * reach[..., None, :], axis=1, out=total[:, 1:])
    return total


def stationary(order: int, tracking_index: Array) -> Stationary:
    """Return the filter for Λ (joints,), to about full relative precision for any Λ.

    The return difference D(z) D(1/z) S / R = (z - 1)^n (1/z - 1)^n + Λ² |numerator|² depends on
    w = 2 - z - 1/z alone (Kailath, Sayed & Hassibi 2000, ch. 8), so a polynomial of degree n
    replaces the Riccati equation, and its small roots keep the digits that a solver in z loses.

    Raises:
        UsageError: C02, an order that is not known, or Λ that is no positive number.
    """
    if order not in ORDERS:
        words = f"an observer of order {order} is not known"
        raise UsageError("C02", words, remedy="choose order 2, 3 or 4")
    index = np.atleast_1d(np.asarray(tracking_index, dtype=np.float64))
    if not (np.all(np.isfinite(index)) and np.all(index > 0.0)):
        words = "jerk level, noise and sample time of an observer must be positive numbers"
        raise UsageError("C02", words, remedy="correct them")
    delta = _inside(_spectral_roots(order, index))
    step = np.minimum(1.0, index ** (1.0 / order))
    unit = transition(order, np.ones(1))[0]
    nilpotent = unit - np.eye(order)
    rows = np.array([(np.linalg.matrix_power(nilpotent, k) @ unit)[0] for k in range(order)])
    # D(δ) = δ^n (1 + c (δ - N)^-1 E k), δ = z - 1: coefficient n-1-i of D is c N^i E k
    product = np.zeros((len(delta), order + 1), dtype=np.complex128)  # Π (δ - δ_i), highest first
    product[:, 0] = 1.0
    for k in range(order):
        product[:, 1 : k + 2] -= delta[:, k, None] * product[:, : k + 1]
    gain = np.linalg.solve(rows, product[:, 1:].real.T).T / step[:, None] ** np.arange(order)
    remainder = np.prod(1.0 + delta, axis=1).real
    e = transition(order, step)
    updater = np.broadcast_to(np.eye(order), e.shape).copy()
    updater[:, :, 0] -= gain
    updater[:, 0, 0] = remainder
    a = e @ updater
    jerk = (index / step**order)[:, None, None]
    driven = jerk * held_input(order, step)[..., None]
    noise = np.concatenate([e @ gain[..., None], driven], axis=2)
    prior = lyapunov(a, noise @ noise.swapaxes(1, 2))
    posterior = updater @ prior @ updater.swapaxes(1, 2) + gain[:, :, None] * gain[:, None, :]
    filters = (gain, remainder, e, a, updater, prior, posterior)
    return Stationary(order, index, step, 1.0 + delta, *filters)


def lyapunov(a: Array, q: Array) -> Array:
    """X = A X A^T + Q for each joint, by the Kronecker product: time is in the poles' own unit."""
    joints, n, _ = a.shape
    product = np.einsum("nij,nkl->nikjl", a, a).reshape(joints, n * n, n * n)
    x = np.linalg.solve(np.eye(n * n) - product, q.reshape(joints, n * n, 1)).reshape(joints, n, n)
    return np.asarray(0.5 * (x + x.swapaxes(1, 2)))


def _numerator(order: int, w: Complex) -> Complex:
    return np.asarray(np.prod([1.0 - w / root for root in _ZEROS[order]], axis=0))


def _spectral_roots(order: int, index: Array) -> Complex:
    """Return the n roots w of w^n + Λ² Π (1 - w / root) = 0 for every Λ.

    Companion matrices, then Newton on the factored form.
    """
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
            others = [1.0 - w / other for i, other in enumerate(_ZEROS[order]) if i != k]
            rest = np.prod(others or [np.ones_like(w)], axis=0)
            slope = slope - weight[:, None] * scale[:, None] / root * rest
        v = v - value / slope
    return np.asarray(v * scale[:, None])


def _inside(w: Complex) -> Complex:
    """δ = z - 1 of the root inside the unit circle of z + 1/z = 2 - w: δ² + w δ + w = 0."""
    root = np.sqrt(w * w / 4.0 - w)
    one, other = -w / 2.0 + root, -w / 2.0 - root
    larger = np.where(np.abs(one) > np.abs(other), one, other)
    smaller = w / larger
    return np.where(np.abs(1.0 + larger) < np.abs(1.0 + smaller), larger, smaller)


def powers(a: Array, count: int) -> Array:
    """A^0 .. A^count, (joints, count + 1, n, n), by doubling."""
    joints, n, _ = a.shape
    out = np.empty((joints, count + 1, n, n))
    out[:, 0] = np.eye(n)
    known, top = 1, a
    while known <= count:
        more = min(known, count + 1 - known)
        np.matmul(out[:, :more], top[:, None], out=out[:, known : known + more])
        top = top @ top
        known += more
    return out


def scan(m: Array, drive: Array) -> Array:
    """x_0 = d_0, x_{b+1} = M x_b + d_{b+1}, in place of `drive` (joints, blocks, n)."""
    blocks, reach, shift = drive.shape[1], m.swapaxes(1, 2), 1
    while shift < blocks and float(np.abs(reach).max()) > 1e-22:
        drive[:, shift:] += drive[:, :-shift] @ reach
        reach = reach @ reach
        shift *= 2
    return drive


def impulse_toeplitz(h: Array) -> Array:
    """Return the matrix [j, i] = h[i - j] of a causal impulse response (..., B): (..., B, B)."""
    size = h.shape[-1]
    lag = np.arange(size) - np.arange(size)[:, None]
    return np.where(lag >= 0, h[..., np.maximum(lag, 0)], 0.0)
