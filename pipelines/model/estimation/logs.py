"""Fit several logs together and judge the fit on others: every log reconstructed and conditioned alike."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.errors import InputRejected
from pipelines.fit.least_squares import Errors
from pipelines.fit.statistics import gather
from pipelines.log.experiment import Array, ExperimentLog
from pipelines.model.estimation.estimate import Estimate, Stacked, by_blocks, estimate, power_of
from pipelines.model.estimation.regression import Columns, Conditioning, LogEquations, condition
from pipelines.model.motion import Reconstructed, Reconstruction, reconstruct
from pipelines.model.rigid.body import Motion

__all__ = ["Fitted", "Judged", "Motions", "Recipe", "equations_of", "fit_logs", "judge"]

Motions = tuple[tuple[ExperimentLog, Reconstructed], ...]


@dataclass(frozen=True)
class Recipe:
    """What is done to a log before it becomes equations. None: found from the logs that are fitted."""

    how: Reconstruction
    cutoff_hz: float | None = None
    decimation: int | None = None
    min_speed: tuple[float, ...] = (0.0,)
    known: Callable[[Motion], Array] | None = None  # torque (samples, joints) [N m] that is subtracted: of a given friction


@dataclass(frozen=True, eq=False)
class Fitted:
    """The estimate, and the motions it came from."""

    estimate: Estimate
    motions: Motions
    recipe: Recipe  # with the cut-off that was used
    errors: Errors  # on the logs that were fitted

    @property
    def cutoff_hz(self) -> float | None:
        return self.recipe.cutoff_hz


@dataclass(frozen=True, eq=False)
class Judged:
    """How the estimate does on what it was not fitted to."""

    errors: Errors
    by: str  # "logs" | "blocks"
    motions: Motions


def fit_logs(logs: Sequence[ExperimentLog], columns: Columns, recipe: Recipe, weighted: bool = True) -> Fitted:
    """Fit `logs`; the cut-off, where it is not given, is the highest that any of them asks for, and the same for all."""
    motions = tuple((log, reconstruct(log, recipe.how)) for log in logs)
    if recipe.cutoff_hz is None:
        asked = [_condition(log, found, recipe, columns).cutoff_hz for log, found in motions]
        known = [cutoff for cutoff in asked if cutoff is not None]
        recipe = replace(recipe, cutoff_hz=max(known) if known else None)
    equations = [equations_of(log, found, recipe, columns) for log, found in motions]
    found = estimate(equations, columns, weighted)
    return Fitted(found, motions, recipe, _of_whole_torque(found.solution.errors, motions, recipe, columns))


def judge(fitted: Fitted, logs: Sequence[ExperimentLog], blocks: int) -> Judged:
    """Held-out errors: on `logs`, or on contiguous blocks of the fitted ones where there are none."""
    found = fitted.estimate
    if not logs:
        errors = by_blocks(found.equations, blocks, found.solution.weights)
        return Judged(_of_whole_torque(errors, fitted.motions, fitted.recipe, found.columns), "blocks", ())
    motions = tuple((log, reconstruct(log, fitted.recipe.how)) for log in logs)
    equations = [equations_of(log, motion, fitted.recipe, found.columns) for log, motion in motions]
    errors = power_of(equations, found.beta)
    return Judged(_of_whole_torque(errors, motions, fitted.recipe, found.columns), "logs", motions)


def _of_whole_torque(found: Errors, motions: Motions, recipe: Recipe, columns: Columns) -> Errors:
    """The same residual beside the whole torque, where a known part had been subtracted from it."""
    if recipe.known is None:
        return found
    whole = gather(Stacked([equations_of(log, motion, replace(recipe, known=None), columns) for log, motion in motions]))
    counts = np.maximum(whole.counts, 1)
    return replace(found, signal_rms=np.sqrt(whole.power / counts),
                   relative_error=float(np.sqrt(np.sum(np.square(found.rms) * counts) / whole.power.sum())))


def _condition(log: ExperimentLog, found: Reconstructed, recipe: Recipe, columns: Columns) -> Conditioning:
    slow: Array = np.broadcast_to(np.array(recipe.min_speed, dtype=np.float64), columns.body.robot.n_joints)
    return condition(found.motion, 1.0 / log.sample_time, recipe.cutoff_hz, recipe.decimation, slow)


def equations_of(log: ExperimentLog, found: Reconstructed, recipe: Recipe, columns: Columns) -> LogEquations:
    """The equations of one log.

    Raises:
        InputRejected: T04, every stretch of it is too short for the low-pass.
    """
    how = _condition(log, found, recipe, columns)
    equations = LogEquations(columns, found, how, held=log.torque != "measured", known=recipe.known)
    if not equations.runs:
        raise InputRejected("T04", f"no stretch without a gap outlasts the low-pass at {how.cutoff_hz:.3g} Hz",
                            where=log.source or log.name, remedy="filter higher with --filter, or record longer")
    return equations
