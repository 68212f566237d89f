"""Read files of arrays as nested documents: NPY, NPZ, Parquet, MAT of any version, plain HDF5.

What a file declares is held against its size before anything is read. Objects are never built or
unpickled, cells stay closed, and nothing outside the file is opened.
"""

from __future__ import annotations

import io
import math
import struct
import warnings
import zipfile
import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np

from pipelines.errors import InputRejected, UsageError
from pipelines.importers.config import ARRAYS
from pipelines.importers.raw import Anything
from pipelines.io.hdf5 import refuse_oversize

_NUMERIC = ("double", "single", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32",
            "uint64", "logical")  # fmt: skip
_CLOSED = (b"char", "char", b"cell", "cell", b"function_handle", "function_handle")
# What the libraries raise on damage; NameError: a local variable of scipy that is left unset.
_DAMAGE = (ValueError, TypeError, LookupError, OSError, ArithmeticError, EOFError, AttributeError,
           struct.error, zlib.error, zipfile.BadZipFile, RuntimeError, AssertionError, MemoryError,
           NameError, SyntaxError, Warning)  # fmt: skip


def _damaged(what: str, source: str) -> InputRejected:
    message, remedy = f"truncated or damaged {what}", "save or copy it again"
    return InputRejected("F08", message, source, remedy)


def damaged_mat(source: str) -> InputRejected:
    """Return F08, with the only sentence for it."""
    return _damaged("MAT file", source)


def _too_large(declared: int, source: str) -> InputRejected:
    message = f"declares {declared} bytes of samples"
    return InputRejected("X05", message, source, "split the recording")


def read_npy(data: bytes, source: str) -> dict[str, Anything]:
    """Return the fields of a structured array by name, or a plain array under the name "column".

    Raises:
        InputRejected: F02 truncated, F08 damaged header, X05 too large, X07 pickled objects.
    """
    stream = io.BytesIO(data)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # of type codes that no file has held for years
            version = np.lib.format.read_magic(stream)
            read = np.lib.format.read_array_header_2_0  # of version 3 as well, but for its letters
            if version == (1, 0):
                read = np.lib.format.read_array_header_1_0
            shape, by_columns, kind = read(stream, max_header_size=ARRAYS.longest_header)
        if version == (3, 0) and kind.names:
            kind.names = tuple(name.encode("latin-1").decode() for name in kind.names)
        np.empty(0, kind).reshape([0, *map(abs, shape[1:])])  # no more sides than arrays have
        size = math.prod(shape) * kind.itemsize
    except _DAMAGE:
        raise _damaged("NPY header", source) from None
    if kind.hasobject:
        message = "holds pickled Python objects, which are never opened"
        remedy = "save plain numbers: numpy.save(…, allow_pickle=False)"
        raise InputRejected("X07", message, source, remedy)
    if size > ARRAYS.budget or any(side < 0 for side in shape):
        raise _too_large(size, source)
    if (end := stream.tell() + size) != len(data):
        message = f"truncated or damaged: {len(data)} of {end} bytes"
        raise InputRejected("F02", message, source, "copy the file again")
    if size == 0:
        raise InputRejected("T08", "no sample", source, "record again")
    array = np.frombuffer(data, dtype=kind, offset=stream.tell())
    array = array.reshape(shape, order="F" if by_columns else "C")
    if kind.names is None:
        return {"column": array}
    if array.ndim != 1:
        message, remedy = f"a structured array of shape {shape}", "save one record a sample"
        raise InputRejected("S11", message, source, remedy)
    return {name: array[name] for name in kind.names}


