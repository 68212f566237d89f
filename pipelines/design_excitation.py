"""Design the experiment that tells most about the arm, within its limits.

Reads    a robot description; optionally a model or bounds on its parameters, earlier logs, results of frf, a recipe
Writes   trajectory.h5 (a planned log), controller.csv, coefficients.json, result.json, result.h5, report.html
Source   Kostić et al. 2004, Section IV.C.3, eq. (22), Figs. 8 and 9; Swevers et al. 1997

`purpose` plans the other experiments of the workflow instead: logs/<name>.h5, one an experiment.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from pipelines.errors import NothingMatched, UsageError
from pipelines.importers.recipe import Recipe
from pipelines.importers.units import controller_table, write_controller_table
from pipelines.io.files import write_log
from pipelines.io.model_file import read_model
from pipelines.io.option import option
from pipelines.io.output import write_file
from pipelines.io.results import json_text, stored_result
from pipelines.io.robot import RobotDescription
from pipelines.io.robot_files import load_robot, robot_at_hand, robot_sources
from pipelines.io.sandbox import read_small_text
from pipelines.model.arm import Arm
from pipelines.model.excitation.allowed import refuse_strange
from pipelines.model.excitation.apart import Pair, refuse_hidden, refuse_one
from pipelines.model.excitation.bounds import parse_bounds
from pipelines.model.excitation.design import Design, Effort
from pipelines.model.excitation.doubts import doubts
from pipelines.model.excitation.earlier import USED, first_mode, information_of
from pipelines.model.excitation.found import best
from pipelines.model.excitation.others import frf_plans, friction_plans, hold_plans
from pipelines.model.excitation.outcome import excitation
from pipelines.model.excitation.outputs import coefficients, joint_motion, log_of_plan
from pipelines.model.excitation.rehearse import rehearsed
from pipelines.model.excitation.result import CostOfLimit, Result
from pipelines.model.excitation.task import Task, Wishes, plan_task
from pipelines.model.named_cause import wanted_cause
from pipelines.report.excitation_report import excitation_report
from pipelines.report.report import Report
from pipelines.stage import Inputs, Request, Stage, read_logs, slug
from pipelines.writing.task import planned_log

__all__ = ["STAGE", "Result", "Settings", "compute", "read", "report"]

PURPOSES = ("excitation", "friction", "frf", "hold")
_APART_HARMONICS = (20,)  # a search without gradients wants fewer


@dataclass(frozen=True)
class Settings:
    """What to design for which robot, and how long to search."""

    robot: str | None = option(None, "Description, URDF, log or shipped name. [robot.toml here, else rrr]", "ROBOT")
    experiment: str = option("excitation", "excitation, friction, frf or hold.")
    criterion: str = option("default", "default (A with condition 3), condition, frobenius, E, D or A.")
    cond_max: float | None = option(None, "Ceiling on the condition number. [default: 3]")
    harmonics: tuple[int, ...] | None = option(None, "Harmonics: one number, or one a joint.")
    frequency: tuple[float, ...] = option((0.1,), "Fundamental [Hz]: one, or one a joint.")
    stop_band: tuple[float, ...] = option((), "Bands without harmonics [Hz]: 4,6 or 4,6,11,13.")
    time_limit: float = option(30.0, "Time to search, in seconds of computing.")
    evaluations: int | None = option(None, "Search so many evaluations instead: repeatable exactly.")
    seed: int = option(1, "Seed of the search.")
    symmetric: bool = option(False, "Mirror-symmetric links: p4 = p15 = 0.")
    model: str | None = option(None, "Model that predicts torque and friction. [the described links]")
    bounds: str | None = option(None, "Bounds on the parameters (TOML), where no model is known.")
    home: tuple[float, ...] | None = option(None, "Posture to start from [rad], one a joint: 0,-1.57,0.")
    rest: bool = option(True, "In motion at both ends, with run-in and run-out.", "--no-rest")
    periods: int = option(1, "How often the period is repeated.")
    random: bool = option(False, "frf: random noise in the place of odd multisines.")
    sample_time: float = 1e-3  # [s]
    friction: bool | None = option(None, "Count columns of friction as well. [on every arm but the RRR arm]", "--friction/--no-friction")
    noise: tuple[float, ...] | None = None  # [N m] std of the torque; None: 1 % of its limit
    torque_share: float = 0.9  # of the torque limit that the plan may use
    speed_share: float = 0.95  # of the speed limit: a loop without feed-forward overshoots by up to 4 %
    tip_speed: float | None = option(None, "Limit on the speed of the tip [m/s].")
    tip_box: tuple[float, ...] | None = option(None, "Box for the tip [m]: x from,to, y from,to, z from,to.")
    recipe: str | None = option(None, "Recipe of import: controller.csv in its order, units and rate.")
    mode_factor: float = 3.0  # the top harmonic stays so many times below the first mode that --prior-logs knows
    rehearse: bool = True
    discriminate: tuple[str, ...] = option((), "Two causes that the motion shall separate: spring:2 cogging:2:order=1.", pair=True, causes=True)

    @property
    def wishes(self) -> Wishes:
        bands = tuple(zip(self.stop_band[::2], self.stop_band[1::2], strict=False))
        harmonics = self.harmonics if self.harmonics or not self.discriminate else _APART_HARMONICS
        return Wishes(self.criterion, self.cond_max, harmonics, self.frequency, bands, None, self.rest, self.home,
                      self.symmetric, self.friction, self.noise, self.torque_share, self.speed_share, self.tip_speed,
                      self.tip_box, self.sample_time, self.periods)


@dataclass(frozen=True)
class Material:
    """What was read."""

    robot: RobotDescription
    arm: Arm | None
    bounds: str | None  # text of the file
    recipe: Recipe | None
    modes: tuple[Mapping[str, Any], ...]  # results of frf
    tell: Any = field(compare=False)
    why: str = ""  # this robot, where none was named


def read(request: Request, settings: Settings) -> Inputs:
    """The robot, its model, the recipe, and the earlier logs and results among the request's paths.

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
    modes = tuple(found for path in request.paths if (found := stored_result(path, "frf")) is not None)
    logs = _earlier(request, settings, robot)
    bounds = None
    if settings.bounds is not None:
        if arm is not None:
            raise UsageError("C02", "the torque is known by the model or the described links", where="--bounds",
                             remedy="leave --bounds out, or --model")
        bounds = read_small_text(Path(settings.bounds), what="bounds of parameters (TOML)")
        sources.append(Path(settings.bounds))
    if settings.model is not None and Path(settings.model).is_file():
        sources.append(Path(settings.model).absolute())
    sources = [*logs.sources, *(path.absolute() for path in sources)]
    return Inputs(logs.logs, logs.rejected, (*robot.checks, *logs.checks), tuple(sources), logs.hashes, robot=robot,
                  material=Material(robot, arm, bounds, recipe, modes, request.tell, why),
                  label=_label(settings), robot_name=robot.name)


