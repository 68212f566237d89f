"""Validate a model on a writing task: torque, six control cases, simulation.

Reads    logs of role "validate", "writing" ones above all; a model, or the logs to fit one; or,
         with `text`, a robot alone
Writes   result.json, result.h5, logs/ with the model's torque, report.html; of a designed task
         trajectory.h5, controller.csv
Source   Kostić et al. 2004, Sections III.B and IV.C.5, eq. (9), (23), (24), Figs. 2, 3, 13-16,
         Table IV
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.errors import Check, InputRejected, NothingMatched, UsageError
from pipelines.estimation.estimate import refuse_leak
from pipelines.estimation.motion import Reconstructed, Reconstruction, reconstruct
from pipelines.estimation.result import of_this_robot, torques, with_torques
from pipelines.friction.several import fitted_in_folder
from pipelines.importers.controller import controller_table, write_controller_table
from pipelines.importers.recipe import Recipe
from pipelines.io.files import write_log
from pipelines.io.log import ExperimentLog, digest_of, recording
from pipelines.io.model_file import ModelFile, read_model
from pipelines.io.option import option
from pipelines.io.robot import RobotDescription
from pipelines.io.robot_files import load_robot, robot_at_hand, robot_sources
from pipelines.io.sandbox import read_small_text
from pipelines.quality.checks import Subject, accepted
from pipelines.report.report import Report
from pipelines.report.writing_report import writing_report
from pipelines.stage import Inputs, Request, Stage, Uses, read_logs, slug
from pipelines.writing import validation
from pipelines.writing.config import CONFIG
from pipelines.writing.path import Page
from pipelines.writing.task import designed, planned_log, writing_task
from pipelines.writing.timing import Pace
from pipelines.writing.validation import Gates, Result

__all__ = ["STAGE", "Result", "Settings", "compute", "read", "report"]


@dataclass(frozen=True)
class Settings:
    """Name the model to judge and the gate, or describe the task to design."""

    model: str | None = option(None, "model.json to judge. [the folder's, else fitted to its logs]")
    torque_gate: float = option(0.1, "Largest relative torque error of a joint.")
    draws: int = option(5, "Models that simulated control cases run on in turn.")
    seed: int = option(1, "Seed of those.")
    simulate: bool = option(True, "Judge by what was recorded alone.", "--no-simulation")
    text: str | None = option(
        None, "Design this writing task instead: trajectory.h5 for the robot."
    )
    plane_y: float = option(Page.y, "Plane of the letters, y [m].")
    x: float = option(Page.x, "Middle of the text, x [m].")
    z: float = option(Page.z, "Middle of the text, z [m].")
    size: float = option(Page.height, "Height of a letter [m].")
    lift: float = Page.lift  # [m] off the plane between strokes
    speed: float = option(Pace.fast, "Speed of the tip in fast phases [m/s].")
    slow: float = option(Pace.slow, "In slow phases, from a line into an arc [m/s].")
    acceleration: float = option(Pace.acceleration, "Largest acceleration of the tip [m/s^2].")
    elbow: str | None = option(None, "up or down, of the RRR arm. [up]")
    sample_time: float = 1e-3  # [s] of the designed task
    recipe: str | None = option(
        None, "Recipe of import: controller.csv in its order, units and rate."
    )

    @property
    def designs(self) -> bool:
        return self.text is not None


@dataclass(frozen=True)
class Material:
    """Files that are read besides the logs."""

    model: ModelFile | None
    said: str  # where the model comes from
    named: bool  # by the user: one that the folder holds may be fit-friction's, without inertia
    robot: RobotDescription | None  # of a task to design
    recipe: Recipe | None


def read(request: Request, settings: Settings) -> Inputs:
    """Read the logs and the model; of a task to design the robot, its model and the recipe.

    Raises:
        UsageError: C02, neither logs nor a task; C04, no such file.
    """
    if not (request.paths or request.roles or settings.designs):
        remedy = "name logs to validate on; of an RRR arm, --text RRR designs the task"
        raise UsageError("C02", "no logs, and no text to write", "validate-writing", remedy)
    read_any = request.paths or request.roles
    inputs = read_logs(request, settings) if read_any else Inputs()
    found = settings.model if settings.model is not None else _left_in(request.paths)
    model = None if found is None else read_model(found)
    if model is not None and settings.model is None and request.session and not _of(model, inputs):
        found = model = None  # another robot's, or of another day
    sources = [] if found is None or not Path(found).is_file() else [Path(found).absolute()]
    said = f"{Path(found).name} of the folder" if found is not None else ""
    if settings.model is not None:
        said = f"{Path(settings.model).name}, as given"
    robot = recipe = None
    if settings.designs:
        robot, known = _robot(request, inputs)
        sources += known
        if settings.recipe is not None:
            from pipelines.importers.recipe import find_recipe, parse_recipe

            path = find_recipe(settings.recipe)
            recipe = parse_recipe(read_small_text(path, what="a recipe (TOML)"), path)
            sources.append(path)
    label = inputs.label or f"writing-{slug(settings.text or '')}"
    material = Material(model, said, settings.model is not None, robot, recipe)
    return replace(
        inputs,
        sources=(*inputs.sources, *sources),
        material=material,
        label=label,
        robot_name=robot.name if robot is not None else inputs.robot_name,
    )


def _left_in(paths: Sequence[Path]) -> str | None:
    """Return the model that estimate-bps wrote into one of the folders, or `run` below it."""
    for folder in paths:
        for file in (folder / "model.json", folder / "estimate-bps" / "model.json"):
            if folder.is_dir() and file.is_file():
                return str(file)
    return None


def _of(model: ModelFile, inputs: Inputs) -> bool:
    """Return whether a model was fitted to some of these logs."""
    ours = {digest_of(recording(opened.log)) for opened in inputs.logs}
    return any(source.sha256 in ours for source in model.sources)


def _robot(request: Request, inputs: Inputs) -> tuple[RobotDescription, list[Path]]:
    """Return the robot of the logs, else the one given, here or shipped; and its files."""
    if request.robot is None and inputs.logs:
        return inputs.logs[0].log.robot, []
    named = request.robot or robot_at_hand()[0]
    return load_robot(named), [path.absolute() for path in robot_sources(named) if path.is_file()]


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Validate on every held-out log; or design the task.

    Raises:
        NothingMatched: C06, no log of role validate, or neither a model nor logs to fit one.
        UsageError: C02, settings that do not fit, or a model of another robot.
        InputRejected: a check rejects a log: its first reason; D14, the model was fitted to a log
            that shall judge it.
    """
    _refuse_strange(settings)
    if settings.designs:
        return _designed(inputs, settings)
    logs = [opened.log for opened in inputs.logs if opened.log.origin != "planned"]
    judges = [log for log in logs if log.role == "validate"]
    if not judges:
        kinds = ", ".join(sorted({f"{log.experiment} ({log.role})" for log in logs})) or "none"
        words = f"no log of role validate; there are: {kinds}"
        remedy = "record another motion with role validate; --text designs one for RRR arms"
        raise NothingMatched("C06", words, inputs.label, remedy)
    arm, said = _model(inputs, logs, judges)
    pairs, checks = _examined(sorted(judges, key=lambda log: log.experiment != "writing"))
    parts = [torques(arm, log, motion) for log, motion in pairs]
    found = tuple(
        validation.torque_validation(log, motion, own, place < CONFIG.drawn_logs)
        for place, ((log, motion), own) in enumerate(zip(pairs, parts, strict=True))
    )
    torque = validation.pooled(found)
    cases, left_out, apart = validation.control_cases(
        pairs, parts, arm, settings.simulate, settings.draws, settings.seed
    )
    simulated, not_simulated = None, "it was not asked for"
    if settings.simulate:
        simulated, not_simulated = validation.simulated_task(pairs, arm)
    gates, failed = validation.gates_of(torque, cases, settings.torque_gate, arm.robot.name)
    how = {"model": None if settings.model is None else Path(settings.model).name}
    derived = tuple(
        with_torques(log, motion, Reconstruction(), own, "validate-writing", how)
        for (log, motion), own in zip(pairs, parts, strict=True)
    )
    return Result(
        robot=arm.robot.name,
        joints=tuple(joint.name for joint in arm.robot.joints),
        model=said,
        torque=torque,
        gates=gates,
        logs=found,
        cases=cases,
        cases_left_out=left_out,
        cases_apart=apart,
        drawn=_drawn_from(arm),
        draws=settings.draws,
        simulation=simulated,
        simulation_left_out=not_simulated,
        data_quality=(*checks, *failed),
        derived=derived,
    )


