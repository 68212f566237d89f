"""Run the whole workflow on a folder of logs.

Reads    a folder of logs of one robot and one day
Writes   result.json with every stage's result, one report.html, and each stage's own files in a
         folder of its name
Source   cli-contract.md; the order is the way of the data: what a stage finds, the next ones use

Only what changed is computed again (`pipelines/cache.py`): a stage whose logs, settings, code,
libraries and stages before it are the same is taken from the last run in the same output folder.
Takes some 60 s for three joints and two minutes of motion, and some seconds where nothing has
changed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any

from pipelines import cache
from pipelines.cache import Entry, Key
from pipelines.diagnosis.result import Diagnosis
from pipelines.errors import Check, InputRejected, Level, NothingMatched, UsageError, did_you_mean
from pipelines.estimation.checks.boundary import Boundary
from pipelines.io.files import expanded
from pipelines.io.option import option
from pipelines.io.output import hash_file, renamed, short_names, tilde, write_text
from pipelines.io.results import decode, encode, json_text
from pipelines.io.robot import format_robot
from pipelines.io.schema import FORMAT_VERSION
from pipelines.io.sessions import of_one_session
from pipelines.quality.checks import columns_first
from pipelines.report.report import Report
from pipelines.report.run_report import Result, Step, run_report
from pipelines.stage import Beside, Inputs, Request, Stage, default_out, read_logs, result_type

# Modules of the stages, in the order they are run.
STEPS = (
    "inspect",
    "fit_friction",
    "reconstruct",
    "estimate_bps",
    "validate_writing",
    "frf",
    "diagnose",
    "extend",
)
MODULES = tuple(f"pipelines.{module}" for module in ("run", *STEPS))
_LIBRARIES = ("numpy", "scipy", "h5py", "pyarrow", "pandas")


@dataclass(frozen=True)
class Settings:
    """Settings of single stages by their names; the others run with their own defaults."""

    # filled by --set and --config
    stages: Mapping[str, Any] = field(default_factory=dict, metadata={"option": False})
    skip: tuple[str, ...] = option((), "Stage to leave out, such as diagnose. Repeatable.")
    no_cache: bool = option(False, "Compute everything, also what has not changed.")
    dry_run: bool = option(
        False, "Report what would be computed, and why; compute nothing.", option=False
    )


@dataclass(frozen=True)
class Material:
    """The material of a run, beside its logs."""

    store: cache.Store
    finished: Callable[[str], tuple[str, bytes] | None]  # figures of the last run
    sources: cache.Sources
    names: Mapping[str, str]  # folders of inputs -> how results name them
    options: Mapping[str, Any]  # of the request, as far as they change what logs say
    beside: Mapping[str, Beside]  # what stages have read beside the logs
    request: Request


@dataclass(frozen=True)
class Planned:
    """The plan for one stage, with its reason."""

    stage: str
    computed: bool  # else recalled
    why: str


def read(request: Request, settings: Settings) -> Inputs:
    """Open the logs, the files that settings of stages name, and what earlier runs have left."""
    inputs = of_one_session(read_logs(request, settings, keep_rejected=True))
    out = request.out or default_out(inputs, "run")
    robot = None if inputs.robot is None else cache.digest_of_json(format_robot(inputs.robot))
    names = short_names(request.named)
    options: dict[str, Any] = {
        "robot": robot,
        "assume_units": request.assume_units,
        "joints": list(request.joints),
        "format": request.format,
        "folder": inputs.label,
    }
    if request.roles:
        roles = {str(renamed(str(opened.path), names)): opened.log.role for opened in inputs.logs}
        options["roles"] = roles
    sources = cache.read_sources()
    finished = cache.finished_figures(
        out, "" if settings.no_cache else cache.drawing_digest(MODULES, sources)
    )
    beside = {
        stage.name: stage.beside(own, request)
        for stage, own in _wanted(settings)
        if stage.beside is not None
    }
    store = cache.Store(out, settings.no_cache)
    return replace(
        inputs,
        material=Material(store, finished, sources, names, options, beside, request),
        sources=(*inputs.sources, *(path for one in beside.values() for path in one.sources)),
        folders=(*inputs.folders, *(path for one in beside.values() for path in one.folders)),
    )


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Run every stage on what those before it leave; take what is unchanged from the cache."""
    _refuse_unknown(settings)
    given: Material = inputs.material
    given.store.hold()
    chain, steps = Chain(inputs), []
    for stage, own in _wanted(settings):
        key = chain.key(stage, own)
        entry = given.store.recall(stage.name, key)
        given.request.tell(f"{stage.name}: {'unchanged' if isinstance(entry, Entry) else entry}")
        if isinstance(entry, Entry):
            step = _step(stage, entry)
            step = replace(step, report=_with_figures(step.report, given.finished))
            chain.recalled(stage, key, step.result, entry)
        else:
            entry, result = _computed(stage, own, chain.inputs_of(stage), key, given)
            step = _step(stage, entry)
            chain.computed(stage, key, result)
        steps.append(step)
    return _result(tuple(steps))


