"""Sample the motion of a log, and lay out the torque of its joints as rows.

`row_fits` explains each joint's torque by its row of the rigid body, the rotor's inertia, Coulomb
and viscous friction and an offset: what any healthy arm may have. `torque_rows` keeps gravity free:

    τ_j = (Y_0j + Σ_k a_jk Y_kj) φ + F_j f_j        j: joint, k: x, y, z of the base

The regressor is linear in the gravity vector a [m/s^2] (Atkeson, An & Hollerbach 1986, eq. (9)):
Y_0 is the regressor without gravity, Y_k what a gravity of 1 m/s^2 along axis k adds. φ are the
base parameters of the arm under gravity from anywhere, F the columns that a joint has for itself.
Noise in a column makes its parameter too small, so columns and torque pass through one low-pass,
which keeps the equation exact (Gautier 1997, "parallel decimation").
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from pipelines.dynamics.base_parameters import base_set
from pipelines.dynamics.body import RigidBody
from pipelines.dynamics.chain import regressor
from pipelines.dynamics.kinematics import SerialChain, serial_chain
from pipelines.estimation.config import BoundaryConfig, PlausibilityConfig
from pipelines.estimation.filters import apply_kernel, half_width, kernel, local_polynomial
from pipelines.estimation.least_squares import Indices
from pipelines.io.log import Array
from pipelines.io.robot import RobotDescription
from pipelines.quality.segments import Mask, Usable

_CONFIG = PlausibilityConfig()
_RANK = 1e-10  # numerics: of the largest eigenvalue, of equilibrated columns: less is rounding
_BOUNDARY = BoundaryConfig()
_ELSEWHERE = np.array([3.1, -5.3, 7.7])  # [m/s^2] along no axis: shows all that any gravity shows
_SEED = 20040509  # numerics
_OVERLAP = 6  # numerics: moments that are kept within the length of the filter: no aliasing
_RIDGE = 1e-6  # numerics: of equilibrated columns, for a first estimate of the load alone


@dataclass(frozen=True)
class Sampled:
    """Smoothed motion and torque at moments far enough apart, and the torque between them."""

    t: Array  # [s] (moments,)
    q: Array  # [rad] (moments, joints)
    dq: Array
    ddq: Array
    coulomb: Array  # tanh(v/v0), smoothed like the torque
    torque: Array  # [N m] (samples, joints) smoothed, on the even grid of every run
    at: Indices  # (moments,) place of each moment in `torque`
    reach: int  # samples around each moment within which `torque` belongs to the same run
    sample_time: float

    def shifted(self, offset: Array | float) -> Array:
        """Return the torque (moments, joints) `offset` samples later, (moments,) or one."""
        place = self.at + np.clip(offset, -self.reach, self.reach - 1)
        below = np.floor(place).astype(int)
        share = (place - below)[:, None]
        return np.asarray((1.0 - share) * self.torque[below] + share * self.torque[below + 1])

    @property
    def tau(self) -> Array:
        return self.torque[self.at]

    def every(self, step: int) -> Sampled:
        """Return every `step`-th moment."""
        names = ("t", "q", "dq", "ddq", "coulomb", "at")
        return replace(self, **{name: getattr(self, name)[::step] for name in names})


def sample_motion(good: Usable) -> Sampled | None:
    """Return position, speed, acceleration and torque through one and the same smoothing.

    None where no stretch is long enough.
    """
    ts = good.log.sample_time
    half = half_width(ts, _CONFIG.cutoff_hz)
    reach = max(4, round(_CONFIG.reach / ts))
    thin = -(-good.log.n_samples // _CONFIG.most_rows)
    spacing = max(1, round(_CONFIG.spacing / ts), thin)
    parts, done = [], 0
    for run in good.runs:
        part = _sample_run(good, run, half, reach, spacing)
        if part is not None:
            parts.append(replace(part, at=part.at + done))
            done += len(part.torque)
    if not parts:
        return None
    names = ("t", "q", "dq", "ddq", "coulomb", "torque", "at")
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in names
    }
    return replace(parts[0], **joined)


def _sample_run(good: Usable, run: slice, half: int, reach: int, spacing: int) -> Sampled | None:
    log, ts = good.log, good.log.sample_time
    t = log.t[run]
    samples = round((t[-1] - t[0]) / ts) + 1
    moments = np.arange(half + reach, samples - 3 * half - reach, spacing)
    if samples < 4 * half + 2 * reach + 2 * spacing or not moments.size:
        return None
    grid = t[0] + ts * np.arange(samples)
    # a row that was stored again is no sample: held positions add to the acceleration
    both = np.concatenate([log.q[run], log.tau[run]], axis=1)
    stale = (np.diff(both, axis=0, prepend=np.nan) == 0.0).all(axis=1, keepdims=True)
    q = _filled(grid, t, log.q[run], good.position_spikes[run] | stale)
    tau = _filled(grid, t, log.tau[run], good.torque_spikes[run] | stale)
    if log.torque != "measured":  # held until the next sample: its middle is half a sample later
        tau[1:] = 0.5 * (tau[1:] + tau[:-1])
    value, first, second = local_polynomial(q, ts, half)
    # speeds far below the usual say nothing about the sign of friction
    slow = np.minimum(0.01, 0.02 * np.sqrt(np.mean(first**2, axis=0)) + 1e-12)
    smooth = kernel(half, 4, 0)
    coulomb, torque = apply_kernel(np.tanh(first / slow), smooth), apply_kernel(tau, smooth)
    spoilt = np.interp(grid, t, good.saturated[run].any(axis=1).astype(float))
    near = apply_kernel(spoilt[:, None], np.ones(2 * half + 1))[:, 0]
    at = moments[(near < 0.5)[moments]]
    motion = (value[at], first[at], second[at], coulomb[at - half])
    return Sampled(grid[at + half], *motion, torque, at, reach, ts)


def _filled(grid: Array, t: Array, x: Array, spoilt: Mask) -> Array:
    """Return `x` on an even grid; missing samples are bridged, good enough for such a test."""
    columns = []
    for column, bad in zip(x.T, spoilt.T, strict=True):
        ok = np.isfinite(column) & ~bad
        columns.append(np.interp(grid, t[ok], column[ok]) if ok.any() else np.zeros(grid.size))
    return np.stack(columns, axis=-1)


@dataclass(frozen=True)
class Row:
    """One joint's columns, factorised."""

    basis: Array  # (moments, rank) orthonormal
    solve: Array  # (columns, rank): coefficients = solve @ basisᵀ τ

    def residual(self, tau: Array) -> Array:
        """Return what the columns cannot explain of any right-hand sides (moments, ...)."""
        return np.asarray(tau - self.basis @ (self.basis.T @ tau))

    def estimate(self, tau: Array) -> tuple[Array, Array]:
        """Return the coefficients of one right-hand side and their covariance."""
        rest = self.residual(tau)
        freedom = max(1, len(tau) - self.basis.shape[1])
        variance = float(rest @ rest) / freedom
        return self.solve @ (self.basis.T @ tau), variance * self.solve @ self.solve.T


