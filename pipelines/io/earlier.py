"""Move an earlier batch aside: until batch refuses it like every command."""

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
    """Return whether an output of `inputs` is of other logs than those that were `read`."""
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
    """Return the free place beside `out` for what is there now."""
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
