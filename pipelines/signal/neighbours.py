"""Pairs of instants at which a system is in the same state.

first, second = nearest_pairs(state, time, near=0.1, apart=1.0)
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["nearest_pairs"]

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]

_NEIGHBOURS = 32  # numerics: that are looked at; slow motion has many next to it in time


def nearest_pairs(state: Array, time: Array, near: float, apart: float) -> tuple[Indices, Indices]:
    """Return pairs of rows of one state, the nearest first; no row is in two of them.

    Args:
        state: (rows, coordinates), each in units of what is no motion of it.
        time: (rows,) [s]
        near: of the standard deviation of each coordinate, by which two rows may differ, or by a unit.
        apart: [s] between them, at least.
    """
    from scipy.spatial import cKDTree

    if len(state) < 2:
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    scaled = state / np.maximum(state.std(axis=0), 1.0 / near)
    distance, other = cKDTree(scaled).query(
        scaled, min(_NEIGHBOURS, len(scaled)), p=np.inf, distance_upper_bound=near
    )
    here, place = np.nonzero(np.isfinite(distance))
    there = other[here, place]
    kept = np.abs(time[here] - time[there]) >= apart
    here, there, distance = here[kept], there[kept], distance[here, place][kept]
    free, chosen = np.ones(len(scaled), dtype=bool), []
    for k in np.argsort(distance, kind="stable"):
        if free[here[k]] and free[there[k]]:
            free[[here[k], there[k]]] = False
            chosen.append(k)
    return here[chosen], there[chosen]
