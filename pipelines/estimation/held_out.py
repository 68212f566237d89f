"""Compute held-out errors by stretches of time: of other logs, or of the fitted ones in turn.

    by_blocks(equations, samples, ...)      contiguous blocks held out once each
    by_stretches(equations, samples, ...)   given parameters, judged stretch by stretch

One pass, memory constant in the number of samples: every part of the time leaves one small matrix,
and the statistics of any rest are sums of those.

A low-pass, and the smoother before it, spread one sample's noise over its neighbours. Equations
next to a block that is held out share its noise, and parameters fitted to them would be judged by
what they have seen (Burman, Chow & Nolan 1994). They are left out while that block is judged.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
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
from pipelines.io.log import Array

_ASIDE = 8  # numerics: of the shortest logs an eighth is left out at most


@dataclass(frozen=True, eq=False)
class Stretches:
    """What is left of the torque in each stretch of time, and what there was."""

    rss: Array  # (stretches, channels) Σ (y - A β)²
    power: Array  # (stretches, channels) Σ y²
    counts: Indices  # (channels,) equations
    samples: int

    @property
    def errors(self) -> Errors:
        rss, power = self.rss.sum(axis=0), self.power.sum(axis=0)
        return Errors.of(rss, power, self.counts, self.samples)


def by_blocks(
    equations: Iterable[Block],
    samples: int,
    blocks: int,
    guard: int,
    *,
    triangles: bool = False,
    weighted: bool = True,
) -> Stretches:
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
    return Stretches(np.array(rss), np.array(power), reduce(add, parts).counts, samples)


def by_stretches(
    equations: Iterable[Block], samples: int, stretches: int, beta: Array
) -> Stretches:
    """Return how β explains each of so many stretches of equal length."""
    cuts = np.linspace(0, samples, min(stretches, samples) + 1).astype(np.intp)
    parts = _parts(equations, cuts, gather)
    rss, power = [part.rss(beta) for part in parts], [part.power for part in parts]
    return Stretches(np.array(rss), np.array(power), reduce(add, parts).counts, samples)


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
