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
import shutil
import sys
import time
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar

from pipelines import __version__
from pipelines.errors import Check, EnvironmentFault, InputRejected, RrridError, UsageError, clean
from pipelines.log.atomic import environment_faults, replace_folder, staging_folder, write_file
from pipelines.log.experiment import ExperimentLog
from pipelines.log.files import PROVENANCE, Opened, expanded, find_logs, hash_file, open_log
from pipelines.log.places import given_names, keep_apart, refuse_foreign, renamed, short_names, slug, tilde, written_by
from pipelines.log.results import encode, json_text, write_series
from pipelines.log.robot import RobotDescription
from pipelines.log.robot_files import load_robot, robot_sources
from pipelines.report.report import Report

__all__ = ["Inputs", "Outcome", "Rejected", "Request", "Stage", "Uses", "default_out", "footer_of", "read_by_role", "read_logs",
           "refuse_foreign", "result_type", "run_stage", "slug", "tilde"]

_NAMED = 6  # rejected files, in one error
_LISTED = 40  # inputs, at the foot of a report

S = TypeVar("S")
R = TypeVar("R")


@dataclass(frozen=True)
class Request:
    """What the user asked of any stage: inputs, and the options that every command takes."""

    paths: tuple[Path, ...]
    out: Path | None = None
    robot: str | None = None  # description to use instead of the one inside the logs
    strict: bool = False  # a repair is an error
    check: bool = False  # a gate that failed, or something found, ends in exit 1
    force: bool = False  # replace a folder of rrrid's where files were added or changed since
    no_report: bool = False
    assume_units: bool = False
    format: str = "h5"  # of derived logs
    tell: Callable[[str], None] = field(default=lambda words: None, compare=False)  # progress, in words
    joints: tuple[int, ...] = ()  # 1-based: the joints to take of every log, in this order; none: all
    roles: Mapping[str, Sequence[str]] = field(default_factory=dict)  # role -> paths of logs that have it, whatever they say

    @property
    def named(self) -> tuple[Path, ...]:
        """Every input, also those that are named for a role."""
        return (*self.paths, *(Path(path).expanduser().absolute() for paths in self.roles.values() for path in paths))


@dataclass(frozen=True)
class Rejected:
    """An input that could not be opened, and why."""

    path: Path
    error: RrridError


@dataclass(frozen=True)
class Inputs:
    """What `read` found: opened logs, rejected files, and whatever a stage's own reader adds as `material`."""

    logs: tuple[Opened, ...] = ()
    rejected: tuple[Rejected, ...] = ()
    checks: tuple[Check, ...] = ()
    sources: tuple[Path, ...] = ()  # every file read, for provenance and for the check that none changed meanwhile
    hashes: Mapping[Path, str] = field(default_factory=dict)  # SHA-256 of what was read of them, where the reader knows
    folders: tuple[Path, ...] = ()  # folders of inputs that were named beside the request's paths: no output goes there
    robot: RobotDescription | None = None  # --robot
    material: Any = None
    label: str = ""  # folder name for the default --out
    robot_name: str = ""


@dataclass(frozen=True)
class Uses:
    """What of a run's inputs a stage looks at: within `run` it is computed again where this has changed, and only there.

    Of a log that `logs` leaves out it may know what the log says of itself (experiment, role, robot), and no sample.
    """

    logs: Callable[[ExperimentLog, Any], bool] = lambda log, settings: True  # (a log by what it says of itself, the settings)
    before: bool = False  # `material`: what a stage before it handed on
    rejected: bool = False  # files that could not be opened


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
    in_run: S | None = None  # settings within `run`, where they are others than by default
    durations: Callable[[R], dict[str, float]] = lambda result: {}  # [s] of parts of compute, for provenance.json alone
    remakes: Callable[[str], bool] = lambda name: False  # own files that are made again where they were changed (P10)
    ended: Callable[[Inputs, bool], None] = lambda inputs, finished: None  # told at the end; `finished`: not by a signal


@dataclass(frozen=True)
class Outcome(Generic[R]):
    """What `run_stage` leaves: the result, where it lies, and how the process shall end."""

    result: R
    json: dict[str, Any]
    report: Report
    folder: Path
    exit_code: int
    checks: tuple[Check, ...]


