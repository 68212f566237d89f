"""Estimate the base parameter set by least squares.

Reads    logs with experiment "excitation" or "free", role "identify"; every log of role "validate"
         judges; optionally a model with friction
Writes   result.json, result.h5, model.json, logs/ with the model's torque and the residual,
         report.html
Source   Kostić et al. 2004, eq. (12)-(15), Table V, Figs. 9, 11, 12
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from pipelines.dynamics.arm import Arm
from pipelines.dynamics.parameter import Uncertainty
from pipelines.errors import Check, NothingMatched, UsageError
from pipelines.estimation.checks.plausibility import examined
from pipelines.estimation.consistency import consistency
from pipelines.estimation.estimate import (
    Fitted,
    Judged,
    Recipe,
    fit_logs,
    judge,
    motions_of,
    moving_rows,
    refuse_leak,
    refuse_strange,
    refuse_unfit,
    with_cutoff,
)
from pipelines.estimation.identifiability import not_separated
from pipelines.estimation.judgements import REMEDY, negative_viscous, unresolved
from pipelines.estimation.motion import Motions, Reconstruction, for_equations
from pipelines.estimation.nominal import fitted_arm, nominal_columns
from pipelines.estimation.periods import averaged, doubts, residuals
from pipelines.estimation.regression import Columns
from pipelines.estimation.result import (
    Result,
    course,
    of_this_robot,
    parameters,
    torques,
    validity,
    with_torques,
)
from pipelines.io.files import write_log
from pipelines.io.log import ExperimentLog, digest_of, recording
from pipelines.io.model_file import (
    Source,
    read_covariance,
    read_model,
    write_covariance,
    write_model,
)
from pipelines.io.option import option
from pipelines.io.results import encode
from pipelines.io.schema import joint_unit
from pipelines.report.bps_report import bps_report
from pipelines.report.report import Report
from pipelines.stage import Inputs, Request, Stage, Uses, read_logs

__all__ = ["STAGE", "Result", "Settings", "compute", "read", "report"]

FITTED = ("excitation", "free")
_COURSES = 3  # numerics: logs drawn


@dataclass(frozen=True)
class Settings(Reconstruction):
    """How motion is reconstructed, what is done to torque and columns, and what is estimated."""

    cutoff_hz: float | None = option(
        None, "Low-pass over torque and columns [Hz]. [from the motion]"
    )
    decimate: int | None = option(None, "Keep every Nth sample. [four a period of the low-pass]")
    min_speed: tuple[float, ...] = option(
        (0.0,), "Leave slower samples out [rad/s]: one, or one a joint."
    )
    symmetric: bool = option(False, "RRR arm, mirror-symmetric links: p4 = p15 = 0.")
    weighted: bool = option(True, "Weigh all joints alike, as Kostić et al. 2004.", "--unweighted")
    offset: bool = True
    rotor_inertia: bool | None = None  # None: on geared arms
    blocks: int = option(10, "Blocks held out in turn where no log is validate.")
    model: str | None = option(None, "model.json whose friction is subtracted, not fitted.")
    allow_overlap: bool = option(False, "One recording may be fitted and judged by.")
    skip_sanity_checks: bool = option(False, "Fit torque that fails its checks.")

    @property
    def reconstruction(self) -> Reconstruction:
        return Reconstruction(self.method, self.order, self.bandwidth)


def read(request: Request, settings: Settings) -> Inputs:
    """Read the logs, and the model whose friction is to be taken."""
    refuse_strange(settings)
    inputs = read_logs(request, settings)
    if settings.model is None:
        return inputs
    path = Path(settings.model).absolute()
    # a shipped model is not one of the user's files
    sources = (*inputs.sources, *((path,) if path.is_file() else ()))
    material = Arm.from_model(read_model(settings.model), path)
    return replace(inputs, sources=sources, material=material)


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Fit, judge, check.

    Raises:
        NothingMatched: C06, no log to fit.
        UsageError: C02, settings that do not fit, logs of several robots, or another's model.
        InputRejected: `inspect` rejects a log: its first reason; S23, S24, S25, the torque lacks
            gravity, has one of another direction, or has no sign; S13, S14, S15, T06, torque and
            motion of a log do not belong together; T04, no stretch of a log can be used; T08, too
            few equations are left; D14, a log that is fitted shall judge as well.
    """
    refuse_strange(settings)
    identify, validate = _chosen(inputs, settings.allow_overlap)
    logs, first = (*identify, *validate), len(identify)
    given: Arm | None = inputs.material
    if given is not None and not of_this_robot(given, logs[0]).friction:
        given = None
    how = settings.reconstruction
    for log in logs:
        how.check(log.n_joints)
        refuse_unfit(settings, log)
    said, boundary = examined(logs, settings.skip_sanity_checks, gates=True)
    motions = motions_of(logs, how)
    even = for_equations(motions)
    known = None if given is None else given.friction_torque
    recipe = Recipe(how, settings.cutoff_hz, settings.decimate, settings.min_speed, known)
    recipe = with_cutoff(recipe, even[:first])
    means, scatter = averaged(even, recipe.cutoff_hz)
    columns_of = partial(
        nominal_columns,
        logs[0].robot,
        rotor_inertia=settings.rotor_inertia,
        symmetric=settings.symmetric,
    )
    columns = columns_of(friction=given is None, offset=settings.offset)
    rows = moving_rows(means, first, columns, recipe, settings.weighted)

    def judged_fit(columns: Columns, recipe: Recipe) -> tuple[Fitted, Judged]:
        fitted = fit_logs(means[:first], columns, recipe, settings.weighted, rows[:first])
        return fitted, judge(fitted, means[first:], settings.blocks, rows[first:])

    fitted, judged = judged_fit(columns, recipe)
    rigid = columns_of(friction=False, offset=False)
    alone = judged_fit(rigid, replace(recipe, known=None))[1]
    arm = fitted_arm(fitted.estimate, logs[0].robot_name, given.friction if given else ())
    for own, log in zip(scatter, logs, strict=True):
        if own is not None:
            said = (*said, *doubts(own[0], log.source or log.name))
    return replace(
        _result(fitted, judged, motions, arm, settings),
        boundary=boundary,
        data_quality=(*said, *negative_viscous(fitted.estimate, arm.name)),
        noise_floor=residuals(scatter, fitted, judged, logs),
        rigid_body_alone=tuple(map(float, alone.errors.rms)),
    )


