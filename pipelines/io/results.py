"""Store any stage's result as open files, and bring it back: JSON for figures, HDF5 for long series.

    text, series = encode(result)
    result = decode(Result, json.loads(text), series)

A result is a frozen dataclass of plain values, tuples, further dataclasses and arrays. Arrays of at most 64 numbers
stand in the JSON; longer ones become series, and the JSON says which. Infinite and undefined numbers become null.
Fields marked `metadata=NOT_STORED` (samples that are written as logs, say) are left out and come back as None. The fields of one
marked `metadata=FLAT` stand beside the others; what is None adds nothing.
"""

from __future__ import annotations

import dataclasses
import json
import math
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np

from pipelines.errors import InputRejected
from pipelines.io.chunks import store
from pipelines.io.experiment import Array

__all__ = ["FLAT", "NOT_STORED", "SCHEMA_VERSION", "decode", "encode", "headed", "json_text", "read_foreign_series", "read_series",
           "refuse_earlier", "stored_result", "write_series"]

NOT_STORED: Final[Mapping[str, object]] = {"stored": False}
FLAT: Final[Mapping[str, object]] = {"flat": True}
SCHEMA_VERSION: Final = 2  # of result.json
_INLINE = 64
_CHUNK = 65536  # numbers
_SERIES = "$series"

T = TypeVar("T")


def encode(result: Any) -> tuple[dict[str, Any], dict[str, Array]]:
    """`result` as a JSON object and the series that are too long for it."""
    series: dict[str, Array] = {}
    return _encode(result, "", series), series


def json_text(value: Any) -> str:
    """JSON as every file of rrrid has it: sorted keys, two blanks, null for infinite and undefined. Bytes of a path that are no
    text (C07) become question marks."""
    text = json.dumps(value, sort_keys=True, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    return text.encode("utf-8", "replace").decode("utf-8")


def headed(command: str, object_: Mapping[str, Any]) -> dict[str, Any]:
    """Return the object of a result.json: the command and the version of the schema before what was found."""
    return {"command": command, "schema_version": SCHEMA_VERSION, **object_}


def refuse_earlier(object_: Mapping[str, Any], file: Path) -> None:
    """Refuse a result.json of an earlier schema, whose names have other meanings.

    Raises:
        InputRejected: F17.
    """
    version = object_.get("schema_version", 1)
    if not isinstance(version, int) or version < SCHEMA_VERSION:
        raise InputRejected("F17", "written by an earlier rrrid", where=file, remedy="run the command again")


def stored_result(path: Path, command: str) -> Mapping[str, Any] | None:
    """The object of the result.json of `command`, named itself or in the folder named; None where there is none.

    Raises:
        InputRejected: F17, it was written by an earlier rrrid.
    """
    file = path / "result.json" if path.is_dir() else path
    if file.name != "result.json" or not file.is_file():
        return None
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except (ValueError, RecursionError):
        return None
    if not isinstance(found, dict) or found.get("command") != command:
        return None
    refuse_earlier(found, file)
    return found


def _encode(value: Any, path: str, series: dict[str, Array]) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        stored = [field for field in dataclasses.fields(value) if field.metadata.get("stored", True)]
        flat = [getattr(value, field.name) for field in stored if field.metadata.get("flat")]
        beside = [_encode(one, path, series) for one in flat if one is not None]
        return {key: item for one in beside for key, item in one.items()} | {
            field.name: _encode(getattr(value, field.name), f"{path}/{field.name}", series)
            for field in stored if not field.metadata.get("flat")}
    if isinstance(value, Mapping):
        return {str(key): _encode(item, f"{path}/{key}", series) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        if value.size > _INLINE:
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


def decode(kind: type[T], value: Any, series: Mapping[str, Array]) -> T:
    """The result of type `kind` that `encode` made `value` and `series` of."""
    return typing.cast(T, _decode(kind, value, series))


def _decode(kind: Any, value: Any, series: Mapping[str, Array]) -> Any:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        real = [a for a in arguments if a is not type(None)]
        return None if value is None else _decode(real[0], value, series) if len(real) == 1 else value
    if isinstance(value, dict) and _SERIES in value:
        return series[value[_SERIES]]
    if origin is np.ndarray:
        return np.array([math.nan if x is None else x for x in value] if value is not None else math.nan, dtype=np.float64)
    if dataclasses.is_dataclass(kind) and isinstance(kind, type):
        hints = typing.get_type_hints(kind)
        return kind(**{field.name: _decode(hints[field.name], value[field.name], series)
                       if field.metadata.get("stored", True) else None
                       for field in dataclasses.fields(kind) if field.metadata.get("stored", True) is False or field.name in value})
    if origin is tuple:
        if len(arguments) == 2 and arguments[1] is Ellipsis:
            return tuple(_decode(arguments[0], item, series) for item in value)
        return tuple(_decode(a, item, series) for a, item in zip(arguments, value, strict=True))
    if origin in (dict, Mapping) or (isinstance(origin, type) and issubclass(origin, Mapping)):
        return {key: _decode(arguments[1], item, series) for key, item in value.items()}
    if kind is float and value is None:
        return math.nan
    return float(value) if kind is float else value


def write_series(path: Path, series: Mapping[str, Array]) -> None:
    """The series of a result as HDF5, checksummed, each under the place where the JSON names it."""
    import h5py

    with h5py.File(path, "w", libver=("v110", "v110")) as file:
        file.attrs["format"] = "rrrid-result"
        for name, values in series.items():
            rows = max(1, _CHUNK * len(values) // max(values.size, 1))
            store(file, name, values, (min(rows, len(values)), *values.shape[1:]))


def read_series(path: Path) -> dict[str, Array]:
    """What `write_series` wrote, of a file whose bytes are known to be those."""
    import h5py

    found: dict[str, Array] = {}
    with h5py.File(path, "r") as file:
        file.visititems(lambda name, item: found.update({f"/{name}": item[()]}) if isinstance(item, h5py.Dataset) else None)
    return found


def read_foreign_series(path: Path) -> dict[str, Array]:
    """The same of a file that may come from anywhere: in a guarded child, and only numbers that lie in the file itself.

    Raises:
        InputRejected: F02-F04, damaged; X02, X03, X05, S12, it leads elsewhere or holds something else.
    """
    import h5py

    from pipelines.io.guard import Answer, guarded
    from pipelines.io.hdf5 import explain

    def work() -> Answer:
        try:
            with h5py.File(path, "r", locking=False) as file:
                _refuse_what_leads_elsewhere(file, path)
            return Answer({}, read_series(path))
        except (OSError, RuntimeError, KeyError, ValueError, TypeError, MemoryError) as problem:
            raise explain(problem, path) from None

    return dict(guarded(work, path).arrays)


def _refuse_what_leads_elsewhere(file: Any, path: Path) -> None:
    """Every data set, before one byte of it is read."""
    import h5py

    from pipelines.io.hdf5 import foreign_storage, refuse_oversize

    found: list[Any] = []
    file.visititems(lambda _, item: found.append(item) if isinstance(item, h5py.Dataset) else None)
    for dataset in found:
        where = f"{path}, {dataset.name}"
        if foreign := foreign_storage(dataset):
            raise InputRejected("X02" if "raw" in foreign else "X03", f"{foreign} refused", where=where,
                                remedy="run the command again")
        if dataset.dtype != np.float64:
            raise InputRejected("S12", f"type {dataset.dtype}, no series of a result", where=where, remedy="run the command again")
    refuse_oversize(8 * sum(math.prod(dataset.shape) for dataset in found), path.stat().st_size, "X05", str(path))
