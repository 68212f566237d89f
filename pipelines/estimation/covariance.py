"""Estimate standard deviations that allow for a residual with a memory, and for one that repeats.

Filtering, decimation and what a model lacks leave a residual whose samples depend on one another,
from sample to sample and from channel to channel. The estimate stays unbiased; its covariance is
the sandwich (White 1980; Newey & West 1987)

    C M C,    C = (Σ_j w_j A_jᵀ A_j)⁻¹,    M = Σ_ij w_i w_j Σ_kl a_i(k) γ_ij(k - l) a_j(l)ᵀ

Newey & West estimate M from products of residuals and regressors. Here the noise is taken as
stationary and only its cross-spectrum S is estimated, far fewer numbers from the same samples, so
that ten seconds are enough:

    M = 1/n Σ_f Σ_ij w_i w_j conj(a_i(f)) S_ij(f) a_j(f)ᵀ,   a(f) the transform of the columns

S is prewhitened by an autoregression of each channel (Andrews & Monahan 1992), then averaged over
bands: an autoregression alone misses what a sharp filter does, averages alone smear a peak. Blocks
of another `noise` have an S of their own, and a part of M.

An error of the model is the same in each of M periods of a motion that repeats, r_k(p) = e(p) +
n_k(p) at phase p of period k: it is no independent error each time, and equations of one phase are
a cluster (Liang & Zeger 1986, Biometrika 73, p. 13; Arellano 1987, Oxf. Bull. Econ. Stat. 49,
p. 431). An orthogonal turn over the periods of a phase, of Helmert 1876,

    √M r̄(p) = √M e(p) + noise
    √(k/(k+1)) (r_k - mean of r_0 … r_{k-1})(p) = noise        k = 1 … M - 1

leaves the estimate as it is, white noise white and of the same strength, and both parts independent
of each other. So each has a spectrum of its own, as an analysis of variance has a mean square
between phases and one within: where nothing but noise is left both agree, and M periods are worth
M; where the model lacks something they are worth one. Means of another number of periods have
another: √M e is as strong as M is great. Periods need not be alike: what a motion does differently
each time is in the columns of the contrasts.

The limit: noise that is not white runs on from the end of a period into the next, and so from a
contrast to the mean and to the contrast after it. Taken for independent they tell too little where
noise remembers long compared with a period and columns jump from its end to its beginning: standard
deviations 1.4 times too small at a twenty-fifth of one of 8 periods, 2 times at a tenth of one of
20. `Robust.at_least` sets that right by what the periods tell in the order of time.

Memory: the transform of one block, every block padded to the longest; of a motion that repeats that
is a period, however many there are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from operator import itemgetter
from typing import Any

import numpy as np

from pipelines.estimation.chain import Complex
from pipelines.estimation.config import CovarianceConfig
from pipelines.estimation.filters import fast_length
from pipelines.estimation.least_squares import Block, Flags, Indices, Solution
from pipelines.io.log import Array

_CONFIG = CovarianceConfig()
_PADDING = 8  # numerics: an eighth of a block of zeros, so that its end is far from its beginning
# of `Block.noise`, whose 0 is that of equations that repeat nothing; from MEAN on that of means
CONTRAST, MEAN = 1, 2  # numerics


def of_mean(periods: float) -> int:
    """Return the noise of √M times the mean of so many periods M."""
    return MEAN + round(periods)


@dataclass(frozen=True, eq=False)
class Robust:
    """The covariance of β, with what was learnt of the residual."""

    covariance: Array  # (k, k); infinite where β is not determined
    white: bool  # the residual can pass for white of one strength, its channels for independent
    inflation: Array  # (k,) standard deviation over that of white noise
    orders: tuple[int, ...]  # of each channel's autoregression, one noise after the other

    @property
    def std(self) -> Array:
        return np.sqrt(np.diag(self.covariance))

    def at_least(self, other: Robust) -> Robust:
        """Return D C D with D = diag(max(1, std_other / std)): no parameter surer than `other`."""
        known = np.isfinite(self.std) & (self.std > 0.0)
        ratio = np.maximum(1.0, other.std / np.where(known, self.std, 1.0))
        wider = np.where(known, ratio, 1.0)
        covariance = wider[:, None] * self.covariance * wider
        white = self.white and other.white
        return Robust(covariance, white, self.inflation * wider, self.orders)


@dataclass(frozen=True, eq=False)
class _Noise:
    """A cross-spectrum S = H L Lᴴ Hᴴ: H shapes each channel, L mixes them within a band."""

    length: int  # samples of the Fourier transform
    shape: Complex  # (channels, frequencies)
    edges: Indices  # (bands + 1,)
    mix: Complex  # (bands, channels, channels) lower triangular
    orders: tuple[int, ...]
    white: bool


@dataclass(frozen=True, eq=False)
class _Transformed:
    """The Fourier transforms a(f) of a block's columns."""

    columns: tuple[Indices, ...]
    spectra: tuple[Complex, ...]  # of each channel (k_j, frequencies)
    noise: int


