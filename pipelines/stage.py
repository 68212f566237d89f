"""The anatomy every stage shares: read, compute, report, write, and say where it all came from.

A stage is a module directly in `pipelines/`: its docstring's first line is its title, `Settings` holds every option
with its default, `compute(inputs, settings)` opens no file and prints nothing, `report(result)` returns words, tables
and figures. `run_stage` does the rest, once for all: opening and checking the inputs, refusing to overwrite what is
not rrrid's, writing everything into a hidden folder that takes the place of the old one in one step, and
`provenance.json` as the last file of it.
"""

from __future__ import annotations

import dataclasses
import os
import platform
import sys
import time
import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar

from pipelines import __version__
from pipelines.errors import Check, EnvironmentFault, RrridError, clean
from pipelines.io.files import expanded
from pipelines.io.log import ExperimentLog
from pipelines.io.output import (
    PROVENANCE,
    environment_faults,
    given_names,
    hash_file,
    keep_apart,
    refuse_foreign,
    refuse_unwritable,
    remove_folder,
    renamed,
    replace_folder,
    short_names,
    slug,
    staging_place,
    tilde,
    told_apart,
    write_file,
    write_text,
)
from pipelines.io.results import encode, headed, json_text, write_series
from pipelines.io.robot_files import robot_sources
from pipelines.io.sessions import (
    Inputs,
    Rejected,
    Request,
    check_alike,
    of_one_session,
    read_by_role,
    read_logs,
    refuse_mixed,
)
from pipelines.report.report import Report

__all__ = ["Beside", "Inputs", "Outcome", "Rejected", "Request", "Stage", "Uses", "default_out", "footer_of", "read_by_role",
           "read_logs", "refuse_foreign", "result_type", "run_stage", "slug", "tilde"]

_LISTED = 40  # inputs, at the foot of a report

S = TypeVar("S")
R = TypeVar("R")


@dataclass(frozen=True)
class Uses:
    """What of a run's inputs a stage looks at: within `run` it is computed again where this has changed, and only there.

    Of a log that `logs` leaves out it may know what the log says of itself (experiment, role, robot), and no sample.
    """

    logs: Callable[[ExperimentLog, Any], bool] = lambda log, settings: True  # (a log by what it says of itself, the settings)
    before: bool = False  # `material`: what a stage before it handed on
    rejected: bool = False  # files that could not be opened


@dataclass(frozen=True)
class Beside:
    """What a stage reads beside the logs, of files that its settings name."""

    material: Any = None
    sources: tuple[Path, ...] = ()  # every one of the user's files
    folders: tuple[Path, ...] = ()  # no output goes there


@dataclass(frozen=True)
class Stage(Generic[S, R]):
    """One command's computation, between reading and writing."""

    name: str  # the command's
    title: str
    settings: type[S]
    compute: Callable[[Inputs, S], R]
    report: Callable[[R], Report]
    read: Callable[[Request, S], Inputs]
    write: Callable[[R, Path, Request], None] | None = None  # derived logs and tables, into the folder it is given
    exit_code: Callable[[R, bool], int] = lambda result, check: 0  # (result, --check)
    checks: Callable[[R], tuple[Check, ...]] = lambda result: ()  # what compute found or mended
    onward: Callable[[R, Inputs], Inputs] = lambda result, inputs: inputs  # what `run` hands to the stages after it:
    hands_on: Literal["", "choice", "logs", "material"] = ""  # fewer logs, each log by itself with more in it, or material
    restored: Callable[[R, Path], R] | None = None  # a stored result with what `onward` needs out of the files it has written
    uses: Uses = field(default_factory=Uses)
    beside: Callable[[S, Request], Beside] | None = None  # reads it within `run` as well, where settings say `in_run`
    in_run: S | None = None  # settings within `run`, where they are others than by default
    durations: Callable[[R], dict[str, float]] = lambda result: {}  # [s] of parts of compute, for provenance.json alone
    remakes: Callable[[str], bool] = lambda name: False  # own files that are made again where they were changed (P10)
    ended: Callable[[Inputs, bool], None] = lambda inputs, finished: None  # told at the end; `finished`: not by a signal
    sessions: Literal["", "folder", "one"] = ""  # which logs must be of one robot and day: those of a folder, or all


