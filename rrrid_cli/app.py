"""Every command: its help, what it takes beside the settings of its stage, what it does."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from inspect import Signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines import __version__
from pipelines.errors import EnvironmentFault, RrridError, UsageError, did_you_mean, escaped
from pipelines.io.option import option
from rrrid_cli import console
from rrrid_cli.options import (
    COMMANDS,
    STAGES,
    Common,
    make_settings,
    parameters,
    read,
    read_values,
    settable,
    stage_file,
    stage_of,
)

if TYPE_CHECKING:
    from pipelines.stage import Outcome


# Fields of `Inputs` that a command takes beside its settings; any other has those of a command that
# reads logs by their roles.
LOGS = ("logs", "joints", "session")
ROLES = ("logs", "identify", "validate", "reference", "joints", "session")
INPUTS = {"inspect": LOGS, "convert": LOGS, "reconstruct": LOGS, "demo": (), "import": ()}
INPUTS |= {"simulate": ("replay", "session"), "export": ("replay", "session")}
INPUTS |= {"design-excitation": ("prior_logs", "session")}
INPUTS |= {"compare": ("a", "b"), "report": ("folder",), "schema": ("what",), "doctor": ("quick",)}
REQUIRED = ("a", "b", "folder", "root")
# Shared options of commands that do not take them all.
SHARED = {"report": ("out", "force", "quiet", "debug"), "schema": (), "doctor": ("json", "debug")}
_MOST_ERRORS = 12  # numerics: lines of a batch; its report lists all
OUT = {"demo": "demo", "batch": "runs/several/ROOT/batch", "report": "DIR"}


@dataclass(frozen=True)
class Inputs:
    """Hold the logs, results and names that a command takes."""

    logs: tuple[Path, ...] = option((), "Logs, or folders of logs.", "LOGS")
    a: Path = option(Path(), "A command's folder, result.json or model.json.", "A")
    b: Path = option(Path(), "Another one of the same command.", "B")
    folder: Path = option(Path(), "A folder that a command has left.", "DIR")
    what: str = option("model", "A command, for its result.json; model; log.", "WHAT")
    replay: tuple[Path, ...] = option((), "Log to replay, or a folder. Repeatable.")
    prior_logs: tuple[Path, ...] = option((), "Earlier logs. Repeatable.")
    identify: tuple[str, ...] = option((), "Identification logs, instead of the logs' own roles.")
    validate: tuple[str, ...] = option((), "Validation logs, instead of the logs' own roles.")
    reference: tuple[str, ...] = option((), "Logs of the arm as it was before.")
    joints: tuple[int, ...] = option((), "Joints to take of every log: 1,3. --robot is theirs.")
    session: str = option("", "Of several robots or days: 'ROBOT', or 'ROBOT 2026-05-18'.")
    quick: bool = option(False, "Leave the self-test out.")


@dataclass(frozen=True)
class Batch:
    """Many folders of logs, and how they are worked through."""

    root: Path = option(Path(), "Folder with many folders of logs.", "ROOT")
    stage: str = option("run", "Command to run on each: run, estimate-bps, inspect, …")
    jobs: int | None = option(None, "Items at a time. [as many as there are cores]")
    timeout: float | None = option(None, "Time for one item [s]; then it has failed. [none]")
    memory: str | None = option(None, "Memory for one item: 500M, 2G; then it has failed. [none]")
    resume: bool = option(False, "Do only what is unfinished, failed, rejected or changed.")
    shard: str | None = option(None, "I/N: every Nth item alone, from the Ith on. [all]")
    backend: str = option("local", "local, or dask://HOST:PORT: a Dask scheduler.")
    joints: tuple[int, ...] = option((), "Joints to take of every log: 1,3. --robot is theirs.")

    def __post_init__(self) -> None:
        for flag, value in (("--jobs", self.jobs), ("--timeout", self.timeout)):
            if value is not None and not value > 0:
                raise UsageError("C02", f"'{value}' is not possible", flag, "give more than 0")


def build(word: str) -> typer.Typer:
    """Return the application; the command `word` alone has its options, and its stage loaded."""
    settings = {"help_option_names": ["-h", "--help"], "max_content_width": 110}
    app = typer.Typer(no_args_is_help=True, rich_markup_mode=None, context_settings=settings)
    app.callback()(_about)
    for name in COMMANDS:
        title = _title(name)
        if name == word:
            call, text, end = _function(name), _help(name), _end(name)
            app.command(name, help=text, short_help=title, epilog=end)(call)
        else:
            app.command(name, short_help=title)(_not_called)
    return app


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"rrrid {__version__}")
        raise typer.Exit


VERSION = typer.Option(
    "--version", help="Print the version and exit.", callback=_print_version, is_eager=True
)


def _about(version: Annotated[bool, VERSION] = False) -> None:
    """Identify robot arms from logs: what the simulation gets wrong, and how to make it better."""


def _not_called() -> None:
    """Stand for a command in the list of all."""


def _function(name: str) -> Callable[..., None]:
    """Return the function of a command; typer makes the options of its signature."""

    def called(**given: Any) -> None:
        raise typer.Exit(ACTIONS.get(name, _stage)(name, given))

    needed = REQUIRED if "identify" in INPUTS.get(name, ROLES) else (*REQUIRED, "logs")
    options = parameters(Inputs, INPUTS.get(name, ROLES), needed)
    if name == "batch":
        options = parameters(Batch, required=REQUIRED)
    if name in STAGES:
        options += parameters(stage_of(name).settings)
    out = f"Folder for the output. [{OUT.get(name, 'runs/ROBOT/FOLDER/COMMAND')}]"
    shared = SHARED.get(name, _names_of(Common))
    options += parameters(Common, shared, out=out)
    called.__signature__ = Signature(options)  # type: ignore[attr-defined]
    called.__annotations__ = {one.name: one.annotation for one in options}
    return called


def _title(name: str) -> str:
    """Return the title of a command: the first line of its module, or of its function here."""
    if name not in STAGES:
        return str(ACTIONS[name].__doc__)
    with stage_file(name).open(encoding="utf-8") as file:
        return file.readline().strip().strip('"')


def _help(name: str) -> str:
    """Return the docstring of a stage's module; what is laid out in columns stays so."""
    if name not in STAGES:
        return _title(name)
    parts = str(sys.modules[stage_of(name).compute.__module__].__doc__).split("\n\n")
    return "\n\n".join(f"\b\n{part}" if part.startswith("Reads ") else part for part in parts)


