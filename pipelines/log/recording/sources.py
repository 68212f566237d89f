"""Read a recorded file by its content, whatever its name: text, JSON, NPY, NPZ, Parquet or MAT."""

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
from pipelines.log.recording import array_files, frames
from pipelines.log.recording.raw import Arrays, RawTable, columns_of_arrays, unstacked
from pipelines.log.recording.recipe import TextFormat
from pipelines.log.recording.tables import read_text

__all__ = ["read_table"]

_LARGEST = 2 << 30  # [B]
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
    table = unstacked(_read(kind, data, path, source, text))
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
    return "json" if frames.is_json(data) else "text"


def _read(kind: str, data: bytes, path: Path, source: str, text: TextFormat | None) -> RawTable:
    if kind == "text":
        detect = text in (None, TextFormat()) and len(data) <= frames.LARGEST
        if detect and (documents := frames.yaml_documents(data)) is not None:
            return frames.table_of_frames(documents, source)
        return read_text(data, source, text)
    if kind == "json":
        return frames.read_json(data, source)
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
