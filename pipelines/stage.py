"""The anatomy every stage shares: read, compute, report, write, and say where it all came from.

A stage is a module directly in `pipelines/`: its docstring's first line is its title, `Settings` holds every option
with its default, `compute(inputs, settings)` opens no file and prints nothing, `report(result)` returns words, tables
and figures. `run_stage` does the rest, once for all: opening and checking the inputs, refusing to overwrite what is
not rrrid's, writing everything into a hidden folder that takes the place of the old one in one step, and
`provenance.json` as the last file of it.
"""

from __future__ import annotations

import dataclasses
import json
import os
import platform
import shutil
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

from pipelines.errors import Check, RrridError, UsageError
from pipelines.log.atomic import replace_folder, staging_folder, write_file
from pipelines.log.files import Opened, find_logs, hash_file, open_log
from pipelines.log.results import encode, json_text, write_series
from pipelines.log.robot import RobotDescription
from pipelines.log.robot_files import load_robot
from pipelines.report.report import Report

__all__ = ["Inputs", "Outcome", "Rejected", "Request", "Stage", "read_logs", "run_stage", "slug", "tilde"]

VERSION = "0.1.0"
PROVENANCE = "provenance.json"

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
    force: bool = False  # replace a folder of rrrid's whose files were changed since
    no_report: bool = False
    assume_units: bool = False
    format: str = "h5"  # of derived logs
    tell: Callable[[str], None] = field(default=lambda words: None, compare=False)  # progress, in words


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
    robot: RobotDescription | None = None  # --robot
    material: Any = None
    label: str = ""  # folder name for the default --out
    robot_name: str = ""


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
        InputRejected: one of them is rejected, unless `keep_rejected` (the doctor looks at those too).
    """
    del settings
    paths, checks = find_logs(request.paths)
    opened: list[Opened] = []
    rejected: list[Rejected] = []
    for index, path in enumerate(paths):
        request.tell(f"reading {path.name} ({index + 1} of {len(paths)})")
        try:
            opened.append(open_log(path, assume_units=request.assume_units))
        except RrridError as problem:
            if not keep_rejected or problem.exit_code != 3:
                raise
            rejected.append(Rejected(path, problem))
    robot = load_robot(request.robot) if request.robot else None
    names = sorted({opened_log.log.robot_name for opened_log in opened})
    return Inputs(tuple(opened), tuple(rejected), checks, paths, robot, label=_label(request.paths),
                  robot_name=names[0] if len(names) == 1 else "several" if names else "unknown")


def _label(paths: Iterable[Path]) -> str:
    first = next(iter(paths)).absolute()
    return first.name if first.is_dir() else first.parent.name


def run_stage(stage: Stage[S, R], request: Request, settings: S) -> Outcome[R]:
    """Read, compute, report and write `stage`; the output folder is the old one or the complete new one.

    Raises:
        RrridError: with the code, the place and the exit code of what went wrong. Nothing is then changed.
    """
    started = time.time()
    if request.out is not None:
        refuse_foreign(request.out, request.paths, request.force)
    inputs = stage.read(request, settings)
    out = request.out or Path("runs") / slug(inputs.robot_name) / slug(inputs.label) / stage.name
    refuse_foreign(out, request.paths, request.force)
    hashes = {path: hash_file(path) for path in inputs.sources if _readable(path)}
    result = stage.compute(inputs, settings)
    checks = (*inputs.checks, *(c for opened in inputs.logs for c in opened.checks), *stage.checks(result))
    if request.strict and (repair := next((c for c in checks if c.level == "repair"), None)):
        raise repair.as_error()
    request.tell("writing the report")
    report = stage.report(result)
    object_, series = encode(result)
    object_ = tilde({"command": stage.name, **object_})
    staging = staging_folder(out)
    try:
        _fill(staging, stage, result, report, object_, series, request, hashes)
        _unchanged(hashes)
        _provenance(staging, stage, settings, request, hashes, started)
        replace_folder(staging, out)
    finally:
        shutil.rmtree(staging, ignore_errors=True)
    return Outcome(result, object_, report, out, stage.exit_code(result, request.check), checks)


def _fill(folder: Path, stage: Stage[S, R], result: R, report: Report, object_: dict[str, Any], series: dict[str, Any],
          request: Request, hashes: dict[Path, str]) -> None:
    write_file(folder / "result.json", lambda draft: _text(draft, json_text(object_)))
    if series:
        write_file(folder / "result.h5", lambda draft: write_series(draft, series))
    if stage.write is not None:
        stage.write(result, folder, request)
    if not request.no_report:
        from pipelines.report.render import write_report

        footer = {"command": f"rrrid {stage.name}", "version": VERSION}
        footer |= {f"input {path.name}": value[:16] for path, value in list(hashes.items())[:40]}
        write_report(tilde(report), folder, footer)


def _text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def _readable(path: Path) -> bool:
    return path.is_file() and os.access(path, os.R_OK)


def _unchanged(hashes: dict[Path, str]) -> None:
    for path, before in hashes.items():
        if not path.exists() or hash_file(path) != before:
            raise Check.of("F14", "reject", "was modified while it was processed", where=path,
                           remedy="wait until the recording is finished").as_error()


def _provenance(folder: Path, stage: Stage[S, R], settings: S, request: Request, hashes: dict[Path, str], started: float) -> None:
    outputs = {path.relative_to(folder).as_posix(): hash_file(path) for path in sorted(folder.rglob("*")) if path.is_file()}
    about = {
        "tool": "rrrid", "version": VERSION, "command": stage.name,
        "settings": encode(settings)[0] if dataclasses.is_dataclass(settings) else {},
        "options": {"strict": request.strict, "assume_units": request.assume_units, "robot": request.robot,
                    "format": request.format},
        "inputs": {str(path): value for path, value in hashes.items()}, "outputs": outputs,
        "python": platform.python_version(), "libraries": _libraries(),
        "started": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(started)), "duration": time.time() - started,
    }
    write_file(folder / PROVENANCE, lambda draft: _text(draft, json_text(tilde(about))))


def _libraries() -> dict[str, str]:
    from importlib.metadata import version

    return {name: version(name) for name in ("numpy", "h5py", "pyarrow", "scipy", "matplotlib")}


def refuse_foreign(out: Path, inputs: Iterable[Path], force: bool = False) -> None:
    """C05: an output folder may be new, empty, or rrrid's own earlier output, and never lies inside an input.

    Raises:
        UsageError: it is anything else.
    """
    for path in inputs:
        if os.path.isdir(path) and out.resolve().is_relative_to(path.resolve()):
            raise UsageError("C05", f"lies inside the input {path}", where=out, remedy="choose another folder with --out")
    if out.is_symlink() or (out.exists() and not out.is_dir()):
        raise UsageError("C05", "is not a folder", where=out, remedy="choose another folder with --out")
    if not out.exists() or not any(out.iterdir()):
        return
    try:
        about = json.loads((out / PROVENANCE).read_text(encoding="utf-8"))
        ours = set(about["outputs"]) | {PROVENANCE} if about.get("tool") == "rrrid" else set()
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        ours = set()
    there = {path.relative_to(out).as_posix() for path in out.rglob("*") if not path.is_dir()}
    foreign = sorted(there - ours)
    if foreign and not (force and ours):
        raise UsageError("C05", f"holds files that rrrid did not write there: {', '.join(foreign[:3])}", where=out,
                         remedy="choose another folder with --out, or move them")


def slug(text: str) -> str:
    """`text` as a file name: [A-Za-z0-9._-], at most 80 characters, with a hash where something had to go (X11)."""
    import hashlib
    import re

    plain = re.sub(r"[^A-Za-z0-9._-]+", "-", text).strip("-.")[:69]
    reserved = plain.split(".")[0].upper() in {"CON", "PRN", "AUX", "NUL",
                                               *(f"{p}{i}" for p in ("COM", "LPT") for i in range(1, 10))}
    if plain == text and plain and not reserved:
        return plain
    return f"{'x-' if reserved else ''}{plain or 'x'}-{hashlib.sha256(text.encode('utf-8', 'surrogatepass')).hexdigest()[:8]}"


def tilde(value: Any) -> Any:
    """`value` with the home folder written as ~ in every text, so that no report names its user (X14)."""
    home = os.path.expanduser("~")
    if isinstance(value, str):
        return value.replace(home, "~") if len(home) > 1 else value
    if isinstance(value, dict):
        return {tilde(key): tilde(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return type(value)(tilde(item) for item in value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return dataclasses.replace(value, **{f.name: tilde(getattr(value, f.name)) for f in dataclasses.fields(value)})
    return value
