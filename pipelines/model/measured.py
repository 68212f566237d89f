"""The positions of a log as the filters see them: unwrapped, glitches taken out, on even grids."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.errors import InputRejected
from pipelines.io.limits import SHORTEST, recorded_span
from pipelines.io.log import Array, ExperimentLog
from pipelines.quality.segments import Usable, usable
from pipelines.signal.grid import Grid, grids

__all__ = ["Measured", "measured"]

_LONG = 4096  # missing samples: of more, only the first are predicted
_END = 1024


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
    """The positions of `log` on even grids.

    Raises:
        InputRejected: T04, no stretch of it is long enough; T05, its clock is too uneven.
    """
    good = usable(log) if good is None else good
    if log.n_samples < SHORTEST:
        span = recorded_span(log.signals["t"].values, log.sample_time)
        raise InputRejected("T08", f"{log.n_samples} samples, {span:.3g} s: at least {SHORTEST} are needed to reconstruct motion, "
                            f"{SHORTEST * log.sample_time:.3g} s at this rate",
                            where=log.source or log.name, remedy="record longer, some seconds of the motion at least")
    if not good.runs:
        raise InputRejected("T04", "no stretch without a gap is long enough to reconstruct motion from",
                            where=log.source or log.name, remedy="'rrrid inspect' shows what is missing; record again")
    y = np.where(good.position_spikes, np.nan, good.log.q)
    lost = np.isnan(y)
    if lost.all(axis=0).any():
        raise InputRejected("D02", f"joint {int(np.argmax(lost.all(axis=0))) + 1} has no measurement at all",
                            where=log.source or log.name, remedy="leave the joint out, or record it again")
    edges = np.flatnonzero(np.diff(lost.any(axis=1).astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
    ends = [place for a, b in edges.tolist() if b - a > _LONG for place in (a + _END, b)]
    cuts = np.concatenate([np.flatnonzero(good.jumped.any(axis=1)), [good.end], ends]).astype(np.intp)
    step = log.sample_time if good.time.known else good.time.median
    return Measured(good, y, step, tuple(grids(good.log.t, step, cuts)))
