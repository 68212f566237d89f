"""Rate an experiment by a smooth number of its information, with the derivative.

Group j of equations of equal noise σ_j contributes S_j = A_jᵀ A_j / n (parameters, parameters):

    Φᵀ Φ/n = Σ_j S_j          of which the condition is taken
    M = Σ_j S_j/σ_j²          of which D and A are taken

Of a matrix with eigenvalues λ are minimised

    condition    ½ log(λ_max/λ_min) = log cond Φ; smooth: ½ (log tr Mᵖ + log tr M⁻ᵖ)/p, from above
    D            -½ log det M / parameters, the volume of the confidence ellipsoid
    A            ½ log Σ_k g_k (M⁻¹)_kk, the standard deviation, parameters weighed by g

Pukelsheim 1993, ch. 6; Swevers et al. 1997 for D on robots. A ceiling on the condition number is a
penalty that hardens as p grows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Array
from pipelines.excitation.config import CONFIG

__all__ = ["CRITERIA", "FAR", "Figures", "Goal", "Spectrum", "a_optimal", "condition", "d_optimal",
           "spectrum"]

CRITERIA = ("condition", "D", "A")
FAR = 1e6  # numerics: added to the logarithm of a condition number above its ceiling
ROUNDING = 1e-6  # numerics: relative, of a condition number on another number of samples
LARGEST = 500.0  # numerics: of an exponent


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Eigenvalues, smallest first, and eigenvectors of an information matrix."""

    values: Array  # λ (parameters,)
    vectors: Array  # (parameters, parameters), columns

    @property
    def condition(self) -> float:
        """Condition number of Φ, not of M = ΦᵀΦ/n."""
        return float(np.sqrt(self.values[-1] / self.values[0]))

    def of(self, weights: Array) -> Array:
        """Return V diag(weights) Vᵀ."""
        return np.asarray((self.vectors * weights) @ self.vectors.T)

    @property
    def covariance(self) -> Array:
        """M⁻¹."""
        return self.of(1.0 / self.values)


def spectrum(information: Array) -> Spectrum:
    """Decompose a symmetric matrix; rounding below zero becomes next to nothing."""
    values, vectors = np.linalg.eigh(information)
    return Spectrum(np.maximum(values, 1e-15 * max(float(values[-1]), 1e-300)), vectors)


def condition(found: Spectrum, p: float) -> tuple[float, Array]:
    """Return ½ (log tr Mᵖ + log tr M⁻ᵖ)/p, at least log cond Φ, and its derivative by M."""
    rising, high = _log_power_sum(found.values, p)
    falling, low = _log_power_sum(1.0 / found.values, p)
    return 0.5 * (rising + falling), found.of(0.5 * (high - low) / found.values)


def d_optimal(found: Spectrum) -> tuple[float, Array]:
    """Return -½ log det M / parameters and its derivative by M."""
    count = len(found.values)
    return -0.5 * float(np.log(found.values).sum()) / count, found.of(-0.5 / count / found.values)


def a_optimal(found: Spectrum, weights: Array) -> tuple[float, Array]:
    """Return ½ log Σ_k g_k (M⁻¹)_kk, weights g (parameters,), and its derivative by M."""
    inverse = found.covariance
    total = float(weights @ np.diag(inverse))
    return 0.5 * float(np.log(total)), (inverse * weights) @ inverse * (-0.5 / total)


def _log_power_sum(values: Array, p: float) -> tuple[float, Array]:
    """Return (log Σ λᵖ)/p and each share λᵖ/Σ λᵖ, without overflow."""
    logs = p * np.log(values)
    terms = np.exp(logs - logs.max())
    total = terms.sum()
    return float((logs.max() + np.log(total)) / p), terms / total


@dataclass(frozen=True)
class Figures:
    """All criteria of one design."""

    condition_number: float  # of Φ
    predicted_relative_std: float  # √(mean (std_k/size_k)²) of one experiment


@dataclass(frozen=True, eq=False)
class Goal:
    """Define the criterion of the information `grams` S (joints, columns, columns)."""

    criterion: str  # one of `CRITERIA`
    kept: npt.NDArray[np.intp]  # columns that are estimated
    noise: Array  # σ_j (joints,)
    sizes: Array  # (columns,) what a standard deviation is compared with
    samples: int  # of one experiment
    ceiling: float | None = None  # of the condition number
    earlier: Array | None = None  # S of earlier experiments, which is added

    def value(self, grams: Array, sharpness: float) -> tuple[float, Array, float]:
        """Return the criterion, its derivative by `grams`, and the exact figure of a design."""
        plain = self._plain(grams)
        bar, on_plain = np.zeros_like(grams), np.zeros_like(plain.vectors)
        if self.criterion in ("D", "A"):
            weighed = self._weighed(grams)
            value, on_weighed = (d_optimal(weighed) if self.criterion == "D"
                                 else a_optimal(weighed, self._weights))
            score = value
            bar[:, self.kept[:, None], self.kept] = on_weighed / self.noise[:, None, None] ** 2
        else:
            (value, on_plain), score = condition(plain, sharpness), plain.condition
        if self.ceiling is not None:
            # steep · log(1 + exp(s (f - log ceiling)))/s, f the smooth log of the condition number
            above, on_above = condition(plain, sharpness)
            excess = sharpness * (above - math.log(self.ceiling))
            soft = max(excess, 0.0) + math.log1p(math.exp(-abs(excess)))
            share = 1.0 / (1.0 + math.exp(-min(max(excess, -LARGEST), LARGEST)))
            value += CONFIG.steep * soft / sharpness
            on_plain = on_plain + CONFIG.steep * share * on_above
            if plain.condition > self.ceiling:
                score = FAR + math.log(plain.condition)
        bar[:, self.kept[:, None], self.kept] += on_plain
        return value, bar, score

    def _plain(self, grams: Array) -> Spectrum:
        """Return the spectrum of ΦᵀΦ/n."""
        return self._spectrum(grams, np.ones(len(grams)))

    def _weighed(self, grams: Array) -> Spectrum:
        """Return the spectrum of M."""
        return self._spectrum(grams, self.noise**-2.0)

    def _spectrum(self, grams: Array, weights: Array) -> Spectrum:
        if self.earlier is not None:
            grams = grams + self.earlier
        whole = np.tensordot(weights, grams, axes=1)
        return spectrum(whole[np.ix_(self.kept, self.kept)])

    @property
    def _weights(self) -> Array:
        """g_k = 1/size_k², over their number."""
        return np.asarray(self.sizes[self.kept] ** -2.0 / len(self.kept))

    def meets(self, condition_number: float) -> bool:
        """Return whether a condition number is below the ceiling, if there is one."""
        return self.ceiling is None or condition_number <= self.ceiling * (1.0 + ROUNDING)

    def figures(self, grams: Array) -> Figures:
        """Return all criteria, whichever is minimised."""
        plain, weighed = self._plain(grams), self._weighed(grams)
        variance = float(self._weights @ np.diag(weighed.covariance)) / self.samples
        return Figures(plain.condition, math.sqrt(variance))

    def std(self, grams: Array) -> Array:
        """Return the standard deviation (columns,) of one experiment; NaN where not estimated."""
        out = np.full(len(self.sizes), np.nan)
        out[self.kept] = np.sqrt(np.diag(self._weighed(grams).covariance) / self.samples)
        return out
