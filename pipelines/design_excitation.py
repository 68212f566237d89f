"""Design the experiment that tells most about the arm, within its limits.

Reads    a robot description; optionally a model, earlier logs, a recipe
Writes   trajectory.h5 (a planned log), controller.csv, both as gentle-… for a first run that is
         slower, coefficients.json, result.json, result.h5, report.html
Source   Kostić et al. 2004, Section IV.C.3, eq. (22), Figs. 8 and 9; Swevers et al. 1997

`experiment` plans the other experiments of the workflow instead: logs/<name>.h5, one an experiment.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pipelines.dynamics.arm import Arm
from pipelines.dynamics.named_cause import wanted_cause
from pipelines.errors import UsageError
from pipelines.excitation.discrimination import Pair, best, refuse_hidden, refuse_one
from pipelines.excitation.fourier import Trajectory
from pipelines.excitation.optimise import Effort
from pipelines.excitation.other_plans import frf_plans, friction_plans
from pipelines.excitation.result import (
    Result,
    doubts,
    gentle_log,
    information_of,
    judged,
    planned,
)
from pipelines.excitation.result import log_of as planned_log_of
from pipelines.excitation.task import Wishes, plan_task
from pipelines.importers.controller import (
    ControllerTable,
    controller_table,
    write_controller_table,
)
from pipelines.importers.recipe import Recipe
from pipelines.io.files import write_log
from pipelines.io.model_file import read_model
from pipelines.io.option import option
from pipelines.io.output import write_file
from pipelines.io.results import json_text
from pipelines.io.robot import RobotDescription
from pipelines.io.robot_files import load_robot, robot_at_hand, robot_sources
from pipelines.io.sandbox import read_small_text
from pipelines.report.excitation_report import excitation_report
from pipelines.report.report import Report
from pipelines.stage import Inputs, Request, Stage, read_logs, slug

__all__ = ["STAGE", "Result", "Settings", "compute", "read", "report"]

PURPOSES = ("excitation", "friction", "frf")
APART_HARMONICS = (20,)  # numerics: a search without gradients wants fewer
USED = ("excitation", "free")  # experiments whose information is added


@dataclass(frozen=True)
class Settings(Wishes):
    """Describe the experiment, its limits and the search."""

    robot: str | None = option(
        None, "Description, URDF, log or shipped name. [robot.toml here, else rrr]", "ROBOT")
    experiment: str = option("excitation", "excitation, friction or frf.")
    time_limit: float = option(30.0, "Time to search, in seconds of computing.")
    evaluations: int | None = option(
        None, "Search so many evaluations instead: repeatable exactly.")
    seed: int = option(1, "Seed of the search.")
    gentle: float = option(0.5, "Speed of a first run, as a share of the motion's; 1: none.")
    model: str | None = option(
        None, "Model that predicts torque and friction. [the described links]")
    recipe: str | None = option(
        None, "Recipe of import: controller.csv in its order, units and rate.")
    discriminate: tuple[str, ...] = option(
        (), "Two causes that the motion shall separate: spring:2 cogging:2:order=1.", pair=True,
        causes=True)


@dataclass(frozen=True)
class Material:
    """The robot and the files that are read besides the logs."""

    robot: RobotDescription
    arm: Arm | None
    recipe: Recipe | None
    tell: Any = field(compare=False)
    why: str = ""  # this robot, where none was named


def read(request: Request, settings: Settings) -> Inputs:
    """Read the robot, its model, the recipe, and earlier logs.

    Raises:
        UsageError: C04, no such file; C02, a model of another robot.
    """
    named, why = (given, "") if (given := settings.robot or request.robot) else robot_at_hand()
    if why:
        request.tell(f"no robot was named, taking: {why}")
    robot = load_robot(named)
    sources = [path for path in robot_sources(named) if path.is_file()]
    arm = _arm(settings.model, robot)
    recipe = None
    if settings.recipe is not None:
        from pipelines.importers.recipe import find_recipe, parse_recipe

        path = find_recipe(settings.recipe)
        recipe = parse_recipe(read_small_text(path, what="a recipe (TOML)"), path)
        sources.append(path)
    logs = _earlier(request, settings, robot)
    if settings.model is not None and Path(settings.model).is_file():
        sources.append(Path(settings.model).absolute())
    sources = [*logs.sources, *(path.absolute() for path in sources)]
    return Inputs(logs.logs, logs.rejected, (*robot.checks, *logs.checks), tuple(sources),
                  logs.hashes, robot=robot, label=_label(settings), robot_name=robot.name,
                  material=Material(robot, arm, recipe, request.tell, why))


def _label(settings: Settings) -> str:
    """Return what the design is for: a plan for another purpose lies in another folder."""
    return "-".join((settings.experiment, *settings.discriminate)).replace(":", "-")


def _arm(model: str | None, robot: RobotDescription) -> Arm | None:
    """Return the model given, else the one of the described links, else none."""
    if model is not None:
        arm = Arm.from_model(read_model(model), model)
        if arm.n_joints != robot.n_joints:
            raise UsageError("C02", f"the model has {arm.n_joints} joints, the robot "
                             f"{robot.n_joints}", where="--model",
                             remedy="give a model of this robot")
        return arm
    known = all(joint.link is not None for joint in robot.joints)
    return Arm.from_links(robot) if known else None


def _earlier(request: Request, settings: Settings, robot: RobotDescription) -> Inputs:
    """Read the logs among the paths."""
    if not request.paths:
        return Inputs()
    found = read_logs(replace(request, robot=None), settings)
    for opened in found.logs:
        if opened.log.n_joints != robot.n_joints:
            raise UsageError("C02", f"{opened.path.name} has {opened.log.n_joints} joints, the "
                             f"robot {robot.n_joints}", where="--prior-logs",
                             remedy="name logs of this robot")
    return found


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Decide what was left open, search, judge.

    Raises:
        UsageError: C02, settings that do not fit; C08, limits that no motion keeps: says which.
    """
    given: Material = inputs.material
    _refuse_strange(settings)
    pair = _pair(settings, given.robot)
    wishes: Wishes = settings
    if pair is not None and not settings.harmonics:
        wishes = replace(settings, harmonics=APART_HARMONICS)
    if settings.experiment != "excitation":
        return _plans(given, settings, wishes)
    logs = [opened.log for opened in inputs.logs if opened.log.origin != "planned"
            and opened.log.experiment in USED and opened.log.role == "identify"]
    task = plan_task(given.robot, given.arm, wishes)
    if logs:
        earlier = information_of(logs, task.problem.columns)
        task = plan_task(given.robot, given.arm, wishes, earlier)
    if pair is not None:
        refuse_hidden(task, pair, settings.seed)
    effort = Effort(settings.time_limit, settings.evaluations, given.tell)
    design, apart = best(task, pair, effort, settings.seed)
    given.tell("judging the design")
    trajectory = design.trajectory
    t, motion = trajectory.sampled(settings.sample_time)
    log = planned_log_of(task, f"{settings.criterion} excitation", t, motion, "excitation")
    log = replace(log, period=trajectory.series.period if task.rest else None)
    logs_of_plan, tables = {"trajectory": log}, {"controller": _table(given, settings, trajectory)}
    if settings.gentle < 1.0:
        logs_of_plan["gentle-trajectory"] = gentle_log(task, trajectory, settings.gentle)
        tables["gentle-controller"] = _table(given, settings, trajectory, settings.gentle)
    return replace(
        judged(task, design, apart, settings.seed), criterion=settings.criterion,
        robot_from=given.why, torque_share=settings.torque_share, speed_share=settings.speed_share,
        after=tuple(log.name for log in logs),
        logs=tuple(logs_of_plan.items()), tables=tables)


