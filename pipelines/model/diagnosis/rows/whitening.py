"""Rows whose noise is white: what neighbouring rows share of it is taken out of torque and columns alike.

    whitening = Whitening.of(data, residuals)       from what a model leaves of an arm in order
    whitening.through(x, joints, stretches)         (channels, rows) as much as the rows before do not tell; stretches of each joint

A drive's zero wanders slowly, and a low-pass makes neighbours of rows alike: what is left of an arm in order has a colour. Where
noise is slow and a cause quick, least squares of such rows weigh most what tells least. With a the best prediction of a row's noise
by the p rows before it (`signal.prediction`), every signal x is replaced by x_i - Σ_k a_k x_{i-k}, and least squares of that are
generalised ones (Aitken 1935). The noise of a joint keeps its size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pipelines.log.experiment import Array
from pipelines.signal.prediction import prediction_errors, prediction_weights

if TYPE_CHECKING:
    from pipelines.model.diagnosis.rows.data import Data

__all__ = ["Whitening"]

_ORDER = 20  # rows: as far as the noise of the low-pass reaches, and a fifth of a second of what is slower
_RIDGE = 1e-4  # of the noise's power: what the low-pass keeps back is not to be brought back by more


@dataclass(frozen=True, eq=False)
class Whitening:
    """Of each joint."""

    weights: Array  # (joints, order + 1, order + 1) of a row and of those before it, predicted by no row, by one, …

    @classmethod
    def of(cls, data: Data, residuals: Array) -> Whitening:
        """From `residuals` (m, rows) [N m], by the mean autocovariance over the stretches of each joint."""
        products = np.zeros((data.n_joints, _ORDER + 1))
        rows = np.zeros(data.n_joints)
        first = 0
        for one in data.logs:
            for joint in range(one.n_joints):
                for stretch in one.stretches[joint]:
                    if not one.weighed[joint, stretch.start]:
                        continue
                    x = residuals[:, first + stretch.start:first + stretch.stop]
                    rows[joint] += x.size
                    for lag in range(min(_ORDER + 1, x.shape[1])):
                        products[joint, lag] += np.sum(x[:, lag:] * x[:, :x.shape[1] - lag])
                first += one.rows
        means = products / np.maximum(rows, 1.0)[:, None]
        return cls(np.array([prediction_weights(own, _RIDGE) for own in means]))

    def through(self, x: Array, joints: Sequence[int] | npt.NDArray[np.intp], stretches: Sequence[Sequence[slice]]) -> Array:
        """(channels, rows) of `x`, each channel a torque of one of the `joints` (channels,); every one of the `stretches` of its
        joint for itself."""
        out = np.empty_like(x)
        which = np.asarray(joints)
        for joint in np.unique(which):
            own = np.flatnonzero(which == joint)
            for stretch in stretches[joint]:
                out[own, stretch] = prediction_errors(self.weights[joint], x[own, stretch])
        return out
