"""Series for the figures of a simulated log."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.io.log import Array, ExperimentLog
from pipelines.simulation.config import SIMULATION

__all__ = ["Course", "course"]

Pair = tuple[Array, Array]


@dataclass(frozen=True)
class Course:
    """Measured and simulated signals (points, joints).

    t has two points a stretch, its lowest and its highest sample.
    """

    t: Array  # [s] (points,)
    position: Array  # [rad] measured
    position_simulated: Array
    position_difference: Array  # simulated minus measured
    speed: Array  # [rad/s] reconstructed
    speed_simulated: Array
    torque: Array | None = None  # [N m] commanded
    torque_simulated: Array | None = None
    torque_difference: Array | None = None


def course(log: ExperimentLog, q: Pair, dq: Pair, tau: Pair | None) -> Course:
    """Return the series of one log; each pair is measured and simulated (samples, joints)."""
    size = max(1, -(-log.n_samples // SIMULATION.stretches))
    first = np.arange(0, log.n_samples, size)
    middle = np.minimum(first + size // 2, log.n_samples - 1)
    t = np.stack([log.t[first], log.t[middle]], axis=1).ravel()
    torque = () if tau is None else (*tau, tau[1] - tau[0])
    series = (*q, q[1] - q[0], *dq, *torque)
    return Course(t, *(_envelope(x, size) for x in series))


def _envelope(x: Array, size: int) -> Array:
    """(2 stretches, joints): lowest and highest of each `size` samples, NaN without any."""
    first = np.arange(0, len(x), size)
    low = np.minimum.reduceat(np.where(np.isnan(x), np.inf, x), first, axis=0)
    high = np.maximum.reduceat(np.where(np.isnan(x), -np.inf, x), first, axis=0)
    both = np.stack([low, high], axis=1).reshape(-1, x.shape[1])
    return np.where(np.isfinite(both), both, np.nan)
