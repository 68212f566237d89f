"""Extend the model by named causes, refit everything, and say what it gains on held-out logs.

Reads    logs of roles "identify", "validate" and "reference"; the causes; optionally a model, whose
         effects are kept
Writes   model.json where every rule of acceptance is kept, result.json, result.h5, logs/ with the
         model's torque, report.html
Source   causes.md for the causes; Kostić et al. 2004, eq. (4), (12)-(15), for the rest

A cause is accepted where its gain on held-out torque is beyond its bootstrap interval, where the
logs agree on its size, and where no held-out log gets worse by more than a tenth. Compliance takes
its numbers from frequency responses, a payload from how the base parameters moved since the
reference logs. What is not accepted is named with the reason; there is no way around it. Takes some
10 s for three joints and two minutes of motion.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.extension import extend
from pipelines.diagnosis.result import Extended, Extension
from pipelines.diagnosis.result import Result as Diagnosed
from pipelines.dynamics.arm import Arm
from pipelines.dynamics.named_cause import refuse_unknown, wanted_cause
from pipelines.effects import find_effect
from pipelines.effects.base import Effect
from pipelines.errors import NothingMatched, UsageError
from pipelines.estimation.candidate_columns import Wanted, place_of
from pipelines.estimation.checks.plausibility import examined
from pipelines.estimation.estimate import refuse_strange, refuse_unfit
from pipelines.estimation.motion import Motions, Reconstructed
from pipelines.estimation.preparation import (
    BLOCKS,
    Logs,
    logs_of_roles,
    prepare,
    with_terms_told_apart,
)
from pipelines.estimation.result import torques, validity
from pipelines.io.files import write_log
from pipelines.io.log import ExperimentLog, derive, digest_of, recording
from pipelines.io.model_file import ModelFile, Source, read_model, write_model
from pipelines.io.option import option
from pipelines.report.diagnosis_report import extension_report
from pipelines.report.report import Report
from pipelines.report.words import fewer_words
from pipelines.stage import Inputs, Request, Stage, Uses, read_logs, slug

__all__ = ["STAGE", "Extension", "Settings", "compute", "read", "report"]


@dataclass(frozen=True)
class Settings:
    """By what the model is extended, and which logs do what."""

    causes: tuple[str, ...] = option(
        (),
        "CAUSE:JOINT, or CAUSE:JOINT:NAME=VALUE with a start for a non-linear number: "
        "cogging:2:order=18; all causes are listed below. What may act more than once at a joint, "
        "waves of several orders say, does so as held-out logs confirm. Repeatable.",
        "--with",
        causes=True,
    )
    identify: tuple[str, ...] = ()  # paths of logs to fit, instead of those that say so
    validate: tuple[str, ...] = ()  # that judge
    reference: tuple[str, ...] = ()  # of the arm as it was before
    model: str | None = option(None, "model.json to extend: its effects are kept, and fitted anew.")
    blocks: int = option(BLOCKS, "Blocks held out in turn where no log is validate.")
    cutoff_hz: float | None = option(
        None, "Low-pass over torque and columns [Hz]. [of the motion, 10..25]"
    )
    decimate: int | None = option(None, "Keep every Nth sample. [2.6 a period of the low-pass]")
    min_speed: tuple[float, ...] = option(
        (0.0,), "Leave slower samples out [rad/s]: one, or one a joint."
    )
    skip_sanity_checks: bool = option(False, "Fit torque that fails its checks.")


@dataclass(frozen=True)
class Material:
    """The model and causes that were read beside the logs."""

    arm: Arm | None
    tell: Callable[[str], None]


def read(request: Request, settings: Settings) -> Inputs:
    """Read the logs in their roles, and the model to extend.

    Raises:
        UsageError: C01, no such cause; C02, no cause, no logs, or a log with two roles; C04, no
            such file.
    """
    if not settings.causes:
        raise UsageError(
            "C02", "no cause", where="--with", remedy="name one, as diagnose does: --with cogging:2"
        )
    for text in settings.causes:
        refuse_unknown(text, "--with")
    refuse_strange(settings)
    roles = {role: getattr(settings, role) for role in ("identify", "validate", "reference")}
    inputs = read_logs(replace(request, roles=roles), settings)
    if settings.model is None:
        return replace(inputs, material=Material(None, request.tell))
    path = Path(settings.model).absolute()
    sources = (path,) if path.is_file() else ()  # a shipped model is not one of the user's files
    arm = Arm.from_model(read_model(settings.model), path)
    return replace(
        inputs, sources=(*inputs.sources, *sources), material=Material(arm, request.tell)
    )


def compute(inputs: Inputs, settings: Settings) -> Extension:
    """Check the logs, fit the model with the causes, and judge it on held-out logs.

    Raises:
        NothingMatched: C06, no log to fit; within `run`, nothing that diagnose found, or no
            diagnose.
        UsageError: C01, C02, causes or settings that do not fit, logs of several robots, a model of
            another one.
        InputRejected: as `diagnose`.
    """
    refuse_strange(settings)
    known = inputs.material
    given = known if isinstance(known, Material) else Material(None, lambda words: None)
    before = known if isinstance(known, Diagnosed) else None
    chosen = logs_of_roles([opened.log for opened in inputs.logs], inputs.label)
    for log in (*chosen.identify, *chosen.validate, *chosen.reference):
        refuse_unfit(settings, log)
    first = chosen.identify[0]
    if given.arm is not None and given.arm.n_joints != first.n_joints:
        words = f"the model has {given.arm.n_joints} joints, {first.name} has {first.n_joints}"
        raise UsageError("C02", words, where="--model", remedy="give a model of this robot")
    wanted = _wanted(settings, given.arm, before, first.robot.revolute, inputs.label)
    if before is None:
        said = examined(chosen.every, settings.skip_sanity_checks)[0]
    else:
        said = before.data_quality
    found = before.extension if before is not None and not settings.causes else None
    if found is None:
        given.tell(f"fitting {', '.join(dict.fromkeys(one.place for one in wanted))}")
        found = _extended(chosen, settings, given.arm, wanted)
    named = given.arm is not None and given.arm.friction
    return Extension(
        accepted=not found.rejected,
        causes=tuple(dict.fromkeys(one.place for one in wanted)),
        findings=found.findings,
        rejected=found.rejected,
        gain=found.gain,
        residual_rms=found.before,
        after_rms=found.after,
        held_out=found.held_out,
        baseline_effects=tuple(one.place for one in found.standing),
        robot=first.robot_name,
        joints=tuple(joint.name for joint in first.robot.joints),
        rated=tuple(joint.torque for joint in first.robot.joints),
        data_quality=said,
        model=_model(found, first.robot_name),
        derived=_derived(found, settings),
        laws_of=Path(settings.model or "").name if named else "",
        fewer_terms=found.fewer,
        revolute=tuple(first.robot.revolute),
    )


def _wanted(
    settings: Settings,
    arm: Arm | None,
    before: Diagnosed | None,
    revolute: Sequence[bool],
    label: str,
) -> list[Wanted]:
    """Return the causes to extend the model by.

    Raises:
        NothingMatched: C06, no such log.
    """
    if before is not None and not settings.causes:
        return _found(before, label)
    named = (Wanted(*wanted_cause(text, revolute)) for text in settings.causes)
    wanted = [*_kept(arm), *named]
    if not wanted:
        words = "no cause is named, and diagnose, which would name one, was not done"
        remedy = "name a cause: rrrid extend LOGS --with CAUSE:JOINT"
        raise NothingMatched("C06", words, where=label, remedy=remedy)
    return wanted


def _extended(
    chosen: Logs, settings: Settings, arm: Arm | None, wanted: Sequence[Wanted]
) -> Extended:
    """Return the model fitted with the causes, as far as held-out rows bear them out."""
    config = replace(DiagnosisConfig(), cutoff_hz=settings.cutoff_hz)
    rows = config.recipe(settings.decimate, settings.min_speed)
    prepared = with_terms_told_apart(prepare(chosen, rows, arm), settings.blocks)
    return extend(prepared, _each(wanted), config, settings.blocks)


def _model(found: Extended, name: str) -> ModelFile | None:
    """Return the model file of what was accepted."""
    if found.arm is None:
        return None
    places = ", ".join(place_of(one.cause, one.joint) for one in found.findings)
    return replace(found.arm, name=name).to_model(
        validity=validity(found.motions[: found.fitted]),
        sources=_sources(found.motions),
        notes=(f"fitted by rrrid extend, with {places}", *fewer_words(found.fewer)),
    )


def _each(wanted: Sequence[Wanted]) -> tuple[Wanted, ...]:
    """Return each once; a place has all starts that the model before and the user give there."""
    return tuple({(one.place, *sorted(one.start.items())): one for one in wanted}.values())


def _kept(arm: Arm | None) -> list[Wanted]:
    """Return the effects that the model has already: they are fitted anew beside the others."""
    return [
        Wanted(
            acting.effect,
            {
                q.name: acting.values[q.name]
                for q in acting.effect.parameters
                if q.shape and not q.derived
            },
        )
        for acting in (arm.effects if arm is not None else ())
    ]


def _found(diagnosed: Diagnosed, label: str) -> list[Wanted]:
    """Return the causes that `diagnose` named, within `run`, without those that happen once."""
    named = [
        Wanted(find_effect(one.cause)(joint=one.joint))
        for one in diagnosed.findings
        if diagnosed.verdict == "cause" and not _once(find_effect(one.cause))
    ]
    if not named:
        raise NothingMatched(
            "C06",
            f"{_found_instead(diagnosed)}: there is nothing to extend the model by",
            where=label,
            remedy="to try a cause all the same, name it: rrrid extend LOGS --with CAUSE:JOINT",
        )
    return named


def _found_instead(diagnosed: Diagnosed) -> str:
    """Return the outcome of `diagnose` in words, where it names nothing that a model could have."""
    if diagnosed.verdict == "unknown":
        return "diagnose found something wrong, and no cause for it"
    if diagnosed.verdict == "cannot-judge":
        return "diagnose cannot judge these logs"
    if diagnosed.findings:
        return "what diagnose found happens once, and has no place in a model"
    changed = diagnosed.question == "what has changed"
    what = "that has changed since the reference logs" if changed else "wrong"
    return f"diagnose found nothing {what}"


def _once(kind: type[Effect]) -> bool:
    """Return whether it happens at a moment of one log."""
    return kind.clock == "log"


def _sources(motions: Motions) -> tuple[Source, ...]:
    return tuple(
        Source(log.name, digest_of(recording(log)), log.experiment, log.role) for log, _ in motions
    )


def _derived(found: Extended, settings: Settings) -> tuple[tuple[str, ExperimentLog], ...]:
    """Every log with the torque of the extended model and what it leaves."""
    if found.arm is None:
        return ()
    return tuple(
        (slug(log.name), _with_torque(log, motion, found.arm, settings.causes))
        for log, motion in found.motions
    )


def _with_torque(
    log: ExperimentLog, motion: Reconstructed, arm: Arm, causes: Sequence[str]
) -> ExperimentLog:
    parts = torques(arm, log, motion)
    total = parts.total
    return derive(
        log,
        "extend",
        {"causes": list(causes)},
        {"tau_model": total, "tau_effects": parts.effects, "tau_residual": log.tau - total},
    )


def write(result: Extension, folder: Path, request: Request) -> None:
    """model.json, and every log with the model's torque."""
    if result.model is not None:
        write_model(folder / "model.json", result.model)
    for name, log in result.derived or ():
        write_log(folder / f"logs/{name}.{request.format}", log)


def report(result: Extension) -> Report:
    """Return the verdict, the gain, each cause with its proof, what was not accepted and why."""
    return extension_report(result)


STAGE = Stage(
    "extend",
    "Extend the model by named causes",
    Settings,
    compute,
    report,
    read,
    write,
    lambda result, check: int(check and not result.accepted),
    lambda result: result.data_quality,
    uses=Uses(before=True),
    sessions="one",
)
