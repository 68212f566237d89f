"""Read files of arrays: NPY, NPZ and Parquet. Objects are never unpickled.

The header of a file is checked against its size before anything is read.
"""

from __future__ import annotations

import io
import math
import struct
import warnings
import zipfile
import zlib
from typing import Any

import numpy as np

from pipelines.errors import InputRejected, UsageError
from pipelines.importers.config import ARRAYS
from pipelines.importers.raw import Anything
from pipelines.io.hdf5 import refuse_oversize

_BAD_HEADER = (Warning, ValueError, SyntaxError, TypeError, KeyError, IndexError, AttributeError,
               RecursionError, MemoryError, OverflowError)  # fmt: skip
_BAD_ARCHIVE = (zipfile.BadZipFile, zlib.error, EOFError, OSError, NotImplementedError,
                RuntimeError, ValueError, struct.error)  # fmt: skip


def too_large(declared: int, source: str, of: str = "") -> InputRejected:
    """Return X05, a file that declares more than a recording has."""
    message = f"declares {declared} bytes{of}"
    return InputRejected("X05", message, where=source, remedy="split the recording")


def read_npy(data: bytes, source: str) -> dict[str, Anything]:
    """Return the fields of a structured array by name, or a plain array under the name "column".

    Raises:
        InputRejected: F02 truncated, F08 damaged header, X05 too large, X07 pickled objects.
    """
    kind, by_columns, shape, start = _npy_header(data, source)
    if kind.hasobject:
        message = "holds pickled Python objects, which are never opened"
        remedy = "save plain numbers: numpy.save(…, allow_pickle=False)"
        raise InputRejected("X07", message, source, remedy)
    count = math.prod(shape)
    size = count * kind.itemsize
    if size > ARRAYS.budget:
        raise too_large(size, source)
    if start + size != len(data):
        message = f"truncated or damaged: {len(data)} of {start + size} bytes"
        raise InputRejected("F02", message, source, "copy the file again")
    if size == 0:
        raise InputRejected("T08", "no sample", source, "record again")
    flat = np.frombuffer(data, dtype=kind, count=count, offset=start)
    array = flat.reshape(shape, order="F" if by_columns else "C")
    if kind.names is None:
        return {"column": array}
    if array.ndim != 1:
        message, remedy = f"a structured array of shape {shape}", "save one record a sample"
        raise InputRejected("S11", message, source, remedy)
    return {name: array[name] for name in kind.names}


def _npy_header(data: bytes, source: str) -> tuple[np.dtype[Any], bool, tuple[int, ...], int]:
    """Return type, whether it is stored by columns, shape, and where the numbers begin."""
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
        if not all(side >= 0 for side in shape):
            raise ValueError
        np.empty(0, kind).reshape([0, *shape[1:]])  # no more sides than arrays have
    except _BAD_HEADER:
        message, remedy = "damaged NPY header", "save or copy the file again"
        raise InputRejected("F08", message, source, remedy) from None
    return kind, by_columns, shape, stream.tell()


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
                raise too_large(declared, source)
            for member in members:
                name = member.filename.removesuffix(".npy")
                fields = read_npy(archive.read(member), f"{source}, array {name}")
                for field, array in fields.items():
                    found[name if field == "column" else f"{name}.{field}"] = array
    except _BAD_ARCHIVE:
        message, remedy = "truncated or damaged NPZ archive", "save or copy it again"
        raise InputRejected("F08", message, source, remedy) from None
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
    except InputRejected:
        raise
    except (pa.ArrowException, OSError, ValueError, TypeError, IndexError, struct.error):
        message, remedy = "truncated or damaged Parquet file", "save or copy it again"
        raise InputRejected("F08", message, source, remedy) from None
    return found
