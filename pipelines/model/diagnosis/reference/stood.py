"""How much of what was found in the later logs the reference logs have.

    share = share_before(columns, data, later, others, standing, weight)
    share.stood                 it was there before
    share.doubtful              so much of it may have been there before that nobody knows whether it has changed

The standing set is what pays in the reference logs. A law may pay little there and be there all the same: a hump of friction at
speeds that an excitation hardly stays at. In later logs of another motion it stands high, the more so as its shape is fitted to
these, while the best shape of a screening leaves some of it, which passes for a change. So the amplitude is asked for before and
after in one system, in the very shape that was found.

Of 22 effects hidden in later logs the reference logs had 0.00 to 0.14, of four laws of friction that had always been there 0.92 to
1.03, and of what passed for cogging in an arm in order 0.40 and 0.60, of another phase.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.fitted.linear import covariance, solved
from pipelines.model.diagnosis.fitted.nominal import orthonormal
from pipelines.model.diagnosis.rows.data import Data

__all__ = ["ANYTHING", "Share", "share_before"]

_SAME, _TWICE, _SURE = 0.5, 2.0, 0.25  # of what is there now, that was there before: at least, at most; its standard deviation
_LIKE = 0.3  # the same in any shape, from which it may have been there
_CHANCE = 2.0  # of these deviations, below which nobody knows
_ROUNDING = 1e-6  # of a column: what others leave of it, when they are all of it
_REST = 0.3  # of what shows of it in the reference logs: what stands there is the rest of it, in this shape or nearly


@dataclass(frozen=True)
class Share:
    """In parts of the torque that a cause makes in the later logs, by what the nominal model cannot imitate of it there."""

    same: float  # of that of the reference logs' amplitudes, along it
    whole: float  # of these, in any direction
    std: float

    @property
    def stood(self) -> bool:
        return _SAME <= self.same <= _TWICE and self.std <= _SURE

    @property
    def doubtful(self) -> bool:
        """What was there with the other sign, half as much at least, is no such thing: it has changed all the more. Nor is noise,
        which has a size as well, where the reference logs do not tell."""
        like = np.sqrt(max(self.whole**2 - self.std**2, 0.0))
        return bool(like > _LIKE and self.whole > _CHANCE * self.std and self.same > -_SAME)


ANYTHING = Share(0.0, 1.0, 0.0)  # all of it may have been there, and nobody knows


def share_before(columns: Array, data: Data, later: npt.NDArray[np.bool_], others: Array, standing: Array, weight: Array) -> Share:
    """Of a cause's amplitudes in one system, each with its own before and after.

    A cause that stands already, in this shape or nearly, is told by `standing` in the reference logs: of what is new in the later
    ones they have nothing.

    Args:
        columns: (k, rows) of the cause.
        data: rows of the reference logs, then of the later ones; `later` says which.
        others: (n, rows) columns of all else that the model has; `standing`: (m, rows) those of what stands.
        weight: (joints,) [1/(N m)].
    """
    count, weights = len(columns), weight[data.joint]
    own = columns * weights
    before, after = np.where(later, 0.0, own), np.where(later, own, 0.0)
    plain = orthonormal(others * weights)
    every = _extended(plain, standing * weights)
    shows, left = (np.linalg.norm(_beside(_extended(basis, after), before)) for basis in (plain, every))
    if left <= _REST * shows:
        return Share(0.0, 0.0, 0.0 if before.any() else np.inf)
    # Of the whole fit only these coefficients are asked: of what all others leave of the columns and the torque
    # (Frisch & Waugh 1933, Lovell 1963), and so their covariance.
    table = np.concatenate([before, after])
    seen, torque = _beside(every, table), _beside(every, data.y * weights)
    seen[np.linalg.norm(seen, axis=1) <= _ROUNDING * np.linalg.norm(table, axis=1)] = 0.0
    beta = solved(seen, torque)
    was, now = beta[:count], beta[count:]
    gram = seen[count:] @ seen[count:].T
    there = max(float(now @ gram @ now), 1e-300)
    spread = float(np.trace(gram @ covariance(seen, torque - beta @ seen)[:count, :count]))
    size, std = (float(np.sqrt(max(x, 0.0) / there)) for x in (float(was @ gram @ was), spread))
    return Share(float(was @ gram @ now) / there, size, std)


def _extended(basis: Array, table: Array) -> Array:
    """Orthonormal rows that span those of `basis`, which are, and of `table`."""
    left = _beside(basis, table)
    new = np.linalg.norm(left, axis=1) > _ROUNDING * np.linalg.norm(table, axis=1)
    return np.concatenate([basis, orthonormal(_beside(basis, left[new]))])


def _beside(basis: Array, x: Array) -> Array:
    """Rows (…, rows) less what the orthonormal ones of `basis` make of them."""
    return np.asarray(x - (x @ basis.T) @ basis)
