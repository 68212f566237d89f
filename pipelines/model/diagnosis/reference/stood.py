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
from pipelines.model.diagnosis.fitted.linear import covariance
from pipelines.model.diagnosis.fitted.nominal import Fit, fit_columns
from pipelines.model.diagnosis.rows.data import Data

__all__ = ["ANYTHING", "Share", "share_before"]

_SAME, _TWICE, _SURE = 0.5, 2.0, 0.25  # of what is there now, that was there before: at least, at most; its standard deviation
_LIKE = 0.3  # the same in any shape, from which it may have been there
_CHANCE = 2.0  # of these deviations, below which nobody knows
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
    count = len(columns)
    before, after = np.where(later, 0.0, columns), np.where(later, columns, 0.0)
    whole = np.concatenate([others, standing])

    def beside(table: Array) -> Fit:
        """Nothing is fitted: what these columns leave of others is asked."""
        return Fit(data, table, data.y, weight, np.zeros(len(table)))

    shows, left = (np.linalg.norm(beside(np.concatenate([table, after])).project(before)) for table in (others, whole))
    if left <= _REST * shows:
        return Share(0.0, 0.0, 0.0 if before.any() else np.inf)
    fit = fit_columns(data, np.concatenate([whole, before, after]), weight=weight)
    own = slice(len(whole), len(whole) + count)
    was, now = fit.beta[own], fit.beta[own.stop:]
    seen = beside(whole).project(after)
    gram = seen @ seen.T
    there = max(float(now @ gram @ now), 1e-300)
    spread = float(np.trace(gram @ covariance(fit.table * fit.weights, fit.residual)[own, own]))
    size, std = (float(np.sqrt(max(x, 0.0) / there)) for x in (float(was @ gram @ was), spread))
    return Share(float(was @ gram @ now) / there, size, std)
