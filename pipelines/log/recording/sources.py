"""Read a recorded file by what it is, not by what it is called: text, JSON, NPY, NPZ, Parquet, MAT v5 or v7.3."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipelines.errors import Check, EnvironmentFault, InputRejected, UsageError
from pipelines.log.atomic import fault_of
from pipelines.log.files import regular_file
from pipelines.log.guard import Answer, guarded
from pipelines.log.recording.arrays import read_npy, read_npz, read_parquet
from pipelines.log.recording.dialect import TextFormat
from pipelines.log.recording.json_table import is_json, read_json, table_of_frames
from pipelines.log.recording.labelled import yaml_documents
from pipelines.log.recording.matlab import damaged, read_mat5, read_mat73
from pipelines.log.recording.raw import RawTable, columns_of_arrays, unstacked
from pipelines.log.recording.tabular import read_text

__all__ = ["read_table"]

_LARGEST = 2 << 30  # [B]
_LARGEST_YAML = 200_000_000  # [B], as of JSON
_ENDINGS = {
    "npy": (".npy",),
    "npz": (".npz",),
    "parquet": (".parquet",),
    "json": (".json", ".jsonl"),
    "text": (),
    "mat5": (".mat",),
    "mat73": (".mat", ".h5", ".hdf5"),
}
_REFUSED = (
    (b"PK\x03\x04", "X12", "an archive (zip or xlsx)", "unpack it, or export the sheet as CSV"),
    (b"\x1f\x8b", "X12", "a gzip archive", "unpack it"),
    (b"\xd0\xcf\x11\xe0", "F06", "an old spreadsheet", "export the sheet as CSV"),
    (
        b"#ROSBAG",
        "F06",
        "a bag of ROS 1",
        "export its topics: rostopic echo -b FILE -p /joint_states > run.csv",
    ),
    (b"\x89MCAP0", "F06", "an MCAP file", "export its topics as CSV or JSON"),
    (
        b"SQLite format 3",
        "F06",
        "a data base, such as a bag of ROS 2",
        "export its topics or tables as CSV",
    ),
    (b"TDSm", "F06", "a TDMS file of LabVIEW", "export it as CSV, or save it as MAT"),
    (b"ARROW1", "F06", "an Arrow (Feather) file", "save it as Parquet"),
)


def read_table(path: Path, text: TextFormat | None = None, name: str = "") -> RawTable:
    """Everything numeric in a recorded file; `name` is what messages call it, such as its path below the source folder.

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
    table = unstacked(_read(kind, data, path, source, text))
    checks = table.checks
    named = {ending: what for what, endings in _ENDINGS.items() for ending in endings}.get(
        path.suffix.lower(), "text"
    )
    if path.suffix.lower() not in _ENDINGS[kind] and named != kind:
        checks = (
            Check.of(
                "F06",
                "warn",
                f"named '{path.suffix}', but its content is {kind}; read as that",
                where=source,
                remedy="rename it",
            ),
            *checks,
        )
    return replace(table, checks=checks, sha256=hashlib.sha256(data).hexdigest())


def _refuse_locked(handle: int, path: Path) -> None:
    """F15: a file that a logger holds is still being written."""
    import fcntl

    try:
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        message = "in use by another process"
        remedy = "wait until the recording is finished"
        raise EnvironmentFault("F15", message, where=path, remedy=remedy) from None
    except OSError:
        return  # a file system without locks cannot say


def _kind(data: bytes, source: str) -> str:
    """F06: what the first bytes say."""
    if data.startswith(b"PK\x03\x04") and source.lower().endswith(".npz"):
        return "npz"
    for magic, code, what, remedy in _REFUSED:
        if data.startswith(magic):
            raise (UsageError if code == "X12" else InputRejected)(
                code, f"{what}, not a recording", where=source, remedy=remedy
            )
    if data.startswith(b"\x93NUMPY"):
        return "npy"
    if data.startswith(b"PAR1"):
        return "parquet"
    if data[:1] == b"\x80" and data[1:2] in (b"\x02", b"\x03", b"\x04", b"\x05"):
        message = "a pickle, which is never opened"
        raise InputRejected("X07", message, where=source, remedy="save plain numbers as NPY or CSV")
    if data.startswith(b"\x89HDF\r\n\x1a\n") or data.startswith(b"MATLAB 7.3"):
        return "mat73"
    if data.startswith(b"MATLAB 5.0") or _is_mat4(data, source):
        return "mat5"
    return "json" if is_json(data) else "text"


def _is_mat4(data: bytes, source: str) -> bool:
    return source.lower().endswith(".mat") and len(data) > 20 and b"\0" in data[:4]


def _read(kind: str, data: bytes, path: Path, source: str, text: TextFormat | None) -> RawTable:
    if kind == "text":
        documents = (
            yaml_documents(data)
            if text in (None, TextFormat()) and len(data) <= _LARGEST_YAML
            else None
        )
        return (
            read_text(data, source, text)
            if documents is None
            else table_of_frames(documents, source)
        )
    if kind == "json":
        return read_json(data, source)
    if kind == "npy":
        return columns_of_arrays(read_npy(data, source), source)
    if kind == "npz":
        return _in_child(lambda: columns_of_arrays(read_npz(data, source), source), path, source)
    if kind == "parquet":
        import pyarrow.compute
        import pyarrow.parquet  # noqa: F401

        return _in_child(
            lambda: columns_of_arrays(read_parquet(data, source), source), path, source
        )
    if kind == "mat5":
        import scipy.io  # noqa: F401  imported before the fork, so that every child has it

        return _in_child(lambda: columns_of_arrays(read_mat5(data, source), source), path, source)
    import h5py  # noqa: F401

    return _in_child(lambda: columns_of_arrays(read_mat73(path, source), source), path, source)


def _in_child(read: Callable[[], RawTable], path: Path, source: str) -> RawTable:
    """The table, read where a crash or a flood of memory costs a child process only."""

    def work() -> Answer:
        table = read()
        about = {
            "names": list(table.columns),
            "text": dict(table.text),
            "units": dict(table.units),
            "notes": list(table.notes),
            "groups": {k: list(v) for k, v in table.groups.items()},
            "checks": [check.as_dict() for check in table.checks],
        }
        return Answer(about, {str(i): values for i, values in enumerate(table.columns.values())})

    try:
        answer = guarded(work, path)
    except InputRejected as problem:
        # However it was damaged, and however the library took it: one message (F08).
        if problem.code == "RRID-F03":
            raise damaged(source) from None
        raise
    try:
        return _told(answer, source)
    except (
        KeyError,
        TypeError,
        AttributeError,
        StopIteration,
    ):  # a child that a file has broken says anything
        raise damaged(source) from None


def _told(answer: Answer, source: str) -> RawTable:
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