def _end(name: str) -> str:
    """Return the end of a command's help: what --set takes, and all causes where it takes some."""
    if name not in STAGES:
        return "--set and --config give the stage its options." if name == "batch" else ""
    parts = [
        f"--set {stage}.OPTION=VALUE, options: {', '.join(names)}."
        for stage, names in settable(name).items()
    ]
    if any(field.metadata.get("causes") for field in fields(stage_of(name).settings)):
        from pipelines.effects import all_effects

        for scope, title in (("joint", "Causes at one joint"), ("arm", "Causes of the whole arm")):
            effects = [effect for effect in all_effects() if effect.scope == scope]
            lines = [f"  {effect.name:24} {effect.words.title}" for effect in effects]
            parts.append("\n".join(["\b", f"{title}:", *lines]))
    return "\n\n".join(parts)


def _read(name: str, given: Mapping[str, Any]) -> tuple[Any, Any, Any, Common]:
    """Return a stage, its request and its settings, and the shared options, of the command line."""
    from pipelines.stage import Request

    stage, common = stage_of(name), read(Common, given)
    inputs, own = read_values(Inputs, given), read_values(stage.settings, given)
    roles = {name: inputs[name] for name in ROLES[1:4] if name in inputs}
    if "identify" in _names_of(stage.settings):
        own, roles = own | roles, {}
    sets = common.set
    if name == "convert" and given["common_format"]:
        sets = (f"convert.to={common.format}", *sets)
    settings = make_settings(name, common.config, sets, own)
    paths = [path for key in ("logs", "replay", "prior_logs") for path in inputs.get(key, ())]
    paths += [inputs[key] for key in ("a", "b") if key in inputs]
    values = vars(common) | inputs | {"paths": tuple(paths), "roles": roles}
    request = Request(tell=console.Progress(common), **_fields_of(Request, values))
    return stage, request, settings, common


def _names_of(kind: type[Any]) -> set[str]:
    return {field.name for field in fields(kind)}