def _examined(
    logs: Sequence[ExperimentLog],
) -> tuple[list[tuple[ExperimentLog, Reconstructed]], tuple[Check, ...]]:
    """Return the motion of every log, and the checks of its data."""
    pairs, checks = [], list[Check]()
    for log in logs:
        subject = Subject(recording(log))
        checks += accepted(subject)
        pairs.append((log, reconstruct(log, Reconstruction(), subject.good)))
    return pairs, tuple(checks)


def _model(
    inputs: Inputs, logs: Sequence[ExperimentLog], judges: Sequence[ExperimentLog]
) -> tuple[Arm, str]:
    """Return the model to judge and where it comes from; never one that was fitted to `judges`."""
    given = inputs.material
    if isinstance(given, Arm) and given.p.any():
        return of_this_robot(given, judges[0]), "estimate-bps, on the logs of role identify"
    if (
        isinstance(given, Material)
        and (model := given.model) is not None
        and (given.named or any(p.value for p in model.base_parameters))
    ):
        fitted = {source.sha256 for source in model.sources if source.role == "identify"}
        for log in judges:
            if digest_of(recording(log)) in fitted:
                words = f"leak: the model was fitted to {log.name}, which shall judge it"
                where, remedy = log.source or log.name, "judge on another recording"
                raise InputRejected("D14", words, where, remedy)
        arm = Arm.from_model(model, given.said)
        if not arm.p.any():
            words = "the model holds friction alone, no inertia"
            raise UsageError("C02", words, "--model", "name the model.json of estimate-bps")
        return of_this_robot(arm, judges[0]), given.said
    refuse_leak([log for log in logs if log.role == "identify"], judges)
    if (here := fitted_in_folder(logs)) is None:
        words = "no model to validate, and no excitation or free log of role identify to fit one"
        remedy = "give --model model.json, or the folder that has such logs"
        raise NothingMatched("C06", words, inputs.label, remedy)
    order = "base parameters and friction together"
    if _friction_held(here):
        order = "friction first, then the base parameters"
    return here, f"fitted here to the logs of role identify: {order}"