def _with_figures(report: Report, finished: Callable[[str], tuple[str, bytes] | None]) -> Report:
    """Return a report that takes those of its figures that are drawn already."""
    sections = [
        replace(s, figures=tuple(replace(figure, finished=finished) for figure in s.figures))
        for s in report.sections
    ]
    return replace(report, sections=tuple(sections))


def _result(steps: tuple[Step, ...]) -> Result:
    return Result(steps, boundary=_boundary(steps), diagnosis=_diagnosis(steps))


def plan(request: Request, settings: Settings) -> tuple[Planned, ...]:
    """Say what `compute` would do, and why; nothing is written.

    `inspect` alone is computed, for it decides which logs the others get.
    """
    _refuse_unknown(settings)
    paths = tuple(path.absolute() for path in expanded(request.paths))
    inputs = read(replace(request, paths=paths), settings)
    chain, planned = Chain(inputs), []
    for stage, own in _wanted(settings):
        key = chain.key(stage, own)
        entry = inputs.material.store.recall(stage.name, key)
        if isinstance(entry, Entry):
            planned.append(Planned(stage.name, False, "unchanged"))
            chain.recalled(stage, key, _step(stage, entry).result, entry)
        else:
            planned.append(Planned(stage.name, True, entry))
            chooses = stage.hands_on == "choice"
            found = stage.compute(chain.inputs_of(stage), own) if chooses else None
            chain.computed(stage, key, found)
    return tuple(planned)


def _refuse_unknown(settings: Settings) -> None:
    names = [module.replace("_", "-") for module in STEPS]
    for name in settings.skip:
        if name not in names:
            words = f"'{name}' is no stage of a run{did_you_mean(name, names)}"
            remedy = f"there are: {', '.join(names)}"
            raise UsageError("C01", words, where="--skip", remedy=remedy)


def _boundary(steps: Iterable[Step]) -> Boundary | None:
    """Return the torque boundary of the last stage that determined it."""
    known = [
        found
        for step in steps
        if isinstance(found := getattr(step.result, "boundary", None), Boundary)
    ]
    return known[-1] if known else None


def _diagnosis(steps: Iterable[Step]) -> Diagnosis | None:
    """Return the diagnosis without its series, which the stage keeps."""
    found = next((step.result for step in steps if isinstance(step.result, Diagnosis)), None)
    if found is None:
        return None
    findings = tuple(replace(one, proof=None, answers=()) for one in found.findings)
    return replace(found, evidence=(), findings=findings)


def _wanted(settings: Settings) -> Iterator[tuple[Stage[Any, Any], Any]]:
    """Yield the stages with their settings, in order."""
    for module in STEPS:
        stage: Stage[Any, Any] = import_module(f"pipelines.{module}").STAGE
        if stage.name not in settings.skip:
            yield stage, settings.stages.get(stage.name) or stage.in_run or stage.settings()


