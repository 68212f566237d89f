"""What a controller follows: a motion with its exact derivatives, sample by sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bench.machine import SAMPLE_TIME
from pipelines.io.experiment import Array, ExperimentLog

__all__ = ["Reference", "at_rest", "times"]


@dataclass(frozen=True, eq=False)
class Reference:
    """A motion. The machine starts at rest at its first sample."""

    t: Array  # (samples,) [s]
    q: Array  # (samples, n) [rad]
    dq: Array  # (samples, n) [rad/s]
    ddq: Array  # (samples, n) [rad/s^2]

    @classmethod
    def of_log(cls, log: ExperimentLog) -> Reference:
        """The references that a log carries, planned logs among them; KeyError where it has none."""
        return cls(log.t - log.t[0], log["q_ref"], log["dq_ref"], log["ddq_ref"])

    @property
    def samples(self) -> int:
        return len(self.t)

    @property
    def n(self) -> int:
        return int(self.q.shape[1])


def times(duration: float) -> Array:
    """0, T, 2 T, … below `duration` [s], (samples,)."""
    return np.arange(round(duration / SAMPLE_TIME), dtype=np.float64) * SAMPLE_TIME


def at_rest(posture: Array, duration: float) -> Reference:
    """No motion at `posture` (n,) for `duration` [s]."""
    t = times(duration)
    still = np.zeros((len(t), len(posture)))
    return Reference(t, still + posture, still, still)
