"""Read documents: JSON, as frames or arrays by name, and the YAML of `ros2 topic echo`.

[{"t": 0.0, "q": [0.1, 0.2]}, …], or one frame a line   columns t, q[0], q[1]
{"frames": [{"joints": {"j1": {"pos": 0.1}}}, …]}       joints.j1.pos
{"t": [0.0, …], "q": [[0.1, 0.2], …]}                   t, q_1, q_2
position: - 0.1 - 0.2 --- (in lines of their own)       position[0], position[1]
"""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pipelines.errors import InputRejected
from pipelines.log.experiment import Array
from pipelines.log.limits import FEWEST
from pipelines.log.recording.raw import RawTable, columns_of_arrays, described, distinct
from pipelines.log.recording.tables import LABELLED_VALUE

__all__ = ["LARGEST", "is_json", "read_json", "table_of_frames", "yaml_documents"]

LARGEST = 200_000_000  # [bytes]; parsed, JSON takes about ten times its size
_DEEPEST = 8  # levels of names within a frame
_MOST_COLUMNS = 2000
_MOST_NOTES = 200


def is_json(data: bytes) -> bool:
    """Return whether the file begins as JSON does: a list of lists or objects, or an object."""
    head = data[:256].lstrip(b"\xef\xbb\xbf \t\r\n").translate(None, b" \r\n")
    return head.startswith((b'{"', b"[{", b"[[", b"{}", b"[]"))


def read_json(data: bytes, source: str) -> RawTable:
    """Return the table of a JSON recording.

    Raises:
        InputRejected: F08 not JSON, S12 no recording in it, X05 larger than a recording.
    """
    if len(data) > LARGEST:
        message = f"{len(data)} bytes of JSON; import reads up to {LARGEST}"
        remedy = "split the recording, or save it as CSV or NPY"
        raise InputRejected("X05", message, where=source, remedy=remedy)
    document = _of_pandas(_parsed(data, source))
    notes = tuple(itertools.islice(_notes(document), _MOST_NOTES))
    if (frames := _frames(document, _DEEPEST)) is not None:
        return replace(table_of_frames(frames, source), notes=notes)
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
    """Yield (path, group, value) of every number and text of a frame."""
    for path, value in _named(frame, "", _DEEPEST):
        for k, item in enumerate(value) if isinstance(value, list) else ():
            if isinstance(item, dict):
                for inner, cell in _named(item, "", _DEEPEST):
                    if not isinstance(cell, list):
                        yield f"{path}[{k}].{inner}", f"{path}[{k}].{inner}", cell
            elif not isinstance(item, list):
                yield f"{path}[{k}]", path, item
        if not isinstance(value, list):
            yield path, path, value


def table_of_frames(frames: Sequence[Mapping[str, Any]], source: str) -> RawTable:
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


def yaml_documents(data: bytes) -> list[dict[str, Any]] | None:
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