def _table(given: Material, settings: Settings, trajectory: Trajectory,
           share: float = 1.0) -> ControllerTable:
    """Return the motion for the controller at a share of its speed."""
    return controller_table(given.recipe, given.robot, lambda t: trajectory.at(share * t)[0].T,
                            trajectory.duration / share, settings.sample_time)


def _plans(given: Material, settings: Settings, wishes: Wishes) -> Result:
    """Plan the other experiments of the workflow."""
    task, seed = plan_task(given.robot, given.arm, wishes), settings.seed
    if settings.experiment == "friction":
        plans = friction_plans(task)
    else:
        plans = frf_plans(task, seed)
    return replace(planned(task, settings.experiment, seed, plans), robot_from=given.why)


def _refuse_strange(settings: Settings) -> None:
    """Raise C02, with the option, for a number that no design can have."""
    if settings.experiment not in PURPOSES:
        raise UsageError(
            "C02", f"'{settings.experiment}' is no experiment to design", where="--experiment",
            remedy=f"one of: {', '.join(PURPOSES)}; the writing task comes with its own command")
    shares = {"--torque-share": settings.torque_share, "--speed-share": settings.speed_share,
              "--gentle": settings.gentle}
    positive = {"--time-limit": settings.time_limit, "--evaluations": settings.evaluations,
                "--cond-max": settings.cond_max, "--periods": settings.periods,
                "sample_time": settings.sample_time, "noise": min(settings.noise or (1.0,))}
    for where, value in (shares | positive).items():
        most = 1.0 if where in shares else sys.float_info.max
        if value is not None and not 0.0 < value <= most:
            rule = "more than 0, 1 at most" if where in shares else "a positive, finite number"
            raise UsageError("C02", f"{value:g} does not fit", where=where, remedy=f"give {rule}")
    bands = settings.stop_band
    if not all(map(math.isfinite, (*(settings.home or ()), *(settings.tip_box or ()), *bands))):
        raise UsageError("C02", "a number is not finite", where="--home, --tip-box, --stop-band",
                         remedy="give finite numbers")
    pairs = zip(bands[::2], bands[1::2], strict=False)
    if len(bands) % 2 or any(not 0.0 <= low <= high for low, high in pairs):
        raise UsageError("C02", "bands to stay out of are pairs of frequencies, from 0 Hz upwards",
                         where="--stop-band", remedy="write 5,8 [Hz]")
    if settings.seed < 0:
        raise UsageError("C02", f"the seed {settings.seed} is negative", where="--seed",
                         remedy="give 0 or more")