def _fields_of(kind: type[Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return those of the values that a dataclass has fields for."""
    return {name: value for name, value in values.items() if name in _names_of(kind)}


def _outcome(stage: Any, request: Any, settings: Any, common: Common) -> Outcome[Any]:
    """Run a stage and print its outcome."""
    from pipelines.stage import run_stage

    with request.tell:
        outcome = run_stage(stage, request, settings)
    console.print_outcome(outcome, common)
    return outcome


def _stage(name: str, given: Mapping[str, Any]) -> int:
    return _outcome(*_read(name, given)).exit_code


def _run(name: str, given: Mapping[str, Any]) -> int:
    """Run the workflow, or with --dry-run print what would be computed, and why."""
    stage, request, settings, common = _read(name, given)
    if not settings.dry_run:
        return _outcome(stage, request, settings, common).exit_code
    from pipelines.run import plan

    with request.tell:
        planned = plan(request, settings)
    if common.json:
        _print_json("run", {"stages": planned})
    elif not common.quiet:
        rows = [(one.stage, "computed" if one.computed else "cached", one.why) for one in planned]
        console.print_table(("stage", "would be", "because"), rows)
    return 0


def _import(name: str, given: Mapping[str, Any]) -> int:
    """Make logs by a recipe, or with --guess print the draft of a recipe."""
    stage, request, settings, common = _read(name, given)
    if settings.guess is None:
        return _outcome(stage, request, settings, common).exit_code
    from pipelines.import_log import draft_recipe
    from pipelines.io.results import encode, json_text

    draft = draft_recipe(settings.guess, common.robot)
    if common.out is not None:
        remedy = "redirect it: rrrid import --guess FILE > recipe.toml"
        raise UsageError("C02", "--guess prints its draft", where="--out", remedy=remedy)
    sys.stdout.write(json_text(encode(draft)[0]) if common.json else draft.text)
    return 0


def _demo(name: str, given: Mapping[str, Any]) -> int:
    """Simulate logs with a fault, run the workflow on them, compare what was hidden and found."""
    from pipelines import demo
    from pipelines.stage import refuse_foreign, run_stage

    stage, request, settings, common = _read(name, given)
    out, words = common.out or Path("demo"), sys.stderr if common.json else sys.stdout
    shared = {key: value for key, value in given.items() if key.startswith("common_")}
    workflow, _, its_settings, _ = _read("run", shared)
    # before the arm is simulated
    refuse_foreign(out / "run", common.force, workflow.remakes, "run")
    with request.tell:
        request.tell("simulating the arm")
        recording = replace(request, out=out / "recording", no_report=True)
        recorded = run_stage(stage, recording, settings)
    if not common.quiet:
        logs = f"{len(recorded.result.logs)} logs into {out / 'recording/logs'}"
        print(f"Simulated {logs}; now: rrrid run {out / 'recording'}", file=sys.stderr)
    request = replace(request, paths=(out / "recording",), out=out / "run")
    try:
        outcome = _outcome(workflow, request, its_settings, common)
    except BaseException:
        if not common.quiet:
            print(f"Hidden was: {demo.hidden(recorded.result)}.", file=sys.stderr)
        raise
    if not common.quiet:
        report = outcome.folder / "report.html"
        lines = demo.ending(recorded.result, outcome.result.diagnosis)
        lines = (*lines, f"Report:     {report if report.exists() else 'none was asked for'}")
        next_ = "rrrid run FOLDER, on logs of your own; rrrid import --guess FILE drafts"
        print(*lines, f"Next:       {next_} what makes logs of recordings", sep="\n", file=words)
    return outcome.exit_code


def _batch(name: str, given: Mapping[str, Any]) -> int:
    """Run the workflow, or one stage, on every robot and day of many folders, in parallel."""
    common, own = read(Common, given), read(Batch, given)
    from pipelines.batch import module_of, run_batch
    from pipelines.executor import Plan
    from pipelines.io.output import slug
    from pipelines.stage import Request

    module, values = module_of(own.stage), vars(common) | vars(own)
    settings = make_settings(own.stage, common.config, common.set, {})
    request = Request((), **_fields_of(Request, values | {"out": None}))
    values |= {
        "out": common.out or Path("runs/several") / slug(own.root.resolve().name) / "batch",
        "jobs": own.jobs or len(os.sched_getaffinity(0)),
        "memory": _bytes(own.memory),
        "shard": read_shard(own.shard),
    }
    with (progress := console.Progress(common)):
        plan = Plan(module, settings, request, **_fields_of(Plan, values))
        outcome = run_batch(plan, progress)
    console.print_outcome(outcome, common)
    failing = [(item.name, item.error) for item in outcome.result.items if item.error is not None]
    for item, one in failing[:_MOST_ERRORS]:
        where = f"{item}: {one.where}".removesuffix(f": {item}")
        code = one.code.removeprefix("RRID-")
        console.print_error(RrridError(code, one.message, where, one.remedy))
    return outcome.exit_code


def read_shard(text: str | None) -> tuple[int, int]:
    """Return "2/4" as (2, 4); (1, 1) where nothing was said."""
    found = re.fullmatch(r"([0-9]{1,8})/([0-9]{1,8})", text or "1/1")
    if not found or not 1 <= int(found[1]) <= int(found[2]):
        raise UsageError("C02", f"'{text}' is no shard", "--shard", "write I/N, from 1/N to N/N")
    return int(found[1]), int(found[2])


def _bytes(text: str | None) -> int | None:
    """Return an amount of memory in bytes: "2G", "500M"."""
    if text is None:
        return None
    found = re.fullmatch(r"(\d+(?:\.\d+)?)([KMGT]?)I?B?", text.strip().upper())
    size = float(found[1]) * 1024 ** " KMGT".index(found[2] or " ") if found else 0.0
    if not 1 << 20 <= size < 1 << 50:
        message = f"'{text}' is no amount of memory"
        raise UsageError("C02", message, "--memory", "write for example 500M or 2G")
    return int(size)


def _report(name: str, given: Mapping[str, Any]) -> int:
    """Draw a report again from its stored result; nothing is computed."""
    from pipelines.rerender import rerender

    common, folder = read(Common, given), read(Inputs, given).folder
    drawn = rerender(folder.absolute(), common.out and common.out.absolute(), common.force)
    if not common.quiet:
        console.print_verdict(drawn)
        print(f"→ {escaped((common.out or folder) / 'report.html')}")
    return 0


def _doctor(name: str, given: Mapping[str, Any]) -> int:
    """Examine libraries, threads and folders, with a self-test of some seconds; exit 6: no use."""
    from pipelines.selfcheck import examine

    found, as_json = [], read(Common, given).json
    for one in examine(not read(Inputs, given).quick):  # each is printed when it is known
        found.append(one)
        if not as_json:
            remedy = f" ({one.remedy})" if one.remedy else ""
            print(f"  {console.SIGNS[one.level]} {one.name}: {one.found}{remedy}", flush=True)
    works = all(one.level != "bad" for one in found)
    if as_json:
        _print_json("doctor", {"works": works, "findings": found})
    else:
        print("rrrid can work here." if works else "rrrid cannot work here: see x above.")
    return 0 if works else EnvironmentFault.exit_code


def _print_json(command: str, content: dict[str, Any]) -> None:
    from pipelines.io.results import encode, headed, json_text

    encoded = {name: encode(value)[0] for name, value in content.items()}
    sys.stdout.write(json_text(headed(command, encoded)))


def _schema(name: str, given: Mapping[str, Any]) -> int:
    """Print the JSON schema of a command's result.json, of model.json, or of a log."""
    from pipelines.io.results import json_text

    sys.stdout.write(json_text(schema_of(read(Inputs, given).what)))
    return 0


def schema_of(what: str) -> dict[str, Any]:
    """Return the JSON schema of a command's result.json, of a "model" or of a "log"."""
    from pipelines.io.model_file import model_schema
    from pipelines.io.results import result_schema
    from pipelines.io.schema import log_schema
    from pipelines.report.batch_report import Result
    from pipelines.stage import result_type

    if what in ("model", "log"):
        return model_schema() if what == "model" else log_schema()
    if what == "batch":
        return result_schema(Result, what)
    if what in STAGES:
        return result_schema(result_type(stage_of(what)), what)
    known = ("model", "log", "batch", *STAGES)
    message = f"no schema of '{what}'{did_you_mean(what, known)}"
    raise UsageError("C02", message, "schema", f"one of: {', '.join(known)}")


ACTIONS = {"run": _run, "import": _import, "demo": _demo}  # any other stage: _stage
ACTIONS |= {"batch": _batch, "report": _report, "schema": _schema, "doctor": _doctor}