def robust_covariance(equations: Iterable[Block], solution: Solution, longest: int) -> Robust:
    """Return the covariance of `solution` by two passes over its equations; one where they are a
    single block, or the residual is white.

    Args:
        longest: samples of the longest block (`Statistics.longest`).
    """
    length = fast_length(longest + longest // _PADDING + 1)
    noises, alone = _noises(equations, solution, length)
    orders = tuple(order for noise in noises.values() for order in noise.orders)
    plain = np.diag(solution.covariance)
    if len(noises) == 1 and all(noise.white for noise in noises.values()):
        return Robust(solution.covariance, True, np.ones(len(plain)), orders)
    meat = np.zeros_like(solution.bread)
    blocks = (_transform(block, length) for block in equations) if alone is None else (alone,)
    for block in blocks:
        _add_meat(meat, block, solution.weights, noises[block.noise])
    covariance = solution.bread @ meat @ solution.bread
    # below 0 by rounding, of numbers next to undetermined ones
    determined = solution.determined & (np.diag(covariance) >= 0.0)
    variance = np.maximum(np.diag(covariance), 0.0)
    inflation = np.sqrt(variance / np.where(plain > 0.0, plain, 1.0))
    covariance[~determined] = covariance[:, ~determined] = np.inf
    return Robust(covariance, False, np.where(determined, inflation, 1.0), orders)


def _transform(block: Block, length: int) -> _Transformed:
    spectra = tuple(np.fft.rfft(values, length, axis=1) for values in block.values)
    return _Transformed(block.columns, spectra, block.noise)


def _add_meat(meat: Array, block: _Transformed, weights: Array, noise: _Noise) -> None:
    """Add 1/n Σ_f conj(Z)ᵀ Z with Z = Lᴴ Hᴴ [w_j a_j(f)ᵀ]: S as a square keeps M positive."""
    bins = noise.shape.shape[1]
    twice = np.full(bins, np.sqrt(2.0 / noise.length))  # negative frequencies
    twice[0] = np.sqrt(1.0 / noise.length)
    if noise.length % 2 == 0:
        twice[-1] = twice[0]
    width = np.diff(noise.edges)
    for a in range(len(weights)):
        felt = [j for j in range(a, len(weights)) if noise.mix[:, j, a].any()]
        factors = {
            j: weights[j] * twice * np.conj(noise.shape[j] * np.repeat(noise.mix[:, j, a], width))
            for j in felt
        }
        if felt == [a]:  # its phase does not matter
            used, mixed = block.columns[a], block.spectra[a] * np.abs(factors[a])
        else:
            used = block.columns[a][:0]
            if felt:
                used = np.unique(np.concatenate([block.columns[j] for j in felt]))
            mixed = np.zeros((len(used), bins), dtype=np.complex128)
            for j in felt:
                mixed[np.searchsorted(used, block.columns[j])] += block.spectra[j] * factors[j]
        # columns stored with samples slowest are not contiguous
        real = np.ascontiguousarray(mixed).view(np.float64)
        meat[np.ix_(used, used)] += real @ real.T


class _Sums:
    """Sums over the blocks of one noise."""

    def __init__(self, channels: int, bins: int) -> None:
        self.samples, self.longest, self.counts = 0, 0, np.zeros(channels)
        self.cross = np.zeros((channels, channels, bins), dtype=np.complex128)
        self.leverage = np.zeros((channels, bins))


def _noises(
    equations: Iterable[Block], solution: Solution, length: int
) -> tuple[dict[int, _Noise], _Transformed | None]:
    """Return the residual's cross-spectrum of each noise; and the block where there is one only."""
    found, blocks, transformed = dict[int, _Sums](), 0, None
    for block in equations:
        own = found.setdefault(block.noise, _Sums(block.channels, length // 2 + 1))
        spectrum = np.fft.rfft(block.residual(solution.beta), length, axis=1)
        own.cross += spectrum[:, None] * np.conj(spectrum)
        transformed = _transform(block, length)
        own.leverage += _leverage(transformed, solution)
        own.samples, own.longest = own.samples + block.samples, max(own.longest, block.samples)
        own.counts, blocks = own.counts + block.counts, blocks + 1
    noises = {noise: _noise(own, length) for noise, own in found.items()}
    return noises, transformed if blocks == 1 else None


def _noise(sums: _Sums, length: int) -> _Noise:
    samples, counts, channels = sums.samples, np.maximum(sums.counts, 1.0), len(sums.counts)
    # equations left out have no noise
    cross = sums.cross / np.sqrt(counts[:, None] * counts)[:, :, None]
    own = np.arange(channels)
    gamma = np.fft.irfft(cross[own, own], length, axis=1)
    # what is further apart than a block is long, no block tells
    most = min(_CONFIG.order, samples // 20, sums.longest // 2)
    fits = [_autoregression(g, samples, most) for g in gamma]
    shape = np.array([1.0 / np.fft.rfft(a, length) for a in fits])
    orders = tuple(len(a) - 1 for a in fits)
    # n samples have n / 2 frequencies of their own
    bins = cross.shape[2]
    width = max(1, _CONFIG.bins * length // samples)
    edges = np.linspace(0, bins, max(1, bins // width) + 1).astype(np.intp)
    taken = np.minimum(_mean(sums.leverage / counts[:, None], edges), _CONFIG.most_taken)
    left = np.sqrt(1.0 - taken)
    flat = cross / (shape[:, None] * np.conj(shape))
    mean = _mean(flat, edges) / (left[:, None] * left)
    together = _correlated(flat, mean, length, samples)
    if not together:
        mean[~np.eye(channels, dtype=bool)] = 0.0
    mix, white = _factor(mean.transpose(2, 0, 1)), not any(orders) and not together
    return _Noise(length, shape, edges, mix, orders, white)


def _leverage(block: _Transformed, solution: Solution) -> Array:
    """w aᴴ C a (channels, frequencies): the share of the noise that the parameters take up.

    It is largest where the columns are, which is where S matters: E|r|² = (1 - h) S.
    """
    rows = []
    for index, spectra, w in zip(block.columns, block.spectra, solution.weights, strict=True):
        values, vectors = np.linalg.eigh(solution.bread[np.ix_(index, index)])
        part = (vectors * np.sqrt(np.maximum(w * values, 0.0))).T @ spectra
        rows.append(np.square(part.real).sum(axis=0) + np.square(part.imag).sum(axis=0))
    return np.array(rows)


def _mean(values: Any, edges: Indices) -> Any:
    """Return averages over bands of the last axis."""
    return np.add.reduceat(values, edges[:-1], axis=-1) / np.diff(edges)


def _autoregression(gamma: Array, samples: int, most: int) -> Array:
    """Return the coefficients [1, a_1, …] of the order that Schwarz's criterion prefers.

    Levinson 1947, Durbin 1960; Schwarz 1978: N log σ² + order · log N.
    """
    a, power = np.ones(1), float(gamma[0])
    best, least = a, 0.0
    if power <= 0.0:
        return best
    for order in range(1, most + 1):
        reflection = -float(a @ gamma[order:0:-1]) / power
        a = np.append(a, 0.0)
        a = a + reflection * a[::-1]
        power *= 1.0 - reflection**2
        if power <= 1e-13 * gamma[0]:
            break
        criterion = samples * np.log(power / gamma[0]) + order * np.log(samples)
        if criterion < least:
            best, least = a, criterion
    return best


def _factor(spectrum: Complex) -> Complex:
    """Return lower triangular L with L Lᴴ = S for each band; zero of a channel without noise."""
    power = np.einsum("bjj->bj", spectrum).real
    scale = np.sqrt(np.where(power > 0.0, power, 1.0))
    unit = spectrum / scale[:, :, None] / scale[:, None, :]
    eye = np.eye(unit.shape[1])
    unit += 1e-12 * eye  # channels may be exact multiples of one another
    root = np.linalg.cholesky(unit + np.where(power > 0.0, 0.0, 1.0)[:, :, None] * eye)
    return np.asarray(root * np.where(power > 0.0, scale, 0.0)[:, :, None])


def _correlated(flat: Complex, mean: Complex, length: int, samples: int) -> bool:
    """Return whether two channels go together beyond chance: a little apart, or within a band.

    Of channels that are independent, coherence over n frequencies exceeds c with probability
    exp(-n c) at most.
    """
    others = ~np.eye(len(flat), dtype=bool)
    lags = min(_CONFIG.lags, length // 2)
    covariance = np.fft.irfft(flat[others], length, axis=1)[:, [*range(lags), *range(-lags, 0)]]
    power = np.einsum("jjf->jf", flat).real.mean(axis=1)
    limit = _CONFIG.cross * np.sqrt(power[:, None] * power)[others][:, None]
    if np.any(np.abs(covariance) * np.sqrt(samples) > limit):
        return True
    each = np.einsum("jjb->jb", mean).real
    frequencies = flat.shape[2] * min(1.0, samples / length) / mean.shape[2]
    coherent = np.square(np.abs(mean)) * frequencies > _CONFIG.coherent * each[:, None] * each
    return bool(np.any(coherent[others]))


@dataclass(frozen=True, eq=False)
class Cycle:
    """Where equations lie in the period of their motion."""

    phase: Indices  # (samples,) 0 .. count - 1, rising within a period
    count: int  # of phases


@dataclass(frozen=True, eq=False)
class Contrasted:
    """The equations of several logs, turned where they repeat; iterate as often as they allow."""

    # blocks, alike in their columns, with the place of their log
    numbered: Callable[[], Iterable[tuple[int, Block]]]
    cycles: Sequence[Cycle | None]  # of each log; None: it repeats nothing

    def __iter__(self) -> Iterator[Block]:
        for place, pairs in groupby(self.numbered(), itemgetter(0)):
            cycle, blocks = self.cycles[place], (block for _, block in pairs)
            yield from blocks if cycle is None else _contrasted(blocks, cycle)

    def longest(self, block: int) -> int:
        """Return the samples of the longest block, where untouched equations have `block`."""
        return max(block if cycle is None else cycle.count for cycle in self.cycles)


def _contrasted(blocks: Iterable[Block], cycle: Cycle) -> Iterator[Block]:
    """Yield the contrasts of each period to those before it, then the mean. Memory: one period."""
    total, done = None, 0
    for block in blocks:
        phase = cycle.phase[done : done + block.samples]
        done += block.samples
        cuts = np.flatnonzero(np.diff(phase) <= 0) + 1  # no phase comes twice between them
        for first, last in pairwise([0, *cuts.tolist(), len(phase)]):
            total = _Sum(block, cycle.count) if total is None else total
            yield from total.add(block.part(slice(first, last)), phase[first:last])
    if total is not None:
        yield total.mean()


class _Sum:
    """The sum of the equations of every phase so far, and of how many; left out ones are none."""

    def __init__(self, like: Block, phases: int) -> None:
        self.like = like
        # columns of a channel, and y
        self.sums = [np.zeros((len(index) + 1, phases)) for index in like.columns]
        self.seen = np.zeros((like.channels, phases))

    def add(self, block: Block, phase: Indices) -> Iterator[Block]:
        """Yield the contrast of one period to those before it, where there are any."""
        rows, used = [], []
        for j, (sums, seen) in enumerate(zip(self.sums, self.seen, strict=True)):
            own = np.vstack([block.values[j], block.y[j]])
            there = np.ones(len(phase), dtype=bool) if block.used is None else block.used[j]
            n, both = seen[phase], there & (seen[phase] > 0.0)
            # √(n/(n+1)) (x - Σ/n)
            contrast = (n * own - sums[:, phase]) / np.sqrt(np.maximum(n, 1.0) * (n + 1.0))
            rows.append(np.where(both, contrast, 0.0))
            used.append(both)
            sums[:, phase] += np.where(there, own, 0.0)
            seen[phase] += there
        if np.any(used):
            yield self._block(rows, np.array(used), CONTRAST)

    def mean(self) -> Block:
        """Return √n times the mean of the n equations of each phase."""
        pairs = zip(self.sums, self.seen, strict=True)
        rows = [sums / np.sqrt(np.maximum(seen, 1.0)) for sums, seen in pairs]
        periods = float(np.mean(self.seen[self.seen > 0.0]))
        return self._block(rows, self.seen > 0.0, of_mean(periods))

    def _block(self, rows: list[Array], used: Flags, noise: int) -> Block:
        keep = np.flatnonzero(used.any(axis=0))
        values = tuple(np.ascontiguousarray(row[:-1, keep]) for row in rows)
        y, counted = tuple(row[-1, keep] for row in rows), tuple(used[:, keep])
        whole = None if used.all() else counted
        return Block(self.like.width, self.like.columns, values, y, whole, noise)
