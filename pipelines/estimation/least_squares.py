"""Solve weighted least squares over a stream of equations, memory constant in the samples.

    fitted = fit(equations)                     equations: anything that can be iterated over again
    fitted.solution.beta, .covariance
    errors(held_out_statistics, beta)           how the same numbers do on other samples

Equations y = A β arrive in blocks, each output channel with the columns that act on it. A block is
a stretch of consecutive samples. Noise is taken to be stationary in each channel, and stretches to
be independent of each other, so a block should be long against the memory of the noise.

Kostić et al. 2004, eq. (12)-(15), with every channel weighted by its own residual. Normal equations
with unit columns; where their condition number exceeds 1e4 the stream is read again into triangular
factors, which lose half as many digits. Of all samples one small matrix for each channel remains:

    Gram         [A y]ᵀ [A y], by adding products: fast, loses the square of the condition number
    Triangles    R of [A y] = Q R, by QR of one block on top of the last R (TSQR; Demmel et al.
                 2012, section 2.2): loses the condition number only

Channels stay apart, so that their weights can change without reading a sample again; two of a kind
add up to that of all samples.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from pipelines.io.log import Array

Indices = npt.NDArray[np.intp]
Flags = npt.NDArray[np.bool_]

_CONDITION = 1e4  # numerics: above it normal equations leave fewer than eight digits
_ROUNDS = 20  # numerics
_SETTLED = 1e-6  # numerics: relative change of the weights: a thousandth of what noise leaves
_LOST = 1e-6  # numerics: a share of a lost direction that is not rounding itself
_LEAST_SIGMA = 1e-6  # numerics: of the signal: below it a residual is rounding
_FLOOR = 1e-10  # numerics: smallest eigenvalue, of unit columns, of a part that can be solved


@dataclass(frozen=True, eq=False)
class Block:
    """Equations of consecutive samples. Memory may be shared: what is to be kept must be copied."""

    width: int  # parameters in all
    columns: tuple[Indices, ...]  # of each channel, (k_j,): the parameters that act on it
    values: tuple[Array, ...]  # of each channel, (k_j, samples): their columns, samples fastest
    y: tuple[Array, ...]  # of each channel, (samples,)
    # of each channel (samples,): equations left out are zero throughout; None: all count
    used: tuple[Flags, ...] | None = None

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
    def of(cls, Y: Array, y: Array) -> Block:
        """Return the block of Y (samples, channels, parameters) and y (samples, channels).

        What is zero throughout the block is left out; views where columns are a run.
        """
        acting: Flags = np.asarray(Y.any(axis=0))
        columns = tuple(np.flatnonzero(row) for row in acting)
        tables = Y.transpose(1, 2, 0)
        values = []
        for table, index in zip(tables, columns, strict=True):
            run = len(index) and index[-1] - index[0] == len(index) - 1
            values.append(table[index[0] : index[-1] + 1] if run else table[index])
        return cls(Y.shape[2], columns, tuple(values), tuple(y.T))

    def part(self, rows: slice) -> Block:
        """Return some consecutive samples of the block."""
        values = tuple(v[:, rows] for v in self.values)
        used = self.used and tuple(used[rows] for used in self.used)
        y = tuple(y[rows] for y in self.y)
        return Block(self.width, self.columns, values, y, used)

    def residual(self, beta: Array) -> Array:
        """Return y - A β (channels, samples)."""
        rows = zip(self.columns, self.values, self.y, strict=True)
        return np.array([y - beta[index] @ values for index, values, y in rows])


def split(equations: Iterable[Block], samples: int) -> Iterator[Block]:
    """Yield the same equations in blocks of at most this many samples."""
    for block in equations:
        for first in range(0, block.samples, samples):
            yield block.part(slice(first, first + samples))


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
    def power(self) -> Array:
        """Σ y² of each channel."""
        return self.gram[:, -1, -1]

    def __add__(self, other: Gram) -> Gram:
        counts, samples = self.counts + other.counts, self.samples + other.samples
        return Gram(self.gram + other.gram, counts, samples, max(self.longest, other.longest))

    def information(self) -> Array:
        """Return AᵀA of each channel (channels, k, k)."""
        return self.gram[:, :-1, :-1]

    def root(self, weights: Array) -> Array:
        """Return a square matrix F with FᵀF = Σ w_j [A y]ᵀ[A y], found with unit columns."""
        total = np.tensordot(weights, self.gram, 1)
        scale = _unit(np.sqrt(np.diag(total)))
        values, vectors = np.linalg.eigh(total / scale / scale[:, None])
        return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T * scale)

    def spectrum(self, weights: Array) -> Spectrum:
        """Return singular values as roots of eigenvalues, which keep half the digits."""
        total = np.tensordot(weights, self.gram, 1)
        scale = _unit(np.sqrt(np.diag(total)[:-1]))
        values, vectors = np.linalg.eigh(total[:-1, :-1] / scale / scale[:, None])
        s, v = np.sqrt(np.maximum(values[::-1], 0.0)), vectors.T[::-1]
        return Spectrum(scale, s, v, v @ (total[:-1, -1] / scale) / _unit(s))

    def rss(self, beta: Array) -> Array:
        """Return ‖y - A β‖² of each channel; below 1e-15 of its power it may be zero."""
        v = np.append(-beta, 1.0)
        return np.asarray(np.maximum(self.gram @ v @ v, 0.0))


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangular factors. The last column is that of y. Methods as of `Gram`."""

    factor: Array  # (channels, k + 1, k + 1)
    counts: Indices  # (channels,) equations
    samples: int
    longest: int
    floor: float = 1e-13

    @property
    def power(self) -> Array:
        return np.asarray(np.square(self.factor[:, :, -1]).sum(axis=1))

    def __add__(self, other: Triangles) -> Triangles:
        both = np.linalg.qr(np.concatenate([self.factor, other.factor], axis=1), mode="r")
        counts, samples = self.counts + other.counts, self.samples + other.samples
        return Triangles(np.asarray(both), counts, samples, max(self.longest, other.longest))

    def information(self) -> Array:
        a = self.factor[:, :, :-1]
        return np.asarray(a.transpose(0, 2, 1) @ a)

    def root(self, weights: Array) -> Array:
        stack = np.sqrt(weights)[:, None, None] * self.factor
        return np.asarray(np.linalg.qr(stack.reshape(-1, stack.shape[2]), mode="r"))

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


