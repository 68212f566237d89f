"""Run a stage: read, compute, report, write, and record the provenance.

A stage is a module directly in `pipelines/`: its docstring's first line is its title, `Settings`
holds every option with its default, `compute(inputs, settings)` opens no file and prints nothing,
`report(result)` returns words, tables and figures. `run_stage` does the rest, once for all: it
opens and checks the inputs, refuses to overwrite foreign files, and writes everything into a hidden
folder that takes the place of the old one in one step, with `provenance.json` as its last file.
"""

from __future__ import annotations

import dataclasses
import os
import platform
import sys
import time
import typing
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar

from pipelines import __version__
from pipelines.errors import Check, EnvironmentFault, InputRejected, RrridError, clean
from pipelines.io.files import expanded
from pipelines.io.hdf5 import write_series
from pipelines.io.log import ExperimentLog
from pipelines.io.output import (
    PROVENANCE,
    environment_faults,
    hash_file,
    refuse_foreign,
    refuse_place,
    remove_folder,
    renamed,
    replace_folder,
    short_names,
    slug,
    staging_place,
    tilde,
    write_file,
    write_text,
)
from pipelines.io.results import encode, headed, json_text
from pipelines.io.robot_files import robot_sources
from pipelines.io.sessions import Inputs, Rejected, Request, of_one_session, read_logs, refuse_mixed
from pipelines.report.config import REPORT
from pipelines.report.report import Report

__all__ = [
    "Answer",
    "Beside",
    "Inputs",
    "Outcome",
    "Rejected",
    "Request",
    "Stage",
    "Uses",
    "answered",
    "default_out",
    "footer_of",
    "handed_on",
    "read_logs",
    "refuse_foreign",
    "result_type",
    "robot_hashes",
    "run_stage",
    "slug",
    "tilde",
    "usable_folder",
]

S = TypeVar("S")
R = TypeVar("R")


@dataclass(frozen=True)
class Uses:
    """Inputs of a run on which a stage depends: where these are unchanged, its result is cached.

    Of a log that `logs` leaves out the stage may use attributes (experiment, role, robot) alone.
    """

    logs: Callable[[ExperimentLog, Any], bool] = lambda log, settings: True
    before: bool = False  # `material`: what an earlier stage handed on
    rejected: bool = False  # files that could not be opened


@dataclass(frozen=True)
class Beside:
    """Files that a stage reads besides the logs, named by its settings."""

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
    # write derived logs and tables into a folder
    write: Callable[[R, Path, Request], None] | None = None
    exit_code: Callable[[R, bool], int] = lambda result, check: 0  # (result, --check)
    checks: Callable[[R], tuple[Check, ...]] = lambda result: ()  # what compute found or repaired
    # inputs that `run` hands to the stages after it: fewer logs ("choice"), each log by itself with
    # more in it ("logs"), or material
    onward: Callable[[R, Inputs], Inputs] = lambda result, inputs: inputs
    hands_on: Literal["", "choice", "logs", "material"] = ""
    # a stored result with what `onward` needs, from the files that it has written
    restored: Callable[[R, Path], R] | None = None
    uses: Uses = field(default_factory=Uses)
    # read within `run` as well, where settings name files
    beside: Callable[[S, Request], Beside] | None = None
    in_run: S | None = None  # settings within `run`, where they are others than by default
    remakes: Callable[[str], bool] = lambda name: False  # own files, made again if changed (P10)
    ended: Callable[[Inputs], None] = lambda inputs: None  # called at the end, whatever it is
    # logs that must be of one robot and day: those of a folder, or all
    sessions: Literal["", "folder", "one"] = ""


@dataclass(frozen=True)
class Outcome(Generic[R]):
    """The result of `run_stage`, its folder, and the exit code of the process."""

    result: R
    json: dict[str, Any]
    report: Report
    folder: Path
    exit_code: int
    checks: tuple[Check, ...]
    inputs: Inputs = field(default_factory=Inputs)


def run_stage(stage: Stage[S, R], request: Request, settings: S) -> Outcome[R]:
    """Read, compute, report and write; the output folder is the old one or the complete new one.

    Raises:
        RrridError: with its code, place and exit code. Nothing is then changed.
        SeveralSessions: the logs are of several robots or days; `request.session` names one.
    """
    request = dataclasses.replace(request, paths=expanded(request.paths))
    given = {str(path.absolute()): str(path) for path in request.paths if not path.is_absolute()}
    inputs = ", ".join(map(str, request.paths))
    absolute = tuple(path.absolute() for path in request.paths)
    try:
        with environment_faults(request.out or Path()):
            return _run(stage, dataclasses.replace(request, paths=absolute), settings)
    except RrridError as problem:
        # a filter of samples, for example, knows no file
        problem.where = renamed(problem.where, given) or clean(inputs or f"rrrid {stage.name}")
        problem.message = renamed(problem.message, given)
        problem.remedy = renamed(problem.remedy, given)
        raise


