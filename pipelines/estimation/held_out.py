"""Compute held-out errors of contiguous blocks of the fitted logs, held out once each.

One pass, memory constant in the number of samples: every part of the time leaves one small matrix,
and the statistics of any rest are sums of those.

A low-pass, and the smoother before it, spread one sample's noise over its neighbours. Equations
next to a block that is held out share its noise, and parameters fitted to them would be judged by
what they have seen (Burman, Chow & Nolan 1994). They are left out while that block is judged.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import reduce
from itertools import accumulate, pairwise
from operator import add
from typing import Any

import numpy as np

from pipelines.estimation.least_squares import (
    Block,
    Errors,
    Indices,
    Statistics,
    gather,
    solve,
    triangulate,
)

_ASIDE = 8  # numerics: of the shortest logs an eighth is left out at most


def by_blocks(
    equations: Iterable[Block],
    samples: int,
    blocks: int,
    guard: int,
    *,
    triangles: bool = False,
    weighted: bool = True,
) -> Errors:
    """Hold contiguous blocks out once each: every one explained by parameters of the rest.

    Args:
        samples: of all equations.
        guard: equations on either side of a block that have no part in its parameters.
        triangles: by QR, as a fit of bad condition is.
        weighted: joints by their own residual; all alike without.
    """
    edges = np.linspace(0, samples, min(blocks, samples) + 1).astype(np.intp)
    guard = min(guard, samples // _ASIDE)
    cuts = np.concatenate([edges - guard, edges, edges + guard])
    cuts = np.unique(np.clip(cuts, 0, samples))
    parts = _parts(equations, cuts, triangulate if triangles else gather)
    at = {int(cut): k for k, cut in enumerate(cuts)}
    before = [None, *accumulate(parts, add)]
    after = [None, *accumulate(parts[::-1], add)][::-1]
    rss, power = [], []
    for first, last in pairwise(edges.tolist()):
        held = reduce(add, parts[at[first] : at[last]])
        sides = before[at[max(0, first - guard)]], after[at[min(samples, last + guard)]]
        rest = reduce(add, [side for side in sides if side is not None])
        weights = None if weighted else np.ones(len(rest.power))
        rss.append(held.rss(solve(rest, weights=weights).beta))
        power.append(held.power)
    totals = np.sum(rss, axis=0), np.sum(power, axis=0)
    return Errors.of(*totals, reduce(add, parts).counts, samples)


def _parts(
    equations: Iterable[Block], cuts: Indices, gathered: Callable[[list[Block]], Statistics]
) -> list[Any]:
    """Return the statistics between every two cuts, counted in equations from the first on."""
    found: dict[int, Any] = {}
    done = 0
    for block in equations:
        inside = cuts[(cuts > done) & (cuts < done + block.samples)] - done
        for first, last in pairwise([0, *inside.tolist(), block.samples]):
            place = int(np.searchsorted(cuts, done + first, side="right")) - 1
            part = gathered([block.part(slice(first, last))])
            found[place] = found[place] + part if place in found else part
        done += block.samples
    return [found[place] for place in range(len(cuts) - 1)]
