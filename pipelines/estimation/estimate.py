"""Estimate base parameters and friction from several logs; judge the fit on others.

    recipe = with_cutoff(Recipe(how), motions)
    fitted = fit_logs(motions, columns, recipe)      fit, covariance, what is visible
    judged = judge(fitted, others, blocks)           held-out errors

Kostić et al. 2004, eq. (12)-(15): the equations of all logs stacked, joints weighted by their own
residual; every log is reconstructed and conditioned alike. Memory is constant in the samples.

At rest dry friction takes any value that holds the joint, and no law of friction holds
(Armstrong-Hélouvry, Dupont & Canudas de Wit 1994, sec. 2.1): the equations at rest are left out
where a model fitted to the motion leaves far more of them (`moving_rows`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from pipelines.dynamics.body import Motion
from pipelines.errors import InputRejected, UsageError
from pipelines.estimation.config import FitConfig
from pipelines.estimation.covariance import Robust, robust_covariance
from pipelines.estimation.filters import KEEP
from pipelines.estimation.identifiability import (
    Unresolved,
    condition_number,
    typical_size,
    unresolved,
    visible,
)
from pipelines.estimation.least_squares import (
    Block,
    Convergence,
    Errors,
    Flags,
    Solution,
    Statistics,
    by_blocks,
    convergence,
    errors,
    fit,
    gather,
)
from pipelines.estimation.motion import Motions, Reconstructed, Reconstruction, reconstruct
from pipelines.estimation.regression import (
    Columns,
    LogEquations,
    Rows,
    condition,
    cutoff_at,
    wanted_cutoff,
)
from pipelines.io.log import Array, ExperimentLog
from pipelines.quality.segments import Mask, blocks

__all__ = ["Motions"]

_CONFIG = FitConfig()
_KEPT = 4 << 20  # numerics: [B] of conditioned equations; longer ones are made at every pass


class Stacked:
    """The equations of several logs, one after the other; kept in memory where they are few."""

    def __init__(self, logs: Sequence[LogEquations]) -> None:
        self.logs = logs
        self._kept: list[Block] = []

    def __iter__(self) -> Iterator[Block]:
        if self._kept:
            yield from self._kept
            return
        kept, size = list[Block](), 0
        for log in self.logs:
            for block in log:
                size += sum(v.nbytes for v in block.values)
                if size <= _KEPT:
                    kept.append(block)
                else:
                    kept.clear()
                yield block
        self._kept = kept


@dataclass(frozen=True, eq=False)
class Estimate:
    """Parameters, how well they are known, and how well they explain their equations."""

    columns: Columns
    solution: Solution
    statistics: Statistics
    equations: Stacked

    @cached_property
    def robust(self) -> Robust:
        """The covariance that allows for a residual with a memory, by two passes."""
        return robust_covariance(self.equations, self.solution, self.statistics.longest)

    @property
    def beta(self) -> Array:
        return self.solution.beta

    @property
    def std(self) -> Array:
        return self.robust.std

    @cached_property
    def visible(self) -> Flags:
        """(k,) whether the logs show the parameter: its value, or that it is small."""
        names = self.columns.names
        kinds = [one.unit + one.name.partition(":")[0].rstrip("0123456789") for one in names]
        known = visible(self.beta, self.std, typical_size(self.beta, self.std, kinds))
        return np.asarray(known & self.trusted)

    @cached_property
    def unresolved(self) -> Unresolved:
        names = [column.name for column in self.columns.names]
        return unresolved(self.solution, names, float(self.robust.inflation.max()))

    @cached_property
    def trusted(self) -> Flags:
        """(k,) whether the logs determine the parameter; any other is the smallest that fits."""
        lost = self.unresolved.parameters
        kept = [column.name not in lost for column in self.columns.names]
        return np.asarray(kept & self.solution.determined)

    @property
    def condition_number(self) -> float:
        """Of Φ in (13): rigid columns, unweighted, SI."""
        return condition_number(self.statistics, self.columns.rigid)

    def convergence(self) -> Convergence:
        """Return how the estimates settle as samples come in, Fig. 12."""
        return convergence(self.equations, self.solution, _CONFIG.parts, self.robust.inflation)


def estimate(logs: Sequence[LogEquations], columns: Columns, weighted: bool = True) -> Estimate:
    """Fit the equations of `logs`; without `weighted` every joint counts alike, as in eq. (15)."""
    stacked = Stacked(logs)
    weights = None if weighted else np.ones(columns.body.robot.n_joints)
    fitted = fit(stacked, weights=weights)
    return Estimate(columns, fitted.solution, fitted.statistics, stacked)


@dataclass(frozen=True)
class Recipe:
    """How a log becomes equations. None: found from the logs that are fitted."""

    how: Reconstruction = field(default_factory=Reconstruction)
    cutoff_hz: float | None = None
    decimation: int | None = None
    min_speed: tuple[float, ...] = (0.0,)
    # torque (samples, joints) [N m] that is subtracted: of a given friction
    known: Callable[[Motion], Array] | None = None
    orders: int = 0  # [1/rev] of a torque that a found cut-off lets through at the fastest speed
    lowest_hz: float = 0.0  # of a cut-off that is found
    highest_hz: float = np.inf
    found: bool = False  # whether the fitted logs gave the cut-off, or showed that none is needed
    keep: float = KEEP  # samples left in a period of the cut-off, where no decimation is given


@dataclass(frozen=True, eq=False)
class Fitted:
    """The estimate, and the motions it came from."""

    estimate: Estimate
    motions: Motions
    recipe: Recipe  # with the cut-off that was used
    errors: Errors  # on the logs that were fitted
    weighted: bool  # joints by their own residual


@dataclass(frozen=True, eq=False)
class Judged:
    """How the estimate does on what it was not fitted to."""

    errors: Errors
    by: str  # "logs" | "blocks"
    motions: Motions
    equations: tuple[LogEquations, ...]  # that judge; none where blocks of the fitted logs do


def refuse_strange(given: Any) -> None:
    """C02: a number that no log can be done with, before any log is opened.

    Args:
        given: settings with `blocks`, `min_speed`, `decimate` and `cutoff_hz`.
    """
    if given.blocks < 2:
        words = "1 block" if given.blocks == 1 else f"{given.blocks} blocks"
        raise UsageError("C02", words, "--blocks", "give 2 or more")
    if not all(0.0 <= speed < np.inf for speed in given.min_speed):
        words = "a speed that is no number from zero up"
        raise UsageError("C02", words, "--min-speed", "give 0 or more [rad/s]")
    if given.decimate is not None and given.decimate < 1:
        words = f"every {given.decimate}th sample"
        raise UsageError("C02", words, "--decimate", "give 1 or more")
    if given.cutoff_hz is not None and not 0.0 < given.cutoff_hz < np.inf:
        words = f"a low-pass at {given.cutoff_hz:g} Hz"
        raise UsageError("C02", words, "--cutoff-hz", "give a frequency above 0")


def refuse_unfit(given: Any, log: ExperimentLog) -> None:
    """C02: what no log of this rate and so many joints can be done with."""
    if len(given.min_speed) not in (1, log.n_joints):
        words = f"{len(given.min_speed)} values for {log.n_joints} joints"
        raise UsageError("C02", words, "--min-speed", "give one, or one a joint")
    highest = _CONFIG.highest / log.sample_time
    if given.cutoff_hz is not None and not given.cutoff_hz < highest:
        rate = f"{1.0 / log.sample_time:g} Hz"
        words = f"a low-pass at {given.cutoff_hz:g} Hz for {log.name}, sampled at {rate}"
        limit = f"{_CONFIG.highest:g} of the rate, {highest:g} Hz"
        remedy = f"give a frequency above 0 and below {limit}"
        raise UsageError("C02", words, "--cutoff-hz", remedy)


def refuse_leak(
    fitted: Sequence[ExperimentLog], judging: Sequence[ExperimentLog], way_out: str = ""
) -> None:
    """D14: what a model was fitted to must not judge it."""
    seen = {log.q.tobytes() + log.tau.tobytes(): log for log in fitted}
    for log in judging:
        if (same := seen.get(log.q.tobytes() + log.tau.tobytes())) is not None:
            roles = f"{same.role} and {log.role}"
            words = f"leak: {same.name} and {log.name} hold the same samples with roles {roles}"
            remedy = f"judge on another recording{way_out}"
            raise InputRejected("D14", words, log.source or log.name, remedy)


def motions_of(logs: Sequence[ExperimentLog], how: Reconstruction) -> Motions:
    """Return each log with its motion.

    Raises:
        UsageError, InputRejected: as `reconstruct`, of the first log that it cannot be done for.
    """
    return tuple((log, reconstruct(log, how)) for log in logs)


def with_cutoff(recipe: Recipe, motions: Motions) -> Recipe:
    """Return the recipe with the highest cut-off that any of these logs, or ripple, needs."""
    if recipe.found or recipe.cutoff_hz is not None:
        return recipe
    wanted, turning = [recipe.lowest_hz], 0.0
    for log, found in motions:
        wanted.append(wanted_cutoff(found.motion, 1.0 / log.sample_time))
        speed = np.abs(found.motion.dq[:, list(log.robot.revolute)]).max(initial=0.0)
        turning = max(turning, float(speed))
    wanted.append(recipe.orders * turning / (2.0 * np.pi))
    highest = min(max(wanted), recipe.highest_hz)
    felt = any(cutoff_at(highest, 1.0 / log.sample_time) is not None for log, _ in motions)
    return replace(recipe, cutoff_hz=highest if felt else None, found=True)


def equations_of(
    motions: Motions, recipe: Recipe, columns: Columns, rows: Sequence[Rows] | None = None
) -> list[LogEquations]:
    """Return the equations of every log; of the samples in `rows` where those are given.

    Raises:
        InputRejected: T04, every stretch of a log is too short for the low-pass, or spoilt.
    """
    slow = np.broadcast_to(np.array(recipe.min_speed), columns.body.robot.n_joints)
    cutoff = np.inf if recipe.found and recipe.cutoff_hz is None else recipe.cutoff_hz
    found_equations = []
    for k, (log, found) in enumerate(motions):
        rate = 1.0 / log.sample_time
        how = condition(found.motion, rate, cutoff, recipe.decimation, slow, recipe.keep)
        chosen, held = None if rows is None else rows[k], log.torque != "measured"
        equations = LogEquations(columns, found, how, held, recipe.known, chosen)
        if not equations.runs:
            words = f"no stretch without a gap outlasts the low-pass at {how.cutoff_hz:.3g} Hz"
            remedy = "filter higher with --cutoff-hz, or record longer"
            raise InputRejected("T04", words, log.source or log.name, remedy)
        if equations.rows.out.all():
            raise none_left(log, found)
        found_equations.append(equations)
    return found_equations


def none_left(log: ExperimentLog, found: Reconstructed, few: bool = False) -> InputRejected:
    """Return the refusal of a log of which no sample is left, or so `few` that no row is."""
    where, touched = log.source or log.name, f"touches {'nearly every one' if few else 'every one'}"
    if found.good.saturated.any(axis=1).mean() > _CONFIG.mostly:
        words = f"no sample is left: saturated torque {touched}"
        return InputRejected("D05", words, where, "drive it more gently")
    words = f"no sample is left: what is missing or spoilt {touched}"
    return InputRejected("T04", words, where, "'rrrid inspect' shows what is wrong; record again")


def refuse_too_few(
    equations: Sequence[LogEquations], motions: Motions, fewest: int = _CONFIG.fewest
) -> None:
    """Check before a fit that enough equations are left, in all and of every joint.

    Args:
        fewest: equations in all.

    Raises:
        InputRejected: T08, too few equations are left for a fit, in all or of a joint.
    """
    log = motions[0][0]
    limit = np.max([one.conditioning.min_speed for one in equations], axis=0)
    slow = np.all([one.rows.slow.all(axis=0) for one in equations], axis=0) & (limit > 0.0)
    counts = np.sum([one.counts * one.repeats for one in equations], axis=0)
    j = int(np.argmin(counts))
    if slow.any():
        j = int(np.argmax(slow))
        speeds = [np.abs(found.motion.dq[found.good.kept, j]).max() for _, found in motions]
        unit = "rad/s" if log.robot.joints[j].revolute else "m/s"
        words = f"no equation of joint {j + 1} is left: its largest speed is {max(speeds):.3g} "
        words += f"{unit}, --min-speed asks for {limit[j]:g}"
        remedy = "give less; one value a joint, where their speeds differ"
    elif counts[j] < _CONFIG.fewest_of_joint:
        words = f"{counts[j]:.0f} equations of joint {j + 1} are left"
        remedy = "lower --min-speed or --decimate, or record longer"
    elif counts.sum() < fewest:
        words = f"{counts.sum():.0f} equations are left, too few for a fit"
        remedy = "lower --decimate, filter higher with --cutoff-hz, or record longer"
    else:
        return
    raise InputRejected("T08", words, log.source or log.name, remedy)


def fit_logs(
    motions: Motions,
    columns: Columns,
    recipe: Recipe,
    weighted: bool = True,
    rows: Sequence[Rows] | None = None,
) -> Fitted:
    """Fit the logs; a cut-off that is not given is the highest that any of them needs.

    Raises:
        InputRejected: T04, a log without a stretch that can be used; T08, too few equations.
    """
    recipe = with_cutoff(recipe, motions)
    equations = equations_of(motions, recipe, columns, rows)
    refuse_too_few(equations, motions)
    found = estimate(equations, columns, weighted)
    whole = _of_whole_torque(found.solution.errors, equations)
    return Fitted(found, motions, recipe, whole, weighted)


def judge(
    fitted: Fitted, motions: Motions, blocks: int, rows: Sequence[Rows] | None = None
) -> Judged:
    """Return held-out errors: on other logs, or on blocks of the fitted ones without others."""
    found = fitted.estimate
    if motions:
        equations = equations_of(motions, fitted.recipe, found.columns, rows)
        left = errors(gather(Stacked(equations)), found.beta)
        return Judged(_of_whole_torque(left, equations), "logs", motions, tuple(equations))
    own = found.equations.logs
    left = by_blocks(
        found.equations,
        found.statistics.samples,
        blocks,
        max(one.guard for one in own),
        triangles=found.statistics.triangular,
        weighted=fitted.weighted,
    )
    return Judged(_of_whole_torque(left, own), "blocks", (), ())


def _of_whole_torque(found: Errors, equations: Sequence[LogEquations]) -> Errors:
    """Return the errors relative to the whole torque [N m], where a part had been subtracted.

    Equations of a mean period are scaled by the root of its periods.
    """
    if any(one.known is not None for one in equations):
        whole = gather(Stacked([replace(one, known=None) for one in equations]))
        counts = np.maximum(whole.counts, 1)
        relative = np.sqrt(np.sum(np.square(found.rms) * counts) / whole.power.sum())
        signal = np.sqrt(whole.power / counts)
        found = replace(found, signal_rms=signal, relative_error=float(relative))
    if all(one.repeats == 1 for one in equations):
        return found
    rows = np.sum([one.counts for one in equations], axis=0)
    whole_rows = np.sum([one.counts * one.repeats for one in equations], axis=0)
    shrink = np.sqrt(rows / np.maximum(whole_rows, 1))
    return replace(found, rms=found.rms * shrink, signal_rms=found.signal_rms * shrink)


def moving_rows(
    motions: Motions,
    fitted: int,
    columns: Columns,
    recipe: Recipe,
    weighted: bool = True,
    held: Sequence[Mask] | None = None,
) -> list[Rows]:
    """Return the samples of each log that make equations, without those that dry friction holds.

    Args:
        fitted: how many of `motions`, from the first on, are fitted; the others are judged by.
        held: (joints,) of each log: joints of which no sample makes an equation.
    """
    equations = equations_of(motions, recipe, columns)
    rows = [one.rows for one in equations]
    if held is not None:
        rows = [replace(one, slow=one.slow | own) for one, own in zip(rows, held, strict=True)]
    still = _rests(motions, recipe.cutoff_hz)
    moving = [replace(one, slow=one.slow | mask) for one, mask in zip(rows, still, strict=True)]
    own = [replace(one, chosen=part) for one, part in zip(equations, moving, strict=True)][:fitted]
    counts = np.sum([one.counts for one in own], axis=0)
    if not any(mask.any() for mask in still[:fitted]) or counts.min() < _CONFIG.fewest_of_joint:
        return rows
    weights = None if weighted else np.ones(len(counts))
    in_motion = Stacked(own)
    beta = fit(in_motion, weights=weights).solution.beta
    pairs = zip(own, rows, still, strict=False)
    at_rest = [replace(one, chosen=replace(r, slow=r.slow | ~mask)) for one, r, mask in pairs]
    power, count = np.zeros((2, 2, len(counts)))
    for k, part in enumerate((Stacked(at_rest), in_motion)):
        for block in part:
            power[k] += np.sum(block.residual(beta) ** 2, axis=1)
            count[k] += block.counts
    rest, move = np.sqrt(power / np.maximum(count, 1.0))
    stuck = rest > _CONFIG.more * move
    return [
        replace(one, slow=one.slow | (mask & stuck)) for one, mask in zip(rows, still, strict=True)
    ]


def _rests(motions: Motions, cutoff_hz: float | None) -> list[Mask]:
    """Return the samples (samples, joints) of each log where a joint stands for a period of the
    low-pass, and for another one to either side, over which that spreads what held it.
    """
    speeds = [found.motion.dq[found.good.kept] for _, found in motions]
    accelerations = [found.motion.ddq[found.good.kept] for _, found in motions]
    usual = [_rms(speeds), _rms(accelerations)]
    found_rests = []
    for (log, _), dq, ddq in zip(motions, speeds, accelerations, strict=True):
        period = _CONFIG.memory if cutoff_hz is None else 1.0 / cutoff_hz
        least = math.ceil(period / log.sample_time)
        slow = np.hypot(dq / usual[0], ddq / usual[1]) < _CONFIG.resting
        out = np.zeros(slow.shape, dtype=bool)
        for j in range(slow.shape[1]):
            for start, stop in blocks(slow[:, j]):
                if stop - start > least:
                    out[max(0, start - least) : stop + least, j] = True
        found_rests.append(out)
    return found_rests


def _rms(parts: Sequence[Array]) -> Array:
    return np.asarray(np.maximum(np.sqrt(np.mean(np.vstack(parts) ** 2, axis=0)), 1e-300))