class _Adder:
    """Adds the products of blocks up, each channel over its own columns only."""

    def __init__(self, block: Block) -> None:
        self.total = np.zeros((block.channels, block.width + 1, block.width + 1))
        self.counts = np.zeros(block.channels, dtype=np.intp)
        self.samples = self.longest = 0
        self.columns: tuple[Indices, ...] = ()
        self.places: list[tuple[Indices, Indices]] = []

    def add(self, block: Block) -> None:
        if block.columns is not self.columns:
            self.columns = block.columns
            self.places = [(index[:, None], index) for index in block.columns]
        channels = zip(self.total, self.places, block.values, block.y, strict=True)
        for total, (down, across), a, y in channels:
            total[down, across] += a @ a.T
            total[across, -1] += a @ y
            total[-1, -1] += y @ y
        self.counts += block.counts
        self.samples += block.samples
        self.longest = max(self.longest, block.samples)

    def gram(self) -> Gram:
        self.total[:, -1, :-1] = self.total[:, :-1, -1]
        return Gram(self.total, self.counts, self.samples, self.longest)


def gather(equations: Iterable[Block]) -> Gram:
    """Return the Gram matrices of all blocks, in one pass, memory constant in their number."""
    adder: _Adder | None = None
    for block in equations:
        adder = _Adder(block) if adder is None else adder
        adder.add(block)
    if adder is None:
        raise ValueError("no equations")
    return adder.gram()


def gather_growing(equations: Iterable[Block], parts: int = 24) -> list[Gram]:
    """Return the Gram matrices of consecutive parts of one block or more, `parts` to twice as many.

    Neighbouring parts are joined as soon as there are too many, so that memory stays constant.
    """
    done: list[Gram] = []
    adder: _Adder | None = None
    size, held = 1, 0
    for block in equations:
        if adder is None:
            if len(done) == 2 * parts:
                done = [a + b for a, b in zip(done[::2], done[1::2], strict=True)]
                size *= 2
            adder, held = _Adder(block), 0
        adder.add(block)
        held += 1
        if held == size:
            done.append(adder.gram())
            adder = None
    if adder is not None:
        done.append(adder.gram())
    if not done:
        raise ValueError("no equations")
    return done


