"""Test differences: of held-out errors by blocks drawn again, of numbers by their deviations.

    low, high = apart(ours, theirs, power, rng)       95 % of  error of theirs - error of ours
    by_flips(gains)                                   how likely chance alone gains as much
    chi2_bound, upper_point                           what chance exceeds rarely
    wald(numbers, covariance, alpha)                  whether numbers differ from none: above 1
    standardised(a, b, std_a, std_b), limit_of(n)     whether two estimates of a number differ

Efron 1979; blocks of consecutive samples, whose residuals depend on one another, stay whole (Künsch
1989). Both errors are of the same blocks in every draw, so that what is hard for both falls out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist

import numpy as np

from pipelines.io.log import Array

_DRAWS = 4000  # numerics: with replacement
_NORMAL = 1.96  # numerics: standard deviations of 95 %
_EVERY = 12  # numerics: gains up to which every choice of signs is looked at
_FLIPS = 8191  # numerics: choices of signs drawn of more
_SEED = 20040509  # numerics
_ROUNDING = 1e-9  # numerics


def apart(
    ours: Array, theirs: Array, power: Array, rng: np.random.Generator
) -> tuple[float, float]:
    """Return where the difference of √(Σ rss / Σ power), theirs less ours, lies with 95 %.

    Percentiles of the draws, their distance from the difference itself widened by
    t_{B-1} √(B / (B - 1)) / 1.96, for the draws of B blocks scatter less than B new blocks would
    (Hesterberg 2015, Section 4.5). Over 1500 draws of blocks whose noise differs by up to four
    times, ten blocks held 93-94 % of true differences, twenty 93-95 %.

    Args:
        ours, theirs: (blocks,) Σ (y - A β)² of each block.
        power: (blocks,) Σ y².
    """
    blocks = len(power)
    drawn = rng.multinomial(blocks, np.full(blocks, 1.0 / blocks), size=_DRAWS).astype(np.float64)
    whole = drawn @ power
    known = whole > 0.0
    if blocks < 2 or not known.any():
        return -np.inf, np.inf
    differences = (np.sqrt(drawn @ theirs) - np.sqrt(drawn @ ours))[known] / np.sqrt(whole[known])
    middle = float((np.sqrt(theirs.sum()) - np.sqrt(ours.sum())) / np.sqrt(power.sum()))
    # t of 97.5 %: z + (z³ + z)/4n + (5z⁵ + 16z³ + 3z)/96n², Abramowitz & Stegun 1964, 26.7.5
    z, n = _NORMAL, blocks - 1.0
    student = z + (z**3 + z) / (4.0 * n) + (5.0 * z**5 + 16.0 * z**3 + 3.0 * z) / (96.0 * n**2)
    wider = student * np.sqrt(blocks / n) / _NORMAL
    low, high = np.quantile(differences, (0.025, 0.975)) - middle
    return middle + wider * float(low), middle + wider * float(high)


def by_flips(gains: Array) -> float:
    """Return the share of draws of signs whose sum is as large as that of the gains; 1 of none.

    What gains nothing gains and loses alike, whatever the size of each: given their sizes, every
    choice of signs is equally likely (Fisher 1935, The Design of Experiments, Section 21; Pitman
    1937). No two gains need to scatter alike, and no law is assumed. What costs a little where it
    is not there, a number fitted to noise say, is chance less often than the share.

    Args:
        gains: (blocks,) of independent parts, what was taken off the squared error of each.
    """
    size = np.abs(gains[gains != 0.0])
    whole = float(gains.sum())
    if not whole > 0.0:  # nor of what is no number
        return 1.0
    least = whole - _ROUNDING * float(size.sum())
    if len(size) <= _EVERY:
        signs = 1.0 - 2.0 * ((np.arange(2 ** len(size))[:, None] >> np.arange(len(size))) & 1)
        return float(np.mean(signs @ size >= least))
    signs = np.random.default_rng(_SEED).choice((-1.0, 1.0), size=(_FLIPS, len(size)))
    return float((1 + np.count_nonzero(signs @ size >= least)) / (1 + _FLIPS))


def chi2_bound(alpha: float, freedom: int) -> float:
    """Return the value that χ² of as many degrees of freedom exceeds with probability `alpha`."""
    from scipy.special import chdtri

    return float(chdtri(max(freedom, 1), alpha))


def upper_point(values: Sequence[float], alpha: float) -> float:
    """Return the upper `alpha` point of a Gumbel law fitted to maxima by its moments."""
    x = np.asarray(values)
    spread = float(x.std(ddof=1)) if len(x) > 1 else 0.0
    scale = max(spread * np.sqrt(6.0) / np.pi, 1e-12)
    return float(x.mean() - np.euler_gamma * scale - scale * np.log(-np.log1p(-alpha)))


def wald(numbers: Array, covariance: Array, alpha: float) -> float:
    """Return aᵀ C⁻¹ a of numbers a over its χ² bound, which numbers of none exceed with probability
    `alpha` (Wald 1943).

    Args:
        numbers: a (k,).
        covariance: C (k, k); numbers of variance 0 are not known, and count for nothing.
    """
    known = np.flatnonzero(np.diag(covariance) > 0.0)
    a, inverse = numbers[known], np.linalg.pinv(covariance[np.ix_(known, known)], hermitian=True)
    return float(a @ inverse @ a) / chi2_bound(alpha, max(len(a), 1))


def difference(a: float, b: float, period: float | None = None) -> float:
    """Return b - a; of numbers that are the same again after a `period`, the shorter way around."""
    if period is None or not math.isfinite(b - a):
        return b - a
    return math.remainder(b - a, period)


def standardised(
    a: float, b: float, std_a: float, std_b: float, period: float | None = None
) -> float:
    """Return z = (b - a) / √(σa² + σb²), standard normal where nothing differs; NaN of no σ."""
    std = math.hypot(std_a, std_b)
    return difference(a, b, period) / std if std > 0.0 else math.nan


def limit_of(count: int, alpha: float = 0.01) -> float:
    """Return what the largest |z| of `count` numbers exceeds with probability `alpha` at most.

    Φ⁻¹(1 - α/(2n)) (Bonferroni; Miller, Simultaneous Statistical Inference, 1981, p. 8).
    """
    return NormalDist().inv_cdf(1.0 - alpha / (2 * max(count, 1)))
