"""Fit each joint's torque by its own row of the rigid body, so that other torques can be tried on the same row at once.

One factorisation a joint, A_j = U S Vᵀ; any right-hand side τ then costs U (Uᵀ τ). The columns of a row are those of the
rigid body, the rotor's inertia, Coulomb and viscous friction and an offset: what any healthy arm may have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Array, RigidBody
from pipelines.estimation.filters import apply_kernel, half_width, kernel, local_polynomial
from pipelines.quality.segments import Usable

__all__ = ["Row", "Sampled", "quick_residual", "relative_residual", "row_columns", "row_fits", "sample_motion",
           "shared_residual"]

_CUTOFF_HZ = 20.0  # above the motion of a robot arm, below its elastic modes and the drive's noise
_SPACING = 0.01  # [s] between the samples of the fit
_MOST_ROWS = 2000
_RANK = 1e-7  # singular values below this share of the largest are rounding, of equilibrated columns


@dataclass(frozen=True)
class Sampled:
    """Smoothed motion and torque at moments far enough apart, and the smoothed torque between them."""

    t: Array  # [s] (moments,)
    q: Array  # [rad] (moments, joints)
    dq: Array
    ddq: Array
    coulomb: Array  # tanh(v/v0), smoothed like the torque
    torque: Array  # [N m] (samples, joints) smoothed, on the even grid of every run
    at: npt.NDArray[np.intp]  # (moments,) place of each moment in `torque`
    reach: int  # samples around each moment within which `torque` belongs to the same run
    sample_time: float

    def shifted(self, offset: Array | float) -> Array:
        """Torque (moments, joints) `offset` samples later, (moments,) or one for all."""
        place = self.at + np.clip(offset, -self.reach, self.reach - 1)
        below = np.floor(place).astype(int)
        share = (place - below)[:, None]
        return np.asarray((1.0 - share) * self.torque[below] + share * self.torque[below + 1])

    @property
    def tau(self) -> Array:
        return self.torque[self.at]


def sample_motion(good: Usable, reach_seconds: float = 0.06) -> Sampled | None:
    """Position, speed, acceleration and torque of the usable stretches, through one and the same smoothing.

    Returns:
        None where no stretch is long enough.
    """
    ts = good.log.sample_time
    half = half_width(ts, _CUTOFF_HZ)
    reach = max(4, round(reach_seconds / ts))
    spacing = max(1, round(_SPACING / ts), -(-good.log.n_samples // _MOST_ROWS))
    parts, done = [], 0
    for run in good.runs:
        if (part := _sample_run(good, run, half, reach, spacing)) is not None:
            parts.append((*part[:-1], part[-1] + done))
            done += len(part[5])
    if not parts:
        return None
    t, q, dq, ddq, coulomb, torque, at = (np.concatenate(p) for p in zip(*parts, strict=True))
    return Sampled(t, q, dq, ddq, coulomb, torque, at.astype(int), reach, ts)


def _sample_run(good: Usable, run: slice, half: int, reach: int, spacing: int) -> tuple[Array, ...] | None:
    log, ts = good.log, good.log.sample_time
    t = log.t[run]
    samples = round((t[-1] - t[0]) / ts) + 1
    if samples < 4 * half + 2 * reach + 2 * spacing:
        return None
    grid = t[0] + ts * np.arange(samples)
    # A row that was stored again is no sample: held positions add a share of their speed to the acceleration.
    again = np.diff(np.concatenate([log.q[run], log.tau[run]], axis=1), axis=0, prepend=np.nan) == 0.0
    stale = again.all(axis=1, keepdims=True)
    q = _filled(grid, t, log.q[run], good.position_spikes[run] | stale)
    tau = _filled(grid, t, log.tau[run], good.torque_spikes[run] | stale)
    if log.torque != "measured":  # held until the next sample: its middle lies half a sample later
        tau[1:] = 0.5 * (tau[1:] + tau[:-1])
    value, first, second = local_polynomial(q, ts, half)
    # speeds far below the usual say nothing about the sign of friction
    slow = np.minimum(0.01, 0.02 * np.sqrt(np.mean(first**2, axis=0)) + 1e-12)
    smooth = kernel(half, 4, 0)
    coulomb = apply_kernel(np.tanh(first / slow), smooth)
    torque = apply_kernel(tau, smooth)
    moments = np.arange(half + reach, samples - 3 * half - reach, spacing)  # in samples of `motion`
    if not moments.size:
        return None
    spoilt = np.interp(grid, t, good.saturated[run].any(axis=1).astype(float))
    clean = apply_kernel(spoilt[:, None], np.full(2 * half + 1, 1.0))[:, 0] < 0.5
    moments = moments[clean[moments]]
    return (grid[moments + half], value[moments], first[moments], second[moments],
            coulomb[moments - half], torque, moments.astype(float))


def _filled(grid: Array, t: Array, x: Array, spoilt: npt.NDArray[np.bool_]) -> Array:
    """`x` on an even grid; a missing sample here and there is bridged, which is good enough for a plausibility test."""
    columns = []
    for column, bad in zip(x.T, spoilt.T, strict=True):
        ok = np.isfinite(column) & ~bad
        columns.append(np.interp(grid, t[ok], column[ok]) if ok.any() else np.zeros(grid.size))
    return np.stack(columns, axis=-1)


@dataclass(frozen=True)
class Row:
    """The columns of one joint's torque, factorised: (moments, columns) = U S Vᵀ / scale."""

    basis: Array  # U (moments, rank)
    solve: Array  # (columns, rank): coefficients = solve @ (Uᵀ τ)
    names: tuple[str, ...]

    def residual(self, tau: Array) -> Array:
        """What of `tau` (moments,) or (moments, k) the row cannot explain."""
        return np.asarray(tau - self.basis @ (self.basis.T @ tau))

    def estimate(self, tau: Array) -> tuple[Array, Array]:
        """Coefficients (columns,) and their covariance, as if the residual were white from moment to moment."""
        coefficients = self.solve @ (self.basis.T @ tau)
        rest = self.residual(tau)
        variance = float(rest @ rest) / max(1, len(tau) - self.basis.shape[1])
        return coefficients, variance * self.solve @ self.solve.T


