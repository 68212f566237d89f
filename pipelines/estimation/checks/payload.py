"""Estimate the payload whose torque the controller subtracts from what it logs.

    τ = Y (φ - B ψ) + F f        ψ = (m, m c, I): of a body that the last link carries

A payload ψ that is set in the controller makes the last link lighter by its own parameters: any
session by itself gives them to the links. Two things hold φ: reference logs, whose torque is Y φ
(Gautier & Khalil 1990: base parameters do not change), or links that are described well,
φ = φ_d + D e, e ~ N(0, σ²). How well they are described, the links before the last show: σ is what
maximises the evidence of the logs with ψ unknown (MacKay 1992, eq. (2.8)). The last link may be as
wrong as they are allowed to be, and so its mass adds to the deviation of m.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.dynamics.body import standard_parameters
from pipelines.estimation.checks.config import BoundaryConfig
from pipelines.estimation.checks.gravity_fit import GravityFit, GravityModel
from pipelines.estimation.checks.spread import jackknife
from pipelines.estimation.checks.torque_rows import CLUSTERS, Array, GenericArm
from pipelines.io.robot import LinkParameters

__all__ = ["NOT_TOLD", "CompensatedPayload", "payload_by_links", "payload_by_reference"]

_TEN = 10  # numerics: standard parameters of a body, its mass the first
_LOOSE = 10.0  # numerics: times the torque, that a payload makes before any data
_ERRORS = np.logspace(-3.0, 0.0, 61)  # σ of described links that are compared
_NEEDS = "it needs a reference log, or links described within 5 %"


@dataclass(frozen=True)
class CompensatedPayload:
    """A body at the last link whose torque the controller subtracts, or that was taken off."""

    mass: float | None = None  # [kg] of the body; null: not identifiable
    std: float | None = None  # [kg] standard deviation of `mass`
    present: bool | None = None  # whether a payload is subtracted; null: not identifiable
    by: str = ""  # what it is compared with: "reference logs" or "described links"; else empty
    reason: str = (
        "a payload that the controller subtracts is absorbed by the last links' masses: " + _NEEDS
    )  # why a value is not identifiable; else empty


NOT_TOLD = CompensatedPayload()


@dataclass(frozen=True, eq=False)
class _Part:
    """Equations of one session over each torque's RMS."""

    model: GravityModel
    fit: GravityFit  # of any links: the noise
    columns: Array  # (n, N, w) of what the sessions share
    target: Array  # (n, N)

    @property
    def weights(self) -> Array:
        """Independent moments over all moments and over the residual's variance (n,)."""
        return np.asarray(self.model.effective / (self.fit.variance * self.target.shape[1]))


def payload_by_reference(
    arm: GenericArm,
    session: GravityModel,
    reference: GravityModel,
    gravity: Array,
    config: BoundaryConfig,
) -> CompensatedPayload:
    """Return the payload that the torque of a session lacks, and that of the reference holds.

    Friction, rotor inertia and offset of either are its own.

    Args:
        gravity: (3,) [m/s^2] as described.
    """
    tip = arm.combine[:, -_TEN:]
    parts = []
    for model, carries in ((session, 1.0), (reference, 0.0)):
        rigid, torque = _rigid(model, gravity)
        columns = np.concatenate([-carries * rigid @ tip, rigid], axis=2)
        parts.append(_Part(model, model.fit(gravity), columns, torque))
    prior = np.zeros((_TEN + len(tip), _TEN + len(tip)))
    prior[:_TEN, :_TEN] = np.diag(_size(parts[0]) ** 2) / _LOOSE**2
    return _judged(parts, prior, "reference logs", config)


def payload_by_links(
    arm: GenericArm,
    session: GravityModel,
    links: Sequence[LinkParameters],
    gravity: Array,
    config: BoundaryConfig,
) -> CompensatedPayload:
    """Return the payload that the torque of a session lacks, and the described links have.

    Not identifiable where the logs allow links that are described worse than `config.described`.
    """
    rigid, torque = _rigid(session, gravity)
    scale = np.concatenate([_of_link(link) for link in links])
    known = arm.combine @ standard_parameters(links).ravel()
    columns = np.concatenate(
        [-rigid @ arm.combine[:, -_TEN:], rigid @ (arm.combine * scale)], axis=2
    )
    part = _Part(session, session.fit(gravity), columns, torque - rigid @ known)
    loose = _size(part) ** 2 / _LOOSE**2
    worst = _largest_error(part, loose, config)
    if worst > config.described:
        reason = f"the logs allow links described wrong by {100.0 * worst:.2g} %: {_NEEDS}"
        return CompensatedPayload(reason=reason)
    prior = np.diag(np.concatenate([loose, np.full(len(scale), config.described**-2)]))
    return _judged([part], prior, "described links", config)


def _rigid(model: GravityModel, gravity: Array) -> tuple[Array, Array]:
    """Return columns (n, N, p) under `gravity` and torque (n, N)."""
    rows = model.rows
    rigid = rows.inertial.copy()
    rigid[:, :, rows.heavy] += np.einsum("k,jnkm->jnm", gravity, rows.gravity)
    return rigid / model.size[:, None, None], rows.tau / model.size[:, None]


