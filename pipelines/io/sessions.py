"""Tell the logs of several robots and days of recording apart, by what they say of themselves and never by where they lie.

    for session in apart(logs):     one robot and one day at a time; what was before goes with what came after
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

from pipelines.io.files import Opened

__all__ = ["Session", "apart", "called", "day_that_judges", "sessions"]

Key = tuple[str, str, str]

_PAUSE: Final = timedelta(hours=3)
_SESSION: Final = timedelta(hours=12)
_DATE: Final = len("2026-05-18")


@dataclass(frozen=True)
class Session:
    """The logs of one robot and one day."""

    name: str  # unlike that of any other session beside it: "rrr-tue 2026-03-02"
    robot: str
    description: str
    logs: tuple[Opened, ...]
    own: str  # what tells it from others of a robot of that name, for the name of a folder: "2026-03-02"; "" where there are none


def apart(logs: Iterable[Opened], named: Collection[Path] = ()) -> tuple[Session, ...]:
    """The logs of one robot and one day at a time.

    Args:
        named: files that the user named for a role: they go with every day of their robot.
    """
    groups = sessions(logs, named)
    names = [" ".join(filter(None, (robot, day))) for robot, _, day in groups]
    robots = [robot for robot, _, _ in groups]
    found = []
    for i, ((robot, description, day), members) in enumerate(groups.items()):
        again = names.count(names[i]) > 1
        own = "-".join(filter(None, (day, str(i + 1) if again else ""))) if robots.count(robot) > 1 else ""
        found.append(Session(f"{names[i]} ({i + 1})" if again else names[i], robot, description, tuple(members), own))
    return tuple(found)


def called(wanted: str, found: Collection[Session]) -> Session | None:
    """The session of this name, or the only one of the robot of this name."""
    of_robot = [one for one in found if one.robot == wanted]
    return next((one for one in found if one.name == wanted), of_robot[0] if len(of_robot) == 1 else None)


def sessions(logs: Iterable[Opened], named: Collection[Path] = ()) -> dict[Key, list[Opened]]:
    """Logs by the robot's name, its description, and the day.

    What a robot was like before (role "reference") goes with every later day, or with the only one; a plan, and what is in `named`,
    with every day of its robot. A day of which all logs judge (role "validate") goes with the day before it that has others, or
    with the first one after; logs that do not tell their day go with the only day of their robot.
    """
    groups: dict[Key, list[Opened]] = {}
    by_day = _across_midnight([((o.log.robot_name, o.log.robot_text, (o.log.recorded or "")[:10]), o) for o in logs])
    meant = [(key, o) for key, o in by_day if o.path in named]
    plans = [(key, o) for key, o in by_day if o.path not in named and o.log.origin == "planned"]
    rest = [(key, o) for key, o in by_day if o.path not in named and o.log.origin != "planned"]
    for key, opened in rest:
        if opened.log.role != "reference":
            groups.setdefault(key, []).append(opened)
    if not groups:
        _beside(groups, meant)
        meant = []
    _undated(groups)
    _judged_later(groups)
    found = tuple(groups)
    for key, opened in rest:
        if opened.log.role == "reference":
            days = [other for other in found if other[:2] == key[:2]]
            later = [other for other in days if not other[2] or key[2] <= other[2]]
            for other in later or (days if len(days) == 1 else [key]):
                groups.setdefault(other, []).append(opened)
    _beside(groups, (*meant, *plans))
    return groups


def _undated(groups: dict[Key, list[Opened]]) -> None:
    """Put logs that do not tell their day to the only day of their robot, where there is one: they speak of no other."""
    for key in [key for key in groups if not key[2]]:
        days = [other for other in groups if other[:2] == key[:2] and other != key]
        if len(days) == 1:
            groups[days[0]] += groups.pop(key)


def _judged_later(groups: dict[Key, list[Opened]]) -> None:
    """Put days whose logs all judge to the day whose model they judge: by themselves they say nothing."""
    judging = [key for key, logs in groups.items() if key[2] and all(opened.log.role == "validate" for opened in logs)]
    for key in judging:
        days = sorted(other for other in groups if other[:2] == key[:2] and other[2] and other not in judging)
        if days:
            before = [other for other in days if other[2] <= key[2]]
            groups[before[-1] if before else days[0]] += groups.pop(key)


def day_that_judges(session: Session) -> str:
    """The last day of which a session has logs that judge but none that is judged; "" where there is none."""
    days = {role: {(o.log.recorded or "")[:_DATE] for o in session.logs if (o.log.role == "validate") is role and o.log.recorded}
            for role in (True, False)}
    return max(days[True] - days[False], default="") if days[False] else ""


def _across_midnight(by_day: list[tuple[Key, Opened]]) -> list[tuple[Key, Opened]]:
    """The same, with the logs after midnight (UTC: an afternoon, elsewhere) to the day before where it is one session: no pause
    of more than three hours, and twelve in all. Logs of role "reference" and hours that are not told decide nothing."""
    times: dict[Key, list[datetime]] = {}
    for key, opened in by_day:
        if (began := _time(opened.log.recorded)) is not None and opened.log.role != "reference":
            times.setdefault(key, []).append(began)
    same: dict[Key, Key] = {}
    for key, after in sorted(times.items()):
        before = (*key[:2], (min(after) - timedelta(days=1)).date().isoformat())
        if before in times and before not in same and min(after) - max(times[before]) <= _PAUSE and (
                max(after) - min(times[before]) <= _SESSION):
            same[key] = before
    return [(same.get(key, key), opened) for key, opened in by_day]


def _time(recorded: str | None) -> datetime | None:
    """When a log began; None where it tells a day alone, or nothing that is a time."""
    try:
        told = datetime.fromisoformat(recorded or "")
    except ValueError:
        return None
    return told.replace(tzinfo=told.tzinfo or UTC) if len(recorded or "") > _DATE else None


def _beside(groups: dict[Key, list[Opened]], timeless: Iterable[tuple[Key, Opened]]) -> None:
    """Put each log to every day of its robot; where there is none, to one without a date."""
    found = tuple(groups)
    for key, opened in timeless:
        of_robot = [other for other in found if other[:2] == key[:2]]
        for other in of_robot or [(key[0], key[1], "")]:
            groups.setdefault(other, []).append(opened)
