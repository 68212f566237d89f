"""Read and write a log as Parquet: one table, one JSON object in its metadata, a checksum on every page."""

from __future__ import annotations

import json
import re
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from pipelines.errors import InputRejected
from pipelines.io import canonical, schema
from pipelines.io.experiment import Array, ExperimentLog, Signal
from pipelines.io.hdf5 import as_reals, refuse_oversize

__all__ = ["read_parts", "write"]

_KEY = b"rrrid"
_LONGEST_METADATA = 16 << 20  # [B]
_COLUMN = re.compile(r"(?P<signal>[a-z_]+?)(?:_(?P<joint>[1-9]\d{0,2}))?")


def write(path: Path, log: ExperimentLog) -> None:
    """Write `log` to `path`: zstd, byte-stream-split, no dictionary, page checksums."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    about = json.loads(canonical.log_text(log))
    about.pop("signals")
    flat = {"format": schema.FORMAT, "format_version": schema.FORMAT_VERSION, "digest": canonical.digest_of(log)}
    flat |= about.pop("attributes") | about
    fields, columns = [], []
    for name, signal in log.signals.items():
        words = {"units": signal.units, "long_name": signal.long_name}
        vectors = [(name, signal.values)] if signal.values.ndim == 1 else [
            (f"{name}_{j + 1}", signal.values[:, j]) for j in range(signal.values.shape[1])]
        fields += [pa.field(column, pa.float64(), nullable=False, metadata=words) for column, _ in vectors]
        columns += [_column(values) for _, values in vectors]
    text = json.dumps(flat, sort_keys=True, separators=(",", ":"), allow_nan=False)
    table = pa.Table.from_arrays(columns, schema=pa.schema(fields, metadata={_KEY: text.encode("ascii")}))
    pq.write_table(table, path, compression="zstd", use_dictionary=False, use_byte_stream_split=True,
                   write_statistics=False, write_page_checksum=True, version="2.6")


def _column(values: Array) -> Any:
    """Samples as an Arrow array. Through its buffer: pyarrow's own conversion imports pandas, five times the work."""
    import pyarrow as pa

    return pa.Array.from_buffers(pa.float64(), len(values), [None, pa.py_buffer(np.ascontiguousarray(values, dtype="<f8"))])


def _samples(column: Any) -> Any:
    """An Arrow column without nulls as a NumPy array, through its buffers."""
    width = column.type.bit_width // 8
    kind = np.dtype(f"<{'f' if str(column.type) in ('double', 'float', 'halffloat') else str(column.type)[0]}{width}")
    parts = [np.frombuffer(chunk.buffers()[1], kind, len(chunk), chunk.offset * width) for chunk in column.chunks if len(chunk)]
    return np.concatenate(parts) if parts else np.empty(0, kind)


