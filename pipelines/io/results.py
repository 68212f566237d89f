"""Store any stage's result as open files, and read it again: JSON for figures, HDF5 for series.

text, series = encode(result)
result = decode(Result, json.loads(text), series)

A result is a frozen dataclass of plain values, tuples, further dataclasses and arrays. Short arrays
are part of the JSON; longer ones become series, and the JSON says which. Infinite and undefined
numbers become null. Fields marked `metadata=NOT_STORED` are left out and come back as None. The
fields of one marked `metadata=FLAT` are among the others; None adds no fields.
"""

from __future__ import annotations

import dataclasses
import inspect
import json
import math
import re
import types
import typing
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pipelines.errors import InputRejected, UsageError
from pipelines.io.config import FORMAT as LIMITS
from pipelines.io.hdf5 import read_series
from pipelines.io.output import hash_file, listed_outputs
from pipelines.io.sandbox import Answer, guarded, read_small_text, regular_file
from pipelines.io.schema import DRAFT, Array

T = TypeVar("T")

NOT_STORED: Mapping[str, object] = {"stored": False}
FLAT: Mapping[str, object] = {"flat": True}
SCHEMA_VERSION = 2  # numerics: of result.json
_SERIES = "$series"
_AGAIN = "run the command again"
# of a dataclass: comments above a field, its name, and its line with those that go on with it
_FIELD = re.compile(
    r"((?:^    # .*\n)*)^    (\w+) ?: (.*\n(?:^(?:     |    \)).*\n)*)", re.MULTILINE
)


def _stored_fields(kind: Any) -> list[Any]:
    return [one for one in dataclasses.fields(kind) if one.metadata.get("stored", True)]


def encode(result: Any) -> tuple[Any, dict[str, Array]]:
    """Return `result` as a JSON object, and the series that are too long for it."""
    series: dict[str, Array] = {}
    return _encode(result, "", series), series


