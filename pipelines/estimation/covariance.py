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
bands: an autoregression alone misses what a sharp filter does, averages alone smear a peak. Memory:
the transform of one block, every block padded to the longest.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.estimation.config import UncertaintyConfig
from pipelines.estimation.filters import fast_length
from pipelines.estimation.least_squares import Block, Solution
from pipelines.io.log import Array

Complex = npt.NDArray[np.complex128]

_CONFIG = UncertaintyConfig()
_PADDING = 8  # numerics: an eighth of a block of zeros, so that its end is far from its beginning
_ALIKE = 1e-12  # numerics: channels may be exact multiples of one another


@dataclass(frozen=True, eq=False)
class Robust:
    """The covariance of β, with what was learnt of the residual."""

    covariance: Array  # (k, k); infinite where β is not determined
    white: bool  # the residual can pass for white of one strength, its channels for independent
    inflation: Array  # (k,) standard deviation over that of white noise

    @property
    def std(self) -> Array:
        return np.sqrt(np.diag(self.covariance))


def robust_covariance(equations: Iterable[Block], solution: Solution, longest: int) -> Robust:
    """Return the covariance of `solution` by two passes over its equations; one of white noise.

    Args:
        longest: samples of the longest block (`Statistics.longest`).
    """
    length = fast_length(longest + longest // _PADDING + 1)
    noise = _spectrum(equations, solution, length)
    plain = np.diag(solution.covariance)
    if noise is None:
        return Robust(solution.covariance, True, np.ones(len(plain)))
    meat = np.zeros_like(solution.bread)
    for block in equations:
        _add_meat(meat, block, solution.weights, noise, length)
    covariance = solution.bread @ meat @ solution.bread
    # below 0 by rounding, of numbers next to undetermined ones
    determined = solution.determined & (np.diag(covariance) >= 0.0)
    variance = np.maximum(np.diag(covariance), 0.0)
    inflation = np.sqrt(variance / np.where(plain > 0.0, plain, 1.0))
    covariance[~determined] = covariance[:, ~determined] = np.inf
    return Robust(covariance, False, np.where(determined, inflation, 1.0))


def _add_meat(meat: Array, block: Block, weights: Array, noise: Complex, length: int) -> None:
    """Add 1/n Σ_f conj(Z)ᵀ Z with Z = Nᴴ [w_j a_j(f)ᵀ], S = N Nᴴ: as a square M stays positive.

    Args:
        noise: N (channels, channels, frequencies), lower triangular.
    """
    spectra = [np.fft.rfft(values, length, axis=1) for values in block.values]
    twice = np.full(noise.shape[2], np.sqrt(2.0 / length))  # negative frequencies
    twice[0] = np.sqrt(1.0 / length)
    if length % 2 == 0:
        twice[-1] = twice[0]
    for source in range(len(weights)):
        felt = [j for j in range(len(weights)) if noise[j, source].any()]
        if not felt:
            continue
        used = np.unique(np.concatenate([block.columns[j] for j in felt]))
        mixed = np.zeros((len(used), noise.shape[2]), dtype=np.complex128)
        for j in felt:
            factor = weights[j] * twice * np.conj(noise[j, source])
            mixed[np.searchsorted(used, block.columns[j])] += spectra[j] * factor
        real = mixed.view(np.float64)
        meat[np.ix_(used, used)] += real @ real.T


def _spectrum(equations: Iterable[Block], solution: Solution, length: int) -> Complex | None:
    """Return N (channels, channels, frequencies), the residual's cross-spectrum S = N Nᴴ.

    None where the residual can pass for white.
    """
    channels, bins = len(solution.weights), length // 2 + 1
    cross = np.zeros((channels, channels, bins), dtype=np.complex128)
    leverage, counts = np.zeros((channels, bins)), np.zeros(channels)
    samples = longest = 0
    for block in equations:
        residual = np.fft.rfft(block.residual(solution.beta), length, axis=1)
        cross += residual[:, None] * np.conj(residual)
        leverage += _leverage(block, solution, length)
        samples, longest = samples + block.samples, max(longest, block.samples)
        counts += block.counts
    counts = np.maximum(counts, 1.0)
    cross /= np.sqrt(counts[:, None] * counts)[:, :, None]  # equations left out have no noise
    own = np.arange(channels)
    gamma = np.fft.irfft(cross[own, own], length, axis=1)
    # what is further apart than a block is long, no block tells
    most = min(_CONFIG.order, samples // 20, longest // 2)
    fits = [_autoregression(g, samples, most) for g in gamma]
    shape = np.array([1.0 / np.fft.rfft(a, length) for a in fits])
    # n samples have n / 2 frequencies of their own
    width = max(1, _CONFIG.bins * length // samples)
    edges = np.linspace(0, bins, max(1, bins // width) + 1).astype(np.intp)
    taken = np.minimum(_mean(leverage / counts[:, None], edges), _CONFIG.most_taken)
    left = np.sqrt(1.0 - taken)
    flat = cross / (shape[:, None] * np.conj(shape))
    mean = _mean(flat, edges) / (left[:, None] * left)
    together = _correlated(flat, mean, length, samples)
    if not together:
        if all(len(a) == 1 for a in fits):
            return None
        mean[~np.eye(channels, dtype=bool)] = 0.0
    mix = np.repeat(_root(mean.transpose(2, 0, 1)), np.diff(edges), axis=0)
    return np.asarray(shape[:, None] * mix.transpose(1, 2, 0))


def _leverage(block: Block, solution: Solution, length: int) -> Array:
    """w aᴴ C a (channels, frequencies): the share of the noise that the parameters take up.

    It is largest where the columns are, which is where S matters: E|r|² = (1 - h) S.
    """
    rows = []
    for index, values, w in zip(block.columns, block.values, solution.weights, strict=True):
        size, vectors = np.linalg.eigh(solution.bread[np.ix_(index, index)])
        turned = (vectors * np.sqrt(np.maximum(w * size, 0.0))).T @ values
        rows.append(np.square(np.abs(np.fft.rfft(turned, length, axis=1))).sum(axis=0))
    return np.array(rows)


def _mean(values: Any, edges: npt.NDArray[np.intp]) -> Any:
    """Return averages over bands of the last axis."""
    return np.add.reduceat(values, edges[:-1], axis=-1) / np.diff(edges)


def _autoregression(gamma: Array, samples: int, most: int) -> Array:
    """Return the coefficients [1, a_1, …] of the order that Schwarz's criterion prefers.

    Levinson 1947, Durbin 1960; Schwarz 1978: N log σ² + order · log N.
    """
    a, power = np.ones(1), float(gamma[0])
    best, least = a, 0.0
    for order in range(1, most + 1):
        if power <= 1e-13 * gamma[0]:
            break
        reflection = -float(a @ gamma[order:0:-1]) / power
        a = np.append(a, 0.0)
        a = a + reflection * a[::-1]
        power *= 1.0 - reflection**2
        criterion = samples * np.log(max(power / gamma[0], 1e-300)) + order * np.log(samples)
        if criterion < least:
            best, least = a, criterion
    return best


def _root(spectrum: Complex) -> Complex:
    """Return lower triangular L with L Lᴴ = S for each band; zero of a channel without noise."""
    power = np.einsum("bjj->bj", spectrum).real
    scale = np.sqrt(np.where(power > 0.0, power, 1.0))
    eye = np.eye(power.shape[1]) * (_ALIKE + (power <= 0.0))[:, :, None]
    root = np.linalg.cholesky(spectrum / scale[:, :, None] / scale[:, None, :] + eye)
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
