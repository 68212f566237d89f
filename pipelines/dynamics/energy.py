"""Energy, linear in the same parameters as torque.

The balance of power that follows checks a fit without acceleration.

    E = e(q, dq) p,    dq · τ_rigid = d/dt E

Gautier & Khalil 1988. Kinetic: ½ dqᵀ D dq, with D dq from the regressor at ddq = dq. Potential:
minus gravity's work on every mass, in closed form for the RRR arm and from the links' frames for
any serial arm.
"""

from __future__ import annotations

import numpy as np

from pipelines.dynamics.base_parameters import BaseArm
from pipelines.dynamics.body import Array, RigidBody
from pipelines.dynamics.kinematics import forward_kinematics
from pipelines.dynamics.rrr import RRR

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

    Raises:
        TypeError: the body is neither the closed form nor a serial arm.
    """
    if isinstance(body, RRR):
        return _of_rrr(body, q)
    if isinstance(body, BaseArm):
        return _of_chain(body, q)
    raise TypeError(f"no potential energy is known of a {type(body).__name__}")


def _of_rrr(body: RRR, q: Array) -> Array:
    """g (p3 sS + p4 cS + p14 s2 + p15 c2): its slopes are h2 and h3.

    Kostić et al. 2004, eq. (A5), ddq = dq = 0.
    """
    g = -body.robot.gravity[2]
    _, second, third = np.moveaxis(q + np.array(body.geometry.offset), -1, 0)
    out = np.zeros((len(q), 15))
    out[:, 2], out[:, 3] = g * np.sin(second + third), g * np.cos(second + third)
    out[:, 13], out[:, 14] = g * np.sin(second), g * np.cos(second)
    return out


def _of_chain(body: BaseArm, q: Array) -> Array:
    """-gᵀ (m x + R h): x the position of a link's frame, R its rotation, h its first moment."""
    chain = body.chain
    frames = forward_kinematics(chain, q)
    out = np.zeros((len(q), chain.n_joints, 10))
    out[:, :, 0] = -frames.position @ chain.gravity
    out[:, :, 1:4] = -np.einsum("a,sjab->sjb", chain.gravity, frames.rotation)
    return out.reshape(len(q), -1)[:, list(body.base.chosen)]


def work(q: Array, tau: Array) -> Array:
    """∫ τᵀ dq (samples,) [J] from the first sample on, by the trapezoidal rule over position.

    No speed is needed.
    """
    power = 0.5 * (tau[1:] + tau[:-1]) * np.diff(q, axis=0)
    return np.concatenate([[0.0], np.cumsum(power.sum(axis=1))])
