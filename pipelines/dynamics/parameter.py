"""One number of a model: what it is worth, how sure that is, and where it comes from."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

__all__ = ["Origin", "Parameter", "Uncertainty"]

Origin = Literal["fitted", "known", "assumed"]


@dataclass(frozen=True)
class Parameter:
    """A named number with its uncertainty and its identifiability.

    Args:
        std: one standard deviation, or None where it is unknown (an assumed or a known value).
        bounds: what the value may be; infinite where nothing bounds it.
        origin: "fitted" (from logs), "known" (from the description) or "assumed".
        visible: False where the logs behind it hardly tell it, so that it stands for its prior or
            for nothing.
    """

    name: str
    value: float
    std: float | None = None
    unit: str = "1"
    bounds: tuple[float, float] = (-math.inf, math.inf)
    origin: Origin = "fitted"
    visible: bool = True

    @property
    def words(self) -> str:
        """Value, uncertainty and unit, of as many digits as that leaves: "1.930 ± 0.021 kg"."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        if self.std is None or not math.isfinite(self.std) or self.std <= 0:
            return f"{self.value:.6g}{unit}"
        digits = max(0, 1 - math.floor(math.log10(self.std)))
        return f"{self.value:.{digits}f} ± {self.std:.{digits}f}{unit}"


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """How the errors of several numbers go together."""

    names: tuple[str, ...]
    covariance: npt.NDArray[np.float64]  # (k, k); not finite where a number is not determined
