"""Read and write a log as Parquet, and write tables for other programs."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pipelines.errors import InputRejected
from pipelines.io.config import FORMAT as LIMITS
from pipelines.io.hdf5 import refuse_oversize, refuse_version
from pipelines.io.output import write_file
from pipelines.io.sandbox import Answer
from pipelines.io.schema import FORMAT, FORMAT_VERSION, Array, plain

# its other allocators reserve more address space than a guarded child may use
os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")


_KEY = b"rrrid"
_COLUMN = re.compile(r"(?P<signal>[a-z_]+?)(?:_(?P<joint>[1-9]\d{0,2}))?")
_AGAIN = "copy the file again from where it was recorded"
_TABLE: dict[str, Any] = {"compression": "zstd", "write_page_checksum": True}


def write(path: Path, parts: Answer) -> None:
    """Write the parts of a log to a single table: zstd, byte-stream-split, page checksums."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    groups = plain(parts.about["groups"])
    about = {"format": FORMAT, "format_version": FORMAT_VERSION, "digest": parts.about["digest"]}
    about |= groups.pop("attributes") | groups
    fields, columns = [], []
    for name, values in columns_of(parts.arrays).items():
        words = parts.about["signals"][name if name in parts.arrays else name.rpartition("_")[0]]
        fields.append(pa.field(name, pa.float64(), nullable=False, metadata=words))
        # through its buffer: pyarrow's own conversion imports pandas, five times the work
        data = pa.py_buffer(np.ascontiguousarray(values, dtype="<f8"))
        columns.append(pa.Array.from_buffers(pa.float64(), len(values), [None, data]))
    text = json.dumps(about, sort_keys=True, separators=(",", ":"), allow_nan=False)
    schema = pa.schema(fields, metadata={_KEY: text.encode("ascii")})
    pq.write_table(
        pa.Table.from_arrays(columns, schema=schema),
        path,
        compression="zstd",
        use_dictionary=False,
        use_byte_stream_split=True,
        write_statistics=False,
        write_page_checksum=True,
        version="2.6",
    )


def columns_of(signals: Mapping[str, Array]) -> dict[str, Array]:
    """Return the columns of a table: `t`, `q_1` … `q_n` and so on."""
    columns = {}
    for name, values in signals.items():
        if values.ndim == 1:
            columns[name] = values
        else:
            columns |= {f"{name}_{j}": column for j, column in enumerate(values.T, 1)}
    return columns


