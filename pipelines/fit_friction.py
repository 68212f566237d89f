"""Fit the friction law of each joint, and choose it.

Reads    "friction" logs of role "identify", each of one joint driven alone; those of role
         "validate" judge; without them "excitation" and "free" logs: friction then is
         fitted with the base parameters
Writes   result.json, result.h5, model.json with the friction, logs/ with its torque, report.html
Source   Kostić et al. 2004, Section IV.B, eq. (10)-(11), Table III, Figs. 5 and 6
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.dynamics.body import Array
from pipelines.dynamics.parameter import Origin, Parameter
from pipelines.dynamics.rrr import rigid_body
from pipelines.errors import Check, NothingMatched, UsageError, did_you_mean
from pipelines.estimation.estimate import Recipe
from pipelines.estimation.motion import Reconstruction, reconstruct
from pipelines.estimation.nominal import fitted_arm
from pipelines.estimation.result import validity
from pipelines.friction.config import FRICTION
from pipelines.friction.findings import findings_of, misfits
from pipelines.friction.joint import JointFit, Seen, fit_joint, friction_of, logs_by_joint
from pipelines.friction.laws import LADDER, Law, law_named
from pipelines.friction.result import Result, joint_result, several_results
from pipelines.friction.several import fit_several
from pipelines.io.files import write_log
from pipelines.io.log import ExperimentLog, derive, digest_of, recording
from pipelines.io.model_file import ModelFile, Source, read_model, write_model
from pipelines.io.option import option
from pipelines.io.results import encode
from pipelines.quality.checks import Subject, accepted
from pipelines.report.friction_report import friction_report
from pipelines.report.report import Report
from pipelines.stage import Inputs, Request, Stage, Uses, read_logs, slug

__all__ = ["STAGE", "Result", "Settings", "compute", "report"]


MOVING = ("excitation", "free")  # experiments in which all joints move
WINDOWS = (1e-3, 1.0)  # numerics: [s] shortest and longest window of the equations


@dataclass(frozen=True)
class Settings:
    """Law and windows of the fit."""

    law: str | None = option(
        None, "Law to fit, as the report names it. [the simplest that is not worse]"
    )
    window: float = option(FRICTION.window, "Windows of the equations [s], the shortest.")
    order: int = Reconstruction.order  # of the smoother that motion begins with
    together: bool = True  # where no joint was driven alone: friction with the base parameters


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Fit every joint that was driven alone.

    Raises:
        NothingMatched: C06, no friction log to fit.
        UsageError: C02, settings that do not fit.
        InputRejected: a check rejects a log: its first reason; T08, too few windows are left.
    """
    law = _law(settings)
    measured = [opened.log for opened in inputs.logs if opened.log.origin != "planned"]
    logs = [log for log in measured if log.experiment == "friction"]
    moving = [log for log in measured if log.experiment in MOVING]
    identify = [log for log in logs if log.role == "identify"]
    together = any(log.role == "identify" for log in moving)
    if not identify and together and settings.together:
        return _together(moving, settings, law, inputs.label)
    if not identify:
        kinds = sorted({f"{one.log.experiment} ({one.log.role})" for one in inputs.logs})
        there = ", ".join(kinds) or "none"
        also = "; fit-friction by itself also takes logs in which all move" if together else ""
        raise NothingMatched(
            "C06",
            f"no friction log of role identify; there are: {there}",
            where=inputs.label,
            remedy="drive each joint alone, the others held, and record it as "
            f"experiment 'friction'{also}",
        )
    used = [log for log in logs if log.role in ("identify", "validate")]
    seen, checks = _examined(used, Reconstruction(order=settings.order))
    parts, elsewhere = logs_by_joint(seen)
    checks += elsewhere
    joints = [fit_joint(part, settings.window, law) for part in parts]
    robot = identify[0].robot
    results = tuple(
        joint_result(joint, robot.joints[joint.logs.joint - 1].name) for joint in joints
    )
    for joint, result in zip(joints, results, strict=True):
        checks += findings_of(joint, result)
    checks += misfits(results, inputs.label)
    arm = _arm(identify[0], joints)
    notes = ["friction fitted by rrrid fit-friction, joint by joint"]
    if arm.body.known_parameters() is None:
        notes.append(
            "base parameters were not fitted and are not known: zero stands for them; "
            "rrrid estimate-bps finds them"
        )
    model = _model(arm, [pair for joint in joints for pair in joint.logs.identify], *notes)
    derived = tuple(
        _derived(pair, joint, arm, settings)
        for joint in joints
        for pair in (*joint.logs.identify, *joint.logs.validate)
    )
    return Result(
        identify[0].robot_name,
        results,
        "one joint at a time",
        tuple(checks),
        model=model,
        derived=derived,
    )


