"""Test whether one joint's torque fits the others' in another scale: gear ratio, torque constant.

    found = torque_scale(e)          found.factor: times what the other joints' torques need

No parameter of the arm has to be known: the rows of all joints share the rigid body's parameters,
those of one joint alone would follow any scale of its torque.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.body import RigidBody
from pipelines.estimation.checks.joint_rows import Evidence, Sampled
from pipelines.estimation.config import TorqueScaleConfig
from pipelines.io.log import Array

_CONFIG = TorqueScaleConfig()
_GRID, _FINER = 25, 6  # numerics: points, and how often a grid is laid about the best of the last
_RANK = 1e-12  # numerics: of the largest eigenvalue of the normal equations, a column


@dataclass(frozen=True)
class TorqueScale:
    """The torque of `joint` (from 0) is `factor` times what the others' need."""

    joint: int
    factor: float
    before: float  # residual
    after: float  # the same where the torque is divided by the factor
    # joints and factors that explain as much: of two torques only the ratio shows
    others: tuple[tuple[int, float], ...] = ()


def torque_scale(e: Evidence) -> TorqueScale | None:
    """Return the joint and factor that leave least, where the log as it is leaves far more.

    Joints that are only held tell nothing.
    """
    told = e.telling.tolist()
    if len(told) < 2:
        return None
    rows = _Rows.of(e.body, e.motion, told)
    before = rows.left(np.ones(len(told)))
    if before < _CONFIG.bad:
        return None
    found = sorted((*_least(rows, place, len(told)), joint) for place, joint in enumerate(told))
    after, factor, joint = found[0]
    size = max(factor, 1.0 / factor)
    # the end of the search is no finding
    inside = _CONFIG.least < size < _CONFIG.most * (1.0 - 1e-9)
    if not inside or after > _CONFIG.better * before:
        return None
    alike = [(other, by) for left, by, other in found[1:] if left < _CONFIG.as_good * after]
    return TorqueScale(joint, factor, before, after, tuple(alike))


def _least(rows: _Rows, place: int, n: int) -> tuple[float, float]:
    """Return residual and factor of one joint's torque by which all rows fit best.

    By ever finer grids of its logarithm.
    """

    def left(log_factor: float) -> float:
        factors = np.ones(n)
        factors[place] = np.exp(log_factor)
        return rows.left(factors)

    low, high = -np.log(_CONFIG.most), np.log(_CONFIG.most)
    for _ in range(_FINER):
        grid = np.linspace(low, high, _GRID)
        best, at = min((left(float(x)), k) for k, x in enumerate(grid))
        low, high = grid[max(at - 1, 0)], grid[min(at + 1, _GRID - 1)]
    return best, float(np.exp(grid[at]))


@dataclass(frozen=True)
class _Rows:
    """Normal equations of each joint's torque over its size, after its own columns."""

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
            parts = (motion.ddq[:, j], motion.dq[:, j], motion.coulomb[:, j], np.ones(len(tau)))
            own = np.stack(parts, axis=-1)
            own, _ = np.linalg.qr(own / np.maximum(np.linalg.norm(own, axis=0), 1e-300))
            size = float(np.linalg.norm(tau[:, j] - tau[:, j].mean())) or 1.0
            rest, columns = tau[:, j] / size, regressor[:, j]
            rest, columns = (x - own @ (own.T @ x) for x in (rest, columns))
            grams.append(columns.T @ columns / size**2)
            sides.append(columns.T @ rest / size)
            squares.append(float(rest @ rest))
        return cls(np.array(grams), np.array(sides), np.array(squares))

    def left(self, factors: Array) -> float:
        """Return the rms of what is left of each torque's variation, divided by `factors`.

        min over β of Σ_j |τ_j/s_j - f_j/s_j Φ_j β|² = Σ_j c_j - bᵀ G⁺ b,  b = Σ_j f_j b_j,
        G = Σ_j f_j² G_j
        """
        gram, side = np.einsum("j,jab->ab", factors**2, self.gram), factors @ self.side
        size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        values, vectors = np.linalg.eigh(gram / size / size[:, None])
        seen = values > _RANK * values[-1] * len(values)
        explained = np.sum((vectors[:, seen].T @ (side / size)) ** 2 / values[seen])
        rest = max(float(self.square.sum()) - float(explained), 0.0)
        return float(np.sqrt(rest / len(self.square)))
