"""Find the files of a recipe by pattern: `run_{number}.csv`, `{role}/*.mat`, `{stem}_tau.csv`."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path

from pipelines.errors import EnvironmentFault, UsageError
from pipelines.log.guard_answer import Answer
from pipelines.log.guard_child import Child, Lost

__all__ = ["files_below", "fill", "lying_there", "match", "matches"]

_MOST_FILES = 100_000
_NAMED = 5  # files that a message names
_LONGEST = 500  # characters of a pattern
_SIMPLE = 2  # wildcards: a name of 255 characters is tried 255² times at most
_SECONDS = 3.0  # for all patterns of a recipe on all names
_MEMORY = 256 << 20  # [B]
_FIELD = re.compile(r"\{([A-Za-z_]\w*)(?::([^{}]+(?:\{\d+(?:,\d*)?\}[^{}]*)*))?\}")


@lru_cache(maxsize=256)
def _compiled(pattern: str) -> re.Pattern[str]:
    """The regular expression of a pattern: {name} any text without a slash, {name:regex} that, *, ** and ? as in a shell."""
    if len(pattern) > _LONGEST:
        message = f"a pattern of {len(pattern)} characters"
        raise UsageError("C02", message, where="match", remedy=f"write at most {_LONGEST}")
    parts, at = [], 0
    seen: set[str] = set()
    for found in _FIELD.finditer(pattern):
        parts.append(_shell(pattern[at : found.start()]))
        name, inner = found.group(1), found.group(2) or r"[^/]+?"
        parts.append(f"(?P={name})" if name in seen else f"(?P<{name}>{inner})")
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


def matches(
    every: Sequence[str | tuple[str, ...]], names: Sequence[str], where: Path
) -> list[dict[str, dict[str, str]]]:
    """Of each of `every` patterns: the names that fit, each with its groups; in a time that no pattern exceeds.

    A regular expression can take longer than the world has lasted; what could is matched in a child process.

    Raises:
        UsageError: C02, a pattern is none, or takes too long.
    """
    flat = [
        pattern
        for patterns in every
        for pattern in ((patterns,) if isinstance(patterns, str) else patterns)
    ]
    for pattern in flat:
        _compiled(pattern)

    def work() -> list[dict[str, dict[str, str]]]:
        return [
            {name: groups for name in names if (groups := match(patterns, name)) is not None}
            for patterns in every
        ]

    if all(
        ":" not in pattern and len(re.findall(r"\{|\*+", pattern)) <= _SIMPLE for pattern in flat
    ):
        return work()
    try:
        answer = Child(lambda _: Answer({"found": work()}, {})).ask(
            None, where, _SECONDS, _MEMORY, _MEMORY, last=True
        )
    except Lost:
        message = f"a pattern takes more than {_SECONDS:.0f} s: {', '.join(flat)}"
        remedy = "write fewer wildcards, and no repetition inside another, such as (a+)+"
        raise UsageError("C02", message, where=where, remedy=remedy) from None
    found: list[dict[str, dict[str, str]]] = answer.about["found"]
    return found


def match(patterns: str | tuple[str, ...], relative: str) -> dict[str, str] | None:
    """The groups of the first pattern that fits the path, {stem} among them; None where none fits."""
    for pattern in (patterns,) if isinstance(patterns, str) else patterns:
        if found := _compiled(pattern).fullmatch(relative):
            return {"stem": Path(relative).stem} | found.groupdict(default="")
    return None


def lying_there(names: Sequence[str], endings: Collection[str]) -> str:
    """What a message says of the files in a folder, those with the `endings` of recordings first."""
    if not names:
        return "no file lies there"
    first = sorted(names, key=lambda name: Path(name).suffix.lower() not in endings)[:_NAMED]
    more = f" and {len(names) - len(first)} more" if len(names) > len(first) else ""
    return f"there {'lies' if len(names) == 1 else 'lie'} {', '.join(first)}{more}"


def fill(template: str, groups: Mapping[str, str], where: object) -> str:
    """A template with its {groups} filled in.

    Raises:
        UsageError: C02, it names a group that the pattern does not have.
    """

    def value(found: re.Match[str]) -> str:
        if found.group(1) not in groups:
            message = (
                f"'{template}' names {{{found.group(1)}}}, but the pattern has {', '.join(groups)}"
            )
            remedy = "name one of these, or add it to the pattern"
            raise UsageError("C02", message, where=where, remedy=remedy)
        return groups[found.group(1)]

    return re.sub(r"\{(\w+)\}", value, template)


def files_below(folder: Path) -> tuple[str, ...]:
    """Paths of all regular files below `folder`, relative, sorted; links to folders are not followed, hidden ones left out.

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
        found += [
            Path(parent, name).relative_to(folder).as_posix()
            for name in names
            if not name.startswith(".")
        ]
        if len(found) > _MOST_FILES:
            remedy = "give a folder that holds the recordings only"
            raise UsageError("C07", f"more than {_MOST_FILES} files", where=folder, remedy=remedy)
    return tuple(sorted(found))


def inside(folder: Path, relative: str, where: object) -> Path:
    """The path of a file of the recording, which its name must not lead out of the folder (X11); a link may, it is the user's."""
    if Path(relative).is_absolute() or os.path.normpath(relative).startswith(".."):
        message = f"'{relative}' lies outside the source folder"
        remedy = "keep the files of a recording together"
        raise UsageError("X11", message, where=where, remedy=remedy)
    return folder / relative


def unique(names: Iterable[str]) -> tuple[str, ...]:
    """The names, those that occur twice numbered."""
    taken: set[str] = set()
    out = []
    for name in names:
        fresh, number = name, 2
        while fresh in taken:
            fresh, number = f"{name}-{number}", number + 1
        taken.add(fresh)
        out.append(fresh)
    return tuple(out)
