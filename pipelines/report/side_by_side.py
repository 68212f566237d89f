"""Draw many figures in two processes: half of the time of a long report is theirs.

    pictures = drawn({"friction": figure, ...}, draw)       the same bytes as one after the other
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import struct
import warnings
from collections.abc import Callable, Mapping
from typing import IO

from pipelines.log.guard import die_with_parent, shared_file
from pipelines.report.report import Figure

__all__ = ["Picture", "drawn"]

Picture = tuple[str, bytes]  # SVG and PNG

_MANY = 8  # figures, from which on a second process is worth its start
_SIZES = struct.Struct("<QQ")
_STOPPING = (signal.SIGINT, signal.SIGTERM)


def drawn(figures: Mapping[str, Figure], draw: Callable[[Figure, str], Picture]) -> dict[str, Picture]:
    """Each figure's picture by its name; `draw` is given the figure and the name."""
    names = list(figures)
    theirs = names[1::2] if _worth(len(names)) else []
    with os.fdopen(shared_file(), "w+b") as store:
        child = _started(theirs, figures, draw, store) if theirs else None
        try:
            found = {name: draw(figures[name], name) for name in names if name not in set(theirs)}
        except BaseException:
            _ended(child, kill=True)
            raise
        if _ended(child):
            store.seek(0)
            found.update((name, _read(store)) for name in theirs)
    # What the other process could not draw is drawn here, where its error can be told.
    return {name: found[name] if name in found else draw(figures[name], name) for name in names}


def _worth(count: int) -> bool:
    """Not among the workers of a batch, which have every processor already."""
    return count >= _MANY and _processors() > 1 and multiprocessing.parent_process() is None


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _started(names: list[str], figures: Mapping[str, Figure], draw: Callable[[Figure, str], Picture], store: IO[bytes]) -> int:
    import matplotlib.figure  # noqa: F401  # once, before there are two

    before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOPPING)  # the child has no use for this program's handlers
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # a fork beside threads: the child takes none of their locks
            child = os.fork()
        if child == 0:
            _serve(names, figures, draw, store, before)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    return child


def _serve(names: list[str], figures: Mapping[str, Figure], draw: Callable[[Figure, str], Picture], store: IO[bytes],
           mask: set[int | signal.Signals]) -> None:
    status = 1
    try:
        die_with_parent()
        for stop in _STOPPING:
            signal.signal(stop, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for name in names:
            svg, png = draw(figures[name], name)
            text = svg.encode()
            store.write(_SIZES.pack(len(text), len(png)) + text + png)
        store.flush()
        status = 0
    finally:
        os._exit(status)


def _read(store: IO[bytes]) -> Picture:
    text, png = _SIZES.unpack(store.read(_SIZES.size))
    return store.read(text).decode(), store.read(png)


def _ended(child: int | None, kill: bool = False) -> bool:
    """Whether there was a child, and it did all that it should."""
    if child is None:
        return False
    if kill:
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
