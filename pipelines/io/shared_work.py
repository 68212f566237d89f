"""Share a list of work between two processes: each takes the next piece when it is done with its last.

    answers = shared_out(work, pieces)        [work(piece) for piece in pieces]

The other process is a copy of this one, made where there is a second processor and this is none of a batch's workers: what `work`
needs it has already, and its answers are copied back. A piece gets the same answer in either: the outcome does not hang on how
the pieces fell.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import struct
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from pipelines.io.guard import die_with_parent
from pipelines.io.processors import processors

if TYPE_CHECKING:
    from multiprocessing.connection import Connection
    from types import FrameType

__all__ = ["shared_out"]

P = TypeVar("P")
A = TypeVar("A")

_PLACE = struct.Struct("<I")
_MOST = 10_000  # pieces: their places fit into a pipe that nobody reads yet
_STOPPING = (signal.SIGINT, signal.SIGTERM)
_COPY = threading.Event()  # set in the other process: it makes no further one
# Processes that have answered: what they hold is given back while this one goes on, for that takes 20 ms of half a gigabyte.
_LEAVING: list[int] = []


def shared_out(work: Callable[[P], A], pieces: Sequence[P]) -> list[A]:
    """What `work` makes of each piece, in order."""
    if not 1 < len(pieces) < _MOST or not _second():
        return [work(piece) for piece in pieces]
    places = _places(len(pieces))
    other = _Other()
    found: dict[int, A] = {}
    try:
        other.begin(lambda: [(k, work(pieces[k])) for k in _next(places)])
        found.update((k, work(pieces[k])) for k in _next(places))
        with contextlib.suppress(EOFError, OSError, MemoryError):  # it came to grief: its pieces are done here
            found.update(other.answer())
    finally:
        with _undisturbed():
            other.end()
            os.close(places)
    return [found[k] if k in found else work(piece) for k, piece in enumerate(pieces)]


def _second() -> bool:
    """Whether another process may be made: not among the workers of a batch, which have every processor already."""
    alone = multiprocessing.parent_process() is None and threading.current_thread() is threading.main_thread()
    return alone and not _COPY.is_set() and processors() > 1


def _places(count: int) -> int:
    """A pipe with the numbers up to `count`, to be read by both."""
    read, write = os.pipe()
    os.write(write, b"".join(map(_PLACE.pack, range(count))))
    os.close(write)
    return read


def _next(places: int) -> Iterator[int]:
    while number := os.read(places, _PLACE.size):
        yield _PLACE.unpack(number)[0]


class _Other:
    """A copy of this process that answers once."""

    def __init__(self) -> None:
        self._process, self._answered = 0, False
        self._ours, self._theirs = multiprocessing.Pipe(duplex=False)

    def begin(self, work: Callable[[], Any]) -> None:
        """Make the copy, if the system has a process for it. A signal that comes meanwhile is taken when `end` has all it needs."""
        parent = os.getpid()
        with _undisturbed():
            before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOPPING)  # the copy has no use for this program's handlers
            try:
                with warnings.catch_warnings(), contextlib.suppress(OSError):  # none can be had: every piece is done here
                    warnings.simplefilter("ignore", DeprecationWarning)  # a fork beside threads: the copy takes none of their locks
                    self._process = os.fork()
                    if self._process == 0:
                        _serve(work, self._theirs, before, parent)
            finally:
                self._theirs.close()  # or nobody would ever be told that no answer comes
                signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def answer(self) -> Any:
        """What it has made of its work.

        Raises:
            EOFError: it came to grief.
        """
        found = self._ours.recv()
        self._answered = True
        return found

    def end(self) -> None:
        """It has answered, and leaves by itself; or nobody waits for it any more."""
        self._ours.close()
        self._theirs.close()
        if self._process and self._answered:
            _LEAVING.append(self._process)
        elif self._process:
            with contextlib.suppress(ProcessLookupError, ChildProcessError):  # it ended and was waited for: by another, or by none
                os.kill(self._process, signal.SIGKILL)
                os.waitpid(self._process, 0)
        _LEAVING[:] = [process for process in _LEAVING if _is_there(process)]


def _is_there(process: int) -> bool:
    """Whether it has not ended yet; of one that has nothing is left."""
    try:
        return os.waitpid(process, os.WNOHANG) == (0, 0)
    except ChildProcessError:  # somebody else has waited for it
        return False


@contextlib.contextmanager
def _undisturbed() -> Iterator[None]:
    """No handler of this program runs meanwhile; what came is taken at the end.

    A mask alone does not do it: another thread takes the signal then, and the handler runs here all the same. One that comes while
    the handlers are put back is taken at once, and by whatever handler is not yet back as well.
    """
    came: list[int] = []
    waiting = True
    before = {number: handler for number in _STOPPING if callable(handler := signal.getsignal(number))}

    def hear(number: int, frame: FrameType | None) -> None:
        if waiting:
            came.append(number)
        else:
            before[signal.Signals(number)](number, frame)

    try:
        for number in before:
            signal.signal(number, hear)
        yield
    finally:
        waiting = False
        for number, handler in before.items():
            signal.signal(number, handler)
        for one in came:
            signal.raise_signal(one)


def _serve(work: Callable[[], Any], end: Connection[Any, Any], mask: set[int | signal.Signals],
           parent: int) -> None:
    status = 1
    try:
        _COPY.set()
        die_with_parent()
        if os.getppid() != parent:  # it was killed before
            return
        for stop in _STOPPING:
            signal.signal(stop, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        end.send(work())
        status = 0
    finally:
        os._exit(status)
