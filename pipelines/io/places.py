"""Where results may lie, and how a place is named in them: never over another's files, never with this machine's paths."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from pipelines.errors import EnvironmentFault, UsageError, clean
from pipelines.io.files import PROVENANCE, hash_file

__all__ = ["free_name", "given_names", "keep_apart", "provenance_of", "refuse_foreign", "refuse_own_place",
           "refuse_unwritable", "renamed", "short_names", "slug", "tilde", "told_apart", "written_by"]

_ELSEWHERE = "choose another folder with --out"


def keep_apart(out: Path, sources: Iterable[Path], folders: Iterable[Path]) -> None:
    """C05: no file that was read lies inside `out`, which is replaced as a whole, and `out` inside no folder of inputs.

    Raises:
        UsageError: one does.
    """
    target = out.resolve()
    for source in sources:
        # A link in `out` would be deleted as well, wherever it leads.
        if source.resolve().is_relative_to(target) or Path(os.path.abspath(source)).is_relative_to(os.path.abspath(out)):
            raise UsageError("C05", f"holds the input {source}, and would be replaced with it", where=out, remedy=_ELSEWHERE)
    for folder in folders:
        if os.path.isdir(folder) and target.is_relative_to(folder.resolve()):
            raise UsageError("C05", f"lies inside the input {folder}", where=out, remedy=_ELSEWHERE)


def refuse_own_place(out: Path, remedy: str = f"{_ELSEWHERE}, or call from outside of it (cd)") -> None:
    """C05: the folder one is in is not replaced, or moved: a shell that stays in the old one finds nothing there any more.

    Raises:
        UsageError: `out` is that folder, or around it.
    """
    try:
        here = Path.cwd()
    except FileNotFoundError:  # somebody has done so already: who is nowhere is in no output
        return
    if here.is_relative_to(out.resolve()):
        raise UsageError("C05", "is the folder you are in, or around it, and would be replaced under you", where=out, remedy=remedy)


def refuse_foreign(out: Path, force: bool = False, remade: Callable[[str], bool] = lambda name: False) -> tuple[str, ...]:
    """C05: an output folder may be new, empty, or rrrid's own earlier output as it was left.

    Args:
        force: rrrid's output may be replaced even where files were added to it or changed since.
        remade: own files, by their names in `out`, that nobody edits: changed ones are made again (P10).

    Returns:
        The names of such files.

    Raises:
        UsageError: it is anything else.
    """
    if out.is_symlink() or (out.exists() and not out.is_dir()):
        raise UsageError("C05", "is not a folder", where=out, remedy=_ELSEWHERE)
    refuse_own_place(out)
    if not out.exists() or not any(out.iterdir()):
        return ()
    try:
        ours: dict[str, object] = dict(provenance_of(out)["outputs"])
    except (KeyError, TypeError, ValueError):
        ours = {}
    if ours and force:
        return ()
    known = {*ours, PROVENANCE} if ours else set()
    # three are enough: the folder may hold the whole machine
    foreign = list(islice((name for name in _members(out) if name not in known), 3))
    if foreign:
        raise UsageError("C05", f"holds files that rrrid did not write there: {', '.join(foreign)}", where=out,
                         remedy=f"{_ELSEWHERE}, or move them")
    edited = sorted(name for name in _members(out) if name in ours and hash_file(out / name) != ours[name])
    if kept := [name for name in edited if not remade(name)]:
        raise UsageError("C05", f"holds files that were changed since rrrid wrote them: {', '.join(kept[:3])}", where=out,
                         remedy=f"{_ELSEWHERE}, or replace them with --force")
    return tuple(edited)


def free_name(folder: Path) -> Path:
    """`folder`, or the first of folder-2, folder-3, … that nothing has yet."""
    number, free = 1, folder
    while free.exists() or free.is_symlink():
        number += 1
        free = folder.with_name(f"{folder.name}-{number}")
    return free


def refuse_unwritable(out: Path) -> None:
    """F13, C05: `out` can be made where it shall be.

    Raises:
        EnvironmentFault: the nearest folder above it that there is may not be written.
        UsageError: that is none.
    """
    above = next(path for path in out.absolute().parents if path.exists())
    if not above.is_dir():
        raise UsageError("C05", f"lies below {above}, which is not a folder", where=out, remedy=_ELSEWHERE)
    if not os.access(above, os.W_OK | os.X_OK):
        raise EnvironmentFault("F13", "permission denied", where=above, remedy="choose another --out, or change its permissions")


def _members(folder: Path, above: str = "") -> Iterator[str]:
    """The names of everything below `folder` that is no folder, or one that cannot be read; in the order of their names."""
    for name in sorted(os.listdir(folder)):
        path = folder / name
        if path.is_symlink() or not path.is_dir() or not os.access(path, os.R_OK | os.X_OK):
            yield f"{above}{name}"
        else:
            yield from _members(path, f"{above}{name}/")


def written_by(folder: Path) -> str:
    """The command of rrrid whose output `folder` is; "" where it is none."""
    return str(provenance_of(folder).get("command", ""))


def provenance_of(folder: Path) -> dict[str, Any]:
    """The provenance.json of rrrid's own output in `folder`; empty where there is none."""
    try:
        about = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return about if isinstance(about, dict) and about.get("tool") == "rrrid" else {}


