"""Where in the period of its motion each equation of a log lies."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from pipelines.fit.contrasts import Cycle
from pipelines.fit.equations import Block
from pipelines.model.estimation.regression import LogEquations

__all__ = ["cycle_of"]

_WHOLE = 1e-6  # of an equation: so little beyond a whole number of them a period makes no further phase


def cycle_of(equations: Iterable[Block]) -> Cycle | None:
    """The phase of every equation; None where a period comes but once: no period is given, or it is their mean already.

    A period need be no whole number of equations: those of one phase then lie up to half a step from it, an eighth of the
    shortest period that the low-pass lets through.
    """
    if not isinstance(equations, LogEquations) or equations.found.mean is not None:
        return None
    log, t = equations.found.good.log, equations.times()
    if log.period is None or len(t) == 0 or t[-1] - t[0] <= log.period:
        return None
    count = int(np.ceil(log.period / (log.sample_time * equations.conditioning.decimation) - _WHOLE))
    return Cycle(np.rint((t - t[0]) / log.period * count).astype(np.intp) % count, count)