def read_parts(path: Path, only: Collection[str] | None = None) -> Answer:
    """Return the groups of attributes, the digest, and the signals of `only` or all.

    Runs in the guarded child.

    Raises:
        InputRejected: with the row of the table of bad inputs that fits.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    where = str(path)
    try:
        with pq.ParquetFile(
            path,
            page_checksum_verification=True,
            pre_buffer=False,
            thrift_string_size_limit=LIMITS.metadata,
        ) as file:
            about = _about(file.schema_arrow, where)
            rows, count = file.metadata.num_rows, file.metadata.num_columns
            refuse_oversize(8 * rows * count, path.stat().st_size, "X06", where)
            names = _signal_columns(file.schema_arrow, where)
            names = {k: own for k, own in names.items() if only is None or k in only}
            table = file.read([name for own in names.values() for name in own], use_threads=False)
    except InputRejected:
        raise
    except (OSError, pa.ArrowException, ValueError, KeyError, UnicodeError, MemoryError) as problem:
        raise _explain(problem, path) from None
    if table.num_rows != rows or any(column.null_count for column in table.columns):
        raise InputRejected("F04", "rows are missing inside the table", where, _AGAIN)
    keys = ("controller", "derived", "robot")
    groups: dict[str, Any] = {key: about.pop(key) for key in keys if key in about}
    digest = about.pop("digest", None)
    described, arrays = {}, {}
    for name, own in names.items():
        described[name] = _words(table.schema, own, where)
        columns = [_samples(table.column(column)) for column in own]
        arrays[name] = columns[0] if own == ["t"] else np.stack(columns, axis=1)
    groups["attributes"] = about
    return Answer({"groups": groups, "digest": digest, "signals": described}, arrays)


def _about(schema: Any, where: str) -> dict[str, Any]:
    """Return the JSON object in the metadata of a table."""
    try:
        about = json.loads((schema.metadata or {}).get(_KEY, b"{}"))
    except (ValueError, RecursionError):
        raise InputRejected("F04", "the attributes are damaged", where, _AGAIN) from None
    if not isinstance(about, dict):
        about = {}
    refuse_version(about, "Parquet", where)
    return about


def _signal_columns(schema: Any, where: str) -> dict[str, list[str]]:
    """Map every signal to its columns in joint order (S02, S03, S12, S19)."""
    import pyarrow.types as types

    found: dict[str, dict[int, str]] = {}
    for field in schema:
        match = _COLUMN.fullmatch(field.name)
        if match is None:
            words = f"column '{field.name}' is not in format version {FORMAT_VERSION}"
            raise InputRejected("S19", words, where, "rename or remove it")
        if not (types.is_floating(field.type) or types.is_integer(field.type)):
            words, place = f"type {field.type}, not real numbers", f"{where}, column {field.name}"
            raise InputRejected("S12", words, place, "store double")
        own, joint = found.setdefault(match["signal"], {}), int(match["joint"] or 0)
        if joint in own:
            words = f"two columns are called '{field.name}'"
            raise InputRejected("S03", words, where, "rename one")
        own[joint] = field.name
    for signal, own in found.items():
        if sorted(own) != ([0] if signal == "t" else list(range(1, len(own) + 1))):
            words = f"columns of {signal} are {', '.join(own.values())}"
            remedy = f"number the joints from 1: {signal}_1, {signal}_2, …"
            raise InputRejected("S02", words, where, remedy)
    return {signal: [own[joint] for joint in sorted(own)] for signal, own in found.items()}


def _words(schema: Any, columns: list[str], where: str) -> dict[str, str]:
    """Return units and long_name of a signal, which all its columns share."""
    every = [schema.field(column).metadata or {} for column in columns]
    if any(words != every[0] for words in every):
        words = f"columns {', '.join(columns)} differ in units or long_name"
        raise InputRejected("S20", words, where, "give one signal one unit")
    decoded = {
        k.decode("utf-8", "replace"): v.decode("utf-8", "replace") for k, v in every[0].items()
    }
    decoded.pop("PARQUET:field_id", None)
    return decoded


def _samples(column: Any) -> Array:
    """Return an Arrow column without nulls as float64, through its buffers (without pandas)."""
    kind = np.dtype(column.type.to_pandas_dtype())
    parts = [
        np.frombuffer(chunk.buffers()[1], kind, len(chunk), chunk.offset * kind.itemsize)
        for chunk in column.chunks
        if len(chunk)
    ]
    stored = np.concatenate(parts) if parts else np.empty(0, kind)
    if kind.kind in "iu" and stored.size and np.abs(stored.astype(float)).max() > LIMITS.integer:
        words, remedy = "integers beyond 2^53, which are no samples", "store float64"
        raise InputRejected("S12", words, remedy=remedy)
    return stored.astype(np.float64)


def _explain(problem: BaseException, path: Path) -> InputRejected:
    """Return the library's message in the words of the table of bad inputs."""
    text = str(problem).splitlines()[0] if str(problem) else type(problem).__name__
    code, words = "F04", f"damaged: {text}"
    if "crc" in text.lower() or "checksum" in text.lower():
        words = "checksum mismatch in a page, the data are damaged"
    elif "magic bytes" in text.lower() or "footer" in text.lower():
        code, words = "F07", "truncated: no footer"
    return InputRejected(code, words, path, _AGAIN)


def csv_cell(text: str) -> str:
    """Return `text` as a CSV cell that no spreadsheet takes for a formula (X10)."""
    safe = f"'{text}" if text[:1] in ("=", "+", "-", "@", "\t", "\r") else text
    if safe == text and not any(c in safe for c in ',;"\n\r'):
        return safe
    return '"' + safe.replace('"', '""') + '"'


def write_rows(path: Path, rows: Sequence[Mapping[str, object]], kinds: Mapping[str, str]) -> None:
    """Write rows of named cells as Parquet; `kinds`: column -> type of pandas."""
    import pandas as pd

    table = pd.DataFrame(rows, columns=list(kinds)).astype(dict(kinds))
    write_file(path, lambda draft: table.to_parquet(draft, index=False, **_TABLE))
