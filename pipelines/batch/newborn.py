"""For the process that workers are forked from: one whose batch ends while it starts has nothing to say.

A signal for the whole group ends that process first, and the batch lets go of what its workers share; the one that was just being
forked finds nothing of it and would end in a traceback, in the middle of the batch's own last words. Any other fault of a worker's
start is told as ever. Imported where workers are forked from, and nowhere else: it takes the place of `sys.excepthook`.
"""

from __future__ import annotations

import sys
from traceback import walk_tb
from types import TracebackType
from typing import Final

__all__: list[str] = []

_GONE: Final = (FileNotFoundError, EOFError)  # a semaphore that was unlinked; a pipe that was closed
_before = sys.excepthook


def _told(kind: type[BaseException], problem: BaseException, trace: TracebackType | None) -> None:
    places = [frame.f_globals.get("__name__", "") for frame, _ in walk_tb(trace)]
    starting = "multiprocessing.spawn" in places and places[-1].startswith("multiprocessing.")
    if not (starting and issubclass(kind, _GONE)):
        _before(kind, problem, trace)


sys.excepthook = _told
