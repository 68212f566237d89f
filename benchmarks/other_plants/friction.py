"""Dry friction of a plant's joints, by one law for all of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.io.log import Array


@dataclass(frozen=True, eq=False)
class Friction:
    """A law of dry friction for all joints, and viscous friction. All (joints,)."""

    kind: str  # "tanh", "root", "arctan", "stribeck", "lugre"
    coulomb: Array  # [N m]
    viscous: Array  # [N m s/rad]
    width: Array  # [rad/s] over which dry friction changes its sign; of "lugre" [rad] of presliding
    slow: Array  # [rad/s] Stribeck's speed of "stribeck" and "lugre"
    breakaway: float = 1.5  # of the Coulomb friction, in "stribeck" and "lugre"

    def dry(self, v: Array) -> Array:
        """Friction without memory [N m]."""
        if self.kind == "root":
            sign = v / np.sqrt(v * v + self.width**2)
        elif self.kind == "arctan":
            sign = 2.0 / np.pi * np.arctan(v / self.width)
        else:
            sign = np.tanh(v / self.width)
        return self.level(v) * sign

    def level(self, v: Array) -> Array:
        """Dry friction at a steady speed [N m]."""
        if self.kind not in ("stribeck", "lugre"):
            return self.coulomb
        return self.coulomb * (1.0 + (self.breakaway - 1.0) * np.exp(-((v / self.slow) ** 2)))
