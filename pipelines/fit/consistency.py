"""Whether bodies that could exist explain the estimates.

A rigid body's ten parameters are those of some distribution of mass exactly if its pseudo-inertia is positive
semidefinite (Wensing, Kim & Slotine 2018, Theorem 1):

    J = [ Σ  h ]      Σ = ∫ r rᵀ dm,  h = ∫ r dm,  m = ∫ dm
        [ hᵀ m ]

Torque shows only combinations β = L φ of the parameters φ of all bodies. Consistent is an estimate for which bodies exist
whose β lies within its covariance (Sousa & Cortesão 2014, who state it as a semidefinite programme):

    minimise  ½ (β̂ - L φ)ᵀ C⁻¹ (β̂ - L φ)    over φ with every J_i(φ_i) ⪰ 0

It is solved by a barrier method (Boyd & Vandenberghe 2004, section 11.3) in about ten milliseconds; a conic solver needs
scipy.sparse, which takes half a second to load. Masses are bounded, far above those of any arm, because torque leaves
some of them open.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipelines.fit.equations import Array

__all__ = ["Consistency", "Inequality", "physical_consistency", "pseudo_inertia"]

_LIMIT = 3.0  # standard deviations within which noise explains the distance to what is possible
_GAP = 1e-4  # of ½ distance², absolute and relative, where the search stops
_BOUND = 100.0  # times the largest estimate: what mass and moments stay below
_STEPS = 200
_ROUNDING = 1e-13  # of a Hessian with unit diagonal


@dataclass(frozen=True)
class Inequality:
    """A quantity that physics demands to be positive, with its uncertainty."""

    name: str  # "p13 - p5 = 2 ∫ y² dm > 0"
    value: float
    std: float

    @property
    def satisfied(self) -> bool:
        """Within its uncertainty; where that is unknown, as it stands."""
        return self.value > -(_LIMIT * self.std if np.isfinite(self.std) else 0.0)


@dataclass(frozen=True, eq=False)
class Consistency:
    """How far an estimate is from what bodies can do."""

    consistent: bool
    distance: float  # standard deviations between the estimate and the nearest possible one
    nearest: Array  # (k,) the nearest possible β
    parameters: Array  # (bodies, 10) one set of bodies that has it; many do
    violating: tuple[int, ...]  # bodies without whose condition the estimate would be consistent


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
_ROWS = _PSEUDO.reshape(16, 10).T  # J as a row of 16 = φ · this
_TRACE = np.einsum("aak->k", _PSEUDO)


def pseudo_inertia(parameters: Array) -> Array:
    """J (bodies, 4, 4) of standard parameters (bodies, 10)."""
    return np.asarray((parameters @ _ROWS).reshape(-1, 4, 4))


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
    bodies = combine.shape[1] // 10
    bound = _BOUND * max(float(np.abs(beta[known]).max(initial=0.0)), 1.0)
    everybody = range(bodies)
    phi = _nearest(a, b, _Barrier(tuple(everybody), bodies, bound))
    distance = float(np.linalg.norm(a @ phi - b))
    violating: tuple[int, ...] = ()
    if distance > _LIMIT:
        others = [_Barrier(tuple(k for k in everybody if k != i), bodies, bound) for i in everybody]
        without = [float(np.linalg.norm(a @ _nearest(a, b, barrier) - b)) for barrier in others]
        violating = tuple(i for i in everybody if without[i] <= max(_LIMIT, 0.5 * distance)) or tuple(everybody)
    return Consistency(distance <= _LIMIT, distance, combine @ phi, phi.reshape(bodies, 10), violating)


def _whitener(covariance: Array) -> Array:
    """W with WᵀW = C⁻¹, found with unit variances."""
    std = np.sqrt(np.diag(covariance))
    std = np.where(std > 0.0, std, 1e-12)
    values, vectors = np.linalg.eigh(covariance / std / std[:, None])
    return np.asarray((vectors / np.sqrt(np.maximum(values, 1e-12))).T / std)


@dataclass(frozen=True)
class _Barrier:
    """-Σ log det J_i - Σ log(bound - tr J_i) over the bodies that are held, -Σ log(bound² - φ²) over the others'."""

    held: tuple[int, ...]
    bodies: int
    bound: float

    @cached_property
    def free(self) -> list[int]:
        return [i for i in range(self.bodies) if i not in self.held]

    def value(self, phi: Array) -> float:
        """Infinite outside."""
        table = phi.reshape(self.bodies, 10)
        free = self.bound**2 - np.square(table[self.free])
        inertias = pseudo_inertia(table[list(self.held)])
        room = self.bound - np.einsum("iaa->i", inertias)
        if (free <= 0.0).any() or (room <= 0.0).any():
            return float("inf")
        try:
            triangles = np.linalg.cholesky(inertias)
        except np.linalg.LinAlgError:
            return float("inf")
        return float(-2.0 * np.log(np.einsum("iaa->ia", triangles)).sum() - np.log(room).sum() - np.log(free).sum())

    def derivatives(self, phi: Array) -> tuple[Array, Array]:
        """Gradient (10 · bodies,), and F with FᵀF the Hessian: from J = T Tᵀ and S_k = T⁻¹ M_k T⁻ᵀ come -tr S_k and
        tr S_k S_l. Boyd & Vandenberghe 2004, section A.4.
        """
        table = phi.reshape(self.bodies, 10)
        gradient, factor = np.zeros((self.bodies, 10)), np.zeros((self.bodies, 17, self.bodies, 10))
        for i in range(self.bodies):
            if i in self.held:
                inertia = pseudo_inertia(table[i:i + 1])[0]
                inverse = np.linalg.inv(np.linalg.cholesky(inertia))
                scaled = np.einsum("ab,bck,dc->adk", inverse, _PSEUDO, inverse)
                room = self.bound - float(np.trace(inertia))
                gradient[i] = _TRACE / room - np.einsum("aak->k", scaled)
                factor[i, :16, i], factor[i, 16, i] = scaled.reshape(16, 10), _TRACE / room
            else:
                room_of = self.bound**2 - np.square(table[i])
                gradient[i] = 2.0 * table[i] / room_of
                factor[i, :10, i] = np.diag(np.sqrt(2.0 / room_of + np.square(gradient[i])))
        return gradient.ravel(), factor.reshape(-1, phi.size)