def _drawn_from(arm: Arm) -> str:
    if arm.uncertainty is not None:
        held = "base parameters, friction held as it was fitted before"
        return f"the covariance of the {held if _friction_held(arm) else 'fit'}"
    if any(p.std for p in arm.base):
        return "the standard deviations of the model file's base parameters, as if independent"
    return ""


def _friction_held(arm: Arm) -> bool:
    """Return whether the fit took friction as known: its covariance then has no number of it."""
    numbers = {f"{law.place}:{p.name}" for law in arm.friction for p in law.parameters}
    return (
        bool(numbers) and arm.uncertainty is not None and numbers.isdisjoint(arm.uncertainty.names)
    )


def _refuse_strange(settings: Settings) -> None:
    """Raise C02 for a setting that makes no sense."""
    letters, gate, draws = len(settings.text or ""), settings.torque_gate, settings.draws
    side = "say up or down"
    if settings.elbow not in (None, "up", "down"):
        raise UsageError("C02", f"'{settings.elbow}' is no side of an elbow", "--elbow", side)
    if not 0.0 < gate < math.inf:
        words, remedy = f"a gate of {gate:g}", "give a relative error above 0"
        raise UsageError("C02", words, "--torque-gate", remedy)
    if not 1 <= draws <= CONFIG.most_draws:
        raise UsageError("C02", f"{draws} draws", "--draws", f"give 1 to {CONFIG.most_draws}")
    if letters > CONFIG.longest:
        remedy = f"give {CONFIG.longest} at most"
        raise UsageError("C02", f"a text of {letters} letters", "--text", remedy)
    if settings.seed < 0:
        words = f"the seed {settings.seed} is negative"
        raise UsageError("C02", words, "--seed", "give 0 or more")


