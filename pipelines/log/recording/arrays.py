"""Read a NumPy or Parquet file: its header is checked against its size before anything is read, and nothing is unpickled."""

from __future__ import annotations

import ast
import io
import math
import struct
import warnings
import zipfile
import zlib

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected, UsageError
from pipelines.log.hdf5 import refuse_oversize

__all__ = ["read_npy", "read_npz", "read_parquet"]

_LONGEST_HEADER = 65_536
_BUDGET = 4 << 30  # [B]
_MOST_PACKED = 1100  # to 1, what deflate reaches at most


def read_npy(data: bytes, source: str) -> dict[str, npt.NDArray[np.generic]]:
    """The array of an NPY file, its fields by name where it is structured, else under the name "column".

    Raises:
        InputRejected: F02 truncated, F08 damaged header, X05 larger than a recording, X07 holds pickled objects.
    """
    kind, by_columns, shape, start = _header(data, source)
    if kind.hasobject:
        message = "holds pickled Python objects, which are never opened"
        remedy = "save plain numbers: numpy.save(…, allow_pickle=False)"
        raise InputRejected("X07", message, where=source, remedy=remedy)
    size = math.prod(shape) * kind.itemsize
    if size > _BUDGET:
        remedy = "split the recording"
        raise InputRejected("X05", f"declares {size} bytes", where=source, remedy=remedy)
    if start + size != len(data):
        message = f"truncated or damaged: {len(data)} of {start + size} bytes"
        raise InputRejected("F02", message, where=source, remedy="copy the file again")
    if size == 0:
        raise InputRejected("T08", "no sample", where=source, remedy="record again")
    array = np.frombuffer(data, dtype=kind, count=math.prod(shape), offset=start).reshape(
        shape, order="F" if by_columns else "C"
    )
    if kind.names is None:
        return {"column": array}
    if array.ndim != 1:
        message = f"a structured array of shape {shape}"
        raise InputRejected("S11", message, where=source, remedy="save one record a sample")
    return {name: array[name] for name in kind.names}


def read_npz(data: bytes, source: str) -> dict[str, npt.NDArray[np.generic]]:
    """The arrays of a NumPy archive by name. Nothing is written to disk; it runs in the guarded child.

    Raises:
        UsageError: X12, it holds anything but arrays.
        InputRejected: F08 damaged, X05 larger than a recording, and what `read_npy` raises.
    """
    found: dict[str, npt.NDArray[np.generic]] = {}
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = archive.infolist()
            if any(not member.filename.endswith(".npy") for member in members):
                message = "an archive of other files than arrays, not a recording"
                raise UsageError("X12", message, where=source, remedy="unpack it")
            declared = sum(member.file_size for member in members)
            if declared > min(_BUDGET, _MOST_PACKED * len(data) + (64 << 20)):
                message = f"declares {declared} bytes"
                raise InputRejected("X05", message, where=source, remedy="split the recording")
            for member in members:
                name = member.filename.removesuffix(".npy")
                arrays = read_npy(archive.read(member), f"{source}, array {name}")
                found |= {
                    name if field == "column" else f"{name}.{field}": array
                    for field, array in arrays.items()
                }
    except (
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        OSError,
        NotImplementedError,
        RuntimeError,
        ValueError,
        struct.error,
    ):
        message = "truncated or damaged NPZ archive"
        raise InputRejected("F08", message, where=source, remedy="save or copy it again") from None
    return found


def read_parquet(data: bytes, source: str) -> dict[str, npt.NDArray[np.generic]]:
    """The columns of a Parquet table that hold numbers, lists of one length, or dates [s]. Runs in the guarded child.

    Raises:
        InputRejected: F06 a log of this program, F08 damaged, X06 larger than a recording.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    found: dict[str, npt.NDArray[np.generic]] = {}
    try:
        with pq.ParquetFile(io.BytesIO(data), page_checksum_verification=True) as file:
            if b"rrrid" in (file.schema_arrow.metadata or {}):
                message = "a log of this program, not a recording"
                remedy = "it needs no import: rrrid inspect reads it"
                raise InputRejected("F06", message, where=source, remedy=remedy)
            refuse_oversize(
                8 * file.metadata.num_rows * file.metadata.num_columns, len(data), "X06", source
            )
            table = file.read()
            for name, column in zip(table.column_names, table.columns, strict=True):
                kind = column.type
                if pa.types.is_timestamp(kind):
                    column = pa.compute.divide(
                        column.cast(pa.timestamp("ns"))
                        .cast(pa.int64())
                        .cast(pa.float64(), safe=False),
                        1e9,
                    )
                if pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind):
                    words = pa.types.is_string(
                        kind.value_type
                    )  # the joints' names, again in every row
                    rows = column.to_pylist()
                    found[name] = (
                        np.array(rows[0], dtype=np.str_)
                        if words and rows
                        else np.array(rows, dtype=np.float64)
                    )
                elif not pa.types.is_nested(kind):
                    found[name] = column.to_numpy()
    except InputRejected:
        raise
    except (pa.ArrowException, OSError, ValueError, TypeError, struct.error):
        message = "truncated or damaged Parquet file"
        raise InputRejected("F08", message, where=source, remedy="save or copy it again") from None
    return found


def _header(data: bytes, source: str) -> tuple[np.dtype[np.generic], bool, tuple[int, ...], int]:
    broken = InputRejected(
        "F08", "damaged NPY header", where=source, remedy="save or copy the file again"
    )
    major = data[6] if len(data) > 12 else 0
    if major not in (1, 2, 3):
        raise broken
    wide = 2 if major == 1 else 4
    length = int.from_bytes(data[8 : 8 + wide], "little")
    start = 8 + wide + length
    if length > _LONGEST_HEADER or start > len(data):
        raise broken
    try:
        table = ast.literal_eval(
            data[8 + wide : start].decode("latin-1" if major < 3 else "utf-8").strip()
        )
        descr, order, shape = table["descr"], table["fortran_order"], table["shape"]
        with warnings.catch_warnings():
            warnings.simplefilter(
                "error"
            )  # numpy warns of type codes that no file has held for years
            kind = np.dtype(np.lib.format.descr_to_dtype(descr))
    except (
        Warning,
        ValueError,
        SyntaxError,
        TypeError,
        KeyError,
        IndexError,
        AttributeError,
        RecursionError,
        MemoryError,
        OverflowError,
    ):
        raise broken from None
    if not (
        isinstance(shape, tuple)
        and all(type(n) is int and n >= 0 for n in shape)
        and len(shape) <= 8
        and isinstance(order, bool)
    ):
        raise broken
    return kind, order, shape, start
