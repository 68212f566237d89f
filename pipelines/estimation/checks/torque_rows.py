"""Lay out the torque of logs in the columns of a rigid body whose gravity is free.

    τ_j = (Y_0j + Σ_k a_jk Y_kj) φ + F_j f_j        j: joint, k: x, y, z of the base

The regressor is linear in the gravity vector a [m/s^2] (Atkeson, An & Hollerbach 1986, eq. (9)):
Y_0 is the regressor without gravity, Y_k what a gravity of 1 m/s^2 along axis k adds. φ are the
base parameters of the arm under gravity from anywhere, F the columns that a joint has for itself:
rotor inertia, a smooth law of friction, and an offset.

Accelerations of a log are noisy, and noise in a column makes its parameter too small: a link that
seems lighter makes gravity seem larger. Columns and torque therefore pass through one low-pass
filter, which keeps the equation exact (Gautier 1997, "parallel decimation").
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.base_parameters import base_set
from pipelines.dynamics.chain import regressor
from pipelines.dynamics.kinematics import SerialChain, serial_chain
from pipelines.estimation.checks.config import BoundaryConfig
from pipelines.estimation.checks.joint_rows import Sampled
from pipelines.io.robot import RobotDescription

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]

_ELSEWHERE = np.array([3.1, -5.3, 7.7])  # [m/s^2] along no axis: shows all that any gravity shows
_SEED = 20040509  # numerics
_OVERLAP = 6  # numerics: moments that are kept within the length of the filter: no aliasing
_RIDGE = 1e-6  # numerics: of equilibrated columns, for a first estimate of the load alone
_CONFIG = BoundaryConfig()


@dataclass(frozen=True, eq=False)
class TorqueRows:
    """Columns and torques of N moments of n joints; p parameters, of which gravity acts on m."""

    inertial: Array  # Y_0 (n, N, p)
    gravity: Array  # Y_k (n, N, 3, m) [per m/s^2]
    heavy: Indices  # (m,) indices of the parameters on which gravity acts
    own: Array  # F (n, N, c): rotor inertia, friction, offset
    dissipated: Array  # (n, c) <F v> / (rms τ · rms v): power of each friction column; else 0
    own_rms: Array  # (n, c) RMS of the own columns before the filter
    tau: Array  # (n, N) [N m]
    start: Indices  # first moment of each stretch of even samples
    cluster: Indices  # (N,) moments of one cluster share the model's error


@dataclass(frozen=True, eq=False)
class GenericArm:
    """The geometry of an arm, and its base parameters under gravity from anywhere."""

    chain: SerialChain  # without gravity
    columns: tuple[int, ...]  # (p,) standard parameters, 10 · link + position


def generic_arm(robot: RobotDescription) -> GenericArm:
    """Return the geometry and the base parameters of `robot` under gravity from anywhere."""
    chain = serial_chain(robot)
    base = base_set(replace(chain, gravity=_ELSEWHERE), np.random.default_rng(_SEED))
    return GenericArm(replace(chain, gravity=np.zeros(3)), base.chosen)


def torque_rows(
    arm: GenericArm,
    motions: Sequence[Sampled],
    q_order: Sequence[int] | None = None,
    tau_order: Sequence[int] | None = None,
) -> TorqueRows:
    """Return the rows of `motions`, joint j of the arm taking column order[j] of the logs.

    Args:
        q_order: of the positions; None: as logged.
        tau_order: of the torques; None: as logged.
    """
    n, p = len(arm.chain.revolute), len(arm.columns)
    of_q, of_tau = (list(range(n) if order is None else order) for order in (q_order, tau_order))
    q, dq, ddq, coulomb = (
        np.concatenate([getattr(motion, name)[:, of_q] for motion in motions])
        for name in ("q", "dq", "ddq", "coulomb")
    )
    tau = np.concatenate([motion.tau[:, of_tau] for motion in motions])
    heavy = np.array([k for k, column in enumerate(arm.columns) if column % 10 < 4], dtype=int)
    masses, still = [arm.columns[k] for k in heavy], np.zeros_like(q)
    pulled = [regressor(replace(arm.chain, gravity=a), q, still, still, masses) for a in np.eye(3)]
    inertial = regressor(arm.chain, q, dq, ddq, arm.columns)
    rigid = np.concatenate([inertial, *pulled], axis=2).transpose(1, 0, 2)
    smooth = RowFilter(motions)
    own, torque, slow = own_columns(dq, ddq, coulomb), smooth(tau.T[:, :, None]), smooth(rigid)
    # of gears, in proportion to the load
    friction = np.abs(_load(slow, smooth(own), torque, rigid)) * coulomb.T[:, :, None]
    own = np.concatenate([own[:, :, :-1], friction, own[:, :, -1:]], axis=2)
    scale = np.sqrt(np.mean(dq**2, axis=0) * np.mean(tau**2, axis=0))
    dissipated = np.einsum("jnc,nj->jc", own, dq) / len(dq)
    dissipated = dissipated / np.where(scale > 0.0, scale, np.inf)[:, None]
    dissipated[:, [0, -1]] = 0.0
    return TorqueRows(
        inertial=slow[:, :, :p],
        gravity=slow[:, :, p:].reshape(n, torque.shape[1], 3, len(heavy)),
        heavy=heavy,
        own=smooth(own),
        dissipated=dissipated,
        own_rms=np.sqrt(np.mean(own**2, axis=1)),
        tau=torque[:, :, 0],
        start=smooth.start,
        cluster=smooth.clusters(q),
    )


def own_columns(dq: Array, ddq: Array, coulomb: Array) -> Array:
    """Return the columns (n, N, c) of rotor inertia, friction in speed, and offset."""
    size = np.sqrt(np.mean(dq**2, axis=0))
    size = np.where(size > 0.0, size, 1.0)
    bends = [np.tanh(dq / (width * size)) for width in _CONFIG.widths]
    columns = [ddq, coulomb, *bends, dq, dq * np.abs(dq), np.ones_like(dq)]
    return np.stack(columns, axis=-1).transpose(1, 0, 2)


def _load(slow: Array, own: Array, torque: Array, rigid: Array) -> Array:
    """Return the torque (n, N, 1) of the rigid body as each joint's own row has it, without
    friction.

    The logged torque cannot stand for it: it contains the friction that is to be explained.
    """
    design = np.concatenate([slow, own], axis=2)
    scale = np.linalg.norm(design, axis=1, keepdims=True)
    scale = np.where(scale > 0.0, scale, 1.0)
    design = design / scale
    normal = design.transpose(0, 2, 1) @ design + _RIDGE * np.eye(design.shape[2])
    fit = np.linalg.solve(normal, design.transpose(0, 2, 1) @ torque)
    return np.asarray(rigid @ (fit / scale.transpose(0, 2, 1))[:, : rigid.shape[2]])


class RowFilter:
    """A Hann window over a part of the motion's period, stretch by stretch."""

    def __init__(self, motions: Sequence[Sampled]) -> None:
        edges, spacing, rates, done = list[tuple[int, int]](), [], [], 0
        for motion in motions:
            step = float(np.median(np.diff(motion.t)))
            cuts = 1 + np.flatnonzero(np.abs(np.diff(motion.t) - step) > 0.5 * step)
            edges += pairwise([done, *(done + cuts).tolist(), done + len(motion.t)])
            spacing.append(step)
            speed = np.sqrt(np.mean(motion.dq**2, axis=0))
            rates.append(np.max(speed / np.maximum(np.std(motion.q, axis=0), 1e-12)))
            done += len(motion.t)
        period = 2.0 * np.pi / max(float(np.max(rates)), 1e-12)
        wanted = _CONFIG.periods * period / float(np.median(spacing))
        wanted = min(wanted, 0.1 * max(b - a for a, b in edges))
        self.step = max(1, int(wanted / _OVERLAP))
        self.steps = max(1, min(int(wanted), _OVERLAP))  # within the length of the window
        length = self.step * self.steps
        self.edges = [(a, b) for a, b in edges if b - a >= length]
        window = np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 2
        self.window = (window / window.sum()).reshape(self.steps, self.step)
        self.count = [(b - a - length) // self.step + 1 for a, b in self.edges]
        self.start = np.cumsum([0, *self.count])[:-1]

    def __call__(self, columns: Array) -> Array:
        """Return `columns` (n, N_all, k) filtered and thinned: (n, N, k)."""
        outputs = []
        for (a, _), count in zip(self.edges, self.count, strict=True):
            blocks = count + self.steps - 1
            part = columns[:, a : a + blocks * self.step]
            sums = self.window @ part.reshape(len(columns), blocks, self.step, columns.shape[2])
            outputs.append(sum(sums[:, k : k + count, k] for k in range(self.steps)))
        return np.concatenate(outputs, axis=1)

    def clusters(self, q: Array) -> Indices:
        """Return the cluster (N,) of each moment: of equal stretches of time, or of the phase.

        A model errs alike each time that a motion is repeated: a period counts once.
        """
        slow, longest = self(q.T[:, :, None])[:, :, 0], int(np.argmax(self.count))
        first = self.start[longest]
        period = _period(slow[:, first : first + self.count[longest]])
        if period is None:
            total = slow.shape[1]
            return np.asarray(np.arange(total) * _CONFIG.clusters // total)
        place = np.concatenate([np.arange(count) for count in self.count])
        return np.asarray(((place % period) * _CONFIG.clusters / period).astype(int))


def _period(q: Array) -> int | None:
    """Return after how many moments the motion q (n, N) repeats; None where it does not."""
    power = np.maximum(2.0 * np.var(q, axis=1), 1e-300)
    lags = range(1, 2 * q.shape[1] // 3)
    apart = [np.mean(np.mean((q[:, lag:] - q[:, :-lag]) ** 2, axis=1) / power) for lag in lags]
    away = np.flatnonzero(np.array(apart) > _CONFIG.moved_on)
    back = np.flatnonzero(np.array(apart[away[0] :]) < _CONFIG.returned) if away.size else away
    if not back.size:
        return None
    first = int(away[0] + back[0])
    return 1 + first + int(np.argmin(apart[first : first + _OVERLAP]))
