"""Lay samples whose clock wanders on an even grid and read states off it at the times they were taken.

    for grid in grids(t, sample_time, cuts):
        states, std = on_grid(y, grid, track)        at the rows grid.first .. grid.last - 1 of y

Nothing is interpolated: a place of the grid that holds no sample is missing. A log whose clock is uneven is put on an even
grid before (`model.even`); what is left here is a clock that runs a little fast, and lost samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected

__all__ = ["Grid", "Tracker", "grids", "lay_on", "on_grid"]

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]
Tracker = Callable[[Array], tuple[Array, Array | None]]  # samples of a grid -> states and deviations (order, samples, joints)

_LATE = 1e-3  # of a sample: nearer than this, a sample is taken to lie on its place
_CROWDED = 0.05  # of all samples: more than these on one place with another is no clock


@dataclass(frozen=True)
class Grid:
    """Rows first .. last - 1 of a log, and where each lies on a grid of even steps."""

    first: int
    last: int
    step: float  # [s] of this clock
    place: Indices  # (rows,) from 0 upwards
    late: Array  # (rows,) how long after its place each was taken, in steps
    alone: npt.NDArray[np.bool_]  # (rows,) the sample that stands for its place

    @property
    def size(self) -> int:
        return int(self.place[-1]) + 1

    def lateness(self, sample_time: float) -> Array:
        """[s] (rows,), zero where it is too small to matter."""
        return np.asarray(np.where(np.abs(self.late) > _LATE, self.late, 0.0) * sample_time)


def grids(t: Array, sample_time: float, cuts: Indices | None = None, longest: int = 10) -> list[Grid]:
    """Grids of the stamps `t` [s]: a new one where time steps back, after more than `longest` missing samples, and at `cuts`.

    Raises:
        InputRejected: T05, the clock wanders so far that samples fall on each other's places.
    """
    step = np.diff(t) / sample_time
    new = (step <= 0.0) | (step > longest + 1.5)
    if cuts is not None:
        new[cuts[(cuts > 0) & (cuts < len(t))] - 1] = True
    borders = np.concatenate([[0], np.flatnonzero(new) + 1, [len(t)]])
    found = [_grid(t, a, b, sample_time) for a, b in pairwise(borders.tolist())]
    crowded = sum(int(np.count_nonzero(~grid.alone)) for grid in found)
    if crowded > _CROWDED * len(t):
        raise InputRejected("T05", f"the clock is too uneven: {crowded} of {len(t)} samples lie nearer to another's place",
                            remedy="record with an even clock, or resample with 'rrrid import'")
    return found


def _grid(t: Array, first: int, last: int, sample_time: float) -> Grid:
    since = t[first:last] - t[first]
    count = np.diff(since) / sample_time
    whole = np.rint(count)
    unit, wanders = sample_time, bool(len(since) > 1 and np.abs(count - whole).max() > _LATE)
    if len(since) > 1 and np.all(np.abs(count - whole) < 0.25) and whole.min() >= 1:
        unit = float(since[-1] / whole.sum())  # the clock's own step: it may run a little fast
    exact = since / unit
    # the places lie where most samples do, not where the first happens to
    exact -= np.angle(np.exp(2j * np.pi * exact).mean()) / (2.0 * np.pi) if wanders else 0.0
    place = np.rint(exact).astype(np.intp)
    place -= place.min()
    exact += place[0] - np.rint(exact[0])
    late = exact - place
    alone = np.ones(len(place), dtype=bool)
    for k in np.flatnonzero(np.diff(place) <= 0).tolist():
        alone[k if abs(late[k]) > abs(late[k + 1]) else k + 1] = False
    return Grid(first, last, unit, place, late, alone)


def lay_on(y: Array, grid: Grid) -> Array:
    """`y` (rows, joints) of one grid's rows at their places, NaN where nothing was measured."""
    out = np.full((grid.size, *y.shape[1:]), np.nan)
    out[grid.place[grid.alone]] = y[grid.alone]
    return out


def on_grid(y: Array, grid: Grid, sample_time: float, track: Tracker) -> tuple[Array, Array | None]:
    """States and deviations (order, rows, joints) of `y` (rows, joints), whose filter `track` counts in `sample_time`."""
    states, std = track(lay_on(y, grid))
    return (_rescale(states[:, grid.place], grid, sample_time),
            None if std is None else _rescale(std[:, grid.place], grid, sample_time))


def _rescale(values: Array, grid: Grid, sample_time: float) -> Array:
    """From the nominal step to the clock's own: a derivative of order i grows by (nominal / own)^i."""
    ratio = sample_time / grid.step
    if abs(ratio - 1.0) < 1e-9:
        return values
    return np.asarray(values * (ratio ** np.arange(len(values)))[:, None, None])
