"""A log with gaps as its controller ran: at an even rate through them, with no measurement there.

    log = bridged(log)

A recorder that loses samples does not stop the controller. Where the log describes it, the samples that are lost are put back as
missing ones, and the reference that was followed meanwhile as a cubic through position and speed at both ends (Hermite), so that
the experiment can be run again by a twin: without one nobody knows the floor, and an arm in order may be blamed for its noise.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pipelines.log.experiment import Array, ExperimentLog

__all__ = ["bridged"]

Indices = npt.NDArray[np.intp]

_UNEVEN = 0.05  # of a sample time: what is farther off is an uneven clock, and no lost sample
_MOST = 0.25  # of a log, that may be put back


def bridged(log: ExperimentLog) -> ExperimentLog:
    """The log with the samples that it lost, measurements missing; itself where it lost none, or nobody knows what was asked."""
    steps = np.diff(log.t) / log.sample_time
    counts = np.rint(steps)
    lost = float(np.sum(counts - 1.0))
    followed = log.controller is not None and log.controller.law != "unknown" and "q_ref" in log and "v" not in log
    if not followed or not 0.0 < lost <= _MOST * log.n_samples or counts.min() < 1.0 or np.abs(steps - counts).max() > _UNEVEN:
        return log
    place = np.concatenate([[0], np.cumsum(counts)]).astype(np.intp)
    every = np.arange(place[-1] + 1)
    asked = {"t": _linear(every, place, log.t[:, None])[:, 0]}
    if "dq_ref" in log:
        asked["q_ref"] = _hermite(every, place, log["q_ref"], log["dq_ref"] * log.sample_time)
    for name in ("q_ref", "dq_ref", "ddq_ref"):
        if name in log and name not in asked:
            asked[name] = _linear(every, place, log[name])
    signals = {name: replace(one, values=asked[name] if name in asked else _missing(len(every), place, one.values))
               for name, one in log.signals.items()}
    return replace(log, signals=signals)


def _missing(count: int, place: Indices, x: Array) -> Array:
    whole = np.full((count, *x.shape[1:]), np.nan)
    whole[place] = x
    return whole


def _linear(every: Indices, place: Indices, x: Array) -> Array:
    return np.stack([np.interp(every, place, column) for column in x.T], axis=1)


def _hermite(every: Indices, place: Indices, x: Array, slope: Array) -> Array:
    """(samples, joints) `x` between its places, `slope` a sample.

    h(s) = (1 + 2s)(1 - s)² x₀ + s(1 - s)² d m₀ + s²(3 - 2s) x₁ + s²(s - 1) d m₁, at s of the way of d samples from 0 to 1
    """
    first = np.clip(np.searchsorted(place, every, side="right") - 1, 0, len(place) - 2)
    d = (place[first + 1] - place[first]).astype(np.float64)[:, None]
    s = (every - place[first])[:, None] / d
    left, right = (1.0 - s) ** 2, s**2
    return np.asarray((1.0 + 2.0 * s) * left * x[first] + s * left * d * slope[first] + right * (3.0 - 2.0 * s) * x[first + 1]
                      + right * (s - 1.0) * d * slope[first + 1])