def _label(settings: Settings) -> str:
    """What the design is for, in the name of its default folder: a plan for another purpose is another plan."""
    return "-".join((settings.experiment, *settings.discriminate)).replace(":", "-")


def _arm(model: str | None, robot: RobotDescription) -> Arm | None:
    """The model given, else the one of the described links, else none."""
    if model is not None:
        arm = Arm.from_model(read_model(model), model)
        if arm.n_joints != robot.n_joints:
            raise UsageError("C02", f"the model has {arm.n_joints} joints, the robot {robot.n_joints}", where="--model",
                             remedy="give a model of this robot")
        return arm
    return Arm.from_links(robot) if all(joint.link is not None for joint in robot.joints) else None


def _earlier(request: Request, settings: Settings, robot: RobotDescription) -> Inputs:
    """The logs among the paths; a folder that holds none may hold a result of frf."""
    paths = tuple(path for path in request.paths if path.name != "result.json")
    if not paths:
        return Inputs()
    try:
        found = read_logs(replace(request, paths=paths, robot=None), settings)
    except NothingMatched:
        if any(stored_result(path, "frf") is not None for path in paths):
            return Inputs()
        raise
    for opened in found.logs:
        if opened.log.n_joints != robot.n_joints:
            raise UsageError("C02", f"{opened.path.name} has {opened.log.n_joints} joints, the robot {robot.n_joints}",
                             where="--prior-logs", remedy="name logs of this robot")
    return found


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Decide what was left open, search, judge, rehearse.

    Raises:
        UsageError: C02, settings that do not fit; C08, limits that no motion keeps: says which.
    """
    given: Material = inputs.material
    if settings.experiment not in PURPOSES:
        raise UsageError("C02", f"'{settings.experiment}' is no experiment to design", where="--experiment",
                         remedy=f"one of: {', '.join(PURPOSES)}; the writing task comes with its own command")
    if len(settings.stop_band) % 2:
        raise UsageError("C02", "bands to stay out of are pairs of frequencies", where="--stop-band", remedy="write 5,8 [Hz]")
    refuse_strange(settings)
    pair = _pair(settings, given.robot)
    mode = first_mode(given.modes)
    wishes = replace(settings.wishes, top_hz=None if mode is None else mode / settings.mode_factor)
    logs = [o.log for o in inputs.logs if o.log.origin != "planned" and o.log.experiment in USED and o.log.role == "identify"]
    told = bounds = None
    earlier = logs and settings.experiment == "excitation"
    if earlier or given.bounds is not None:
        columns = plan_task(given.robot, given.arm, wishes).problem.columns
        told = information_of(logs, columns) if earlier else None
        bounds = None if given.bounds is None else parse_bounds(given.bounds, columns, str(settings.bounds))
    task = plan_task(given.robot, given.arm, wishes, told, bounds)
    if settings.experiment != "excitation":
        return replace(_plans(task, settings, given), robot_from=given.why)
    if pair is not None:
        refuse_hidden(task, pair, settings.seed)
    found = best(task, pair, Effort(settings.time_limit, settings.evaluations, given.tell), settings.seed, settings.rehearse)
    result = _result(task, found.design, settings, given, tuple(log.name for log in logs), mode)
    return replace(result, rehearsal=found.rehearsal, rehearsal_failed=found.failed, apart=found.apart, robot_from=given.why)


def _pair(settings: Settings, robot: RobotDescription) -> Pair | None:
    """The two causes to tell apart."""
    if not settings.discriminate:
        return None
    if len(settings.discriminate) != 2 or settings.experiment != "excitation":
        raise UsageError("C02", "two causes are needed, and an excitation", where="--discriminate",
                         remedy="write --discriminate spring:2 cogging:2")
    if not settings.rest:
        raise UsageError("C02", "a motion that tells causes apart starts and ends at rest", where="--no-rest",
                         remedy="leave it out")
    (a, first), (b, second) = (wanted_cause(text, robot.revolute, "--discriminate") for text in settings.discriminate)
    pair = Pair(a, b, (first, second))
    refuse_one(pair, settings.discriminate)
    return pair


def _result(task: Task, found: Design, settings: Settings, given: Material, after: tuple[str, ...], mode: float | None) -> Result:
    given.tell("judging the design")
    judged = excitation(task, found, settings.seed)
    goal = task.problem.goal
    trajectory = found.trajectory
    t, motion = trajectory.sampled(settings.sample_time)
    log = planned_log(f"{task.robot.name} {settings.criterion} excitation", task.robot, joint_motion(t, motion), "excitation",
                      "identify")
    log = replace(log, period=trajectory.series.period if task.rest else None)
    top = int(np.flatnonzero(task.harmonics.used.any(axis=0))[-1]) + 1
    return Result(
        robot=task.robot.name, joints=tuple(j.name for j in task.robot.joints), purpose="excitation",
        criterion=settings.criterion, ceiling=goal.ceiling, condition_number=judged.condition_number,
        lower_bound=judged.lower_bound, predicted_relative_std=judged.predicted_relative_std, frobenius=judged.frobenius,
        smallest_singular_value=judged.smallest_singular_value, log_determinant=judged.log_determinant,
        limits=tuple(CostOfLimit(p.joint, p.quantity, p.peak, p.limit, p.unit, p.share, p.cost) for p in found.peaks),
        evaluations=found.evaluations, found_at=found.found_at, seed=settings.seed,
        interrupted=found.stopped > 0, stopped=found.stopped, reached=goal.meets(judged.condition_number),
        shrunk=found.shrunk, shrunk_for=found.shrunk_for,
        singular_values=judged.singular_values, parameters=judged.parameters,
        random=judged.random, course=judged.course, period=trajectory.series.period, periods=trajectory.periods,
        run_in=trajectory.run_in, duration=trajectory.duration, sample_time=settings.sample_time,
        home=None if task.home is None else tuple(map(float, task.home)), noise=tuple(map(float, goal.noise)),
        friction_columns=task.problem.columns.friction, torque_checked=task.torque is not None,
        torque_bounded=task.arm is None and task.torque is not None, torque_share=settings.torque_share,
        speed_share=settings.speed_share, after=after, first_mode=mode, mode_factor=settings.mode_factor,
        top_hz=top / trajectory.series.period, plans=(),
        logs=(("trajectory", log),), table=controller_table(given.recipe, task.robot, lambda at: trajectory.at(at)[0].T,
                                                            trajectory.duration, settings.sample_time),
        coefficients=coefficients(task, trajectory))


def _plans(task: Task, settings: Settings, given: Material) -> Result:
    """The other experiments of the workflow."""
    plans = {"friction": lambda: friction_plans(task), "frf": lambda: frf_plans(task, settings.seed, settings.random),
             "hold": lambda: hold_plans(task, settings.seed)}[settings.experiment]()
    rehearsals, failed = rehearsed(task, plans, settings.seed, given.tell) if settings.rehearse else ((), "")
    return Result.of_plans(task, settings.experiment, settings.seed, settings.sample_time, plans,
                           tuple((plan.name, log_of_plan(plan, task)) for plan in plans), rehearsals, failed)


def write(result: Result, folder: Path, request: Request) -> None:
    """trajectory.h5, controller.csv and coefficients.json; of other purposes logs/ alone."""
    for name, log in result.logs:
        path = f"{name}.{request.format}" if result.purpose == "excitation" else f"logs/{slug(name)}.{request.format}"
        write_log(folder / path, log)
    if result.table is not None:
        write_controller_table(folder / "controller.csv", result.table)
    if result.coefficients is not None:
        text = json_text(result.coefficients)

        def fill(draft: Path) -> None:
            draft.write_text(text, encoding="utf-8")

        write_file(folder / "coefficients.json", fill)


def report(result: Result) -> Report:
    """The motion, how near it comes to its limits, and what it will tell."""
    return excitation_report(result)


STAGE = Stage("design-excitation", "Design the excitation", Settings, compute, report, read, write,
              lambda result, check: result.stopped or int(check and any(found.gate for found in doubts(result))), doubts,
              sessions="folder")

