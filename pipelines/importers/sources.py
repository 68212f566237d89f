"""Read a recorded file by its content: text, JSON, YAML, NPY, NPZ, Parquet or MAT.

Documents are read here; tables of text and files of arrays have modules of their own. JSON holds
frames or arrays by name, the YAML of `ros2 topic echo` frames:

[{"t": 0.0, "q": [0.1, 0.2]}, …], or one frame a line   columns t, q[0], q[1]
{"frames": [{"joints": {"j1": {"pos": 0.1}}}, …]}       joints.j1.pos
{"t": [0.0, …], "q": [[0.1, 0.2], …]}                   t, q_1, q_2
position: - 0.1 - 0.2 --- (in lines of their own)       position[0], position[1]
"""

from __future__ import annotations

import hashlib
import itertools
import json
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pipelines.errors import Check, EnvironmentFault, InputRejected, UsageError
from pipelines.importers import array_files
from pipelines.importers.raw import (
    Arrays,
    RawTable,
    columns_of_arrays,
    described,
    distinct,
    unstacked,
)
from pipelines.importers.recipe import TextFormat
from pipelines.importers.tables import LABELLED_VALUE, read_text
from pipelines.io.atomic import fault_of
from pipelines.io.experiment import Array
from pipelines.io.files import regular_file
from pipelines.io.guard import Answer, guarded
from pipelines.io.limits import FEWEST

__all__ = ["read_table"]

