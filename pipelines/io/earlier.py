"""What a new output takes the place of: rrrid's own earlier one is replaced, and no result is lost that nobody meant to replace.

A result of another command is moved aside as a whole, whoever chose the folder: who names one with --out need not know what lies
there. One of the same command is moved aside in a default folder alone, where it is of other data (two folders of logs may have
one name), or has a model that is not made anew; a folder that was named is replaced, as asked. With --force nothing is kept. What
is kept or lost is said.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath

from pipelines.errors import Check, clean
from pipelines.io.atomic import replace_folder
from pipelines.io.places import free_name, provenance_of, slug

__all__ = ["Coming", "beside", "kept", "of_other_data", "put_in_place", "replaced"]

_DESCRIBES = {".toml", ".json", ".urdf", ".xml", ".xacro"}  # robots, recipes, models, results: two sessions may share them
_LOOK = "look there for it, or choose folders with --out"
_LOOK_APART = "look there for it, or give the results of each an --out of their own"


@dataclass(frozen=True)
class Coming:
    """The output that takes the place."""

    command: str
    named: bool  # the folder, with --out
    force: bool = False
    read: frozenset[str] = frozenset()  # SHA-256 and, as in provenance.json, places of the logs or recordings that it is of
    spare: tuple[str, ...] = ()  # causes of a model that lies there, where it does not make that anew


@dataclass(frozen=True)
class _Loss:
    """An earlier output that would be gone."""

    what: str
    ending: str  # of its name beside its place
    asked: bool = False  # to be replaced
    remedy: str = _LOOK


def put_in_place(staging: Path, out: Path, coming: Coming) -> tuple[Check, ...]:
    """`staging` takes the place of `out` in one step. C05: what is moved aside for it, or is lost to it, is said."""
    loss = _loss(out, coming)
    if loss is None:
        replace_folder(staging, out)
        return ()
    if coming.force or loss.asked:
        replace_folder(staging, out)
        return (replaced(out, loss.what, coming.force),)
    aside = beside(out, loss.ending)
    replace_folder(staging, out, aside)
    return (kept(out, loss.what, aside, loss.remedy),)


def _loss(out: Path, coming: Coming) -> _Loss | None:
    about = provenance_of(out)
    if not about:
        return None
    command = about.get("command")
    if command != coming.command:
        other = command if isinstance(command, str) else ""
        return _Loss(f"the earlier result of {clean(other, 40) or 'another command'}", other or "earlier")
    if coming.spare:
        return _Loss(f"the earlier model there, with {', '.join(coming.spare)},", "-".join(coming.spare).replace(":", "-"),
                     coming.named)
    if not coming.named and of_other_data(inputs := about.get("inputs"), coming.read):
        return _Loss(f"the earlier result of {coming.command}, {_whose(inputs)},", "", remedy=_LOOK_APART)
    return None


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
    return {path: value for path, value in inputs.items() if PurePath(path).suffix.lower() not in _DESCRIBES} or dict(inputs)


def _whose(inputs: object) -> str:
    data = sorted(_data_of(inputs)) if isinstance(inputs, Mapping) else ()
    if not data:
        return "which does not say of what data it is"
    return f"of other data ({clean(data[0])}{f' and {len(data) - 1} more' if len(data) > 1 else ''})"


def beside(out: Path, ending: str) -> Path:
    """The free place beside `out` for what lies there now."""
    place = out if out.name not in ("", "..") else Path(os.path.abspath(out))  # a/.. has a name as well
    return free_name(place.with_name(slug(f"{place.name}-{ending}")) if ending else place)


def kept(out: Path, what: str, aside: Path, remedy: str = _LOOK) -> Check:
    """C05: where `what` lies now."""
    return Check.of("C05", "warn", f"{what} is kept: its whole output was moved to {aside}", where=out, remedy=remedy)


def replaced(out: Path, what: str, forced: bool) -> Check:
    """C05: `what` is gone."""
    return Check.of("C05", "warn", f"{what} was replaced{', as --force says' if forced else ''}", where=out,
                    remedy="leave --force out to keep such a result" if forced else
                    "give every model an --out of its own to keep them all")
