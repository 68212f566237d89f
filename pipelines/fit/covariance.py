"""Standard deviations that allow for a residual with a memory.

Filtering, decimation and what a model lacks leave a residual whose samples depend on one another, from sample to sample
and from channel to channel. The estimate stays unbiased; its covariance is the sandwich (White 1980; Newey & West 1987)

    C M C,    C = (Σ_j w_j A_jᵀ A_j)⁻¹,    M = Σ_ij w_i w_j Σ_kl a_i(k) γ_ij(k - l) a_j(l)ᵀ

Newey & West estimate M from products of residuals and regressors. Here the noise is taken as stationary and only its
cross-spectrum S is estimated, far fewer numbers from the same samples, so that ten seconds are enough:

    M = 1/n Σ_f Σ_ij w_i w_j conj(a_i(f)) S_ij(f) a_j(f)ᵀ,   a(f) the Fourier transform of a channel's columns

S is prewhitened by an autoregression of each channel (Andrews & Monahan 1992), then averaged over bands: an autoregression
alone misses what a sharp filter does, averages alone smear a peak.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.fit.equations import Array, Block
from pipelines.fit.least_squares import Solution

__all__ = ["Robust", "robust_covariance"]

Complex = npt.NDArray[np.complex128]

_ORDER = 24  # of the autoregressions at most
_BINS = 40  # independent frequencies in a band: its power is then known to 16 %
_PADDING = 8  # an eighth of a block of zeros, so that its end does not touch its beginning
_CROSS = 4.0  # standard deviations of a correlation between channels that is not chance


@dataclass(frozen=True, eq=False)
class Robust:
    """The covariance of β, with what was learnt of the residual."""

    covariance: Array  # (k, k); infinite where β is not determined
    white: bool  # whether the residual can pass for white and its channels for independent
    inflation: Array  # (k,) standard deviation over that of white noise
    orders: tuple[int, ...]  # of each channel's autoregression

    @property
    def std(self) -> Array:
        return np.sqrt(np.diag(self.covariance))


@dataclass(frozen=True, eq=False)
class _Noise:
    """A cross-spectrum S = H L Lᴴ Hᴴ: H shapes each channel, L mixes them, constant within a band."""

    length: int  # samples of the Fourier transform
    shape: Complex  # (channels, frequencies)
    edges: npt.NDArray[np.intp]  # (bands + 1,)
    mix: Complex  # (bands, channels, channels) lower triangular
    orders: tuple[int, ...]
    white: bool


def robust_covariance(equations: Iterable[Block], solution: Solution, longest: int) -> Robust:
    """The covariance of `solution` by two passes over its equations, one where the residual is white.

    Args:
        longest: samples of the longest block (`Statistics.longest`).
    """
    noise = _noise(equations, solution, _good_length(longest + longest // _PADDING + 1))
    plain = np.diag(solution.covariance)
    if noise.white:
        return Robust(solution.covariance, True, np.ones(len(plain)), noise.orders)
    meat = np.zeros_like(solution.bread)
    for block in equations:
        meat += _block_meat(block, solution.weights, noise)
    covariance = solution.bread @ meat @ solution.bread
    inflation = np.sqrt(np.diag(covariance) / np.where(plain > 0.0, plain, 1.0))
    covariance[~solution.determined] = covariance[:, ~solution.determined] = np.inf
    return Robust(covariance, False, np.where(solution.determined, inflation, 1.0), noise.orders)


def _block_meat(block: Block, weights: Array, noise: _Noise) -> Array:
    """1/n Σ_f conj(Z)ᵀ Z with Z = Lᴴ Hᴴ [w_j a_j(f)ᵀ]: S as a square keeps M positive."""
    bins = noise.shape.shape[1]
    spectra = [np.fft.rfft(values, noise.length, axis=1) * (w * np.conj(h)) for values, w, h in
               zip(block.values, weights, noise.shape, strict=True)]
    twice = np.full(bins, np.sqrt(2.0 / noise.length))  # negative frequencies
    twice[0] = np.sqrt(1.0 / noise.length)
    if noise.length % 2 == 0:
        twice[-1] = twice[0]
    wide = np.repeat(noise.mix, np.diff(noise.edges), axis=0)  # (frequencies, channels, channels)
    meat = np.zeros((block.width, block.width))
    for a in range(block.channels):
        mixed = np.zeros((block.width, bins), dtype=np.complex128)
        for j in range(a, block.channels):
            factor = np.conj(wide[:, j, a])
            if factor.any():
                mixed[block.columns[j]] += spectra[j] * (factor * twice)
        used = np.flatnonzero(mixed.any(axis=1))
        real = np.ascontiguousarray(mixed[used]).view(np.float64)
        meat[np.ix_(used, used)] += real @ real.T
    return meat


def _noise(equations: Iterable[Block], solution: Solution, length: int) -> _Noise:
    """The residual's cross-spectrum, its power made good for what the parameters took."""
    channels, samples = len(solution.sigma), 0
    cross = np.zeros((channels, channels, length // 2 + 1), dtype=np.complex128)
    for residual in _residuals(equations, solution):
        spectrum = np.fft.rfft(residual, length, axis=1)
        cross += spectrum[:, None] * np.conj(spectrum)
        samples += residual.shape[1]
    taken = np.sqrt(samples / solution.freedom)
    cross *= (taken[:, None] * taken / samples)[:, :, None]
    gamma = np.fft.irfft(cross[np.arange(channels), np.arange(channels)], length, axis=1)
    fits = [_autoregression(g, samples, min(_ORDER, samples // 20)) for g in gamma]
    shape = np.array([1.0 / np.fft.rfft(a, length) for a in fits])
    orders = tuple(len(a) - 1 for a in fits)
    edges = _edges(cross.shape[2], max(1, _BINS * length // max(samples, length)))
    flat = cross / (shape[:, None] * np.conj(shape))
    mean: Complex = np.asarray(np.add.reduceat(flat, edges[:-1], axis=2) / np.diff(edges), dtype=np.complex128)
    return _Noise(length, shape, edges, _factor(mean.transpose(2, 0, 1)), orders,
                  not any(orders) and not _correlated(cross, samples))


def _residuals(equations: Iterable[Block], solution: Solution) -> Iterator[Array]:
    return (block.residual(solution.beta) for block in equations)


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


def _edges(bins: int, width: int) -> npt.NDArray[np.intp]:
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


def _correlated(cross: Complex, samples: int) -> bool:
    """Whether two channels are correlated at the same instant beyond chance."""
    covariance = 2.0 * cross[:, :, 1:].real.sum(axis=2) + cross[:, :, 0].real
    std = np.sqrt(np.diag(covariance))
    apart = covariance - np.diag(np.diag(covariance))
    return bool(np.any(np.abs(apart) * np.sqrt(samples) > _CROSS * std[:, None] * std))


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
