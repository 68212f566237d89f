"""Read files of arrays: NPY, NPZ, Parquet, MAT v5 (scipy) and v7.3, and plain HDF5.

The header of a file is checked against its size before anything is read; objects are never
unpickled or built. Structures of MATLAB are opened: field q of structure data is the column
"data.q". All but NPY are read in a guarded child process.
"""

from __future__ import annotations

import ast
import io
import math
import struct
import warnings
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected, UsageError
from pipelines.importers.column_names import read_name
from pipelines.importers.raw import Arrays, described, distinct, unit_in
from pipelines.io.hdf5 import refuse_oversize

__all__ = ["damaged_mat", "read_mat5", "read_mat73", "read_npy", "read_npz", "read_parquet"]

Array = npt.NDArray[np.generic]

_BUDGET = 4 << 30  # [B] in one file; a ten-minute log of seven joints at 5 kHz has 0.5 GB
_LONGEST_HEADER = 65_536
_MOST_PACKED = 1100  # to 1, what deflate reaches at most
_MOST_MEMBERS = 2000
_DEEPEST = 8  # levels of structures, as in JSON; Isaac Lab has six
_NUMERIC = ("double", "single", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32",
            "uint64", "logical")  # fmt: skip
_HARMLESS = (*_NUMERIC, "char", "cell", "struct", "sparse")
_CLOSED = (b"char", "char", b"cell", "cell", b"function_handle", "function_handle")
_INTERNAL = ("#refs#", "#subsystem#")
_BAD_HEADER = (Warning, ValueError, SyntaxError, TypeError, KeyError, IndexError, AttributeError,
               RecursionError, MemoryError, OverflowError)  # fmt: skip
_BAD_ARCHIVE = (zipfile.BadZipFile, zlib.error, EOFError, OSError, NotImplementedError,
                RuntimeError, ValueError, struct.error)  # fmt: skip
# NameError: a local variable of scipy that damage leaves unset.
_BAD_MAT = (ValueError, TypeError, IndexError, KeyError, OSError, OverflowError, EOFError,
            AttributeError, NotImplementedError, struct.error, zlib.error, ZeroDivisionError,
            RuntimeError, AssertionError, MemoryError, NameError)  # fmt: skip


def _too_large(declared: int, source: str, of: str = "") -> InputRejected:
    message = f"declares {declared} bytes{of}"
    return InputRejected("X05", message, where=source, remedy="split the recording")


def read_npy(data: bytes, source: str) -> dict[str, Array]:
    """Return the fields of a structured array by name, or a plain array under the name "column".

    Raises:
        InputRejected: F02 truncated, F08 damaged header, X05 too large, X07 pickled objects.
    """
    kind, by_columns, shape, start = _npy_header(data, source)
    if kind.hasobject:
        message = "holds pickled Python objects, which are never opened"
        remedy = "save plain numbers: numpy.save(…, allow_pickle=False)"
        raise InputRejected("X07", message, where=source, remedy=remedy)
    count = math.prod(shape)
    size = count * kind.itemsize
    if size > _BUDGET:
        raise _too_large(size, source)
    if start + size != len(data):
        message = f"truncated or damaged: {len(data)} of {start + size} bytes"
        raise InputRejected("F02", message, where=source, remedy="copy the file again")
    if size == 0:
        raise InputRejected("T08", "no sample", where=source, remedy="record again")
    flat = np.frombuffer(data, dtype=kind, count=count, offset=start)
    array = flat.reshape(shape, order="F" if by_columns else "C")
    if kind.names is None:
        return {"column": array}
    if array.ndim != 1:
        message, remedy = f"a structured array of shape {shape}", "save one record a sample"
        raise InputRejected("S11", message, where=source, remedy=remedy)
    return {name: array[name] for name in kind.names}


def _npy_header(data: bytes, source: str) -> tuple[np.dtype[Any], bool, tuple[int, ...], int]:
    """Return type, whether it is stored by columns, shape, and where the numbers begin."""
    remedy = "save or copy the file again"
    broken = InputRejected("F08", "damaged NPY header", where=source, remedy=remedy)
    major = data[6] if len(data) > 12 else 0
    if major not in (1, 2, 3):
        raise broken
    wide = 2 if major == 1 else 4
    length = int.from_bytes(data[8 : 8 + wide], "little")
    start = 8 + wide + length
    if length > _LONGEST_HEADER or start > len(data):
        raise broken
    try:
        text = data[8 + wide : start].decode("latin-1" if major < 3 else "utf-8")
        table = ast.literal_eval(text.strip())
        descr, by_columns, shape = table["descr"], table["fortran_order"], table["shape"]
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # of type codes that no file has held for years
            kind = np.dtype(np.lib.format.descr_to_dtype(descr))
    except _BAD_HEADER:
        raise broken from None
    sizes = isinstance(shape, tuple) and all(type(n) is int and n >= 0 for n in shape)
    if not (sizes and len(shape) <= 8 and isinstance(by_columns, bool)):
        raise broken
    return kind, by_columns, shape, start


