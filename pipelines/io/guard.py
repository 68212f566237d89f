"""Open unknown files in a child process, so that a library that crashes or hangs on one costs one file.

    answer = guarded(work, path)         a child for this file alone

    guard = Guard(work)                  a child that may stay for the next file:
    thing = guard.ask(words, path, needs, take)

HDF5 and Parquet are read by large C libraries; a damaged file has sent them into a crash or an endless loop before. A file that is
read without harm may still have left something broken behind: a child is kept only after a file whose content was verified, and
what a kept child says against a file, or says wrongly of it, counts only when a fresh one says it again.
"""

from __future__ import annotations

import atexit
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, TypeVar

from pipelines.errors import InputRejected
from pipelines.io.guard_answer import Answer, Garbled, longest_text
from pipelines.io.guard_child import Child, Lost, die_with_parent

__all__ = ["Answer", "Guard", "die_with_parent", "guarded"]

T = TypeVar("T")

_SECONDS: Final = 10.0  # a healthy file of 20 MB takes a tenth of it
_BYTES_A_SECOND: Final = 5e6
_MEMORY: Final = 1 << 30  # [B] beyond three times the file and what its samples need
_PATIENCE: Final = 0.3  # of the time for a file that a kept child is given; the rest is for a fresh one
_FILES: Final = 256  # that one child reads: what a library leaks with each of them goes with it


def guarded(work: Callable[[], Answer], path: Path, *, seconds: float | None = None, memory: int | None = None) -> Answer:
    """Run `work` in a child process and return its answer.

    Args:
        work: reads `path`; import what it needs before, so that the child has it.
        seconds: the child is killed after so long; default 10 s and a second more for each 5 MB of the file.
        memory: how many bytes more than this process the child may use; default 1 GiB and 1200 times the file, at
            most 32 GiB: no more than what the budget of declared sizes lets pass.

    Raises:
        RrridError: what `work` raised.
        InputRejected: F03 where the library crashed or hung on the file, or what it gave is nonsense.
    """
    limit, budget, longest = _limits(path, seconds, memory)
    try:
        return Child(lambda _: work()).ask(None, path, limit, budget, longest, last=True)
    except (Lost, Garbled) as lost:
        raise _told(lost, path, limit) from None


class Guard(threading.local):
    """A child for file after file, one for each thread: a child dies with the thread that made it."""

    def __init__(self, work: Callable[[Any], Answer]) -> None:
        """`work` is given the words of `ask`, as JSON leaves them."""
        self._work = work
        self._child: Child | None = None
        self._vouched = False
        if threading.current_thread() is threading.main_thread():
            atexit.register(self.let_go)

    def ask(self, words: Any, path: Path, needs: str, take: Callable[[Answer], tuple[T, bool]]) -> T:
        """What `take` makes of the answer to `words` about the file `path`, in the time and the memory that `guarded` gives it.

        Args:
            path: a relative one is always read by a fresh child: a kept one may stand in another folder.
            needs: the module that reads it, imported already: a child that was made without it is replaced.
            take: gives what is asked for, and whether the answer was verified: the child may be kept then. It raises where
                the answer cannot be right: Garbled where it has not even the form of one.

        Raises:
            RrridError: what the work raised, or `take`.
            InputRejected: F03 where the library crashed or hung on the file, or what it gave is nonsense.
        """
        limit, budget, longest = _limits(path)
        began = time.monotonic()
        child = self._kept(needs, path)
        if child is not None:
            try:
                return self._taken(child.ask(words, path, _PATIENCE * limit, budget, longest), take)
            except Exception:
                self.let_go()  # it may be a trace of an earlier file: a fresh child decides, and tells
        self._child = Child(self._work)
        try:
            left = limit - (time.monotonic() - began)
            return self._taken(self._child.ask(words, path, left, budget, longest), take)
        except (Lost, Garbled) as lost:
            raise _told(lost, path, limit) from None

    def _taken(self, answer: Answer, take: Callable[[Answer], tuple[T, bool]]) -> T:
        thing, self._vouched = take(answer)
        return thing

    def _kept(self, needs: str, path: Path) -> Child | None:
        """The child of the last file, where it may be asked for this one."""
        vouched, self._vouched = self._vouched, False
        child = self._child
        if (child is not None and vouched and path.is_absolute() and child.owner == os.getpid() and needs in child.imported
                and child.asked < _FILES):
            return child
        self.let_go()
        return None

    def let_go(self) -> None:
        """End the child; the next file is read by another one."""
        if self._child is not None:
            self._child.end()
            self._child = None


def _limits(path: Path, seconds: float | None = None, memory: int | None = None) -> tuple[float, int, int]:
    """[s] for a file, [B] of memory, and [B] that may be said of it beside its samples."""
    size = path.stat().st_size
    return (_SECONDS + size / _BYTES_A_SECOND if seconds is None else seconds,
            min(_MEMORY + 1200 * size, 32 << 30) if memory is None else memory, longest_text(size))


def _told(lost: Lost | Garbled, path: Path, limit: float) -> InputRejected:
    """F03: what became of the child."""
    if isinstance(lost, Garbled):
        said = "what came of reading it makes no sense"
    elif lost.signal is None:
        said = f"reading did not end within {limit:.0f} s"
    elif lost.signal:
        said = f"the reading library crashed on it (signal {lost.signal})"
    else:
        said = "the reading library ended its process"
    return InputRejected("F03", f"{said}, the file is damaged", where=path, remedy="copy the file again")
