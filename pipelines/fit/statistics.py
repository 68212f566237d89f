"""What a fit has to remember of its samples, whatever their number: one small matrix for each channel.

    Gram         [A y]ᵀ [A y], by adding products: fast, and loses the square of the condition number
    Triangles    R of [A y] = Q R, by QR of one block on top of the last R (TSQR; Demmel et al. 2012, section 2.2):
                 loses the condition number only

Channels stay apart, so that their weights can change without reading a sample again; two of a kind add up to that of all
samples.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from pipelines.fit.equations import Array, Block, Indices

__all__ = ["Gram", "Spectrum", "Statistics", "Triangles", "gather", "gather_growing", "triangulate"]


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The weighted equations as U S V with columns of unit length."""

    scale: Array  # (k,) length of each column; 1 where it is empty
    singular_values: Array  # (k,) falling
    directions: Array  # (k, k) V, one direction a row
    projections: Array  # (k,) Uᵀ y


@dataclass(frozen=True, eq=False)
class Gram:
    """Sums of products. The last row and column are those of y."""

    gram: Array  # (channels, k + 1, k + 1)
    counts: Indices  # (channels,) equations
    samples: int
    longest: int  # samples of the longest block
    floor: float = 3e-8  # singular values below this, of unit columns, are rounding

    @property
    def width(self) -> int:
        return int(self.gram.shape[2]) - 1

    @property
    def power(self) -> Array:
        """Σ y² of each channel."""
        return self.gram[:, -1, -1]

    def __add__(self, other: Gram) -> Gram:
        return Gram(self.gram + other.gram, self.counts + other.counts, self.samples + other.samples,
                    max(self.longest, other.longest), self.floor)

    def information(self) -> Array:
        """AᵀA of each channel (channels, k, k)."""
        return self.gram[:, :-1, :-1]

    def root(self, weights: Array) -> Array:
        """A square matrix F with FᵀF = Σ w_j [A y]ᵀ[A y]; found with unit columns, so that units do not matter."""
        total = np.tensordot(weights, self.gram, 1)
        scale = _unit(np.sqrt(np.diag(total)))
        values, vectors = np.linalg.eigh(total / scale / scale[:, None])
        return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T * scale)

    def spectrum(self, weights: Array) -> Spectrum:
        """The singular values by the eigenvalues of the products: their square roots keep half the digits."""
        total = np.tensordot(weights, self.gram, 1)
        scale = _unit(np.sqrt(np.diag(total)[:-1]))
        values, vectors = np.linalg.eigh(total[:-1, :-1] / scale / scale[:, None])
        s, v = np.sqrt(np.maximum(values[::-1], 0.0)), vectors.T[::-1]
        return Spectrum(scale, s, v, v @ (total[:-1, -1] / scale) / _unit(s))

    def rss(self, beta: Array) -> Array:
        """‖y - A β‖² of each channel; nothing below 1e-15 of its power can be told from zero."""
        v = np.append(-beta, 1.0)
        return np.asarray(np.maximum(self.gram @ v @ v, 0.0))


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangular factors. The last column is that of y."""

    factor: Array  # (channels, k + 1, k + 1)
    counts: Indices  # (channels,) equations
    samples: int
    longest: int
    floor: float = 1e-13

    @property
    def width(self) -> int:
        return int(self.factor.shape[2]) - 1

    @property
    def power(self) -> Array:
        return np.asarray(np.square(self.factor[:, :, -1]).sum(axis=1))

    def __add__(self, other: Triangles) -> Triangles:
        both = np.concatenate([self.factor, other.factor], axis=1)
        return Triangles(np.asarray(np.linalg.qr(both, mode="r")), self.counts + other.counts, self.samples + other.samples,
                         max(self.longest, other.longest))

    def information(self) -> Array:
        a = self.factor[:, :, :-1]
        return np.asarray(a.transpose(0, 2, 1) @ a)

    def root(self, weights: Array) -> Array:
        return np.asarray(np.linalg.qr((np.sqrt(weights)[:, None, None] * self.factor).reshape(-1, self.width + 1), mode="r"))

    def spectrum(self, weights: Array) -> Spectrum:
        root = self.root(weights)
        scale = _unit(np.linalg.norm(root[:, :-1], axis=0))
        u, s, v = np.linalg.svd(root[:, :-1] / scale, full_matrices=False)
        return Spectrum(scale, s, v, u.T @ root[:, -1])

    def rss(self, beta: Array) -> Array:
        return np.asarray(np.square(self.factor @ np.append(-beta, 1.0)).sum(axis=1))


Statistics = Gram | Triangles


def _unit(lengths: Array) -> Array:
    return np.where(lengths > 0.0, lengths, 1.0)


def gather(equations: Iterable[Block]) -> Gram:
    """The Gram matrices of all blocks, in one pass, memory constant in their number."""
    adder: _Adder | None = None
    for block in equations:
        if adder is None:
            adder = _Adder(block.channels, block.width)
        adder.add(block)
    if adder is None:
        raise ValueError("no equations")
    return adder.gram()


def gather_growing(equations: Iterable[Block], parts: int = 24) -> list[Gram]:
    """The same in consecutive parts, between `parts` and twice as many of them where there are as many blocks.

    The number of blocks need not be known: whenever there are twice too many parts, neighbours are merged. All parts but
    the last hold equally many blocks.
    """
    done: list[Gram] = []
    adder: _Adder | None = None
    blocks_a_part, held = 1, 0
    for block in equations:
        if adder is None:
            if len(done) == 2 * parts:
                done = [a + b for a, b in zip(done[::2], done[1::2], strict=True)]
                blocks_a_part *= 2
            adder, held = _Adder(block.channels, block.width), 0
        adder.add(block)
        held += 1
        if held == blocks_a_part:
            done.append(adder.gram())
            adder = None
    if adder is not None:
        done.append(adder.gram())
    if not done:
        raise ValueError("no equations")
    return done


class _Adder:
    """Adds the products of blocks up, each channel over its own columns only."""

    def __init__(self, channels: int, width: int) -> None:
        self.total = np.zeros((channels, width + 1, width + 1))
        self.counts = np.zeros(channels, dtype=np.intp)
        self.samples = self.longest = 0
        self.columns: tuple[Indices, ...] = ()
        self.places: list[tuple[Indices, Indices]] = []

    def add(self, block: Block) -> None:
        if block.columns is not self.columns:
            self.columns = block.columns
            self.places = [(index[:, None], index) for index in block.columns]
        for total, (down, across), a, y in zip(self.total, self.places, block.values, block.y, strict=True):
            total[down, across] += a @ a.T
            total[across, -1] += a @ y
            total[-1, -1] += y @ y
        self.counts += block.counts
        self.samples += block.samples
        self.longest = max(self.longest, block.samples)

    def gram(self) -> Gram:
        self.total[:, -1, :-1] = self.total[:, :-1, -1]
        return Gram(self.total, self.counts, self.samples, self.longest)


def triangulate(equations: Iterable[Block]) -> Triangles:
    """The triangular factors of all blocks, in one pass, memory constant in their number."""
    factor: Array | None = None
    samples = longest = 0
    counts = np.zeros(0, dtype=np.intp)
    for block in equations:
        if factor is None:
            counts = np.zeros(block.channels, dtype=np.intp)
            factor = np.zeros((block.channels, block.width + 1, block.width + 1))
        for r, index, a, y in zip(factor, block.columns, block.values, block.y, strict=True):
            used = np.append(np.union1d(np.flatnonzero(r[:, :-1].any(axis=0)), index), block.width)
            stack = np.zeros((len(used) + block.samples, len(used)))
            stack[:len(used)] = r[:len(used), used]
            stack[len(used):, np.searchsorted(used, index)] = a.T
            stack[len(used):, -1] = y
            small = np.linalg.qr(stack, mode="r")
            r[:] = 0.0
            r[np.ix_(np.arange(len(small)), used)] = small
        counts += block.counts
        samples += block.samples
        longest = max(longest, block.samples)
    if factor is None:
        raise ValueError("no equations")
    return Triangles(factor, counts, samples, longest)