def read_logs(request: Request, settings: object, *, keep_rejected: bool = False) -> Inputs:
    """Open every log among the request's paths; the default reader of a stage.

    Raises:
        InputRejected: some of them are rejected, unless `keep_rejected` (the doctor looks at those too). The error is
            the first one's, and names the others.
    """
    if request.roles:
        return read_by_role(dataclasses.replace(request, roles={}), settings, request.roles, keep_rejected=keep_rejected)
    if not request.paths:
        raise _no_logs()
    paths, checks = find_logs(request.paths)
    robot = load_robot(request.robot) if request.robot is not None else None
    opened: list[Opened] = []
    rejected: list[Rejected] = []
    for index, path in enumerate(paths):
        request.tell(f"reading {path.name} ({index + 1} of {len(paths)})")
        try:
            opened.append(open_log(path, assume_units=request.assume_units, joints=request.joints, robot=robot))
        except RrridError as problem:
            if problem.exit_code != 3:
                raise
            rejected.append(Rejected(path, problem))
    if rejected and not keep_rejected:
        raise _all_of(rejected)
    names = sorted({opened_log.log.robot_name for opened_log in opened})
    return Inputs(tuple(opened), tuple(rejected), checks, paths, {o.path: o.sha256 for o in opened}, robot=robot,
                  label=_label(request.paths),
                  robot_name=names[0] if len(names) == 1 else "several" if names else "unknown")


def read_by_role(request: Request, settings: object, named: Mapping[str, Sequence[str]], *, keep_rejected: bool = False) -> Inputs:
    """The same with `named`: role -> paths. A log named for a role has it, whatever it says of itself; the others that say they
    have this role are left out.

    Raises:
        UsageError: C02, no input at all, or a log named for two roles; C04, no such file.
    """
    paths = {role: tuple(Path(path).expanduser().absolute() for path in given) for role, given in named.items() if given}
    every = tuple(dict.fromkeys((*request.paths, *(path for given in paths.values() for path in given))))
    if not every:
        raise _no_logs()
    inputs = read_logs(dataclasses.replace(request, paths=every), settings, keep_rejected=keep_rejected)
    roles: dict[Path, str] = {}
    for role, given in paths.items():
        for file in find_logs(given)[0]:
            if roles.setdefault(file, role) != role:
                raise UsageError("C02", f"{file.name} is named for {roles[file]} and for {role}", where=f"--{role}",
                                 remedy="name it for one of them")
    kept = [(opened, roles.get(opened.path, opened.log.role)) for opened in inputs.logs
            if opened.path in roles or opened.log.role not in paths]
    logs = tuple(opened if opened.log.role == role else dataclasses.replace(opened, log=dataclasses.replace(opened.log, role=role))
                 for opened, role in kept)
    beside = tuple(path for given in paths.values() for path in given)
    return dataclasses.replace(inputs, logs=logs, folders=(*inputs.folders, *beside))


def _no_logs() -> UsageError:
    return UsageError("C02", "no logs", where="LOGS", remedy="name logs, or folders of logs")


def _all_of(rejected: list[Rejected]) -> RrridError:
    """The first of several errors, with the names of the other files and their codes."""
    first, others = rejected[0].error, rejected[1:]
    if not others:
        return first
    named = ", ".join(f"{clean(r.path.name, 40)} ({r.error.code})" for r in others[:_NAMED])
    more = f" and {len(others) - _NAMED} more" if len(others) > _NAMED else ""
    return InputRejected(first.code.removeprefix("RRID-"), f"{clean(first.message, 160)}; {len(others)} more cannot be used: "
                         f"{named}{more}", where=first.where or rejected[0].path, remedy=first.remedy)


def _label(paths: Iterable[Path]) -> str:
    """What the default --out calls the inputs: the name of the first one's folder.

    Of rrrid's own output in runs/ROBOT/LABEL/COMMAND, or of its `logs`, it is LABEL: what is made of an import stands
    beside it, and two imports of one robot stay apart. Of own output that lies elsewhere it is that folder's name.
    """
    first = next(iter(paths)).absolute()
    folder = first if first.is_dir() else first.parent
    if folder.name == "logs" and written_by(folder.parent):
        folder = folder.parent
    return folder.parent.name if folder.name == written_by(folder) else folder.name


