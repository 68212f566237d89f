"""Run the whole workflow on a folder of logs.

Reads    a folder of logs of one robot; several robots or days of recording below it are taken apart
Writes   result.json with every stage's result, one report.html, and each stage's own files in a folder of its name
Source   cli-contract.md; the order is the way of the data: what a stage finds, the next ones build on
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from pipelines.errors import Check, InputRejected, Level, NothingMatched, RrridError, UsageError, did_you_mean
from pipelines.log.files import Opened
from pipelines.log.results import FLAT, NOT_STORED
from pipelines.model.diagnosis.result import Diagnosis
from pipelines.report.report import Report, Section, Table, Tone
from pipelines.stage import Inputs, Request, Stage, read_logs, slug

__all__ = ["STAGE", "STEPS", "Group", "Result", "Settings", "Step", "compute", "report"]

# Modules of the stages, in the order they are run.
STEPS = ("inspect", "fit_friction", "reconstruct", "estimate_bps", "validate_writing", "frf", "diagnose", "extend")

_WORST: tuple[Tone, ...] = ("neutral", "good", "attention", "bad")


@dataclass(frozen=True)
class Settings:
    """`stages`: settings of single stages by their names; the others run with their own defaults."""

    stages: Mapping[str, Any] = field(default_factory=dict, metadata={"option": False})  # filled by --set and --config
    skip: tuple[str, ...] = ()  # stages that are left out


@dataclass(frozen=True)
class Step:
    """One stage's outcome: its exit code under --check, and its result."""

    name: str
    exit: int
    result: Any
    report: Report = field(metadata=NOT_STORED, repr=False)
    checks: tuple[Check, ...] = field(metadata=NOT_STORED, repr=False)


@dataclass(frozen=True)
class Group:
    """The logs of one robot, recorded on one day, and what the stages made of them."""

    name: str
    stages: tuple[Step, ...]
    diagnosis: Diagnosis | None = field(default=None, metadata=FLAT, repr=False)


