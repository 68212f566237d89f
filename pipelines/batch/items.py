"""Find the items of a batch: the folders below a root that hold logs, or every single log.

    items, checks = find_items(root, each_log=False)
    mine = shard(items, 1, 4)

What is a log, and what is passed over, is what `log.files.find_logs` says: hidden files, folders that rrrid itself wrote,
links out of the folder.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from pipelines.errors import Check, RrridError, UsageError
from pipelines.io.atomic import fault_of
from pipelines.io.files import entries, nothing_there, regular_file
from pipelines.io.places import slug

__all__ = ["Item", "find_items", "read_shard", "shard"]


@dataclass(frozen=True)
class Item:
    """One folder of logs, one robot and day of it, or one log."""

    name: str  # the path relative to the root, "." for the root itself; with the session
    paths: tuple[Path, ...]  # what the stage is given
    logs: tuple[Path, ...]  # the logs among and below them
    fault: RrridError | None = field(default=None, compare=False)  # the folder could not be looked into
    session: str = ""  # the only one to take

    @property
    def slug(self) -> str:
        """The name as that of one folder; two names never share one."""
        return slug(self.name)

    def divided(self, sessions: Iterable[str]) -> tuple[Item, ...]:
        """The item's sessions, each an item of its own."""
        return tuple(replace(self, name=f"{self.name}: {session}", session=session) for session in sessions)


def find_items(root: Path, each_log: bool = False) -> tuple[tuple[Item, ...], tuple[Check, ...]]:
    """Every item below `root`, sorted by name, and what was passed over.

    A folder that holds logs itself is an item. Where folders below it hold logs too, they are items of their own, and it has
    its own logs alone.

    Args:
        each_log: every log is an item.

    Raises:
        UsageError: C04, `root` does not exist; C02, it is no folder.
        NothingMatched: C06, there is no log below it.
    """
    root = root.absolute()
    if not os.path.isdir(root):
        regular_file(root)
        raise UsageError("C02", "is a log, not a folder of folders", where=root, remedy="run the stage on it alone")
    folders: dict[Path, list[Path]] = {}
    faults: dict[Path, RrridError] = {}
    checks: list[Check] = []
    _walk(root, folders, faults, checks)
    if not folders and not faults:
        raise nothing_there(root, checks, [root])
    items = [Item(_name(folder, root), (folder,), (), fault) for folder, fault in faults.items()]
    for folder, logs in folders.items():
        if each_log:
            items += [Item(_name(log, root), (log,), (log,)) for log in logs]
        else:
            nested = any(other.is_relative_to(folder) for other in folders if other != folder)
            items.append(Item(_name(folder, root), tuple(logs) if nested else (folder,), tuple(logs)))
    return tuple(sorted(items, key=lambda item: item.name)), tuple(checks)


def _name(path: Path, root: Path) -> str:
    return path.relative_to(root).as_posix()


def _walk(folder: Path, folders: dict[Path, list[Path]], faults: dict[Path, RrridError], checks: list[Check]) -> None:
    """Gather the logs of `folder` and of the folders below it, each under its own folder."""
    try:
        there = entries(folder, checks)
    except OSError as problem:
        faults[folder] = fault_of(problem, folder)
        return
    for entry in there:
        if entry.is_dir():
            _walk(entry, folders, faults, checks)
        else:
            folders.setdefault(folder, []).append(entry)


def shard(items: Sequence[Item], number: int, of: int) -> tuple[Item, ...]:
    """Every `of`-th item, from the `number`-th on, counted from 1: all shards together are all items, none twice."""
    return tuple(items[number - 1::of])


def read_shard(text: str | None) -> tuple[int, int]:
    """"2/4" as (2, 4); (1, 1) where nothing was said.

    Raises:
        UsageError: C02, it is no such fraction.
    """
    if text is None:
        return 1, 1
    first, slash, last = text.partition("/")
    if not (slash and first.isascii() and first.isdigit() and last.isascii() and last.isdigit() and len(text) < 12
            and 1 <= int(first) <= int(last)):
        raise UsageError("C02", f"'{text}' is no shard", where="--shard", remedy="write I/N, from 1/N to N/N")
    return int(first), int(last)
