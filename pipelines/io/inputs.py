"""What any stage is asked, and the logs among it: opened, checked, and taken for the roles that the user names.

    inputs = read_logs(request, settings)
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from pipelines.errors import Check, InputRejected, RrridError, UsageError, clean, did_you_mean
from pipelines.io.files import Opened, find_logs, open_log
from pipelines.io.places import written_by
from pipelines.io.robot import RobotDescription
from pipelines.io.robot_files import load_robot
from pipelines.io.sessions import Session, apart, called

__all__ = ["Inputs", "Rejected", "Request", "only", "read_by_role", "read_logs"]

_NAMED: Final = 6  # rejected files, in one error


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
    session: str = ""  # the name of the only one to take, of several robots and days

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
    named: frozenset[Path] = frozenset()  # files that the user named for a role: whatever day they are of, they were meant


def read_logs(request: Request, settings: object, *, keep_rejected: bool = False) -> Inputs:
    """Open every log among the request's paths; the default reader of a stage.

    Raises:
        InputRejected: some of them are rejected, unless `keep_rejected` (the doctor looks at those too). The error is
            the first one's, and names the others.
        UsageError: C01, no such session; C02, no logs; C04, no such file.
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
    described = robot.checks if robot is not None else ()
    inputs = Inputs(tuple(opened), tuple(rejected), (*described, *checks), paths, {o.path: o.sha256 for o in opened}, robot=robot,
                    label=_label(request.paths),
                    robot_name=names[0] if len(names) == 1 else "several" if names else "unknown")
    return _of_session(inputs, request.session)


def _of_session(inputs: Inputs, wanted: str) -> Inputs:
    """The inputs with the logs of the session called `wanted` alone; all where it is "".

    Raises:
        UsageError: C01, there is no such session.
    """
    if not wanted:
        return inputs
    found = apart(inputs.logs, inputs.named)
    one = called(wanted, found)
    if one is None:
        names = [session.name for session in found]
        raise UsageError("C01", f"no session '{wanted}'{did_you_mean(wanted, names)}", where="--session",
                         remedy=f"there are: {', '.join(names)}")
    return only(inputs, one)


def only(inputs: Inputs, one: Session) -> Inputs:
    """The inputs with the logs of that session alone; what others were read from is no source of it."""
    kept = {opened.path for opened in one.logs}
    others = {opened.path for opened in inputs.logs} - kept
    return dataclasses.replace(
        inputs, logs=tuple(opened for opened in inputs.logs if opened.path in kept), robot_name=one.robot,
        sources=tuple(path for path in inputs.sources if path not in others),
        label=f"{inputs.label}-{one.own}" if one.own else inputs.label)


def read_by_role(request: Request, settings: object, named: Mapping[str, Sequence[str]], *, keep_rejected: bool = False) -> Inputs:
    """The same with `named`: role -> paths. A log named for a role has it, whatever it says of itself; the others that say they
    have this role are left out.

    Raises:
        UsageError: C01, no such session; C02, no input at all, or a log named for two roles; C04, no such file.
    """
    paths = {role: tuple(Path(path).expanduser().absolute() for path in given) for role, given in named.items() if given}
    every = tuple(dict.fromkeys((*request.paths, *(path for given in paths.values() for path in given))))
    if not every:
        raise _no_logs()
    inputs = read_logs(dataclasses.replace(request, paths=every, session=""), settings, keep_rejected=keep_rejected)
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
    inputs = dataclasses.replace(inputs, logs=logs, folders=(*inputs.folders, *beside), named=frozenset(roles))
    return _of_session(inputs, request.session)


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