def slug(text: str) -> str:
    """`text` as a file name: [A-Za-z0-9._-], at most 80 characters, with a hash where something had to go (X11)."""
    plain = re.sub(r"[^A-Za-z0-9._-]+", "-", text).strip("-.")[:69]
    reserved = plain.split(".")[0].upper() in {"CON", "PRN", "AUX", "NUL",
                                               *(f"{p}{i}" for p in ("COM", "LPT") for i in range(1, 10))}
    if plain == text and plain and not reserved:
        return plain
    return f"{'x-' if reserved else ''}{plain or 'x'}-{hashlib.sha256(text.encode('utf-8', 'surrogatepass')).hexdigest()[:8]}"


def short_names(paths: Iterable[Path]) -> dict[str, str]:
    """Every folder of inputs -> what stands for it in a result: nothing for a single one, its name where there are more.

    A result then does not depend on where its inputs lie: equal inputs give equal bytes.
    """
    roots = list(dict.fromkeys(path if os.path.isdir(path) else path.parent for path in paths))
    names: dict[str, str] = {}
    for root in roots:
        name, number = root.name if len(roots) > 1 else "", 1
        while name and (name if number == 1 else f"{name}-{number}") in names.values():
            number += 1
        names[str(root)] = name if number == 1 else f"{name}-{number}"
    return names


def told_apart(paths: Iterable[str]) -> dict[str, str]:
    """Every path -> its last part, or as many from its end as no other ends in: "monday/model.json" beside "friday/model.json"."""
    parts = {path: Path(path).parts for path in paths}
    names, depth = dict[str, str](), 0
    while left := [path for path in parts if path not in names]:
        depth += 1
        ends = Counter(parts[path][-depth:] for path in left)
        names |= {path: str(Path(*end)) for path in left
                  if ends[end := parts[path][-depth:]] == 1 or depth >= len(parts[path])}
    return names


def given_names(paths: Iterable[Path]) -> dict[str, str]:
    """Every absolute input -> the way it was written on the command line, for errors on the terminal."""
    return {str(path.absolute()): str(path) for path in paths if not path.is_absolute()}


def renamed(value: Any, names: Mapping[str, str]) -> Any:
    """`value` with every path that begins with one of `names` written by what stands for it."""
    # Messages hold the path as `clean` leaves it, on one line.
    rules = [(text, names[root]) for root in sorted((root for root in names if root != os.sep), key=len, reverse=True)
             for text in dict.fromkeys((root, clean(root)))]

    def rename(text: str) -> str:
        for place, name in rules:
            if place in text:  # else no rule is made of it: an item of a batch has a folder of its own
                below, itself = (f"{name}/", name) if name else ("", ".")
                text = re.sub(rf"(?<![^\s,:;(\['\"]){re.escape(place)}(?:(/)|(?![^\s,:;)\]'\"]))",
                              partial(_replacement, below, itself), text)
        return text

    return _texts(value, rename) if rules else value


def _replacement(below: str, itself: str, found: re.Match[str]) -> str:
    return below if found[1] else itself


def tilde(value: Any) -> Any:
    """`value` with the home folder written as ~ in every text, so that no report names its user (X14)."""
    home = os.path.expanduser("~")
    return _texts(value, lambda text: text.replace(home, "~")) if len(home) > 1 else value


def _texts(value: Any, change: Callable[[str], str]) -> Any:
    """`value` with `change` done to every text in it; the very same object where nothing changed."""
    if isinstance(value, str | Path):
        text = change(str(value))
        return value if text == str(value) else type(value)(text)
    if isinstance(value, Mapping):
        return {_texts(key, change): _texts(item, change) for key, item in value.items()}
    if isinstance(value, list | tuple):
        items = [_texts(item, change) for item in value]
        same = all(new is old for new, old in zip(items, value, strict=True))
        return value if same else type(value)(items)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        changes = {field.name: new for field in dataclasses.fields(value) if field.init and field.metadata.get("stored", True)
                   and (new := _texts(old := getattr(value, field.name), change)) is not old}
        return dataclasses.replace(value, **changes) if changes else value
    return value
