"""What a design is to achieve, as a smooth number of the Gram matrices of its equations.

The equations come in groups of equal noise. Group j contributes S_j = A_jᵀ A_j / n (parameters, parameters), and

    Φᵀ Φ/n = Σ_j S_j                        the plain information matrix, of which condition, Frobenius and E are taken
    M = Σ_j S_j/σ_j²                        weighed by noise, of which D and A are taken

Information that earlier experiments left is added to S. A ceiling on the condition number is a penalty that begins softly and
hardens as the sharpness grows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.fit.design.criteria import (
    Spectrum,
    a_optimal,
    condition,
    d_optimal,
    e_optimal,
    frobenius,
    spectrum,
)

__all__ = ["FAR", "Figures", "Goal"]

Array = npt.NDArray[np.float64]

_STEEP = 10.0  # of the penalty, far above the ceiling: it outweighs what A or D could gain
_ROUNDED = 1e-6  # beyond the ceiling: what a motion that lies on it has on another number of samples
FAR = 1e6  # a design above the ceiling is worse than any below it: its figure is this and the logarithm of its condition number


@dataclass(frozen=True)
class Figures:
    """All criteria of one design, as they are called."""

    condition_number: float  # of Φ
    frobenius: float  # ‖Φ‖ ‖Φ⁺‖
    smallest_singular_value: float  # of Φ/√n
    log_determinant: float  # log det M
    relative_std: float  # √(mean (std_k/size_k)²) of one experiment of `samples` samples


@dataclass(frozen=True, eq=False)
class Goal:
    """What is minimised."""

    criterion: str  # one of `CRITERIA`
    plain: npt.NDArray[np.intp]  # parameters that condition, Frobenius and E look at
    weighed: npt.NDArray[np.intp]  # parameters that are estimated: D and A look at them
    judged: npt.NDArray[np.intp]  # those of them whose standard deviation counts in A
    noise: Array  # σ_j (groups,)
    sizes: Array  # (all parameters,) what a standard deviation is compared with
    samples: int  # of one experiment
    ceiling: float | None = None  # of the condition number
    earlier: Array | None = None  # (groups, all parameters, all parameters) information of earlier experiments, as S

    def value(self, grams: Array, sharpness: float) -> tuple[float, Array, float]:
        """(what is minimised, its derivative by `grams` (groups, all, all), the exact figure that designs are ranked by)."""
        grams = self._with_earlier(grams)
        bar = np.zeros_like(grams)
        plain = spectrum(grams.sum(axis=0)[np.ix_(self.plain, self.plain)])
        value, score = 0.0, 0.0
        on_plain = np.zeros_like(plain.vectors)
        if self.criterion in ("D", "A"):
            value, on_weighed = self._weighed(grams)
            score = value
            bar[:, self.weighed[:, None], self.weighed] = on_weighed / self.noise[:, None, None] ** 2
        else:
            value, on_plain, score = self._plain(plain, sharpness)
        if self.ceiling is not None:
            value, on_plain = self._below(plain, sharpness, value, on_plain)
            if plain.condition > self.ceiling:
                score = FAR + math.log(plain.condition)
        bar[:, self.plain[:, None], self.plain] += on_plain
        return value, bar, score

    def _with_earlier(self, grams: Array) -> Array:
        return grams if self.earlier is None else grams + self.earlier

    def _plain(self, plain: Spectrum, sharpness: float) -> tuple[float, Array, float]:
        if self.criterion == "condition":
            return *condition(plain, sharpness), plain.condition
        if self.criterion == "E":
            return *e_optimal(plain, sharpness), -0.5 * math.log(plain.values[0])
        value, bar = frobenius(plain)
        return value, bar, value

    def _weighed(self, grams: Array) -> tuple[float, Array]:
        found = spectrum(self._information(grams))
        if self.criterion == "D":
            return d_optimal(found)
        return a_optimal(found, self._shares)

    @property
    def _shares(self) -> Array:
        """g_k = 1/size_k² of what is judged, over their number; zero for the rest of what is estimated."""
        return np.where(np.isin(self.weighed, self.judged), self.sizes[self.weighed] ** -2.0, 0.0) / len(self.judged)

    def _information(self, grams: Array) -> Array:
        whole = np.tensordot(self.noise**-2.0, grams, axes=1)
        return np.asarray(whole[np.ix_(self.weighed, self.weighed)])

    def _below(self, plain: Spectrum, sharpness: float, value: float, bar: Array) -> tuple[float, Array]:
        """Add steep · log(1 + exp(s (f - log ceiling)))/s, with f the smooth logarithm of the condition number."""
        above, on_above = condition(plain, sharpness)
        excess = sharpness * (above - math.log(self.ceiling or 1.0))
        share = 1.0 / (1.0 + math.exp(-max(min(excess, 500.0), -500.0)))
        soft = max(excess, 0.0) + math.log1p(math.exp(-abs(excess)))
        return value + _STEEP * soft / sharpness, bar + _STEEP * share * on_above

    def figures(self, grams: Array) -> Figures:
        """All criteria, whichever is minimised."""
        grams = self._with_earlier(grams)
        plain = spectrum(grams.sum(axis=0)[np.ix_(self.plain, self.plain)])
        weighed = spectrum(self._information(grams))
        variance = float(self._shares @ np.diag(weighed.covariance)) / self.samples
        return Figures(plain.condition, math.exp(frobenius(plain)[0]), math.sqrt(plain.values[0]),
                       float(np.log(weighed.values).sum()), math.sqrt(variance))

    def meets(self, condition_number: float) -> bool:
        """Return whether that is below the ceiling, if there is one."""
        return self.ceiling is None or condition_number <= self.ceiling * (1.0 + _ROUNDED)

    def singular_values(self, grams: Array) -> Array:
        """Of Φ/√n, largest first."""
        grams = self._with_earlier(grams)
        return np.sqrt(spectrum(grams.sum(axis=0)[np.ix_(self.plain, self.plain)]).values[::-1])

    def std(self, grams: Array) -> Array:
        """Standard deviation (all parameters,) of one experiment; undefined where a parameter is not estimated."""
        grams = self._with_earlier(grams)
        out = np.full(len(self.sizes), np.nan)
        out[self.weighed] = np.sqrt(np.diag(spectrum(self._information(grams)).covariance) / self.samples)
        return out