def read_npz(data: bytes, source: str) -> dict[str, Array]:
    """Return the arrays of a NumPy archive by name; nothing is written to disk.

    Arrays of Python objects are not opened and come back empty.

    Raises:
        UsageError: X12, it holds anything but arrays.
        InputRejected: F08 damaged, X05 larger than a recording, and what `read_npy` raises.
    """
    found: dict[str, Array] = {}
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = archive.infolist()
            if any(not member.filename.endswith(".npy") for member in members):
                message = "an archive of other files than arrays, not a recording"
                raise UsageError("X12", message, where=source, remedy="unpack it")
            declared = sum(member.file_size for member in members)
            if declared > min(_BUDGET, _MOST_PACKED * len(data) + (64 << 20)):
                raise _too_large(declared, source)
            for member in members:
                name = member.filename.removesuffix(".npy")
                packed = archive.read(member)
                where = f"{source}, array {name}"
                if _npy_header(packed, where)[0].hasobject:
                    found[name] = np.empty(0, object)
                    continue
                for field, array in read_npy(packed, where).items():
                    found[name if field == "column" else f"{name}.{field}"] = array
    except _BAD_ARCHIVE:
        message, remedy = "truncated or damaged NPZ archive", "save or copy it again"
        raise InputRejected("F08", message, where=source, remedy=remedy) from None
    return found


