"""Solve weighted least squares over a stream of equations, memory constant in the samples.

    fitted = fit(equations)                     equations: anything that can be iterated over again
    fitted.solution.beta, .covariance
    errors(held_out_statistics, beta)           how the same numbers do on other samples
    by_blocks(equations, ...)                   errors of blocks of time, held out in turn

Equations y = A β arrive in blocks of consecutive samples, each output channel with the columns that
act on it. Of all samples one small matrix for each channel remains (`Statistics`): [A y]ᵀ[A y],
fast, which loses the square of the condition number; or, where that exceeds 1e4, R of [A y] = Q R,
by QR of one block on top of the last R (TSQR; Demmel et al. 2012, section 2.2). Channels stay
apart, so that their weights can change without reading a sample again.

Kostić et al. 2004, eq. (12)-(15), with every channel weighted by its own residual.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property, reduce
from itertools import accumulate, pairwise
from operator import add

import numpy as np
import numpy.typing as npt

from pipelines.io.log import Array

Indices = npt.NDArray[np.intp]
Flags = npt.NDArray[np.bool_]

_CONDITION = 1e4  # numerics: above it normal equations leave fewer than eight digits
_FLOOR = {False: 3e-8, True: 1e-13}  # numerics: singular values of unit columns that are rounding
_ROUNDS = 20  # numerics
_SETTLED = 1e-6  # numerics: relative change of the weights: a thousandth of what noise leaves
_LOST = 1e-6  # numerics: a share of a lost direction that is not rounding itself
_LEAST_SIGMA = 1e-6  # numerics: of the signal: below it a residual is rounding
_ENOUGH = 1e5  # numerics: condition from which samples do not tell all parameters yet
_ASIDE = 8  # numerics: of the shortest logs an eighth is left out at most


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
    def samples(self) -> int:
        return len(self.y[0])

    @property
    def counts(self) -> Indices:
        """(channels,) equations that count."""
        if self.used is None:
            return np.full(len(self.y), self.samples)
        return np.array([np.count_nonzero(used) for used in self.used])

    @classmethod
    def of(cls, Y: Array, y: Array) -> Block:
        """Return the block of Y (samples, channels, parameters) and y (samples, channels).

        What is zero throughout the block is left out.
        """
        columns = tuple(np.flatnonzero(row) for row in np.asarray(Y.any(axis=0)))
        tables = zip(Y.transpose(1, 2, 0), columns, strict=True)
        return cls(Y.shape[2], columns, tuple(table[index] for table, index in tables), tuple(y.T))

    def part(self, rows: slice) -> Block:
        """Return some consecutive samples of the block."""
        values, y = tuple(v[:, rows] for v in self.values), tuple(y[rows] for y in self.y)
        used = self.used and tuple(used[rows] for used in self.used)
        return Block(self.width, self.columns, values, y, used)

    def residual(self, beta: Array) -> Array:
        """Return y - A β (channels, samples)."""
        rows = zip(self.columns, self.values, self.y, strict=True)
        return np.array([y - beta[index] @ values for index, values, y in rows])


@dataclass(frozen=True, eq=False)
class Statistics:
    """Sufficient statistics of equations; those of two streams add. The last column is y."""

    table: Array  # (channels, k + 1, k + 1) [A y]ᵀ[A y] of each channel, or its R
    counts: Indices  # (channels,) equations
    samples: int
    longest: int  # samples of the longest block
    triangular: bool = False  # the table holds R

    def __add__(self, other: Statistics) -> Statistics:
        table = self.table + other.table
        if self.triangular:
            both = np.concatenate([self.table, other.table], axis=1)
            table = np.asarray(np.linalg.qr(both, mode="r"))
        longest, samples = max(self.longest, other.longest), self.samples + other.samples
        return Statistics(table, self.counts + other.counts, samples, longest, self.triangular)

    @cached_property
    def gram(self) -> Array:
        """(channels, k + 1, k + 1) [A y]ᵀ[A y]."""
        if not self.triangular:
            return self.table
        return np.asarray(self.table.transpose(0, 2, 1) @ self.table)

    @property
    def power(self) -> Array:
        """(channels,) Σ y²."""
        return self.gram[:, -1, -1]

    @property
    def floor(self) -> float:
        """Of columns of unit length, singular values that are rounding."""
        return _FLOOR[self.triangular]

    def root(self, weights: Array) -> Array:
        """Return a matrix F (…, k + 1) with FᵀF = Σ w_j [A y]ᵀ[A y], found with unit columns."""
        if self.triangular:
            stack = np.sqrt(weights)[:, None, None] * self.table
            return np.asarray(np.linalg.qr(stack.reshape(-1, stack.shape[2]), mode="r"))
        total = np.tensordot(weights, self.table, 1)
        scale = _unit(np.sqrt(np.diag(total)))
        values, vectors = np.linalg.eigh(total / scale / scale[:, None])
        return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T * scale)

    def rss(self, beta: Array) -> Array:
        """Return ‖y - A β‖² of each channel; of sums below 1e-15 of its power it may be zero."""
        v = np.append(-beta, 1.0)
        if self.triangular:
            return np.asarray(np.square(self.table @ v).sum(axis=1))
        return np.asarray(np.maximum(self.table @ v @ v, 0.0))


def _unit(lengths: Array) -> Array:
    return np.where(lengths > 0.0, lengths, 1.0)


def gather(equations: Iterable[Block]) -> Statistics:
    """Return the sums of products of all blocks, in one pass, memory constant in their number."""

    def take(total: Array, index: Indices, a: Array, y: Array) -> None:
        total[index[:, None], index] += a @ a.T
        total[index, -1] += a @ y
        total[-1, -1] += y @ y

    found = _collected(equations, take)
    found.table[:, -1, :-1] = found.table[:, :-1, -1]
    return found


def triangulate(equations: Iterable[Block]) -> Statistics:
    """Return the triangular factors of all blocks, in one pass, memory constant in their number."""

    def take(r: Array, index: Indices, a: Array, y: Array) -> None:
        acting = np.union1d(np.flatnonzero(r[:, :-1].any(axis=0)), index)
        used = np.append(acting, len(r) - 1)
        stack = np.zeros((len(used) + len(y), len(used)))
        stack[: len(used)] = r[: len(used), used]
        stack[len(used) :, np.searchsorted(used, index)] = a.T
        stack[len(used) :, -1] = y
        small = np.linalg.qr(stack, mode="r")
        r[:] = 0.0
        r[: len(small), used] = small

    return _collected(equations, take, triangular=True)


def _collected(
    equations: Iterable[Block],
    take: Callable[[Array, Indices, Array, Array], None],
    triangular: bool = False,
) -> Statistics:
    """Return the tables (k + 1, k + 1) into which `take` has put every channel of every block."""
    table = np.zeros((0, 0, 0))
    counts = np.zeros(0, dtype=np.intp)
    samples = longest = 0
    for block in equations:
        if not samples:
            table = np.zeros((len(block.y), block.width + 1, block.width + 1))
            counts = np.zeros(len(block.y), dtype=np.intp)
        for channel in zip(table, block.columns, block.values, block.y, strict=True):
            take(*channel)
        counts += block.counts
        samples, longest = samples + block.samples, max(longest, block.samples)
    if not samples:
        raise ValueError("no equations")
    return Statistics(table, counts, samples, longest, triangular)


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


def errors(statistics: Statistics, beta: Array) -> Errors:
    """Return how well β explains samples, which need not be those that it was fitted to."""
    rss = statistics.rss(beta)
    return Errors.of(rss, statistics.power, statistics.counts, statistics.samples)


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
    singular_values: Array  # (k,) falling
    directions: Array  # (k, k) right singular vectors, one a row
    rank: int  # as far as rounding allows to see; `identifiability` asks what noise allows
    determined: Flags  # (k,) a parameter is outside every direction that is lost to rounding
    acting: Flags  # (k,) any sample shows the parameter at all

    @property
    def std(self) -> Array:
        return np.sqrt(np.diag(self.covariance))

    @property
    def condition(self) -> float:
        """Condition number of the weighted equations with unit columns."""
        if self.rank < len(self.beta):
            return float("inf")
        return float(self.singular_values[0] / self.singular_values[-1])


@dataclass(frozen=True, eq=False)
class Fit:
    """A solution, and what remains of the equations that it solves."""

    statistics: Statistics
    solution: Solution


def fit(equations: Iterable[Block], *, weights: Array | None = None) -> Fit:
    """Fit `equations`, which are iterated over again where the condition asks for QR.

    Args:
        equations: blocks; a list, or an object whose `__iter__` makes them anew.
        weights: of the channels; by default their own residuals decide.
    """
    normal = gather(equations)
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
    information = statistics.gram[:, :-1, :-1]
    rms = np.sqrt(statistics.power / np.maximum(statistics.counts, 1))
    w = _weights(rms, rms) if weights is None else weights
    for left in reversed(range(_ROUNDS)):
        root = statistics.root(w)
        scale = _unit(np.linalg.norm(root[:, :-1], axis=0))
        u, s, v = np.linalg.svd(root[:, :-1] / scale, full_matrices=False)
        keep = s > statistics.floor * np.sqrt(len(scale))
        inverse = v[keep] / s[keep, None] / scale
        beta, bread = (u.T @ root[:, -1])[keep] @ inverse, inverse.T @ inverse
        taken = w * np.einsum("jab,ab->j", information, bread)
        freedom = np.maximum(statistics.counts - taken, 1.0)
        sigma = np.sqrt(statistics.rss(beta) / freedom)
        better = _weights(sigma, rms)
        settled = bool(np.all(np.abs(better - w) <= _SETTLED * w))
        if weights is not None or settled or not left:
            break
        w = better
    determined = ~np.any(np.abs(v[~keep]) > _LOST, axis=0)
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
        scale,
        s,
        v,
        int(keep.sum()),
        determined,
        np.einsum("jkk->k", information) > 0.0,
    )


def _weights(sigma: Array, rms: Array) -> Array:
    """1/σ², but no channel better than rounding."""
    return 1.0 / np.square(_unit(np.maximum(sigma, _LEAST_SIGMA * rms)))


@dataclass(frozen=True, eq=False)
class Convergence:
    """Estimates from the first samples, ever more of them. Kostić et al. 2004, Fig. 12."""

    samples: tuple[int, ...]
    beta: Array  # (counts, k); NaN while the samples so far do not determine all parameters
    std: Array  # (counts, k)


def convergence(
    equations: Iterable[Block], solution: Solution, parts: int, inflation: Array | float = 1.0
) -> Convergence:
    """Return the series over the growing sums of so many `parts`, in one pass.

    Args:
        solution: of all of them; its weights, and so its noise, hold throughout.
        inflation: (k,) what the residual's memory adds to standard deviations.
    """
    unit = inflation * np.sqrt(np.mean(solution.weights * np.square(solution.sigma)))
    cuts = np.unique(np.linspace(0, solution.errors.samples, parts + 1).astype(np.intp))
    samples, beta, std = list[int](), list[Array](), list[Array]()
    for upto in accumulate(_between(equations, cuts, gather), add):
        found = solve(upto, weights=solution.weights)
        known = 1.0 if found.condition < _ENOUGH else np.nan
        samples.append(upto.samples)
        beta.append(known * found.beta)
        std.append(known * unit * np.sqrt(np.diag(found.bread)))
    return Convergence(tuple(samples), np.array(beta), np.array(std))


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

    A low-pass spreads the noise of one sample over its neighbours: those next to a block that is
    held out are left out of the rest (Burman, Chow & Nolan 1994). One pass, memory constant: every
    part of the time leaves one small matrix, and those of any rest are sums.

    Args:
        samples: of all equations.
        guard: equations on either side of a block that have no part in its parameters.
        triangles: by QR, as a fit of bad condition is.
        weighted: joints by their own residual; all alike without.
    """
    edges = np.linspace(0, samples, min(blocks, samples) + 1).astype(np.intp)
    guard = min(guard, samples // _ASIDE)
    cuts = np.unique(np.clip(np.concatenate([edges - guard, edges, edges + guard]), 0, samples))
    parts = _between(equations, cuts, triangulate if triangles else gather)
    rss, power = [], []
    for first, last in pairwise(edges.tolist()):
        inside = (cuts[:-1] >= first) & (cuts[1:] <= last)
        near = (cuts[:-1] >= first - guard) & (cuts[1:] <= last + guard)
        held = reduce(add, [part for part, own in zip(parts, inside, strict=True) if own])
        rest = reduce(add, [part for part, own in zip(parts, near, strict=True) if not own])
        weights = None if weighted else np.ones(len(rest.power))
        rss.append(held.rss(solve(rest, weights=weights).beta))
        power.append(held.power)
    counts = reduce(add, parts).counts
    return Errors.of(np.sum(rss, axis=0), np.sum(power, axis=0), counts, samples)


def _between(
    equations: Iterable[Block], cuts: Indices, collect: Callable[[list[Block]], Statistics]
) -> list[Statistics]:
    """Return what remains between every two cuts, counted in equations from the first on."""
    found: dict[int, Statistics] = {}
    done = 0
    for block in equations:
        inside = cuts[(cuts > done) & (cuts < done + block.samples)] - done
        for first, last in pairwise([0, *inside.tolist(), block.samples]):
            place = int(np.searchsorted(cuts, done + first, side="right"))
            part = collect([block.part(slice(first, last))])
            found[place] = found[place] + part if place in found else part
        done += block.samples
    return list(found.values())
