"""Tell noise from model error by pairs of rows of one state.

    common, differing = Repeated.of(data).parts(left)      what is noise, and what is not

Noise is what differs between two rows of one state. With a residual r = f(q, dq, ddq) + e of a
model error f and noise e, independent in both rows,

    E ¼ (r₁ - r₂)² = ½ σ²        E ¼ (r₁ + r₂)² = ½ σ² + f²

(Rice 1984, difference-based variance). Rows of periods that come again are such pairs, declared or
not, within a log or between two. Where states differ a little, σ² is too large, not too small.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.log.experiment import Array
from pipelines.model.rows.data import Data
from pipelines.signal.neighbours import nearest_pairs

__all__ = ["Repeated"]

_STILL = (1e-3, 1e-2, 0.1)  # [rad, rad/s, rad/s²; m, m/s, m/s²] less motion is noise
_NEAR = 0.1  # of the standard deviation of each coordinate: rows of one state
_APART = 1.0  # [s] in a log, at least: after less, what wanders is still where it was
_OTHER_LOG = 1e9  # numerics: [s] between the clocks of two logs
_FEWEST = 100  # numerics: pairs of a joint; fewer say little


@dataclass(frozen=True, eq=False)
class Repeated:
    """Pairs of rows of one state; no row is in two of them."""

    data: Data
    first: npt.NDArray[np.intp]  # (pairs,) among the rows of all logs, one joint
    second: npt.NDArray[np.intp]

    @classmethod
    def of(cls, data: Data) -> Repeated:
        """Return the pairs, nearest first."""
        logs = []
        for one in data.logs:
            scaled = zip((one.motion.q, one.motion.dq, one.motion.ddq), _STILL, strict=True)
            logs.append(np.hstack([one.at_rows(x) / least for x, least in scaled]))
        log = np.repeat(np.arange(len(logs)), [len(own) for own in logs])
        time = np.concatenate([one.t for one in data.logs]) + _OTHER_LOG * log
        return cls(data, *nearest_pairs(np.vstack(logs), time, _NEAR, _APART))

    @property
    def count(self) -> Array:
        """(joints,) pairs that count."""
        return np.asarray(self._counts.sum(axis=1), dtype=np.float64)

    def parts(self, left: Array) -> tuple[Array, Array]:
        """Return the mean squares of what pairs of a residual (rows,) share, and of the rest."""
        one, other = (self._laid(left)[:, at] for at in (self.first, self.second))
        counts, number = self._counts, np.where(self.count < _FEWEST, np.nan, self.count)
        both = (one + other, one - other)
        return tuple(np.square(0.5 * x).sum(axis=1, where=counts) / number for x in both)

    def noise(self, left: Array) -> Array:
        """Return the variance (joints,) of a residual's noise; NaN of too few pairs."""
        return 2.0 * self.parts(left)[1]

    @property
    def _counts(self) -> npt.NDArray[np.bool_]:
        """(joints, pairs)"""
        weighed = np.concatenate([one.weighed for one in self.data.logs], axis=1)
        return np.asarray(weighed[:, self.first] & weighed[:, self.second])

    def _laid(self, x: Array) -> Array:
        """(rows,) -> (joints, rows of one joint)"""
        return np.concatenate(list(self.data.split(x)), axis=1)
