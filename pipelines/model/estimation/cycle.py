"""Where in the period of its motion each equation of a log lies."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from pipelines.fit.contrasts import Cycle
from pipelines.fit.equations import Array, Block
from pipelines.model.estimation.regression import LogEquations

__all__ = ["cycle_of"]

_WHOLE = 1e-6  # of an equation: so little beyond a whole number of them a period makes no further phase
_FEWEST = 40  # phases: one band of the spectrum of their means; fewer do not tell what noise those have
_REPEATS = 0.1  # of what a joint moves: more apart than so in one phase, it is not doing the same again
_STILL = 1e-3  # [rad or m] that matters to no regressor


def cycle_of(equations: Iterable[Block]) -> Cycle | None:
    """The phase of every equation; None where no phase comes again, or none that could be told.

    A period comes but once where none is given, or the log is their mean already. One of a few phases makes no spectrum, and
    where the motion does not repeat after it, equations of one phase have nothing in common: the attribute is wrong.

    A period need be no whole number of equations: those of one phase then lie up to half a step from it, an eighth of the
    shortest period that the low-pass lets through.
    """
    if not isinstance(equations, LogEquations) or equations.found.mean is not None:
        return None
    log, t = equations.found.good.log, equations.times()
    if log.period is None or len(t) == 0 or t[-1] - t[0] <= log.period:
        return None
    count = int(np.ceil(log.period / (log.sample_time * equations.conditioning.decimation) - _WHOLE))
    if count < _FEWEST:
        return None
    cycle = Cycle(np.rint((t - t[0]) / log.period * count).astype(np.intp) % count, count)
    return cycle if _repeats(cycle, equations.postures()) else None


def _repeats(cycle: Cycle, q: Array) -> bool:
    """Whether equations of one phase are those of one posture: positions `q` (samples, joints) [rad or m] of every joint that
    moves scatter within a phase by little of what they do in all.

    n postures of a phase scatter around their mean with n - 1 degrees of freedom.
    """
    seen = np.bincount(cycle.phase, minlength=cycle.count)
    mean = np.zeros((cycle.count, q.shape[1]))
    np.add.at(mean, cycle.phase, q)
    mean /= np.maximum(seen, 1)[:, None]
    free = len(q) - np.count_nonzero(seen)
    within = np.sqrt(np.square(q - mean[cycle.phase]).sum(axis=0) / max(free, 1))
    return bool(np.all(within <= np.maximum(_REPEATS * q.std(axis=0), _STILL)))
