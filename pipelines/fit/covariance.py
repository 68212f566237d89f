"""Standard deviations that allow for a residual with a memory.

Filtering, decimation and what a model lacks leave a residual whose samples depend on one another, from sample to sample
and from channel to channel. The estimate stays unbiased; its covariance is the sandwich (White 1980; Newey & West 1987)

    C M C,    C = (Σ_j w_j A_jᵀ A_j)⁻¹,    M = Σ_ij w_i w_j Σ_kl a_i(k) γ_ij(k - l) a_j(l)ᵀ

Newey & West estimate M from products of residuals and regressors. Here the noise is taken as stationary and only its
cross-spectrum S is estimated, far fewer numbers from the same samples, so that ten seconds are enough:

    M = 1/n Σ_f Σ_ij w_i w_j conj(a_i(f)) S_ij(f) a_j(f)ᵀ,   a(f) the Fourier transform of a channel's columns

S is prewhitened by an autoregression of each channel (Andrews & Monahan 1992), then averaged over bands: an autoregression
alone misses what a sharp filter does, averages alone smear a peak. Blocks of another `noise` have an S of their own, and a
part of M: so have the means of periods and the contrasts between them (`contrasts.py`).

Memory: the transform of one block, every block padded to the longest; of a motion that repeats that is a period.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.fit.equations import Array, Block, Indices
from pipelines.fit.least_squares import Solution

__all__ = ["Robust", "robust_covariance"]

Complex = npt.NDArray[np.complex128]

_ORDER = 24  # of the autoregressions at most
_BINS = 40  # independent frequencies in a band: its power is then known to 16 %
_MOST_TAKEN = 0.75  # of a band's noise, by the parameters: beyond, what is left says too little
_PADDING = 8  # an eighth of a block of zeros, so that its end does not touch its beginning
_CROSS = 5.0  # standard deviations of a correlation between channels that is not chance
_COHERENT = 14.0  # times one over the number of frequencies: once in a million bands by chance
_LAGS = 20  # samples apart, at which it is looked for


@dataclass(frozen=True, eq=False)
class Robust:
    """The covariance of β, with what was learnt of the residual."""

    covariance: Array  # (k, k); infinite where β is not determined
    white: bool  # whether the residual can pass for white of one strength and its channels for independent
    inflation: Array  # (k,) standard deviation over that of white noise
    orders: tuple[int, ...]  # of each channel's autoregression, one noise after the other

    @property
    def std(self) -> Array:
        return np.sqrt(np.diag(self.covariance))

    def at_least(self, other: Robust) -> Robust:
        """The same, no parameter surer than `other` has it: D C D with D = diag(max(1, std_other / std)), positive as C is."""
        known = np.isfinite(self.std) & (self.std > 0.0)
        wider = np.where(known, np.maximum(1.0, other.std / np.where(known, self.std, 1.0)), 1.0)
        return Robust(wider[:, None] * self.covariance * wider, self.white and other.white, self.inflation * wider, self.orders)


@dataclass(frozen=True, eq=False)
class _Noise:
    """A cross-spectrum S = H L Lᴴ Hᴴ: H shapes each channel, L mixes them, constant within a band."""

    width: int  # parameters
    length: int  # samples of the Fourier transform
    shape: Complex  # (channels, frequencies)
    edges: Indices  # (bands + 1,)
    mix: Complex  # (bands, channels, channels) lower triangular
    orders: tuple[int, ...]
    white: bool


def robust_covariance(equations: Iterable[Block], solution: Solution, longest: int) -> Robust:
    """The covariance of `solution` by two passes over its equations; one where they are a single block, or the residual
    is white.

    Args:
        longest: samples of the longest block (`Statistics.longest`).
    """
    length = _good_length(longest + longest // _PADDING + 1)
    noises, alone = _noises(equations, solution, length)
    orders = tuple(order for noise in noises.values() for order in noise.orders)
    plain = np.diag(solution.covariance)
    if len(noises) == 1 and all(noise.white for noise in noises.values()):
        return Robust(solution.covariance, True, np.ones(len(plain)), orders)
    meat = np.zeros_like(solution.bread)
    for transformed in (alone,) if alone is not None else (_transform(block, length) for block in equations):
        meat += _meat(transformed, solution.weights, noises[transformed.noise])
    covariance = solution.bread @ meat @ solution.bread
    determined = solution.determined & (np.diag(covariance) >= 0.0)  # below 0 by rounding, of numbers next to undetermined
    inflation = np.sqrt(np.maximum(np.diag(covariance), 0.0) / np.where(plain > 0.0, plain, 1.0))
    covariance[~determined] = covariance[:, ~determined] = np.inf
    return Robust(covariance, False, np.where(determined, inflation, 1.0), orders)


@dataclass(frozen=True, eq=False)
class _Transformed:
    """The Fourier transforms a(f) of a block's columns."""

    columns: tuple[Indices, ...]
    spectra: tuple[Complex, ...]  # of each channel (k_j, frequencies)
    noise: int


