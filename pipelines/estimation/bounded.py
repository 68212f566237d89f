"""Minimise sums of squares within bounds (Branch, Coleman, Li 1999, SIAM J. Sci. Comput. 21)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.io.log import Array


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where the sum of squares is smallest."""

    x: Array  # (parameters,)
    rest: Array  # (rows,)
    slope: Array  # (rows, parameters)
    at_bound: npt.NDArray[np.bool_]  # (parameters,)


def least_squares(
    rest: Callable[[Array], Array],
    start: Array,
    low: Array | float = -np.inf,
    high: Array | float = np.inf,
    scale: Array | None = None,
    steps: int | None = None,
) -> Minimum:
    """Return the minimum next to `start`.

    Args:
        rest: parameters (parameters,) to residuals (rows,).
        low, high: bounds of the parameters.
        scale: their characteristic sizes; None: by the slopes.
        steps: evaluations at most.

    Raises:
        numpy.linalg.LinAlgError: no number at `start`, or the step cannot be solved for.
    """
    from scipy import optimize

    if not np.isfinite(rest(start)).all():
        raise np.linalg.LinAlgError("the residual is no number where the search starts")

    sizes = "jac" if scale is None else scale
    bounds = (low, high)
    found = optimize.least_squares(rest, start, bounds=bounds, x_scale=sizes, max_nfev=steps)
    return Minimum(found.x, found.fun, found.jac, np.asarray(found.active_mask != 0))


def least_between(
    loss: Callable[[float], float], low: float, high: float, tolerance: float
) -> float:
    """Return where `loss` of one number is smallest between two, to `tolerance` (Brent 1973)."""
    from scipy import optimize

    options = {"xatol": tolerance}
    found = optimize.minimize_scalar(loss, bounds=(low, high), method="bounded", options=options)
    return float(found.x)