def _designed(inputs: Inputs, settings: Settings) -> Result:
    """Return the task, within the limits of the robot."""
    given: Material = inputs.material
    robot = given.robot
    assert robot is not None  # `read` puts it there whenever a task is designed
    arm = _torque_of(given, robot, inputs)
    page = Page(settings.plane_y, settings.x, settings.z, settings.size, lift=settings.lift)
    acceleration = settings.acceleration
    pace = Pace(
        settings.speed,
        min(settings.slow, settings.speed),
        acceleration,
        Pace.jerk * acceleration / Pace.acceleration,
    )
    text, elbow = settings.text or "", settings.elbow
    task = writing_task(robot, text, page, pace, elbow=elbow)  # type: ignore[arg-type]
    reference = task.sampled(settings.sample_time, arm)
    log = planned_log(f"{robot.name} writing {text}", robot, reference.motion)
    design = designed(robot, reference, arm, text)
    table = controller_table(
        given.recipe,
        robot,
        lambda t: task.motion(np.minimum(t, task.duration)).q,
        float(reference.motion.t[-1]),
        settings.sample_time,
    )
    return Result(
        robot=robot.name,
        joints=tuple(joint.name for joint in robot.joints),
        model="",
        torque=None,
        gates=Gates(settings.torque_gate, None, None),
        draws=settings.draws,
        design=design,
        derived=(("trajectory", log),),
        table=table,
    )


def _torque_of(given: Material, robot: RobotDescription, inputs: Inputs) -> Arm | None:
    """Return the model, one fitted to the logs, that of the described links, or None."""
    if given.model is not None:
        arm = Arm.from_model(given.model, "--model")
        if arm.n_joints != robot.n_joints:
            words = f"the model has {arm.n_joints} joints, the robot {robot.n_joints}"
            raise UsageError("C02", words, "--model", "give a model of this robot")
        return arm
    fitted = fitted_in_folder([opened.log for opened in inputs.logs]) if inputs.logs else None
    if fitted is None and all(joint.link is not None for joint in robot.joints):
        return Arm.from_links(robot)
    return fitted


def _exit_code(result: Result, check: bool) -> int:
    return int(check and False in (result.gates.torque, result.gates.cases))


def write(result: Result, folder: Path, request: Request) -> None:
    """Write logs/ with the model's torque and one simulated log; or the designed task."""
    if result.design is not None:
        for name, log in result.derived:
            write_log(folder / f"{name}.{request.format}", log)
        if result.table is not None:
            write_controller_table(folder / "controller.csv", result.table)
        return
    taken: set[str] = set()
    for name, log in result.derived:
        while name in taken:
            name += "+"
        taken.add(name)
        write_log(folder / f"logs/{name}.{request.format}", log)
    if result.simulation is not None:
        for file, log in zip(result.simulation.files, result.simulation.logs, strict=True):
            write_log(folder / f"{file}.{request.format}", log)


def report(result: Result) -> Report:
    """Report the gates, the torque and its split, Table IV, the simulation."""
    return writing_report(result)


def _reads(log: ExperimentLog, settings: Settings) -> bool:
    """Return whether a log judges, or a model can be fitted to it."""
    return log.role == "validate" or (log.role == "identify" and log.experiment != "frf")


STAGE = Stage(
    "validate-writing",
    "Validate on the writing task",
    Settings,
    compute,
    report,
    read,
    write,
    _exit_code,
    lambda result: result.data_quality,
    uses=Uses(_reads, before=True),
    sessions="one",
)
