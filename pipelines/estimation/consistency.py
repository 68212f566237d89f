"""Decide whether bodies that could exist explain the estimates.

A rigid body's ten parameters are those of some distribution of mass exactly if its pseudo-inertia
is positive semidefinite (Wensing, Kim & Slotine 2018, Theorem 1):

    J = [ Σ  h ]      Σ = ∫ r rᵀ dm,  h = ∫ r dm,  m = ∫ dm
        [ hᵀ m ]

Torque shows only combinations β = L φ of the parameters φ of all bodies. Consistent is an estimate
for which bodies exist whose β lies within its covariance (Sousa & Cortesão 2014, who state it as a
semidefinite programme):

    minimise  ½ (β̂ - L φ)ᵀ C⁻¹ (β̂ - L φ)    over φ with every J_i(φ_i) ⪰ 0

It is solved by a barrier method (Boyd & Vandenberghe 2004, section 11.3) in about ten milliseconds;
a conic solver needs scipy.sparse, which takes half a second to load. Masses are bounded, far above
those of any arm, because torque leaves some of them open.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.base_parameters import BaseArm
from pipelines.dynamics.body import RigidBody
from pipelines.dynamics.rrr import RRR, combined
from pipelines.estimation.config import ConsistencyConfig
from pipelines.estimation.estimate import Estimate
from pipelines.io.log import Array

_CONFIG = ConsistencyConfig()
_STEPS = 200  # numerics
_ROUNDING = 1e-13  # numerics: of a Hessian with unit diagonal


@dataclass(frozen=True)
class Consistent:
    """Whether links that could exist have the estimated parameters."""

    consistent: bool
    distance: float  # [standard deviations] to the nearest parameters that could
    violating: tuple[str, ...]  # links without whose condition they would


@dataclass(frozen=True, eq=False)
class Consistency:
    """How far an estimate is from what bodies can do."""

    consistent: bool
    distance: float  # standard deviations between the estimate and the nearest possible one
    nearest: Array  # (k,) the nearest possible β
    parameters: Array  # (bodies, 10) one set of bodies that has it; many do
    violating: tuple[int, ...]  # bodies without whose condition the estimate would be consistent


def consistency(found: Estimate, body: RigidBody) -> Consistent | None:
    """Return whether links could have these parameters.

    None where a parameter is not determined: nothing can be said of links then.
    """
    if not found.trusted[list(found.columns.rigid)].all():
        return None
    kept = list(found.columns.kept)
    own = len(kept)
    if isinstance(body, RRR):
        combine = combined(body.robot)
    elif isinstance(body, BaseArm):
        combine = body.base.combine
    else:
        raise TypeError(f"no links are known behind a {type(body).__name__}")
    answer = physical_consistency(
        found.beta[:own], found.robust.covariance[:own, :own], combine[kept]
    )
    names = tuple(body.robot.joints[i].name for i in answer.violating)
    return Consistent(answer.consistent, answer.distance, names)


def _pseudo_map() -> Array:
    """(4, 4, 10): J = Σ_k map[..., k] φ_k for φ = m, mx, my, mz, Ixx, Iyy, Izz, Ixy, Ixz, Iyz.

    About the origin, products positive: Σ_xx = (Iyy + Izz - Ixx)/2, Σ_xy = Ixy.
    """
    out = np.zeros((4, 4, 10))
    out[3, 3, 0] = 1.0
    for a in range(3):
        out[a, 3, 1 + a] = out[3, a, 1 + a] = 1.0
        out[a, a, 4:7] = 0.5
        out[a, a, 4 + a] = -0.5
    for k, (a, b) in enumerate(((0, 1), (0, 2), (1, 2))):
        out[a, b, 7 + k] = out[b, a, 7 + k] = 1.0
    return out


_PSEUDO = _pseudo_map()
_TRACE = np.einsum("aak->k", _PSEUDO)


def pseudo_inertia(parameters: Array) -> Array:
    """Return J (bodies, 4, 4) of standard parameters (bodies, 10)."""
    return np.asarray((parameters @ _PSEUDO.reshape(16, 10).T).reshape(-1, 4, 4))


def physical_consistency(beta: Array, covariance: Array, combine: Array) -> Consistency:
    """Return whether bodies exist that reproduce `beta` within `covariance`.

    Args:
        beta: (k,) estimates.
        covariance: (k, k); an estimate with an infinite variance says nothing.
        combine: L (k, 10 · bodies), β = L φ.
    """
    known = np.isfinite(np.diag(covariance))
    whiten = _whitener(covariance[np.ix_(known, known)])
    a, b = whiten @ combine[known], whiten @ beta[known]
    bound = _CONFIG.bound * max(float(np.abs(beta[known]).max(initial=0.0)), 1.0)
    bodies = tuple(range(combine.shape[1] // 10))
    phi = _nearest(a, b, _Barrier(bodies, len(bodies), bound))
    distance = float(np.linalg.norm(a @ phi - b))
    violating: tuple[int, ...] = ()
    if distance > _CONFIG.limit:
        without = []
        for i in bodies:
            others = _Barrier(tuple(k for k in bodies if k != i), len(bodies), bound)
            without.append(float(np.linalg.norm(a @ _nearest(a, b, others) - b)))
        enough = max(_CONFIG.limit, 0.5 * distance)
        violating = tuple(i for i in bodies if without[i] <= enough) or bodies
    table = phi.reshape(len(bodies), 10)
    return Consistency(distance <= _CONFIG.limit, distance, combine @ phi, table, violating)


def _whitener(covariance: Array) -> Array:
    """Return W with WᵀW = C⁻¹, found with unit variances."""
    std = np.sqrt(np.diag(covariance))
    std = np.where(std > 0.0, std, 1e-12)
    values, vectors = np.linalg.eigh(covariance / std / std[:, None])
    return np.asarray((vectors / np.sqrt(np.maximum(values, 1e-12))).T / std)


@dataclass(frozen=True)
class _Barrier:
    """-Σ log det J_i - Σ log(bound - tr J_i) of held bodies, -Σ log(bound² - φ²) of others."""

    held: tuple[int, ...]
    bodies: int
    bound: float

    def value(self, phi: Array) -> float:
        """Return the barrier; infinite outside."""
        table = phi.reshape(self.bodies, 10)
        free = [i for i in range(self.bodies) if i not in self.held]
        inside = self.bound**2 - np.square(table[free])
        inertias = pseudo_inertia(table[list(self.held)])
        room = self.bound - np.einsum("iaa->i", inertias)
        if (inside <= 0.0).any() or (room <= 0.0).any():
            return float("inf")
        try:
            triangles = np.linalg.cholesky(inertias)
        except np.linalg.LinAlgError:
            return float("inf")
        determinants = 2.0 * np.log(np.einsum("iaa->ia", triangles)).sum()
        return float(-determinants - np.log(room).sum() - np.log(inside).sum())

    def derivatives(self, phi: Array) -> tuple[Array, Array]:
        """Return the gradient (10 · bodies,), and F with FᵀF the Hessian.

        From J = T Tᵀ and S_k = T⁻¹ M_k T⁻ᵀ come -tr S_k and tr S_k S_l. Boyd & Vandenberghe 2004,
        section A.4.
        """
        table = phi.reshape(self.bodies, 10)
        gradient = np.zeros((self.bodies, 10))
        factor = np.zeros((self.bodies, 17, self.bodies, 10))
        for i in range(self.bodies):
            if i in self.held:
                inertia = pseudo_inertia(table[i : i + 1])[0]
                inverse = np.linalg.inv(np.linalg.cholesky(inertia))
                scaled = np.einsum("ab,bck,dc->adk", inverse, _PSEUDO, inverse)
                room = _TRACE / (self.bound - float(np.trace(inertia)))
                gradient[i] = room - np.einsum("aak->k", scaled)
                factor[i, :16, i], factor[i, 16, i] = scaled.reshape(16, 10), room
            else:
                left = self.bound**2 - np.square(table[i])
                gradient[i] = 2.0 * table[i] / left
                factor[i, :10, i] = np.diag(np.sqrt(2.0 / left + np.square(gradient[i])))
        return gradient.ravel(), factor.reshape(-1, phi.size)


def _nearest(a: Array, b: Array, barrier: _Barrier) -> Array:
    """Minimise t ½ ‖a φ - b‖² + barrier(φ) by Newton while t grows; 5 · bodies / t is left.

    In coordinates x of which the first are a φ, rotated, and the others do not touch it: rounding
    in what is known to many digits then does not reach what is not known at all.
    """
    u, s, v = np.linalg.svd(a)
    rank = int(np.sum(s > 1e-12 * s[0])) if len(s) else 0
    basis = v.T.copy()
    basis[:, :rank] /= s[:rank]
    goal = u[:, :rank].T @ b
    unit = np.tile([1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0], barrier.bodies)
    x = np.concatenate([s[:rank], np.ones(v.shape[0] - rank)]) * (v @ unit)

    def misfit(x: Array) -> float:
        return float(np.sum(np.square(x[:rank] - goal)))

    t = 1.0 / max(misfit(x), 1e-3)
    for _ in range(_STEPS):
        gradient, factor = barrier.derivatives(basis @ x)
        gradient, factor = basis.T @ gradient, factor @ basis
        hessian = factor.T @ factor
        gradient[:rank] += t * (x[:rank] - goal)
        hessian[np.arange(rank), np.arange(rank)] += t
        size = np.sqrt(np.diag(hessian))
        scaled = hessian / size / size[:, None] + _ROUNDING * np.eye(len(size))
        step = -np.linalg.solve(scaled, gradient / size) / size
        decrement = -float(gradient @ step)
        if decrement < 0.05:
            if 5.0 * barrier.bodies / t < _CONFIG.gap * max(1.0, 0.5 * misfit(x)):
                break
            t *= 30.0
            continue
        # halve the step until it gains a quarter of what its slope promises
        start = 0.5 * t * misfit(x) + barrier.value(basis @ x)
        for length in np.power(0.5, np.arange(40)):
            there = x + length * step
            value = 0.5 * t * misfit(there) + barrier.value(basis @ there)
            if value <= start - 0.25 * length * decrement:
                x = there
                break
    return np.asarray(basis @ x)