def _transform(block: Block, length: int) -> _Transformed:
    return _Transformed(block.columns, tuple(np.fft.rfft(values, length, axis=1) for values in block.values), block.noise)


def _meat(block: _Transformed, weights: Array, noise: _Noise) -> Array:
    """1/n Σ_f conj(Z)ᵀ Z with Z = Lᴴ Hᴴ [w_j a_j(f)ᵀ]: S as a square keeps M positive."""
    width, bins = noise.width, noise.shape.shape[1]
    twice = np.full(bins, np.sqrt(2.0 / noise.length))  # negative frequencies
    twice[0] = np.sqrt(1.0 / noise.length)
    if noise.length % 2 == 0:
        twice[-1] = twice[0]
    meat = np.zeros((width, width))
    for a in range(len(weights)):
        felt = [j for j in range(a, len(weights)) if noise.mix[:, j, a].any()]
        factors = {j: weights[j] * twice * np.conj(noise.shape[j] * np.repeat(noise.mix[:, j, a], np.diff(noise.edges)))
                   for j in felt}
        if felt == [a]:  # its phase does not matter
            used, mixed = block.columns[a], block.spectra[a] * np.abs(factors[a])
        else:
            used = np.unique(np.concatenate([block.columns[j] for j in felt])) if felt else block.columns[a][:0]
            mixed = np.zeros((len(used), bins), dtype=np.complex128)
            for j in felt:
                mixed[np.searchsorted(used, block.columns[j])] += block.spectra[j] * factors[j]
        real = np.ascontiguousarray(mixed).view(np.float64)  # of columns stored with samples slowest it is not
        meat[np.ix_(used, used)] += real @ real.T
    return meat


class _Sums:
    """What blocks of one noise add up to."""

    def __init__(self, channels: int, bins: int) -> None:
        self.samples, self.longest, self.counts = 0, 0, np.zeros(channels)
        self.cross = np.zeros((channels, channels, bins), dtype=np.complex128)
        self.leverage = np.zeros((channels, bins))