def result_type(stage: Stage[Any, R]) -> type[R]:
    """Return the dataclass that a stage's `compute` returns."""
    found: type[R] = typing.get_type_hints(stage.compute)["return"]
    return found


def default_out(inputs: Inputs, command: str) -> Path:
    """Return the output folder of `command` where none is given."""
    return Path("runs") / slug(inputs.robot_name) / slug(inputs.label) / command


def _run(stage: Stage[S, R], request: Request, settings: S) -> Outcome[R]:
    started = time.time()
    if request.out is not None:
        refuse_place(request.out, (), request.paths)
        refuse_foreign(request.out, request.force, stage.remakes, stage.name)
    described = robot_hashes(request)
    inputs = stage.read(request, settings)
    if stage.sessions == "folder":
        refuse_mixed(inputs, filter(os.path.isdir, request.paths))
    if stage.sessions == "one":
        inputs = of_one_session(inputs)
    try:
        out = request.out or default_out(inputs, stage.name)
        changed = usable_folder(out, stage, request, inputs, described)
        answer = answered(stage, request, settings, inputs, described, started)
        request.tell("writing the report")
        object_ = answer.write(out)
    finally:
        stage.ended(inputs)
    words = "was not what rrrid had written there; it was made again"
    remedy = "look after the disk, or keep your own changes in another folder"
    remade = (Check.of("P10", "warn", words, where=name, remedy=remedy) for name in changed)
    exit_code = stage.exit_code(answer.result, request.check)
    checks = (*remade, *answer.checks)
    return Outcome(answer.result, object_, answer.report, out, exit_code, checks, inputs)


def robot_hashes(request: Request) -> dict[Path, str]:
    """Return the SHA-256 of the files that describe the robot which a request names."""
    return {} if request.robot is None else _hashes(robot_sources(request.robot), {})


def usable_folder(
    out: Path,
    stage: Stage[Any, Any],
    request: Request,
    inputs: Inputs,
    described: Iterable[Path] = (),
) -> Iterable[str]:
    """Refuse an output folder that a result cannot take; return its files that were changed.

    Raises:
        UsageError: it holds inputs, or something that is not rrrid's.
        EnvironmentFault: it cannot be written.
    """
    refuse_place(out, (*inputs.sources, *described), (*request.paths, *inputs.folders))
    return refuse_foreign(out, request.force, stage.remakes, stage.name)


@dataclass(frozen=True, eq=False)
class Answer(Generic[S, R]):
    """Computed result of a stage, with its inputs; `write` writes it."""

    stage: Stage[S, R]
    request: Request
    settings: S
    inputs: Inputs
    result: R
    checks: tuple[Check, ...]
    hashes: dict[Path, str]  # SHA-256 of every source
    started: float  # [s] since 1970

    @cached_property
    def report(self) -> Report:
        """The words, tables and figures of the result."""
        told: Report = renamed(self.stage.report(self.result), short_names(self.request.named))
        return told

    def write(self, out: Path) -> dict[str, Any]:
        """Write everything into a folder that takes the place of `out`; return the JSON object.

        Raises:
            InputRejected: F14, an input has changed meanwhile.
            EnvironmentFault: the folder cannot be written.
        """
        stage, result = self.stage, self.result
        bare, series = encode(result)
        object_: dict[str, Any] = tilde(headed(stage.name, bare))
        sources = {str(path): value for path, value in self.hashes.items()}
        request, names = self.request, ("strict", "assume_units", "robot", "format")
        options = {name: getattr(request, name) for name in names}
        about = {
            "tool": "rrrid",
            "version": __version__,
            "command": stage.name,
            "settings": encode(self.settings)[0],
            "seed": getattr(self.settings, "seed", None),
            "options": options | {"joints": list(request.joints), "session": request.session},
            "python": platform.python_version(),
            "inputs": sources,
        }
        with _new_folder(out) as folder:
            write_text(folder / "result.json", json_text(object_))
            if series:
                write_file(folder / "result.h5", lambda draft: write_series(draft, series))
            if stage.write is not None:
                stage.write(result, folder, self.request)
            if not self.request.no_report:
                from pipelines.report.render import write_report

                write_report(tilde(self.report), folder, footer_of(stage.name, sources))
            for path, before in self.hashes.items():
                if not path.exists() or hash_file(path) != before:
                    words, remedy = "was modified while it was processed", "wait for the recording"
                    raise InputRejected("F14", words, where=path, remedy=remedy)
            _write_provenance(folder, about, self.started)
        return object_


