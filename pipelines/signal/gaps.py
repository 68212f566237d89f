"""Lay time-stamped samples on an even grid, leaving empty what was not measured: nothing is interpolated."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected

__all__ = ["Stretch", "even_stretches", "lay"]

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Stretch:
    """Samples first .. last - 1 of a log, and the place of each on a grid of even steps."""

    first: int
    last: int
    place: npt.NDArray[np.intp]  # (last - first,) from 0 upwards


def even_stretches(t: Array, sample_time: float | None = None, jitter: float = 0.05) -> list[Stretch]:
    """Stretches of increasing stamps `t` [s] whose steps are whole numbers of samples within `jitter` of one.

    A step of two samples or more is a gap on the grid; a step that is no whole number ends the stretch. Steps are counted
    one by one, so a clock that runs a little fast does not drift off the grid.
    """
    if len(t) < 2:
        raise InputRejected("T08", f"{len(t)} samples: nothing can be reconstructed", remedy="record at least two samples")
    step = np.diff(t)
    if not (np.isfinite(step).all() and np.all(step > 0.0)):
        at = int(np.argmin(np.where(np.isfinite(step), step, -np.inf)))
        raise InputRejected("T01", "time does not increase", where=f"sample {at + 1}",
                            remedy="split the log at the step of its clock")
    unit = float(np.median(step)) if sample_time is None else sample_time
    count = np.rint(step / unit)
    uneven = (np.abs(step - count * unit) > jitter * unit) | (count < 1)
    if np.count_nonzero(uneven) > len(step) // 20:
        raise InputRejected("T05", f"{np.count_nonzero(uneven)} of {len(step)} steps differ from a whole sample by more than "
                            f"{jitter:.0%}", remedy="resample the log, or record with an even clock")
    borders = np.concatenate([[0], np.flatnonzero(uneven) + 1, [len(t)]])
    place = np.concatenate([[0], np.cumsum(np.maximum(count, 1))]).astype(np.intp)
    return [Stretch(a, b, place[a:b] - place[a]) for a, b in pairwise(borders.tolist())]


def lay(y: Array, stretch: Stretch) -> Array:
    """`y` (samples, ...) of the whole log on the grid of one stretch, NaN where nothing was measured."""
    out = np.full((int(stretch.place[-1]) + 1, *y.shape[1:]), np.nan)
    out[stretch.place] = y[stretch.first:stretch.last]
    return out