class Chain:
    """The inputs on their way through the stages, and what the result of each depends on."""

    def __init__(self, inputs: Inputs) -> None:
        self.given: Material = inputs.material
        self.inputs = replace(inputs, material=None)
        self.through: dict[str, str] = {}  # stages that the logs have come through
        self.upon: dict[str, str] = {}  # the one whose result is built on
        # Results that were recalled, whose files are read only when a stage after them is computed.
        self.waiting: list[tuple[Stage[Any, Any], Any, Path]] = []

    def key(self, stage: Stage[Any, Any], settings: Any) -> Key:
        """Return all that the result of `stage` depends on."""
        given, every = self.given, self.inputs.logs
        logs = [opened for opened in every if stage.uses.logs(opened.log, settings)]
        unusable: dict[str, str] = {}
        if stage.uses.rejected:
            for one in self.inputs.rejected:
                error = renamed(one.error.as_dict(), given.names)
                unusable[self._name(one.path)] = cache.digest_of_json(error)
        others = {f"{o.log.experiment} ({o.log.role}, {o.log.origin})" for o in every}
        arrangement = {
            "the logs are in another order": [self._name(opened.path) for opened in logs],
            "there are other logs beside those it reads": sorted(others)
            if len(logs) < len(every)
            else [],
        }
        code = cache.code_of(stage.compute.__module__, given.sources, "pipelines.report")
        beside = self._beside(stage).sources
        return {
            "log": {self._name(opened.path): opened.sha256 for opened in logs},
            "arrangement": arrangement,
            "unusable file": unusable,
            "file": {self._name(path): hash_file(path) for path in beside},
            "setting": tilde(encode(settings)[0]),
            "option": given.options,
            "code": {name.removeprefix("pipelines."): sha for name, sha in code.items()},
            "library": cache.libraries(*_LIBRARIES) | {"log format": str(FORMAT_VERSION)},
            "stage": self.through | (self.upon if stage.uses.before else {}),
        }

    def _beside(self, stage: Stage[Any, Any]) -> Beside:
        return self.given.beside.get(stage.name, Beside())

    def _name(self, path: Path) -> str:
        return str(renamed(str(path), self.given.names))

    def inputs_of(self, stage: Stage[Any, Any]) -> Inputs:
        """Return what `stage` gets: of what came before, no more than it says that it uses."""
        for earlier, result, files in self.waiting:
            whole = earlier.restored(result, files) if earlier.restored else result
            self.inputs = earlier.onward(whole, self.inputs)
        self.waiting = []
        uses = stage.uses
        material = self.inputs.material if uses.before else self._beside(stage).material
        rejected = self.inputs.rejected if uses.rejected else ()
        return replace(self.inputs, material=material, rejected=rejected)

    def computed(self, stage: Stage[Any, Any], key: Key, result: Any) -> None:
        """Hand on a new result; None where the stage had none."""
        if result is not None:
            self.inputs = stage.onward(result, self.inputs)
        self._hand_on(stage, key)

    def recalled(self, stage: Stage[Any, Any], key: Key, result: Any, entry: Entry) -> None:
        """Hand on a stored result."""
        if result is not None and stage.hands_on == "choice" and not self.waiting:
            self.inputs = stage.onward(result, self.inputs)
        elif result is not None and stage.hands_on:
            self.waiting.append((stage, result, entry.files))
        self._hand_on(stage, key)

    def _hand_on(self, stage: Stage[Any, Any], key: Key) -> None:
        if stage.hands_on == "logs":  # the same for every log
            treatment = [key[part] for part in ("setting", "option", "code", "library")]
            self.through = self.through | {stage.name: cache.digest_of_json(treatment)}
        if stage.hands_on == "material":
            self.upon = {stage.name: cache.digest_of_json(key)}


def restored(folder: Path, result: Mapping[str, Any]) -> Result:
    """Return the result of the run in `folder`, of what it stored there.

    Args:
        result: the object of its result.json.

    Raises:
        InputRejected: F05, it is missing or changed; F17, it is of several sessions.
    """
    if result["runs"]:
        words = "holds several robots or days, as an earlier version wrote them"
        remedy = "run the command again on each session"
        raise InputRejected("F17", words, where=folder, remedy=remedy)
    stages, steps = {stage.name: stage for stage, _ in _wanted(Settings())}, []
    for one in result["stages"]:
        entry = cache.Store(folder).recall(one["name"])
        if isinstance(entry, str):
            words = f"the stored result of {one['name']} is missing, or not as it was written"
            raise InputRejected("F05", words, where=folder, remedy="run the command again")
        steps.append(_step(stages[one["name"]], entry))
    return _result(tuple(steps))


