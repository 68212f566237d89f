"""Linear equations y = A β that arrive in blocks, each output channel with the columns that act on it.

    Block.of(Y, y)      from a dense array; what is zero in the whole block is left out
    Block(...)          directly, from whoever knows which columns act where

A block is a stretch of consecutive samples. Noise is taken to be stationary in each channel, and stretches to be
independent of each other, so a block should be long against the memory of the noise.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["Array", "Block", "Flags", "Indices", "rows_of", "split"]

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Block:
    """Equations of consecutive samples. Working memory may be shared: what is to be kept must be copied."""

    width: int  # parameters in all
    columns: tuple[Indices, ...]  # of each channel, (k_j,): the parameters that act on it, increasing or not
    values: tuple[Array, ...]  # of each channel, (k_j, samples): their columns, samples fastest
    y: tuple[Array, ...]  # of each channel, (samples,)
    used: tuple[Flags, ...] | None = None  # of each channel (samples,): equations left out are zero throughout; None: all count
    noise: int = 0  # blocks with the same number have noise of the same spectrum

    @property
    def channels(self) -> int:
        return len(self.y)

    @property
    def samples(self) -> int:
        return len(self.y[0])

    @property
    def counts(self) -> Indices:
        """(channels,) equations that count."""
        if self.used is None:
            return np.full(self.channels, self.samples)
        return np.array([np.count_nonzero(used) for used in self.used])

    @classmethod
    def of(cls, Y: Array, y: Array, acting: npt.NDArray[np.bool_] | None = None) -> Block:
        """From Y (samples, channels, parameters) and y (samples, channels).

        Views where they do; quickest where Y is stored with samples fastest. `acting` (channels, parameters) says which
        columns can act at all; without it those that are zero throughout the block are left out.
        """
        seen = np.asarray(Y.any(axis=0)) if acting is None else acting
        columns = tuple(np.flatnonzero(row) for row in seen)
        by_channel = Y.transpose(1, 2, 0)
        return cls(Y.shape[2], columns, tuple(rows_of(by_channel[j], index) for j, index in enumerate(columns)), tuple(y.T))

    def residual(self, beta: Array) -> Array:
        """y - A β (channels, samples)."""
        return np.array([y - beta[index] @ values
                         for index, values, y in zip(self.columns, self.values, self.y, strict=True)])


def rows_of(table: Array, index: Indices) -> Array:
    """table[index], as a view where the index is a run."""
    if len(index) and index[-1] - index[0] == len(index) - 1 and bool(np.all(np.diff(index) == 1)):
        return table[index[0]:index[-1] + 1]
    return table[index]


def split(equations: Iterable[Block], samples: int) -> Iterator[Block]:
    """The same equations in blocks of at most this many samples."""
    for block in equations:
        for first in range(0, block.samples, samples):
            part = slice(first, first + samples)
            yield Block(block.width, block.columns, tuple(v[:, part] for v in block.values),
                        tuple(y[part] for y in block.y), block.used and tuple(used[part] for used in block.used), block.noise)
