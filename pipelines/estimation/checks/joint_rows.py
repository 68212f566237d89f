"""Sample the motion of a log, and fit each joint's torque by its row of the rigid body.

The columns of a row are those of the rigid body, the rotor's inertia, Coulomb and viscous friction
and an offset: what any healthy arm may have. A row by itself takes any parameters; rows together
share those of the rigid body.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipelines.dynamics.body import RigidBody
from pipelines.estimation.config import PlausibilityConfig
from pipelines.estimation.filters import apply_kernel, half_width, kernel, local_polynomial
from pipelines.estimation.least_squares import Indices
from pipelines.io.log import Array
from pipelines.quality.segments import Mask, Usable

_CONFIG = PlausibilityConfig()
_RANK = 1e-10  # numerics: of the largest eigenvalue, of equilibrated columns: less is rounding


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


@dataclass(frozen=True)
class SharedRows:
    """Rows that share the rigid body's parameters, each over its torque's size, its own columns
    taken out. A row by itself takes a wrong scale for other parameters; together they cannot.
    """

    gram: Array  # (joints, parameters, parameters)
    side: Array  # (joints, parameters)
    square: Array  # (joints,)

    @classmethod
    def of(cls, body: RigidBody, motion: Sampled, joints: Sequence[int]) -> SharedRows:
        regressor, tau = body.regressor(motion.q, motion.dq, motion.ddq), motion.tau
        scale = np.sqrt(np.sum(regressor**2, axis=(0, 1)))
        regressor = regressor / np.where(scale > 0.0, scale, 1.0)
        parts = []
        for j in joints:
            own = _own(motion, j)
            own, _ = np.linalg.qr(own / np.maximum(np.linalg.norm(own, axis=0), 1e-300))
            size = float(np.linalg.norm(tau[:, j] - tau[:, j].mean())) or 1.0
            whole = np.column_stack([regressor[:, j], tau[:, j]]) / size
            whole -= own @ (own.T @ whole)
            parts.append(whole.T @ whole)
        gram = np.array(parts)
        return cls(gram[:, :-1, :-1], gram[:, :-1, -1], gram[:, -1, -1])

    def left(self, factors: Array) -> Array:
        """Return the relative residual (joints,) if torque j is `factors` j times what it seems.

        min over β of Σ_j |τ_j - f_j Φ_j β|²
        """
        gram, side = np.einsum("j,jab->ab", factors**2, self.gram), factors @ self.side
        size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        values, vectors = np.linalg.eigh(gram / size / size[:, None])
        seen = values > 1e-12 * values[-1] * len(values)
        beta = (vectors[:, seen] / values[seen]) @ (vectors[:, seen].T @ (side / size)) / size
        rest = self.square - 2.0 * factors * (self.side @ beta)
        rest += factors**2 * np.einsum("a,jab,b->j", beta, self.gram, beta)
        return np.asarray(np.sqrt(np.maximum(rest, 0.0)))