def _computed(
    stage: Stage[Any, Any], settings: Any, inputs: Inputs, key: Key, given: Material
) -> tuple[Entry, Any]:
    """Compute one stage and store what it found, or why it found nothing."""
    keep = given.store.keep
    try:
        result = renamed(stage.compute(inputs, settings), given.names)
    except (NothingMatched, InputRejected) as problem:
        told = tilde(renamed(problem.as_dict(), given.names)) | {"exit": problem.exit_code}
        # What is an option of the stage's own command is a setting here.
        option = f"--set {stage.name}.skip_sanity_checks=true"
        told["remedy"] = told["remedy"].replace("--skip-sanity-checks", option)
        return keep(stage.name, key, {"problem": told}, None, lambda folder: None), None
    checks = [tilde(renamed(check.as_dict(), given.names)) for check in stage.checks(result)]
    about = {"exit": stage.exit_code(result, True), "problem": None, "checks": checks}

    def write(folder: Path) -> None:
        if stage.write is not None:
            stage.write(result, folder, given.request)

    return keep(stage.name, key, about, tilde(encode(result)), write), result


def _step(stage: Stage[Any, Any], entry: Entry) -> Step:
    """Return a stored result as the stage's outcome, whenever it was computed."""
    about = entry.about
    if (problem := about["problem"]) is not None:
        report, check = _without(stage, problem)
        return Step(stage.name, problem["exit"], None, report, (check,), entry)
    result = decode(result_type(stage), *entry.result())
    checks = tuple(Check(**told) for told in about["checks"])
    return Step(stage.name, about["exit"], result, stage.report(result), checks, entry)


def _without(stage: Stage[Any, Any], problem: Mapping[str, Any]) -> tuple[Report, Check]:
    """Return a stage without a result: nothing to read, or an input that it cannot use."""
    passed_over = problem["exit"] == NothingMatched.exit_code
    remedy = problem["remedy"]
    how = "Passed over" if passed_over else "Not done"
    words = f"{how}: {problem['message']}. {remedy[:1].upper()}{remedy[1:]}."
    level: Level = "warn" if passed_over else "reject"
    where, message = problem["where"], problem["message"]
    check = Check(problem["code"], level, message, where, remedy, gate=not passed_over)
    return Report(stage.title, words, "neutral" if passed_over else "bad"), check


def report(result: Result) -> Report:
    """Return the verdict, a table of all stages, the diagnosis, then every other stage's report."""
    return run_report(result)


def write(result: Result, folder: Path, request: Request) -> None:
    """Write the files of every stage in a folder of its name, and what the next run may recall."""
    for step in result.stages:
        step.kept.put(folder)
    if not request.no_report:
        drawing = cache.drawing_digest(MODULES, cache.read_sources())
        write_text(folder / cache.DRAWING, json_text(drawing))


def _exit_code(result: Result, check: bool) -> int:
    codes = [step.exit for step in result.stages if step.exit != NothingMatched.exit_code]
    if InputRejected.exit_code in codes:
        return InputRejected.exit_code
    return max(codes, default=0) if check else 0


def _checks(result: Result) -> tuple[Check, ...]:
    return tuple(columns_first(check for step in result.stages for check in step.checks))


def _remakes(name: str) -> bool:
    """Return whether only rrrid reads a file; a user may have edited a model or a report."""
    return (
        name.startswith(f"{cache.CACHE}/")
        or name in ("result.json", "result.h5")
        or "/logs/" in name
    )


STAGE = Stage(
    "run",
    "Run the whole workflow on a folder of logs",
    Settings,
    compute,
    report,
    read,
    write,
    _exit_code,
    _checks,
    remakes=_remakes,
    ended=lambda inputs: inputs.material.store.release(),
    sessions="one",
)
