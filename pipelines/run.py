"""Run the whole workflow on a folder of logs.

Reads    a folder of logs of one robot and one day
Writes   result.json with every stage's result, one report.html, and each stage's own files in a folder of its name
Source   cli-contract.md; the order is the way of the data: what a stage finds, the next ones build on

Only what changed is computed again: a stage whose logs, settings, code, libraries and stages before
it are the same is taken from the last run in the same output folder, or from one that was killed
there. Takes some 60 s for three joints and two minutes of motion, and some seconds where nothing has
changed.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

from pipelines.diagnosis.result import Diagnosis
from pipelines.errors import Check, InputRejected, Level, NothingMatched, UsageError, did_you_mean
from pipelines.estimation.checks.boundary import Boundary
from pipelines.io.files import expanded
from pipelines.io.mixed import of_one_session
from pipelines.io.option import option
from pipelines.io.places import renamed, short_names, tilde
from pipelines.io.results import decode, encode
from pipelines.io.robot import format_robot
from pipelines.quality.checks import columns_first
from pipelines.recall.chain import Chain
from pipelines.recall.key import Key, digest_of_json
from pipelines.recall.pictures import Pictures, pictures_of, with_pictures, write_drawing
from pipelines.recall.store import CACHE, Kept, Missed, Store
from pipelines.report.report import Report
from pipelines.report.run_report import Result, Step, run_report
from pipelines.stage import Beside, Inputs, Request, Stage, default_out, read_logs, result_type

__all__ = ["MODULES", "STAGE", "STEPS", "Planned", "Result", "Settings", "Step", "compute", "plan", "report", "restored"]

# Modules of the stages, in the order they are run.
STEPS = ("inspect", "fit_friction", "reconstruct", "estimate_bps", "validate_writing", "frf", "diagnose", "extend")
MODULES = tuple(f"pipelines.{module}" for module in ("run", *STEPS))


@dataclass(frozen=True)
class Settings:
    """`stages`: settings of single stages by their names; the others run with their own defaults."""

    stages: Mapping[str, Any] = field(default_factory=dict, metadata={"option": False})  # filled by --set and --config
    skip: tuple[str, ...] = option((), "Stage to leave out, such as diagnose. Repeatable.")
    no_cache: bool = option(False, "Compute everything, also what has not changed.")
    dry_run: bool = option(False, "Report what would be computed, and why; compute nothing.", option=False)


@dataclass(frozen=True)
class Material:
    """What a run knows beside its logs."""

    store: Store
    pictures: Pictures
    names: Mapping[str, str]  # folders of inputs -> how results name them
    options: Mapping[str, Any]  # of the request, as far as they change what logs say
    beside: Mapping[str, Beside]  # what stages have read beside the logs
    request: Request


@dataclass(frozen=True)
class Planned:
    """What a run would do with one stage, and why."""

    stage: str
    computed: bool  # else taken back
    why: str


def read(request: Request, settings: Settings) -> Inputs:
    """Every log that can be opened, the files that settings of stages name, and what earlier runs have left."""
    inputs = of_one_session(read_logs(request, settings, keep_rejected=True))
    out = request.out or default_out(inputs, "run")
    robot = None if inputs.robot is None else digest_of_json(format_robot(inputs.robot))
    options: dict[str, Any] = {"robot": robot, "assume_units": request.assume_units, "joints": list(request.joints),
                               "format": request.format, "folder": inputs.label}
    names = short_names(request.named)
    if request.roles:
        options["roles"] = {str(renamed(str(opened.path), names)): opened.log.role for opened in inputs.logs}
    pictures = Pictures(out, {}) if settings.no_cache else pictures_of(out, MODULES)
    beside = {stage.name: stage.beside(own, request) for stage, own in _wanted(settings) if stage.beside is not None}
    return dataclasses.replace(
        inputs, material=Material(Store(out, settings.no_cache), pictures, names, options, beside, request),
        sources=(*inputs.sources, *(path for one in beside.values() for path in one.sources)),
        folders=(*inputs.folders, *(path for one in beside.values() for path in one.folders)))


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Run every stage on the logs; take what is unchanged from the cache."""
    _refuse_strange(settings)
    return _result(_stages(inputs, settings))


