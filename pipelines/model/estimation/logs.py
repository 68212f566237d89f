"""Fit several logs together and judge the fit on others: every log reconstructed and conditioned alike."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipelines.dynamics.body import Motion
from pipelines.errors import InputRejected, UsageError
from pipelines.estimation.filters import KEEP
from pipelines.estimation.motion import Reconstructed, Reconstruction, reconstruct
from pipelines.fit.least_squares import Errors
from pipelines.fit.statistics import Triangles, gather
from pipelines.io.log import Array, ExperimentLog
from pipelines.model.estimation.blocks import Stretches, by_blocks, by_stretches
from pipelines.model.estimation.conditioning import condition, cutoff_at, wanted_cutoff
from pipelines.model.estimation.estimate import Estimate, Stacked, estimate
from pipelines.model.estimation.regression import Columns, LogEquations, Rows

__all__ = ["FEWEST_OF_JOINT", "Fitted", "Judged", "Motions", "Recipe", "equations_of", "fit_logs", "judge", "motions_of",
           "none_left", "of_each", "refuse_too_few", "with_cutoff"]

Motions = tuple[tuple[ExperimentLog, Reconstructed], ...]

_FEWEST = 200  # equations of a fit: ten a parameter of the RRR arm with friction
FEWEST_OF_JOINT = 20
_STRETCHES = 20  # of held-out logs, to see how far errors scatter
_MOSTLY = 0.01  # of the samples saturated: that is why none is left


@dataclass(frozen=True)
class Recipe:
    """How a log becomes equations. None: found from the logs that are fitted."""

    how: Reconstruction = field(default_factory=Reconstruction)
    cutoff_hz: float | None = None
    decimation: int | None = None
    min_speed: tuple[float, ...] = (0.0,)
    known: Callable[[Motion], Array] | None = None  # torque (samples, joints) [N m] that is subtracted: of a given friction
    orders: int = 0  # [1/rev] of a torque that the cut-off lets through at the fastest speed, where it is found
    lowest_hz: float = 0.0  # of a cut-off that is found
    highest_hz: float = np.inf
    found: bool = False  # the cut-off, or that there is none, came of the fitted logs; one of a lower rate does without
    keep: float = KEEP  # samples left in a period of the cut-off, where no decimation is given


@dataclass(frozen=True, eq=False)
class Fitted:
    """The estimate, and the motions it came from."""

    estimate: Estimate
    motions: Motions
    recipe: Recipe  # with the cut-off that was used
    errors: Errors  # on the logs that were fitted
    weighted: bool  # joints by their own residual

    @property
    def cutoff_hz(self) -> float | None:
        return self.recipe.cutoff_hz


@dataclass(frozen=True, eq=False)
class Judged:
    """How the estimate does on what it was not fitted to."""

    errors: Errors
    by: str  # "logs" | "blocks"
    stretches: Stretches  # of time, in order
    motions: Motions
    equations: tuple[LogEquations, ...]  # that judge; none of other logs where blocks of the fitted ones do


def motions_of(logs: Sequence[ExperimentLog], how: Reconstruction) -> Motions:
    """Each log with its motion.

    Raises:
        UsageError, InputRejected: as `reconstruct`, of the first log that it cannot be done for.
    """
    return of_each(logs, lambda place: reconstruct(logs[place], how))


def of_each(logs: Sequence[ExperimentLog], work: Callable[[int], Reconstructed]) -> Motions:
    """Each log with the motion that `work` makes for its place, in order; raises what comes first."""
    def moved(place: int) -> Reconstructed | UsageError | InputRejected:
        try:
            return work(place)
        except (UsageError, InputRejected) as no:  # which of several logs is told does not hang on who was quicker
            return no

    longest = sorted(range(len(logs)), key=lambda place: -logs[place].n_samples)
    found = dict(zip(longest, map(moved, longest), strict=True))
    motions = []
    for place, log in enumerate(logs):
        one = found[place]
        if isinstance(one, Exception):
            raise one
        motions.append((log, one))
    return tuple(motions)


def fit_logs(motions: Motions, columns: Columns, recipe: Recipe, weighted: bool = True,
             rows: Sequence[Rows] | None = None) -> Fitted:
    """Fit the logs; the cut-off, where it is not given, is the highest that any of them asks for, and the same for all.

    Raises:
        InputRejected: T04, a log without a stretch that can be used; T08, too few equations.
    """
    recipe = with_cutoff(recipe, motions)
    equations = equations_of(motions, recipe, columns, rows)
    refuse_too_few(equations, motions)
    found = estimate(equations, columns, weighted)
    return Fitted(found, motions, recipe, _of_whole_torque(found.solution.errors, equations), weighted)


def with_cutoff(recipe: Recipe, motions: Motions) -> Recipe:
    """`recipe` with the cut-off for these logs, where none is given: the highest that any of them, or ripple, asks for."""
    if recipe.found or recipe.cutoff_hz is not None:
        return recipe
    rates = [1.0 / log.sample_time for log, _ in motions]
    asked = [wanted_cutoff(found.motion, rate) for (_, found), rate in zip(motions, rates, strict=True)]
    turning = [np.abs(found.motion.dq[:, list(log.robot.revolute)]).max(initial=0.0) for log, found in motions]
    ripple = recipe.orders * max(turning) / (2.0 * np.pi)
    highest = min(max(*asked, ripple, recipe.lowest_hz), recipe.highest_hz)
    felt = any(cutoff_at(highest, rate) is not None for rate in rates)
    return replace(recipe, cutoff_hz=highest if felt else None, found=True)


def refuse_too_few(equations: Sequence[LogEquations], motions: Motions, fewest: int = _FEWEST) -> None:
    """Before a fit: enough equations are left, in all and of every joint.

    Args:
        fewest: equations in all.

    Raises:
        InputRejected: T08, too few equations are left for a fit, in all or of a joint.
    """
    _fast_enough(equations, motions)
    _enough(equations, motions[0][0], fewest)


def _fast_enough(equations: Sequence[LogEquations], motions: Motions) -> None:
    """T08: no sample of any log is as fast as the least speed asked for."""
    asked = np.max([one.conditioning.min_speed for one in equations], axis=0)
    slow = np.all([one.rows.slow.all(axis=0) for one in equations], axis=0) & (asked > 0.0)
    if not slow.any():
        return
    j = int(np.argmax(slow))
    fastest = max(float(np.abs(found.motion.dq[found.good.kept, j]).max()) for _, found in motions)
    unit = "rad/s" if motions[0][0].robot.joints[j].revolute else "m/s"
    raise InputRejected("T08", f"no equation of joint {j + 1} is left: its largest speed is {fastest:.3g} {unit}, --min-speed asks "
                        f"for {asked[j]:g}", where=motions[0][0].source or motions[0][0].name,
                        remedy="give less; one value a joint, where their speeds differ")


def _enough(equations: Sequence[LogEquations], log: ExperimentLog, fewest: int) -> None:
    counts = np.sum([one.counts * one.repeats for one in equations], axis=0)
    j = int(np.argmin(counts))
    if counts[j] < FEWEST_OF_JOINT:
        raise InputRejected("T08", f"{counts[j]:.0f} equations of joint {j + 1} are left", where=log.source or log.name,
                            remedy="lower --min-speed or --decimate, or record longer")
    if counts.sum() < fewest:
        raise InputRejected("T08", f"{counts.sum():.0f} equations are left, too few for a fit", where=log.source or log.name,
                            remedy="lower --decimate, filter higher with --cutoff-hz, or record longer")


def judge(fitted: Fitted, motions: Motions, blocks: int, rows: Sequence[Rows] | None = None) -> Judged:
    """Held-out errors: on other logs, or on contiguous blocks of the fitted ones where there are none."""
    found = fitted.estimate
    if not motions:
        fitted_to = [one for one in found.equations.logs if isinstance(one, LogEquations)]
        apart = by_blocks(found.equations, found.statistics.samples, blocks, max(one.guard for one in fitted_to),
                          triangles=isinstance(found.statistics, Triangles), weighted=fitted.weighted)
        return Judged(_of_whole_torque(apart.errors, fitted_to), "blocks", apart, (), ())
    equations = equations_of(motions, fitted.recipe, found.columns, rows)
    apart = by_stretches(Stacked(equations), sum(one.samples for one in equations), max(blocks, _STRETCHES), found.beta)
    return Judged(_of_whole_torque(apart.errors, equations), "logs", apart, motions, tuple(equations))


def _of_whole_torque(found: Errors, equations: Sequence[LogEquations]) -> Errors:
    """The same residual beside the whole torque, where a known part had been subtracted from it."""
    if any(one.known is not None for one in equations):
        whole = gather(Stacked([replace(one, known=None) for one in equations]))
        counts = np.maximum(whole.counts, 1)
        found = replace(found, signal_rms=np.sqrt(whole.power / counts),
                        relative_error=float(np.sqrt(np.sum(np.square(found.rms) * counts) / whole.power.sum())))
    return _of_mean_periods(found, equations)


def _of_mean_periods(found: Errors, equations: Sequence[LogEquations]) -> Errors:
    """Root mean squares [N m] of torques as they are: equations of a mean period are scaled by the root of its periods."""
    if all(one.repeats == 1 for one in equations):
        return found
    rows = np.sum([one.counts for one in equations], axis=0)
    shrink = np.sqrt(rows / np.maximum(np.sum([one.counts * one.repeats for one in equations], axis=0), 1))
    return replace(found, rms=found.rms * shrink, signal_rms=found.signal_rms * shrink)


def equations_of(motions: Motions, recipe: Recipe, columns: Columns, rows: Sequence[Rows] | None = None) -> list[LogEquations]:
    """The equations of every log; of the samples in `rows` where those are given.

    Raises:
        InputRejected: T04, every stretch of a log is too short for the low-pass, or spoilt.
    """
    return [_of_log(log, found, recipe, columns, None if rows is None else rows[i]) for i, (log, found) in enumerate(motions)]


def _of_log(log: ExperimentLog, found: Reconstructed, recipe: Recipe, columns: Columns, rows: Rows | None) -> LogEquations:
    slow: Array = np.broadcast_to(np.array(recipe.min_speed, dtype=np.float64), columns.body.robot.n_joints)
    cutoff = np.inf if recipe.found and recipe.cutoff_hz is None else recipe.cutoff_hz
    how = condition(found.motion, 1.0 / log.sample_time, cutoff, recipe.decimation, slow, recipe.keep)
    equations = LogEquations(columns, found, how, held=log.torque != "measured", known=recipe.known, chosen=rows)
    if not equations.runs:
        raise InputRejected("T04", f"no stretch without a gap outlasts the low-pass at {how.cutoff_hz:.3g} Hz",
                            where=log.source or log.name, remedy="filter higher with --cutoff-hz, or record longer")
    if equations.rows.out.all():
        raise none_left(log, found)
    return equations


def none_left(log: ExperimentLog, found: Reconstructed, few: bool = False) -> InputRejected:
    """What a log is refused with of which no sample is left, or so `few` that none is when they are thinned out."""
    saturated = bool(found.good.saturated.any(axis=1).mean() > _MOSTLY)
    what, touched = "saturated torque" if saturated else "what is missing or spoilt", "nearly every one" if few else "every one"
    return InputRejected("D05" if saturated else "T04", f"no sample is left: {what} touches {touched}",
                         where=log.source or log.name,
                         remedy="drive it more gently" if saturated else "'rrrid inspect' shows what is wrong; record again")
