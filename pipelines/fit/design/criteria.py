"""How good an experiment is, as a number of its information matrix: smooth, with its derivative.

With M = ΦᵀΦ/n (parameters, parameters) and λ its eigenvalues, all to be minimised, all without unit but for a constant:

    condition    ½ log(λ_max/λ_min) = log cond Φ; smooth: ½ (log tr Mᵖ + log tr M⁻ᵖ)/p, from above and ever closer as p grows
    frobenius    ½ log(tr M tr M⁻¹), the logarithm of the Frobenius condition number ‖Φ‖ ‖Φ⁺‖
    E            -½ log λ_min, the worst direction; smooth: ½ log tr M⁻ᵖ / p
    D            -½ log det M / parameters, the volume of the confidence ellipsoid
    A            ½ log Σ_k g_k (M⁻¹)_kk, the standard deviation, parameters weighed by g

Pukelsheim 1993, ch. 6 (E, D and A are members of one family of matrix means); Swevers et al. 1997 for D on robots.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["CRITERIA", "Spectrum", "a_optimal", "condition", "d_optimal", "e_optimal", "frobenius", "spectrum"]

Array = npt.NDArray[np.float64]

_TINY = 1e-300
CRITERIA = ("condition", "frobenius", "E", "D", "A")


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Eigenvalues, smallest first, and eigenvectors of an information matrix."""

    values: Array  # λ (parameters,)
    vectors: Array  # (parameters, parameters), columns

    @property
    def condition(self) -> float:
        """Condition number of Φ, not of M = ΦᵀΦ/n."""
        return float(np.sqrt(self.values[-1] / self.values[0])) if self.values[0] > 0.0 else float("inf")

    def of(self, weights: Array) -> Array:
        """V diag(weights) Vᵀ."""
        return np.asarray((self.vectors * weights) @ self.vectors.T)

    @property
    def covariance(self) -> Array:
        """M⁻¹."""
        return self.of(1.0 / self.values)


def spectrum(information: Array) -> Spectrum:
    """Decompose a symmetric matrix; rounding below zero becomes next to nothing."""
    values, vectors = np.linalg.eigh(information)
    return Spectrum(np.maximum(values, 1e-15 * max(float(values[-1]), _TINY)), vectors)




def condition(found: Spectrum, p: float) -> tuple[float, Array]:
    """½ (log tr Mᵖ + log tr M⁻ᵖ)/p, at least log cond Φ."""
    rising, high = _log_power_sum(found.values, p)
    falling, low = _log_power_sum(1.0 / found.values, p)
    return 0.5 * (rising + falling), found.of(0.5 * (high - low) / found.values)


def e_optimal(found: Spectrum, p: float) -> tuple[float, Array]:
    """½ log tr M⁻ᵖ / p, at least -½ log λ_min."""
    value, share = _log_power_sum(1.0 / found.values, p)
    return 0.5 * value, found.of(-0.5 * share / found.values)


def frobenius(found: Spectrum) -> tuple[float, Array]:
    """½ log(tr M tr M⁻¹)."""
    total, inverse = float(found.values.sum()), float((1.0 / found.values).sum())
    return 0.5 * float(np.log(total * inverse)), found.of(0.5 / total - 0.5 / inverse / found.values**2)


def d_optimal(found: Spectrum) -> tuple[float, Array]:
    """-½ log det M / parameters."""
    count = len(found.values)
    return -0.5 * float(np.log(found.values).sum()) / count, found.of(-0.5 / count / found.values)


def a_optimal(found: Spectrum, weights: Array) -> tuple[float, Array]:
    """½ log Σ_k g_k (M⁻¹)_kk; `weights` g (parameters,)."""
    inverse = found.covariance
    total = float(weights @ np.diag(inverse))
    return 0.5 * float(np.log(total)), (inverse * weights) @ inverse * (-0.5 / total)


def _log_power_sum(values: Array, p: float) -> tuple[float, Array]:
    """(log Σ λᵖ)/p and each share λᵖ/Σ λᵖ, without overflow."""
    logs = p * np.log(values)
    top = logs.max()
    terms = np.exp(logs - top)
    total = terms.sum()
    return float((top + np.log(total)) / p), terms / total
