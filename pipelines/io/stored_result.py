"""Read what a command has left: result.json with its series, or a model file; held against provenance.json where that is there."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from pipelines.errors import InputRejected, UsageError
from pipelines.io.files import PROVENANCE, hash_file, regular_file
from pipelines.io.results import refuse_earlier
from pipelines.io.text import read_small_text

__all__ = ["StoredResult", "listed_outputs", "read_result"]

_LARGEST: Final = 256 << 20  # [B] of a result.json; a run's has less than one
_MODEL: Final = "rrrid-model"


@dataclass(frozen=True)
class StoredResult:
    """One result: the file it came from, the command that wrote it ("model" of a model file), and its JSON object."""

    path: Path
    command: str
    object: dict[str, Any]
    within: str = ""  # the folder of a stage, below that of the run whose result.json says what the stage found

    @property
    def folder(self) -> Path:
        """Where the command has left it."""
        return self.path.parent / self.within

    @property
    def series(self) -> Path:
        """Where its long series lie, if it has any."""
        return self.path.parent / "result.h5"


def read_result(path: Path) -> StoredResult:
    """The result in `path`: a folder that a command has left, its result.json, or a model.json.

    Raises:
        UsageError: C04, there is none.
        InputRejected: F05, it is not what provenance.json says; F02, it is damaged; S19, it is no result of rrrid; F17, of an
            earlier one.
    """
    file = path / "result.json" if path.is_dir() else path
    if path.is_dir() and not file.is_file():
        raise UsageError("C04", "no result.json there", where=path, remedy="name the folder that a command has left with --out")
    regular_file(file, what="a result.json, or the folder it is in")
    expected = listed_outputs(file.parent).get(file.name)
    if expected is not None and expected != hash_file(file):
        raise InputRejected("F05", "sha256 differs from provenance.json: it was changed since it was written", where=file,
                            remedy="run the command again")
    try:
        object_ = json.loads(read_small_text(file, _LARGEST, what="a result.json"), parse_int=_whole_number)
    except (ValueError, RecursionError):
        raise InputRejected("F02", "not complete JSON, or with numbers that no float holds", where=file,
                            remedy="run the command again") from None
    if isinstance(object_, dict) and object_.get("format") == _MODEL:
        return StoredResult(file, "model", object_)
    if not isinstance(object_, dict) or not isinstance(object_.get("command"), str):
        raise InputRejected("S19", "not a result of rrrid", where=file, remedy="name a result.json, or the folder it is in")
    refuse_earlier(object_, file)
    return StoredResult(file, object_["command"], object_)


def _whole_number(digits: str) -> int:
    """Return the number; a longer one is no figure, and overflows where a float is wanted."""
    if len(digits) > 300:
        raise ValueError
    return int(digits)


def listed_outputs(folder: Path) -> dict[str, str]:
    """File -> SHA-256, as the provenance.json in `folder` lists them; empty where there is none."""
    try:
        outputs = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))["outputs"]
        return {str(name): str(value) for name, value in outputs.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return {}
