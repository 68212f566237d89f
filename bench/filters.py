"""Elements that several faults share: a first-order lag, and walls that push and never pull."""

from __future__ import annotations

from collections.abc import Callable
from math import exp

from bench.config import CONFIG


def first_order_lag(time_constant: float, step: float) -> Callable[[float], float]:
    """Return a filter T dy/dt = u - y, from u held over a step to the mean of y over that step.

    Args:
        time_constant: T [s]; far below the step the input passes unchanged.
        step: [s] between two calls.
    """
    ratio = time_constant / step
    kept = exp(-1.0 / ratio) if ratio > CONFIG.shortest_lag else 0.0
    y = 0.0

    def mean(u: float) -> float:
        nonlocal y
        behind = y - u
        y = u + behind * kept
        return u + behind * ratio * (1.0 - kept)

    return mean


def wall(x: float, v: float, half: float, stiffness: float, damping: float) -> float:
    """Return k (|x| - half) sign x + d v, never pulling, beyond the walls at ± `half`; 0 between.

    It is the load of the walls on a body at `x` with speed `v`, `stiffness` k and `damping` d.
    """
    if x > half:
        return max(0.0, stiffness * (x - half) + damping * v)
    if x < -half:
        return min(0.0, stiffness * (x + half) + damping * v)
    return 0.0