def answered(
    stage: Stage[S, R],
    request: Request,
    settings: S,
    inputs: Inputs,
    described: Mapping[Path, str],
    started: float,
) -> Answer[S, R]:
    """Compute what a stage finds in inputs that were read.

    Args:
        described: SHA-256 of the files that describe the robot.
        started: [s] since 1970, when the work began.

    Raises:
        RrridError: what `compute` raises, or under `strict` the first repair.
    """
    hashes = {**_hashes(inputs.sources, inputs.hashes), **described}
    # equal inputs give equal bytes in any place: no path of this machine goes into a result
    names = short_names(request.named)
    result = renamed(stage.compute(inputs, settings), names)
    of_logs = (check for opened in inputs.logs for check in opened.checks)
    checks = renamed((*inputs.checks, *of_logs, *stage.checks(result)), names)
    for check in checks:
        if request.strict and check.level == "repair":
            raise check.as_error()
    return Answer(stage, request, settings, inputs, result, checks, hashes, started)


def handed_on(
    before: Answer[Any, Any], stage: Stage[Any, Any], settings: Any, anew: bool = False
) -> Inputs:
    """Return what a stage gets of the one before it, as in a run.

    Args:
        anew: let the stage read what its settings name; only the logs are handed on.
    """
    inputs = before.stage.onward(before.result, before.inputs)
    if anew:
        return dataclasses.replace(stage.read(before.request, settings), logs=inputs.logs)
    beside = stage.beside(settings, before.request) if stage.beside else Beside()
    return dataclasses.replace(
        inputs,
        material=inputs.material if stage.uses.before else beside.material,
        rejected=inputs.rejected if stage.uses.rejected else (),
        sources=(*inputs.sources, *beside.sources),
        folders=(*inputs.folders, *beside.folders),
    )


@contextmanager
def _new_folder(out: Path) -> Iterator[Path]:
    """Give a hidden folder that takes the place of `out` at the end."""
    staging = staging_place(out)
    try:
        with environment_faults(out):
            staging.mkdir()
            yield staging
            replace_folder(staging, out)
    except EnvironmentFault as problem:
        problem.where = renamed(problem.where, {str(staging): str(out)})
        raise
    finally:
        remove_folder(staging)


def footer_of(command: str, inputs: Mapping[str, str]) -> dict[str, str]:
    """Return the foot of a report: versions, and inputs (path -> SHA-256).

    Each has the name of its file, one of several of that name with as many of the folders above it
    as make it unlike the others.
    """
    ends = {path: [Path(path).parts[-n:] for n in range(1, len(Path(path).parts) + 1)]
            for path in inputs}  # fmt: skip
    times = Counter(end for own in ends.values() for end in own)
    named = {}
    for path, value in sorted(inputs.items())[: REPORT.inputs]:
        name = next((str(Path(*end)) for end in ends[path] if times[end] == 1), path)
        named[f"input {name}"] = value[:16]
    return {"command": f"rrrid {command}", "version": __version__} | named


def _hashes(sources: Iterable[Path], known: Mapping[Path, str]) -> dict[Path, str]:
    """Return the hash of every readable source, of the very bytes that were read where `known`."""
    hashes = {}
    for path in sources:
        if path in known:
            hashes[path] = known[path]
        elif path.is_file() and os.access(path, os.R_OK):
            hashes[path] = hash_file(path)
    return hashes


def _write_provenance(folder: Path, about: dict[str, Any], started: float) -> None:
    """Write provenance.json, with the hash of every file that is there."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    # of loaded libraries: others had no part in the outcome, and importlib.metadata costs 15 ms
    names = ("numpy", "h5py", "pyarrow", "scipy", "matplotlib")
    loaded = {name: sys.modules[name] for name in names if name in sys.modules}
    about = about | {
        "outputs": {path.relative_to(folder).as_posix(): hash_file(path) for path in files},
        "libraries": {name: module.__version__ for name, module in loaded.items()},
        "started": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(started)),
        "duration": time.time() - started,
    }
    write_text(folder / PROVENANCE, json_text(tilde(about)))
