"""Diagnose an arm: what its simulation gets wrong, why, and how much better it becomes.

Reads    logs of any experiment: "identify" to fit, "validate" to judge, "reference" as it was
         before; optionally a model
Writes   result.json, result.h5, report.html
Source   Kostić et al. 2004, Sections III and IV, for the model; causes.md and diagnosis.md for what
         it lacks

Gates come first: swapped columns, a flipped sign, a wrong scale or unsynchronised clocks are
refused with their repair named, before any physics is blamed. Logs of role "reference" turn the
question into what has changed since. Takes some 30 s for three joints and two minutes of motion.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

from pipelines.diagnosis.answer import answer
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.engine import diagnose_prepared
from pipelines.diagnosis.result import Diagnosis, Extended, Result
from pipelines.dynamics.arm import Arm
from pipelines.dynamics.named_cause import refuse_unknown
from pipelines.errors import Check, UsageError
from pipelines.estimation.checks.plausibility import examined
from pipelines.estimation.estimate import refuse_strange, refuse_unfit
from pipelines.estimation.preparation import (
    BLOCKS,
    Logs,
    logs_of_roles,
    prepare,
    with_terms_told_apart,
)
from pipelines.io.model_file import read_model
from pipelines.io.option import option
from pipelines.report.diagnosis_report import diagnosis_report
from pipelines.report.finding_words import headlines
from pipelines.report.report import Report
from pipelines.stage import Beside, Inputs, Request, Stage, read_logs

__all__ = ["STAGE", "Result", "Settings", "compute", "read", "report"]

_CUT = 3  # numerics: causes named of those that --max-causes cut off


@dataclass(frozen=True)
class Settings:
    """Options of the diagnosis: roles of logs, excluded causes, length of the search."""

    identify: tuple[str, ...] = ()  # paths of logs to fit, instead of those that say so
    validate: tuple[str, ...] = ()  # that judge
    reference: tuple[str, ...] = ()  # of the arm as it was before
    model: str | None = option(
        None, "model.json whose friction laws are taken. [Coulomb and viscous]", in_run=True
    )
    exclude: tuple[str, ...] = option(
        (), "Exclude this cause: cogging; all causes are listed below. Repeatable.", causes=True
    )
    max_causes: int = option(DiagnosisConfig.causes, "Largest number of causes to look for.")
    blocks: int = option(BLOCKS, "Blocks held out in turn where no log is validate.")
    cutoff_hz: float | None = option(
        None, "Low-pass over torque and columns [Hz]. [of the motion, 10..25]"
    )
    decimate: int | None = option(None, "Keep every Nth sample. [2.6 a period of the low-pass]")
    min_speed: tuple[float, ...] = option(
        (0.0,), "Leave slower samples out [rad/s]: one, or one a joint."
    )
    skip_sanity_checks: bool = option(False, "Diagnose torque that fails its checks.")


@dataclass(frozen=True)
class Material:
    """The model that was read beside the logs."""

    arm: Arm | None
    tell: Callable[[str], None]


def read(request: Request, settings: Settings) -> Inputs:
    """Return the logs in their roles, and the model whose friction laws are to be taken.

    Raises:
        UsageError: C01, C02, a setting that makes no sense, no logs, or a log with two roles; C04,
            no such file.
        InputRejected: S18, a model that cannot be used.
    """
    _refuse_strange(settings)
    roles = {role: getattr(settings, role) for role in ("identify", "validate", "reference")}
    inputs = read_logs(replace(request, roles=roles), settings)
    found = beside(settings, request)
    return replace(
        inputs,
        sources=(*inputs.sources, *found.sources),
        folders=(*inputs.folders, *found.folders),
        material=found.material,
    )


def beside(settings: Settings, request: Request) -> Beside:
    """Return the model whose friction laws are to be taken.

    Raises:
        UsageError: C01, C02, a setting that makes no sense, which no run should begin with; C04, no
            such file.
        InputRejected: S18, a model that cannot be used.
    """
    _refuse_strange(settings)
    if settings.model is None:
        return Beside(Material(None, request.tell), (), ())
    path = Path(settings.model).absolute()
    sources = (path,) if path.is_file() else ()  # a shipped model is not one of the user's files
    return Beside(
        Material(Arm.from_model(read_model(settings.model), path), request.tell), sources, ()
    )


def compute(inputs: Inputs, settings: Settings, whole: bool = True) -> Result:
    """Check the logs, then search for causes.

    Args:
        whole: with detection limits and the series of figures, which have no part in the verdict.

    Raises:
        NothingMatched: C06, no log to fit.
        UsageError: C01, C02, settings that do not fit, logs of several robots, or a model of
            another one.
        InputRejected: `inspect` rejects a log: its first reason; S23, S24, S25, the torque lacks
            gravity, has one of another direction, or has no sign; S13, S14, S15, T06, torque and
            motion of a log do not belong together; T04, no stretch of a log can be used; T08, too
            few equations are left; D14, one recording in two roles.
    """
    _refuse_strange(settings)
    given = (
        inputs.material
        if isinstance(inputs.material, Material)
        else Material(None, lambda words: None)
    )
    if settings.model is not None and given.arm is None:
        raise UsageError(
            "C02",
            "a model is named that was not read",
            where="diagnose",
            remedy="hand on what diagnose.beside reads, as material",
        )
    chosen = logs_of_roles([opened.log for opened in inputs.logs], inputs.label)
    for log in (*chosen.identify, *chosen.validate, *chosen.reference):
        refuse_unfit(settings, log)
    if given.arm is not None and given.arm.n_joints != chosen.identify[0].n_joints:
        raise UsageError(
            "C02",
            f"the model has {given.arm.n_joints} joints, {chosen.identify[0].name} has "
            f"{chosen.identify[0].n_joints}",
            where="--model",
            remedy="give a model of this robot",
        )
    given.tell("examining the logs")
    said, boundary = examined(chosen.every, settings.skip_sanity_checks)
    found, extension = _diagnosed(chosen, settings, given, whole)
    found = replace(_beside_clocks(found, said), boundary=boundary)
    robot = chosen.identify[0].robot
    result = Result(
        **{f.name: getattr(found, f.name) for f in fields(found)},
        robot=chosen.identify[0].robot_name,
        joints=tuple(joint.name for joint in robot.joints),
        rated=tuple(joint.torque for joint in robot.joints),
        without=settings.exclude,
        data_quality=(*said, *found.checks),
        extension=extension,
        laws_of=""
        if given.arm is None or not given.arm.friction
        else Path(settings.model or "").name,
    )
    return replace(result, summary=" ".join(headlines(result)))


def _diagnosed(
    logs: Logs, settings: Settings, given: Material, whole: bool
) -> tuple[Diagnosis, Extended | None]:
    """Return the causes, by one Gaussian model of reference logs and later ones."""
    usual = DiagnosisConfig()
    config = replace(usual, causes=settings.max_causes, cutoff_hz=settings.cutoff_hz)
    rows = config.recipe(settings.decimate, settings.min_speed)
    prepared = with_terms_told_apart(prepare(logs, rows, given.arm), settings.blocks)
    given.tell("comparing with the reference logs" if logs.reference else "looking for causes")
    found = diagnose_prepared(prepared, config, settings.exclude)
    told, extension = answer(prepared, found, given.tell, settings.blocks, whole, settings.exclude)
    return _with_cut(told, found.look.selection.cut, settings.max_causes), extension


def _with_cut(found: Diagnosis, cut: Sequence[tuple[str, int | None]], most: int) -> Diagnosis:
    """Say that the search ended at --max-causes, and which causes were still significant there."""
    if not cut:
        return found
    places = [cause if joint is None else f"{cause}:{joint}" for cause, joint in cut[:_CUT]]
    more = f" and {len(cut) - _CUT} more" if len(cut) > _CUT else ""
    words = (
        f"the search ended at {most} cause{'s' if most > 1 else ''} (--max-causes {most}); "
        f"still significant: {', '.join(places)}{more}"
    )
    return replace(found, reason=f"{found.reason}; {words}" if found.reason else words)


def _beside_clocks(found: Diagnosis, said: Sequence[Check]) -> Diagnosis:
    """Say that torque is late, where it is so in all logs: then nothing has changed."""
    late = next((check for check in said if check.code == "RRID-T06"), None)
    if found.verdict not in ("no-fault-found", "cannot-judge") or late is None:
        return found
    words = f"in {Path(late.where.partition(',')[0]).name} {late.message}"
    return replace(found, reason=f"{found.reason}; {words}" if found.reason else words)


def _refuse_strange(settings: Settings) -> None:
    """C01, C02 for a setting that makes no sense."""
    for cause in settings.exclude:
        refuse_unknown(cause, "--exclude")
        if ":" in cause:
            raise UsageError(
                "C02",
                f"'{cause}': a cause is left out as a whole, at every joint",
                where="--exclude",
                remedy=f"write {cause.split(':')[0]}",
            )
    refuse_strange(settings)
    if settings.max_causes < 1:
        raise UsageError(
            "C02",
            f"{settings.max_causes} findings at most",
            where="--max-causes",
            remedy="give 1 or more",
        )


def _exit_code(result: Result, check: bool) -> int:
    return int(check and result.verdict != "no-fault-found")


def report(result: Result) -> Report:
    """Return the verdict and what to check, each finding's proof, alternatives and limits."""
    return diagnosis_report(result)


STAGE = Stage(
    "diagnose",
    "Diagnose what the simulation gets wrong",
    Settings,
    compute,
    report,
    read,
    None,
    _exit_code,
    lambda result: result.data_quality,
    lambda result, inputs: replace(inputs, material=result),
    hands_on="material",
    beside=beside,
    sessions="one",
)
