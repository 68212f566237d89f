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

__all__ = [
    "CLUSTERS",
    "Array",
    "GenericArm",
    "RowFilter",
    "TorqueRows",
    "generic_arm",
    "own_columns",
    "torque_rows",
]

Array = npt.NDArray[np.float64]

_ELSEWHERE = np.array([3.1, -5.3, 7.7])  # [m/s^2] along no axis: shows all that any gravity shows
_SEED = 20040509  # numerics
_OVERLAP = 6  # numerics: moments that are kept within the length of the filter: no aliasing
_RIDGE = 1e-6  # numerics: of equilibrated columns, for a first estimate of the load alone
_CONFIG = BoundaryConfig()
CLUSTERS = _CONFIG.clusters


@dataclass(frozen=True, eq=False)
class TorqueRows:
    """Columns and torques of N moments of n joints; p parameters, of which gravity acts on m."""

    inertial: Array  # Y_0 (n, N, p)
    gravity: Array  # Y_k (n, N, 3, m) [per m/s^2]
    heavy: npt.NDArray[np.intp]  # (m,) indices of the parameters on which gravity acts
    own: Array  # F (n, N, c): rotor inertia, friction, offset
    dissipated: Array  # (n, c) <F v> / (rms τ · rms v): power of each friction column; else 0
    own_rms: Array  # (n, c) RMS of the own columns before the filter
    tau: Array  # (n, N) [N m]
    start: npt.NDArray[np.intp]  # first moment of each stretch of even samples
    cluster: npt.NDArray[np.intp]  # (N,) moments of one cluster share the model's error

    @property
    def n_joints(self) -> int:
        return int(self.tau.shape[0])


@dataclass(frozen=True, eq=False)
class GenericArm:
    """The geometry of an arm, and its base parameters under gravity from anywhere."""

    chain: SerialChain  # without gravity
    columns: tuple[int, ...]  # (p,) standard parameters, 10 · link + position
    combine: Array  # (p, 10 · links): base parameters of standard parameters


def generic_arm(robot: RobotDescription) -> GenericArm:
    """Return the geometry and the base parameters of `robot` under gravity from anywhere."""
    chain = serial_chain(robot)
    base = base_set(replace(chain, gravity=_ELSEWHERE), np.random.default_rng(_SEED))
    return GenericArm(replace(chain, gravity=np.zeros(3)), base.chosen, base.combine)


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
    n = len(arm.chain.revolute)
    of_q, of_tau = (list(range(n) if order is None else order) for order in (q_order, tau_order))
    q, dq, ddq, coulomb = (
        np.concatenate([getattr(motion, name)[:, of_q] for motion in motions])
        for name in ("q", "dq", "ddq", "coulomb")
    )
    tau = np.concatenate([motion.tau[:, of_tau] for motion in motions])
    heavy = np.array([k for k, column in enumerate(arm.columns) if column % 10 < 4], dtype=int)
    inertial = regressor(arm.chain, q, dq, ddq, arm.columns)
    still = np.zeros_like(q)
    masses = [arm.columns[k] for k in heavy]
    pulled = [regressor(replace(arm.chain, gravity=a), q, still, still, masses) for a in np.eye(3)]
    rigid = np.concatenate([inertial, *pulled], axis=2).transpose(1, 0, 2)
    smooth = RowFilter(motions)
    own = own_columns(dq, ddq, coulomb)
    torque = smooth(tau.T[:, :, None])[:, :, 0]
    slow = smooth(rigid)
    load = _load(slow, smooth(own), torque, rigid)
    friction = np.abs(load) * coulomb.T  # of gears, in proportion to the load
    own = np.concatenate([own[:, :, :-1], friction[:, :, None], own[:, :, -1:]], axis=2)
    dissipated = np.einsum("jnc,nj->jc", own, dq) / len(dq)
    own_rms = np.sqrt(np.mean(own**2, axis=1))
    scale = np.sqrt(np.mean(dq**2, axis=0) * np.mean(tau**2, axis=0))
    dissipated = dissipated / np.where(scale > 0.0, scale, np.inf)[:, None]
    dissipated[:, [0, -1]] = 0.0
    p = len(arm.columns)
    moments = torque.shape[1]
    return TorqueRows(
        slow[:, :, :p],
        slow[:, :, p:].reshape(n, moments, 3, len(heavy)),
        heavy,
        smooth(own),
        dissipated,
        own_rms,
        torque,
        smooth.start,
        smooth.clusters(q),
    )