def read_npz(data: bytes, source: str) -> dict[str, Anything]:
    """Return the arrays of a NumPy archive by name; nothing is written to disk.

    Raises:
        UsageError: X12, it holds anything but arrays.
        InputRejected: F08 damaged, X05 larger than a recording, and what `read_npy` raises.
    """
    found: dict[str, Anything] = {}
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = archive.infolist()
            if any(not member.filename.endswith(".npy") for member in members):
                message = "an archive of other files than arrays, not a recording"
                raise UsageError("X12", message, source, "unpack it")
            declared = sum(member.file_size for member in members)
            if declared > ARRAYS.most_bytes(len(data)):
                raise _too_large(declared, source)
            for member in members:
                name = member.filename.removesuffix(".npy")
                fields = read_npy(archive.read(member), f"{source}, array {name}")
                for field, array in fields.items():
                    found[name if field == "column" else f"{name}.{field}"] = array
    except _DAMAGE:
        raise _damaged("NPZ archive", source) from None
    return found


def read_parquet(data: bytes, source: str) -> dict[str, Anything]:
    """Return the columns of a Parquet table: numbers, lists of one length, or dates [s].

    Raises:
        InputRejected: F06 a log of this program, F08 damaged, X06 larger than a recording.
    """
    import pyarrow as pa
    import pyarrow.compute
    import pyarrow.parquet as pq

    found: dict[str, Anything] = {}
    try:
        with pq.ParquetFile(io.BytesIO(data), page_checksum_verification=True) as file:
            if b"rrrid" in (file.schema_arrow.metadata or {}):
                message = "a log of this program, not a recording"
                remedy = "it needs no import: rrrid inspect reads it"
                raise InputRejected("F06", message, source, remedy)
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
                found[name] = np.array(rows[0], np.str_) if words else np.array(rows, np.float64)
            elif not pa.types.is_nested(kind):
                found[name] = column.to_numpy()
    except (pa.ArrowException, *_DAMAGE):
        raise _damaged("Parquet file", source) from None
    return found


def read_mat5(data: bytes, source: str) -> dict[str, Any]:
    """Return the numbers, texts and structures of a MAT file of version 4 to 7.

    Raises:
        InputRejected: F08 damaged, S03 a variable twice, S12 no number, X05 too large, X07 objects
            only.
    """
    from scipy.io import loadmat, whosmat
    from scipy.io.matlab import MatReadError, MatReadWarning

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)
            kinds = whosmat(io.BytesIO(data))
            names = _wanted(kinds, source)
            # Not mat_dtype=True, the type MATLAB shows: it would drop imaginary parts.
            loaded = loadmat(io.BytesIO(data), variable_names=names, simplify_cells=True)
            return {name: loaded[name] for name in names}
    except MatReadWarning as problem:
        message, remedy = f"a variable is there twice: {problem}", "save each variable once"
        raise InputRejected("S03", message, source, remedy) from None
    except (MatReadError, *_DAMAGE):
        raise damaged_mat(source) from None


def _wanted(listed: list[tuple[str, tuple[int, ...], str]], source: str) -> list[str]:
    """X05, X07: return the names of what may be loaded, judged by the headers."""
    declared = sum(8 * math.prod(shape) for _, shape, kind in listed if kind in _NUMERIC)
    if declared > ARRAYS.budget or any(size < 0 for _, shape, _ in listed for size in shape):
        raise _too_large(declared, source)
    kinds = (*_NUMERIC, "struct", "char")
    names = [name for name, _, kind in listed if kind in kinds and not name.startswith("__")]
    if names:
        return names
    harmless = (*kinds, "cell", "sparse")
    if foreign := ", ".join(f"{name} ({kind})" for name, _, kind in listed if kind not in harmless):
        message = f"holds only objects, which are never built: {foreign}"
        remedy = "save the signals as numeric arrays, or timetables as struct of arrays"
        raise InputRejected("X07", message, source, remedy)
    raise InputRejected("S12", "no numeric variable", source, "save the signals as numeric arrays")


