"""Validate a model on a writing task: torque, six control cases, simulation.

Reads    logs of role "validate", "writing" ones above all; a model, or the logs to fit one; or, with `text`, a robot alone
Writes   result.json, result.h5, logs/ with the model's torque, report.html; of a designed task trajectory.h5, controller.csv
Source   Kostić et al. 2004, Sections III.B and IV.C.5, eq. (9), (23), (24), Figs. 2, 3, 13-16, Table IV
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pipelines.errors import NothingMatched, UsageError
from pipelines.importers.recipe import Recipe
from pipelines.importers.units import controller_table, write_controller_table
from pipelines.io.files import write_log
from pipelines.io.log import ExperimentLog, derive, digest_of, recording
from pipelines.io.model_file import ModelFile, read_model
from pipelines.io.option import option
from pipelines.io.robot import RobotDescription
from pipelines.io.robot_files import load_robot, robot_at_hand, robot_sources
from pipelines.io.sandbox import read_small_text
from pipelines.model.arm import Arm, ArmTorque
from pipelines.model.estimation.in_folder import fitted_in_folder
from pipelines.model.motion import Reconstructed, Reconstruction
from pipelines.model.writing.design import Wishes, plan
from pipelines.model.writing.inverse import Elbow
from pipelines.model.writing.model_at_hand import given_model, handed_on, model_fitted_here
from pipelines.model.writing.result import Gates, Result, SimulationError
from pipelines.model.writing.validation import Effort, validate
from pipelines.report.report import Report
from pipelines.report.writing_report import writing_report
from pipelines.stage import Inputs, Request, Stage, Uses, read_logs, slug

__all__ = ["STAGE", "Result", "Settings", "compute", "read", "report"]

_LONGEST = 200  # letters, or moves: minutes of writing, and seconds of planning


@dataclass(frozen=True)
class Settings:
    """Which model is judged and by what; or which task is designed."""

    model: str | None = option(None, "model.json to judge. [the folder's, else fitted to its logs]")
    torque_gate: float = option(0.1, "Largest relative torque error of a joint.")
    draws: int = option(5, "Models that simulated control cases run on in turn.")
    seed: int = option(1, "Seed of those, and of via points.")
    simulate: bool = option(True, "Judge by what was recorded alone.", "--no-simulation")
    text: str | None = option(None, "Design this writing task instead: trajectory.h5 for the robot.")
    plane_y: float = option(Wishes.plane_y, "Plane of the letters, y [m].")
    x: float = option(Wishes.x, "Middle of the text, x [m].")
    z: float = option(Wishes.z, "Middle of the text, z [m].")
    size: float = option(Wishes.size, "Height of a letter [m].")
    lift: float = Wishes.lift  # [m] off the plane between strokes
    speed: float = option(Wishes.speed, "Speed of the tip in fast phases [m/s].")
    slow: float = option(Wishes.slow, "In slow phases, from a line into an arc [m/s].")
    acceleration: float = option(Wishes.acceleration, "Largest acceleration of the tip [m/s^2].")
    elbow: str | None = option(None, "up or down, of the RRR arm. [up]")
    posture: tuple[float, ...] | None = option(None, "Posture near the task [rad], of any other arm.")
    via_points: int | None = option(None, "Design so many moves between random postures instead.")
    sample_time: float = 1e-3  # [s] of the designed task
    recipe: str | None = option(None, "Recipe of import: controller.csv in its order, units and rate.")

    @property
    def designs(self) -> bool:
        return self.text is not None or self.via_points is not None

    @property
    def wishes(self) -> Wishes:
        elbow: Elbow | None = None if self.elbow is None else "down" if self.elbow == "down" else "up"
        return Wishes(self.text, self.plane_y, self.x, self.z, self.size, self.lift, self.speed, self.slow, self.acceleration,
                      elbow, self.posture, self.via_points, self.seed, self.sample_time)


@dataclass(frozen=True)
class Material:
    """What was read beside the logs."""

    model: ModelFile | None
    said: str  # where the model comes from
    named: bool  # by the user: one that the folder holds may be fit-friction's, without inertia
    robot: RobotDescription | None  # of a task to design
    recipe: Recipe | None


def read(request: Request, settings: Settings) -> Inputs:
    """The logs and the model; of a task to design the robot, its model and the recipe.

    Raises:
        UsageError: C02, neither logs nor a task; C04, no such file.
    """
    if not (request.paths or request.roles or settings.designs):
        raise UsageError("C02", "no logs, and no text to write", where="validate-writing",
                         remedy="name logs to validate on, or design the task with --text RRR")
    inputs = read_logs(request, settings) if request.paths or request.roles else Inputs()
    found = settings.model if settings.model is not None else _left_in(request.paths)
    model = None if found is None else read_model(found)
    if model is not None and settings.model is None and request.session and not _of(model, inputs):
        found = model = None  # another robot's, or of another day
    sources = [] if found is None or not Path(found).is_file() else [Path(found).absolute()]
    said = f"{Path(found).name} of the folder" if found is not None else ""
    said = said if settings.model is None else f"{Path(settings.model).name}, as given"
    robot = recipe = None
    if settings.designs:
        robot, known = _robot(request, inputs)
        sources += known
        if settings.recipe is not None:
            from pipelines.importers.recipe import find_recipe, parse_recipe

            path = find_recipe(settings.recipe)
            recipe = parse_recipe(read_small_text(path, what="a recipe (TOML)"), path)
            sources.append(path)
    label = inputs.label or (f"writing-{slug(settings.text)}" if settings.text else "via-points")
    material = Material(model, said, settings.model is not None, robot, recipe)
    return replace(inputs, sources=(*inputs.sources, *sources), material=material, label=label,
                   robot_name=robot.name if robot is not None else inputs.robot_name)


def _left_in(paths: Sequence[Path]) -> str | None:
    """The model that estimate-bps left in one of the folders, or `run` below it."""
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
    """That of the logs, else the one given, else robot.toml here, else the shipped one; with the files it was read from."""
    if request.robot is None and inputs.logs:
        return inputs.logs[0].log.robot, []
    named = request.robot or robot_at_hand()[0]
    return load_robot(named), [path.absolute() for path in robot_sources(named) if path.is_file()]


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Validate on every held-out log; or design the task.

    Raises:
        NothingMatched: C06, no log of role validate, or neither a model nor logs to fit one.
        UsageError: C02, settings that do not fit, or a model of another robot.
        InputRejected: the doctor rejects a log: its first reason; D14, the model was fitted to a log that shall judge it.
    """
    _refuse_strange(settings)
    if settings.designs:
        return _designed(inputs, settings)
    logs = [opened.log for opened in inputs.logs if opened.log.origin != "planned"]
    judges = [log for log in logs if log.role == "validate"]
    if not judges:
        kinds = ", ".join(sorted({f"{log.experiment} ({log.role})" for log in logs})) or "none"
        raise NothingMatched("C06", f"no log of role validate; there are: {kinds}", where=inputs.label,
                             remedy="record the writing task with role validate; --text RRR designs it")
    arm, said = _model(inputs, logs, judges)
    found = validate(judges, arm, Effort(settings.torque_gate, settings.draws, settings.seed, settings.simulate))
    done = found.imitation
    error = None if done is None else SimulationError(done.name, done.simulation, done.position_rms, done.speed_rms,
                                                      done.torque_rms)
    derived = tuple(_derived(log, motion, parts, settings) for (log, motion), parts in zip(found.pairs, found.parts, strict=True))
    return Result(
        robot=arm.robot.name, joints=tuple(joint.name for joint in arm.robot.joints), model=said, torque=found.torque,
        gates=found.gates, logs=found.firsts, cases=found.cases, cases_left_out=found.cases_left_out,
        cases_apart=found.cases_apart, drawn=_drawn_from(arm), draws=settings.draws, simulation=error,
        simulation_left_out=found.simulation_left_out, imitation=done, design=None, data_quality=found.checks, derived=derived,
        online_seconds=found.seconds)


