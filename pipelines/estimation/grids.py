"""Lay the samples of a log on even grids, as filters need them, and read states off them.

    seen = measured(log)
    for grid in seen.grids:
        states, std = on_grid(seen.y[grid.first:grid.last], grid, seen.step, track)

Nothing is interpolated: a place of the grid that holds no sample is missing. A log whose clock is
uneven is resampled before (`uneven_clock`); what remains here is a clock that runs a little fast,
and lost samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected
from pipelines.estimation.config import GridConfig
from pipelines.io.limits import SHORTEST, recorded_span
from pipelines.io.log import Array, ExperimentLog
from pipelines.quality.segments import Usable, usable

Indices = npt.NDArray[np.intp]
# samples of a grid -> states and deviations (order, samples, joints)
Tracker = Callable[[Array], tuple[Array, Array | None]]

_CONFIG = GridConfig()


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

    @property
    def wanders(self) -> bool:
        """Return whether a sample was taken away from its place."""
        return bool((np.abs(self.late) > _CONFIG.late).any())


@dataclass(frozen=True, eq=False)
class Measured:
    """The positions of a log as the filters see them."""

    good: Usable
    y: Array  # (kept samples, joints) [rad], unwrapped, NaN where missing or a glitch
    step: float  # [s] nominal
    grids: tuple[Grid, ...]  # stretches of an unbroken clock

    @property
    def longest(self) -> Grid:
        return max(self.grids, key=lambda grid: grid.last - grid.first)


def measured(log: ExperimentLog, good: Usable | None = None) -> Measured:
    """Return the positions of `log` on even grids.

    Raises:
        InputRejected: T08, too few samples; T04, no stretch is long enough; T05, the clock is too
            uneven; D02, a joint without any measurement.
    """
    good = usable(log) if good is None else good
    where = log.source or log.name
    if log.n_samples < SHORTEST:
        span = recorded_span(log.signals["t"].values, log.sample_time)
        words = f"{log.n_samples} samples, {span:.3g} s: at least {SHORTEST} are needed to "
        words += f"reconstruct motion, {SHORTEST * log.sample_time:.3g} s at this rate"
        remedy = "record longer, some seconds of the motion at least"
        raise InputRejected("T08", words, where=where, remedy=remedy)
    if not good.runs:
        words = "no stretch without a gap is long enough to reconstruct motion from"
        remedy = "'rrrid inspect' shows what is missing; record again"
        raise InputRejected("T04", words, where=where, remedy=remedy)
    y = np.where(good.position_spikes, np.nan, good.log.q)
    lost = np.isnan(y)
    if lost.all(axis=0).any():
        words = f"joint {int(np.argmax(lost.all(axis=0))) + 1} has no measurement at all"
        remedy = "leave the joint out, or record it again"
        raise InputRejected("D02", words, where=where, remedy=remedy)
    bad = np.diff(lost.any(axis=1).astype(np.int8), prepend=0, append=0)
    ends = [
        place
        for a, b in np.flatnonzero(bad).reshape(-1, 2).tolist()
        if b - a > _CONFIG.long
        for place in (a + _CONFIG.predicted, b)
    ]
    jumps = np.flatnonzero(good.jumped.any(axis=1))
    cuts = np.concatenate([jumps, [good.end], ends]).astype(np.intp)
    step = log.sample_time if good.time.known else good.time.median
    return Measured(good, y, step, tuple(grids(good.log.t, step, cuts)))


def grids(
    t: Array, sample_time: float, cuts: Indices | None = None, longest: int = _CONFIG.bridged
) -> list[Grid]:
    """Return the grids of the stamps `t` [s].

    A new one begins where time steps back, after more than `longest` missing samples, and at
    `cuts`.

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
    if crowded > _CONFIG.crowded * len(t):
        words = f"{crowded} of {len(t)} samples lie nearer to another's place"
        remedy = "record with an even clock, or resample with 'rrrid import'"
        raise InputRejected("T05", f"the clock is too uneven: {words}", remedy=remedy)
    return found


def _grid(t: Array, first: int, last: int, sample_time: float) -> Grid:
    since = t[first:last] - t[first]
    count = np.diff(since) / sample_time
    whole, several = np.rint(count), len(since) > 1
    unit, wanders = sample_time, several and np.abs(count - whole).max() > _CONFIG.late
    if several and np.all(np.abs(count - whole) < 0.25) and whole.min() >= 1:
        unit = float(since[-1] / whole.sum())  # the clock's own step: it may run a little fast
    exact = since / unit
    if wanders:  # the places lie where most samples do, not where the first happens to
        exact -= np.angle(np.exp(2j * np.pi * exact).mean()) / (2.0 * np.pi)
    place = np.rint(exact).astype(np.intp)
    place -= place.min()
    exact += place[0] - np.rint(exact[0])
    late = exact - place
    alone = np.ones(len(place), dtype=bool)
    for k in np.flatnonzero(np.diff(place) <= 0).tolist():
        alone[k if abs(late[k]) > abs(late[k + 1]) else k + 1] = False
    return Grid(first, last, unit, place, late, alone)


def lay_on(y: Array, grid: Grid) -> Array:
    """Return `y` (rows, joints) of one grid at its places, NaN where nothing was measured."""
    out = np.full((grid.size, *y.shape[1:]), np.nan)
    out[grid.place[grid.alone]] = y[grid.alone]
    return out


def on_grid(y: Array, grid: Grid, sample_time: float, track: Tracker) -> tuple[Array, Array | None]:
    """Return states and deviations (order, rows, joints) of `y` (rows, joints).

    `track` counts in `sample_time`: a derivative of order i grows by (nominal / own)^i.
    """
    states, std = track(lay_on(y, grid))
    ratio = sample_time / grid.step
    if abs(ratio - 1.0) < 1e-9:
        return states[:, grid.place], None if std is None else std[:, grid.place]
    scale = (ratio ** np.arange(len(states)))[:, None, None]
    return states[:, grid.place] * scale, None if std is None else std[:, grid.place] * scale


def grid(start: float, end: float, rate: float) -> Array:
    """Return even time stamps [s] from `start` on, `rate` a second, none after `end`."""
    # a millionth of a step of slack: 10 s at 400 Hz are 4001 samples, whatever the rounding
    count = int(np.floor((end - start) * rate + 1e-6)) + 1
    return start + np.arange(max(0, count)) / rate


def resample(
    t: Array, values: Array, at: Array, method: Literal["spline", "linear"] = "spline"
) -> Array:
    """Return `values` (samples,) or (samples, k), taken at increasing `t`, at the times `at`.

    The natural cubic spline is the noise-free limit of the smoother of an integrated Wiener process
    (Wahba 1978, eq. (1.4)): it adds nothing but the smoothest motion between the samples.
    """
    if method == "linear" or t.size < 4:
        columns = np.atleast_2d(values.T)
        laid = np.stack([np.interp(at, t, column) for column in columns], axis=-1)
        return laid.reshape(at.shape + values.shape[1:])
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(t, values, axis=0, bc_type="natural")
    return np.asarray(spline(at), dtype=np.float64)


def through(at: Array, values: Array, wanted: Array) -> Array:
    """Return a cubic spline through `values` (samples, channels) at `at`, at the `wanted` times."""
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(at, values)(wanted))
