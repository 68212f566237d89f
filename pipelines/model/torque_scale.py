"""Ask whether one joint's torque would fit the others' in another scale: a gear ratio or torque constant applied twice, or not.

    found = torque_scale(e)          found.factor: times what the other joints' torques need; None where nothing is wrong

No parameter of the arm has to be known: the rows of all joints share the rigid body's parameters, those of one joint alone would
follow any scale of its torque.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.body import Array, RigidBody
from pipelines.model.evidence import Evidence
from pipelines.model.row_fit import Sampled

__all__ = ["TorqueScale", "torque_scale"]

# A drive whose gain is off by less is a fault that `diagnose` names and measures; gear ratios are off by more.
_LEAST, _MOST = 1.8, 200.0
# Relative residual of all rows with one set of parameters, and the ratio of two: with that beyond what a set for each joint leaves,
# torque of another drive in a joint, or a clipped one, would pass for a scale.
_BAD, _BETTER = 0.02, 0.4
_GRID, _FINER = 25, 6  # points, and how often a grid is laid about the best of the last
_AS_GOOD = 1.3  # times the least residual
_RANK = 1e-12  # of the largest eigenvalue of the normal equations, a column: what is smaller is rounding


@dataclass(frozen=True)
class TorqueScale:
    """The torque of `joint` (from 0) is `factor` times what the others' need; residuals before and after it is divided by it."""

    joint: int
    factor: float
    before: float
    after: float
    others: tuple[tuple[int, float], ...] = ()  # joints and factors that explain as much: of two torques only the ratio shows


def torque_scale(e: Evidence) -> TorqueScale | None:
    """The joint and factor that leave least, where the log as it is leaves far more; None where none does. Joints that are only
    held tell nothing."""
    told = e.telling.tolist()
    if len(told) < 2:
        return None
    rows = _Rows.of(e.body, e.motion, told)
    before = rows.left(np.ones(len(told)))
    if before < _BAD:
        return None
    found = sorted((*_least(rows, place, len(told)), joint) for place, joint in enumerate(told))
    after, factor, joint = found[0]
    apart = max(factor, 1.0 / factor)
    inside = _LEAST < apart < _MOST * (1.0 - 1e-9)  # the end of the search is no finding
    if not inside or after > _BETTER * before:
        return None
    others = tuple((other, by) for left, by, other in found[1:] if left < _AS_GOOD * after)
    return TorqueScale(joint, factor, before, after, others)


def _least(rows: _Rows, place: int, n: int) -> tuple[float, float]:
    """Residual and factor of one joint's torque by which all rows fit best, by ever finer grids of its logarithm."""
    def left(log_factor: float) -> float:
        factors = np.ones(n)
        factors[place] = np.exp(log_factor)
        return rows.left(factors)

    low, high = -np.log(_MOST), np.log(_MOST)
    for _ in range(_FINER):
        grid = np.linspace(low, high, _GRID)
        best, at = min((left(float(x)), k) for k, x in enumerate(grid))
        low, high = grid[max(at - 1, 0)], grid[min(at + 1, _GRID - 1)]
    return best, float(np.exp(grid[at]))


@dataclass(frozen=True)
class _Rows:
    """Normal equations of the torque of each joint that tells, over its size, after its own friction, rotor inertia and offset."""

    gram: Array  # (joints, parameters, parameters)
    side: Array  # (joints, parameters)
    square: Array  # (joints,)

    @classmethod
    def of(cls, body: RigidBody, motion: Sampled, told: Sequence[int]) -> _Rows:
        regressor, tau = body.regressor(motion.q, motion.dq, motion.ddq), motion.tau
        scale = np.sqrt(np.sum(regressor**2, axis=(0, 1)))
        regressor = regressor / np.where(scale > 0.0, scale, 1.0)
        grams, sides, squares = [], [], []
        for j in told:
            own = np.stack([motion.ddq[:, j], motion.dq[:, j], motion.coulomb[:, j], np.ones(len(tau))], axis=-1)
            own, _ = np.linalg.qr(own / np.maximum(np.linalg.norm(own, axis=0), 1e-300))
            size = float(np.linalg.norm(tau[:, j] - tau[:, j].mean())) or 1.0
            unit = tau[:, j] / size
            rest, columns = unit - own @ (own.T @ unit), regressor[:, j] - own @ (own.T @ regressor[:, j])
            grams.append(columns.T @ columns / size**2)
            sides.append(columns.T @ rest / size)
            squares.append(float(rest @ rest))
        return cls(np.array(grams), np.array(sides), np.array(squares))

    def left(self, factors: Array) -> float:
        """rms over the joints of what is left of each torque's variation, the torques divided by `factors` (joints,).

            min over β of Σ_j |τ_j/s_j - f_j/s_j Φ_j β|² = Σ_j c_j - bᵀ G⁺ b,  b = Σ_j f_j b_j,  G = Σ_j f_j² G_j
        """
        gram, side = np.einsum("j,jab->ab", factors**2, self.gram), factors @ self.side
        size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        values, vectors = np.linalg.eigh(gram / size / size[:, None])
        seen = values > _RANK * values[-1] * len(values)
        explained = float(np.sum((vectors[:, seen].T @ (side / size)) ** 2 / values[seen]))
        return float(np.sqrt(max(float(self.square.sum()) - explained, 0.0) / len(self.square)))
