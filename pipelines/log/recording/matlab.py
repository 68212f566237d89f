"""Read the numeric arrays of a MAT file, v5 (scipy) or v7.3 (HDF5); objects and functions are never built.

Structures are opened: field q of structure data is the column "data.q". Both run in a guarded child.
"""

from __future__ import annotations

import io
import math
import struct
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected
from pipelines.log.recording.column_names import read_name
from pipelines.log.recording.raw import described, distinct, unit_in

__all__ = ["BUDGET", "damaged", "read_mat5", "read_mat73"]

Arrays = dict[str, npt.NDArray[np.generic]]

BUDGET = 4 << 30  # [B] of samples in one file; a ten-minute log of seven joints at 5 kHz has 0.5 GB
_MOST_MEMBERS = 2000
_DEEPEST = 8  # levels of structures, as in JSON; Isaac Lab has six
_NUMERIC = (
    "double",
    "single",
    "int8",
    "int16",
    "int32",
    "int64",
    "uint8",
    "uint16",
    "uint32",
    "uint64",
    "logical",
)
_HARMLESS = (*_NUMERIC, "char", "cell", "struct", "sparse")
_DAMAGE = (
    ValueError,
    TypeError,
    IndexError,
    KeyError,
    OSError,
    OverflowError,
    EOFError,
    AttributeError,
    NotImplementedError,
    struct.error,
    zlib.error,
    ZeroDivisionError,
    RuntimeError,
    AssertionError,
    MemoryError,
    NameError,
)  # a local variable of scipy that damage leaves unset


def damaged(source: str) -> InputRejected:
    """F08, in the one way it is said."""
    remedy = "copy it again, or save it again from MATLAB"
    return InputRejected("F08", "truncated or damaged MAT file", where=source, remedy=remedy)


def read_mat5(data: bytes, source: str) -> Arrays:
    """The numeric variables of a MAT file of version 4 to 7.

    Raises:
        InputRejected: F08 truncated or damaged, S03 a variable twice, X05 larger than a recording, X07 objects only.
    """
    from scipy.io import loadmat, whosmat
    from scipy.io.matlab import MatReadError, MatReadWarning

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)
            listed = whosmat(io.BytesIO(data))
            names = _wanted(listed, source)
            # Not mat_dtype=True, the type MATLAB shows: it would drop imaginary parts; columns become real numbers later.
            loaded = loadmat(
                io.BytesIO(data),
                variable_names=names,
                mat_dtype=False,
                struct_as_record=True,
                squeeze_me=False,
            )
    except MatReadWarning as problem:
        message = f"a variable is there twice: {problem}"
        remedy = "save each variable once"
        raise InputRejected("S03", message, where=source, remedy=remedy) from None
    except (*_DAMAGE, MatReadError, UserWarning):
        raise damaged(source) from None
    found: Arrays = {}
    for name in names:
        if name not in loaded:
            raise damaged(source)
        opened = _opened(name, loaded[name], _DEEPEST)
        found |= {distinct(key, found, source): values for key, values in opened}
    return found


def _wanted(listed: list[tuple[str, tuple[int, ...], str]], source: str) -> list[str]:
    """X05, X07: what may be loaded, judged by its header."""
    declared = sum(8 * math.prod(shape) for _, shape, kind in listed if kind in _NUMERIC)
    if declared > BUDGET or any(size < 0 for _, shape, _ in listed for size in shape):
        message = f"declares {declared} bytes of samples"
        raise InputRejected("X05", message, where=source, remedy="split the recording")
    names = [
        name
        for name, _, kind in listed
        if kind in (*_NUMERIC, "struct", "char") and not name.startswith("__")
    ]
    foreign = [f"{name} ({kind})" for name, _, kind in listed if kind not in _HARMLESS]
    if not names:
        if foreign:
            message = f"holds only objects, which are never built: {', '.join(foreign)}"
            remedy = "save the signals as numeric arrays, or timetables as struct of arrays"
            raise InputRejected("X07", message, where=source, remedy=remedy)
        remedy = "save the signals as numeric arrays"
        raise InputRejected("S12", "no numeric variable", where=source, remedy=remedy)
    return names


def _opened(name: str, value: Any, depth: int) -> list[tuple[str, npt.NDArray[np.generic]]]:
    """A variable, or the numeric fields of a structure and of those within it; cells stay closed.

    Structures in an array go by the name that each of them holds: dSPACE's Y(k).Name, Simulink's signals(k).label.
    """
    if not isinstance(value, np.ndarray):
        return []
    if value.dtype.names is None:
        return [(name, value)] if depth == _DEEPEST or value.dtype.kind in "fiubcU" else []
    if depth == 0:
        return []
    found: list[tuple[str, npt.NDArray[np.generic]]] = []
    for item in value.reshape(-1)[:_MOST_MEMBERS]:
        own = described(
            {
                field: str(item[field].squeeze())
                for field in value.dtype.names
                if item[field].dtype.kind == "U"
            }
        )
        if value.size > 1 and not own:
            return []
        fields = value.dtype.names[:_MOST_MEMBERS]
        series = [
            field
            for field in fields
            if own and item[field].dtype.kind in "fiu" and item[field].size > 1
        ]
        signals = [field for field in series if read_name(field).quantity != "time"]
        for field in fields:
            named = (
                own
                if signals == [field]
                else f"{own.partition(' [')[0] if field in series else name}.{field}"
            )
            found += _opened(named, item[field], depth - 1)
    return found


