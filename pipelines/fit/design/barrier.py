"""Keep signals within bounds while something is minimised: a logarithmic barrier.

    B = -(1/n) Σ_k log(1 - g_k²),    g = (y - middle)/half

is finite only while every sample keeps its bounds. µ B is added to what is minimised; as µ shrinks, the bounds are approached.
At a minimum, µ ∂B/∂(log half) says what the bound costs. Boyd & Vandenberghe 2004, ch. 11.2.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["barrier", "cost_of_bounds"]

Array = npt.NDArray[np.float64]


def barrier(signals: Array, middle: Array, half: Array) -> tuple[float, Array] | None:
    """B summed over signals (signals, samples) and its derivative, for bounds (signals,); None where a bound is not kept."""
    g = (signals - middle[:, None]) / half[:, None]
    slack = 1.0 - g * g
    if not slack.min(initial=1.0) > 0.0:
        return None
    count = signals.shape[1]
    return -float(np.log(slack).sum()) / count, g / slack * (2.0 / count / half[:, None])


def cost_of_bounds(signals: Array, middle: Array, half: Array) -> Array:
    """-∂B/∂(log half) (signals,): how much each bound would give if it were wider, in units of µ."""
    g = (signals - middle[:, None]) / half[:, None]
    return np.asarray((2.0 * g * g / (1.0 - g * g)).mean(axis=1))
