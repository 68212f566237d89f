"""Compute the torque of a motion with one joint displaced, and the deflection of a soft joint.

    P_j(d) = K_j d + C_j ḋ + M_j d̈,    K, C, M = ∂τ/∂(q, q̇, q̈)

`torque` is any function of a motion: with friction inside, its slope is part of C. Derivatives by
time are taken of what a model predicts, never of what was measured.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np

from pipelines.dynamics.body import Array, Motion, RigidBody

__all__ = [
    "arm_slopes", "deflection", "oscillation", "perturbed_by", "perturbed_torque", "rate_of",
    "rigid_slopes", "rigid_torque", "shifted", "torque_slopes"
]

Torque = Callable[[Motion], Array]


class Moving(Protocol):
    """An arm: what torque it needs for a motion."""

    def torque(self, motion: Motion) -> Array: ...


# [rad], [rad/s], thousandfold [rad/s^2]: far below what friction resolves, above rounding
_STEP = 1e-6  # numerics: see above
_ROUNDS = 3  # numerics: each leaves what is of higher order in the deflection
_SETTLED = 1e-6  # numerics: of the deflection: less is no correction
_LEAST = 0.1  # numerics: of the inertia that a joint feels: what stays beyond its spring at least


def rate_of(x: Array, t: Array) -> Array:
    """dx/dt (samples, …) by central differences; zero of one or two samples."""
    if len(t) <= 2:  # noqa: PLR2004
        return np.zeros_like(x)
    return np.asarray(np.gradient(x, t, axis=0, edge_order=2))


def shifted(motion: Motion, index: int, d: Array, rate: Array, second: Array) -> Motion:
    """`motion` with joint `index` further by d (samples,) [rad], with the derivatives of d."""
    q, dq, ddq = motion.q.copy(), motion.dq.copy(), motion.ddq.copy()
    q[:, index] += d
    dq[:, index] += rate
    ddq[:, index] += second
    return replace(motion, q=q, dq=dq, ddq=ddq)


def perturbed_torque(torque: Torque, motion: Motion, index: int, d: Array, rate: Array,
                     second: Array) -> Array:
    """P_j(d) (samples, joints), by central differences along the direction (d, ḋ, d̈)."""
    sizes = np.abs(d).max(initial=0.0), np.abs(rate).max(initial=0.0)
    size = max(*sizes, 1e-3 * np.abs(second).max(initial=0.0))
    if size == 0.0:
        return np.zeros_like(motion.q)
    e = _STEP / size
    ahead, behind = (torque(shifted(motion, index, s * d, s * rate, s * second)) for s in (e, -e))
    return np.asarray((ahead - behind) / (2.0 * e))


def perturbed_by(slopes: Array, d: Array, rate: Array, second: Array) -> Array:
    """P_j(d) (samples, joints) by the slopes K_j, C_j, M_j."""
    spring, drag, mass = slopes
    return np.asarray(spring * d[:, None] + drag * rate[:, None] + mass * second[:, None])


def torque_slopes(torque: Torque, motion: Motion, index: int) -> Array:
    """Return K_j, C_j, M_j (3, samples, joints): P_j of any direction follows from them."""
    zero, one = np.zeros(len(motion.t)), np.ones(len(motion.t))
    units = ((one, zero, zero), (zero, one, zero), (zero, zero, one))
    return np.stack([perturbed_torque(torque, motion, index, *unit) for unit in units])


def arm_slopes(arm: Moving, motion: Motion, index: int) -> Array:
    """Return K_j, C_j, M_j (3, samples, joints) of an arm with its friction.

    Kept with the motion.
    """
    return motion.kept(("slopes of the arm", arm, index),
                       lambda: torque_slopes(arm.torque, motion, index))


def rigid_torque(body: RigidBody, p: Array, motion: Motion) -> Array:
    """Return the torque (samples, joints) of the rigid arm alone, kept with the motion."""
    return motion.kept(("torque of the body", body, p),
                       lambda: body.torque(motion.q, motion.dq, motion.ddq, p))


def rigid_slopes(body: RigidBody, p: Array, motion: Motion, index: int) -> Array:
    """Return K_j, C_j, M_j (3, samples, joints) of the rigid arm alone, kept with the motion."""
    def torque(there: Motion) -> Array:
        return body.torque(there.q, there.dq, there.ddq, p)

    return motion.kept(("slopes of the body", body, p, index),
                       lambda: torque_slopes(torque, motion, index))


def deflection(torque: Torque, slopes: Array, motion: Motion, index: int, stiffness: float,
               damping: float, inertia: float) -> tuple[Array, Array, Array]:
    """x, ẋ, ẍ (samples,) of the deflection of a joint on a spring, exactly.

        k x + d ẋ + I (q̈ + ẍ) + τ_j(q + x) = 0          for I < 0: a motor that was counted with
        its link k x + d ẋ + I ẍ + τ_j(q + x) = 0                 for I > 0: a base below the joint

    `torque` is that of the rigid arm, `slopes` (3, samples, joints) are its `torque_slopes`.
    Newton's method: what is linear in x has coefficients that vary with time and is solved from
    sample to sample.
    """
    base, own = inertia > 0.0, motion.ddq[:, index]
    zero = np.zeros(len(motion.t))
    spring, drag, mass = slopes[..., index]
    mass = np.maximum(mass + inertia, _LEAST * mass)
    drag, spring = drag + damping, np.maximum(spring + stiffness, 0.5 * stiffness)
    x = rate = second = zero
    for _ in range(_ROUNDS):
        tau = torque(shifted(motion, index, x, rate, second))[:, index]
        left = stiffness * x + damping * rate + tau + inertia * (second if base else own + second)
        more = oscillation(motion.t, mass, drag, spring, -left)
        x, rate, second = (a + b for a, b in zip((x, rate, second), more, strict=True))
        if np.abs(more[0]).max(initial=0.0) < _SETTLED * np.abs(x).max(initial=0.0):
            break
    return x, rate, second


def oscillation(t: Array, mass: Array, drag: Array, spring: Array,
                force: Array) -> tuple[Array, Array, Array]:
    """x, ẋ, ẍ of m ẍ + c ẋ + k x = f, coefficients and force (samples,).

    Settled at the first sample.

    x = f/k + y: what remains for y is small where the spring is stiff, so that no digits are lost
    there. Within a sample coefficients are held and the force is a straight line: exact for that,
    however stiff.
    """
    still = force / spring
    rate = rate_of(still, t)
    second = rate_of(rate, t)
    rest = -(mass * second + drag * rate)
    m, c, k = (0.5 * (z[1:] + z[:-1]) for z in (mass, drag, spring))
    y, dy = _propagated(np.diff(t), m, c, k, rest)
    return still + y, rate + dy, second + (rest - drag * dy - spring * y) / mass


def _propagated(h: Array, m: Array, c: Array, k: Array, f: Array) -> tuple[Array, Array]:
    """y and ẏ (samples,) of m ÿ + c ẏ + k y = f; h, m, c, k (samples - 1,) of the intervals.

    With slope s of the force, y = (f + s t)/k - c s/k² + e^(-at) (A cos wt + B sin wt), a = c/2m,
    w² = k/m - a².
    """
    s = np.diff(f) / h
    a = 0.5 * c / m
    w = np.sqrt((k / m - a * a).astype(complex))
    one, other = np.exp((1j * w - a) * h), np.exp((-1j * w - a) * h)
    # e^(-at) cos wt, sin wt / w
    cos, sinc = 0.5 * (one + other).real, ((one - other) / np.where(w == 0.0, 1.0, 2j * w)).real
    sinc, lag = np.where(w == 0.0, h * one.real, sinc), c * s / k**2
    along = np.array([[cos + a * sinc, sinc], [-sinc * k / m, cos - a * sinc]])  # (2, 2, intervals)
    before, after, speed = f[:-1] / k - lag, f[1:] / k - lag, s / k
    # settled: no ringing at the start
    still = np.array([before[:1], speed[:1]]) if len(h) else np.zeros((2, 1))
    onto = np.array([after, speed]) - np.einsum("ijn,jn->in", along, np.array([before, speed]))
    y, dy = _recurred(along, onto, still[:, 0])
    return y, dy


def _recurred(along: Array, onto: Array, start: Array) -> Array:
    """z (2, steps + 1) of z' = A z + b with A (2, 2, steps), b (2, steps).

    Many stretches at once, then put one behind the other.

    In each stretch the product of all A and the motion from rest are known without the others; z at
    its start follows from them.
    """
    steps = along.shape[2]
    length = max(1, int(np.sqrt(steps / 4.0)))
    count = -(-steps // length)
    padded = count * length - steps
    still = np.broadcast_to(np.eye(2)[:, :, None], (2, 2, padded))
    a = np.concatenate([along, still], axis=2).reshape(2, 2, count, length).transpose(3, 0, 1,
                                                                                      2).copy()
    b = np.concatenate([onto, np.zeros((2, padded))],
                       axis=1).reshape(2, count, length).transpose(2, 0, 1).copy()
    moved = np.empty((length + 1, 2, 3, count))  # from rest, and from unit starts
    moved[0] = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])[:, :, None]
    for k in range(length):
        np.multiply(a[k, :, 0, None], moved[k, 0], out=moved[k + 1])
        moved[k + 1] += a[k, :, 1, None] * moved[k, 1]
        moved[k + 1, :, 0] += b[k]
    starts = np.empty((2, count))
    u, v = start.tolist()
    for k, ((c1, p11, p12), (c2, p21, p22)) in enumerate(moved[-1].transpose(2, 0, 1).tolist()):
        starts[:, k] = u, v
        u, v = c1 + p11 * u + p12 * v, c2 + p21 * u + p22 * v
    z = moved[1:, :, 0] + moved[1:, :, 1] * starts[0] + moved[1:, :, 2] * starts[1]
    return np.concatenate([start[:, None], z.transpose(1, 2, 0).reshape(2, -1)[:, :steps]], axis=1)
