"""What a guarded child hands over, and how far it is believed: samples in a file that both share, everything else as JSON.

    reply = heard(end, deadline, longest)             in the parent: the child's text
    answer = answer_of(reply, store, path, memory)    in the parent: what it says, with its samples

A hijacked child may claim anything. What it claims is held against what is there and what its file may hold before the parent
allocates it, and nothing that it says is ever executed.
"""

from __future__ import annotations

import json
import math
import os
import select
import socket
import struct
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from pipelines.errors import EnvironmentFault, InputRejected, RrridError, UsageError
from pipelines.io.experiment import Array

__all__ = ["LENGTH", "Answer", "Garbled", "TimeOut", "answer_of", "heard", "longest_text", "shared_file", "stored"]

LENGTH: Final = struct.Struct("<Q")  # before every text
# What a log says of itself is kilobytes, as JSON in JSON at most seven times as long as in its file (control characters).
_ALWAYS_SAID, _TIMES_THE_FILE, _EVER_SAID = 16 << 20, 16, 256 << 20  # [B], and how many times the file
_FLOAT: Final = 8  # [B]


@dataclass(frozen=True)
class Answer:
    """What the child found: a JSON object and named arrays."""

    about: dict[str, Any]
    arrays: Mapping[str, Array]


class Garbled(Exception):
    """What the child says has not the form of an answer, or claims samples that are not there."""


class TimeOut(Exception):
    """It has not said everything in time."""


def longest_text(file_size: int) -> int:
    """[B] that a child may say of a file of `file_size` bytes, beside its samples."""
    return min(_ALWAYS_SAID + _TIMES_THE_FILE * file_size, _EVER_SAID)


def heard(end: socket.socket, deadline: float, longest: int, path: Path) -> bytes:
    """The next text; empty where the child has closed its end.

    Raises:
        TimeOut: `deadline` is over.
        InputRejected: X05, it is longer than `longest` bytes: nobody waits for them.
    """
    text, size = bytearray(), -1
    while size < 0 or len(text) < size:
        if not select.select([end], [], [], max(0.0, deadline - time.monotonic()))[0]:
            raise TimeOut
        try:
            part = end.recv(1 << 20)
        except ConnectionResetError:  # it died with our question unread
            part = b""
        if not part:
            return b""
        text += part
        if size < 0 and len(text) >= LENGTH.size:
            size = LENGTH.size + LENGTH.unpack_from(text)[0]
        if size > LENGTH.size + longest:
            raise InputRejected("X05", f"its description is longer than {longest / 1e6:.0f} MB", where=path,
                                remedy="keep samples in signals, and texts short")
    return bytes(text[LENGTH.size:])


def shared_file() -> int:
    """A file without a name that both processes can read and write."""
    if hasattr(os, "memfd_create"):
        return os.memfd_create("rrrid", os.MFD_CLOEXEC)
    import tempfile

    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())


def stored(arrays: Mapping[str, Array], store: int) -> dict[str, list[int]]:
    """In the child: write the arrays one behind the other; name -> [offset, *shape]."""
    places, offset = {}, 0
    for name, values in arrays.items():
        flat = np.ascontiguousarray(values, dtype=np.float64)
        places[name] = [offset, *flat.shape]
        view = flat.reshape(-1).view(np.uint8).data
        while view:
            written = os.pwrite(store, view, offset)
            offset, view = offset + written, view[written:]
    return places


def answer_of(text: bytes, store: int, path: Path, memory: int) -> Answer:
    """The answer that `text` is, its samples copied out of `store`.

    Args:
        memory: [B] that the child may use; no samples need more.

    Raises:
        Garbled: it is none. RrridError: what the child's work raised. RuntimeError: a fault of that work.
    """
    problem: RrridError | RuntimeError
    try:
        reply = json.loads(text)
        if "error" in reply:
            problem = _error(reply["error"], path)
        elif "internal" in reply:
            problem = RuntimeError(f"reading {path}: {reply['internal']}")
        else:
            about, places = dict(reply["about"]), _within(reply["arrays"], store, memory)
            return Answer(about, {name: _copied(store, place) for name, place in places.items()})
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError) as nonsense:
        raise Garbled(f"{type(nonsense).__name__}: {nonsense}") from None
    raise problem


def _error(error: Mapping[str, Any], path: Path) -> RrridError:
    kinds = {kind.exit_code: kind for kind in (UsageError, InputRejected, EnvironmentFault)}
    return kinds.get(error["exit"], InputRejected)(error["code"].removeprefix("RRID-"), error["message"],
                                                   where=error["where"] or path, remedy=error["remedy"])


def _within(places: Mapping[str, list[int]], store: int, memory: int) -> Mapping[str, list[int]]:
    """The places as they are, if they lie one behind the other and are all that is there: none is claimed twice."""
    end = 0
    for offset, *shape in places.values():
        if not all(type(n) is int and n >= 0 for n in (offset, *shape)) or offset != end:
            raise ValueError("samples that lie elsewhere")
        end += _FLOAT * math.prod(shape)
    if end > memory or end != os.fstat(store).st_size:
        raise ValueError(f"{end} bytes of samples that are not there")
    return places


def _copied(store: int, place: list[int]) -> Array:
    """The array at `place`, out of the child's reach. A map would hold a handle for as long as its log is needed."""
    offset, *shape = place
    values = np.empty(shape)
    view = values.reshape(-1).view(np.uint8).data
    while view:
        got = os.preadv(store, [view], offset)
        if not got:
            raise ValueError("fewer samples than were announced")
        offset, view = offset + got, view[got:]
    values.flags.writeable = False
    return values