def read_hdf5(data: bytes, source: str) -> dict[str, Any]:
    """Return the numbers of a MAT file of version 7.3, or of any plain HDF5 file, and attributes.

    Raises:
        InputRejected: F08 damaged, X01 external link, X02 external storage, X03 virtual data,
            X04 too many members, X05 too large.
    """
    import h5py

    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            members = dict(_members(file, "", source))
            sets = {name: m for name, m in members.items() if isinstance(m, h5py.Dataset)}
            usable = {name: s for name, s in sets.items() if _is_usable(s, name, source)}
            declared = sum(dataset.nbytes for dataset in usable.values())
            if declared > ARRAYS.most_bytes(len(data)):
                raise _too_large(declared, source)
            found = {name: m for name, m in members.items() if name not in sets}  # attributes
            for name, dataset in usable.items():
                found |= _arrays(name, dataset)
            return found
    except _DAMAGE:
        raise damaged_mat(source) from None


def _members(group: Any, prefix: str, source: str) -> Iterator[tuple[str, Any]]:
    """Yield data sets and attributes (numbers, texts) in and below a group by their path."""
    import h5py

    if "MATLAB_class" not in group.attrs:
        for key, value in list(group.attrs.items())[: ARRAYS.most_members]:
            text = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
            if isinstance(text, str | np.generic):
                yield f"{prefix}{key}", np.array(str(text))
    for count, name in enumerate(group):
        if count > ARRAYS.most_members:
            message = f"more than {ARRAYS.most_members} members"
            raise InputRejected("X04", message, source, "save the signals alone")
        link = group.get(name, getlink=True)
        if isinstance(link, h5py.ExternalLink):
            raise _stored_elsewhere("X01", f"external link '{prefix}{name}' refused", source)
        if name in ("#refs#", "#subsystem#") or not isinstance(link, h5py.HardLink):
            continue
        kind = group.get(name, getclass=True)
        if kind is h5py.Group and prefix.count(".") < ARRAYS.deepest:
            yield from _members(group[name], f"{prefix}{name}.", source)
        elif kind is h5py.Dataset:
            yield f"{prefix}{name}", group[name]


def _stored_elsewhere(code: str, message: str, source: str) -> InputRejected:
    return InputRejected(code, message, source, "store the data in the file itself")


def _is_usable(dataset: Any, name: str, source: str) -> bool:
    """X02, X03: return whether a data set holds plain numbers; no text, no references."""
    if dataset.id.get_create_plist().get_external_count() > 0:
        raise _stored_elsewhere("X02", f"'{name}' lies in another file: refused", source)
    if dataset.is_virtual:
        raise _stored_elsewhere("X03", f"'{name}' is virtual: refused", source)
    numbers = dataset.dtype.kind in "fiub" or dataset.dtype.names is not None
    closed = dataset.attrs.get("MATLAB_class", b"double") in _CLOSED
    closed = closed or "MATLAB_empty" in dataset.attrs
    sides = [side for side in dataset.shape or () if side > 1]
    return bool(numbers and not closed and dataset.shape and not sides[2:])  # no pictures


def _arrays(name: str, dataset: Any) -> dict[str, Anything]:
    """Return the arrays of a data set: itself, or the fields of its records."""
    values = np.asarray(dataset[()])
    if dataset.dtype.names is not None:
        return dict(_fields(name, values))
    # MATLAB stores by columns: what HDF5 calls (n, samples) is a (samples, n) matrix.
    values = values.T if "MATLAB_class" in dataset.attrs else values
    unit = dataset.attrs.get("unit", dataset.attrs.get("units", ""))
    unit = unit.decode("utf-8", "replace") if isinstance(unit, bytes) else unit
    said = isinstance(unit, str) and 0 < len(unit) <= ARRAYS.longest_unit
    return {f"{name} [{unit}]" if said else name: values}


def _fields(name: str, records: Anything) -> Iterator[tuple[str, Anything]]:
    """Yield the fields of numbers of a table of records, those of inner records by their path."""
    for field in records.dtype.names or ():
        yield from _fields(f"{name}.{field}", records[field])
    if records.dtype.kind in "fiub":
        yield name, records
