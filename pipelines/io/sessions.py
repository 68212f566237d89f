"""Read the logs of a command: opened, in their roles, of one robot and one day of recording.

inputs = read_logs(request, settings)     every log among the request's paths
inputs = of_one_session(inputs)           SeveralSessions, with the list, where there are more

Sessions differ in attributes of their logs (robot, description, day), never in their folders.
"""

from __future__ import annotations

import contextlib
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from pipelines.errors import Check, InputRejected, RrridError, UsageError, clean, did_you_mean
from pipelines.io.config import SESSIONS
from pipelines.io.files import Opened, find_logs, open_log
from pipelines.io.output import written_by
from pipelines.io.robot import RobotDescription
from pipelines.io.robot_files import load_robot

Key = tuple[str, str, str]  # robot's name, its description, day


def silent(words: str) -> None:
    """Report no progress: a function by name, which a worker process can be given."""


@dataclass(frozen=True)
class Request:
    """The request of the user to any stage: inputs, and options that every command takes."""

    paths: tuple[Path, ...]
    out: Path | None = None
    robot: str | None = None  # description to use instead of the one inside the logs
    strict: bool = False  # a repair is an error
    check: bool = False  # a gate that failed, or something found, ends in exit 1
    force: bool = False  # replace a folder of rrrid's of any command, changed or not
    no_report: bool = False
    assume_units: bool = False
    format: str = "h5"  # of derived logs
    tell: Callable[[str], None] = field(default=silent, compare=False)  # progress, in words
    joints: tuple[int, ...] = ()  # 1-based: the joints of every log, in this order; none: all
    # role -> paths of logs that have it, instead of their attribute
    roles: Mapping[str, Sequence[str]] = field(default_factory=dict)
    session: str = ""  # the name of the only one to take, of several robots and days

    @property
    def named(self) -> tuple[Path, ...]:
        """Return every input, also those that are named for a role."""
        return (*self.paths, *(path for paths in _by_role(self.roles).values() for path in paths))


@dataclass(frozen=True)
class Rejected:
    """An input that could not be opened, and why."""

    path: Path
    error: RrridError


@dataclass(frozen=True)
class Inputs:
    """Opened logs, rejected files, and what a stage's own reader adds as `material`."""

    logs: tuple[Opened, ...] = ()
    rejected: tuple[Rejected, ...] = ()
    checks: tuple[Check, ...] = ()
    sources: tuple[Path, ...] = ()  # every file read, for provenance
    hashes: Mapping[Path, str] = field(default_factory=dict)  # SHA-256, where the reader has it
    folders: tuple[Path, ...] = ()  # inputs beside the request's paths: no output goes there
    robot: RobotDescription | None = None  # --robot
    material: Any = None
    label: str = ""  # folder name for the default --out
    robot_name: str = ""
    named: frozenset[Path] = frozenset()  # named for a role: they go with every day


@dataclass(frozen=True)
class Session:
    """The logs of one robot and one day."""

    name: str  # unlike that of any other session: "rrr-tue 2026-03-02"
    robot: str
    description: str
    logs: tuple[Opened, ...]
    own: str  # what distinguishes it from others of its robot: "2026-03-02"; "" for the only one