def _model(inputs: Inputs, logs: list[ExperimentLog], judges: list[ExperimentLog]) -> tuple[Arm, str]:
    """The model to judge, and where it comes from."""
    given = inputs.material
    if isinstance(given, Arm) and (arm := handed_on(given, judges[0])) is not None:
        return arm, "estimate-bps, on the logs of role identify"
    if isinstance(given, Material) and given.model is not None and (given.named or any(p.value for p in
                                                                                       given.model.base_parameters)):
        return given_model(given.model, judges, given.said), given.said
    arm = model_fitted_here(logs, judges, inputs.label)
    order = "friction first, then the base parameters" if _friction_held(arm) else "base parameters and friction together"
    return arm, f"fitted here to the logs of role identify: {order}"


def _drawn_from(arm: Arm) -> str:
    if arm.uncertainty is not None:
        return f"the covariance of the {'base parameters, friction held as it was fitted before' if _friction_held(arm) else 'fit'}"
    if any(p.std for p in arm.base):
        return "the standard deviations of the model file's base parameters, as if independent"
    return ""


def _friction_held(arm: Arm) -> bool:
    """Return whether the fit took friction as known: its covariance then has no number of it."""
    numbers = {f"{law.place}:{p.name}" for law in arm.friction for p in law.parameters}
    return bool(numbers) and arm.uncertainty is not None and numbers.isdisjoint(arm.uncertainty.names)