def row_columns(body: RigidBody, motion: Sampled, joint: int, q: Array | None = None, dq: Array | None = None,
                ddq: Array | None = None, regressor: Array | None = None) -> tuple[Array, tuple[str, ...]]:
    """The columns (moments, columns) of one joint's torque and their names; another motion may stand in."""
    q, dq, ddq = (motion.q if q is None else q, motion.dq if dq is None else dq, motion.ddq if ddq is None else ddq)
    rigid = (body.regressor(q, dq, ddq) if regressor is None else regressor)[:, joint]
    own = np.stack([ddq[:, joint], dq[:, joint], motion.coulomb[:, joint], np.ones(len(q))], axis=-1)
    names = tuple(p.name for p in body.parameters)
    return np.concatenate([rigid, own], axis=1), (*names, "rotor inertia", "viscous", "coulomb", "offset")


def factorised(columns: Array, names: tuple[str, ...]) -> Row:
    """The row of these columns; columns that are zero or depend on others get the smallest coefficients that fit."""
    scale = np.linalg.norm(columns, axis=0)
    seen = scale > 1e-12 * max(float(scale.max(initial=0.0)), 1e-300)
    weight = np.where(seen, 1.0 / np.where(seen, scale, 1.0), 0.0)
    u, s, vt = np.linalg.svd(columns * weight, full_matrices=False)
    rank = int(np.sum(s > _RANK * s[0])) if s.size and s[0] > 0 else 0
    return Row(u[:, :rank], weight[:, None] * vt[:rank].T / s[:rank], names)


def quick_residual(body: RigidBody, motion: Sampled, **other: Array) -> Array:
    """`relative_residual` of the sampled torques for another motion, by normal equations: to 1e-4, and ten times faster."""
    q, dq, ddq = (other.get(k, getattr(motion, k)) for k in ("q", "dq", "ddq"))
    regressor = body.regressor(q, dq, ddq)
    tau = motion.tau
    power = np.sum((tau - tau.mean(axis=0)) ** 2, axis=0)
    left = []
    for j in range(tau.shape[1]):
        columns, _ = row_columns(body, motion, j, q, dq, ddq, regressor)
        scale = np.linalg.norm(columns, axis=0)
        columns = columns / np.where(scale > 0, scale, 1.0)
        values, vectors = np.linalg.eigh(columns.T @ columns)
        seen = values > 1e-10 * values[-1]
        explained = np.sum((vectors[:, seen].T @ (columns.T @ tau)) ** 2 / values[seen, None], axis=0)
        left.append(np.sum(tau**2, axis=0) - explained)
    return np.asarray(np.sqrt(np.maximum(left, 0.0) / np.where(power > 0, power, 1.0)))


def shared_residual(body: RigidBody, motion: Sampled, **other: Array) -> Array:
    """(joints,) what of each torque's variation is left when all rows share one set of rigid parameters, for another motion.

    A row by itself takes a wrong scale of a speed for another inertia; together they cannot: in the row of the joint itself
    inertia takes the inverse of the scale, in the rows of the others, by the centrifugal torque, its square.
    """
    q, dq, ddq = (other.get(k, getattr(motion, k)) for k in ("q", "dq", "ddq"))
    n = motion.tau.shape[1]
    size = np.linalg.norm(motion.tau - motion.tau.mean(axis=0), axis=0)
    size = np.where(size > 0, size, 1.0)
    own = np.einsum("mjc,jk->mjkc", np.stack([ddq, dq, motion.coulomb, np.ones_like(q)], axis=-1), np.eye(n))
    columns = np.concatenate([body.regressor(q, dq, ddq), own.reshape(len(q), n, -1)], axis=2) / size[:, None]
    flat = columns.reshape(len(q) * n, -1)
    scale = np.linalg.norm(flat, axis=0)
    flat = flat / np.where(scale > 0, scale, 1.0)
    tau = (motion.tau / size).ravel()
    left = tau - flat @ np.linalg.lstsq(flat, tau, rcond=_RANK)[0]
    return np.asarray(np.linalg.norm(left.reshape(-1, n), axis=0))


def row_fits(body: RigidBody, motion: Sampled, **other: Array) -> tuple[Row, ...]:
    """Every joint's row."""
    q, dq, ddq = (other.get(k, getattr(motion, k)) for k in ("q", "dq", "ddq"))
    regressor = body.regressor(q, dq, ddq)
    return tuple(factorised(*row_columns(body, motion, j, q, dq, ddq, regressor)) for j in range(motion.q.shape[1]))


def relative_residual(rows: tuple[Row, ...], tau: Array) -> Array:
    """(rows, torques) what of each torque's variation each joint's row cannot explain, 0 … 1."""
    size = np.linalg.norm(tau - tau.mean(axis=0), axis=0)
    size = np.where(size > 0, size, 1.0)
    return np.stack([np.linalg.norm(row.residual(tau), axis=0) / size for row in rows])
