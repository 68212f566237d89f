"""Read a recorded file by its content: text, JSON, YAML, NPY, NPZ, Parquet, MAT or HDF5.

JSON and the YAML of `ros2 topic echo` hold arrays by name, or frames:

[{"t": 0.0, "q": [0.1, 0.2]}, …], or one frame a line   columns t, q[0], q[1]
{"frames": [{"joints": {"j1": {"pos": 0.1}}}, …]}       joints.j1.pos
{"t": [0.0, …], "q": [[0.1, 0.2], …]}                   t, q_1, q_2
position: - 0.1 - 0.2 --- (in lines of their own)       position[0], position[1]
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pipelines.errors import Check, EnvironmentFault, InputRejected, UsageError, clean
from pipelines.importers import matlab, npy
from pipelines.importers.config import ARRAYS
from pipelines.importers.raw import (
    Anything,
    RawTable,
    columns_of_arrays,
    flatten,
    notes_of,
    unstacked,
)
from pipelines.importers.recipe import TextFormat
from pipelines.importers.text import read_text
from pipelines.io.limits import FEWEST
from pipelines.io.log import Array
from pipelines.io.output import fault_of
from pipelines.io.sandbox import Answer, guarded, regular_file

_REFUSED = (
    (b"PK\x03\x04", "X12", "an archive (zip or xlsx)", "unpack it, or export the sheet as CSV"),
    (b"\x1f\x8b", "X12", "a gzip archive", "unpack it"),
    (b"\xd0\xcf\x11\xe0", "F06", "an old spreadsheet", "export the sheet as CSV"),
    (b"#ROSBAG", "F06", "a bag of ROS 1",
     "export its topics: rostopic echo -b FILE -p /joint_states > run.csv"),
    (b"\x89MCAP0", "F06", "an MCAP file", "export its topics as CSV or JSON"),
    (b"SQLite format 3", "F06", "a data base, such as a bag of ROS 2",
     "export its topics or tables as CSV"),
    (b"TDSm", "F06", "a TDMS file of LabVIEW", "export it as CSV, or save it as MAT"),
    (b"ARROW1", "F06", "an Arrow (Feather) file", "save it as Parquet"),
)  # fmt: skip
_PICKLES = (b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?|nan|[+-]?inf", re.IGNORECASE)


@dataclass(frozen=True)
class Reader:
    """How files of one kind are known and read: a new kind is a module and an entry in `READERS`.

    `read(data, path, source)` returns named arrays or nested documents of them, the samples among
    them, with units in brackets behind names and metadata as texts and single numbers; or a table.
    """

    kind: str
    magic: tuple[bytes, ...]  # first bytes, any of them
    endings: tuple[str, ...]
    read: Callable[[bytes, Path, str], Mapping[str, Any] | RawTable]
    library: Callable[[], object] | None = None  # imports it; it is then used in a child process


def _scipy() -> object:
    import scipy.io

    return scipy.io


def _h5py() -> object:
    import h5py

    return h5py


def _pyarrow() -> object:
    import pyarrow.compute
    import pyarrow.parquet

    return pyarrow.parquet


READERS = (
    Reader("npy", (b"\x93NUMPY",), (".npy",), lambda data, _, source: npy.read_npy(data, source)),
    Reader("npz", (), (".npz",), lambda data, _, source: npy.read_npz(data, source), lambda: None),
    Reader("parquet", (b"PAR1",), (".parquet",),
           lambda data, _, source: npy.read_parquet(data, source), _pyarrow),
    Reader("mat73", (b"\x89HDF\r\n\x1a\n", b"MATLAB 7.3"), (".mat", ".h5", ".hdf5"),
           lambda _, path, source: matlab.read_hdf5(path, source), _h5py),
    Reader("mat5", (b"MATLAB 5.0",), (".mat",),
           lambda data, _, source: matlab.read_mat5(data, source), _scipy),
    Reader("json", (), (".json", ".jsonl"), lambda data, _, source: read_json(data, source)),
    Reader("text", (), (), lambda data, _, source: read_text(data, source)),
)  # fmt: skip


def read_table(path: Path, text: TextFormat | None = None, name: str = "") -> RawTable:
    """Return everything numeric in a recorded file; messages call it `name`.

    Raises:
        InputRejected: the file is damaged, hostile or holds no table; the code says which.
        EnvironmentFault: no permission.
    """
    data, source = _bytes_of(path), name or path.name
    reader = _reader_of(data, source)
    if reader.kind == "text":
        detect = text in (None, TextFormat()) and len(data) <= ARRAYS.largest_json
        table = (read_yaml(data, source) if detect else None) or read_text(data, source, text)
    elif reader.library is not None:
        reader.library()  # before the fork, so that every child has it
        table = _in_child(lambda: _table(reader.read(data, path, source), source), path, source)
    else:
        table = _table(reader.read(data, path, source), source)
    longest = max((*table.columns, *table.text, ""), key=len)
    if len(longest) > ARRAYS.longest_name:
        message = f"the name of a column has {len(longest)} characters, {longest[:40]} …"
        remedy = "export the table with a header of short names"
        raise InputRejected("F16", message, where=source, remedy=remedy)
    table = unstacked(table)
    checks, ending = table.checks, path.suffix.lower()
    foreign = reader.kind != "text" or any(ending in other.endings for other in READERS)
    if ending not in reader.endings and foreign:
        message = f"named '{path.suffix}', but its content is {reader.kind}; read as that"
        checks = (Check.of("F06", "warn", message, where=source, remedy="rename it"), *checks)
    return replace(table, checks=checks, sha256=hashlib.sha256(data).hexdigest())


def _table(content: Mapping[str, Any] | RawTable, source: str) -> RawTable:
    return content if isinstance(content, RawTable) else table_of_document(content, source)


def _bytes_of(path: Path) -> bytes:
    """Return the whole file.

    Raises:
        InputRejected: X05, larger than a recording. EnvironmentFault: F15, a logger holds it.
    """
    status = regular_file(path)
    if status.st_size > ARRAYS.largest_file:
        message = f"{status.st_size} bytes; import reads files up to {ARRAYS.largest_file}"
        raise InputRejected("X05", message, where=path, remedy="split the recording")
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(handle, "rb") as file:
            try:
                fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                message, remedy = "in use by another process", "wait until the recording is done"
                raise EnvironmentFault("F15", message, where=path, remedy=remedy) from None
            except OSError:
                pass  # a file system without locks cannot say
            data = file.read(status.st_size + 1)  # as much is allocated as is asked for
            if len(data) > status.st_size:  # it has grown meanwhile
                data += file.read(ARRAYS.largest_file + 1 - len(data))
    except OSError as problem:
        raise fault_of(problem, path) from None
    return data


def _reader_of(data: bytes, source: str) -> Reader:
    """F06: return the reader of a file by its first bytes."""
    kinds = {reader.kind: reader for reader in READERS}
    name = source.lower()
    if data.startswith(b"PK\x03\x04") and name.endswith(".npz"):
        return kinds["npz"]
    for magic, code, what, remedy in _REFUSED:
        if data.startswith(magic):
            kind = UsageError if code == "X12" else InputRejected
            raise kind(code, f"{what}, not a recording", where=source, remedy=remedy)
    if data.startswith(_PICKLES):
        message, remedy = "a pickle, which is never opened", "save plain numbers as NPY or CSV"
        raise InputRejected("X07", message, where=source, remedy=remedy)
    for reader in READERS:
        if reader.magic and data.startswith(reader.magic):
            return reader
    if name.endswith(".mat") and len(data) > ARRAYS.mat4_header and b"\0" in data[:4]:
        return kinds["mat5"]  # version 4
    # JSON begins a list of lists or objects, or an object.
    head = data[:256].lstrip(b"\xef\xbb\xbf \t\r\n").translate(None, b" \r\n")
    return kinds["json" if head.startswith((b'{"', b"[{", b"[[", b"{}", b"[]")) else "text"]


def _in_child(read: Callable[[], RawTable], path: Path, source: str) -> RawTable:
    """Return the table, read where a crash or a flood of memory costs a child process only."""

    def work() -> Answer:
        table = read()
        about = {
            "names": list(table.columns),
            "text": dict(table.text),
            "units": dict(table.units),
            "notes": list(table.notes),
            "groups": {name: list(columns) for name, columns in table.groups.items()},
            "checks": [check.as_dict() for check in table.checks],
        }
        return Answer(about, {str(i): x for i, x in enumerate(table.columns.values())})

    try:
        answer = guarded(work, path)
        about = answer.about
        columns = {name: np.asarray(answer.arrays[str(i)]) for i, name in enumerate(about["names"])}
        return RawTable(
            source,
            columns,
            np.arange(len(next(iter(columns.values())))),
            text=about["text"],
            units=about["units"],
            notes=tuple(about["notes"]),
            groups={key: tuple(names) for key, names in about["groups"].items()},
            checks=tuple(Check(**check) for check in about["checks"]),
        )
    except InputRejected as problem:
        if problem.code == "RRID-F03":  # however it was damaged and the library took it
            raise matlab.damaged_mat(source) from None
        raise
    except (KeyError, TypeError, AttributeError, StopIteration):  # of a child that a file broke
        raise matlab.damaged_mat(source) from None


def read_json(data: bytes, source: str) -> RawTable:
    """Return the table of a JSON recording.

    Raises:
        InputRejected: F08 no JSON, S12 no samples, X05 too large.
    """
    if len(data) > ARRAYS.largest_json:
        message = f"{len(data)} bytes of JSON; import reads up to {ARRAYS.largest_json}"
        remedy = "split the recording, or save it as CSV or NPY"
        raise InputRejected("X05", message, where=source, remedy=remedy)
    try:
        text = data.decode("utf-8-sig")
        try:
            document = json.loads(text)
        except json.JSONDecodeError:
            document = [json.loads(line) for line in text.splitlines() if line.strip()]
    except (ValueError, RecursionError) as problem:
        message = f"not valid JSON: {problem}"
        remedy = "copy the file again, or end the recording before it is copied"
        raise InputRejected("F08", message, where=source, remedy=remedy) from None
    document = _frame_of_pandas(document)
    frames = _frames(document, ARRAYS.deepest)
    if frames is None:
        return table_of_document(document, source)
    around = flatten(_without(document, frames)) if document is not frames else ()
    arrays = ((path, _array(value)) for path, value in around)
    notes = notes_of({path: array for path, array in arrays if array is not None})
    return _table_of_frames(frames, source, notes)


def _frame_of_pandas(document: Any) -> Any:
    """Return a frame that pandas wrote as an array of each column; anything else unchanged."""
    if not isinstance(document, dict) or not document:
        return document
    names, rows = document.get("columns"), document.get("data")
    if isinstance(names, list) and isinstance(rows, list) and rows:
        if all(isinstance(row, list) and len(row) == len(names) for row in rows):
            return dict(zip(map(str, names), map(list, zip(*rows, strict=True)), strict=True))
        return document
    numbered = all(
        isinstance(column, dict) and column and all(key.isdecimal() for key in column)
        for column in document.values()
    )
    return {k: list(column.values()) for k, column in document.items()} if numbered else document


def _frames(value: Any, depth: int) -> list[Mapping[str, Any]] | None:
    """Return the longest list of objects in the document."""
    if isinstance(value, list):
        enough = len(value) >= FEWEST and all(isinstance(item, dict) for item in value)
        return value if enough else None
    if not isinstance(value, dict) or depth == 0:
        return None
    found = [frames for item in value.values() if (frames := _frames(item, depth - 1)) is not None]
    return max(found, key=len, default=None)


def _without(document: Any, frames: object) -> Any:
    if not isinstance(document, dict):
        return document
    return {k: _without(item, frames) for k, item in document.items() if item is not frames}


def table_of_document(document: Any, source: str) -> RawTable:
    """Return the table of nested arrays by name.

    Raises:
        InputRejected: S03 two series of one name, S12 no samples.
    """
    arrays: dict[str, Anything] = {}
    for name, value in flatten(document):
        array = _array(value)
        if array is None:
            continue
        if name in arrays:
            message = f"two series are both named '{clean(name, 80)}'"
            remedy = "rename one of them in the file"
            raise InputRejected("S03", message, where=source, remedy=remedy)
        arrays[name] = array
    if not arrays:
        remedy = "save a list of frames, or one array a signal"
        message = "no list of samples in the file"
        raise InputRejected("S12", message, where=source, remedy=remedy)
    return columns_of_arrays(arrays, source)


def _array(value: Any) -> Anything | None:
    """Return an array of numbers or of texts; None of anything else."""
    if isinstance(value, np.ndarray):
        return value if value.dtype.kind != "V" else None  # records
    if isinstance(value, str | int | float):
        return np.array(value) if not isinstance(value, int) or abs(value) < 2**63 else None
    if not isinstance(value, list):
        return None
    try:
        return np.array(value, np.str_ if isinstance(value[0], str) else np.float64)
    except (ValueError, TypeError, OverflowError, IndexError):
        return None


def _table_of_frames(
    frames: Sequence[Mapping[str, Any]], source: str, notes: tuple[str, ...] = ()
) -> RawTable:
    columns: dict[str, Array] = {}
    groups: dict[str, list[str]] = {}
    texts: dict[str, list[str]] = {}
    for i, frame in enumerate(frames):
        for path, group, value in _cells(frame, "", ARRAYS.deepest):
            if isinstance(value, str):
                texts.setdefault(path, []).append(value[: ARRAYS.longest_text])
            elif isinstance(value, int | float):
                if path not in columns:
                    columns[path] = np.full(len(frames), np.nan)
                    groups.setdefault(group, []).append(path)
                columns[path][i] = value if abs(value) < ARRAYS.largest_number else np.inf
        if len(columns) > ARRAYS.most_columns:
            message = f"more than {ARRAYS.most_columns} numbers in a frame"
            remedy = "save the signals of the joints alone"
            raise InputRejected("X05", message, where=source, remedy=remedy)
    if not columns:
        message, remedy = "the frames hold no numbers", "save the samples as numbers"
        raise InputRejected("S12", message, where=source, remedy=remedy)
    return RawTable(
        source,
        columns,
        np.arange(len(frames)),
        labels={k: x[0] for k, x in texts.items() if len(x) == len(frames) and len({*x}) == 1},
        groups={name: tuple(paths) for name, paths in groups.items() if paths != [name]},
        text={path: found[0][:40] for path, found in texts.items() if path not in columns},
        notes=notes,
    )


def _cells(value: Any, path: str, depth: int) -> Iterator[tuple[str, str, Any]]:
    """Yield (path, group, value) of every number and text of a frame.

    Lists within an object of a list are left out, unless a list of texts, as long and without
    duplicates, names their numbers: values[effort] of ROS 2's DynamicJointState.
    """
    if isinstance(value, dict):
        for key, item in value.items() if depth else ():
            yield from _cells(item, f"{path}.{key}".lstrip("."), depth - 1)
    elif not isinstance(value, list):
        yield path, path, value
    else:
        for k, item in enumerate(value):
            if isinstance(item, dict):
                for inner, cell in flatten(_by_names(item), f"{path}[{k}]"):
                    if not isinstance(cell, list):
                        yield inner, inner, cell
            elif not isinstance(item, list):
                yield f"{path}[{k}]", path, item


def _by_names(item: dict[str, Any]) -> dict[str, Any]:
    """Return an object without its lists, or with a key for each number that one of them names."""
    rest = {key: value for key, value in item.items() if not isinstance(value, list)}
    lists = [(key, value) for key, value in item.items() if isinstance(value, list)]
    lists.sort(key=lambda pair: not all(isinstance(x, str) for x in pair[1]))
    if len(lists[1:]) == 1:
        (_, texts), (key, numbers) = lists
        if all(isinstance(x, str) for x in texts) and len(set(texts)) == len(texts) == len(numbers):
            return rest | {f"{key}[{x}]": y for x, y in zip(texts, numbers, strict=True)}
    return rest


def read_yaml(data: bytes, source: str) -> RawTable | None:
    """Return the table of YAML documents of mappings and lists of scalars; None of other text."""
    first = re.match(rb"(---\r?\n)?[A-Za-z_]\w*:( \S.*)?\r?\n", data[:300])
    if first is None or data.count(b"\n---") <= 1:
        return None
    frames: list[dict[str, Any]] = []
    for part in re.split(r"(?m)^---\s*$", data.decode("utf-8", "replace")):
        frames.append({})
        path, holder, name = [(-1, frames[-1])], frames[-1], ""  # of the last key
        for line in part.splitlines():
            found = re.fullmatch(r"( *)(?:(- )\s*(.*)|([\w/.]+):(?: (.*))?)", line)
            if found is None:
                continue
            value = ((found[3] if found[2] else found[5]) or "").strip()
            scalar = float(value) if _NUMBER.fullmatch(value) else value.strip("'\"")
            if found[2]:
                if not isinstance(holder.get(name), list):
                    holder[name] = []
                holder[name].append(scalar)
                continue
            while path[-1][0] >= len(found[1]):
                path.pop()
            holder, name = path[-1][1], found[4]
            holder[name] = scalar if value else {}
            if not value:
                path.append((len(found[1]), holder[name]))
    return _table_of_frames([frame for frame in frames if frame], source)
