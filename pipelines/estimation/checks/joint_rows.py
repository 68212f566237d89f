"""Fit each joint's torque by its own row of the rigid body, so that others can be tried on it.

One factorisation a joint, A_j = U S Vᵀ; any right-hand side τ then costs U (Uᵀ τ). The columns of a
row are those of the rigid body, the rotor's inertia, Coulomb and viscous friction and an offset:
what any healthy arm may have.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pipelines.dynamics.body import RigidBody
from pipelines.estimation.config import PlausibilityConfig
from pipelines.estimation.filters import apply_kernel, half_width, kernel, local_polynomial
from pipelines.estimation.least_squares import Indices
from pipelines.io.log import Array
from pipelines.quality.segments import Mask, Usable
from pipelines.quality.subject import Subject

_CONFIG = PlausibilityConfig()
_RANK = 1e-7  # numerics: singular values below this share, of equilibrated columns, are rounding


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
        if (part := _sample_run(good, run, half, reach, spacing)) is not None:
            parts.append((*part[:-1], part[-1] + done))
            done += len(part[5])
    if not parts:
        return None
    t, q, dq, ddq, coulomb, torque, at = (np.concatenate(p) for p in zip(*parts, strict=True))
    return Sampled(t, q, dq, ddq, coulomb, torque, at.astype(int), reach, ts)


def _sample_run(
    good: Usable, run: slice, half: int, reach: int, spacing: int
) -> tuple[Array, ...] | None:
    log, ts = good.log, good.log.sample_time
    t = log.t[run]
    samples = round((t[-1] - t[0]) / ts) + 1
    if samples < 4 * half + 2 * reach + 2 * spacing:
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
    coulomb = apply_kernel(np.tanh(first / slow), smooth)
    moments = np.arange(half + reach, samples - 3 * half - reach, spacing)
    if not moments.size:
        return None
    spoilt = np.interp(grid, t, good.saturated[run].any(axis=1).astype(float))
    near = apply_kernel(spoilt[:, None], np.ones(2 * half + 1))[:, 0]
    moments = moments[(near < 0.5)[moments]]
    motion = (value[moments], first[moments], second[moments], coulomb[moments - half])
    return grid[moments + half], *motion, apply_kernel(tau, smooth), moments.astype(float)


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

    basis: Array  # U (moments, rank)
    solve: Array  # (columns, rank): coefficients = solve @ Uᵀ τ

    def residual(self, tau: Array) -> Array:
        """Return what the columns cannot explain of any right-hand sides (moments, ...)."""
        return np.asarray(tau - self.basis @ (self.basis.T @ tau))

    def estimate(self, tau: Array) -> tuple[Array, Array]:
        """Return the coefficients of one right-hand side and their covariance."""
        rest = self.residual(tau)
        freedom = max(1, len(tau) - self.basis.shape[1])
        variance = float(rest @ rest) / freedom
        return self.solve @ (self.basis.T @ tau), variance * self.solve @ self.solve.T


def row_columns(
    body: RigidBody, motion: Sampled, joint: int, regressor: Array | None = None
) -> Array:
    """Return the columns (moments, columns) of one joint's torque."""
    if regressor is None:
        regressor = body.regressor(motion.q, motion.dq, motion.ddq)
    own = (motion.ddq, motion.dq, motion.coulomb, np.ones_like(motion.q))
    return np.concatenate([regressor[:, joint], *(x[:, joint, None] for x in own)], axis=1)


def factorised(columns: Array) -> Row:
    """Return the row of these columns; dependent ones get the smallest coefficients that fit."""
    scale = np.linalg.norm(columns, axis=0)
    seen = scale > 1e-12 * max(float(scale.max(initial=0.0)), 1e-300)
    weight = np.where(seen, 1.0 / np.where(seen, scale, 1.0), 0.0)
    u, s, vt = np.linalg.svd(columns * weight, full_matrices=False)
    rank = int(np.sum(s > _RANK * s[0])) if s.size and s[0] > 0 else 0
    return Row(u[:, :rank], weight[:, None] * vt[:rank].T / s[:rank])


