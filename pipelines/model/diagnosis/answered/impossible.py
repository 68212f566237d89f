"""What was fitted of a cause that it cannot be: for who asked for it, and may have asked for the wrong one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.model.diagnosis.result import Trial
from pipelines.model.diagnosis.searched.ledger import IMPOSSIBLE, Tried
from pipelines.model.words import plain_number

__all__ = ["numbers_of"]


def numbers_of(trial: Trial, tried: Sequence[Tried]) -> str:
    """": order = 6.02 1/rev, …" of a cause whose numbers are none that it can have; empty where they are not why it was refused."""
    if trial.reason != IMPOSSIBLE:
        return ""
    found = next((one for one in tried if (one.effect.name, one.effect.joint) == (trial.cause, trial.joint)), None)
    if found is None:
        return ""
    last, revolute = found.done.model.effects[-1], found.done.model.arm.robot.revolute
    turning = last.effect.joint is None or revolute[last.effect.joint - 1]
    shown = last.effect.reported(last.values)
    given = last.effect.fixed_amplitudes is not None  # amplitudes, by physics: they were not fitted
    units = {q.name: "" if q.unit == "1" else f" {q.unit_at(turning)}" for q in last.effect.parameters
             if q.period is None and (q.shape or q.derived or not given)}
    numbers = [(name, value) for name, value in shown.items() if name in units and isinstance(value, float) and np.isfinite(value)]
    return f": {', '.join(f'{name} = {plain_number(value, 3)}{units[name]}' for name, value in numbers)}" if numbers else ""
