"""What a new output takes the place of: rrrid's own earlier one is replaced, and no result is lost that nobody meant to replace.

A result of another command is moved aside as a whole, whoever chose the folder: who names one with --out need not know what lies
there. One of the same command is moved aside in a default folder alone, where it is of other data (two folders of logs may have
one name), or has a model that is not made anew; a folder that was named is replaced, as asked. With --force nothing is kept. What
is kept or lost is said.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePath

from pipelines.errors import Check
from pipelines.io.output import slug

__all__ = ["beside", "kept", "of_other_data", "replaced"]

_DESCRIBES = {
    ".toml",
    ".json",
    ".urdf",
    ".xml",
    ".xacro",
}  # robots, recipes, models, results: two sessions may share them
_LOOK = "look there for it, or choose folders with --out"


def of_other_data(inputs: object, read: Iterable[str]) -> bool:
    """Whether an output of `inputs` (path -> SHA-256) is of logs, and none of them is among those that were `read`, by SHA-256 or
    place, of which no more are asked than it takes; also where it says nothing.

    What was made anew in its old place, imported again say, is no other data.
    """
    if not isinstance(inputs, Mapping):
        return True
    earlier = _data_of(inputs)
    return bool(earlier) and {*earlier, *map(str, earlier.values())}.isdisjoint(read)


def _data_of(inputs: Mapping[str, str]) -> dict[str, str]:
    """Those of the inputs that are measured; all where none is: results that are compared."""
    return {
        path: value
        for path, value in inputs.items()
        if PurePath(path).suffix.lower() not in _DESCRIBES
    } or dict(inputs)


def free_name(folder: Path) -> Path:
    number, free = 1, folder
    while free.exists() or free.is_symlink():
        number += 1
        free = folder.with_name(f"{folder.name}-{number}")
    return free


def beside(out: Path, ending: str) -> Path:
    """The free place beside `out` for what lies there now."""
    place = (
        out if out.name not in ("", "..") else Path(os.path.abspath(out))
    )  # a/.. has a name as well
    return free_name(place.with_name(slug(f"{place.name}-{ending}")) if ending else place)


def kept(out: Path, what: str, aside: Path, remedy: str = _LOOK) -> Check:
    """C05: where `what` lies now."""
    return Check.of(
        "C05",
        "warn",
        f"{what} is kept: its whole output was moved to {aside}",
        where=out,
        remedy=remedy,
    )


def replaced(out: Path, what: str, forced: bool) -> Check:
    """C05: `what` is gone."""
    return Check.of(
        "C05",
        "warn",
        f"{what} was replaced{', as --force says' if forced else ''}",
        where=out,
        remedy="leave --force out to keep such a result"
        if forced
        else "give every model an --out of its own to keep them all",
    )