@dataclass(frozen=True)
class Outcome(Generic[R]):
    """What `run_stage` leaves: the result, where it lies, and how the process shall end."""

    result: R
    json: dict[str, Any]
    report: Report
    folder: Path
    exit_code: int
    checks: tuple[Check, ...]


def run_stage(stage: Stage[S, R], request: Request, settings: S) -> Outcome[R]:
    """Read, compute, report and write `stage`; the output folder is the old one or the complete new one.

    Raises:
        RrridError: with the code, the place and the exit code of what went wrong. Nothing is then changed.
        SeveralSessions: the logs are of several robots or days; `request.session` names the one to take.
    """
    request = dataclasses.replace(request, paths=expanded(request.paths))
    given, inputs = given_names(request.paths), ", ".join(map(str, request.paths))
    try:
        with environment_faults(request.out or Path()):
            return _run(stage, dataclasses.replace(request, paths=tuple(path.absolute() for path in request.paths)), settings)
    except RrridError as problem:
        # What knows no file, such as a filter of samples, leaves the place to who knows the inputs.
        problem.where = renamed(problem.where, given) or clean(inputs or f"rrrid {stage.name}")
        problem.message, problem.remedy = renamed(problem.message, given), renamed(problem.remedy, given)
        raise


def result_type(stage: Stage[Any, R]) -> type[R]:
    """The dataclass that a stage's `compute` fills in."""
    found: type[R] = typing.get_type_hints(stage.compute)["return"]
    return found


def default_out(inputs: Inputs, command: str) -> Path:
    """Where the outcome of `command` goes when nobody says."""
    return Path("runs") / slug(inputs.robot_name) / slug(inputs.label) / command


def _run(stage: Stage[S, R], request: Request, settings: S) -> Outcome[R]:
    started = time.time()
    if request.out is not None:
        keep_apart(request.out, (), request.paths)
        refuse_unwritable(request.out)
        refuse_foreign(request.out, request.force, stage.remakes, stage.name)
    described = _hashes(robot_sources(request.robot), {}) if request.robot is not None else {}
    inputs = stage.read(request, settings)
    if stage.sessions == "folder":
        refuse_mixed(inputs, filter(os.path.isdir, request.paths))
    if stage.sessions == "one":
        inputs = of_one_session(inputs)
        inputs = dataclasses.replace(inputs, checks=(*inputs.checks, *check_alike(inputs)))
    try:
        outcome = _outcome(stage, request, settings, inputs, described, started)
    except BaseException as problem:
        stage.ended(inputs, isinstance(problem, Exception))
        raise
    stage.ended(inputs, True)
    return outcome


def _outcome(stage: Stage[S, R], request: Request, settings: S, inputs: Inputs, described: dict[Path, str],
             started: float) -> Outcome[R]:
    out = request.out or default_out(inputs, stage.name)
    keep_apart(out, (*inputs.sources, *described), (*request.paths, *inputs.folders))
    refuse_unwritable(out)
    changed = refuse_foreign(out, request.force, stage.remakes, stage.name)
    hashes = _hashes(inputs.sources, inputs.hashes) | described
    # Equal inputs give equal bytes, wherever they lie: no path of this machine goes into a result.
    names = short_names(request.named)
    result = renamed(stage.compute(inputs, settings), names)
    checks = (*_remade(changed), *inputs.checks, *(c for opened in inputs.logs for c in opened.checks), *stage.checks(result))
    if request.strict and (repair := next((c for c in checks if c.level == "repair"), None)):
        raise repair.as_error()
    request.tell("writing the report")
    report = renamed(stage.report(result), names)
    object_, series = encode(result)
    object_ = tilde(headed(stage.name, object_))
    staging = staging_place(out)
    try:
        with environment_faults(out):
            staging.mkdir()
            _fill(staging, stage, result, report, object_, series, request, hashes)
            _unchanged(hashes)
            _provenance(staging, stage, settings, request, hashes, started, stage.durations(result))
            replace_folder(staging, out)
    except EnvironmentFault as problem:
        problem.where = renamed(problem.where, {str(staging): str(out)})  # the user knows of no hidden folder
        raise
    finally:
        remove_folder(staging)
    return Outcome(result, object_, report, out, stage.exit_code(result, request.check), renamed(checks, names))


