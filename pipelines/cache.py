"""Keep what a run has computed: a stage runs again only where something it depends on changed.

    entry = store.recall(stage, key)     a stored result, or why it must be computed
    entry = store.keep(stage, key, ...)  a new one, there whole or not at all

A key is everything that a result depends on, as groups of named values. Only contents are compared,
never times. Results of the last run lie in OUT/.cache/STAGE beside the files of OUT/STAGE; new ones
lie alike in a hidden folder beside OUT, until they are put into the output.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
import platform
import re
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path, PurePath
from typing import Any

import pipelines
from pipelines.errors import EnvironmentFault, clean
from pipelines.io.hdf5 import read_series, write_series
from pipelines.io.output import (
    environment_faults,
    hash_file,
    listed_outputs,
    remove_folder,
    slug,
    staging_folder,
)
from pipelines.io.results import encode, json_text
from pipelines.report.style import STYLE_FILE

Key = Mapping[str, Mapping[str, Any]]  # group -> name -> value
Sources = Mapping[str, tuple[str, set[str]]]  # module -> hash of its source, modules it imports

CACHE = ".cache"
DRAWING = f"{CACHE}/drawing.json"  # what the figures of an output were drawn by
_IMPORT = re.compile(
    r"^[ \t]*(?:from (pipelines[\w.]*) import (\([^)]*\)|[^\n]*)|import (pipelines[\w.]*))", re.M
)
# What is said of a value that is another; of a file of any kind: that its content is.
_ALTERED = {
    "setting": "{name} was {old}, is {new}",
    "option": "{name} was {old}, is {new}",
    "code": "code of {name}",
    "library": "{name} {old} is now {new}",
    "stage": "{name} before it changed",
    "arrangement": "{name}",
}


def digest_of_json(value: Any) -> str:
    """Return the SHA-256 of `value` as JSON, in any order of its keys."""
    text = json.dumps(value, sort_keys=True, ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


def read_sources() -> Sources:
    """Return every module of this package, by its name; tables are part of their package."""
    root, found = Path(pipelines.__file__).parent, {}
    for path in root.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        parts = path.relative_to(root.parent).with_suffix("").parts
        name = ".".join(parts).removesuffix(".__init__")
        imports = {name.rpartition(".")[0]}
        for package, words, whole in _IMPORT.findall(text):
            imports |= {package, whole, *(f"{package}.{w}" for w in re.findall(r"\w+", words))}
        if path.name == "__init__.py":
            if "import_module(" in text:  # it finds its members by name
                imports |= {f"{name}.{other.stem}" for other in path.parent.glob("*.py")}
            data = (other.read_text(encoding="utf-8") for other in path.parent.glob("*.toml"))
            text = "".join((text, *sorted(data)))  # what its members read
        found[name] = hashlib.sha256(text.encode()).hexdigest()[:12], imports
    return found


def code_of(module: str, sources: Sources, without: str = "nothing") -> dict[str, str]:
    """Return every module that `module` consists of, however deep -> the hash of its source.

    Args:
        without: a package that has no part in it: "pipelines.report" draws, and computes nothing.
    """
    found: dict[str, str] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name in sources and name not in found and not f"{name}.".startswith(f"{without}."):
            found[name], imports = sources[name]
            waiting += imports
    return found


def libraries(*names: str) -> dict[str, str]:
    """Return the versions of Python and of libraries, as installed."""
    found = {"python": platform.python_version()}
    for name in names:
        found[name] = "missing"
        with contextlib.suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def changes(old: Key, new: Key, most: int = 3) -> str:
    """Say what differs, in the first group where something does."""
    for group, now in new.items():
        before = old.get(group, {})
        words = _ALTERED.get(group, "{name} has other content")
        told = []
        for name in dict.fromkeys((*now, *sorted(before))):
            if name not in before:
                told.append(f"new {group} {name}")
            elif name not in now:
                told.append(f"{group} gone: {name}")
            elif before[name] != now[name]:
                was, is_ = _in_words(before[name]), _in_words(now[name])
                told.append(words.format(name=name, old=was, new=is_))
        if told:
            return "; ".join(told[:most]) + (f" and {len(told) - most} more" * (len(told) > most))
    return "its key is another"


def _in_words(value: Any) -> str:
    return "unset" if value is None else clean(json.dumps(value, ensure_ascii=False), 40)


@contextlib.contextmanager
def locked(folder: Path, out: Path) -> Iterator[None]:
    """Hold `folder`, which is made, for this process alone; the lock ends with the process.

    Raises:
        EnvironmentFault: P08, another process holds it; `out` is where it writes.
    """
    path, remedy = folder / "lock", "wait until it has ended, or choose another --out"
    with environment_faults(folder):
        folder.mkdir(parents=True, exist_ok=True)
        file = path.open("a+", encoding="utf-8")
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.seek(0)
            words = f"locked by {clean(file.read(100)) or 'another process'}"
            raise EnvironmentFault("P08", words, where=out, remedy=remedy) from None
        file.truncate(0)
        file.write(f"process {os.getpid()} on {platform.node()}")
        file.flush()
        yield


@dataclass(frozen=True)
class Entry:
    """A stored result: below `root`, in .cache/STAGE, and the stage's own files in STAGE."""

    root: Path
    stage: str
    about: Mapping[str, Any]  # key, files -> SHA-256, and what the caller gave

    @property
    def files(self) -> Path:
        """The folder of the stage's own files."""
        return self.root / self.stage

    def result(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return the result's JSON object and its series."""
        folder = self.root / CACHE / self.stage
        object_ = json.loads((folder / "result.json").read_text(encoding="utf-8"))
        series = folder / "result.h5"
        return object_, read_series(series) if series.is_file() else {}

    def put(self, folder: Path) -> None:
        """Put it into an output that is being made, by second names of its files or copies."""
        for name in (*self.about["files"], f"{CACHE}/{self.stage}/entry.json"):
            with environment_faults(folder / name):
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                try:
                    os.link(self.root / name, folder / name)
                except OSError:  # a file system without such names
                    shutil.copyfile(self.root / name, folder / name)


class Store:
    """The stored results of a run with the output `out`."""

    def __init__(self, out: Path, no_cache: bool = False) -> None:
        self.out, self.no_cache = out, no_cache
        self.new: Path | None = None  # the folder of what this run has computed
        self._lock = contextlib.ExitStack()

    def recall(self, stage: str, key: Key | None = None) -> Entry | str:
        """Return the stored result of `key`, or of any key; or why it must be computed."""
        if self.no_cache:
            return "everything is asked to be computed anew"
        about = _about(self.out, stage)
        if about is None:
            return "for the first time here"
        if key is not None and about["digest"] != digest_of_json(key):
            return changes(about["key"], key)
        if damaged := [n for n, sha in about["files"].items() if not _is_whole(self.out, n, sha)]:
            return f"what is stored is damaged: {damaged[0]}"
        return Entry(self.out, stage, about)

    def keep(
        self,
        stage: str,
        key: Key,
        about: Mapping[str, Any],
        result: tuple[Mapping[str, Any], Mapping[str, Any]] | None,
        write: Callable[[Path], None],
    ) -> Entry:
        """Store a result; entry.json, written last, makes it whole.

        Args:
            about: further plain JSON for the entry.
            result: the JSON object and its series; None where the stage had none.
            write: writes the stage's own files into the folder it is given.
        """
        if self.new is None:
            self.new = staging_folder(self.out.absolute())
        root, folder = self.new, self.new / CACHE / stage
        with environment_faults(root):
            for place in (folder, root / stage):
                place.mkdir(parents=True)
            write(root / stage)
            if result is not None:
                (folder / "result.json").write_text(json_text(result[0]), encoding="utf-8")
            if result is not None and result[1]:
                write_series(folder / "result.h5", result[1])
            paths = [*sorted(folder.rglob("*")), *sorted((root / stage).rglob("*"))]
            names = [path.relative_to(root).as_posix() for path in paths if path.is_file()]
            files = {name: hash_file(root / name) for name in names}
            told, _ = encode({**about, "key": key, "digest": digest_of_json(key), "files": files})
            text = json_text({"about": told, "sha256": digest_of_json(told)})
            (folder / "entry.json").write_text(text, encoding="utf-8")
        return Entry(root, stage, told)

    def hold(self) -> None:
        """Lock `out` for this run alone, by a hidden folder beside it (P08)."""
        out = self.out.absolute()
        folder = out.parent / f".rrrid-lock-{slug(out.name)}"
        self._lock.enter_context(locked(folder, self.out))
        self._lock.callback(remove_folder, folder)

    def release(self) -> None:
        """Remove what was not put into an output, and let go of the lock."""
        if self.new is not None:
            remove_folder(self.new)
        self._lock.close()


def _about(root: Path, stage: str) -> dict[str, Any] | None:
    """Return the content of entry.json; None if it is missing or damaged."""
    try:
        entry = json.loads((root / CACHE / stage / "entry.json").read_text(encoding="utf-8"))
        about: dict[str, Any] = entry["about"]
        return about if entry["sha256"] == digest_of_json(about) else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _is_whole(root: Path, name: str, sha256: str) -> bool:
    path = root / name
    inside = ".." not in PurePath(name).parts and not path.is_symlink()
    return inside and path.is_file() and hash_file(path) == sha256


def drawing_digest(modules: Iterable[str], sources: Sources) -> str:
    """Return the digest of all that the look of figures depends on, their data apart."""
    code = {module: code_of(module, sources) for module in modules}
    return digest_of_json([code, libraries("matplotlib", "numpy"), hash_file(STYLE_FILE)])


def finished_figures(out: Path, drawing: str) -> Callable[[str], tuple[str, bytes] | None]:
    """Return what gives the SVG and PNG of a figure in `out` that this code has drawn there."""
    outputs: Mapping[str, str] = {}
    with contextlib.suppress(OSError):
        if (out / DRAWING).read_text(encoding="utf-8") == json_text(drawing):
            outputs = listed_outputs(out)

    def finished(name: str) -> tuple[str, bytes] | None:
        names = [f"figures/{name}.{ending}" for ending in ("svg", "png")]
        for file in names:
            if not (out / file).is_file() or hash_file(out / file) != outputs.get(file):
                return None
        return (out / names[0]).read_text(encoding="utf-8"), (out / names[1]).read_bytes()

    return finished
