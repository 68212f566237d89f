"""Find the files of a recipe by pattern: `run_{number}.csv`, `{role}/*.mat`, `{stem}_tau.csv`."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path

from pipelines.errors import EnvironmentFault, InputRejected, UsageError
from pipelines.io.sandbox import Answer, guarded

__all__ = ["files_below", "fill", "inside", "lying_there", "match", "matches", "unique"]

_MOST_FILES = 100_000
_NAMED = 5  # files that a message names
_LONGEST = 500  # characters of a pattern
_SIMPLE = 2  # wildcards: a name of 255 characters is tried 255² times at most
_SECONDS = 3.0  # for all patterns of a recipe on all names
_MEMORY = 256 << 20  # [B]
_FIELD = re.compile(r"\{([A-Za-z_]\w*)(?::([^{}]+(?:\{\d+(?:,\d*)?\}[^{}]*)*))?\}")

Patterns = str | tuple[str, ...]


@lru_cache(maxsize=256)
def _compiled(pattern: str) -> re.Pattern[str]:
    """Return the regular expression of a pattern.

    {name} is any text without a slash, {name:regex} that; *, ** and ? are as in a shell.
    """
    if len(pattern) > _LONGEST:
        message, remedy = f"a pattern of {len(pattern)} characters", f"write at most {_LONGEST}"
        raise UsageError("C02", message, where="match", remedy=remedy)
    parts, at = [], 0
    seen: set[str] = set()
    for found in _FIELD.finditer(pattern):
        name, inner = found.group(1), found.group(2) or r"[^/]+?"
        group = f"(?P={name})" if name in seen else f"(?P<{name}>{inner})"
        parts += [_shell(pattern[at : found.start()]), group]
        seen.add(name)
        at = found.end()
    parts.append(_shell(pattern[at:]))
    try:
        return re.compile("".join(parts))
    except re.error as problem:
        message = f"pattern '{pattern}': {problem}"
        remedy = "write {name}, or {name:regular expression}"
        raise UsageError("C02", message, where="match", remedy=remedy) from None


def _shell(text: str) -> str:
    text = re.escape(text)
    return text.replace(r"\*\*", ".*").replace(r"\*", "[^/]*").replace(r"\?", "[^/]")


def _each(patterns: Patterns) -> tuple[str, ...]:
    return (patterns,) if isinstance(patterns, str) else patterns


def matches(
    every: Sequence[Patterns], names: Sequence[str], where: Path
) -> list[dict[str, dict[str, str]]]:
    """Return the names that fit each of `every` patterns, with their groups, in limited time.

    A regular expression can take very long; one that could is matched in a child process.

    Raises:
        UsageError: C02, a pattern is invalid, or takes too long.
    """
    flat = [pattern for patterns in every for pattern in _each(patterns)]
    for pattern in flat:
        _compiled(pattern)

    def work() -> list[dict[str, dict[str, str]]]:
        fits = [{name: match(patterns, name) for name in names} for patterns in every]
        return [{k: groups for k, groups in fit.items() if groups is not None} for fit in fits]

    if all(":" not in p and len(re.findall(r"\{|\*+", p)) <= _SIMPLE for p in flat):
        return work()
    try:
        answer = guarded(lambda: Answer({"found": work()}, {}), where, seconds=_SECONDS, memory=_MEMORY)
    except InputRejected:
        message = f"a pattern takes more than {_SECONDS:.0f} s: {', '.join(flat)}"
        remedy = "write fewer wildcards, and no repetition inside another, such as (a+)+"
        raise UsageError("C02", message, where=where, remedy=remedy) from None
    found: list[dict[str, dict[str, str]]] = answer.about["found"]
    return found


def match(patterns: Patterns, relative: str) -> dict[str, str] | None:
    """Return the groups of the first pattern that fits the path, and {stem}; None otherwise."""
    for pattern in _each(patterns):
        if found := _compiled(pattern).fullmatch(relative):
            return {"stem": Path(relative).stem} | found.groupdict(default="")
    return None


def lying_there(names: Sequence[str], endings: Collection[str]) -> str:
    """Return the files of a folder in words, those with the `endings` of recordings first."""
    if not names:
        return "no file lies there"
    ordered = sorted(names, key=lambda name: Path(name).suffix.lower() not in endings)
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    lie = "lies" if len(names) == 1 else "lie"
    return f"there {lie} {', '.join(ordered[:_NAMED])}{more}"


def fill(template: str, groups: Mapping[str, str], where: object) -> str:
    """Return a template with its {groups} filled in.

    Raises:
        UsageError: C02, it names a group that the pattern does not have.
    """
    for name in re.findall(r"\{(\w+)\}", template):
        if name not in groups:
            message = f"'{template}' names {{{name}}}, but the pattern has {', '.join(groups)}"
            remedy = "name one of these, or add it to the pattern"
            raise UsageError("C02", message, where=where, remedy=remedy)
    return re.sub(r"\{(\w+)\}", lambda found: groups[found[1]], template)


def files_below(folder: Path) -> tuple[str, ...]:
    """Return the relative paths of all files below `folder`, without hidden ones, sorted.

    Links to folders are not followed.

    Raises:
        UsageError: not a folder. EnvironmentFault: no permission.
    """
    if not folder.is_dir():
        remedy = "give the folder of the recordings with --source"
        raise UsageError("C04", "no such folder", where=folder, remedy=remedy)
    if not os.access(folder, os.R_OK | os.X_OK):
        remedy = "change its permissions"
        raise EnvironmentFault("F13", "permission denied", where=folder, remedy=remedy)
    found: list[str] = []
    for parent, folders, names in os.walk(folder, followlinks=False):
        folders[:] = sorted(f for f in folders if not f.startswith("."))
        shown = [name for name in names if not name.startswith(".")]
        found += [Path(parent, name).relative_to(folder).as_posix() for name in shown]
        if len(found) > _MOST_FILES:
            message = f"more than {_MOST_FILES} files"
            remedy = "give a folder that holds the recordings only"
            raise UsageError("C07", message, where=folder, remedy=remedy)
    return tuple(sorted(found))


def inside(folder: Path, relative: str, where: object) -> Path:
    """Return the path of a file, whose name must not lead out of the folder; a link may.

    Raises:
        UsageError: X11, it does.
    """
    if Path(relative).is_absolute() or os.path.normpath(relative).startswith(".."):
        message = f"'{relative}' lies outside the source folder"
        remedy = "keep the files of a recording together"
        raise UsageError("X11", message, where=where, remedy=remedy)
    return folder / relative


def unique(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names, those that occur twice numbered."""
    taken: dict[str, None] = {}
    for name in names:
        fresh, number = name, 2
        while fresh in taken:
            fresh, number = f"{name}-{number}", number + 1
        taken[fresh] = None
    return tuple(taken)
