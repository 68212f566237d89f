"""How estimates settle as samples come in. Kostić et al. 2004, Fig. 12.

The parts that `gather_growing` leaves are added up one after the other and solved with the weights of the whole: no
sample is read again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.fit.equations import Array
from pipelines.fit.least_squares import Solution
from pipelines.fit.statistics import Gram

__all__ = ["Convergence", "convergence"]

_FLOOR = 1e-10  # smallest eigenvalue, of unit columns, that a part of the log may have and still be solved


@dataclass(frozen=True, eq=False)
class Convergence:
    """Estimates from the first samples, ever more of them."""

    samples: tuple[int, ...]
    beta: Array  # (counts, k); not a number while the samples so far do not determine all parameters
    std: Array  # (counts, k)


def convergence(parts: Sequence[Gram], solution: Solution, inflation: Array | None = None) -> Convergence:
    """Series over the growing sums of `parts`.

    Args:
        parts: consecutive parts of one fit.
        solution: of all of them; its weights, and so its noise, hold throughout.
        inflation: (k,) what the residual's memory adds to standard deviations (`Robust.inflation`).
    """
    grams = np.cumsum(np.tensordot(solution.weights, np.stack([part.gram for part in parts]), axes=(0, 1)), axis=0)
    information, moment = grams[:, :-1, :-1], grams[:, :-1, -1]
    scale = np.sqrt(np.einsum("ikk->ik", information))
    scale = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(information / scale[:, :, None] / scale[:, None, :])
    enough = values[:, 0] > _FLOOR
    inverse = vectors / np.sqrt(np.where(enough[:, None], values, 1.0))[:, None, :] / scale[:, :, None]
    beta = np.einsum("iab,icb,ic->ia", inverse, inverse, moment, optimize=True)
    unit = np.sqrt(np.mean(solution.weights * np.square(solution.sigma)))
    std = unit * np.linalg.norm(inverse, axis=2) * (1.0 if inflation is None else inflation)
    beta[~enough], std[~enough] = np.nan, np.nan
    counts = np.cumsum([part.samples for part in parts])
    return Convergence(tuple(int(n) for n in counts), beta, std)