def _chosen(inputs: Inputs, allow_overlap: bool) -> tuple[list[ExperimentLog], list[ExperimentLog]]:
    """Return the logs that are fitted, and those that judge."""
    logs = [opened.log for opened in inputs.logs if opened.log.origin != "planned"]
    identify = [log for log in logs if log.role == "identify" and log.experiment in FITTED]
    if not identify:
        kinds = ", ".join(sorted({f"{log.experiment} ({log.role})" for log in logs})) or "none"
        words = f"no excitation or free log of role identify; there are: {kinds}"
        remedy = "record an excitation, or give the folder that has one"
        raise NothingMatched("C06", words, inputs.label, remedy)
    if len({log.robot_text for log in logs}) > 1:
        remedy = "name the logs of one; 'rrrid run' takes a folder of several apart"
        raise UsageError("C02", "logs of several robots", inputs.label, remedy)
    validate = [log for log in logs if log.role == "validate"]
    if not allow_overlap:
        refuse_leak(identify, validate, ", or say --allow-overlap")
    return identify, validate


def _result(
    fitted: Fitted, judged: Judged, motions: Motions, arm: Arm, settings: Settings
) -> Result:
    found, fits = fitted.estimate, len(fitted.motions)
    both = {"identify": fitted.errors, "validate": judged.errors}
    growth, checked = found.convergence(), consistency(found, arm.body)
    names = [column.name for column in found.columns.names]
    model = None if settings.model is None else Path(settings.model).name
    given = fitted.recipe.known is not None
    parts = [(log, motion, torques(arm, log, motion)) for log, motion in motions]
    how = encode(replace(settings, model=model))[0]
    return Result(
        robot=arm.name,
        joints=tuple(joint.name for joint in arm.robot.joints),
        torque_units=tuple(joint_unit("tau", joint.revolute) for joint in arm.robot.joints),
        parameters=parameters(fitted, arm),
        condition_number=found.condition_number,
        condition_number_fit=found.solution.condition,
        rank=found.solution.rank,
        relative_error={key: e.relative_error for key, e in both.items()},
        torque_rms={key: tuple(map(float, e.rms)) for key, e in both.items()},
        torque_signal_rms={key: tuple(map(float, e.signal_rms)) for key, e in both.items()},
        held_out=judged.by,
        filter_hz=fitted.recipe.cutoff_hz,
        equations=tuple(map(int, found.statistics.counts)),
        friction="given" if given else "fitted",
        friction_of=(model or "fit-friction") if given else "",
        physically_consistent=None if checked is None else checked.consistent,
        consistency=checked,
        unresolved=unresolved(found),
        not_separated=not_separated(found.solution, found.std, names),
        convergence_samples=growth.samples,
        convergence=growth.beta,
        convergence_std=growth.std,
        courses=tuple(course(*one, fitted.recipe.cutoff_hz) for one in parts[:_COURSES]),
        arm=arm,
        model=arm.to_model(
            validity=validity(motions[:fits]),
            # by the digest of either container
            sources=tuple(
                Source(log.name, digest_of(recording(log)), log.experiment, log.role)
                for log, _ in motions
            ),
            notes=(f"fitted by rrrid estimate-bps, motion by {settings.method}",),
        ),
        derived=tuple(
            with_torques(log, motion, settings.reconstruction, own, "estimate-bps", how)
            for log, motion, own in parts
        ),
    )