def read_parquet(data: bytes, source: str) -> dict[str, Array]:
    """Return the columns of a Parquet table: numbers, lists of one length, or dates [s].

    Raises:
        InputRejected: F06 a log of this program, F08 damaged, X06 larger than a recording.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    found: dict[str, Array] = {}
    try:
        with pq.ParquetFile(io.BytesIO(data), page_checksum_verification=True) as file:
            if b"rrrid" in (file.schema_arrow.metadata or {}):
                message = "a log of this program, not a recording"
                remedy = "it needs no import: rrrid inspect reads it"
                raise InputRejected("F06", message, where=source, remedy=remedy)
            cells = file.metadata.num_rows * file.metadata.num_columns
            refuse_oversize(8 * cells, len(data), "X06", source)
            table = file.read()
        for name, column in zip(table.column_names, table.columns, strict=True):
            kind = column.type
            if pa.types.is_timestamp(kind):
                stamps = column.cast(pa.timestamp("ns")).cast(pa.int64())
                column = pa.compute.divide(stamps.cast(pa.float64(), safe=False), 1e9)
            if pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind):
                rows = column.to_pylist()
                words = pa.types.is_string(kind.value_type)  # the joints' names, in every row
                as_text = words and rows
                found[name] = np.array(rows[0], np.str_) if as_text else np.array(rows, np.float64)
            elif not pa.types.is_nested(kind):
                found[name] = column.to_numpy()
    except InputRejected:
        raise
    except (pa.ArrowException, OSError, ValueError, TypeError, struct.error):
        message, remedy = "truncated or damaged Parquet file", "save or copy it again"
        raise InputRejected("F08", message, where=source, remedy=remedy) from None
    return found


def damaged_mat(source: str) -> InputRejected:
    """Return F08, with the only sentence for it."""
    remedy = "copy it again, or save it again from MATLAB"
    return InputRejected("F08", "truncated or damaged MAT file", where=source, remedy=remedy)


def read_mat5(data: bytes, source: str) -> Arrays:
    """Return the numeric variables of a MAT file of version 4 to 7.

    Raises:
        InputRejected: F08 damaged, S03 a variable twice, X05 too large, X07 objects only.
    """
    from scipy.io import loadmat, whosmat
    from scipy.io.matlab import MatReadError, MatReadWarning

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)
            listed = whosmat(io.BytesIO(data))
            names = _wanted(listed, source)
            # Not mat_dtype=True, the type MATLAB shows: it would drop imaginary parts.
            loaded = loadmat(io.BytesIO(data), variable_names=names)
    except MatReadWarning as problem:
        message, remedy = f"a variable is there twice: {problem}", "save each variable once"
        raise InputRejected("S03", message, where=source, remedy=remedy) from None
    except (*_BAD_MAT, MatReadError, UserWarning):
        raise damaged_mat(source) from None
    if not set(names) <= loaded.keys():
        raise damaged_mat(source)
    found: dict[str, Array] = {k: np.empty(0, object) for k, _, kind in listed if kind == "cell"}
    for name in names:
        opened = _opened(name, loaded[name], _DEEPEST)
        found |= {distinct(key, found, source): values for key, values in opened}
    return found


def _wanted(listed: list[tuple[str, tuple[int, ...], str]], source: str) -> list[str]:
    """X05, X07: return the names of what may be loaded, judged by the headers."""
    declared = sum(8 * math.prod(shape) for _, shape, kind in listed if kind in _NUMERIC)
    if declared > _BUDGET or any(size < 0 for _, shape, _ in listed for size in shape):
        raise _too_large(declared, source, " of samples")
    kinds = (*_NUMERIC, "struct", "char")
    names = [name for name, _, kind in listed if kind in kinds and not name.startswith("__")]
    foreign = ", ".join(f"{name} ({kind})" for name, _, kind in listed if kind not in _HARMLESS)
    if not names and foreign:
        message = f"holds only objects, which are never built: {foreign}"
        remedy = "save the signals as numeric arrays, or timetables as struct of arrays"
        raise InputRejected("X07", message, where=source, remedy=remedy)
    if not names:
        remedy = "save the signals as numeric arrays"
        raise InputRejected("S12", "no numeric variable", where=source, remedy=remedy)
    return names


def _opened(name: str, value: Any, depth: int) -> Iterator[tuple[str, Array]]:
    """Yield a variable, or the numeric fields of a structure and of those in it; cells stay closed.

    Structures in an array go by the name that each of them holds: dSPACE's Y(k).Name, Simulink's
    signals(k).label.
    """
    if not isinstance(value, np.ndarray):
        return
    fields = value.dtype.names
    if fields is None:
        if depth == _DEEPEST or value.dtype.kind in "fiubcU":
            yield name, value
        return
    items = value.reshape(-1)[:_MOST_MEMBERS] if depth > 0 else ()
    texts = [{f: str(x[f].squeeze()) for f in fields if x[f].dtype.kind == "U"} for x in items]
    names = [described(text) for text in texts]
    if value.size > 1 and not all(names):
        return
    for item, own in zip(items, names, strict=True):
        numbers = [f for f in fields[:_MOST_MEMBERS] if own and item[f].dtype.kind in "fiu"]
        series = [f for f in numbers if item[f].size > 1]
        signals = [f for f in series if read_name(f).quantity != "time"]
        for f in fields[:_MOST_MEMBERS]:
            stem = own.partition(" [")[0] if f in series else name
            yield from _opened(own if signals == [f] else f"{stem}.{f}", item[f], depth - 1)


def read_mat73(path: Path, source: str) -> Arrays:
    """Return the numeric variables of a MAT file of version 7.3, or of any plain HDF5 file.

    Raises:
        InputRejected: F08 damaged, X01 external link, X02 external storage, X03 virtual data,
            X04 too many members, X05 too large.
    """
    import h5py

    try:
        with h5py.File(path, "r", locking=False) as file:
            members = _scan(file, "", source)
            series = {k: dataset for k, dataset in members.items() if _usable(dataset, k, source)}
            declared = sum(dataset.nbytes for dataset in series.values())
            if declared > min(_BUDGET, _MOST_PACKED * path.stat().st_size + (64 << 20)):
                raise _too_large(declared, source, " of samples")
            found: dict[str, Array] = dict(_attributes(file, ""))
            for name, dataset in series.items():
                for key, values in _columns(name, dataset):
                    found[distinct(key, found, source)] = values
            closed = {k: _unopened(members[k]) for k in members if k not in series}
            return found | {k: array for k, array in closed.items() if array is not None}
    except InputRejected:
        raise
    except (*_BAD_MAT, UnicodeError):
        raise damaged_mat(source) from None


def _scan(group: Any, prefix: str, source: str) -> dict[str, Any]:
    """Return the data sets below a group by their path."""
    import h5py

    found: dict[str, Any] = {}
    for count, name in enumerate(group):
        if count > _MOST_MEMBERS:
            message, remedy = f"more than {_MOST_MEMBERS} members", "save the signals alone"
            raise InputRejected("X04", message, where=source, remedy=remedy)
        link = group.get(name, getlink=True)
        if isinstance(link, h5py.ExternalLink):
            raise _stored_elsewhere("X01", f"external link '{prefix}{name}' refused", source)
        if name in _INTERNAL or not isinstance(link, h5py.HardLink):
            continue
        kind = group.get(name, getclass=True)
        if kind is h5py.Group and prefix.count(".") < _DEEPEST:
            found |= _scan(group[name], f"{prefix}{name}.", source)
        elif kind is h5py.Dataset:
            found[f"{prefix}{name}"] = group[name]
    return found


def _stored_elsewhere(code: str, message: str, source: str) -> InputRejected:
    return InputRejected(code, message, where=source, remedy="store the data in the file itself")


def _usable(dataset: Any, name: str, source: str) -> bool:
    """X02, X03: return whether a data set holds plain numbers; no text, no references."""
    if dataset.id.get_create_plist().get_external_count() > 0:
        raise _stored_elsewhere("X02", f"'{name}' lies in another file: refused", source)
    if dataset.is_virtual:
        raise _stored_elsewhere("X03", f"'{name}' is virtual: refused", source)
    numbers = dataset.dtype.kind in "fiub" or dataset.dtype.names is not None
    plain = numbers and dataset.shape is not None and "MATLAB_empty" not in dataset.attrs
    closed = dataset.attrs.get("MATLAB_class", b"double") in _CLOSED
    return bool(plain and not closed and dataset.shape and _long_sides(dataset) <= 2)


def _long_sides(dataset: Any) -> int:
    return sum(side > 1 for side in dataset.shape or ())


def _unopened(dataset: Any) -> Array | None:
    """Return an empty array in place of cells or pictures, to name them; None for anything else."""
    if dataset.attrs.get("MATLAB_class") in (b"cell", "cell"):
        return np.empty(0, object)
    pictures = dataset.dtype.kind in "fiub" and _long_sides(dataset) > 2
    return np.empty((0, *dataset.shape[1:])) if pictures else None


def _attributes(group: Any, prefix: str) -> Iterator[tuple[str, Array]]:
    """Yield the attributes of groups that are a number or a text: "@rate" is "rate = 500"."""
    import h5py

    for key, value in list(group.attrs.items())[:_MOST_MEMBERS]:
        if isinstance(value, str | bytes | np.generic) and "MATLAB_class" not in group.attrs:
            text = value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
            yield f"@{prefix}{key}", np.array([f"{prefix}{key} = {text[:200]}"])
    for name in list(group)[:_MOST_MEMBERS] if prefix.count(".") < _DEEPEST else []:
        hard = isinstance(group.get(name, getlink=True), h5py.HardLink)
        if hard and name not in _INTERNAL and group.get(name, getclass=True) is h5py.Group:
            yield from _attributes(group[name], f"{prefix}{name}.")


def _columns(name: str, dataset: Any) -> list[tuple[str, Array]]:
    """Return the arrays of a data set: itself, fields of records, or a pandas frame's columns."""
    values = np.asarray(dataset[()])
    if dataset.dtype.names is not None:
        return _fields(name, values)
    # MATLAB stores by columns: what HDF5 calls (n, samples) is a (samples, n) matrix.
    values = values.T if "MATLAB_class" in dataset.attrs else values
    stem = dataset.name.rpartition("/")[2].removesuffix("_values")
    items = dataset.parent.get(f"{stem}_items")
    texts = items is not None and items.dtype.kind == "S" and items.ndim == 1
    labels = [label.decode() for label in items[()]] if texts else []
    if values.ndim == 2 and len(labels) == values.shape[1]:
        return list(zip(labels, values.T, strict=True))
    return [(name + unit_in(dataset.attrs), values)]


def _fields(name: str, records: npt.NDArray[Any]) -> list[tuple[str, Array]]:
    """Return the fields of numbers of a table of records, those of inner records by their path."""
    if records.dtype.names is None:
        return [(name, records)] if records.dtype.kind in "fiub" else []
    fields = records.dtype.names[:_MOST_MEMBERS]
    return [part for field in fields for part in _fields(f"{name}.{field}", records[field])]
