"""Compare what an estimate leaves with noise, and ways to reconstruct motion with each other.

    means, scatter = averaged(motions, how, cutoff_hz)     mean periods instead of their logs
    floors = residuals(scatter, fitted, judged, logs)      residual, noise floor and their ratio
    rows = compare(fitted, judged, blocks)                 the four ways to reconstruct

Noise is what differs from one period to the next: no model explains it. Residual and floor are of
the mean period, whichever way the equations of the fit were made: an error of the model is the same
in every period, noise falls with the root of their number. Only periods that are not alike have no
mean; there it is every sample.

Held-out relative torque error [%] on the same equations, medians over three pairs of simulated logs
where there are any; * measurably worse than the smoother in at least two of three (95 %), none was
ever measurably better:

    logs                                        smoother  zero-phase  differences   observer
    sample logs, RRR, 1 kHz                       0.585      0.585      0.594 *      1.327 *
    Stäubli TX40, recorded, 5 kHz, blocks        13.68      13.68      13.77        13.68
    simulated: 1e-5 rad, 20, 10, 5 mN m, 1 kHz    0.039      0.048 *    0.060 *      0.822 *
    encoder of 1e-3 rad                           0.740      5.474 *   11.761 *      7.984 *
    ten times the torque noise                    0.299      0.300      0.299        0.894 *
    200 Hz                                        0.201      0.219      0.221 *      1.023 *
    200 Hz, 1e-3 rad, ten times the noise         1.161      6.606 *    6.748 *     10.408 *

A fine encoder leaves all but the observer alike; a coarse one decides for the smoother. It is the
default.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import and_

import numpy as np

from pipelines.errors import InputRejected
from pipelines.estimation.bootstrap import apart
from pipelines.estimation.estimate import Fitted, Judged, equations_of, fit_logs, judge
from pipelines.estimation.held_out import Stretches
from pipelines.estimation.least_squares import errors, gather
from pipelines.estimation.mean_period import NoiseFloor, alike, mean_period
from pipelines.estimation.motion import (
    METHODS,
    Motions,
    Reconstructed,
    Reconstruction,
    noise_response,
    reconstruct,
)
from pipelines.estimation.regression import LogEquations, Rows, cutoff_at
from pipelines.io.log import Array, ExperimentLog

_SEED = 20040509  # numerics
_DRAWS = 3  # numerics: of the noise of positions: their mean power is known to a few per cent
_UNKNOWN = (float("nan"), float("nan"))


@dataclass(frozen=True, eq=False)
class Scatter:
    """The differences between the periods of a log, and their mean, whether or not fits use it."""

    floor: NoiseFloor
    mean: tuple[ExperimentLog, Reconstructed] | None  # None: the periods are not alike


@dataclass(frozen=True)
class Beside:
    """One periodic log: its noise, and what the estimate leaves of its torque. Per joint."""

    log: str
    role: str
    periods: int  # compared
    averaged: bool
    why_not: str  # the periods are not averaged, in words
    left_out: tuple[int, ...]  # periods that differ from the others, counted from 1
    position: Array  # [rad] standard deviation of one sample of one period
    torque: Array  # [N m]
    torque_low_pass: Array  # [N m] what the low-pass over equations leaves of it
    motion: Array  # [N m] what the noise of positions does to the model's torque, in the mean
    noise_floor: Array  # [N m] noise in the mean period: torque's over √ their number, and motion's
    residual: Array  # [N m] rms that the estimate leaves in the mean period; else in every sample
    ratio: Array  # residual over noise floor: 1 where the model explains all that repeats
    settling_time: float | None = None  # [s] left out at the start of the first; None: not known


def averaged(
    motions: Motions, how: Reconstruction, cutoff_hz: float | None
) -> tuple[Motions, tuple[Scatter | None, ...]]:
    """Return the logs and motions that equations come from, and the scatter of periodic logs."""
    means, scatter = [], list[Scatter | None]()
    for log, found in motions:
        floor, mean = mean_period(log, found, cutoff_at(cutoff_hz, 1.0 / log.sample_time))
        scatter.append(None if floor is None else Scatter(floor, mean))
        means.append(mean if how.average and mean is not None else (log, found))
    return tuple(means), tuple(scatter)


def residuals(
    scatter: Sequence[Scatter | None],
    fitted: Fitted,
    judged: Judged,
    logs: Sequence[ExperimentLog],
    asked: bool,
) -> tuple[Beside, ...]:
    """Return every periodic log's noise with the residual of its mean.

    Args:
        scatter: of `logs`, those fitted before those that judge.
        asked: whether periods shall be averaged.
    """
    own = [one for one in fitted.estimate.equations.logs if isinstance(one, LogEquations)]
    sources = [log for log, _ in (*fitted.motions, *judged.motions)]
    every = zip(scatter, (*own, *judged.equations), logs, sources, strict=True)
    beside = []
    for found, used, log, source in every:
        if found is None:
            continue
        noise, one = found.floor, _of_mean(found, used, fitted)
        root = np.sqrt(one.repeats)
        residual = errors(gather(one), fitted.estimate.beta).rms / root
        motion = _of_motion(one, noise, source, fitted)
        floor = np.hypot(noise.torque_low_pass / root, motion)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = residual / floor
        beside.append(
            Beside(
                log.name,
                log.role,
                noise.periods,
                used.repeats > 1,
                noise.unlike if asked else "not asked for",
                noise.left_out,
                noise.position,
                noise.torque,
                noise.torque_low_pass,
                motion,
                floor,
                residual,
                ratio,
                noise.settling_time,
            )
        )
    return tuple(beside)


def _of_mean(scatter: Scatter, used: LogEquations, fitted: Fitted) -> LogEquations:
    """Return the equations of the mean period; those used where there are none."""
    if scatter.mean is None or used.found.mean is not None:
        return used
    try:
        return equations_of((scatter.mean,), fitted.recipe, used.columns)[0]
    except InputRejected:  # what is spoilt in one period touches all of the mean
        return used


def _of_motion(one: LogEquations, noise: NoiseFloor, log: ExperimentLog, fitted: Fitted) -> Array:
    """Return the rms [N m] (joints,) by which equations change with new noise of the positions.

    Of a mean over M periods, what differs between them is left to 1/M; of what counting in steps
    leaves, the rest repeats.
    """
    found, mean, rng = one.found, one.found.mean, np.random.default_rng(_SEED)
    source, whole = (log, found) if mean is None else (mean.source, mean.whole)
    power, beta, own = np.zeros(log.n_joints), fitted.estimate.beta, found.motion
    for _ in range(_DRAWS):
        response, variance = noise_response(source, whole, fitted.recipe.how, len(own.t), rng)
        differs = np.minimum(noise.position**2, variance) / variance
        q, dq, ddq = response * np.sqrt(1.0 - differs * (1.0 - 1.0 / one.repeats))
        motion = replace(own, q=own.q + q, dq=own.dq + dq, ddq=own.ddq + ddq)
        shaken = replace(one, found=replace(found, motion=motion), chosen=one.rows)
        for block, moved in zip(one, shaken, strict=True):
            power += np.sum((moved.residual(beta) - block.residual(beta)) ** 2, axis=1)
    return np.asarray(np.sqrt(power / np.maximum(_DRAWS * one.repeats * one.counts, 1)))


@dataclass(frozen=True)
class Compared:
    """The result of one way to reconstruct."""

    method: str
    used: bool  # the one whose estimate is reported
    identify: float  # relative torque error
    validate: float
    apart: tuple[float, float]  # `validate` less that of the one used lies there with 95 %
    tied: bool  # as good as the best of all, as far as these logs can tell
    equations: int  # that it was judged by: the same of all
    value: tuple[float, ...]  # rigid parameters
    std: tuple[float, ...]
    failed: str  # why it gave none; empty where it did


def compare(
    fitted: Fitted, judged: Judged, blocks: int, weighted: bool = True
) -> tuple[Compared, ...]:
    """Fit and judge by every method, on the same equations: of the samples that all of them know.

    Cut-off and decimation are those of the estimate. A filter leaves out what it knows badly,
    others do not know what they know badly: each is judged by what is left of all.
    """
    columns, recipe = fitted.estimate.columns, fitted.recipe
    motions: dict[str, tuple[Motions, Motions]] = {}
    failed: dict[str, str] = {}
    rows: list[list[list[Rows]]] = []
    for method in METHODS:
        both = fitted.motions, judged.motions
        try:
            if method != recipe.how.method:
                how = replace(recipe.how, method=method, jerk_std=None, bandwidth=None)
                both = _again(fitted.motions, how), _again(judged.motions, how)
            chosen = [[one.rows for one in equations_of(x, recipe, columns)] for x in both]
        except InputRejected as problem:  # a zero-phase filter cannot pass a gap, say
            failed[method] = problem.message
            continue
        motions[method] = both
        rows.append(chosen)
    common = [
        [reduce(and_, of_log) for of_log in zip(*(part[k] for part in rows), strict=True)]
        for k in (0, 1)
    ]
    found, stretches = list[Compared](), dict[str, Stretches]()
    for method in METHODS:
        used, why = method == recipe.how.method, failed.get(method, "")
        if method in motions:
            first, second = motions[method]
            try:
                other = fit_logs(first, columns, recipe, weighted, common[0])
                result = judge(other, second, blocks, common[1])
            except InputRejected as problem:
                why = problem.message
            else:
                stretches[method] = result.stretches
                own, rigid = other.estimate, list(columns.rigid)
                found.append(
                    Compared(
                        method,
                        used,
                        other.errors.relative_error,
                        result.errors.relative_error,
                        _UNKNOWN,
                        False,
                        int(result.errors.counts.sum()),
                        tuple(map(float, own.beta[rigid])),
                        tuple(map(float, own.std[rigid])),
                        "",
                    )
                )
                continue
        nothing = (*_UNKNOWN, _UNKNOWN, False, 0, (), ())
        found.append(Compared(method, used, *nothing, why))
    return _judged(found, stretches)


def _again(motions: Motions, how: Reconstruction) -> Motions:
    return tuple(
        (log, reconstruct(log, how, found.good) if found.mean is None else alike(found, how))
        for log, found in motions
    )


def _judged(rows: list[Compared], stretches: dict[str, Stretches]) -> tuple[Compared, ...]:
    """Return the rows with which differences of held-out error are more than chance."""
    known = [row for row in rows if row.method in stretches]
    if not known:
        return tuple(rows)
    best = min(known, key=lambda row: row.validate)
    used = next((row for row in known if row.used), None)

    def differ(ours: Compared, theirs: Compared) -> tuple[float, float]:
        """Return where the error of theirs less that of ours lies with 95 %."""
        if ours.method == theirs.method:
            return 0.0, 0.0
        one, other = stretches[ours.method], stretches[theirs.method]
        reduced = one.errors.relative_error
        whole = ours.validate / reduced if reduced > 0.0 else 1.0
        sums = one.rss.sum(axis=1), other.rss.sum(axis=1), one.power.sum(axis=1)
        low, high = apart(*sums, np.random.default_rng(_SEED))
        return whole * low, whole * high

    return tuple(
        replace(
            row,
            apart=_UNKNOWN if used is None else differ(used, row),
            tied=differ(best, row)[0] <= 0.0,
        )
        if row in known
        else row
        for row in rows
    )