def _result(steps: tuple[Step, ...]) -> Result:
    return Result(steps, boundary=_boundary(steps), diagnosis=_diagnosis(steps))


def plan(request: Request, settings: Settings) -> tuple[Planned, ...]:
    """What `compute` would do. Nothing is written; the doctor alone is asked, for it decides which logs the others get."""
    _refuse_strange(settings)
    request = dataclasses.replace(request, paths=tuple(path.absolute() for path in expanded(request.paths)))
    return tuple(_planned(read(request, settings), settings))


def _refuse_strange(settings: Settings) -> None:
    names = [module.replace("_", "-") for module in STEPS]
    for name in settings.skip:
        if name not in names:
            raise UsageError("C01", f"'{name}' is no stage of a run{did_you_mean(name, names)}", where="--skip",
                             remedy=f"there are: {', '.join(names)}")


def _boundary(steps: Iterable[Step]) -> Boundary | None:
    """What the logged torque is, as the last stage that knows says."""
    known = [found for step in steps if isinstance(found := getattr(step.result, "boundary", None), Boundary)]
    return known[-1] if known else None


def _diagnosis(steps: Iterable[Step]) -> Diagnosis | None:
    """What the run says is wrong; its series stand with the stage."""
    found = next((step.result for step in steps if isinstance(step.result, Diagnosis)), None)
    return None if found is None else dataclasses.replace(
        found, evidence=(), findings=tuple(dataclasses.replace(one, proof=None, answers=()) for one in found.findings))


def _wanted(settings: Settings) -> Iterator[tuple[Stage[Any, Any], Any]]:
    """The stages with their settings, in order."""
    for module in STEPS:
        stage: Stage[Any, Any] = import_module(f"pipelines.{module}").STAGE
        if stage.name not in settings.skip:
            yield stage, settings.stages.get(stage.name) or stage.in_run or stage.settings()


def _stages(inputs: Inputs, settings: Settings) -> tuple[Step, ...]:
    """Every stage in turn, each on what those before it leave; one that finds nothing to read is passed over."""
    given: Material = inputs.material
    chain, steps = Chain(inputs, given.names, given.options, given.beside), []
    for stage, own in _wanted(settings):
        key = chain.key(stage, own)
        kept = given.store.recall(stage.name, key)
        given.request.tell(f"{stage.name}: {'unchanged' if isinstance(kept, Kept) else kept.why}")
        if isinstance(kept, Kept):
            step = _step(stage, kept)
            step = dataclasses.replace(step, report=with_pictures(step.report, given.pictures))
            chain.taken_back(stage, key, step.result, kept.files)
        else:
            kept, result = _computed(stage, own, chain.inputs_of(stage), key, given)
            step = _step(stage, kept)
            chain.passed(stage, key, result)
        steps.append(step)
    return tuple(steps)


def _planned(inputs: Inputs, settings: Settings) -> Iterator[Planned]:
    given: Material = inputs.material
    chain = Chain(inputs, given.names, given.options, given.beside)
    for stage, own in _wanted(settings):
        key = chain.key(stage, own)
        kept = given.store.recall(stage.name, key, dry=True)
        yield Planned(stage.name, isinstance(kept, Missed), "unchanged" if isinstance(kept, Kept) else kept.why)
        if isinstance(kept, Kept):
            chain.taken_back(stage, key, _step(stage, kept).result, kept.files)
        else:
            chain.passed(stage, key, stage.compute(chain.inputs_of(stage), own) if stage.hands_on == "choice" else None)


