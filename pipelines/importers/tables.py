"""Read a recorded file by its content: text, JSON, NPY, NPZ, Parquet, MAT or HDF5.

JSON holds arrays by name, or frames:

{"t": [0.0, …], "q": [[0.1, 0.2], …]}                   t, q_1, q_2
[{"t": 0.0, "q": [0.1, 0.2]}, …], or one frame a line   t, q[0], q[1]
{"frames": [{"joints": {"j1": {"pos": 0.1}}}, …]}       joints.j1.pos
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pipelines.errors import Check, EnvironmentFault, InputRejected, UsageError, clean
from pipelines.importers import arrays
from pipelines.importers.config import ARRAYS
from pipelines.importers.raw import RawTable, flatten, table_of
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
    *((bytes((0x80, version)), "X07", "a pickle, which is never opened",
       "save plain numbers as NPY or CSV") for version in (2, 3, 4, 5)),
)  # fmt: skip


@dataclass(frozen=True)
class Reader:
    """How files of one kind are known and read: a new kind is a function and a line in `READERS`.

    `read(data, source)` returns named arrays or nested documents of them, the samples among them,
    with units in brackets behind names and metadata as texts and single numbers; or a table.
    """

    kind: str
    magic: tuple[bytes, ...]  # first bytes, any of them
    endings: tuple[str, ...]
    read: Callable[[bytes, str], Mapping[str, Any] | RawTable]
    apart: bool = False  # read in a child process, which may crash


def read_json(data: bytes, source: str) -> Any:
    """Return the document of a JSON recording: arrays by name, or frames turned into such.

    Raises:
        InputRejected: F08 no JSON, S03 a name twice in a frame, X05 too large.
    """
    if len(data) > ARRAYS.largest_json:
        message = f"{len(data)} bytes of JSON; import reads up to {ARRAYS.largest_json}"
        raise InputRejected("X05", message, source, "split the recording, or save it as CSV or NPY")
    try:
        text = data.decode("utf-8-sig")
        try:
            document = json.loads(text)
        except json.JSONDecodeError:
            document = [json.loads(line) for line in text.splitlines() if line.strip()]
        return _series(document, source)
    except (ValueError, TypeError, AttributeError, OverflowError, RecursionError) as problem:
        message = f"not valid JSON of a recording: {problem}"
        remedy = "copy the file again, or end the recording before it is copied"
        raise InputRejected("F08", message, source, remedy) from None


def _series(document: Any, source: str) -> Any:
    """Return arrays by name of a document that pandas wrote, or of the longest list of frames."""
    if isinstance(document, dict) and document.keys() >= {"columns", "data"}:
        rows = zip(*document["data"], strict=True)
        return {k: list(x) for k, x in zip(document["columns"], rows, strict=True)}
    columns = document.values() if isinstance(document, dict) else [None]
    if all(isinstance(x, dict) and all(map(str.isdecimal, x)) for x in columns):
        return {name: list(column.values()) for name, column in document.items()}
    frames = max(_lists_of_frames(document, ARRAYS.deepest), key=len, default=None)
    if frames is None:
        return document
    found: dict[str, Any] = {}
    if isinstance(document, dict):
        found = {name: x for name, x in document.items() if not isinstance(x, list)}
    return found | _of_frames(frames, source)


def _of_frames(frames: list[dict[str, Any]], source: str) -> dict[str, Any]:
    """Return the arrays of frames by name.

    A list that a frame lacks, or that has another shape there, is NaN: a missing sample.
    """
    values: dict[str, dict[int, Any]] = {}  # name -> frame -> value
    for k, frame in enumerate(frames):
        for name, value in flatten(frame):
            if k in (of_name := values.setdefault(name, {})):
                message = f"two values of a frame are both named '{clean(name, 80)}'"
                raise InputRejected("S03", message, source, "rename one of them in the file")
            of_name[k] = value
    found: dict[str, Any] = {}
    for name, of_name in values.items():
        first = next((x for x in of_name.values() if x is not None), None)
        words = [first] if isinstance(first, str) else first
        if isinstance(words, list) and words and all(isinstance(x, str) for x in words):
            found[name] = " ".join(words)  # the joints' names, in every frame
            continue
        block = _numbers([of_name.get(k) for k in range(len(frames))])
        if block is None:
            numbers = {k: x for k, value in of_name.items() if (x := _numbers(value)) is not None}
            shape = Counter(x.shape for x in numbers.values()).most_common(1)
            block = np.full((len(frames), *(shape[0][0] if shape else ())), np.nan)
            for k, x in numbers.items():
                if x.shape == block.shape[1:]:
                    block[k] = x
        for index in np.ndindex(block.shape[1:]):
            found[name + "".join(f"[{i}]" for i in index)] = block[:, *index]
    return found


def _numbers(value: Any) -> Array | None:
    """Return an array of a number, or of a list of numbers or lists; None of anything else."""
    try:
        return np.array(value, np.float64)
    except (ValueError, TypeError):
        return None


def _lists_of_frames(value: Any, depth: int) -> Iterator[list[dict[str, Any]]]:
    if isinstance(value, list) and len(value) >= FEWEST and all(isinstance(x, dict) for x in value):
        yield value
    for inner in value.values() if isinstance(value, dict) and depth else ():
        yield from _lists_of_frames(inner, depth - 1)


READERS = (
    Reader("npy", (b"\x93NUMPY",), (".npy",), arrays.read_npy),
    Reader("npz", (), (".npz",), arrays.read_npz, apart=True),
    Reader("parquet", (b"PAR1",), (".parquet",), arrays.read_parquet, apart=True),
    Reader("mat73", (b"\x89HDF\r\n\x1a\n", b"MATLAB 7.3"), (".mat", ".h5", ".hdf5"),
           arrays.read_hdf5, apart=True),
    Reader("mat5", (b"MATLAB 5.0",), (".mat",), arrays.read_mat5, apart=True),
    Reader("json", (), (".json", ".jsonl"), read_json, apart=True),
    Reader("text", (), (), read_text),
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
        table = read_text(data, source, text)
    elif reader.apart:
        _load(reader.kind)
        table = _in_child(lambda: table_of(reader.read(data, source), source), path, source)
    else:
        table = table_of(reader.read(data, source), source)
    longest = max((*table.columns, *table.text, ""), key=len)
    if len(longest) > ARRAYS.longest_name:
        message = f"the name of a column has {len(longest)} characters, {longest[:40]} …"
        raise InputRejected("F16", message, source, "export the table with a header of short names")
    checks, ending = table.checks, path.suffix.lower()
    foreign = reader.kind != "text" or any(ending in other.endings for other in READERS)
    if ending not in reader.endings and foreign:
        message = f"named '{path.suffix}', but its content is {reader.kind}; read as that"
        checks = (Check.of("F06", "warn", message, source, "rename it"), *checks)
    return replace(table, checks=checks, sha256=hashlib.sha256(data).hexdigest())


def _load(kind: str) -> object:
    """Import what reads a kind of file before the fork, so that every child has it."""
    if kind == "parquet":
        import pyarrow.parquet

        return pyarrow.parquet
    if kind == "mat5":
        import scipy.io

        return scipy.io
    import h5py

    return h5py


def _bytes_of(path: Path) -> bytes:
    """Return the whole file.

    Raises:
        InputRejected: X05, larger than a recording. EnvironmentFault: F15, a logger holds it.
    """
    status = regular_file(path)
    if status.st_size > ARRAYS.largest_file:
        message = f"{status.st_size} bytes; import reads files up to {ARRAYS.largest_file}"
        raise InputRejected("X05", message, path, "split the recording")
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(handle, "rb") as file:
            try:
                fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                message, remedy = "in use by another process", "wait until the recording is done"
                raise EnvironmentFault("F15", message, path, remedy) from None
            except OSError:
                pass  # a file system without locks cannot say
            return file.read()
    except OSError as problem:
        raise fault_of(problem, path) from None


def _reader_of(data: bytes, source: str) -> Reader:
    """F06: return the reader of a file by its first bytes.

    Raises:
        InputRejected: F06 of a kind that is not read, X07 a pickle. UsageError: X12, an archive.
    """
    kinds, name = {reader.kind: reader for reader in READERS}, source.lower()
    if data.startswith(b"PK\x03\x04") and name.endswith(".npz"):
        return kinds["npz"]
    for magic, code, what, remedy in _REFUSED:
        if data.startswith(magic):
            kind = UsageError if code == "X12" else InputRejected
            raise kind(code, f"{what}, not a recording", where=source, remedy=remedy)
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
        about = asdict(replace(table, columns={}, rows=np.arange(0)))
        del about["rows"]
        columns = {str(i): x for i, x in enumerate(table.columns.values())}
        return Answer(about | {"names": list(table.columns)}, columns)

    try:
        answer = guarded(work, path)
        about = answer.about
        columns = {name: answer.arrays[str(i)] for i, name in enumerate(about["names"])}
        return RawTable(
            source,
            columns,
            np.arange(len(next(iter(columns.values())))),
            about["units"],
            about["text"],
            tuple(about["notes"]),
            checks=tuple(Check(**check) for check in about["checks"]),
        )
    except InputRejected as problem:
        if problem.code == "RRID-F03":  # however it was damaged and the library took it
            raise arrays.damaged_mat(source) from None
        raise
    except (KeyError, TypeError, AttributeError, StopIteration):  # of a child that a file broke
        raise arrays.damaged_mat(source) from None
