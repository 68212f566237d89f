"""Let one batch at a time write into a folder, and say who does (P08).

The lock is the kernel's (flock): whatever way its owner ends, it is free again, and a file that was left behind locks nobody out.
The file's words are for the message alone.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import os
import platform
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from pipelines.errors import EnvironmentFault, clean
from pipelines.io.atomic import environment_faults

__all__ = ["LOCK", "locked"]

LOCK: Final = ".rrrid-lock"
_TRIES = 20  # to open the file that its owner is just removing


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of `folder`, which exists.

    Raises:
        EnvironmentFault: P08, another process holds it.
    """
    path = folder / LOCK
    with environment_faults(folder):
        handle = _acquired(path)
        os.ftruncate(handle, 0)
        os.pwrite(handle, json.dumps({"pid": os.getpid(), "host": platform.node()}).encode(), 0)
    try:
        yield
    finally:
        with contextlib.suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(handle), path.stat()):  # the folder may have been moved, and another stand in its place
                path.unlink()  # while it is held: whoever opened it meanwhile sees that it is gone, and opens anew
        os.close(handle)


def _acquired(path: Path) -> int:
    """An open handle of `path` that holds its lock, and is the file that stands there."""
    for _ in range(_TRIES):
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as problem:
            owner = _owner(handle)
            os.close(handle)
            if problem.errno not in (errno.EWOULDBLOCK, errno.EACCES):
                raise
            raise EnvironmentFault("P08", f"locked by {owner}", where=path.parent,
                                   remedy="wait until it has ended, or choose another --out") from None
        with contextlib.suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(handle), path.stat()):
                return handle
        os.close(handle)
    raise EnvironmentFault("P08", "locked by processes that come and go", where=path.parent, remedy="choose another --out")


def _owner(handle: int) -> str:
    try:
        about = json.loads(os.pread(handle, 400, 0))
        return f"process {int(about['pid'])} on {clean(about['host'], 60)}"
    except (ValueError, KeyError, TypeError):
        return "another process"  # which has not said yet
