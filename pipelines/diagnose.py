"""Diagnose an arm: what its simulation gets wrong, why, and how much better it becomes.

Reads    logs of any experiment: "identify" to fit, "validate" to judge, "reference" as it was before; optionally a model
Writes   result.json, result.h5, report.html; calibration.json and calibration.h5, thresholds for later logs of the same arm
Source   Kostić et al. 2004, Sections III and IV, for the model; causes.md and diagnosis.md for what it lacks

Gates come first: swapped columns, a flipped sign, a wrong scale or unsynchronised clocks are refused with their repair named,
before any physics is blamed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path

from pipelines.diagnosis.answer import WITHOUT_REFERENCE, answer
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.engine import diagnose_prepared
from pipelines.errors import Check, UsageError
from pipelines.log.model_file import read_model
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.answered.outcome import Result
from pipelines.model.diagnosis.asked.gates import logs_of_roles
from pipelines.model.diagnosis.asked.inputs import Logs
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.diagnose import diagnose
from pipelines.model.diagnosis.floor.calibration import Calibration
from pipelines.model.diagnosis.floor.calibration_file import calibration_files, read_calibration, write_calibration
from pipelines.model.diagnosis.memory import Memory
from pipelines.model.diagnosis.result import Diagnosis
from pipelines.model.diagnosis.worth.extended import Extended
from pipelines.model.estimation.allowed import refuse_strange, refuse_unfit
from pipelines.model.named_cause import refuse_unknown
from pipelines.report.diagnosis_report import diagnosis_report
from pipelines.report.report import Report
from pipelines.stage import Beside, Inputs, Request, Stage, read_by_role

__all__ = ["STAGE", "Result", "Settings", "compute", "read", "report"]


@dataclass(frozen=True)
class Settings:
    """Which logs do what, what is left out, and how long to look."""

    identify: tuple[str, ...] = ()  # paths of logs to fit, instead of those that say so
    validate: tuple[str, ...] = ()  # that judge
    reference: tuple[str, ...] = ()  # of the arm as it was before
    model: str | None = field(default=None, metadata={"in_run": True})  # a model file: the nominal model takes its friction laws
    without: tuple[str, ...] = ()  # causes that it cannot be, the user says
    replicas: int = DiagnosisSettings.replicas  # of the simulated twin; 0: none
    most: int = DiagnosisSettings.most  # findings
    blocks: int = DiagnosisSettings.blocks  # held out in turn where no log is
    filter: float | None = None  # [Hz] low-pass over torque and columns; None: from the motion
    decimate: int | None = None  # every so-manieth sample; None: from the filter
    min_speed: tuple[float, ...] = (0.0,)  # [rad/s] slower samples of a joint are left out of its own equations
    seed: int = DiagnosisSettings.seed  # of the twin's noise
    calibration: str | None = None  # thresholds that an earlier diagnosis has stored: its folder, or its calibration.json
    allow_mismatch: bool = False  # torque that looks swapped, flipped, scaled or mistimed beside the motion is diagnosed


@dataclass(frozen=True)
class Material:
    """What was read beside the logs."""

    arm: Arm | None
    tell: Callable[[str], None]
    calibration: Calibration | None = None


def read(request: Request, settings: Settings) -> Inputs:
    """The logs in their roles, the model whose friction laws are to be taken, and stored thresholds.

    Raises:
        UsageError: C01, C02, a setting that makes no sense, no logs, or a log with two roles; C04, no such file.
        InputRejected: a model (S18) or a calibration (S19, F05, F11) that cannot be used.
    """
    _refuse_strange(settings)
    inputs = read_by_role(request, settings, {"identify": settings.identify, "validate": settings.validate,
                                              "reference": settings.reference})
    found = beside(settings, request)
    return replace(inputs, sources=(*inputs.sources, *found.sources), folders=(*inputs.folders, *found.folders),
                   material=found.material)


def beside(settings: Settings, request: Request) -> Beside:
    """The model whose friction laws are to be taken, and stored thresholds.

    Raises:
        UsageError: C01, C02, a setting that makes no sense, which no run should begin with; C04, no such file.
        InputRejected: a model (S18) or a calibration (S19, F05, F11) that cannot be used.
    """
    _refuse_strange(settings)
    stored, arm = None, None
    sources: tuple[Path, ...] = ()
    folders: tuple[Path, ...] = ()
    if settings.calibration is not None:
        home = Path(settings.calibration).expanduser().absolute()
        stored = read_calibration(home)
        sources, folders = calibration_files(home), (home,)
    if settings.model is not None:
        path = Path(settings.model).absolute()
        sources += (path,) if path.is_file() else ()  # one that is shipped is none of the user's files
        arm = Arm.from_model(read_model(settings.model), path)
    return Beside(Material(arm, request.tell, stored), sources, folders)


def compute(inputs: Inputs, settings: Settings, whole: bool = True) -> Result:
    """Gates, then the search.

    Args:
        whole: with detection limits, what they find beyond all reach, and the series of figures: none has a part in the verdict, in
            findings or their numbers.

    Raises:
        NothingMatched: C06, no log to fit.
        UsageError: C01, C02, settings that do not fit, logs of several robots, or a model or a calibration of another one.
        InputRejected: the doctor rejects a log: its first reason; S23, S24, S25, the torque lacks gravity, has one of another
            direction, or has no sign; S13, S14, S15, T06, torque and motion of a log do not belong together; T04, no stretch of
            a log can be used; T08, too few equations are left; D14, one recording in two roles.
    """
    _refuse_strange(settings)
    given = inputs.material if isinstance(inputs.material, Material) else Material(None, lambda words: None)
    if (settings.model is not None and given.arm is None) or (settings.calibration is not None and given.calibration is None):
        raise UsageError("C02", "a model or a calibration is named that was not read", where="diagnose",
                         remedy="hand on what diagnose.beside reads, as material")
    chosen = logs_of_roles([opened.log for opened in inputs.logs], inputs.label)
    for log in (*chosen.identify, *chosen.validate, *chosen.reference):
        refuse_unfit(settings, log)
    if given.arm is not None and given.arm.n_joints != chosen.identify[0].n_joints:
        raise UsageError("C02", f"the model has {given.arm.n_joints} joints, {chosen.identify[0].name} has "
                         f"{chosen.identify[0].n_joints}", where="--model", remedy="give a model of this robot")
    if chosen.reference and given.calibration is not None:
        raise UsageError("C02", "reference logs tell what is usual, and a calibration is given as well", where="--calibration",
                         remedy="leave out one of the two")
    given.tell("examining the logs")
    memory = Memory()
    said, boundary = memory.examined(chosen, settings.allow_mismatch)
    engine = DiagnosisSettings(settings.replicas, settings.most, settings.blocks, settings.without, settings.filter,
                               settings.decimate, settings.min_speed, settings.seed, evidence=whole, limits=whole)
    extension = None
    if chosen.reference or WITHOUT_REFERENCE:
        found, extension = _by_one_model(chosen, engine, given, memory)
    else:
        found = diagnose(chosen, engine, given.arm, given.tell, given.calibration, memory)
    found = replace(_beside_clocks(found, said), boundary=boundary)
    robot = chosen.identify[0].robot
    return Result(**{f.name: getattr(found, f.name) for f in fields(found)}, robot=chosen.identify[0].robot_name,
                  joints=tuple(joint.name for joint in robot.joints), rated=tuple(joint.torque for joint in robot.joints),
                  without=settings.without, doctor=(*said, *found.checks), memory=memory, extension=extension,
                  laws_of="" if given.arm is None or not given.arm.friction else Path(settings.model or "").name,
                  calibrated_with=() if given.calibration is None else tuple(one.name for one in given.calibration.origin.logs))


def _by_one_model(logs: Logs, chosen: DiagnosisSettings, given: Material, memory: Memory) -> tuple[Diagnosis, Extended | None]:
    """By `pipelines.diagnosis`: every joint and cause in one Gaussian model of reference logs and later ones."""
    usual = DiagnosisConfig()
    config = replace(usual, causes=chosen.most, cutoff_hz=chosen.cutoff_hz or usual.cutoff_hz)
    prepared = memory.prepared(logs, replace(chosen, cutoff_hz=config.cutoff_hz), given.arm)
    given.tell("comparing with the reference logs" if logs.reference else "looking for causes")
    found = diagnose_prepared(prepared, config, chosen.without)
    return answer(prepared, found, given.tell, chosen.blocks, chosen.evidence, chosen.without)


def _beside_clocks(found: Diagnosis, said: Sequence[Check]) -> Diagnosis:
    """Logs whose torque is late alike, before and after, show nothing that has changed: that they are late has to be said."""
    late = next((check for check in said if check.code == "RRID-T06"), None)
    if found.verdict not in ("nothing-wrong", "cannot-judge") or late is None:
        return found
    words = f"in {Path(late.where.partition(',')[0]).name} {late.message}"
    return replace(found, reason=f"{found.reason}; {words}" if found.reason else words,
                   summary=f"{found.summary.rstrip('.')}; but {words}.")


def _refuse_strange(settings: Settings) -> None:
    """C01, C02 for a setting that makes no sense."""
    for cause in settings.without:
        refuse_unknown(cause, "--without")
        if ":" in cause:
            raise UsageError("C02", f"'{cause}': a cause is left out as a whole, at every joint", where="--without",
                             remedy=f"write {cause.split(':')[0]}")
    refuse_strange(settings)
    if settings.replicas < 0 or settings.replicas > 1000:
        raise UsageError("C02", f"{settings.replicas} replicas", where="--replicas", remedy="give 0 to 1000")
    if settings.most < 1:
        raise UsageError("C02", f"{settings.most} findings at most", where="--most", remedy="give 1 or more")
    if settings.seed < 0:
        raise UsageError("C02", f"the seed {settings.seed} is negative", where="--seed", remedy="give 0 or more")


def write(result: Result, folder: Path, request: Request) -> None:
    """The thresholds, where there are any beside a share of the residual."""
    if result.calibration is not None:
        write_calibration(folder, result.calibration)


def _exit_code(result: Result, check: bool) -> int:
    return int(check and result.verdict != "nothing-wrong")


def report(result: Result) -> Report:
    """The verdict and what to check, the proof of every finding, the picture of what is wrong, rivals, ledger and limits."""
    return diagnosis_report(result)


STAGE = Stage("diagnose", "Diagnose what the simulation gets wrong", Settings, compute, report, read, write, _exit_code,
              lambda result: result.doctor, lambda result, inputs: replace(inputs, material=result), hands_on="material",
              beside=beside, sessions="one")