def _together(logs: list[ExperimentLog], settings: Settings, law: Law | None, label: str) -> Result:
    """Fit friction with the base parameters, from logs in which all joints move."""
    how = Reconstruction(order=settings.order)
    if law is not None and (law.sees_load or not law.pointwise):
        raise UsageError(
            "C02",
            f"{law.name} cannot be fitted while all joints move",
            where="--law",
            remedy="drive each joint alone, or choose a law of speed and position",
        )
    seen, checks = _examined([log for log in logs if log.role == "identify"], how)
    others, more = _examined([log for log in logs if log.role == "validate"], how)
    found = fit_several(tuple(seen), tuple(others), Recipe(how), law)
    name = seen[0][0].robot_name
    arm = fitted_arm(found.fitted.estimate, name)
    model = _model(arm, seen, "friction and base parameters fitted together by rrrid fit-friction")
    derived = tuple(
        _with_friction(pair, arm.friction_torque(pair[1].motion), settings)
        for pair in (*seen, *others)
    )
    results = several_results(found, arm, tuple(others))
    return Result(
        name,
        results,
        "all joints at once",
        (*checks, *more, *misfits(results, label)),
        model=model,
        derived=derived,
    )


def _law(settings: Settings) -> Law | None:
    """Return the law to fit; None: choose one."""
    shortest, longest = WINDOWS
    if not shortest <= settings.window <= longest:
        raise UsageError(
            "C02",
            f"windows of {settings.window:g} s",
            where="--window",
            remedy=f"give {shortest:g} to {longest:g} s",
        )
    if settings.law is None:
        return None
    known = [name for law in LADDER for name in (law.name, *law.members)]
    if unknown := [part for part in settings.law.split("+") if part not in known]:
        near = did_you_mean(unknown[0], known)
        raise UsageError(
            "C02",
            f"'{unknown[0]}' is no friction law{near}",
            where="--law",
            remedy=f"one of {', '.join(law.name for law in LADDER)}, or several joined by +",
        )
    return law_named(settings.law)


def _examined(logs: Sequence[ExperimentLog], how: Reconstruction) -> tuple[list[Seen], list[Check]]:
    """Return the motion of every log, and the findings of its quality checks."""
    seen, checks = [], list[Check]()
    for log in logs:
        subject = Subject(recording(log))
        checks += accepted(subject)
        seen.append((log, reconstruct(log, how, subject.good)))
    return seen, checks


def _arm(log: ExperimentLog, joints: Sequence[JointFit]) -> Arm:
    """Return the arm with this friction and the described links; unknown numbers are marked."""
    body = rigid_body(log.robot)
    known = body.known_parameters()
    values = np.zeros(len(body.parameters)) if known is None else known
    origin: Origin = "assumed" if known is None else "known"
    base = tuple(
        Parameter(p.name, float(value), None, p.unit, origin=origin, visible=known is not None)
        for p, value in zip(body.parameters, values, strict=True)
    )
    friction, at_rest = friction_of(joints, log.robot)
    return Arm(log.robot_name, body, base, friction, at_rest)


def _model(arm: Arm, motions: Sequence[Seen], *notes: str) -> ModelFile:
    """Return the model of `arm`, which was fitted to `motions`."""
    sources = tuple(
        Source(log.name, digest_of(recording(log)), log.experiment, log.role) for log, _ in motions
    )
    return arm.to_model(validity=validity(tuple(motions)), sources=sources, notes=notes)


def _derived(
    pair: Seen, joint: JointFit, arm: Arm, settings: Settings
) -> tuple[str, ExperimentLog]:
    friction = arm.friction_torque(pair[1].motion)
    only = np.zeros_like(friction)  # of the joint that was driven: at rest eq. (10) has none
    only[:, joint.logs.joint - 1] = friction[:, joint.logs.joint - 1]
    return _with_friction(pair, only, settings)


def _with_friction(pair: Seen, friction: Array, settings: Settings) -> tuple[str, ExperimentLog]:
    log, motion = pair
    how = Reconstruction(order=settings.order)
    with_motion = derive(log, "reconstruct", how.as_settings(), motion.signals())
    signals = {"tau_friction_model": friction}
    return slug(log.name), derive(with_motion, "fit-friction", encode(settings)[0], signals)


def write(result: Result, folder: Path, request: Request) -> None:
    """Write model.json, and every log with the torque of friction."""
    write_model(folder / "model.json", result.model)
    for name, log in result.derived:
        write_log(folder / f"logs/{name}.{request.format}", log)


def report(result: Result) -> Report:
    """Report Table III, Figs. 5 and 6, the curve with its band, the candidate laws."""
    return friction_report(result)


def _onward(result: Result, inputs: Inputs) -> Inputs:
    """Hand the friction to later stages as known, where every joint has its law."""
    arm = Arm.from_model(result.model)
    whole = result.source == "one joint at a time" and len(result.joints) == arm.n_joints
    return replace(inputs, material=arm) if whole else inputs


def _reads(log: ExperimentLog, settings: Settings) -> bool:
    moving = settings.together and log.experiment in MOVING
    return log.experiment == "friction" or moving


def _exit_code(result: Result, check: bool) -> int:
    return int(check and any(found.gate for found in result.checks))


def _restored(result: Result, folder: Path) -> Result:
    return replace(result, model=read_model(folder / "model.json"))


STAGE = Stage(
    "fit-friction",
    "Fit the friction law of each joint",
    Settings,
    compute,
    report,
    read_logs,
    write,
    _exit_code,
    lambda result: result.checks,
    _onward,
    # estimate-bps fits Coulomb and viscous friction itself
    in_run=Settings(together=False),
    hands_on="material",
    uses=Uses(_reads),
    restored=_restored,
    sessions="one",
)