def _noises(equations: Iterable[Block], solution: Solution, length: int) -> tuple[dict[int, _Noise], _Transformed | None]:
    """The residual's cross-spectrum, of each noise; also the transformed block where there is only one."""
    found, blocks, transformed = dict[int, _Sums](), 0, None
    for block in equations:
        own = found.setdefault(block.noise, _Sums(block.channels, length // 2 + 1))
        spectrum = np.fft.rfft(block.residual(solution.beta), length, axis=1)
        own.cross += spectrum[:, None] * np.conj(spectrum)
        transformed = _transform(block, length)
        own.leverage += _leverage(transformed, solution)
        own.samples, own.longest = own.samples + block.samples, max(own.longest, block.samples)
        own.counts, blocks = own.counts + block.counts, blocks + 1
    return {noise: _noise(own, solution, length) for noise, own in found.items()}, transformed if blocks == 1 else None


def _noise(sums: _Sums, solution: Solution, length: int) -> _Noise:
    samples, counts, channels = sums.samples, np.maximum(sums.counts, 1.0), len(sums.counts)
    cross = sums.cross / np.sqrt(counts[:, None] * counts)[:, :, None]  # equations left out have no noise
    gamma = np.fft.irfft(cross[np.arange(channels), np.arange(channels)], length, axis=1)
    most = min(_ORDER, samples // 20, sums.longest // 2)  # what is further apart than a block is long, no block tells
    fits = [_autoregression(g, samples, most) for g in gamma]
    shape = np.array([1.0 / np.fft.rfft(a, length) for a in fits])
    orders = tuple(len(a) - 1 for a in fits)
    edges = _edges(cross.shape[2], max(1, _BINS * length // samples))  # n samples have n / 2 frequencies of their own
    left = np.sqrt(1.0 - np.minimum(_mean(sums.leverage / counts[:, None], edges), _MOST_TAKEN))
    flat = cross / (shape[:, None] * np.conj(shape))
    mean = _mean(flat, edges) / (left[:, None] * left)
    together = _correlated(flat, mean, length, samples)
    if not together:
        mean[~np.eye(channels, dtype=bool)] = 0.0
    return _Noise(len(solution.beta), length, shape, edges, _factor(mean.transpose(2, 0, 1)), orders,
                  not any(orders) and not together)


def _leverage(block: _Transformed, solution: Solution) -> Array:
    """w aᴴ C a (channels, frequencies): the share of the noise that the parameters take up, frequency by frequency.

    It is largest where the columns are, which is where S matters: E|r|² = (1 - h) S.
    """
    rows = []
    for index, spectra, w in zip(block.columns, block.spectra, solution.weights, strict=True):
        values, vectors = np.linalg.eigh(solution.bread[np.ix_(index, index)])
        part = (vectors * np.sqrt(np.maximum(w * values, 0.0))).T @ spectra
        rows.append(np.square(part.real).sum(axis=0) + np.square(part.imag).sum(axis=0))
    return np.array(rows)


def _mean(values: Any, edges: Indices) -> Any:
    """Averages over bands of the last axis."""
    return np.add.reduceat(values, edges[:-1], axis=-1) / np.diff(edges)


def _autoregression(gamma: Array, samples: int, most: int) -> Array:
    """Coefficients [1, a_1, …] of the order that Schwarz's criterion prefers.

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


def _edges(bins: int, width: int) -> Indices:
    """Bands of about `width` bins, all alike to one bin."""
    return np.linspace(0, bins, max(1, bins // width) + 1).astype(np.intp)


def _factor(spectrum: Complex) -> Complex:
    """Lower triangular L with L Lᴴ = S for each band; a channel without noise gets a row of zeros."""
    power = np.einsum("bjj->bj", spectrum).real
    scale = np.sqrt(np.where(power > 0.0, power, 1.0))
    unit = spectrum / scale[:, :, None] / scale[:, None, :]
    unit += 1e-12 * np.eye(unit.shape[1])  # channels may be exact multiples of one another
    return np.asarray(np.linalg.cholesky(unit + np.where(power > 0.0, 0.0, 1.0)[:, :, None] * np.eye(unit.shape[1]))
                      * np.where(power > 0.0, scale, 0.0)[:, :, None])


def _correlated(flat: Complex, mean: Complex, length: int, samples: int) -> bool:
    """Return whether two channels go together beyond chance: at the same instant or a little apart, or within a band.

    Of channels that are independent, coherence over n frequencies exceeds c with probability exp(-n c) at most.
    """
    apart = ~np.eye(len(flat), dtype=bool)
    lags = min(_LAGS, length // 2)
    covariance = np.fft.irfft(flat[apart], length, axis=1)[:, [*range(lags), *range(-lags, 0)]]
    power = np.einsum("jjf->jf", flat).real.mean(axis=1)
    if np.any(np.abs(covariance) * np.sqrt(samples) > _CROSS * np.sqrt(power[:, None] * power)[apart][:, None]):
        return True
    each = np.einsum("jjb->jb", mean).real
    frequencies = flat.shape[2] * min(1.0, samples / length) / mean.shape[2]
    coherent = np.square(np.abs(mean)) * frequencies > _COHERENT * each[:, None] * each
    return bool(np.any(coherent[apart]))


def _good_length(least: int) -> int:
    """The smallest 2^a 3^b 5^c not below `least`: transforms of such lengths are fast."""
    best = 1 << (least - 1).bit_length()
    five = 1
    while five < best:
        three = five
        while three < best:
            two = three << max(0, (-(-least // three) - 1).bit_length())
            best = min(best, two)
            three *= 3
        five *= 5
    return best