def _encode(value: Any, path: str, series: dict[str, Array]) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        found: dict[str, Any] = {}
        for field in _stored_fields(value):
            own, flat = getattr(value, field.name), field.metadata.get("flat")
            if not flat:
                found[field.name] = _encode(own, f"{path}/{field.name}", series)
            elif own is not None:
                found |= _encode(own, path, series)
        return found
    if isinstance(value, Mapping):
        return {str(key): _encode(item, f"{path}/{key}", series) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        if value.size > LIMITS.inline:
            series[path] = np.asarray(value, dtype=np.float64)
            return {_SERIES: path}
        return _encode(value.tolist(), path, series)
    if isinstance(value, tuple | list):
        return [_encode(item, f"{path}/{i}", series) for i, item in enumerate(value)]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


def json_text(value: Any) -> str:
    """Return JSON as every file of rrrid has it: sorted keys, two blanks.

    Bytes of a path that are no text (C07) become question marks.
    """
    text = json.dumps(value, sort_keys=True, indent=2, ensure_ascii=False, allow_nan=False)
    return f"{text}\n".encode("utf-8", "replace").decode("utf-8")


def headed(command: str, found: Mapping[str, Any]) -> dict[str, Any]:
    """Return the object of a result.json: command and schema version before the result."""
    return {"command": command, "schema_version": SCHEMA_VERSION, **found}


def decode(kind: type[T], value: Any, series: Mapping[str, Array]) -> T:
    """Return the result of type `kind` that `encode` made `value` and `series` of."""
    return typing.cast(T, _decode(kind, value, series))


def _decode(kind: Any, value: Any, series: Mapping[str, Array]) -> Any:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if isinstance(value, dict) and _SERIES in value:
        return series[value[_SERIES]]
    if origin in (typing.Union, types.UnionType):
        real = [one for one in arguments if one is not type(None)]
        return value if value is None or len(real) > 1 else _decode(real[0], value, series)
    if origin is np.ndarray:
        numbers = math.nan if value is None else [math.nan if x is None else x for x in value]
        return np.array(numbers, dtype=np.float64)
    if dataclasses.is_dataclass(kind) and isinstance(kind, type):
        hints, values = typing.get_type_hints(kind), dict[str, Any]()
        for field in dataclasses.fields(kind):
            if not field.metadata.get("stored", True):
                values[field.name] = None
            elif field.name in value:
                values[field.name] = _decode(hints[field.name], value[field.name], series)
        return kind(**values)
    if origin is tuple:
        kinds = arguments if arguments[1:] != (Ellipsis,) else arguments[:1] * len(value)
        items = zip(kinds, value, strict=True)
        return tuple(_decode(own, item, series) for own, item in items)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return {key: _decode(arguments[1], item, series) for key, item in value.items()}
    if kind is float:
        return math.nan if value is None else float(value)
    return value


def read_foreign_series(path: Path) -> dict[str, Array]:
    """Return the series in a file that may come from anywhere, read in a guarded child."""
    import h5py  # noqa: F401

    return dict(guarded(lambda: Answer({}, read_series(path)), path).arrays)


@dataclass(frozen=True)
class StoredResult:
    """A result: its file, the command that wrote it ("model" of a model file), its JSON object."""

    path: Path
    command: str
    object: dict[str, Any]

    @property
    def series(self) -> Path:
        """Return the file of its long series, if it has any."""
        return self.path.parent / "result.h5"


def read_result(path: Path) -> StoredResult:
    """Return the result in `path`: an output folder, its result.json, or a model.json.

    Raises:
        UsageError: C04, there is none.
        InputRejected: F05, it is not what provenance.json says; F02, it is damaged; S19, it is no
            result of rrrid; F17, it is of an earlier version.
    """
    file = path / "result.json" if path.is_dir() else path
    if path.is_dir() and not file.is_file():
        remedy = "name the folder that a command has left with --out"
        raise UsageError("C04", "no result.json there", path, remedy)
    regular_file(file, what="a result.json, or the folder it is in")
    if listed_outputs(file.parent).get(file.name) not in (None, hash_file(file)):
        words = "sha256 differs from provenance.json: it was changed since it was written"
        raise InputRejected("F05", words, file, _AGAIN)
    try:
        text = read_small_text(file, LIMITS.result, what="a result.json")
        found = json.loads(text, parse_int=_whole_number)
    except (ValueError, RecursionError):
        words = "not complete JSON, or with numbers that no float holds"
        raise InputRejected("F02", words, file, _AGAIN) from None
    if isinstance(found, dict) and found.get("format") == "rrrid-model":
        return StoredResult(file, "model", found)
    if not isinstance(found, dict) or not isinstance(found.get("command"), str):
        remedy = "name a result.json, or the folder it is in"
        raise InputRejected("S19", "not a result of rrrid", file, remedy)
    version = found.get("schema_version", 1)
    if not isinstance(version, int) or version < SCHEMA_VERSION:
        raise InputRejected("F17", "written by an earlier rrrid", file, _AGAIN)
    return StoredResult(file, found["command"], found)


def _whole_number(digits: str) -> int:
    if len(digits) > LIMITS.digits:
        raise ValueError
    return int(digits)


def result_schema(kind: type[Any], command: str) -> dict[str, Any]:
    """Return the JSON Schema of the result.json of `command`, whose result is a `kind`.

    Its descriptions are the comments beside the fields, or the names of the fields.
    """
    from pydantic import Field

    about = Field(description="the command that has left this")
    version = Field(description="version of the names in this file")
    head = {
        "command": (typing.Literal[command], about),
        "schema_version": (typing.Literal[SCHEMA_VERSION], version),
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of fields called as methods of a model
        schema: dict[str, Any] = _Models().of(kind, head).model_json_schema()
    return {"$schema": DRAFT, **schema, "title": f"result.json of rrrid {command}"}


class _Models:
    """Pydantic models of dataclasses, as `encode` writes them."""

    def __init__(self) -> None:
        from pydantic import BaseModel, ConfigDict, Field, RootModel

        class Strict(BaseModel):
            model_config = ConfigDict(extra="forbid")

        class Series(Strict):
            """The place of a long series in result.h5."""

            place: str = Field(alias="$series", description="its place")

        class Numbers(RootModel[float | None | list["Numbers"]]):
            """Numbers; null: infinite or undefined."""

        Numbers.model_rebuild(_types_namespace={"Numbers": Numbers})
        self.strict = Strict
        self.found: dict[Any, Any] = {np.ndarray: Numbers | Series, float: float | None, Path: str}

    def of(self, kind: type[Any], head: Mapping[str, Any]) -> Any:
        """Return the model of a dataclass with the fields `head` before its own."""
        from pydantic import create_model

        doc = " ".join((kind.__doc__ or "").strip().split("\n\n")[0].split())
        made = doc.startswith(f"{kind.__name__}(")  # by dataclass
        options: dict[str, Any] = {"__base__": self.strict, "__doc__": None if made else doc}
        fields = {**head, **self._fields(kind)}
        return create_model(kind.__name__, __module__=kind.__module__, **options, **fields)

    def _fields(self, kind: type[Any]) -> dict[str, Any]:
        from pydantic import Field

        hints, words = typing.get_type_hints(kind), words_of(kind)
        fields: dict[str, Any] = {}
        for field in _stored_fields(kind):
            hint = hints[field.name]
            if not field.metadata.get("flat"):
                about = Field(description=words[field.name])
                fields[field.name] = (self._translated(hint), about)
                continue
            inner = next(x for x in (*typing.get_args(hint), hint) if dataclasses.is_dataclass(x))
            for name, (own, about) in self._fields(typing.cast(type[Any], inner)).items():
                fields.setdefault(name, (own, Field(default=None, description=about.description)))
        return fields

    def _translated(self, hint: Any) -> Any:
        """Return a type as JSON has it: arrays as numbers, dataclasses as models."""
        origin, arguments = typing.get_origin(hint), typing.get_args(hint)
        key = np.ndarray if origin is np.ndarray else hint
        if dataclasses.is_dataclass(hint) and isinstance(hint, type) and hint not in self.found:
            self.found[hint] = self.of(hint, {})
        if origin in (None, typing.Literal, np.ndarray):
            return self.found.get(key, hint)
        inner = tuple(one if one is Ellipsis else self._translated(one) for one in arguments)
        if origin in (typing.Union, types.UnionType):
            return typing.Union[inner]  # noqa: UP007
        if isinstance(origin, type) and issubclass(origin, Mapping):
            return dict.__class_getitem__(inner)
        return origin[inner]


def words_of(kind: type[Any]) -> dict[str, str]:
    """Map every field of a dataclass to the comment beside or above it, else to its name."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        try:
            source = inspect.getsource(base) if dataclasses.is_dataclass(base) else ""
        except (OSError, TypeError):
            source = ""
        for above, name, code in _FIELD.findall(source):
            found[name] = " ".join(re.findall(r"# (.*)", above + code))
    names = {field.name: field.name.replace("_", " ") for field in dataclasses.fields(kind)}
    return {n: f"{words}: {found[n]}" if found.get(n) else words for n, words in names.items()}