def run_stage(stage: Stage[S, R], request: Request, settings: S) -> Outcome[R]:
    """Read, compute, report and write `stage`; the output folder is the old one or the complete new one.

    Raises:
        RrridError: with the code, the place and the exit code of what went wrong. Nothing is then changed.
    """
    request = dataclasses.replace(request, paths=expanded(request.paths))
    given, inputs = given_names(request.paths), ", ".join(map(str, request.paths))
    try:
        with environment_faults(request.out or Path()):
            return _run(stage, dataclasses.replace(request, paths=tuple(path.absolute() for path in request.paths)), settings)
    except RrridError as problem:
        # What knows no file, such as a filter of samples, leaves the place to who knows the inputs.
        problem.where = renamed(problem.where, given) or clean(inputs or f"rrrid {stage.name}")
        problem.message = renamed(problem.message, given)
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
        refuse_foreign(request.out, request.force, stage.remakes)
    described = _hashes(robot_sources(request.robot), {}) if request.robot is not None else {}
    inputs = stage.read(request, settings)
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
    changed = refuse_foreign(out, request.force, stage.remakes)
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
    object_ = tilde({"command": stage.name, **object_})
    staging = staging_folder(out)
    try:
        with environment_faults(out):
            _fill(staging, stage, result, report, object_, series, request, hashes)
            _unchanged(hashes)
            _provenance(staging, stage, settings, request, hashes, started, stage.durations(result))
            replace_folder(staging, out)
    except EnvironmentFault as problem:
        problem.where = renamed(problem.where, {str(staging): str(out)})  # the user knows of no hidden folder
        raise
    finally:
        shutil.rmtree(staging, ignore_errors=True)
    return Outcome(result, object_, report, out, stage.exit_code(result, request.check), renamed(checks, names))


def _remade(changed: Iterable[str]) -> Iterable[Check]:
    """P10: what was no longer as rrrid had written it."""
    for name in changed:
        yield Check.of("P10", "warn", "was not what rrrid had written there; it was made again", where=name,
                       remedy="look after the disk, or keep your own changes in another folder")


def _fill(folder: Path, stage: Stage[S, R], result: R, report: Report, object_: dict[str, Any], series: dict[str, Any],
          request: Request, hashes: dict[Path, str]) -> None:
    write_file(folder / "result.json", lambda draft: _text(draft, json_text(object_)))
    if series:
        write_file(folder / "result.h5", lambda draft: write_series(draft, series))
    if stage.write is not None:
        stage.write(result, folder, request)
    if not request.no_report:
        from pipelines.report.render import write_report

        write_report(tilde(report), folder, footer_of(stage.name, {str(path): value for path, value in hashes.items()}))


def footer_of(command: str, inputs: Mapping[str, str]) -> dict[str, str]:
    """What the foot of a report says of where it comes from; `inputs`: path -> SHA-256."""
    named = {f"input {os.path.basename(path)}": value[:16] for path, value in sorted(inputs.items())[:_LISTED]}
    return {"command": f"rrrid {command}", "version": __version__} | named


def _text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


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
                    "format": request.format, "joints": list(request.joints)},
        "inputs": {str(path): value for path, value in hashes.items()}, "outputs": outputs,
        "python": platform.python_version(), "libraries": _libraries(),
        "started": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(started)), "duration": time.time() - started,
    } | ({"durations": durations} if durations else {})
    write_file(folder / PROVENANCE, lambda draft: _text(draft, json_text(tilde(about))))


def _libraries() -> dict[str, str]:
    """Of those that were loaded: what was not had no part in the outcome, and importlib.metadata costs 15 ms."""
    loaded = {name: sys.modules.get(name) for name in ("numpy", "h5py", "pyarrow", "scipy", "matplotlib")}
    return {name: module.__version__ for name, module in loaded.items() if module is not None}
