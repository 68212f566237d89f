"""What a log asks of an arm that is run in its place, samples that its recorder lost included.

    experiment = experiment_of(log)         as `Experiment.of_log`, of a log with gaps as well
    q = as_recorded(log, done.q)            what was simulated, at the samples that the log has

A recorder that loses samples does not stop the controller. Where the log describes it, the reference that was followed meanwhile
is put back as a cubic through position and speed at both ends (Hermite), so that the experiment can be run again by a twin: without
one nobody knows the floor, and an arm in order may be blamed for its noise. What is known of the real arm stays as it was recorded.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pipelines.log.experiment import Array, ExperimentLog
from pipelines.model.simulation import Experiment

__all__ = ["as_recorded", "experiment_of"]

Indices = npt.NDArray[np.intp]

_UNEVEN = 0.05  # of a sample time: what is farther off is an uneven clock, and no lost sample
_MOST = 0.25  # of a log, that may be put back


def experiment_of(log: ExperimentLog) -> Experiment:
    """The experiment that `log` recorded, at an even rate through its gaps.

    Raises:
        InputRejected: as `Experiment.of_log`; T05, where more than a quarter is lost, the clock is uneven, or what was asked
            meanwhile does not follow from its ends, as an injected excitation does not.
    """
    place = _places(log)
    return Experiment.of_log(log if place is None else _whole(log, place))


def as_recorded(log: ExperimentLog, x: Array) -> Array:
    """Simulated `x` (..., samples, joints) at the samples that the log has; itself where it has no others."""
    place = _places(log)
    return x if place is None or x.shape[-2] == log.n_samples else x[..., place[place < x.shape[-2]], :]


def _places(log: ExperimentLog) -> Indices | None:
    """(samples,) where each stands among all that there were; None where none was lost, or they cannot be put back."""
    apart = np.diff(log.t)
    if "q_ref" not in log or "v" in log or len(apart) < 2 or not (apart > 0.0).all():
        return None
    steps = apart / np.median(apart)
    counts = np.rint(steps)
    lost = float(np.sum(counts - 1.0))
    if not 0.0 < lost <= _MOST * log.n_samples or np.abs(steps - counts).max() > _UNEVEN:
        return None
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.intp)


def _whole(log: ExperimentLog, place: Indices) -> ExperimentLog:
    """With all samples: time and references between those that were recorded, nothing measured there."""
    every = np.arange(place[-1] + 1)
    found = {"t": np.interp(every, place, log.t)}
    names = [name for name in ("q_ref", "dq_ref", "ddq_ref") if name in log]
    if "dq_ref" in log:
        between = dict(zip(("q_ref", "dq_ref", "ddq_ref"), _hermite(every, place, log), strict=True))
    else:
        between = {name: np.stack([np.interp(every, place, x) for x in log[name].T], axis=1) for name in names}
    for name in names:
        found[name] = between[name]
        found[name][place] = log[name]
    signals = {name: replace(one, values=found[name] if name in found else _missing(len(every), place, one.values))
               for name, one in log.signals.items()}
    return replace(log, signals=signals)


def _missing(count: int, place: Indices, x: Array) -> Array:
    whole = np.full((count, *x.shape[1:]), np.nan)
    whole[place] = x
    return whole


def _hermite(every: Indices, place: Indices, log: ExperimentLog) -> tuple[Array, Array, Array]:
    """(samples, joints) position, speed and acceleration between the places of the log's.

    h(s) = (1 + 2s)(1 - s)² x₀ + s(1 - s)² d v₀ + s²(3 - 2s) x₁ + s²(s - 1) d v₁, at s of the way of d seconds from 0 to 1
    """
    first = np.clip(np.searchsorted(place, every, side="right") - 1, 0, len(place) - 2)
    d = (log.t[first + 1] - log.t[first])[:, None]
    s = ((every - place[first]) / (place[first + 1] - place[first]))[:, None]
    x0, x1 = log["q_ref"][first], log["q_ref"][first + 1]
    v0, v1 = (d * log["dq_ref"][k] for k in (first, first + 1))
    position = (1.0 + 2.0 * s) * (1.0 - s) ** 2 * x0 + s * (1.0 - s) ** 2 * v0 + s**2 * (3.0 - 2.0 * s) * x1 + s**2 * (s - 1.0) * v1
    speed = 6.0 * s * (1.0 - s) * (x1 - x0) + (1.0 - s) * (1.0 - 3.0 * s) * v0 + s * (3.0 * s - 2.0) * v1
    bend = 6.0 * (1.0 - 2.0 * s) * (x1 - x0) + (6.0 * s - 4.0) * v0 + (6.0 * s - 2.0) * v1
    return np.asarray(position), np.asarray(speed / d), np.asarray(bend / d**2)
