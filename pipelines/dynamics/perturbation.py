"""Compute the torque of a motion with one joint displaced, and the deflection of a soft joint.

    P_j(d) = K_j d + C_j ḋ + M_j d̈,    K, C, M = ∂τ/∂(q, q̇, q̈)

`torque` is any function of a motion: with friction inside, its slope is part of C. Derivatives by
time are taken of what a model predicts, never of what was measured.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
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


# Far below what friction resolves, above rounding.
_STEP = 1e-6  # numerics: [rad], [rad/s], thousandfold [rad/s^2]
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
    """P_j(d) (samples, …), by central differences along the direction (d, ḋ, d̈)."""
    sizes = np.abs(d).max(initial=0.0), np.abs(rate).max(initial=0.0)
    size = max(*sizes, 1e-3 * np.abs(second).max(initial=0.0))
    if size == 0.0:
        return np.zeros_like(torque(motion))
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


def own_slopes(body: RigidBody, p: Array, motion: Motion, index: int) -> Array:
    """Return K_j, C_j, M_j (3, samples) of the rigid arm's torque on joint `index` itself.

    They are linear in p: what multiplies it is kept with the motion.
    """

    def torque(there: Motion) -> Array:
        return np.ascontiguousarray(body.regressor(there.q, there.dq, there.ddq)[:, index])

    by_p = motion.kept(
        ("slopes of the regressor", body, index), lambda: torque_slopes(torque, motion, index)
    )
    return np.asarray(by_p @ p)


def deflection(
    body: RigidBody,
    p: Array,
    motion: Motion,
    index: int,
    stiffness: float,
    damping: float,
    inertia: float,
) -> tuple[Array, Array, Array]:
    """Return x, ẋ, ẍ (samples,) of the deflection of a joint of the rigid arm on a spring.

        k x + d ẋ + I (q̈ + ẍ) + τ_j(q + x) = 0    for I < 0: a motor counted with its link
        k x + d ẋ + I ẍ + τ_j(q + x) = 0          for I > 0: a base below the joint

    That is exact, with what the arm then needs, by Newton's method: what is linear in x has
    coefficients that vary with time and is solved from sample to sample.
    """
    base, own = inertia > 0.0, motion.ddq[:, index]
    zero = np.zeros(len(motion.t))
    spring, drag, mass = own_slopes(body, p, motion, index)
    mass = np.maximum(mass + inertia, _LEAST * mass)
    drag, spring = drag + damping, np.maximum(spring + stiffness, 0.5 * stiffness)
    oscillator = Oscillator(motion.t, mass, drag, spring)
    x = rate = second = zero
    tau = rigid_torque(body, p, motion)[:, index]
    for _ in range(_ROUNDS):
        load = tau + inertia * (second if base else own + second)
        more = oscillator.response(-(stiffness * x + damping * rate + load))
        x, rate, second = (a + b for a, b in zip((x, rate, second), more, strict=True))
        if np.abs(more[0]).max(initial=0.0) < _SETTLED * np.abs(x).max(initial=0.0):
            break
        there = shifted(motion, index, x, rate, second)
        tau = body.torque(there.q, there.dq, there.ddq, p)[:, index]
    return x, rate, second


def oscillation(
    t: Array, mass: Array, drag: Array, spring: Array, force: Array
) -> tuple[Array, Array, Array]:
    """Return x, ẋ, ẍ (samples,) of m ẍ + c ẋ + k x = f, settled at the first sample."""
    return Oscillator(t, mass, drag, spring).response(force)


@dataclass(frozen=True, eq=False)
class Oscillator:
    """m ẍ + c ẋ + k x = f with coefficients (samples,) that vary with time.

    Within a sample coefficients are held and the force is a straight line of slope s: exact for
    that, however stiff.

        x = (f + s t)/k - c s/k² + e^(-at) (A cos wt + B sin wt),    a = c/2m,    w² = k/m - a²
    """

    t: Array  # [s]
    mass: Array
    drag: Array
    spring: Array

    def response(self, force: Array) -> tuple[Array, Array, Array]:
        """Return x, ẋ, ẍ (samples,), settled at the first sample.

        x = f/k + y: what remains for y is small where the spring is stiff, so that no digits are
        lost there.
        """
        still = force / self.spring
        rate = rate_of(still, self.t)
        second = rate_of(rate, self.t)
        rest = -(self.mass * second + self.drag * rate)
        y, dy = self._propagated(rest)
        return still + y, rate + dy, second + (rest - self.drag * dy - self.spring * y) / self.mass

    @cached_property
    def _held(self) -> tuple[Array, ...]:
        """The intervals h, and m, c, k in them (samples - 1,)."""
        each = self.mass, self.drag, self.spring
        return np.diff(self.t), *(0.5 * (z[1:] + z[:-1]) for z in each)

    @cached_property
    def _along(self) -> Array:
        """A (2, 2, intervals): y and ẏ at the end of an interval by those at its start."""
        h, m, c, k = self._held
        a = 0.5 * c / m
        w = np.sqrt((k / m - a * a).astype(complex))
        one, other = np.exp((1j * w - a) * h), np.exp((-1j * w - a) * h)
        cos = 0.5 * (one + other).real  # e^(-at) cos wt
        sinc = ((one - other) / np.where(w == 0.0, 1.0, 2j * w)).real  # e^(-at) sin wt / w
        sinc = np.where(w == 0.0, h * one.real, sinc)
        return np.array([[cos + a * sinc, sinc], [-sinc * k / m, cos - a * sinc]])

    def _propagated(self, f: Array) -> tuple[Array, Array]:
        """Return y and ẏ (samples,) of m ÿ + c ẏ + k y = f."""
        h, _, c, k = self._held
        s = np.diff(f) / h
        lag = c * s / k**2
        before, after, speed = f[:-1] / k - lag, f[1:] / k - lag, s / k
        start = np.array([before[0], speed[0]]) if len(h) else np.zeros(2)  # it does not ring
        moved = np.einsum("ijn,jn->in", self._along, np.array([before, speed]))
        y, dy = self._recurred(np.array([after, speed]) - moved, start)
        return y, dy

    @cached_property
    def _stretches(self) -> tuple[Array, Array]:
        """A (length, 2, 2, stretches) of equal stretches, and its products from their start."""
        steps = self._along.shape[2]
        length = max(1, int(np.sqrt(steps / 4.0)))
        count = -(-steps // length)
        still = np.broadcast_to(np.eye(2)[:, :, None], (2, 2, count * length - steps))
        whole = np.concatenate([self._along, still], axis=2).reshape(2, 2, count, length)
        a = whole.transpose(3, 0, 1, 2).copy()
        moved = np.empty((length + 1, 2, 2, count))
        moved[0] = np.eye(2)[:, :, None]
        for k in range(length):
            np.multiply(a[k, :, 0, None], moved[k, 0], out=moved[k + 1])
            moved[k + 1] += a[k, :, 1, None] * moved[k, 1]
        return a, moved

    def _recurred(self, onto: Array, start: Array) -> Array:
        """Return z (2, steps + 1) of z' = A z + b, b (2, steps): many stretches at once.

        The motion of each from rest is found without the others; z at its start follows from them.
        """
        steps = onto.shape[1]
        a, moved = self._stretches
        length, _, _, count = a.shape
        b = np.concatenate([onto, np.zeros((2, count * length - steps))], axis=1)
        rest = np.zeros((length + 1, 2, count))
        rest[1:] = b.reshape(2, count, length).transpose(2, 0, 1)
        for k in range(length):
            rest[k + 1] += a[k, :, 0] * rest[k, 0]
            rest[k + 1] += a[k, :, 1] * rest[k, 1]
        starts = np.empty((2, count))
        u, v = start.tolist()
        each = zip(rest[-1].T.tolist(), moved[-1].transpose(2, 0, 1).tolist(), strict=True)
        for k, ((c1, c2), ((p11, p12), (p21, p22))) in enumerate(each):
            starts[:, k] = u, v
            u, v = c1 + p11 * u + p12 * v, c2 + p21 * u + p22 * v
        z = rest[1:] + moved[1:, :, 0] * starts[0] + moved[1:, :, 1] * starts[1]
        every = z.transpose(1, 2, 0).reshape(2, -1)[:, :steps]
        return np.concatenate([start[:, None], every], axis=1)
