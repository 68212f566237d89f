"""What an estimate leaves unexplained, beside what differs from one period to the next: noise, which no model explains.

    means, scatter = averaged(motions, how, cutoff_hz)     mean periods instead of the logs that have them
    beside = residuals(scatter, fitted, judged, logs)      residual, floor and their ratio, joint by joint

Both are of the mean period, whichever way the equations of the fit came: an error of the model is the same in every period,
noise falls with the root of their number, and beside the noise of a single sample the same error would look so much smaller.
Only periods that are not alike have no mean; there it is every sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.errors import InputRejected
from pipelines.estimation.mean_period import NoiseFloor, mean_period
from pipelines.estimation.motion import Reconstructed, Reconstruction, noise_response
from pipelines.fit.least_squares import errors
from pipelines.fit.statistics import gather
from pipelines.io.log import Array, ExperimentLog
from pipelines.model.estimation.conditioning import cutoff_at
from pipelines.model.estimation.logs import Fitted, Judged, Motions, equations_of
from pipelines.model.estimation.regression import LogEquations

__all__ = ["Beside", "Scatter", "averaged", "residuals"]

_SEED = 20040509
_DRAWS = 3  # of the noise of positions: their mean power is known to a few per cent


@dataclass(frozen=True, eq=False)
class Scatter:
    """What differs between the periods of a log, and their mean, whether or not a fit takes it."""

    floor: NoiseFloor
    mean: tuple[ExperimentLog, Reconstructed] | None  # None: the periods are not alike


@dataclass(frozen=True)
class Beside:
    """One periodic log: its noise, and what the estimate leaves of its torque. Arrays are per joint."""

    log: str
    role: str
    periods: int  # compared
    averaged: bool
    why_not: str  # the periods are not averaged, in words
    left_out: tuple[int, ...]  # periods that differ from the others, counted from 1
    position: Array  # [rad] standard deviation of one sample of one period
    torque: Array  # [N m]
    torque_low_pass: Array  # [N m] what the low-pass over equations leaves of it
    motion: Array  # [N m] what the noise of the positions does to the torque that the model asks for, in the mean period
    noise_floor: Array  # [N m] that noise leaves in the mean period: torque's, over the root of their number, and motion's
    residual: Array  # [N m] root mean square of what the estimate leaves in the mean period; where there is none, in every sample
    ratio: Array  # residual over noise floor: 1 where the model explains all that repeats
    settling_time: float | None = None  # [s] left out at the start of the first period compared; None: not known


def averaged(motions: Motions, how: Reconstruction, cutoff_hz: float | None) -> tuple[Motions, tuple[Scatter | None, ...]]:
    """The logs and motions that equations come from, and the scatter of each log that has two periods or more."""
    found = tuple(_scatter(log, motion, cutoff_hz) for log, motion in motions)
    return tuple(own if not how.average or scatter is None or scatter.mean is None else scatter.mean
                 for own, scatter in zip(motions, found, strict=True)), found


def _scatter(log: ExperimentLog, found: Reconstructed, cutoff_hz: float | None) -> Scatter | None:
    if log.period is None:
        return None
    floor, mean = mean_period(log, found, cutoff_at(cutoff_hz, 1.0 / log.sample_time))
    return None if floor is None else Scatter(floor, mean)


def residuals(scatter: Sequence[Scatter | None], fitted: Fitted, judged: Judged, logs: Sequence[ExperimentLog],
              asked: bool) -> tuple[Beside, ...]:
    """Every periodic log's noise beside the residual of its mean; `scatter` of `logs`, those fitted before those that judge."""
    equations = [*(one for one in fitted.estimate.equations.logs if isinstance(one, LogEquations)), *judged.equations]
    sources = [log for log, _ in (*fitted.motions, *judged.motions)]
    return tuple(_beside(own, one, log, source, fitted, asked)
                 for own, one, log, source in zip(scatter, equations, logs, sources, strict=True) if own is not None)


def _beside(scatter: Scatter, used: LogEquations, log: ExperimentLog, source: ExperimentLog, fitted: Fitted,
            asked: bool) -> Beside:
    noise, one = scatter.floor, _of_mean(scatter, used, fitted)
    residual = errors(gather(one), fitted.estimate.beta).rms / np.sqrt(one.repeats)
    motion = _of_motion(one, noise, source, fitted)
    floor = np.hypot(noise.torque_low_pass / np.sqrt(one.repeats), motion)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = residual / floor
    return Beside(log.name, log.role, noise.periods, used.repeats > 1, noise.unlike if asked else "not asked for", noise.left_out,
                  noise.position, noise.torque, noise.torque_low_pass, motion, floor, residual, ratio, noise.settling_time)


def _of_mean(scatter: Scatter, used: LogEquations, fitted: Fitted) -> LogEquations:
    """The equations of the mean period, as a fit to it has them; those used where there are none."""
    if scatter.mean is None or used.found.mean is not None:
        return used
    try:
        return equations_of((scatter.mean,), fitted.recipe, used.columns)[0]
    except InputRejected:  # what is spoilt in one period touches all of the mean
        return used


def _of_motion(one: LogEquations, noise: NoiseFloor, log: ExperimentLog, fitted: Fitted) -> Array:
    """[N m] rms (joints,) by which the equations change when the positions get their noise once more.

    Of a mean over M periods, what differs between them is left to 1/M; of what counting in steps leaves, the rest repeats.
    """
    found, mean, rng = one.found, one.found.mean, np.random.default_rng(_SEED)
    source, whole = (log, found) if mean is None else (mean.source, mean.whole)
    power, beta = np.zeros(log.n_joints), fitted.estimate.beta
    for _ in range(_DRAWS):
        response, variance = noise_response(source, whole, fitted.recipe.how, len(found.motion.t), rng)
        differs = np.minimum(noise.position**2, variance)
        response = response * np.sqrt(1.0 - differs / variance * (1.0 - 1.0 / one.repeats))
        own = found.motion
        shaken = replace(found, motion=replace(own, q=own.q + response[0], dq=own.dq + response[1], ddq=own.ddq + response[2]))
        for block, moved in zip(one, replace(one, found=shaken, chosen=one.rows), strict=True):
            power += np.sum((moved.residual(beta) - block.residual(beta)) ** 2, axis=1)
    return np.asarray(np.sqrt(power / np.maximum(_DRAWS * one.repeats * one.counts, 1)))