def own_columns(dq: Array, ddq: Array, coulomb: Array) -> Array:
    """Return the columns (n, N, c) of rotor inertia, friction in speed, and offset."""
    size = np.sqrt(np.mean(dq**2, axis=0))
    size = np.where(size > 0.0, size, 1.0)
    laws = [
        coulomb,
        *(np.tanh(dq / (width * size)) for width in _CONFIG.widths),
        dq,
        dq * np.abs(dq),
    ]
    return np.stack([ddq, *laws, np.ones_like(dq)], axis=-1).transpose(1, 0, 2)


def _load(slow: Array, own: Array, torque: Array, rigid: Array) -> Array:
    """Return the torque (n, N) of the rigid body as each joint's own row has it, without friction.

    The logged torque cannot stand for it: it contains the friction that is to be explained.
    """
    design = np.concatenate([slow, own], axis=2)
    scale = np.linalg.norm(design, axis=1, keepdims=True)
    design = design / np.where(scale > 0.0, scale, 1.0)
    normal = design.transpose(0, 2, 1) @ design + _RIDGE * np.eye(design.shape[2])
    fit = np.linalg.solve(normal, design.transpose(0, 2, 1) @ torque[:, :, None])
    weight = fit / np.where(scale > 0.0, scale, 1.0).transpose(0, 2, 1)
    return np.asarray((rigid @ weight[:, : rigid.shape[2]])[:, :, 0])


class RowFilter:
    """A Hann window over a part of the motion's period, stretch by stretch."""

    def __init__(self, motions: Sequence[Sampled]) -> None:
        self.edges: list[tuple[int, int]] = []
        spacing, done = [], 0
        for motion in motions:
            step = float(np.median(np.diff(motion.t)))
            cuts = 1 + np.flatnonzero(np.abs(np.diff(motion.t) - step) > 0.5 * step)
            bounds = [done, *(done + cuts).tolist(), done + len(motion.t)]
            self.edges += list(pairwise(bounds))
            spacing.append(step)
            done += len(motion.t)
        self.spacing = float(np.median(np.asarray(spacing)))
        rates = [
            np.sqrt(np.mean(motion.dq**2, axis=0)) / np.maximum(np.std(motion.q, axis=0), 1e-12)
            for motion in motions
        ]
        period = 2.0 * np.pi / max(float(np.max(rates)), 1e-12)
        wanted = min(
            _CONFIG.periods * period / self.spacing, 0.1 * max(b - a for a, b in self.edges)
        )
        self.step = max(1, int(wanted / _OVERLAP))
        self.steps = max(1, min(int(wanted), _OVERLAP))  # within the length of the window
        length = self.step * self.steps
        self.edges = [edge for edge in self.edges if edge[1] - edge[0] >= length]
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
            shape = (len(columns), blocks, self.step, columns.shape[2])
            sums = self.window @ part.reshape(shape)
            outputs.append(sum(sums[:, k : k + count, k] for k in range(self.steps)))
        return np.concatenate(outputs, axis=1)

    def clusters(self, q: Array) -> npt.NDArray[np.intp]:
        """Return the cluster (N,) of each moment: of equal stretches of time, or of the phase.

        A model errs alike each time that a motion is repeated: a period counts once.
        """
        slow = self(q.T[:, :, None])[:, :, 0]
        total = slow.shape[1]
        k = int(np.argmax(self.count))
        period = _period(slow[:, self.start[k] : self.start[k] + self.count[k]])
        if period is None:
            return np.asarray(np.arange(total) * CLUSTERS // total)
        place = np.concatenate([np.arange(count) for count in self.count])
        return np.asarray(((place % period) * CLUSTERS / period).astype(int))


def _period(q: Array) -> float | None:
    """Return after how many moments the motion q (n, N) repeats; None where it does not."""
    moments = q.shape[1]
    power = np.maximum(2.0 * np.var(q, axis=1), 1e-300)
    apart = [
        float(np.mean(np.mean((q[:, lag:] - q[:, :-lag]) ** 2, axis=1) / power))
        for lag in range(1, 2 * moments // 3)
    ]
    left = np.flatnonzero(np.array(apart) > _CONFIG.moved_on)
    if not left.size:
        return None
    back = np.flatnonzero(np.array(apart[left[0] :]) < _CONFIG.returned)
    if not back.size:
        return None
    first = left[0] + int(back[0])
    near = slice(first, first + _OVERLAP)
    return float(1 + first + int(np.argmin(apart[near])))