def _of_link(link: LinkParameters) -> Array:
    """Return the size (10,) of a link's parameters: m, m ρ, m ρ², ρ its radius of gyration."""
    radius = np.sqrt(max(0.5 * sum(link.inertia[:3]) / max(link.mass, 1e-12), 0.0))
    return np.asarray(link.mass * radius ** np.array([0, 1, 1, 1, 2, 2, 2, 2, 2, 2]))


def _size(part: _Part) -> Array:
    """Return the torque (10,) of a unit of each of the payload's parameters, over the whole."""
    return np.asarray(np.sqrt(np.mean(part.columns[:, :, :_TEN] ** 2, axis=(0, 1))))


def _largest_error(part: _Part, loose: Array, config: BoundaryConfig) -> float:
    """Return the largest relative error σ of described links that the logs allow.

    log p(τ|σ) = ½ log|P| - ½ log|H + P| + ½ bᵀ (H + P)⁻¹ b,   P = diag(loose, 1/σ²)
    """
    basis, _ = np.linalg.qr(_own(part))
    columns, target = (
        x - basis @ (basis.transpose(0, 2, 1) @ x) for x in (part.columns, part.target[:, :, None])
    )
    flat = np.tensordot(part.weights, columns.transpose(0, 2, 1) @ columns, 1)
    right = np.einsum("j,jnw,jn->w", part.weights, columns, target[:, :, 0])
    count = len(right) - _TEN
    evidence = []
    for error in _ERRORS:
        normal = flat + np.diag(np.concatenate([loose, np.full(count, error**-2)]))
        normal += 1e-12 * np.diag(np.diag(flat) + 1e-300)
        size = float(np.linalg.slogdet(normal)[1])
        evidence.append(
            0.5 * (float(right @ np.linalg.solve(normal, right)) - size) - count * np.log(error)
        )
    allowed = np.array(evidence) > max(evidence) - config.doubt
    return float(_ERRORS[np.flatnonzero(allowed)[-1]])


def _own(part: _Part) -> Array:
    """Return each joint's own columns (n, N, c) at unit length."""
    own = part.model.rows.own
    return np.asarray(own / np.maximum(np.linalg.norm(own, axis=1, keepdims=True), 1e-300))


def _judged(
    parts: Sequence[_Part], prior: Array, by: str, config: BoundaryConfig
) -> CompensatedPayload:
    """Fit all parameters, those of friction for each session, and return what the mass shows."""
    shared = len(prior)
    n, _, c = parts[0].model.rows.own.shape
    width = shared + len(parts) * n * c
    gram, right = np.zeros((len(parts) * CLUSTERS, width, width)), []
    naive, known = np.zeros((width, width)), np.zeros((width, width))
    known[:shared, :shared] = prior
    for i, part in enumerate(parts):
        sums = np.zeros((CLUSTERS, width))
        own = _own(part)
        for j in range(n):
            first = shared + (i * n + j) * c
            at = np.r_[0:shared, first : first + c]
            scale = np.sqrt(part.fit.variance[j])
            design = np.concatenate([part.columns[j], own[j]], axis=1) / scale
            for b in range(CLUSTERS):
                rows = part.model.rows.cluster == b
                gram[i * CLUSTERS + b][np.ix_(at, at)] += design[rows].T @ design[rows]
                sums[b][at] += design[rows].T @ part.target[j, rows] / scale
            power = (part.fit.residual[j] / part.fit.variance[j]) ** 2 / part.weights[j]
            naive[np.ix_(at, at)] += design.T @ design * power
        right.append(sums)
    theta, covariance = jackknife(gram, np.concatenate(right), known, naive)
    if _misfit(parts, theta, shared) > config.described:
        return replace(NOT_TOLD, reason=f"no payload makes the torque agree with the {by}")
    share = float(_size(parts[0])[0])  # of the torque, that one kilogram makes
    if not share > 0.0:
        return replace(NOT_TOLD, reason="the mass of a payload acts on no joint")
    mass = float(theta[0])
    std = float(np.hypot(np.sqrt(covariance[0, 0]), config.model_error / share))
    if mass > config.payload_deviations * std and share * mass > config.payload_share:
        return CompensatedPayload(mass, std, True, by, "")
    if 0.0 < share * (mass + 2.0 * std) < config.payload_share:
        return CompensatedPayload(mass, std, False, by, "")
    return CompensatedPayload(mass, std, None, by, "the logs do not tell a payload from none")


def _misfit(parts: Sequence[_Part], theta: Array, shared: int) -> float:
    """Return what a fit leaves of a joint's torque beyond what any links leave, at most."""
    own = theta[shared:].reshape(len(parts), *parts[0].target.shape[:1], -1)
    most = 0.0
    for part, laws in zip(parts, own, strict=True):
        model = part.columns @ theta[:shared] + np.einsum("jnc,jc->jn", _own(part), laws)
        beyond = np.mean((part.target - model) ** 2, axis=1) - part.fit.residual**2
        most = max(most, float(np.sqrt(np.max(beyond, initial=0.0))))
    return most