def _remade(changed: Iterable[str]) -> Iterable[Check]:
    """P10: what was no longer as rrrid had written it."""
    for name in changed:
        yield Check.of("P10", "warn", "was not what rrrid had written there; it was made again", where=name,
                       remedy="look after the disk, or keep your own changes in another folder")


def _fill(folder: Path, stage: Stage[S, R], result: R, report: Report, object_: dict[str, Any], series: dict[str, Any],
          request: Request, hashes: dict[Path, str]) -> None:
    write_text(folder / "result.json", json_text(object_))
    if series:
        write_file(folder / "result.h5", lambda draft: write_series(draft, series))
    if stage.write is not None:
        stage.write(result, folder, request)
    if not request.no_report:
        from pipelines.report.render import write_report

        write_report(tilde(report), folder, footer_of(stage.name, {str(path): value for path, value in hashes.items()}))


def footer_of(command: str, inputs: Mapping[str, str]) -> dict[str, str]:
    """What the foot of a report says of where it comes from; `inputs`: path -> SHA-256.

    Each by the name of its file, or with the folders above it that tell it from others of that name.
    """
    names = told_apart(inputs)
    named = {f"input {names[path]}": value[:16] for path, value in sorted(inputs.items())[:_LISTED]}
    return {"command": f"rrrid {command}", "version": __version__} | named


def _hashes(sources: Iterable[Path], known: Mapping[Path, str]) -> dict[Path, str]:
    """The hash of every readable source: of the very bytes that were read, where the reader took it."""
    readable = [path for path in sources if path in known or (path.is_file() and os.access(path, os.R_OK))]
    return {path: known[path] if path in known else hash_file(path) for path in readable}


def _unchanged(hashes: dict[Path, str]) -> None:
    for path, before in hashes.items():
        if not path.exists() or hash_file(path) != before:
            raise Check.of("F14", "reject", "was modified while it was processed", where=path,
                           remedy="wait until the recording is finished").as_error()


def _provenance(folder: Path, stage: Stage[S, R], settings: S, request: Request, hashes: dict[Path, str], started: float,
                durations: dict[str, float]) -> None:
    outputs = {path.relative_to(folder).as_posix(): hash_file(path) for path in sorted(folder.rglob("*")) if path.is_file()}
    about = {
        "tool": "rrrid", "version": __version__, "command": stage.name,
        "settings": encode(settings)[0] if dataclasses.is_dataclass(settings) else {},
        "seed": getattr(settings, "seed", None),
        "options": {"strict": request.strict, "assume_units": request.assume_units, "robot": request.robot,
                    "format": request.format, "joints": list(request.joints)} | (
                        {"session": request.session} if request.session else {}),
        "inputs": {str(path): value for path, value in hashes.items()}, "outputs": outputs,
        "python": platform.python_version(), "libraries": _libraries(),
        "started": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(started)), "duration": time.time() - started,
    } | ({"durations": durations} if durations else {})
    write_text(folder / PROVENANCE, json_text(tilde(about)))


def _libraries() -> dict[str, str]:
    """Of those that were loaded: what was not had no part in the outcome, and importlib.metadata costs 15 ms."""
    loaded = {name: sys.modules.get(name) for name in ("numpy", "h5py", "pyarrow", "scipy", "matplotlib")}
    return {name: module.__version__ for name, module in loaded.items() if module is not None}
