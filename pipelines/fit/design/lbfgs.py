"""Minimise a smooth function inside a domain: limited-memory BFGS with a line search that knows where the domain ends.

Nocedal & Wright 2006, algorithms 7.4 and 7.5; the line search is the bisection of Lewis & Overton 2013 for the weak Wolfe
conditions, which needs no more than values: a function that is not defined at a point returns infinity there.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["Minimum", "minimise"]

Array = npt.NDArray[np.float64]

_ARMIJO, _WOLFE = 1e-4, 0.9
_PAIRS = 24  # differences that the Hessian is made of
_TRIALS = 25  # points along one line


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where the search ended."""

    x: Array
    value: float
    gradient: Array
    iterations: int


def minimise(function: Callable[[Array], tuple[float, Array]], x: Array, iterations: int, tolerance: float = 1e-7) -> Minimum:
    """Minimise `function`, which returns value and gradient, from `x`, where it is finite.

    Args:
        iterations: at most.
        tolerance: ends where ten iterations together gain less.
    """
    value, gradient = function(x)
    pairs: deque[tuple[Array, Array, float]] = deque(maxlen=_PAIRS)
    past: deque[float] = deque([value], maxlen=11)
    done = 0
    while done < iterations:
        done += 1
        direction = -_solve(pairs, gradient)
        slope = float(direction @ gradient)
        if not slope < 0.0:
            pairs.clear()
            direction, slope = -gradient, -float(gradient @ gradient)
        if slope == 0.0:
            break
        first = 1.0 if pairs else min(1.0, 0.1 / float(np.sqrt(-slope)))
        found = _along(function, x, direction, value, slope, first)
        if found is None:
            if not pairs:
                break
            pairs.clear()
            continue
        step, new_value, new_gradient = found
        moved, turned = step * direction, new_gradient - gradient
        curvature = float(moved @ turned)
        if curvature > 1e-12 * float(np.linalg.norm(moved) * np.linalg.norm(turned)):
            pairs.append((moved, turned, 1.0 / curvature))
        x, value, gradient = x + moved, new_value, new_gradient
        past.append(value)
        if len(past) == 11 and past[0] - value < tolerance:
            break
    return Minimum(x, value, gradient, done)


def _solve(pairs: deque[tuple[Array, Array, float]], gradient: Array) -> Array:
    """H g by the two-loop recursion."""
    q = gradient.copy()
    shares = []
    for moved, turned, rho in reversed(pairs):
        share = rho * float(moved @ q)
        shares.append(share)
        q -= share * turned
    if pairs:
        moved, turned, rho = pairs[-1]
        q *= 1.0 / (rho * float(turned @ turned))
    for (moved, turned, rho), share in zip(pairs, reversed(shares), strict=True):
        q += (share - rho * float(turned @ q)) * moved
    return q


def _along(function: Callable[[Array], tuple[float, Array]], x: Array, direction: Array, value: float, slope: float,
           step: float) -> tuple[float, float, Array] | None:
    """A step that satisfies the weak Wolfe conditions, with value and gradient there; the best decrease where none is found."""
    low, high = 0.0, np.inf
    best: tuple[float, float, Array] | None = None
    for _ in range(_TRIALS):
        new, gradient = function(x + step * direction)
        if not new <= value + _ARMIJO * step * slope:
            # beyond the domain the value tells nothing of the slope: come back faster
            high = step
        else:
            best = (step, new, gradient)
            if float(gradient @ direction) >= _WOLFE * slope:
                return best
            low = step
        step = 0.5 * (low + high) if np.isfinite(high) else 2.0 * step
        if high - low < 1e-12 * high:
            break
    return best
