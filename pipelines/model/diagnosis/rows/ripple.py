"""What the torque constants of drives in order ripple with the angle, as noise of the rows.

    ripple = Ripple.of(data)
    ripple.out_of(table, weight)        (k, rows) weighted rows in which it is as large as the rest of the noise, and white

A thousandth of a torque that carries gravity is as much as the amplifier's noise, and the same whenever the joint comes by. Least
squares of rows that are weighed alike take it for what it looks like over the angles of these logs, gravity of a lighter arm say,
and are wrong by several times their standard deviation where other logs turn farther. With the ripple in the covariance of the rows
they are not (Aitken 1935; as a random effect: Henderson 1975).

The ripple of joint j is torque times a random function of its angle, of the orders that drives have, each with the same power:

    e_j = τ_j Σ_m (a_m cos m q_j + b_m sin m q_j),   a_m, b_m ~ N(0, r²/(2 M)),   m = 6 … 39,  r = 0.1 %
    K = I + F Fᵀ,   F = U S Vᵀ,   K^(-1/2) = I + U ((1 + S²)^(-1/2) - 1) Uᵀ
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.rows.imperfections import RIPPLE, ripple_orders

if TYPE_CHECKING:
    from pipelines.model.diagnosis.rows.data import Data, LogData

__all__ = ["Ripple"]

_LEAST = 0.03  # of the rows' noise, that a direction of the ripple has at least: less than a thousandth of it would go out
_ROUNDING = 1e-10  # of the largest square


@dataclass(frozen=True, eq=False)
class Ripple:
    """Of each joint the rows that count, and what ripple does to them."""

    rows: tuple[npt.NDArray[np.intp], ...]  # of each joint
    basis: tuple[Array, ...]  # U (rows, rank)
    size: tuple[Array, ...]  # S (rank,) [N m]

    @classmethod
    def of(cls, data: Data) -> Ripple:
        """By the measured torque: what of it is not the drive's is less than a ripple's ripple."""
        rows, basis, size = [], [], []
        for joint in range(data.n_joints):
            own = np.flatnonzero((data.joint == joint) & data.counts)
            waves = np.concatenate([_rippled(one, joint) for one in data.logs])[data.counts[data.joint == joint]]
            square, turn = np.linalg.eigh(waves.T @ waves)  # S², V: of many rows ten times as fast as their own decomposition
            told = square > _ROUNDING * max(float(square[-1]), 1e-300)
            rows.append(own)
            size.append(np.sqrt(square[told]))
            basis.append(waves @ turn[:, told] / size[-1])
        return cls(tuple(rows), tuple(basis), tuple(size))

    def waves(self, weight: Array) -> list[tuple[npt.NDArray[np.intp], Array]]:
        """Of each joint its rows, and F of these (rows, rank) weighted by `weight` (joints,) [1/(N m)]."""
        parts = zip(self.rows, self.basis, self.size, weight, strict=True)
        return [(rows, basis * (own * size)) for rows, basis, size, own in parts]

    def out_of(self, table: Array, weight: Array, only: npt.NDArray[np.intp] | None = None) -> Array:
        """K^(-1/2) x of every line of `table` (..., rows), weighted by `weight` (joints,) [1/(N m)]; `only`: which rows these are,
        of some of the joints all."""
        if not np.size(table):  # of a cause that acts nowhere
            return table
        flat = np.array(table, dtype=np.float64).reshape(-1, np.shape(table)[-1])
        for rows, basis, size, own in zip(self.rows, self.basis, self.size, weight, strict=True):
            at = rows if only is None else np.searchsorted(only, rows)
            seen = own * size > _LEAST
            if not seen.any() or (only is not None and (at[-1] >= len(only) or only[at[0]] != rows[0])):
                continue
            u = basis[:, seen]
            less = 1.0 / np.sqrt(1.0 + np.square(own * size[seen])) - 1.0
            where = slice(at[0], at[-1] + 1) if at[-1] - at[0] + 1 == len(at) else at  # without gaps nothing is copied
            flat[:, where] += ((flat[:, where] @ u) * less) @ u.T
        return flat.reshape(np.shape(table))


def _rippled(one: LogData, joint: int) -> Array:
    """(rows, orders) [N m] what each wave of a ripple makes of the torque of a joint in one log.

    Of torque that has passed the low-pass: right to 3 % at a usual cut-off, where no wave is as quick; below 10 Hz the highest
    orders are up to a fourth too large.
    """
    orders = ripple_orders(one.log.robot.revolute[joint])
    turn = one.at_rows(one.motion.q)[:, joint, None] * orders
    size = RIPPLE / np.sqrt(2.0 * len(orders)) * one.plain[joint, :, None]
    waves = (size * np.concatenate([np.cos(turn), np.sin(turn)], axis=1)).T
    return waves.T if one.whitening is None else one.whitening.through(waves, [joint] * len(waves), one.stretches).T