def row_fits(body: RigidBody, motion: Sampled, keep: Array | None = None) -> tuple[Row, ...]:
    """Return every joint's row; dependent columns get the smallest coefficients that fit.

    Args:
        keep: (moments, joints) 1 where a moment counts in a joint's row, 0 where the row is zero.
    """
    regressor, rows = body.regressor(motion.q, motion.dq, motion.ddq), []
    for j in range(motion.q.shape[1]):
        columns = np.hstack([regressor[:, j], _own(motion, j)])
        if keep is not None:
            columns = keep[:, j, None] * columns
        scale = np.linalg.norm(columns, axis=0)
        weight = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 1e-12 * scale.max())
        unit = columns * weight
        values, vectors = np.linalg.eigh(unit.T @ unit)
        seen = values > _RANK * max(float(values[-1]), 1e-300)
        turn = vectors[:, seen] / np.sqrt(values[seen])
        rows.append(Row(unit @ turn, weight[:, None] * turn))
    return tuple(rows)


def _own(motion: Sampled, j: int) -> Array:
    """Return what a joint has for itself (moments, 4): rotor inertia, friction and an offset."""
    parts = (motion.ddq[:, j], motion.dq[:, j], motion.coulomb[:, j], np.ones(len(motion.t)))
    return np.stack(parts, axis=-1)


def relative_residual(rows: Sequence[Row], tau: Array) -> Array:
    """(joints,) what of each torque's variation its joint's row cannot explain, 0 … 1."""
    size = np.linalg.norm(tau - tau.mean(axis=0), axis=0)
    left = [np.linalg.norm(row.residual(own)) for row, own in zip(rows, tau.T, strict=True)]
    return np.asarray(left / np.where(size > 0, size, 1.0))


def shared_residual(body: RigidBody, motion: Sampled, joints: Sequence[int]) -> Array:
    """Return the relative residual (joints,) of rows that share the rigid body's parameters.

    min over β of Σ_j |τ_j - Φ_j β|² / |τ_j|², each joint's own columns taken out. A row by itself
    takes a wrong scale for other parameters; together they cannot.
    """
    regressor, parts = body.regressor(motion.q, motion.dq, motion.ddq), []
    for j in joints:
        own, tau = _own(motion, j), motion.tau[:, j]
        own, _ = np.linalg.qr(own / np.maximum(np.linalg.norm(own, axis=0), 1e-300))
        whole = np.column_stack([regressor[:, j], tau])
        whole /= float(np.linalg.norm(tau - tau.mean())) or 1.0
        parts.append(whole - own @ (own.T @ whole))
    rows = np.array(parts)
    table, torque = rows[:, :, :-1], rows[:, :, -1]
    columns = table.reshape(-1, table.shape[2])
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-150)
    unit = columns / size
    values, vectors = np.linalg.eigh(unit.T @ unit)
    seen = values > 1e-12 * values[-1] * len(values)
    turned = vectors[:, seen].T @ (unit.T @ torque.ravel())
    beta = (vectors[:, seen] / values[seen]) @ turned / size
    return np.asarray(np.linalg.norm(torque - table @ beta, axis=1))


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
    bends = [np.tanh(dq / (width * size)) for width in _BOUNDARY.widths]
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
        wanted = _BOUNDARY.periods * period / float(np.median(spacing))
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
            return np.asarray(np.arange(total) * _BOUNDARY.clusters // total)
        place = np.concatenate([np.arange(count) for count in self.count])
        return np.asarray(((place % period) * _BOUNDARY.clusters / period).astype(int))


def _period(q: Array) -> int | None:
    """Return after how many moments the motion q (n, N) repeats; None where it does not."""
    power = np.maximum(2.0 * np.var(q, axis=1), 1e-300)
    lags = range(1, 2 * q.shape[1] // 3)
    apart = [np.mean(np.mean((q[:, lag:] - q[:, :-lag]) ** 2, axis=1) / power) for lag in lags]
    away = np.flatnonzero(np.array(apart) > _BOUNDARY.moved_on)
    back = np.flatnonzero(np.array(apart[away[0] :]) < _BOUNDARY.returned) if away.size else away
    if not back.size:
        return None
    first = int(away[0] + back[0])
    return 1 + first + int(np.argmin(apart[first : first + _OVERLAP]))
