"""Equations of a motion that repeats, turned so that what repeats stands in a few of them and noise alone in the others.

    for block in Contrasted(logs, cycles): ...      noise CONTRAST: between periods; of_mean(M): √M their mean; or as it was

An error of the model is the same in each of M periods, r_k(p) = e(p) + n_k(p) at phase p of period k: it is no independent
error each time, and equations of one phase are a cluster (Liang & Zeger 1986, Biometrika 73, p. 13; Arellano 1987, Oxf. Bull.
Econ. Stat. 49, p. 431). An orthogonal turn over the periods of a phase, of Helmert 1876,

    √M r̄(p) = √M e(p) + noise,    √(k/(k+1)) (r_k - mean of r_0 … r_{k-1})(p) = noise        k = 1 … M - 1

leaves the estimate as it is, white noise white and of the same strength, and both parts independent of each other. So each has
a spectrum of its own, as an analysis of variance has a mean square between phases and one within: where nothing but noise is
left both agree, and M periods are worth M; where the model lacks something they are worth one. Means of another number of
periods, or of none, have another: √M e is as strong as M is great. Periods need not be alike: what a motion does differently
each time is in the columns of the contrasts.

The limit: noise that is not white runs on from the end of a period into the next, and so from a contrast to the mean and to the
contrast after it. Taken for independent they tell too little where noise remembers long beside a period and columns jump from
its end to its beginning: standard deviations 1.4 times too small at a twenty-fifth of one of 8 periods, 2 times at a tenth of
one of 20. `Robust.at_least` sets that right by what the periods tell in the order of time. An error that repeats, remembers as
long and meets such jumps stays that much beyond what is told: one short period says little of its own spectrum.

Memory: one period of columns and its transform, however many there are; so it grows with the period, not with the log.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter

import numpy as np

from pipelines.fit.equations import Array, Block, Flags, Indices

__all__ = ["CONTRAST", "MEAN", "Contrasted", "Cycle", "of_mean"]

CONTRAST, MEAN = 1, 2  # of `Block.noise`, whose 0 is that of equations which repeat nothing; from MEAN on, that of means


def of_mean(periods: float) -> int:
    """The noise of √M times the mean of so many periods M."""
    return MEAN + round(periods)


@dataclass(frozen=True, eq=False)
class Cycle:
    """Where equations lie in the period of their motion."""

    phase: Indices  # (samples,) 0 .. count - 1, rising within a period
    count: int  # of phases


@dataclass(frozen=True, eq=False)
class Contrasted:
    """The equations of several logs, turned where they repeat; iterate as often as the equations allow."""

    numbered: Callable[[], Iterable[tuple[int, Block]]]  # blocks, alike in their columns, with the place of their log
    cycles: Sequence[Cycle | None]  # of each log; None: it repeats nothing

    def __iter__(self) -> Iterator[Block]:
        for place, pairs in groupby(self.numbered(), itemgetter(0)):
            cycle, blocks = self.cycles[place], (block for _, block in pairs)
            yield from blocks if cycle is None else _contrasted(blocks, cycle)

    def longest(self, block: int) -> int:
        """Samples of the longest block, where that of the equations as they come has `block`."""
        return max(block if cycle is None else cycle.count for cycle in self.cycles)


def _contrasted(blocks: Iterable[Block], cycle: Cycle) -> Iterator[Block]:
    """The contrasts of each period to those before it, then the mean. Memory: one period."""
    mean, done = None, 0
    for block in blocks:
        phase = cycle.phase[done:done + block.samples]
        done += block.samples
        for part in _rising(phase):
            mean = _Sum(block, cycle.count) if mean is None else mean
            yield from mean.add(block, part, phase[part])
    if mean is not None:
        yield mean.mean()


def _rising(phase: Indices) -> Iterator[slice]:
    """Stretches in which no phase comes twice."""
    cuts = np.flatnonzero(np.diff(phase) <= 0) + 1
    for first, last in zip([0, *cuts.tolist()], [*cuts.tolist(), len(phase)], strict=True):
        yield slice(first, last)


class _Sum:
    """Of every phase the sum of its equations so far, and of how many; a channel's equation that is left out counts for none."""

    def __init__(self, like: Block, phases: int) -> None:
        self.like = like
        self.sums = [np.zeros((len(index) + 1, phases)) for index in like.columns]  # columns of a channel, and y
        self.seen = np.zeros((like.channels, phases))

    def add(self, block: Block, part: slice, phase: Indices) -> Iterator[Block]:
        """The contrast of one period to those before it, where there are any."""
        rows, used = [], []
        for j, (sums, seen) in enumerate(zip(self.sums, self.seen, strict=True)):
            one = np.vstack([block.values[j][:, part], block.y[j][part]])
            there = np.ones(len(phase), dtype=bool) if block.used is None else block.used[j][part]
            n, both = seen[phase], there & (seen[phase] > 0.0)
            # √(n/(n+1)) (x - Σ/n)
            rows.append(np.where(both, (n * one - sums[:, phase]) / np.sqrt(np.maximum(n, 1.0) * (n + 1.0)), 0.0))
            used.append(both)
            sums[:, phase] += np.where(there, one, 0.0)
            seen[phase] += there
        if np.any(used):
            yield self._block(rows, np.array(used), CONTRAST)

    def mean(self) -> Block:
        """√n times the mean of the n equations of each phase."""
        rows = [sums / np.sqrt(np.maximum(seen, 1.0)) for sums, seen in zip(self.sums, self.seen, strict=True)]
        return self._block(rows, self.seen > 0.0, of_mean(float(np.mean(self.seen[self.seen > 0.0]))))

    def _block(self, rows: list[Array], used: Flags, noise: int) -> Block:
        keep = np.flatnonzero(used.any(axis=0))
        return Block(self.like.width, self.like.columns, tuple(np.ascontiguousarray(row[:-1, keep]) for row in rows),
                     tuple(row[-1, keep] for row in rows), None if used.all() else tuple(used[:, keep]), noise)
