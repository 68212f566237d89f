"""Tell the logs of several robots and days of recording apart."""

from __future__ import annotations

from collections.abc import Iterable

from pipelines.log.files import Opened

__all__ = ["sessions"]


def sessions(logs: Iterable[Opened]) -> dict[tuple[str, str, str], list[Opened]]:
    """Logs by the robot's name, its description, and the day.

    What a robot was like before (role "reference") goes with every later day, or with the only one.
    """
    groups: dict[tuple[str, str, str], list[Opened]] = {}
    by_day = [((o.log.robot_name, o.log.robot_text, (o.log.recorded or "")[:10]), o) for o in logs]
    for key, opened in by_day:
        if opened.log.role != "reference":
            groups.setdefault(key, []).append(opened)
    found = tuple(groups)
    for key, opened in by_day:
        if opened.log.role == "reference":
            days = [other for other in found if other[:2] == key[:2]]
            later = [other for other in days if not other[2] or key[2] <= other[2]]
            for other in later or (days if len(days) == 1 else [key]):
                groups.setdefault(other, []).append(opened)
    return groups
