"""Find the moment from which on an arm no longer does what is asked of it: an emergency stop, a lost reference."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipelines.io.experiment import ExperimentLog
from pipelines.io.order_statistics import median, quantile
from pipelines.quality.faults import Mask, lagged_speed

__all__ = ["emergency_stop"]


def emergency_stop(log: ExperimentLog) -> tuple[int, str] | None:
    """Sample from which on the arm no longer does what was asked of it, up to the end of the log, and how it shows."""
    if log.experiment in ("hold", "frf") or log.n_samples < 100:
        return None
    shortest = max(20, round(0.05 / log.sample_time))
    events = [event for event in (_lost_reference(log), _power_cut(log, shortest))
              if event is not None and 0.1 * log.n_samples < event[0] < log.n_samples - shortest]
    return min(events) if events else None


def _lost_reference(log: ExperimentLog) -> tuple[int, str] | None:
    if "q_ref" not in log:
        return None
    error = np.abs(log.q - log["q_ref"])
    measured = np.isfinite(error)
    spread = np.std(np.where(np.isfinite(log["q_ref"]), log["q_ref"], 0.0), axis=0)
    usual = median(np.where(measured, error, 0.0))
    lost = (error > np.maximum(np.maximum(0.05, 0.25 * spread), 8.0 * usual)) | ~measured
    starts = _start_of_last_run(lost & measured.any(axis=0))
    joint = int(starts.argmin())
    after = measured[starts[joint]:, joint]
    if after.sum() <= 0.5 * after.size:  # not lost, but not recorded
        return None
    off = float(np.nanmax(error[starts[joint]:, joint], initial=0.0))
    return int(starts[joint]), f"joint {joint + 1} leaves its reference by {off:.3g} rad and stays away"


def _power_cut(log: ExperimentLog, shortest: int) -> tuple[int, str] | None:
    """All torques drop to zero for good while the arm moves. In a friction log that is a coast-down, and meant."""
    start = int(_start_of_last_run((log.tau == 0.0).all(axis=1)[:, None])[0])
    speed = np.abs(lagged_speed(log.q, log.sample_time))
    speed = np.where(np.isfinite(speed), speed, 0.0)
    usual = quantile(speed, 0.75)
    before = speed[max(0, start - shortest):start]
    moving = ((before.max(axis=0, initial=0.0) > 0.3 * usual) & (usual > 0)).any()
    return (start, "all torques drop to zero while the arm moves") if moving and log.experiment != "friction" else None


def _start_of_last_run(mask: Mask) -> npt.NDArray[np.intp]:
    """(joints,) first sample of the run that reaches the end; the number of samples where there is none."""
    backward = mask[::-1]
    length = np.where(backward.all(axis=0), len(mask), np.argmin(backward, axis=0))
    return np.asarray(len(mask) - length, dtype=np.intp)