def read_parts(path: Path, only: Collection[str] | None = None) -> tuple[ExperimentLog, str | None]:
    """The container as it is: the log, with the signals of `only` or all, and the digest it carries or None.

    Runs inside the guarded child.

    Raises:
        InputRejected: with the row of the table of bad inputs that fits.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    where = str(path)
    try:
        with pq.ParquetFile(path, page_checksum_verification=True, pre_buffer=False,
                            thrift_string_size_limit=_LONGEST_METADATA) as file:
            about = _about(file.schema_arrow, where)
            refuse_oversize(8 * file.metadata.num_rows * file.metadata.num_columns, path.stat().st_size, "X06", where)
            names = {name: columns for name, columns in _signal_columns(file.schema_arrow, where).items()
                     if only is None or name in only}
            table = file.read([column for columns in names.values() for column in columns], use_threads=False)
    except InputRejected:
        raise
    except (OSError, pa.ArrowException, ValueError, KeyError, UnicodeError, MemoryError) as problem:
        raise _explain(problem, path) from None
    if table.num_rows != file.metadata.num_rows or any(column.null_count for column in table.columns):
        raise InputRejected("F04", "rows are missing inside the table", where=where, remedy="copy the file again")
    digest = about.pop("digest", None)
    groups = {key: about.pop(key) for key in ("controller", "derived", "robot") if key in about}
    signals = {name: _signal(table, columns, f"{where}, column {columns[0]}") for name, columns in names.items()}
    log = canonical.from_parts(groups | {"attributes": about}, signals, where=where)
    return log, digest if isinstance(digest, str) else None


def _about(arrow_schema: Any, where: str) -> dict[str, Any]:
    text = (arrow_schema.metadata or {}).get(_KEY)
    if text is None:
        raise InputRejected("F06", "a Parquet table, but not an experiment log: it has no key 'rrrid' in its metadata", where=where,
                            remedy="use 'rrrid import' with a recipe to make a log of a recording")
    try:
        about = json.loads(text)
    except (ValueError, RecursionError):
        raise InputRejected("F04", "the attributes are damaged", where=where, remedy="copy the file again") from None
    if not isinstance(about, dict) or about.pop("format", None) != schema.FORMAT:
        raise InputRejected("F06", "a Parquet table, but not an experiment log", where=where,
                            remedy="use 'rrrid import' with a recipe to make a log of a recording")
    version = about.pop("format_version", None)
    if version != schema.FORMAT_VERSION or isinstance(version, bool):
        raise InputRejected("F11", f"format_version {version}; this program understands version {schema.FORMAT_VERSION}",
                            where=where,
                            remedy="update rrrid, or write the log in that version")
    return about


def _signal_columns(arrow_schema: Any, where: str) -> dict[str, list[str]]:
    """Signal -> its columns in joint order; S03 where a name stands twice, S12 where a column does not hold numbers."""
    import pyarrow.types as types

    columns: dict[str, dict[int, str]] = {}
    for field in arrow_schema:
        place = f"{where}, column {field.name}"
        match = _COLUMN.fullmatch(field.name)
        if match is None:
            raise InputRejected("S19", f"column '{field.name}' is not in format version {schema.FORMAT_VERSION}", where=where,
                                remedy="rename or remove it")
        if not (types.is_floating(field.type) or types.is_integer(field.type)):
            raise InputRejected("S12", f"type {field.type}, not real numbers", where=place, remedy="store double")
        joint = int(match["joint"] or 0)
        if joint in columns.setdefault(match["signal"], {}):
            raise InputRejected("S03", f"two columns are called '{field.name}'", where=where, remedy="rename one")
        columns[match["signal"]][joint] = field.name
    for signal, by_joint in columns.items():
        wanted = [0] if signal == "t" else list(range(1, len(by_joint) + 1))
        if sorted(by_joint) != wanted:
            raise InputRejected("S02", f"columns of {signal} are {', '.join(by_joint.values())}", where=where,
                                remedy=f"number the joints from 1: {signal}_1, {signal}_2, …")
    return {signal: [by_joint[j] for j in sorted(by_joint)] for signal, by_joint in columns.items()}


def _signal(table: Any, columns: list[str], where: str) -> Signal:
    words = {tuple(sorted((table.schema.field(c).metadata or {}).items())) for c in columns}
    if len(words) != 1:
        raise InputRejected("S20", f"columns {', '.join(columns)} differ in units or long_name", where=where,
                            remedy="give one signal one unit")
    about = {key.decode("utf-8", "replace"): value.decode("utf-8", "replace") for key, value in words.pop()}
    if unknown := set(about) - {"units", "long_name", "PARQUET:field_id"}:
        raise InputRejected("S19", f"metadata {sorted(unknown)} are not in the format", where=where, remedy="remove them")
    stacked = [as_reals(_samples(table.column(c)), where) for c in columns]
    values = stacked[0] if columns == ["t"] else np.stack(stacked, axis=1)
    return Signal(values, about.get("units", ""), about.get("long_name", ""))


def _explain(problem: BaseException, path: Path) -> InputRejected:
    """The library's message in the words of the table of bad inputs."""
    text = str(problem).splitlines()[0] if str(problem) else type(problem).__name__
    again = "copy the file again from where it was recorded"
    lowered = text.lower()
    if "crc" in lowered or "checksum" in lowered:
        return InputRejected("F04", "checksum mismatch in a page, the data are damaged", where=path, remedy=again)
    if "magic bytes" in lowered or "footer" in lowered:
        return InputRejected("F07", "truncated: no footer", where=path, remedy=again)
    return InputRejected("F04", f"damaged: {text}", where=path, remedy=again)
