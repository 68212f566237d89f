"""Find the files of a recipe by pattern: `run_{number}.csv`, `{role}/*.mat`, `{stem}_tau.csv`."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from pipelines.errors import EnvironmentFault, InputRejected, UsageError
from pipelines.importers.config import RECIPE
from pipelines.io.sandbox import Answer, guarded

_FIELD = re.compile(r"\{([A-Za-z_]\w*)(?::([^{}]+(?:\{\d+(?:,\d*)?\}[^{}]*)*))?\}")

Patterns = str | tuple[str, ...]


def each(patterns: Patterns) -> tuple[str, ...]:
    """Return one or several patterns as several."""
    return (patterns,) if isinstance(patterns, str) else patterns


def _compiled(pattern: str) -> re.Pattern[str]:
    """Return the regular expression of a pattern.

    {name} is any text without a slash, {name:regex} that; *, ** and ? are as in a shell.
    """
    if len(pattern) > RECIPE.longest_pattern:
        message = f"a pattern of {len(pattern)} characters"
        raise UsageError("C02", message, "match", f"write at most {RECIPE.longest_pattern}")
    shell = ((r"\*\*", ".*"), (r"\*", "[^/]*"), (r"\?", "[^/]"))
    expression, seen = "", set[str]()
    for k, part in enumerate(_FIELD.split(pattern)):
        if k % 3 == 0:
            text = re.escape(part)
            for sign, meaning in shell:
                text = text.replace(sign, meaning)
            expression += text
        elif k % 3 == 1:
            name = part
        else:
            group = f"(?P={name})" if name in seen else f"(?P<{name}>{part or '[^/]+?'})"
            expression += group
            seen.add(name)
    try:
        return re.compile(expression)
    except re.error as problem:
        message = f"pattern '{pattern}': {problem}"
        remedy = "write {name}, or {name:regular expression}"
        raise UsageError("C02", message, "match", remedy) from None


def matches(
    every: Sequence[Patterns], names: Sequence[str], where: Path
) -> list[dict[str, dict[str, str]]]:
    """Return the names that fit each of `every` patterns, with their groups, in limited time.

    A regular expression can take very long; one that could is matched in a child process.

    Raises:
        UsageError: C02, a pattern is invalid, or takes too long.
    """
    flat = [pattern for patterns in every for pattern in each(patterns)]
    compiled = [[_compiled(pattern) for pattern in each(patterns)] for patterns in every]

    def work() -> list[dict[str, dict[str, str]]]:
        fits = [{name: _groups(some, name) for name in names} for some in compiled]
        return [{k: groups for k, groups in fit.items() if groups is not None} for fit in fits]

    if all(":" not in p and len(re.findall(r"\{|\*+", p)) <= RECIPE.simple for p in flat):
        return work()
    try:
        found = guarded(
            lambda: Answer({"found": work()}, {}),
            where,
            seconds=RECIPE.seconds,
            memory=RECIPE.memory,
        )
    except InputRejected:
        message = f"a pattern takes more than {RECIPE.seconds:.0f} s: {', '.join(flat)}"
        remedy = "write fewer wildcards, and no repetition inside another, such as (a+)+"
        raise UsageError("C02", message, where, remedy) from None
    return list(found.about["found"])


def _groups(compiled: Sequence[re.Pattern[str]], relative: str) -> dict[str, str] | None:
    found = next((x for x in (one.fullmatch(relative) for one in compiled) if x), None)
    return {"stem": Path(relative).stem} | found.groupdict(default="") if found else None


def fill(template: str, groups: Mapping[str, str], where: object) -> str:
    """Return a template with its {groups} filled in.

    Raises:
        UsageError: C02, it names a group that the pattern does not have.
    """
    for name in re.findall(r"\{(\w+)\}", template):
        if name not in groups:
            message = f"'{template}' names {{{name}}}, but the pattern has {', '.join(groups)}"
            raise UsageError("C02", message, where, "name one of these, or add it to the pattern")
    return re.sub(r"\{(\w+)\}", lambda found: groups[found[1]], template)


def files_below(folder: Path) -> tuple[str, ...]:
    """Return the relative paths of all files below `folder`, without hidden ones, sorted.

    Links to folders are not followed.

    Raises:
        UsageError: C07, too many. EnvironmentFault: no permission.
    """
    if not os.access(folder, os.R_OK | os.X_OK):
        raise EnvironmentFault("F13", "permission denied", folder, "change its permissions")
    found: list[str] = []
    for parent, folders, names in os.walk(folder, followlinks=False):
        folders[:] = sorted(f for f in folders if not f.startswith("."))
        shown = [name for name in names if not name.startswith(".")]
        found += [Path(parent, name).relative_to(folder).as_posix() for name in shown]
        if len(found) > RECIPE.most_files:
            message = f"more than {RECIPE.most_files} files"
            raise UsageError("C07", message, folder, "give a folder that holds the recordings only")
    return tuple(sorted(found))


def inside(folder: Path, relative: str, where: object) -> Path:
    """Return the path of a file, whose name must not lead out of the folder; a link may.

    Raises:
        UsageError: X11, it does.
    """
    if Path(relative).is_absolute() or os.path.normpath(relative).startswith(".."):
        message = f"'{relative}' lies outside the source folder"
        raise UsageError("X11", message, where, "keep the files of a recording together")
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