def read_mat73(path: Path, source: str) -> Arrays:
    """The numeric variables of a MAT file of version 7.3, or of any plain HDF5 file. Runs in the guarded child.

    Raises:
        InputRejected: F08, X01 external link, X02 external storage, X03 virtual data, X04 too many members, X05 too large.
    """
    import h5py

    try:
        with h5py.File(path, "r", locking=False) as file:
            members = _scan(file, "", source)
            declared = sum(dataset.nbytes for dataset in members.values())
            if declared > BUDGET or declared > 1100 * path.stat().st_size + (64 << 20):
                message = f"declares {declared} bytes of samples"
                raise InputRejected("X05", message, where=source, remedy="split the recording")
            found: Arrays = dict(_attributes(file, ""))
            for name, dataset in members.items():
                for key, values in _columns(name, dataset):
                    found[distinct(key, found, source)] = values
            return found
    except InputRejected:
        raise
    except (*_DAMAGE, UnicodeError):
        raise damaged(source) from None


def _scan(group: Any, prefix: str, source: str) -> dict[str, Any]:
    import h5py

    found: dict[str, Any] = {}
    for count, name in enumerate(group):
        if count > _MOST_MEMBERS:
            message = f"more than {_MOST_MEMBERS} members"
            raise InputRejected("X04", message, where=source, remedy="save the signals alone")
        link = group.get(name, getlink=True)
        if isinstance(link, h5py.ExternalLink):
            message = f"external link '{prefix}{name}' refused"
            remedy = "store the data in the file itself"
            raise InputRejected("X01", message, where=source, remedy=remedy)
        if name in ("#refs#", "#subsystem#") or not isinstance(link, h5py.HardLink):
            continue
        kind = group.get(name, getclass=True)
        if kind is h5py.Group and prefix.count(".") < _DEEPEST:
            found |= _scan(group[name], f"{prefix}{name}.", source)
        elif (
            kind is h5py.Dataset
            and (dataset := _usable(group[name], f"{prefix}{name}", source)) is not None
        ):
            found[f"{prefix}{name}"] = dataset
    return found


def _attributes(group: Any, prefix: str) -> Iterator[tuple[str, npt.NDArray[np.generic]]]:
    """Yield the attributes of a file and its groups that are a number or a text, as text: "@rate" is "rate = 500"."""
    import h5py

    for key, value in (
        list(group.attrs.items())[:_MOST_MEMBERS] if "MATLAB_class" not in group.attrs else []
    ):
        if isinstance(value, str | bytes | np.generic):
            text = value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
            yield f"@{prefix}{key}", np.array([f"{prefix}{key} = {text[:200]}"])
    for name in list(group)[:_MOST_MEMBERS] if prefix.count(".") < _DEEPEST else []:
        hard = isinstance(group.get(name, getlink=True), h5py.HardLink)
        if (
            hard
            and name not in ("#refs#", "#subsystem#")
            and group.get(name, getclass=True) is h5py.Group
        ):
            yield from _attributes(group[name], f"{prefix}{name}.")


def _usable(dataset: Any, name: str, source: str) -> Any:
    """X02, X03: a data set of plain numbers stored in this file; None for text, references and empty ones."""
    if dataset.id.get_create_plist().get_external_count() > 0:
        message = f"'{name}' lies in another file: refused"
        remedy = "store the data in the file itself"
        raise InputRejected("X02", message, where=source, remedy=remedy)
    if dataset.is_virtual:
        remedy = "store the data in the file itself"
        raise InputRejected("X03", f"'{name}' is virtual: refused", where=source, remedy=remedy)
    numbers = dataset.dtype.kind in "fiub" or dataset.dtype.names is not None
    plain = numbers and dataset.shape is not None and "MATLAB_empty" not in dataset.attrs
    cell = dataset.attrs.get("MATLAB_class", b"double") in (
        b"char",
        "char",
        b"cell",
        "cell",
        b"function_handle",
        "function_handle",
    )
    return dataset if plain and not cell and 1 <= len(dataset.shape) <= 2 else None


def _columns(name: str, dataset: Any) -> list[tuple[str, npt.NDArray[np.generic]]]:
    """Return the arrays of a data set: itself, the fields of a table of records, or the columns of a frame of pandas by name."""
    if dataset.dtype.names is not None:
        return _fields(name, np.asarray(dataset[()]))
    values = _read(dataset)
    items = dataset.parent.get(dataset.name.rpartition("/")[2].removesuffix("_values") + "_items")
    labels = (
        []
        if items is None or items.dtype.kind != "S" or items.ndim != 1
        else [label.decode() for label in items[()]]
    )
    if values.ndim == 2 and len(labels) == values.shape[1]:
        return [(label, values[:, k]) for k, label in enumerate(labels)]
    return [(name + unit_in(dataset.attrs), values)]


def _fields(name: str, records: npt.NDArray[Any]) -> list[tuple[str, npt.NDArray[np.generic]]]:
    """Return the fields of numbers of a table of records, those of records within them by their path."""
    if records.dtype.names is None:
        return [(name, records)] if records.dtype.kind in "fiub" else []
    parts = [
        _fields(f"{name}.{field}", records[field]) for field in records.dtype.names[:_MOST_MEMBERS]
    ]
    return [part for found in parts for part in found]


def _read(dataset: Any) -> npt.NDArray[np.generic]:
    values = np.asarray(dataset[()])
    # MATLAB stores by columns: what HDF5 calls (n, samples) is a (samples, n) matrix.
    return values.T if "MATLAB_class" in dataset.attrs else values
