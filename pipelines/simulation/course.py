"""Series for the figures of a simulated log: envelopes, spectra, drift of windows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pipelines.estimation.filters import welch
from pipelines.io.log import Array, ExperimentLog
from pipelines.simulation.config import SIMULATION
from pipelines.simulation.replay import Windows

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
    frequency: Array | None = None  # [Hz] (bins,) of the spectra; None for windows
    position_density: Array | None = None  # [rad²/Hz] (bins, joints) of the difference
    torque_density: Array | None = None  # [N² m²/Hz]
    elapsed: Array | None = None  # [s] since a window began
    drift: Array | None = None  # [rad] rms of the position's difference by then (points, joints)


def course(
    log: ExperimentLog, q: Pair, dq: Pair, tau: Pair | None, windows: Windows | None = None
) -> Course:
    """Return the series of one log; each pair is measured and simulated (samples, joints)."""
    size = max(1, -(-log.n_samples // SIMULATION.stretches))
    first = np.arange(0, log.n_samples, size)
    middle = np.minimum(first + size // 2, log.n_samples - 1)
    t = np.stack([log.t[first], log.t[middle]], axis=1).ravel()
    off, more = q[1] - q[0], dict[str, Any]()
    if windows is not None:
        rows = windows.first[:, None] + np.arange(windows.length)
        more["elapsed"] = log.sample_time * np.arange(windows.length, dtype=np.float64)
        more["drift"] = np.sqrt(np.mean(off[rows] ** 2, axis=0))
    else:
        more["frequency"], more["position_density"] = _spectrum(off, log.sample_time)
    if tau is not None:
        missed = tau[1] - tau[0]
        names = ("torque", "torque_simulated", "torque_difference")
        more |= {name: _envelope(x, size) for name, x in zip(names, (*tau, missed), strict=True)}
        if windows is None:
            more["torque_density"] = _spectrum(missed, log.sample_time)[1]
    first_five = [_envelope(x, size) for x in (*q, off, *dq)]
    return Course(t, *first_five, **more)


def _spectrum(x: Array, sample_time: float) -> tuple[Array, Array] | tuple[None, None]:
    """Density of the longest stretch without a gap."""
    known = np.isfinite(x).all(axis=1)
    edges = np.flatnonzero(np.diff(known, prepend=False, append=False)).reshape(-1, 2)
    start, stop = max(edges.tolist(), key=lambda edge: edge[1] - edge[0], default=(0, 0))
    if stop - start < SIMULATION.fewest:
        return None, None
    return welch(x[start:stop], 1.0 / sample_time, SIMULATION.segment)


def _envelope(x: Array, size: int) -> Array:
    """(2 stretches, joints): lowest and highest of each `size` samples, NaN where there is none."""
    first = np.arange(0, len(x), size)
    low = np.minimum.reduceat(np.where(np.isnan(x), np.inf, x), first, axis=0)
    high = np.maximum.reduceat(np.where(np.isnan(x), -np.inf, x), first, axis=0)
    both = np.stack([low, high], axis=1).reshape(-1, x.shape[1])
    return np.where(np.isfinite(both), both, np.nan)
