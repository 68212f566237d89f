"""Reach a periodic motion from rest and leave it again, within the limits, as fast as these allow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.errors import UsageError
from pipelines.model.excitation.task import Task
from pipelines.model.excitation.trajectory import Trajectory
from pipelines.model.excitation.verify import Peak, peaks, worst

__all__ = ["with_run_in"]

_FASTEST, _LONGEST = 0.2, 10.0  # [s]
_LONGER = 1.15
_STEP = 1e-3  # [s]


def with_run_in(task: Task, trajectory: Trajectory) -> Trajectory:
    """The trajectory with the shortest run-in and run-out, of equal length, that keep the limits.

    Raises:
        UsageError: C08, none does: says which limit is in the way.
    """
    q, dq, _ = trajectory.series.at(np.zeros(1))[:, :, 0]
    duration, nearest = _FASTEST, None
    while duration <= _LONGEST:
        # half the way at mean speed: the polynomial then accelerates one way only
        rest = task.home if task.home is not None else q - 0.5 * duration * dq
        end = task.home if task.home is not None else q + 0.5 * duration * dq
        one = replace(trajectory, run_in=round(duration / task.sample_time) * task.sample_time, rest=rest, end=end)
        nearest = _nearest(task, one)
        if nearest is None or nearest.share <= 1.0:
            return one
        duration *= _LONGER
    if nearest is None:
        return trajectory
    raise UsageError("C08", f"no run-in of up to {_LONGEST:g} s keeps the {nearest.quantity} limit"
                     f"{f' of joint {nearest.joint}' if nearest.joint else ''}", where="--no-rest",
                     remedy="start at rest, or from another home")


def _nearest(task: Task, one: Trajectory) -> Peak | None:
    t = np.arange(round(one.run_in / _STEP) + 1, dtype=np.float64) * _STEP
    found = [peaks(task.problem.limits, task.problem.chain, one.at(at), task.torque, periodic=False)
             for at in (t, one.duration - t[::-1])]
    return worst(tuple(peak for group in found for peak in group))
