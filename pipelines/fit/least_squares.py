"""Weighted least squares over a stream of equations, memory constant in the number of samples.

    fitted = fit(equations)                     equations: anything that can be iterated over more than once
    fitted.solution.beta, .covariance
    errors(held_out_statistics, beta)           how the same numbers do on other samples, without the samples

Kostić et al. 2004, eq. (12)-(15), with every channel weighted by its own residual. Normal equations with unit columns;
where their condition number exceeds 1e4 the stream is read again into triangular factors, which lose half as many digits.
The covariance of a motion that repeats needs more: a period at once (`contrasts.py`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from pipelines.fit.equations import Array, Block, Indices
from pipelines.fit.statistics import Gram, Statistics, gather, triangulate

__all__ = ["Errors", "Fit", "Solution", "errors", "fit", "solve"]

_CONDITION = 1e4  # above it normal equations leave fewer than eight digits
_ROUNDS = 20
_SETTLED = 1e-6  # relative change of the weights: a thousandth of what noise leaves uncertain in them
_LOST = 1e-6  # a share of a lost direction that is not rounding itself
_LEAST_SIGMA = 1e-6  # of the signal: below it a residual is rounding, and says nothing of its channel's worth


@dataclass(frozen=True, eq=False)
class Errors:
    """How parameters explain samples, per channel and in all."""

    rms: Array  # (channels,) root mean square of y - A β
    signal_rms: Array  # (channels,) of y
    relative_error: float  # ‖y - A β‖ / ‖y‖ over all channels
    counts: Indices  # (channels,) equations
    samples: int


@dataclass(frozen=True, eq=False)
class Solution:
    """Parameters with what is known of their uncertainty, as far as white noise goes."""

    beta: Array  # (k,)
    covariance: Array  # (k, k), as if the residual were white and channels independent; infinite where not determined
    bread: Array  # (k, k) (Σ w_j A_jᵀ A_j)⁻¹ over what is determined
    weights: Array  # (channels,)
    sigma: Array  # (channels,) standard deviation of the residual, parameters allowed for
    freedom: Array  # (channels,) samples less the share of the parameters that the channel determines
    errors: Errors
    scale: Array  # (k,) length of each weighted column; the following are of columns of unit length
    singular_values: Array  # (k,)
    directions: Array  # (k, k) right singular vectors, one a row
    rank: int  # as far as rounding allows to see; `identifiability` asks what noise allows
    determined: npt.NDArray[np.bool_]  # (k,) whether a parameter is outside every direction that is lost to rounding
    acting: npt.NDArray[np.bool_]  # (k,) whether any sample shows the parameter at all
    method: Literal["normal equations", "QR"]

    @property
    def std(self) -> Array:
        return np.sqrt(np.diag(self.covariance))

    @property
    def condition(self) -> float:
        """Of the weighted equations with unit columns."""
        least = float(self.singular_values[-1])
        return float(self.singular_values[0]) / least if self.rank == len(self.beta) else float("inf")


@dataclass(frozen=True, eq=False)
class Fit:
    statistics: Statistics
    solution: Solution


def fit(equations: Iterable[Block], *, weights: Array | None = None, gram: Gram | None = None) -> Fit:
    """Fit `equations`, which are iterated over again where the condition asks for QR.

    Args:
        equations: blocks; a list, or an object whose `__iter__` makes them anew.
        weights: of the channels; their own residuals decide where there are none.
        gram: what `gather` made of the same equations, where it has been done already.
    """
    normal = gather(equations) if gram is None else gram
    solution = solve(normal, weights=weights)
    seen = solution.singular_values[solution.singular_values > 0.0]
    if solution.rank == len(solution.beta) and seen[0] <= _CONDITION * seen[-1]:
        return Fit(normal, solution)
    triangles = triangulate(equations)
    return Fit(triangles, solve(triangles, weights=weights))


def solve(statistics: Statistics, *, weights: Array | None = None) -> Solution:
    """Solve for β; without `weights` each channel is weighted by 1/σ_j² of its own residual, iterated until it settles.

    Iteratively reweighted least squares over channels (Aitken 1935, with the weights estimated): the maximum-likelihood
    estimate where channels have independent white noise of unknown strength. No sample is read.
    """
    information, rounds = statistics.information(), 0
    w = _weights(statistics, np.sqrt(statistics.power / _some(statistics.counts))) if weights is None else weights
    while True:
        seen = statistics.spectrum(w)
        keep = seen.singular_values > statistics.floor * np.sqrt(len(seen.scale))
        inverse = seen.directions[keep] / seen.singular_values[keep, None] / seen.scale
        beta, bread = seen.projections[keep] @ inverse, inverse.T @ inverse
        freedom = np.maximum(statistics.counts - w * np.einsum("jab,ab->j", information, bread), 1.0)
        sigma = np.sqrt(statistics.rss(beta) / freedom)
        better = _weights(statistics, sigma)
        rounds += 1
        if weights is not None or rounds == _ROUNDS or bool(np.all(np.abs(better - w) <= _SETTLED * w)):
            break
        w = better
    determined = ~np.any(np.abs(seen.directions[~keep]) > _LOST, axis=0)
    covariance = bread @ np.tensordot(np.square(w * sigma), information, 1) @ bread
    covariance[~determined] = covariance[:, ~determined] = np.inf
    return Solution(beta, covariance, bread, w, sigma, freedom, errors(statistics, beta), seen.scale, seen.singular_values,
                    seen.directions, int(keep.sum()), determined, np.einsum("jkk->k", information) > 0.0,
                    "normal equations" if isinstance(statistics, Gram) else "QR")


def errors(statistics: Statistics, beta: Array) -> Errors:
    """How well β explains the samples behind `statistics`, which need not be those that it was fitted to."""
    rss, power, counts = statistics.rss(beta), statistics.power, _some(statistics.counts)
    total = float(power.sum())
    return Errors(np.sqrt(rss / counts), np.sqrt(power / counts), float(np.sqrt(rss.sum() / total)) if total > 0.0 else 0.0,
                  statistics.counts, statistics.samples)


def _some(counts: Indices) -> Indices:
    """A channel without equations has no power either: 0 / 1."""
    return np.maximum(counts, 1)


def _weights(statistics: Statistics, sigma: Array) -> Array:
    """1/σ², but no channel better than rounding."""
    least = _LEAST_SIGMA * np.sqrt(statistics.power / _some(statistics.counts))
    known = np.maximum(sigma, least)
    return 1.0 / np.square(np.where(known > 0.0, known, 1.0))
