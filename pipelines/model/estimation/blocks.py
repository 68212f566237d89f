"""Held-out error by stretches of time: of other logs, or of the fitted ones, each stretch explained by the rest.

    by_blocks(equations, samples, ...)      contiguous blocks held out once each
    by_stretches(equations, samples, ...)   given parameters, judged stretch by stretch

One pass, memory constant in the number of samples: every part of the time leaves one small matrix, and the statistics of
any rest are sums of those.

A low-pass, and the smoother before it, spread one sample's noise over its neighbours. Equations next to a block that is
held out share its noise, and parameters fitted to them would be judged by what they have seen (Burman, Chow & Nolan 1994).
They stand aside while that block is judged.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import TypeVar

import numpy as np

from pipelines.fit.equations import Array, Block, Indices
from pipelines.fit.least_squares import Errors, solve
from pipelines.fit.statistics import Gram, Triangles, gather, triangulate

S = TypeVar("S", Gram, Triangles)

__all__ = ["Stretches", "by_blocks", "by_stretches"]

_MOST_ASIDE = 8  # of the shortest logs an eighth at most stands aside, so that something is left to fit


@dataclass(frozen=True, eq=False)
class Stretches:
    """What is left of the torque in each stretch of time, and what there was."""

    rss: Array  # (stretches, channels) Σ (y - A β)²
    power: Array  # (stretches, channels) Σ y²
    counts: Indices  # (channels,) equations
    samples: int

    @property
    def errors(self) -> Errors:
        rss, power, counts = self.rss.sum(axis=0), self.power.sum(axis=0), np.maximum(self.counts, 1)
        total = float(power.sum())
        return Errors(np.sqrt(rss / counts), np.sqrt(power / counts), float(np.sqrt(rss.sum() / total)) if total > 0.0 else 0.0,
                      self.counts, self.samples)


def by_blocks(equations: Iterable[Block], samples: int, blocks: int, guard: int, *, triangles: bool = False,
              weighted: bool = True) -> Stretches:
    """Contiguous blocks held out once each: every one explained by parameters, and joints weighted, as the rest has it.

    Args:
        samples: of all equations.
        guard: equations on either side of a block that have no part in its parameters.
        triangles: by QR, as a fit of bad condition is.
        weighted: joints by their own residual; all alike without.
    """
    edges, guard = np.linspace(0, samples, min(blocks, samples) + 1).astype(np.intp), min(guard, samples // _MOST_ASIDE)
    cuts = np.unique(np.clip(np.concatenate([edges - guard, edges, edges + guard]), 0, samples))
    if triangles:
        return _held_out(_parts(equations, cuts, triangulate), cuts, edges, guard, weighted)
    return _held_out(_parts(equations, cuts, gather), cuts, edges, guard, weighted)


def _held_out(parts: list[S], cuts: Indices, edges: Indices, guard: int, weighted: bool) -> Stretches:
    samples, at = int(edges[-1]), {int(cut): k for k, cut in enumerate(cuts)}
    before = [None, *accumulate(parts, _both)]
    after = [None, *accumulate(parts[::-1], _both)][::-1]
    rss, power = [], []
    for first, last in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        held = _sum(parts[at[first]:at[last]])
        rest = _sum([s for s in (before[at[max(0, first - guard)]], after[at[min(samples, last + guard)]]) if s is not None])
        rss.append(held.rss(solve(rest, weights=None if weighted else np.ones(len(rest.power))).beta))
        power.append(held.power)
    return Stretches(np.array(rss), np.array(power), _sum(parts).counts, samples)


def by_stretches(equations: Iterable[Block], samples: int, stretches: int, beta: Array) -> Stretches:
    """How β explains each of so many stretches of equal length."""
    parts = _parts(equations, np.linspace(0, samples, min(stretches, samples) + 1).astype(np.intp), gather)
    return Stretches(np.array([part.rss(beta) for part in parts]), np.array([part.power for part in parts]),
                     _sum(parts).counts, samples)


def _parts(equations: Iterable[Block], cuts: Indices, gathered: Callable[[list[Block]], S]) -> list[S]:
    """The statistics between every two cuts, counted in equations from the first on."""
    found: dict[int, S] = {}
    for place, piece in _pieces(equations, cuts):
        one = gathered([piece])
        found[place] = one if place not in found else _both(found[place], one)
    return [found[place] for place in range(len(cuts) - 1)]


def _pieces(equations: Iterable[Block], cuts: Indices) -> Iterator[tuple[int, Block]]:
    """Every block cut where a cut falls into it, with the part that it belongs to."""
    done = 0
    for block in equations:
        inside = cuts[(cuts > done) & (cuts < done + block.samples)] - done
        for first, last in zip([0, *inside.tolist()], [*inside.tolist(), block.samples], strict=True):
            part = slice(first, last)
            place = int(np.searchsorted(cuts, done + first, side="right")) - 1
            yield place, Block(block.width, block.columns, tuple(v[:, part] for v in block.values),
                               tuple(y[part] for y in block.y), block.used and tuple(used[part] for used in block.used))
        done += block.samples


def _both(one: S, other: S) -> S:
    return one + other


def _sum(parts: Sequence[S]) -> S:
    """The statistics of all parts together."""
    *_, total = accumulate(parts, _both)
    return total