def triangulate(equations: Iterable[Block]) -> Triangles:
    """Return the triangular factors of all blocks, in one pass, memory constant in their number."""
    factor: Array | None = None
    samples = longest = 0
    counts = np.zeros(0, dtype=np.intp)
    for block in equations:
        if factor is None:
            counts = np.zeros(block.channels, dtype=np.intp)
            factor = np.zeros((block.channels, block.width + 1, block.width + 1))
        for r, index, a, y in zip(factor, block.columns, block.values, block.y, strict=True):
            acting = np.union1d(np.flatnonzero(r[:, :-1].any(axis=0)), index)
            used = np.append(acting, block.width)
            stack = np.zeros((len(used) + block.samples, len(used)))
            stack[: len(used)] = r[: len(used), used]
            stack[len(used) :, np.searchsorted(used, index)] = a.T
            stack[len(used) :, -1] = y
            small = np.linalg.qr(stack, mode="r")
            r[:] = 0.0
            r[np.ix_(np.arange(len(small)), used)] = small
        counts += block.counts
        samples += block.samples
        longest = max(longest, block.samples)
    if factor is None:
        raise ValueError("no equations")
    return Triangles(factor, counts, samples, longest)


@dataclass(frozen=True, eq=False)
class Errors:
    """How parameters explain samples, per channel and in all."""

    rms: Array  # (channels,) root mean square of y - A β
    signal_rms: Array  # (channels,) of y
    relative_error: float  # ‖y - A β‖ / ‖y‖ over all channels
    counts: Indices  # (channels,) equations
    samples: int

    @classmethod
    def of(cls, rss: Array, power: Array, counts: Indices, samples: int) -> Errors:
        """Return the errors of Σ (y - A β)² and Σ y² (channels,)."""
        some, total = np.maximum(counts, 1), float(power.sum())  # 0 / 1 of an empty channel
        relative = float(np.sqrt(rss.sum() / total)) if total > 0.0 else 0.0
        return cls(np.sqrt(rss / some), np.sqrt(power / some), relative, counts, samples)


@dataclass(frozen=True, eq=False)
class Solution:
    """Parameters with what is known of their uncertainty, as far as white noise goes."""

    beta: Array  # (k,)
    # (k, k), as if the residual were white and channels independent; infinite where not determined
    covariance: Array
    bread: Array  # (k, k) (Σ w_j A_jᵀ A_j)⁻¹ over what is determined
    weights: Array  # (channels,)
    sigma: Array  # (channels,) standard deviation of the residual, parameters allowed for
    freedom: Array  # (channels,) samples less the parameters that the channel determines
    errors: Errors
    scale: Array  # (k,) length of each weighted column; the following are of columns of unit length
    singular_values: Array  # (k,)
    directions: Array  # (k, k) right singular vectors, one a row
    rank: int  # as far as rounding allows to see; `identifiability` asks what noise allows
    determined: Flags  # (k,) a parameter is outside every direction that is lost to rounding
    acting: Flags  # (k,) any sample shows the parameter at all
    method: Literal["normal equations", "QR"]

    @property
    def std(self) -> Array:
        return np.sqrt(np.diag(self.covariance))

    @property
    def condition(self) -> float:
        """Condition number of the weighted equations with unit columns."""
        if self.rank < len(self.beta):
            return float("inf")
        return float(self.singular_values[0]) / float(self.singular_values[-1])


@dataclass(frozen=True, eq=False)
class Fit:
    statistics: Statistics
    solution: Solution


def fit(
    equations: Iterable[Block], *, weights: Array | None = None, gram: Gram | None = None
) -> Fit:
    """Fit `equations`, which are iterated over again where the condition asks for QR.

    Args:
        equations: blocks; a list, or an object whose `__iter__` makes them anew.
        weights: of the channels; their own residuals decide where there are none.
        gram: `gather` of the same equations, where it is known.
    """
    normal = gather(equations) if gram is None else gram
    solution = solve(normal, weights=weights)
    seen = solution.singular_values[solution.singular_values > 0.0]
    if solution.rank == len(solution.beta) and seen[0] <= _CONDITION * seen[-1]:
        return Fit(normal, solution)
    triangles = triangulate(equations)
    return Fit(triangles, solve(triangles, weights=weights))