@dataclass(frozen=True)
class Result:
    """One group's stages; with several groups, `runs` holds each of them and `stages` is empty."""

    stages: tuple[Step, ...]
    runs: tuple[Group, ...] = ()
    diagnosis: Diagnosis | None = field(default=None, metadata=FLAT, repr=False)

    @property
    def groups(self) -> tuple[Group, ...]:
        return self.runs or (Group("", self.stages, self.diagnosis),)


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Run every stage on every group of logs."""
    _refuse_strange(settings)
    done = [(name, _stages(part, settings)) for name, part in _apart(inputs)]
    groups = tuple(Group(name, steps, _diagnosis(steps)) for name, steps in done)
    return Result((), groups) if len(groups) > 1 else Result(groups[0].stages, diagnosis=groups[0].diagnosis)


def _refuse_strange(settings: Settings) -> None:
    names = [module.replace("_", "-") for module in STEPS]
    for name in settings.skip:
        if name not in names:
            raise UsageError("C01", f"'{name}' is no stage of a run{did_you_mean(name, names)}", where="--skip",
                             remedy=f"there are: {', '.join(names)}")


def _diagnosis(steps: Iterable[Step]) -> Diagnosis | None:
    """What the run says is wrong; its series stand with the stage."""
    found = next((step.result for step in steps if isinstance(step.result, Diagnosis)), None)
    return None if found is None else dataclasses.replace(
        found, evidence=(), findings=tuple(dataclasses.replace(one, proof=None) for one in found.findings))


def _stages(inputs: Inputs, settings: Settings) -> tuple[Step, ...]:
    """Every stage in turn, each on what those before it leave; one that finds nothing to read is passed over."""
    steps = []
    for module in STEPS:
        stage: Stage[Any, Any] = import_module(f"pipelines.{module}").STAGE
        if stage.name in settings.skip:
            continue
        try:
            result = stage.compute(inputs, settings.stages.get(stage.name) or stage.in_run or stage.settings())
        except (NothingMatched, InputRejected) as problem:
            steps.append(_without(stage, problem))
            continue
        steps.append(Step(stage.name, stage.exit_code(result, True), result, stage.report(result), stage.checks(result)))
        inputs = stage.onward(result, inputs)
    return tuple(steps)


def _without(stage: Stage[Any, Any], problem: RrridError) -> Step:
    """A stage that has no result: nothing to read (passed over), or an input it cannot use."""
    passed_over = problem.exit_code == 5
    words = f"{'Passed over' if passed_over else 'Not done'}: {problem.message}. {problem.remedy[:1].upper()}{problem.remedy[1:]}."
    level: Level = "warn" if passed_over else "reject"
    check = Check(problem.code, level, problem.message, problem.where, problem.remedy, not passed_over)
    return Step(stage.name, problem.exit_code, None, Report(stage.title, words, "neutral" if passed_over else "bad"), (check,))


def _apart(inputs: Inputs) -> list[tuple[str, Inputs]]:
    """The inputs, one robot and one day of recording at a time. Files that no log came out of go with the first."""
    groups = _sessions(inputs.logs)
    if len(groups) < 2:
        return [("", inputs)]
    parts = []
    for number, ((robot, _, day), logs) in enumerate(groups.items()):
        part = dataclasses.replace(inputs, logs=tuple(logs), rejected=inputs.rejected if number == 0 else (), robot_name=robot)
        parts.append((" ".join(filter(None, (robot, day))), part))
    names = [name for name, _ in parts]
    return [(name if names.count(name) == 1 else f"{name} ({i + 1})", part) for i, (name, part) in enumerate(parts)]


def _sessions(logs: Iterable[Opened]) -> dict[tuple[str, str, str], list[Opened]]:
    """Logs by the robot's name, its description, and the day.

    What a robot was like before (role "reference") goes with every later day, or with the only one.
    """
    groups: dict[tuple[str, str, str], list[Opened]] = {}
    by_day = [((o.log.robot_name, o.log.robot_text, (o.log.recorded or "")[:10]), o) for o in logs]
    for key, opened in by_day:
        if opened.log.role != "reference":
            groups.setdefault(key, []).append(opened)
    sessions = tuple(groups)
    for key, opened in by_day:
        if opened.log.role == "reference":
            days = [other for other in sessions if other[:2] == key[:2]]
            later = [other for other in days if not other[2] or key[2] <= other[2]]
            for other in later or (days if len(days) == 1 else [key]):
                groups.setdefault(other, []).append(opened)
    return groups


def report(result: Result) -> Report:
    """The worst verdict first, one table of all stages, what diagnosis says, then every other stage's report."""
    steps = [(group.name, step) for group in result.groups for step in group.stages]
    tone = max((step.report.tone for _, step in steps), key=_WORST.index)
    verdicts = [text for group in result.groups for text in _verdicts(group)]
    table = Table(("logs", "stage", "verdict"), tuple((name or "all", step.name, step.report.verdict) for name, step in steps),
                  caption="Each stage in the order it was run.", tones=tuple(step.report.tone for _, step in steps))
    single = len(steps) == 1
    sections = [Section("Stages", tables=(table,))] if not single else []
    for name, step in sorted(steps, key=lambda one: not isinstance(one[1].result, Diagnosis)):  # the answer before its sources
        sections += _titled(step.report.sections, "" if single else " · ".join(filter(None, (name, step.name))))
    return Report("Run", " ".join(verdicts), tone, steps[0][1].report.key_figures if single else None, tuple(sections))


def _verdicts(group: Group) -> list[str]:
    """What the last stage that had a result says, after whatever is not in order before it."""
    last = max((i for i, step in enumerate(group.stages) if step.result is not None), default=-1)
    shown = [step for i, step in enumerate(group.stages) if i == last or step.report.tone in ("attention", "bad")]
    return [f"{group.name}: {step.report.verdict}" if group.name else step.report.verdict for step in shown]


def _titled(sections: Iterable[Section], prefix: str) -> list[Section]:
    """`sections`, their titles and figures told apart from those of other stages."""
    return [dataclasses.replace(
        section, title=f"{prefix}: {section.title}" if prefix else section.title,
        figures=tuple(dataclasses.replace(f, name=f"{slug(prefix)}-{f.name}" if prefix else f.name) for f in section.figures))
        for section in sections]


def write(result: Result, folder: Path, request: Request) -> None:
    """Let every stage write its files into a folder of its name."""
    for group in result.groups:
        for step in group.stages:
            stage: Stage[Any, Any] = import_module(f"pipelines.{step.name.replace('-', '_')}").STAGE
            if stage.write is not None and step.result is not None:
                stage.write(step.result, folder / slug(group.name) / step.name if group.name else folder / step.name, request)


def _exit_code(result: Result, check: bool) -> int:
    codes = [step.exit for group in result.groups for step in group.stages if step.exit != NothingMatched.exit_code]
    return 3 if 3 in codes else max(codes) if check else 0


def _checks(result: Result) -> tuple[Check, ...]:
    return tuple(check for group in result.groups for step in group.stages for check in step.checks)


STAGE = Stage("run", "Run the whole workflow on a folder of logs", Settings, compute, report,
              partial(read_logs, keep_rejected=True), write, _exit_code, _checks)
