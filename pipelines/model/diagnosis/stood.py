"""How much of what was found in the later logs the reference logs have.

    share = share_before(columns, data, later, others, weight)
    share.stood                 it was there before
    share.doubtful              so much of it may have been there before that nobody knows whether it has changed

The standing set is what pays in the reference logs. A law may pay little there and be there all the same: a hump of friction at
speeds that an excitation hardly stays at. In later logs of another motion it stands high, the more so as its shape is fitted to
these, while the best shape of a screening leaves some of it, which passes for a change. So the amplitude is asked for before and
after in one system, in the very shape that was found.

Of 30 effects hidden in later logs the reference logs had 0.00 to 0.14, of laws of friction that had always been there 0.92 to 1.03,
and of what passed for cogging in an arm in order 0.40 and 0.60, of another phase.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.data import Data
from pipelines.model.diagnosis.linear import covariance
from pipelines.model.diagnosis.nominal import fit_columns

__all__ = ["Share", "share_before"]

_SAME, _TWICE, _SURE = 0.5, 2.0, 0.25  # of what is there now, that was there before: at least, at most; its standard deviation
_LIKE = 0.3  # the same in any shape, from which it may have been there
_CHANCE = 2.0  # of these deviations, below which nobody knows
_NOTHING = 1e-3  # of the length of columns: what is left of them is rounding


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
        """What was there with the other sign is no such thing: it has changed all the more. Nor where the reference logs do not
        tell: noise has a size as well."""
        like = np.sqrt(max(self.whole**2 - self.std**2, 0.0))
        return bool(like > _LIKE and self.whole > _CHANCE * self.std and self.same > -_SAME)


def share_before(columns: Array, data: Data, later: npt.NDArray[np.bool_], others: Array, weight: Array) -> Share:
    """Of a cause's amplitudes in one system, each with its own before and after.

    A cause that stands already, in this shape, has its share in `others`: of what is new the reference logs have nothing.

    Args:
        columns: (k, rows) of the cause.
        data: rows of the reference logs, then of the later ones; `later` says which.
        others: (n, rows) columns of all else that the model has.
        weight: (joints,) [1/(N m)].
    """
    count = len(columns)
    before, after = np.where(later, 0.0, columns), np.where(later, columns, 0.0)
    taken = fit_columns(data, np.concatenate([others, after]), weight=weight)
    if np.linalg.norm(taken.project(before)) <= _NOTHING * np.linalg.norm(before * taken.weights):
        return Share(0.0, 0.0, 0.0 if before.any() else np.inf)
    fit = fit_columns(data, np.concatenate([others, before, after]), weight=weight)
    own = slice(len(others), len(others) + count)
    was, now = fit.beta[own], fit.beta[own.stop:]
    seen = fit_columns(data, others, weight=weight).project(after)
    gram = seen @ seen.T
    there = max(float(now @ gram @ now), 1e-300)
    spread = float(np.trace(gram @ covariance(fit.table * fit.weights, fit.residual)[own, own]))
    whole, std = (float(np.sqrt(max(x, 0.0) / there)) for x in (float(was @ gram @ was), spread))
    return Share(float(was @ gram @ now) / there, whole, std)
