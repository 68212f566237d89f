"""Rows whose noise is white: what neighbouring rows share of it is taken out of torque and columns alike.

    whitening = Whitening.of(data, residuals)       from what a model leaves of an arm in order
    whitening.through(x, joints, stretches)         (channels, rows) as much as the rows before do not tell

A drive's zero wanders slowly, and a low-pass makes neighbours of rows alike: what is left of an arm in order has a colour. Where
noise is slow and a cause quick, least squares of such rows weigh most what tells least. With a the best prediction of a row's noise
by the p rows before it, every signal x is replaced by

    x_i - Σ_k a_k x_{i-k},    a from the noise's autocovariance (Yule 1927, Walker 1931; Durbin 1960 for the first p rows)

and least squares of that are generalised ones (Aitken 1935). The noise of a joint keeps its size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from pipelines.log.experiment import Array

if TYPE_CHECKING:
    from pipelines.model.diagnosis.data import Data

__all__ = ["Whitening"]

_ORDER = 20  # rows: as far as the noise of the low-pass reaches, and a fifth of a second of what is slower
_RIDGE = 1e-4  # of the noise's power: what the low-pass keeps back is not to be brought back by more


@dataclass(frozen=True, eq=False)
class Whitening:
    """Of each joint."""

    errors: Array  # (joints, order + 1, order + 1) of the prediction by no row, by one, …: weights of a row and of those before it

    @classmethod
    def of(cls, data: Data, residuals: Array) -> Whitening:
        """From `residuals` (m, rows) [N m], by the mean autocovariance over the stretches of each joint."""
        products = np.zeros((data.n_joints, _ORDER + 1))
        rows = np.zeros(data.n_joints)
        first = 0
        for one in data.logs:
            for joint in range(one.n_joints):
                for stretch in one.stretches:
                    x = residuals[:, first + stretch.start:first + stretch.stop]
                    rows[joint] += x.size
                    for lag in range(min(_ORDER + 1, x.shape[1])):
                        products[joint, lag] += np.sum(x[:, lag:] * x[:, :x.shape[1] - lag])
                first += one.rows
        return cls(np.array([_errors(own / max(count, 1.0)) for own, count in zip(products, rows, strict=True)]))

    def through(self, x: Array, joints: Sequence[int] | npt.NDArray[np.intp], stretches: Sequence[slice]) -> Array:
        """(channels, rows) of `x`, each channel a torque of one of the `joints` (channels,); every stretch for itself."""
        out = np.empty_like(x)
        which = np.asarray(joints)
        for joint in np.unique(which):
            own, errors = np.flatnonzero(which == joint), self.errors[joint]
            for stretch in stretches:
                some = x[own, stretch]
                done = lfilter(errors[-1], [1.0], some, axis=1)
                for row in range(min(_ORDER, some.shape[1])):
                    done[:, row] = some[:, row::-1] @ errors[row, :row + 1]
                out[own, stretch] = done
        return out


def _errors(covariance: Array) -> Array:
    """(order + 1, order + 1) from the autocovariance (order + 1,), scaled so that noise keeps its size."""
    out = np.zeros((len(covariance), len(covariance)))
    power = covariance[0]
    if power <= 0.0:
        out[:, 0] = 1.0
        return out
    r = covariance / power
    r[0] += _RIDGE
    for order in range(len(r)):
        a = solve_toeplitz(r[:order], r[1:order + 1]) if order else np.zeros(0)
        left = r[0] - a @ r[1:order + 1]
        out[order, :order + 1] = np.concatenate([[1.0], -a]) / np.sqrt(max(left, _RIDGE))
    return out
