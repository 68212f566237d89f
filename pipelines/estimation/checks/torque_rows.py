"""Lay out the torque of logs in the columns of a rigid body whose gravity is free.

    τ_j = (Y_0j + Σ_k a_jk Y_kj) φ + F_j f_j        j: joint, k: x, y, z of the base

The regressor is linear in the gravity vector a [m/s^2] (Atkeson, An & Hollerbach 1986, eq. (9)): Y_0 is the regressor without
gravity, Y_k what a gravity of 1 m/s^2 along axis k adds. φ are the base parameters of the arm under gravity from anywhere, F the
columns that a joint has for itself: rotor inertia, friction and an offset.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pipelines.log.robot import RobotDescription
from pipelines.model.rigid.base import base_set
from pipelines.model.rigid.chain import inverse_dynamics, regressor
from pipelines.model.rigid.geometry import SerialChain, serial_chain
from pipelines.model.row_fit import Sampled

__all__ = ["FRICTION", "Array", "Order", "TorqueRows", "generic_arm", "torque_rows"]

Array = npt.NDArray[np.float64]
Order = tuple[int, ...]

_ELSEWHERE = np.array([3.1, -5.3, 7.7])  # [m/s^2] a gravity along no axis: every parameter that any gravity shows is then seen
_SEED = 20040509
FRICTION = slice(1, 5)  # of the own columns: Coulomb, viscous, viscous quadratic, Coulomb in proportion to the load


@dataclass(frozen=True, eq=False)
class TorqueRows:
    """Columns and torques of N moments of n joints; p parameters, of which gravity acts on m."""

    inertial: Array  # Y_0 (n, N, p)
    gravity: Array  # Y_k (n, N, 3, m) [per m/s^2]
    heavy: npt.NDArray[np.intp]  # (m,) indices of the parameters on which gravity acts
    own: Array  # F (n, N, c): rotor inertia, friction, offset
    unit: Array  # (n, p) mean columns of each joint's torque at an acceleration of one of that joint, without gravity
    tau: Array  # (n, N) [N m]
    start: npt.NDArray[np.intp]  # first moment of each log

    @property
    def n_joints(self) -> int:
        return int(self.tau.shape[0])

    @property
    def moments(self) -> int:
        return int(self.tau.shape[1])


@dataclass(frozen=True, eq=False)
class GenericArm:
    """The geometry of an arm, and its base parameters under gravity from anywhere."""

    chain: SerialChain  # without gravity
    columns: tuple[int, ...]  # (p,) standard parameters, 10 · link + position
    combine: Array  # (p, 10 · links): base parameters of standard parameters


def generic_arm(robot: RobotDescription) -> GenericArm:
    """Return the geometry and the base parameters of `robot` under gravity from anywhere."""
    chain = serial_chain(robot)
    found = base_set(replace(chain, gravity=_ELSEWHERE), np.random.default_rng(_SEED))
    return GenericArm(replace(chain, gravity=np.zeros(3)), found.chosen, found.combine)


def torque_rows(arm: GenericArm, motions: Sequence[Sampled], q_order: Order | None = None,
                tau_order: Order | None = None) -> TorqueRows:
    """Return the rows of `motions`, joint j of the arm taking column order[j] of the logs.

    Args:
        q_order: of the positions; None: as logged.
        tau_order: of the torques; None: as logged.
    """
    n = len(arm.chain.revolute)
    of_q, of_tau = (list(range(n) if order is None else order) for order in (q_order, tau_order))
    q, dq, ddq, coulomb = (np.concatenate([getattr(motion, name)[:, of_q] for motion in motions])
                           for name in ("q", "dq", "ddq", "coulomb"))
    tau = np.concatenate([motion.tau[:, of_tau] for motion in motions])
    inertial = regressor(arm.chain, q, dq, ddq, arm.columns).transpose(1, 0, 2)
    heavy = np.array([k for k, column in enumerate(arm.columns) if column % 10 < 4], dtype=int)
    still = np.zeros_like(q)
    pulled = [regressor(replace(arm.chain, gravity=axis), q, still, still, [arm.columns[k] for k in heavy])
              for axis in np.eye(3)]
    gravity = np.stack(pulled, axis=-2).transpose(1, 0, 2, 3)
    load = np.abs(tau)
    own = np.stack([ddq, coulomb, dq, dq * np.abs(dq), coulomb * load, np.ones_like(q)], axis=-1).transpose(1, 0, 2)
    some = slice(None, None, max(1, len(q) // 100))
    unit = np.stack([regressor(arm.chain, q[some], still[some], still[some] + np.eye(n)[j], arm.columns)[:, j].mean(axis=0)
                     for j in range(n)])
    first = np.cumsum([0, *(len(motion.t) for motion in motions)])[:-1]
    return TorqueRows(inertial, gravity, heavy, own, unit, tau.T.copy(), first)


def described_torque(arm: GenericArm, rows_of: Sequence[Sampled], standard: Array, gravity: Array) -> Array:
    """Return the torque (N, n) of known standard parameters (10 · links,) under `gravity` (3,) [m/s^2]."""
    q, dq, ddq = (np.concatenate([getattr(motion, name) for motion in rows_of]) for name in ("q", "dq", "ddq"))
    return inverse_dynamics(arm.chain, q, dq, ddq, standard, gravity)