_LARGEST = 2 << 30  # [B]
_LARGEST_JSON = 200_000_000  # [bytes]; parsed, JSON takes about ten times its size
_DEEPEST = 8  # levels of names within a frame
_MOST_COLUMNS = 2000
_MOST_NOTES = 200
_ENDINGS = {
    "npy": (".npy",), "npz": (".npz",), "parquet": (".parquet",), "json": (".json", ".jsonl"),
    "text": (), "mat5": (".mat",), "mat73": (".mat", ".h5", ".hdf5"),
}  # fmt: skip
_KIND_OF_ENDING = {ending: kind for kind, endings in _ENDINGS.items() for ending in endings}
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
_KINDS = (
    (b"\x93NUMPY", "npy"), (b"PAR1", "parquet"), (b"\x89HDF\r\n\x1a\n", "mat73"),
    (b"MATLAB 7.3", "mat73"), (b"MATLAB 5.0", "mat5"),
)  # fmt: skip
_LONGEST = 1000  # characters of a column's name
_PICKLES = (b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05")


def read_table(path: Path, text: TextFormat | None = None, name: str = "") -> RawTable:
    """Return everything numeric in a recorded file; messages call it `name`.

    Raises:
        InputRejected: the file is damaged, hostile or holds no table; the code says which.
        EnvironmentFault: no permission.
    """
    status = regular_file(path)
    if status.st_size > _LARGEST:
        message = f"{status.st_size} bytes; import reads files up to {_LARGEST}"
        raise InputRejected("X05", message, where=path, remedy="split the recording")
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(handle, "rb") as file:
            _refuse_locked(handle, path)
            data = file.read(status.st_size + 1)  # as much is allocated as is asked for
            if len(data) > status.st_size:  # it has grown meanwhile
                data += file.read(_LARGEST + 1 - len(data))
    except OSError as problem:
        raise fault_of(problem, path) from None
    source = name or path.name
    kind = _kind(data, source)
    table = _read(kind, data, path, source, text)
    if (longest := max((*table.columns, *table.text, ""), key=len)) and len(longest) > _LONGEST:
        message = f"the name of a column has {len(longest)} characters, {longest[:40]} …"
        raise InputRejected("F16", message, where=source, remedy="export the table with a header of short names")
    table = unstacked(table)
    checks = table.checks
    ending = path.suffix.lower()
    if ending not in _ENDINGS[kind] and _KIND_OF_ENDING.get(ending, "text") != kind:
        message = f"named '{path.suffix}', but its content is {kind}; read as that"
        checks = (Check.of("F06", "warn", message, where=source, remedy="rename it"), *checks)
    return replace(table, checks=checks, sha256=hashlib.sha256(data).hexdigest())


def _refuse_locked(handle: int, path: Path) -> None:
    """F15: a file that a logger holds is still being written."""
    import fcntl

    try:
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        message, remedy = "in use by another process", "wait until the recording is finished"
        raise EnvironmentFault("F15", message, where=path, remedy=remedy) from None
    except OSError:
        return  # a file system without locks cannot say


def _kind(data: bytes, source: str) -> str:
    """F06: return the kind of a file by its first bytes."""
    if data.startswith(b"PK\x03\x04") and source.lower().endswith(".npz"):
        return "npz"
    for magic, code, what, remedy in _REFUSED:
        if data.startswith(magic):
            kind = UsageError if code == "X12" else InputRejected
            raise kind(code, f"{what}, not a recording", where=source, remedy=remedy)
    if data.startswith(_PICKLES):
        message, remedy = "a pickle, which is never opened", "save plain numbers as NPY or CSV"
        raise InputRejected("X07", message, where=source, remedy=remedy)
    for magic, name in _KINDS:
        if data.startswith(magic):
            return name
    if source.lower().endswith(".mat") and len(data) > 20 and b"\0" in data[:4]:
        return "mat5"  # version 4
    return "json" if _is_json(data) else "text"


def _read(kind: str, data: bytes, path: Path, source: str, text: TextFormat | None) -> RawTable:
    if kind == "text":
        detect = text in (None, TextFormat()) and len(data) <= _LARGEST_JSON
        if detect and (documents := _yaml_documents(data)) is not None:
            return _table_of_frames(documents, source)
        return read_text(data, source, text)
    if kind == "json":
        return _read_json(data, source)
    if kind == "npy":
        return columns_of_arrays(array_files.read_npy(data, source), source)
    # Libraries are imported before the fork, so that every child has them.
    if kind == "npz":
        return _in_child(lambda: array_files.read_npz(data, source), path, source)
    if kind == "parquet":
        import pyarrow.compute
        import pyarrow.parquet  # noqa: F401

        return _in_child(lambda: array_files.read_parquet(data, source), path, source)
    if kind == "mat5":
        import scipy.io  # noqa: F401

        return _in_child(lambda: array_files.read_mat5(data, source), path, source)
    import h5py  # noqa: F401

    return _in_child(lambda: array_files.read_mat73(path, source), path, source)


def _in_child(read: Callable[[], Arrays], path: Path, source: str) -> RawTable:
    """Return the table, read where a crash or a flood of memory costs a child process only."""

    def work() -> Answer:
        table = columns_of_arrays(read(), source)
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
    except InputRejected as problem:
        if problem.code == "RRID-F03":  # however it was damaged and the library took it
            raise array_files.damaged_mat(source) from None
        raise
    try:
        return _table_of(answer, source)
    except (KeyError, TypeError, AttributeError, StopIteration):  # of a child that a file broke
        raise array_files.damaged_mat(source) from None


def _table_of(answer: Answer, source: str) -> RawTable:
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


def _is_json(data: bytes) -> bool:
    """Return whether the file begins as JSON does: a list of lists or objects, or an object."""
    head = data[:256].lstrip(b"\xef\xbb\xbf \t\r\n").translate(None, b" \r\n")
    return head.startswith((b'{"', b"[{", b"[[", b"{}", b"[]"))


def _read_json(data: bytes, source: str) -> RawTable:
    """Return the table of a JSON recording."""
    if len(data) > _LARGEST_JSON:
        message = f"{len(data)} bytes of JSON; import reads up to {_LARGEST_JSON}"
        remedy = "split the recording, or save it as CSV or NPY"
        raise InputRejected("X05", message, where=source, remedy=remedy)
    document = _of_pandas(_parsed(data, source))
    notes = tuple(itertools.islice(_notes(document), _MOST_NOTES))
    if (frames := _frames(document, _DEEPEST)) is not None:
        return replace(_table_of_frames(frames, source), notes=notes)
    arrays: dict[str, Array] = {}
    for name, value in _series(document, "", _DEEPEST):
        if (values := _array(value)) is not None:
            arrays[distinct(name, arrays, source)] = values
    if not arrays:
        remedy = "save a list of frames, or one array a signal"
        raise InputRejected(
            "S12", "no list of samples in the JSON file", where=source, remedy=remedy
        )
    table = columns_of_arrays(arrays, source)
    return replace(table, notes=(*table.notes, *notes))


def _notes(document: Any) -> Iterator[str]:
    """Yield "metadata.physics_dt = 0.005" of every number and text outside the samples."""
    for path, value in _named(document, "", _DEEPEST) if isinstance(document, dict) else ():
        if isinstance(value, int | float | str):
            yield f"{path} = {value}"
        elif isinstance(value, list) and value and all(isinstance(item, str) for item in value):
            yield f"{path} = {' '.join(value)}"


def _of_pandas(document: Any) -> Any:
    """Return a frame that pandas wrote as one array a column; anything else as it is."""
    if not isinstance(document, dict) or not document:
        return document
    names, rows = document.get("columns"), document.get("data")
    if (
        isinstance(names, list)
        and isinstance(rows, list)
        and all(isinstance(n, str) for n in names)
    ):
        alike = all(isinstance(row, list) and len(row) == len(names) for row in rows)
        columns = map(list, zip(*rows, strict=True)) if alike and rows else None
        return document if columns is None else dict(zip(names, columns, strict=True))
    numbered = all(
        isinstance(column, dict) and column and all(key.isdecimal() for key in column)
        for column in document.values()
    )
    return {k: list(column.values()) for k, column in document.items()} if numbered else document


def _parsed(data: bytes, source: str) -> Any:
    try:
        text = data.decode("utf-8-sig")
        try:
            return json.loads(text)
        except json.JSONDecodeError:
            return [json.loads(line) for line in text.splitlines() if line.strip()]
    except (ValueError, RecursionError) as problem:
        message = f"not valid JSON: {problem}"
        remedy = "copy the file again, or end the recording before it is copied"
        raise InputRejected("F08", message, where=source, remedy=remedy) from None


def _frames(value: Any, depth: int) -> list[Mapping[str, Any]] | None:
    """Return the longest list of objects in the document."""
    if isinstance(value, list):
        enough = len(value) >= FEWEST and all(isinstance(item, dict) for item in value)
        return value if enough else None
    if not isinstance(value, dict) or depth == 0:
        return None
    found = [frames for item in value.values() if (frames := _frames(item, depth - 1)) is not None]
    return max(found, key=len, default=None)


def _named(value: Any, path: str, depth: int) -> Iterator[tuple[str, Any]]:
    """Yield (path, value) of everything in nested objects that is no object itself."""
    if isinstance(value, dict) and depth > 0:
        for key, item in value.items():
            yield from _named(item, f"{path}.{key}" if path else str(key), depth - 1)
    elif not isinstance(value, dict):
        yield path or "column", value


def _series(value: Any, path: str, depth: int) -> Iterator[tuple[str, Any]]:
    """Yield (path, value) as `_named` does; samples in an object with a name go by it."""
    if isinstance(value, list) and depth > 0 and value and all(isinstance(x, dict) for x in value):
        for k, item in enumerate(value):
            yield from _series(item, f"{path}[{k}]", depth - 1)
    elif isinstance(value, dict) and depth > 0:
        name = described(value)
        for key, item in value.items():
            if name and isinstance(item, list):
                yield name, item
            else:
                yield from _series(item, f"{path}.{key}" if path else str(key), depth - 1)
    elif not isinstance(value, dict):
        yield path or "column", value


def _array(value: Any) -> Array | None:
    if not isinstance(value, list) or len(value) < FEWEST:
        return None
    try:
        return np.array(value, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        return None


def _cells(frame: Mapping[str, Any]) -> Iterator[tuple[str, str, Any]]:
    """Yield (path, group, value) of every number and text of a frame.

    Lists within an object of a list are left out, unless a list of texts, as long and without
    duplicates, names their numbers: values[effort] of ROS 2's DynamicJointState.
    """
    for path, value in _named(frame, "", _DEEPEST):
        if not isinstance(value, list):
            yield path, path, value
            continue
        for k, item in enumerate(value):
            if isinstance(item, dict):
                for inner, cell in _named(_by_names(item), f"{path}[{k}]", _DEEPEST):
                    if not isinstance(cell, list):
                        yield inner, inner, cell
            elif not isinstance(item, list):
                yield f"{path}[{k}]", path, item


def _by_names(item: dict[str, Any]) -> dict[str, Any]:
    """Return an object with a key for each number that its list of texts names; else as it is."""
    lists = {key: value for key, value in item.items() if isinstance(value, list)}
    texts = [v for v in lists.values() if v and all(isinstance(x, str) for x in v)]
    if len(lists) != 2 or len(texts) != 1 or len(set(texts[0])) != len(texts[0]):
        return item
    key, numbers = next((key, value) for key, value in lists.items() if value is not texts[0])
    if len(numbers) != len(texts[0]):
        return item
    rest = {name: value for name, value in item.items() if name not in lists}
    return rest | {f"{key}[{x}]": number for x, number in zip(texts[0], numbers, strict=True)}


def _table_of_frames(frames: Sequence[Mapping[str, Any]], source: str) -> RawTable:
    columns: dict[str, Array] = {}
    groups: dict[str, list[str]] = {}
    texts: dict[str, list[str]] = {}
    for i, frame in enumerate(frames):
        for path, group, value in _cells(frame):
            if isinstance(value, str):
                texts.setdefault(path, []).append(value[:200])
            elif isinstance(value, int | float):
                if path not in columns:
                    if len(columns) == _MOST_COLUMNS:
                        message = f"more than {_MOST_COLUMNS} numbers in a frame"
                        remedy = "save the signals of the joints alone"
                        raise InputRejected("X05", message, where=source, remedy=remedy)
                    columns[path] = np.full(len(frames), np.nan)
                    groups.setdefault(group, []).append(path)
                columns[path][i] = _real(value)
    if not columns:
        remedy = "save the samples as numbers"
        raise InputRejected("S12", "the frames hold no numbers", where=source, remedy=remedy)
    constant = [
        k for k, all_of in texts.items() if len(all_of) == len(frames) and len(set(all_of)) == 1
    ]
    return RawTable(
        source,
        columns,
        np.arange(len(frames)),
        labels={path: texts[path][0] for path in constant},
        groups={name: tuple(paths) for name, paths in groups.items() if paths != [name]},
        text={path: found[0][:40] for path, found in texts.items() if path not in columns},
    )


def _real(value: float) -> float:
    try:
        return float(value)
    except OverflowError:  # an integer of hundreds of digits
        return float("inf")


def _yaml_documents(data: bytes) -> list[dict[str, Any]] | None:
    """Return YAML documents of mappings and lists of scalars; None where it is no such text."""
    first = re.match(rb"(---\r?\n)?[A-Za-z_]\w*:( \S.*)?\r?\n", data[:300])
    if first is None or data.count(b"\n---") < 2:
        return None
    text = data.decode("utf-8", "replace").replace("\r\n", "\n")
    return [_yaml(part) for part in re.split(r"(?m)^---[^\S\n]*$", text) if part.strip()]


def _yaml(text: str) -> dict[str, Any]:
    root: dict[str, Any] = {}
    path: list[tuple[int, dict[str, Any]]] = [(-1, root)]
    holder, name = root, ""  # of the last key
    for line in text.split("\n"):
        found = re.fullmatch(r"( *)(?:(- )\s*(.*)|([\w/.]+):(?: (.*))?)", line)
        if found is None:
            continue
        value = ((found[3] if found[2] else found[5]) or "").strip()
        if found[2]:
            if not isinstance(holder.get(name), list):
                holder[name] = []
            holder[name].append(_scalar(value))
            continue
        while path[-1][0] >= len(found[1]):
            path.pop()
        holder, name = path[-1][1], found[4]
        holder[name] = _scalar(value) if value else {}
        if not value:
            path.append((len(found[1]), holder[name]))
    return root


def _scalar(text: str) -> Any:
    if LABELLED_VALUE.fullmatch(text) and ":" not in text:
        whole = "." not in text and text.lstrip("+-").isdecimal()
        return int(text) if whole else float(text)
    return text.strip("'\"")
