"""Friction of one joint against its speed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import tanh
from typing import Protocol, Self

import numpy as np

__all__ = ["CoulombViscous", "Friction", "ThreeSigmoid"]


class Friction(Protocol):
    """A law of friction: torque that opposes the speed [N m], odd in it."""

    @property
    def coulomb(self) -> float:
        """Its dry part at high speed [N m]."""
        ...

    @property
    def viscous(self) -> float:
        """Its slope at high speed [N m s/rad]."""
        ...

    @property
    def sharpness(self) -> float:
        """Inverse of the speed over which its dry part changes sign [s/rad]."""
        ...

    def law(self) -> Callable[[float], float]:
        """Speed [rad/s] -> torque [N m], as fast as Python allows: it runs at every stage of every inner step."""
        ...

    def drawn(self, rng: np.random.Generator, share: float) -> Self:
        """The same law, its torques each within ± `share` of these."""
        ...


@dataclass(frozen=True)
class CoulombViscous:
    """τ = Fc tanh(w v) + Fv v."""

    coulomb: float = 0.0  # [N m]
    viscous: float = 0.0  # [N m s/rad]
    sharpness: float = 100.0  # [s/rad]

    def law(self) -> Callable[[float], float]:
        fc, fv, w = self.coulomb, self.viscous, self.sharpness
        return lambda v: fc * tanh(w * v) + fv * v

    def drawn(self, rng: np.random.Generator, share: float) -> Self:
        coulomb, viscous = (1.0 + rng.uniform(-share, share, 2)).tolist()
        return replace(self, coulomb=self.coulomb * coulomb, viscous=self.viscous * viscous)


@dataclass(frozen=True)
class ThreeSigmoid:
    """τ = Σ_k f_k tanh(w_k v) + b v, Kostić et al. 2004, eq. (10)."""

    heights: tuple[float, float, float]  # [N m]
    sharpnesses: tuple[float, float, float]  # [s/rad]
    viscous: float  # [N m s/rad]

    @property
    def coulomb(self) -> float:
        return sum(self.heights)

    @property
    def sharpness(self) -> float:
        return self.sharpnesses[0]  # of the highest sigmoid

    def law(self) -> Callable[[float], float]:
        (f1, f2, f3), (w1, w2, w3), b = self.heights, self.sharpnesses, self.viscous
        return lambda v: f1 * tanh(w1 * v) + f2 * tanh(w2 * v) + f3 * tanh(w3 * v) + b * v

    def drawn(self, rng: np.random.Generator, share: float) -> Self:
        f1, f2, f3, b = (1.0 + rng.uniform(-share, share, 4)).tolist()
        heights = (self.heights[0] * f1, self.heights[1] * f2, self.heights[2] * f3)
        return replace(self, heights=heights, viscous=self.viscous * b)
