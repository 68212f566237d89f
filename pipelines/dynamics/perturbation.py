"""Compute the torque of a motion with one joint displaced.

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

__all__ = ["arm_slopes", "perturbed_by", "perturbed_torque", "rate_of", "rigid_slopes",
           "rigid_torque", "shifted", "torque_slopes"]

Torque = Callable[[Motion], Array]


class Moving(Protocol):
    """An arm: what torque it needs for a motion."""

    def torque(self, motion: Motion) -> Array: ...


# Far below what friction resolves, above rounding.
_STEP = 1e-6  # numerics: [rad], [rad/s], thousandfold [rad/s^2]


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
    """Return K_j, C_j, M_j (3, samples, joints) of an arm with its friction, kept with the
    motion."""
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