def _refuse_strange(settings: Settings) -> None:
    """C02 for a setting that makes no sense."""
    if settings.elbow not in (None, "up", "down"):
        raise UsageError("C02", f"'{settings.elbow}' is no side of an elbow", where="--elbow", remedy="say up or down")
    if not (math.isfinite(settings.torque_gate) and settings.torque_gate > 0.0):
        raise UsageError("C02", f"a gate of {settings.torque_gate:g}", where="--torque-gate",
                         remedy="give a relative error above 0")
    if not 1 <= settings.draws <= 1000:
        raise UsageError("C02", f"{settings.draws} draws", where="--draws", remedy="give 1 to 1000")
    if settings.via_points is not None and settings.via_points > _LONGEST:
        raise UsageError("C02", f"{settings.via_points} via points", where="--via-points", remedy=f"give {_LONGEST} at most")
    if settings.text is not None and len(settings.text) > _LONGEST:
        raise UsageError("C02", f"a text of {len(settings.text)} letters", where="--text", remedy=f"give {_LONGEST} at most")
    if settings.seed < 0:
        raise UsageError("C02", f"the seed {settings.seed} is negative", where="--seed", remedy="give 0 or more")


def _derived(log: ExperimentLog, motion: Reconstructed, parts: ArmTorque, settings: Settings) -> tuple[str, ExperimentLog]:
    with_motion = derive(log, "reconstruct", Reconstruction().as_settings(), motion.signals())
    total = parts.total
    told = {"model": None if settings.model is None else Path(settings.model).name}
    signals = {"tau_model": total, "tau_inertia": parts.inertia, "tau_coriolis": parts.coriolis, "tau_gravity": parts.gravity,
               "tau_friction_model": parts.friction, "tau_effects": parts.effects, "tau_residual": log.tau - total}
    return slug(log.name), derive(with_motion, "validate-writing", told, signals)


def _designed(inputs: Inputs, settings: Settings) -> Result:
    """The task, within the limits of the robot."""
    given: Material = inputs.material
    robot = given.robot
    assert robot is not None  # `read` puts it there whenever a task is designed
    arm = _torque_of(given, robot, inputs)
    found = plan(robot, arm, settings.wishes)
    table = controller_table(given.recipe, robot, found.at, found.designed.duration, settings.sample_time)
    return Result(
        robot=robot.name, joints=tuple(joint.name for joint in robot.joints), model="", torque=None,
        gates=Gates(settings.torque_gate, None, None), logs=(), cases=(), cases_left_out="", cases_apart=(), drawn="",
        draws=settings.draws, simulation=None, simulation_left_out="", imitation=None, design=found.designed,
        derived=(("trajectory", found.log),), table=table)


def _torque_of(given: Material, robot: RobotDescription, inputs: Inputs) -> Arm | None:
    """What predicts the torque of the task: the model, one fitted to the logs, the described links, or nothing."""
    if given.model is not None:
        arm = Arm.from_model(given.model, "--model")
        if arm.n_joints != robot.n_joints:
            raise UsageError("C02", f"the model has {arm.n_joints} joints, the robot {robot.n_joints}", where="--model",
                             remedy="give a model of this robot")
        return arm
    if inputs.logs and (fitted := fitted_in_folder([opened.log for opened in inputs.logs])) is not None:
        return fitted
    return Arm.from_links(robot) if all(joint.link is not None for joint in robot.joints) else None


def _exit_code(result: Result, check: bool) -> int:
    return int(check and False in (result.gates.torque, result.gates.cases))


def _durations(result: Result) -> dict[str, float]:
    """For provenance.json: the model's time for one sample online, log by log [s]."""
    return {f"{log.name}: model online, one sample [s]": took
            for log, took in zip(result.logs, result.online_seconds, strict=True)}


def write(result: Result, folder: Path, request: Request) -> None:
    """logs/ with the model's torque and one simulated log; or the designed task."""
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
    if result.imitation is not None:
        for file, log in zip(result.imitation.files, result.imitation.logs, strict=True):
            write_log(folder / f"{file}.{request.format}", log)


def report(result: Result) -> Report:
    """The verdict, the gates, torque and its split, Table IV, the letters, the simulation."""
    return writing_report(result)


def _reads(log: ExperimentLog, settings: Settings) -> bool:
    """Logs that judge, and those that a model can be fitted to."""
    return log.role == "validate" or (log.role == "identify" and log.experiment != "frf")


STAGE = Stage("validate-writing", "Validate on the writing task", Settings, compute, report, read, write, _exit_code,
              lambda result: result.data_quality, durations=_durations, uses=Uses(_reads, before=True), sessions="one")