def restored(folder: Path, result: Mapping[str, Any]) -> Result:
    """The result of the run that has left `folder`, of what it stored there; `result` is the object of its result.json.

    Raises:
        InputRejected: F05, what is stored is missing or changed; F17, it is a result of several sessions.
    """
    if result["runs"]:
        raise InputRejected("F17", "holds several robots or days, as an earlier version wrote them", where=folder,
                            remedy="run the command again on each session")
    store = Store(folder)
    by_name = {stage.name: stage for stage, _ in _wanted(Settings())}
    return _result(tuple(_step(by_name[one["name"]], store.stored(one["name"])) for one in result["stages"]))


def _computed(stage: Stage[Any, Any], settings: Any, inputs: Inputs, key: Key, given: Material) -> tuple[Kept, Any]:
    """Compute one stage and store what it found, or why it found nothing."""
    try:
        result = renamed(stage.compute(inputs, settings), given.names)
    except (NothingMatched, InputRejected) as problem:
        told = tilde(renamed(problem.as_dict(), given.names)) | {"exit": problem.exit_code}
        # what is an option of the stage's own command is a setting here
        told["remedy"] = told["remedy"].replace("--skip-sanity-checks", f"--set {stage.name}.skip_sanity_checks=true")
        return given.store.keep(stage.name, key, {"problem": told}, None, lambda folder: None), None
    about = {"exit": stage.exit_code(result, True), "problem": None,
             "checks": [tilde(renamed(check.as_dict(), given.names)) for check in stage.checks(result)]}
    write = stage.write or (lambda result, folder, request: None)
    kept = given.store.keep(stage.name, key, about, tilde(encode(result)),
                            lambda folder: write(result, folder, given.request))
    return kept, result


def _step(stage: Stage[Any, Any], kept: Kept) -> Step:
    """What is stored of a stage as its outcome: the same whether it was computed now or earlier."""
    about = kept.about
    if (problem := about["problem"]) is not None:
        report, check = _without(stage, problem)
        return Step(stage.name, problem["exit"], None, report, (check,), kept)
    result = decode(result_type(stage), *kept.result())
    return Step(stage.name, about["exit"], result, stage.report(result), tuple(Check(**told) for told in about["checks"]), kept)


def _without(stage: Stage[Any, Any], problem: Mapping[str, Any]) -> tuple[Report, Check]:
    """A stage that has no result: nothing to read (passed over), or an input it cannot use."""
    passed_over = problem["exit"] == NothingMatched.exit_code
    remedy = problem["remedy"]
    words = f"{'Passed over' if passed_over else 'Not done'}: {problem['message']}. {remedy[:1].upper()}{remedy[1:]}."
    level: Level = "warn" if passed_over else "reject"
    check = Check(problem["code"], level, problem["message"], problem["where"], remedy, not passed_over)
    return Report(stage.title, words, "neutral" if passed_over else "bad"), check


def report(result: Result) -> Report:
    """The verdict, one table of all stages, what diagnosis says, then every other stage's report."""
    return run_report(result)


def write(result: Result, folder: Path, request: Request) -> None:
    """The files of every stage in a folder of its name, and what the next run may take back."""
    for step in result.stages:
        step.kept.put(folder, step.name)
    if not request.no_report:
        write_drawing(folder, MODULES)


def _exit_code(result: Result, check: bool) -> int:
    codes = [step.exit for step in result.stages if step.exit != NothingMatched.exit_code]
    if InputRejected.exit_code in codes:
        return InputRejected.exit_code
    return max(codes, default=0) if check else 0


def _checks(result: Result) -> tuple[Check, ...]:
    return tuple(columns_first(check for step in result.stages for check in step.checks))


def _remakes(name: str) -> bool:
    """What only rrrid reads: stored results and derived logs. A model or a report may have been edited by somebody."""
    return name.startswith(f"{CACHE}/") or name in ("result.json", "result.h5") or "/logs/" in name


STAGE = Stage("run", "Run the whole workflow on a folder of logs", Settings, compute, report, read, write, _exit_code, _checks,
              remakes=_remakes, ended=lambda inputs, finished: inputs.material.store.release(finished), sessions="one")
