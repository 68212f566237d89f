"""Refuse the logs of several robots or days, and name logs that nothing but their folder distinguishes.

    of_one_session(inputs)          the logs of one session; SeveralSessions, with the list, where there are more
    refuse_mixed(inputs, folders)   the same for each of several folders, whose logs are read one by one
    check_alike(inputs)             S21: logs of one name in two folders; validation logs of another day
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from pipelines.errors import Check, UsageError, clean
from pipelines.io.files import Opened
from pipelines.io.inputs import Inputs, only
from pipelines.io.sessions import Session, apart, day_that_judges

__all__ = ["SeveralSessions", "check_alike", "of_one_session", "refuse_mixed"]

_LISTED: Final = 4  # logs of a session that lies among others
_SESSIONS: Final = 6  # listed with their logs; where there are more, by their names alone


class SeveralSessions(UsageError):
    """C02: the logs are of several robots or days. `names` are those of the sessions."""

    names: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        return {**super().as_dict(), "sessions": [clean(name) for name in self.names]}


def of_one_session(inputs: Inputs) -> Inputs:
    """Return the inputs if their logs are of one robot and one day; logs named for a role go with every day of their robot.

    Raises:
        SeveralSessions: C02, they are of several; --session takes one, `batch` takes all.
        UsageError: C02, they are of several robots, and some were named for a role.
    """
    parts = [(session, [o for o in session.logs if o.log.origin != "planned"])
             for session in apart(inputs.logs, inputs.named)]
    every = {opened.path for _, used in parts for opened in used}
    if len(parts) < 2 or not every:
        return inputs
    whole = next((session for session, used in parts if len(used) == len(every)), None)
    if whole is not None:
        return only(inputs, whole)
    raise _several(inputs, [part for part in parts if not _within_another(part[1], parts)])


def refuse_mixed(inputs: Inputs, folders: Iterable[Path]) -> None:
    """Refuse a folder whose logs are of several sessions; logs that were named one by one may be of any.

    Raises:
        SeveralSessions: C02, one of `folders` holds several.
    """
    for folder in folders:
        logs = tuple(opened for opened in inputs.logs if opened.path.is_relative_to(folder))
        of_one_session(replace(inputs, logs=logs, label=str(folder)))


def _within_another(used: list[Opened], parts: Iterable[tuple[Session, list[Opened]]]) -> bool:
    """Return whether another session has all logs of this one, such as reference logs alone."""
    mine = {opened.path for opened in used}
    return any(mine < {opened.path for opened in others} for _, others in parts)


def _several(inputs: Inputs, parts: Collection[tuple[Session, list[Opened]]]) -> UsageError:
    robots = len({(session.robot, session.description) for session, _ in parts})
    days = len(parts) > robots
    kinds = " and ".join(kind for kind, there in (("robots", robots > 1), ("days", days)) if there)
    message = f"logs of several {kinds}: {_listed(parts)}"
    if robots > 1 and inputs.named:
        return UsageError(
            "C02", message, where=inputs.label,
            remedy="name logs of one robot alone for --identify, --validate and --reference; if "
            "it is one robot, described twice, give --robot FILE")
    own = "; for days that belong together, name their logs with --identify and --validate"
    problem = SeveralSessions(
        "C02", message, where=inputs.label,
        remedy=f"take one with --session '{next(iter(parts))[0].name}', or all with "
        f"'rrrid batch FOLDER [--stage COMMAND]'{own if days else ''}")
    problem.message = message  # the list is complete, however long
    problem.names = tuple(session.name for session, _ in parts)
    return problem


def _listed(parts: Collection[tuple[Session, list[Opened]]]) -> str:
    """The sessions, and the logs of each: by their folder, where that holds no others."""
    if len(parts) > _SESSIONS:
        return "; ".join(clean(session.name, 60) for session, _ in parts)
    homes: dict[Path, set[str]] = defaultdict(set)
    for session, used in parts:
        for opened in used:
            homes[opened.path.parent].add(session.name)
    return "; ".join(f"{clean(session.name, 60)} ({_members(used, homes)})" for session, used in parts)


def _members(used: list[Opened], homes: dict[Path, set[str]]) -> str:
    folders = list(dict.fromkeys(opened.path.parent for opened in used))
    count = f"{len(used)} log{'s' if len(used) > 1 else ''}"
    if all(len(homes[folder]) == 1 for folder in folders) and len(folders) < _LISTED:
        return f"{count} in {', '.join(clean(folder.name, 40) for folder in folders)}"
    names = [clean(opened.path.name, 40) for opened in used]
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return f"{', '.join(names[:_LISTED])}{more}"


def check_alike(inputs: Inputs) -> tuple[Check, ...]:
    """S21: a log's name is unique within a folder of logs. Where two folders below it have logs of one name, and neither robot nor
    day tells them apart, they may well be of two machines: they are taken for one, and that is said. So is a day whose
    logs judge those of another."""
    found = []
    for session in apart(inputs.logs, inputs.named):
        folders = _doubled(opened for opened in session.logs if opened.path not in inputs.named)
        if len(folders) > 1:
            named = ", ".join(clean(folder.name, 40) for folder in folders[:_LISTED])
            more = f" and {len(folders) - _LISTED} more" if len(folders) > _LISTED else ""
            found.append(Check.of(
                "S21", "warn", f"the folders {named}{more} hold logs of the same names, robot and day, and were taken for one "
                "session", where=clean(session.name, 60),
                remedy="if they are of two machines or sessions, give each folder by itself, or let their logs say so: robot_name, "
                "recorded"))
        named_none = replace(session, logs=tuple(opened for opened in session.logs if opened.path not in inputs.named))
        if day := day_that_judges(named_none):
            found.append(Check.of("S21", "warn", f"its logs of {day}, which all judge, were taken with it",
                                  where=clean(session.name, 60), remedy="if that is another session, name its logs by --validate"))
    return tuple(found)


def _doubled(logs: Iterable[Opened]) -> list[Path]:
    """The folders whose logs have a name that one of another folder has as well, for the same role."""
    named: dict[tuple[str, str], dict[Path, str]] = defaultdict(dict)
    for opened in logs:
        if opened.log.origin != "planned":
            named[opened.log.name, opened.log.role][opened.path.parent] = opened.sha256
    return list(dict.fromkeys(folder for homes in named.values() if len(set(homes.values())) > 1 for folder in homes))