def _nearest(a: Array, b: Array, barrier: _Barrier) -> Array:
    """Minimise t ½ ‖a φ - b‖² + barrier(φ) by Newton's method while t grows; 5 · bodies / t is left to gain.

    In coordinates x of which the first are a φ, rotated, and the others do not touch it: rounding in what is known to
    many digits then does not reach what is not known at all.
    """
    u, s, v = np.linalg.svd(a)
    rank = int(np.sum(s > 1e-12 * s[0])) if len(s) else 0
    basis = v.T.copy()
    basis[:, :rank] /= s[:rank]
    goal = u[:, :rank].T @ b
    phi = np.tile(np.array([1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]), barrier.bodies)
    x = np.concatenate([s[:rank], np.ones(v.shape[0] - rank)]) * (v @ phi)
    t = 1.0 / max(float(np.sum(np.square(x[:rank] - goal))), 1e-3)
    for _ in range(_STEPS):
        gradient, factor = barrier.derivatives(basis @ x)
        gradient, factor = basis.T @ gradient, factor @ basis
        hessian = factor.T @ factor
        gradient[:rank] += t * (x[:rank] - goal)
        hessian[np.arange(rank), np.arange(rank)] += t
        size = np.sqrt(np.diag(hessian))
        step = -np.linalg.solve(hessian / size / size[:, None] + _ROUNDING * np.eye(len(size)), gradient / size) / size
        decrement = -float(gradient @ step)
        if decrement < 0.05:
            if 5.0 * barrier.bodies / t < _GAP * max(1.0, 0.5 * float(np.sum(np.square(x[:rank] - goal)))):
                break
            t *= 30.0
            continue
        x = _descend(x, step, decrement, _Objective(barrier, basis, goal, t))
    return np.asarray(basis @ x)


@dataclass(frozen=True, eq=False)
class _Objective:
    barrier: _Barrier
    basis: Array
    goal: Array
    t: float

    def __call__(self, x: Array) -> float:
        misfit = float(np.sum(np.square(x[:len(self.goal)] - self.goal)))
        return 0.5 * self.t * misfit + self.barrier.value(self.basis @ x)


def _descend(x: Array, step: Array, decrement: float, value: Callable[[Array], float]) -> Array:
    """Halve the step until it gains what a quarter of its slope promises; stay where rounding allows no gain."""
    start = value(x)
    for length in np.power(0.5, np.arange(40)):
        if value(x + length * step) <= start - 0.25 * length * decrement:
            return np.asarray(x + length * step)
    return x
