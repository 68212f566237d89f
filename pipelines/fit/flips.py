"""How likely chance alone gains as much: the same gains with signs drawn at random.

    by_flips(gains)         share of sign draws whose sum is as large as that of the gains

What gains nothing gains and loses alike, whatever the size of each: given their sizes, every choice of signs is equally likely
(Fisher 1935, The Design of Experiments, Section 21; Pitman 1937). No two gains need to scatter alike, and no law is assumed. What
costs a little where it is not there, a number fitted to noise say, is chance less often than is said.
"""

from __future__ import annotations

import numpy as np

from pipelines.fit.equations import Array

__all__ = ["by_flips"]

_ALL = 12  # gains up to which every choice of signs is looked at
_DRAWS = 8191
_SEED = 20040509
_ROUNDING = 1e-9


def by_flips(gains: Array) -> float:
    """Between 0 and 1; 1 where nothing was gained.

    Args:
        gains: (blocks,) of independent parts, what was taken off the squared error of each.
    """
    size = np.abs(gains[gains != 0.0])
    whole = float(gains.sum())
    if not whole > 0.0:  # nor of what is no number
        return 1.0
    least = whole - _ROUNDING * float(size.sum())
    if len(size) <= _ALL:
        signs = 1.0 - 2.0 * ((np.arange(2**len(size))[:, None] >> np.arange(len(size))) & 1)
        return float(np.mean(signs @ size >= least))
    signs = np.random.default_rng(_SEED).choice((-1.0, 1.0), size=(_DRAWS, len(size)))
    return float((1 + np.count_nonzero(signs @ size >= least)) / (1 + _DRAWS))
