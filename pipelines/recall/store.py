"""Results by their keys: written stage by stage, verified when they are taken back.

Results of the last complete run lie in its own output, `.cache/STAGE` beside the files of the stage; those of a run that
was killed lie in a hidden folder beside that output, until a run comes to its end. An entry is `entry.json` with the key, the exit
code, the checks, and the hash of every file; `result.json` and `result.h5`; and the files that the stage wrote. An entry
whose files are not what it says is none.
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from pipelines.errors import EnvironmentFault, InputRejected
from pipelines.io.atomic import environment_faults, replace_folder, staging_folder
from pipelines.io.files import hash_file
from pipelines.io.places import slug
from pipelines.io.results import encode, json_text, read_series, write_series
from pipelines.recall.key import Key, changes, digest_of_json

__all__ = ["CACHE", "Kept", "Missed", "Store"]

CACHE = ".cache"
_ENTRY, _RESULT, _SERIES, _FILES, _LOCK = "entry.json", "result.json", "result.h5", "files", "lock"
_FORMAT = 1


@dataclass(frozen=True)
class Kept:
    """A stored result: `entry` is the folder of its entry, `files` the one of the files that the stage wrote."""

    entry: Path
    files: Path
    about: Mapping[str, Any]

    def result(self) -> tuple[dict[str, Any] | None, dict[str, Any]]:
        """The result's JSON object and its series; None of a stage that had no result."""
        if not (self.entry / _RESULT).is_file():
            return None, {}
        object_: dict[str, Any] = json.loads((self.entry / _RESULT).read_text(encoding="utf-8"))
        return object_, read_series(self.entry / _SERIES) if (self.entry / _SERIES).is_file() else {}

    def put(self, folder: Path, place: str) -> None:
        """Put the entry and the stage's files into `folder`, an output that is being made."""
        _copy(self.entry, folder / CACHE / place, (_ENTRY, _RESULT, _SERIES))
        _copy(self.files, folder / place, tuple(self.about["files"]))


@dataclass(frozen=True)
class Missed:
    """Nothing stored fits; `why` in words."""

    why: str


class Store:
    """What one run may take back, and where it keeps what it computes.

    Args:
        out: the run's output folder, whose last outcome is looked at.
        no_cache: use nothing that is stored.
    """

    def __init__(self, out: Path, no_cache: bool = False) -> None:
        self.out, self.no_cache = out, no_cache
        self.unfinished = out.absolute().parent / f".rrrid-unfinished-{slug(out.absolute().name)}"
        self._lock: int | None = None

    def recall(self, place: str, key: Key, *, dry: bool = False) -> Kept | Missed:
        """The stored result of `key` at `place`; or why there is none.

        Args:
            dry: only look, take no lock.
        """
        if self.no_cache:
            return Missed("everything is asked to be computed anew")
        if not dry and self.unfinished.is_dir():
            self._own()
        why = "for the first time here"
        for entry, files in ((self.unfinished / place, self.unfinished / place / _FILES),
                             (self.out / CACHE / place, self.out / place)):
            about = _about(entry)
            if about is None:
                continue
            if about["key"] != key.digest:
                why = changes(about["parts"], key) or "its key is another"
            elif damaged := _damage(entry, files, about):
                why = f"what is stored is damaged: {damaged}"
            else:
                return Kept(entry, files, about)
        return Missed(why)

    def stored(self, place: str) -> Kept:
        """What the last complete run has stored at `place`, whatever its key.

        Raises:
            InputRejected: F05, it is missing or not what it was.
        """
        entry, files = self.out / CACHE / place, self.out / place
        about = _about(entry)
        if about is None or (damaged := _damage(entry, files, about)):
            told = "missing, or not as it was written" if about is None else f"not as it was written: {damaged}"
            raise InputRejected("F05", f"the stored result of {place} is {told}", where=self.out, remedy="run the command again")
        return Kept(entry, files, about)

    def keep(self, place: str, key: Key, about: Mapping[str, Any], result: tuple[Mapping[str, Any], Mapping[str, Any]] | None,
             write: Callable[[Path], None]) -> Kept:
        """Store what a stage has computed; it is there whole or not at all.

        Args:
            about: further plain JSON for the entry.
            result: the JSON object and its series, as `encode` makes them; None where the stage had none.
            write: writes the stage's own files into the folder it is given.
        """
        self._own()
        target = self.unfinished / place
        draft = staging_folder(target)
        try:
            (draft / _FILES).mkdir()
            write(draft / _FILES)
            if result is not None:
                (draft / _RESULT).write_text(json_text(result[0]), encoding="utf-8")
                if result[1]:
                    write_series(draft / _SERIES, result[1])
            files = {path.relative_to(draft / _FILES).as_posix(): hash_file(path)
                     for path in sorted((draft / _FILES).rglob("*")) if path.is_file()}
            stored = {name: hash_file(draft / name) for name in (_RESULT, _SERIES) if (draft / name).is_file()}
            told, _ = encode({**about, "format": _FORMAT, "key": key.digest, "parts": key.parts, "files": files, "stored": stored})
            (draft / _ENTRY).write_text(json_text(told | {"digest": digest_of_json(told)}), encoding="utf-8")
            replace_folder(draft, target)
        except OSError as problem:
            with environment_faults(target):
                raise problem
        finally:
            shutil.rmtree(draft, ignore_errors=True)
        return Kept(target, target / _FILES, told)

    def release(self, finished: bool = True) -> None:
        """The run has come to its end: where it was not interrupted, what lies beside its output is needed no more."""
        if self._lock is not None:
            if finished:
                shutil.rmtree(self.unfinished, ignore_errors=True)
            os.close(self._lock)
            self._lock = None

    def _own(self) -> None:
        """Take the hidden folder for this run alone; a lock ends with its process.

        Raises:
            EnvironmentFault: P08, another run has it.
        """
        while self._lock is None:
            with environment_faults(self.unfinished):
                self.unfinished.mkdir(parents=True, exist_ok=True)
                handle = os.open(self.unfinished / _LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                os.close(handle)
                raise EnvironmentFault("P08", "another run is writing there", where=self.out,
                                       remedy="wait for it, or choose another --out") from None
            except OSError:
                pass  # a file system without locks: two runs at once are then the user's to avoid
            if _same_file(handle, self.unfinished / _LOCK):
                self._lock = handle
            else:  # the run that had it has just removed it
                os.close(handle)


def _same_file(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except OSError:
        return False


def _about(entry: Path) -> dict[str, Any] | None:
    """What an entry says of itself; None where there is none, or one that another version wrote, or a damaged one."""
    try:
        about = json.loads((entry / _ENTRY).read_text(encoding="utf-8"))
        digest = about.pop("digest")
        return about if about["format"] == _FORMAT and digest == digest_of_json(about) else None
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _damage(entry: Path, files: Path, about: Mapping[str, Any]) -> str:
    """The first file that is missing or not what the entry says; "" where all are."""
    for folder, listed in ((entry, about["stored"]), (files, about["files"])):
        for name, expected in listed.items():
            path = folder / name
            if ".." in PurePosixPath(name).parts or path.is_symlink() or not path.is_file() or hash_file(path) != expected:
                return f"{folder.name}/{name}"
    return ""


def _copy(source: Path, target: Path, names: tuple[str, ...]) -> None:
    """Files of an entry into an output: by a second name where the file system has that, else byte by byte."""
    for name in names:
        if not (source / name).is_file():
            continue
        with environment_faults(target / name):
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            try:
                os.link(source / name, target / name)
            except OSError:
                shutil.copyfile(source / name, target / name)