def solve(statistics: Statistics, *, weights: Array | None = None) -> Solution:
    """Solve for β; without `weights` each channel is weighted by 1/σ_j² of its own residual.

    Iteratively reweighted least squares over channels (Aitken 1935, with the weights estimated):
    the maximum-likelihood estimate where channels have independent white noise of unknown strength.
    No sample is read.
    """
    information, rounds = statistics.information(), 0
    rms = np.sqrt(statistics.power / np.maximum(statistics.counts, 1))
    w = _weights(rms, rms) if weights is None else weights
    while True:
        seen = statistics.spectrum(w)
        keep = seen.singular_values > statistics.floor * np.sqrt(len(seen.scale))
        inverse = seen.directions[keep] / seen.singular_values[keep, None] / seen.scale
        beta, bread = seen.projections[keep] @ inverse, inverse.T @ inverse
        taken = w * np.einsum("jab,ab->j", information, bread)
        freedom = np.maximum(statistics.counts - taken, 1.0)
        sigma = np.sqrt(statistics.rss(beta) / freedom)
        better = _weights(sigma, rms)
        rounds += 1
        settled = bool(np.all(np.abs(better - w) <= _SETTLED * w))
        if weights is not None or rounds == _ROUNDS or settled:
            break
        w = better
    determined = ~np.any(np.abs(seen.directions[~keep]) > _LOST, axis=0)
    covariance = bread @ np.tensordot(np.square(w * sigma), information, 1) @ bread
    covariance[~determined] = covariance[:, ~determined] = np.inf
    return Solution(
        beta,
        covariance,
        bread,
        w,
        sigma,
        freedom,
        errors(statistics, beta),
        seen.scale,
        seen.singular_values,
        seen.directions,
        int(keep.sum()),
        determined,
        np.einsum("jkk->k", information) > 0.0,
        "normal equations" if isinstance(statistics, Gram) else "QR",
    )


def errors(statistics: Statistics, beta: Array) -> Errors:
    """Return how well β explains samples, which need not be those that it was fitted to."""
    rss = statistics.rss(beta)
    return Errors.of(rss, statistics.power, statistics.counts, statistics.samples)


def _weights(sigma: Array, rms: Array) -> Array:
    """1/σ², but no channel better than rounding."""
    known = np.maximum(sigma, _LEAST_SIGMA * rms)
    return 1.0 / np.square(np.where(known > 0.0, known, 1.0))


@dataclass(frozen=True, eq=False)
class Convergence:
    """Estimates from the first samples, ever more of them. Kostić et al. 2004, Fig. 12."""

    samples: tuple[int, ...]
    beta: Array  # (counts, k); NaN while the samples so far do not determine all parameters
    std: Array  # (counts, k)


def convergence(
    parts: Sequence[Gram], solution: Solution, inflation: Array | float = 1.0
) -> Convergence:
    """Return the series over the growing sums of consecutive `parts`; no sample is read again.

    Args:
        solution: of all of them; its weights, and so its noise, hold throughout.
        inflation: (k,) what the residual's memory adds to standard deviations.
    """
    each = np.stack([part.gram for part in parts])
    grams = np.cumsum(np.tensordot(solution.weights, each, axes=(0, 1)), axis=0)
    information, moment = grams[:, :-1, :-1], grams[:, :-1, -1]
    scale = _unit(np.sqrt(np.einsum("ikk->ik", information)))
    values, vectors = np.linalg.eigh(information / scale[:, :, None] / scale[:, None, :])
    enough = values[:, 0] > _FLOOR
    size = np.sqrt(np.where(enough[:, None], values, 1.0))
    inverse = vectors / size[:, None, :] / scale[:, :, None]
    beta = np.einsum("iab,icb,ic->ia", inverse, inverse, moment, optimize=True)
    unit = np.sqrt(np.mean(solution.weights * np.square(solution.sigma)))
    std = unit * np.linalg.norm(inverse, axis=2) * inflation
    beta[~enough], std[~enough] = np.nan, np.nan
    counts = np.cumsum([part.samples for part in parts])
    return Convergence(tuple(int(n) for n in counts), beta, std)
