"""Find the files of a recipe by pattern: `run_{number}.csv`, `{role}/*.mat`, `{stem}_tau.csv`."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
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
    plain, *fields = _FIELD.split(pattern)
    expression, seen = re.escape(plain), set[str]()
    for name, given, text in zip(fields[::3], fields[1::3], fields[2::3], strict=True):
        group = f"(?P={name})" if name in seen else f"(?P<{name}>{given or '[^/]+?'})"
        expression += group.replace("\\", "\0") + re.escape(text)
        seen.add(name)
    for sign, meaning in ((r"\*\*", ".*"), (r"\*", "[^/]*"), (r"\?", "[^/]")):
        expression = expression.replace(sign, meaning)
    try:
        return re.compile(expression.replace("\0", "\\"))
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
    compiled = [[_compiled(pattern) for pattern in each(patterns)] for patterns in every]

    def work() -> list[dict[str, dict[str, str]]]:
        found = []
        for some in compiled:
            hits = {
                name: next(filter(None, (x.fullmatch(name) for x in some)), None) for name in names
            }
            found.append({name: {"stem": Path(name).stem} | hit.groupdict(default="")
                          for name, hit in hits.items() if hit})  # fmt: skip
        return found

    flat = [pattern for patterns in every for pattern in each(patterns)]
    if all(":" not in p and len(re.findall(r"\{|\*+", p)) <= RECIPE.simple for p in flat):
        return work()
    try:
        apart = guarded(
            lambda: Answer({"found": work()}, {}),
            where,
            seconds=RECIPE.seconds,
            memory=RECIPE.memory,
        )
        return list(apart.about["found"])
    except InputRejected:
        message = f"a pattern takes more than {RECIPE.seconds:.0f} s: {', '.join(flat)}"
        remedy = "write fewer wildcards, and no repetition inside another, such as (a+)+"
        raise UsageError("C02", message, where, remedy) from None


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