def _pair(settings: Settings, robot: RobotDescription) -> Pair | None:
    """Return the two causes to separate."""
    if not settings.discriminate:
        return None
    if settings.discriminate[2:] or not settings.discriminate[1:] or (
            settings.experiment != "excitation"):
        raise UsageError("C02", "two causes are needed, and an excitation", where="--discriminate",
                         remedy="write --discriminate spring:2 cogging:2")
    if not settings.rest:
        raise UsageError("C02", "a motion that tells causes apart starts and ends at rest",
                         where="--no-rest", remedy="leave it out")
    (a, first), (b, second) = (wanted_cause(text, robot.revolute, "--discriminate")
                               for text in settings.discriminate)
    pair = Pair(a, b, (first, second))
    refuse_one(pair, settings.discriminate)
    return pair


def write(result: Result, folder: Path, request: Request) -> None:
    """Write planned logs, tables for the controller and coefficients; of other purposes logs/."""
    place = folder if result.purpose == "excitation" else folder / "logs"
    for name, log in result.logs:
        write_log(place / f"{slug(name)}.{request.format}", log)
    for name, table in result.tables.items():
        write_controller_table(folder / f"{name}.csv", table)
    if result.coefficients is not None:
        text = json_text(result.coefficients)

        def fill(draft: Path) -> None:
            draft.write_text(text, encoding="utf-8")

        write_file(folder / "coefficients.json", fill)


def report(result: Result) -> Report:
    """Report the motion, its distance to the limits, and what it will show."""
    return excitation_report(result)


def _exit_code(result: Result, check: bool) -> int:
    return result.stopped or int(check and any(found.gate for found in doubts(result)))


STAGE = Stage("design-excitation", "Design the excitation", Settings, compute, report, read, write,
              _exit_code, doubts, sessions="folder")