def row_fits(body: RigidBody, motion: Sampled) -> tuple[Row, ...]:
    """Return every joint's row."""
    regressor = body.regressor(motion.q, motion.dq, motion.ddq)
    joints = range(motion.q.shape[1])
    return tuple(factorised(row_columns(body, motion, j, regressor)) for j in joints)


def relative_residual(rows: tuple[Row, ...], tau: Array) -> Array:
    """(rows, torques) what of each torque's variation each joint's row cannot explain, 0 … 1."""
    size = np.linalg.norm(tau - tau.mean(axis=0), axis=0)
    size = np.where(size > 0, size, 1.0)
    return np.stack([np.linalg.norm(row.residual(tau), axis=0) / size for row in rows])


def quick_residual(body: RigidBody, motion: Sampled) -> Array:
    """Return `relative_residual` by normal equations: to 1e-4, and ten times faster."""
    regressor, tau = body.regressor(motion.q, motion.dq, motion.ddq), motion.tau
    power = np.sum((tau - tau.mean(axis=0)) ** 2, axis=0)
    left = []
    for j in range(tau.shape[1]):
        columns = row_columns(body, motion, j, regressor)
        scale = np.linalg.norm(columns, axis=0)
        columns = columns / np.where(scale > 0, scale, 1.0)
        values, vectors = np.linalg.eigh(columns.T @ columns)
        seen = values > 1e-10 * values[-1]
        along = vectors[:, seen].T @ (columns.T @ tau)
        left.append(np.sum(tau**2, axis=0) - np.sum(along**2 / values[seen, None], axis=0))
    return np.asarray(np.sqrt(np.maximum(left, 0.0) / np.where(power > 0, power, 1.0)))


def shared_residual(body: RigidBody, motion: Sampled) -> Array:
    """(joints,) what is left of each torque's variation when all rows share rigid parameters.

    A row by itself takes a wrong scale of a speed for another inertia; together they cannot: in the
    row of the joint itself inertia takes the inverse of the scale, in the rows of the others, by
    the centrifugal torque, its square.
    """
    q, n = motion.q, motion.tau.shape[1]
    size = np.linalg.norm(motion.tau - motion.tau.mean(axis=0), axis=0)
    size = np.where(size > 0, size, 1.0)
    each = np.stack([motion.ddq, motion.dq, motion.coulomb, np.ones_like(q)], axis=-1)
    own = np.einsum("mjc,jk->mjkc", each, np.eye(n)).reshape(len(q), n, -1)
    rigid = body.regressor(q, motion.dq, motion.ddq)
    flat = (np.concatenate([rigid, own], axis=2) / size[:, None]).reshape(len(q) * n, -1)
    scale = np.linalg.norm(flat, axis=0)
    flat = flat / np.where(scale > 0, scale, 1.0)
    tau = (motion.tau / size).ravel()
    left = tau - flat @ np.linalg.lstsq(flat, tau, rcond=_RANK)[0]
    return np.asarray(np.linalg.norm(left.reshape(-1, n), axis=0))


@dataclass(frozen=True, eq=False)
class Evidence:
    """The rows of one log, computed once for all questions."""

    subject: Subject
    body: RigidBody
    motion: Sampled

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        return row_fits(self.body, self.motion)

    @cached_property
    def table(self) -> Array:
        """(rows, torques) relative residual of every torque on every joint's row."""
        return relative_residual(self.rows, self.motion.tau)

    @property
    def residual(self) -> Array:
        return np.diag(self.table)

    @cached_property
    def telling(self) -> Indices:
        """The joints (from 0) whose row can tell anything: those that move.

        A joint that is held sways within its dry friction, of which no row knows, while the moving
        joints' motion is in every row: another joint's row may explain its torque better.
        """
        travel = self.subject.travel
        return np.flatnonzero(travel >= _CONFIG.held * travel.max())

    @property
    def n_joints(self) -> int:
        return int(self.motion.q.shape[1])

    def thinned(self) -> Evidence:
        """Return fewer moments, for questions that need a new factorisation each."""
        most = 5 * max(row.basis.shape[1] for row in self.rows)
        return replace(self, motion=self.motion.every(max(1, len(self.motion.t) // most)))