def _checks(result: Result) -> tuple[Check, ...]:
    found = list(result.data_quality)
    if result.unresolved:
        found.append(
            Check.of("D09", "warn", result.unresolved, where=result.robot, gate=True, remedy=REMEDY)
        )
    if result.consistency is not None and not result.consistency.consistent:
        links = ", ".join(result.consistency.violating)
        away = f"{result.consistency.distance:.1f} standard deviations away"
        words = f"no links that could exist have these parameters ({away}); "
        words += f"{links} would need negative mass or inertia"
        remedy = "look for an effect that the model lacks, or for wrong units and signs"
        found.append(Check.of("D15", "warn", words, result.robot, remedy, gate=True))
    return tuple(found)


def write(result: Result, folder: Path, request: Request) -> None:
    """Write model.json, its covariance, and every log with the model's torque and the residual."""
    write_model(folder / "model.json", result.model)
    if (known := result.arm.uncertainty) is not None:
        write_covariance(folder / "covariance.json", known.names, known.covariance)
    for name, log in result.derived:
        write_log(folder / f"logs/{name}.{request.format}", log)


def report(result: Result) -> Report:
    """Return the verdict, Table V with standard deviations, and what the estimate rests on."""
    return bps_report(result)


def _reads(log: ExperimentLog, settings: Settings) -> bool:
    """Return whether a log is fitted, or judges."""
    return log.role == "validate" or (log.role == "identify" and log.experiment in FITTED)


def _restored(result: Result, folder: Path) -> Result:
    """Return a stored result with its model, from the files that `write` wrote."""
    arm = Arm.from_model(read_model(folder / "model.json"), folder)
    known = folder / "covariance.json"
    return replace(
        result,
        arm=replace(
            arm, uncertainty=Uncertainty(*read_covariance(known)) if known.is_file() else None
        ),
    )


STAGE = Stage(
    "estimate-bps",
    "Estimate the base parameter set",
    Settings,
    compute,
    report,
    read,
    write,
    lambda result, check: int(check and any(found.gate for found in _checks(result))),
    _checks,
    lambda result, inputs: replace(inputs, material=result.arm),
    hands_on="material",
    restored=_restored,
    uses=Uses(_reads, before=True),
    sessions="one",
)