class SeveralSessions(UsageError):
    """C02: the logs are of several robots or days. `names` are those of the sessions."""

    names: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return the error as JSON has it."""
        return {**super().as_dict(), "sessions": [clean(name) for name in self.names]}


def _by_role(roles: Mapping[str, Sequence[str]]) -> dict[str, list[Path]]:
    absolute = {k: [Path(path).expanduser().absolute() for path in own] for k, own in roles.items()}
    return {role: paths for role, paths in absolute.items() if paths}


def read_logs(request: Request, settings: object, *, keep_rejected: bool = False) -> Inputs:
    """Open every log among the request's paths, and give it the role it was named for.

    A role that the user names goes before the attribute `role` of the log; other logs with that
    role are left out.

    Raises:
        InputRejected: some of them are rejected, unless `keep_rejected`. The error is the first
            one's, and names the others.
        UsageError: C01, no such session; C02, no logs, or one for two roles; C04, no such file.
    """
    if not request.named:
        raise UsageError("C02", "no logs", "LOGS", "name logs, or folders of logs")
    by_role = _by_role(request.roles)
    roles = _roles_of(by_role)
    paths, checks = find_logs(dict.fromkeys(request.named))
    robot = load_robot(request.robot) if request.robot is not None else None
    logs: list[Opened] = []
    rejected: list[Rejected] = []
    for index, path in enumerate(paths, 1):
        request.tell(f"reading {path.name} ({index} of {len(paths)})")
        units, joints = request.assume_units, request.joints
        try:
            opened = open_log(path, assume_units=units, joints=joints, robot=robot)
        except InputRejected as problem:
            rejected.append(Rejected(path, problem))
            continue
        if path in roles:
            opened = replace(opened, log=replace(opened.log, role=roles[path]))
        if path in roles or opened.log.role not in by_role:
            logs.append(opened)
    if rejected and not keep_rejected:
        raise _all_of(rejected)
    names = sorted({opened.log.robot_name for opened in logs})
    inputs = Inputs(
        tuple(logs),
        tuple(rejected),
        (*(robot.checks if robot is not None else ()), *checks),
        paths,
        {opened.path: opened.sha256 for opened in logs},
        folders=tuple(path for own in by_role.values() for path in own),
        robot=robot,
        label=_label(request.named[0].absolute()),
        robot_name=names[0] if len(names) == 1 else "several" if names else "unknown",
        named=frozenset(roles),
    )
    if not request.session:
        return inputs
    sessions = apart(inputs.logs, inputs.named)
    of_robot = [one for one in sessions if one.robot == request.session]
    fitting = [one for one in sessions if one.name == request.session] or of_robot
    if len(fitting) != 1:
        known = [one.name for one in sessions]
        words = f"no session '{request.session}'{did_you_mean(request.session, known)}"
        raise UsageError("C01", words, "--session", f"there are: {', '.join(known)}")
    return only(inputs, fitting[0])


def _roles_of(by_role: Mapping[str, Sequence[Path]]) -> dict[Path, str]:
    """Return the role for which each file is named.

    Raises:
        UsageError: C02, one for two roles.
    """
    roles: dict[Path, str] = {}
    for role, given in by_role.items():
        for file in find_logs(given)[0]:
            if roles.setdefault(file, role) != role:
                words = f"{file.name} is named for {roles[file]} and for {role}"
                raise UsageError("C02", words, f"--{role}", "name it for one of them")
    return roles


def _all_of(rejected: list[Rejected]) -> RrridError:
    """Return the first of several errors, with the names of the other files and their codes."""
    first, others = rejected[0].error, rejected[1:]
    if not others:
        return first
    named = _first_of([f"{r.path.name} ({r.error.code})" for r in others])
    words = f"{clean(first.message, 160)}; {len(others)} more cannot be used: {named}"
    code, where = first.code.removeprefix("RRID-"), first.where or rejected[0].path
    return InputRejected(code, words, where, first.remedy)


def _label(first: Path) -> str:
    """Return what the default --out calls the inputs: the name of the first one's folder.

    Of rrrid's own output in runs/ROBOT/LABEL/COMMAND, or of its `logs`, it is LABEL: results
    of an import go into the same folder, and two imports of one robot are not confused.
    """
    folder = first if first.is_dir() else first.parent
    if folder.name == "logs" and written_by(folder.parent):
        folder = folder.parent
    return folder.parent.name if folder.name == written_by(folder) else folder.name


def only(inputs: Inputs, session: Session) -> Inputs:
    """Return the inputs with the logs of that session alone."""
    kept = {opened.path for opened in session.logs}
    others = {opened.path for opened in inputs.logs} - kept
    return replace(
        inputs,
        logs=tuple(opened for opened in inputs.logs if opened.path in kept),
        robot_name=session.robot,
        sources=tuple(path for path in inputs.sources if path not in others),
        label=f"{inputs.label}-{session.own}" if session.own else inputs.label,
    )


def apart(logs: Iterable[Opened], named: Collection[Path] = ()) -> tuple[Session, ...]:
    """Return the sessions of `logs`.

    Args:
        named: files that the user named for a role: they go with every day of their robot.
    """
    groups = _grouped(logs, named)
    names = [f"{robot} {day}".strip() for robot, _, day in groups]
    robots = Counter(robot for robot, _, _ in groups)
    found = []
    for i, ((robot, description, day), members) in enumerate(groups.items()):
        name, own = names[i], day
        if names.count(name) > 1:
            name, own = f"{name} ({i + 1})", f"{day}-{i + 1}".strip("-")
        own = own if robots[robot] > 1 else ""
        found.append(Session(name, robot, description, tuple(members), own))
    return tuple(found)


def _grouped(logs: Iterable[Opened], named: Collection[Path]) -> dict[Key, list[Opened]]:
    """Return the logs by the robot's name, its description, and the day on which they began (UTC).

    Reference logs go with every later day, or with the only one; a plan, and what is in `named`,
    with every day of its robot. A day of which all logs judge (role "validate") goes with the day
    before it that has others, or with the first one after; logs without a date go with the only
    day of their robot.
    """
    groups: dict[Key, list[Opened]] = defaultdict(list)
    others: list[tuple[Key, Opened]] = []
    for key, opened in _across_midnight(list(logs)):
        log = opened.log
        if opened.path in named or log.origin == "planned" or log.role == "reference":
            others.append((key, opened))
        else:
            groups[key].append(opened)
    _join_days(groups)
    if not groups:  # what the user named alone is one session
        for key, opened in others:
            if opened.path in named:
                groups[*key[:2], ""].append(opened)
        others = [(key, opened) for key, opened in others if opened.path not in named]
    recorded = {key: _days(groups, key) for key, _ in others}
    for key, opened in others:
        chosen = recorded[key]
        if opened.path not in named and opened.log.origin != "planned":
            later = [day for day in chosen if not day[2] or key[2] <= day[2]]
            chosen = later or (chosen if len(chosen) == 1 else [key])
        for day in chosen or _days(groups, key) or [(*key[:2], "")]:
            groups[day].append(opened)
    return groups


def _across_midnight(logs: list[Opened]) -> list[tuple[Key, Opened]]:
    """Return the logs with their keys, those of a session across midnight (UTC) with its first day.

    It is one session where the pause is at most three hours, and all of it twelve. Reference logs
    and hours that are not given decide nothing.
    """
    keys = [(o.log.robot_name, o.log.robot_text, (o.log.recorded or "")[:10]) for o in logs]
    times: dict[Key, list[datetime]] = defaultdict(list)
    for key, opened in zip(keys, logs, strict=True):
        recorded = opened.log.recorded or ""
        if "T" in recorded and opened.log.role != "reference":
            with contextlib.suppress(ValueError):  # 30 February
                times[key].append(datetime.fromisoformat(recorded))
    same: dict[Key, Key] = {}
    for key, after in sorted(times.items()):
        before = (*key[:2], (min(after) - timedelta(days=1)).date().isoformat())
        if before in times and before not in same:
            pause, whole = min(after) - max(times[before]), max(after) - min(times[before])
            if pause <= SESSIONS.pause and whole <= SESSIONS.longest:
                same[key] = before
    return [(same.get(key, key), opened) for key, opened in zip(keys, logs, strict=True)]


def _join_days(groups: dict[Key, list[Opened]]) -> None:
    """Join logs without a date, and days of which all logs judge, with the day they belong to."""
    for key in [key for key in groups if not key[2]]:
        days = [day for day in _days(groups, key) if day != key]
        if len(days) == 1:
            groups[days[0]] += groups.pop(key)
    judging = [
        key for key, own in groups.items() if key[2] and all(o.log.role == "validate" for o in own)
    ]
    for key in judging:
        if days := sorted(day for day in _days(groups, key) if day[2] and day not in judging):
            before = [day for day in days if day < key]
            groups[before[-1] if before else days[0]] += groups.pop(key)


def _days(groups: Iterable[Key], key: Key) -> list[Key]:
    """Return the groups of the same robot as `key`."""
    return [one for one in groups if one[:2] == key[:2]]


def of_one_session(inputs: Inputs) -> Inputs:
    """Return the inputs if their logs are of one robot and one day.

    Raises:
        SeveralSessions: C02, they are of several; --session takes one, `batch` takes all.
        UsageError: C02, they are of several robots, and some were named for a role.
    """
    sessions = apart(inputs.logs, inputs.named)
    used = [{o.path for o in one.logs if o.log.origin != "planned"} for one in sessions]
    every = set().union(*used)
    if not every:
        return inputs
    if every in used:
        return only(inputs, sessions[used.index(every)])
    several = [
        session
        for session, mine in zip(sessions, used, strict=True)
        if not any(mine < others for others in used)
    ]
    robots = len({(session.robot, session.description) for session in several})
    days = len(several) > robots
    kinds = " and ".join(kind for kind, there in (("robots", robots > 1), ("days", days)) if there)
    words = f"logs of several {kinds}: {'; '.join(map(_in_words, several))}"
    if robots > 1 and inputs.named:
        remedy = "name logs of one robot alone; if it is one, described twice, give --robot FILE"
        raise UsageError("C02", words, inputs.label, remedy)
    remedy = f"take one with --session '{several[0].name}', or all with "
    remedy += "'rrrid batch FOLDER [--stage COMMAND]'"
    if days:
        remedy += "; for days that belong together, name their logs with --identify and --validate"
    problem = SeveralSessions("C02", words, where=inputs.label, remedy=remedy)
    problem.message = words  # complete, however long
    problem.names = tuple(session.name for session in several)
    raise problem


def refuse_mixed(inputs: Inputs, folders: Iterable[Path]) -> None:
    """Refuse a folder whose logs are of several sessions; logs named one by one may be of any.

    Raises:
        SeveralSessions: C02, one of `folders` holds several.
    """
    for folder in folders:
        logs = tuple(opened for opened in inputs.logs if opened.path.is_relative_to(folder))
        of_one_session(replace(inputs, logs=logs, label=str(folder)))


def _in_words(session: Session) -> str:
    files = [opened.path.name for opened in session.logs if opened.log.origin != "planned"]
    return f"{clean(session.name, 60)} ({_first_of(files)})"


def _first_of(names: Sequence[str], most: int = 4) -> str:
    first = ", ".join(clean(name, 40) for name in names[:most])
    return f"{first} and {len(names) - most} more" if len(names) > most else first
