"""Energy, linear in the same parameters as torque.

The balance of power that follows checks a fit without acceleration.

    E = e(q, dq) p,    dq · τ_rigid = d/dt E

Gautier & Khalil 1988. Kinetic: ½ dqᵀ D dq, with D dq from the regressor at ddq = dq. Potential:
minus gravity's work on every mass, from the links' frames.
"""

from __future__ import annotations

import numpy as np

from pipelines.dynamics.altered import chain_of
from pipelines.dynamics.body import Array, RigidBody
from pipelines.dynamics.kinematics import forward_kinematics

__all__ = ["energy", "kinetic_energy", "potential_energy", "work"]


def energy(body: RigidBody, q: Array, dq: Array) -> Array:
    """e (samples, parameters): kinetic and potential energy [J] for each unit of a parameter."""
    return kinetic_energy(body, q, dq) + potential_energy(body, q)


def kinetic_energy(body: RigidBody, q: Array, dq: Array) -> Array:
    """½ dqᵀ D(q) dq by parameter; D dq is what acceleration dq needs at rest, less gravity."""
    rest = np.zeros_like(q)
    momentum = body.regressor(q, rest, dq) - body.regressor(q, rest, rest)
    return np.asarray(0.5 * np.einsum("sj,sjk->sk", dq, momentum))


def potential_energy(body: RigidBody, q: Array) -> Array:
    """Potential energy by parameter (samples, parameters) [J], up to a constant for each.

    -gᵀ (m x + R h): x the position of a link's frame, R its rotation, h its first moment.
    """
    chain = chain_of(body)
    frames = forward_kinematics(chain, q)
    out = np.zeros((len(q), chain.n_joints, 10))
    out[:, :, 0] = -frames.position @ chain.gravity
    out[:, :, 1:4] = -np.einsum("a,sjab->sjb", chain.gravity, frames.rotation)
    return np.asarray(out.reshape(len(q), -1) @ body.links_behind)


def work(q: Array, tau: Array) -> Array:
    """∫ τᵀ dq (samples,) [J] from the first sample on, by the trapezoidal rule over position.

    No speed is needed.
    """
    power = 0.5 * (tau[1:] + tau[:-1]) * np.diff(q, axis=0)
    return np.concatenate([[0.0], np.cumsum(power.sum(axis=1))])
