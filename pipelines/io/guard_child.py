"""A forked child that answers one question after another, and may crash, hang or swell at any of them.

    child = Child(work)
    answer = child.ask(words, path, seconds, memory)     Lost where it crashed or did not end in time
    child.end()

The child is a fork: it costs milliseconds, for the libraries are imported already. How it hands over what it found, and how far
it is believed: `guard_answer`.
"""

from __future__ import annotations

import contextlib
import faulthandler
import gc
import json
import os
import signal
import socket
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NoReturn

from pipelines.errors import RrridError
from pipelines.io.atomic import fault_of
from pipelines.io.guard_answer import LENGTH, Answer, TimeOut, answer_of, heard, shared_file, stored

__all__ = ["Child", "Lost", "die_with_parent"]

_STOPPING: Final = (signal.SIGINT, signal.SIGTERM)
_PR_SET_PDEATHSIG: Final = 1  # prctl(2)
_PAUSE, _PAUSES = 0.005, 400  # [s] until a process that has closed everything is gone


class Lost(Exception):
    """The child gave no answer: it died of `signal`, ended by itself (0), or its time ran out (None)."""

    def __init__(self, signal: int | None) -> None:
        super().__init__(signal)
        self.signal = signal


class Child:
    """One child process. Whatever goes wrong in `ask`, the child has ended then."""

    def __init__(self, work: Callable[[Any], Answer]) -> None:
        """Fork a child that does `work` on every question's words; the libraries that it needs are imported already."""
        self.asked = 0
        self.owner = os.getpid()
        self.imported = frozenset(sys.modules)
        self._process = 0
        self._ours, theirs = socket.socketpair()
        # No signal between the fork and the child's own handlers: the child would run the rest of the parent's program.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOPPING)
        try:
            with warnings.catch_warnings():
                # Python 3.12 warns of forks beside threads; ours runs one reader and leaves without touching any lock of theirs.
                warnings.simplefilter("ignore", DeprecationWarning)
                self._process = os.fork()
            if self._process == 0:
                _serve(work, theirs, self.owner)
        except BaseException:
            self._ours.close()
            raise
        finally:
            theirs.close()
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def ask(self, words: Any, path: Path, seconds: float, memory: int, longest: int, *,
            last: bool = False) -> Answer:
        """The answer to `words`, which can be written as JSON.

        Args:
            path: the file in question, for messages.
            seconds: the child is killed after so long.
            memory: [B] how much more than it has now the child may use.
            longest: [B] what it may say beside samples.
            last: no other question follows; the child ends.

        Raises:
            Lost: it crashed or did not end in time.
            Garbled: what it said is no answer.
            RrridError: what `work` raised; X05, it says more than that.
        """
        self.asked += 1
        store = shared_file()
        try:
            self._put({"words": words, "memory": memory}, store)
            text = self._heard(time.monotonic() + seconds, longest, path)
            if last:
                self.end()
            return answer_of(text, store, path, memory)
        except BaseException:
            self.end()
            raise
        finally:
            os.close(store)

    def _put(self, request: dict[str, Any], store: int) -> None:
        text = json.dumps(request).encode()
        with contextlib.suppress(BrokenPipeError):  # it is dead: heard next
            socket.send_fds(self._ours, [LENGTH.pack(len(text)), text], [store])

    def _heard(self, deadline: float, longest: int, path: Path) -> bytes:
        try:
            reply = heard(self._ours, deadline, longest, path)
        except TimeOut:
            raise Lost(None) from None
        if not reply:
            raise Lost(self._died())
        return reply

    def _died(self) -> int:
        """The signal that the child died of, which has closed its end; one that lives on all the same is killed for it."""
        for _ in range(_PAUSES):
            try:
                process, status = os.waitpid(self._process, os.WNOHANG)
            except ChildProcessError:  # whoever started us ignores ends of children (SIGCHLD): how it ended, nobody knows
                process, status = self._process, 0
            if process:
                self._process = 0
                return os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
            time.sleep(_PAUSE)
        return int(signal.SIGKILL)

    def end(self) -> None:
        """End the child. In a fork of its owner it is left to that one."""
        self._ours.close()
        process, self._process = self._process, 0
        if process and self.owner == os.getpid():
            with contextlib.suppress(ProcessLookupError, ChildProcessError):
                os.kill(process, signal.SIGKILL)
                os.waitpid(process, 0)

    def __del__(self) -> None:
        with contextlib.suppress(AttributeError):  # without handles left there was none
            self.end()  # that of a thread which has ended


def die_with_parent() -> None:
    """Linux: when the process that made this one is killed, this one ends as well, and nobody's work goes on unseen."""
    import ctypes

    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, int(signal.SIGKILL), 0, 0, 0)


def _serve(work: Callable[[Any], Answer], end: socket.socket, reader: int) -> NoReturn:
    """The child of `reader`: answer, question by question, and leave without running anybody's clean-up."""
    try:
        die_with_parent()
        if os.getppid() != reader:  # it was killed before
            os._exit(0)
        # A signal for the whole group is the parent's to answer, and it ends this child: a child that died of it alone
        # would look like a file that crashes the library.
        for number in _STOPPING:
            signal.signal(number, signal.SIG_IGN)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _STOPPING)
        faulthandler.disable()  # a crash here is the parent's to tell
        _alone(end.fileno())
        gc.freeze()  # what the parent had is the parent's to close
        while (request := _received(end)) is not None:
            words, store = request
            text = json.dumps(_replied(work, words["words"], words["memory"], store)).encode()
            os.close(store)
            end.sendall(LENGTH.pack(len(text)) + text)
    finally:
        os._exit(0)


def _alone(end: int) -> None:
    """Let go of what the parent has open: its locks are not held longer than it holds them, nobody waits for its pipes.

    HDF5 prints its error stack where it is not asked to: that goes nowhere.
    """
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nowhere, stream)
    if sys.platform == "linux":
        for name in os.listdir("/proc/self/fd"):
            if int(name) > 2 and int(name) != end:
                with contextlib.suppress(OSError):
                    os.close(int(name))


def _received(end: socket.socket) -> tuple[dict[str, Any], int] | None:
    """The next question and where its arrays go; None where nobody asks any more."""
    text, store = b"", -1
    while len(text) < LENGTH.size or len(text) < LENGTH.size + LENGTH.unpack_from(text)[0]:
        part, handles, _, _ = socket.recv_fds(end, 1 << 16, 1)
        if not part:
            return None
        text, store = text + part, handles[0] if handles else store
    found: dict[str, Any] = json.loads(text[LENGTH.size:])
    return found, store


def _replied(work: Callable[[Any], Answer], words: Any, memory: int, store: int) -> dict[str, Any]:
    """What `work` found, or why it found nothing."""
    lowered = False
    try:
        lowered = _limit_memory(memory)
        answer = work(words)
        return {"about": answer.about, "arrays": stored(answer.arrays, store)}
    except RrridError as problem:
        return {"error": {"exit": problem.exit_code, **problem.as_dict()}}
    except OSError as problem:  # of the machine: what a file does to its library, `work` has told
        fault = fault_of(problem, Path())
        return {"error": {"exit": fault.exit_code, **fault.as_dict(), "where": ""}}
    except MemoryError:
        return {"error": {"where": "", "remedy": "split the recording", **(
            {"exit": 6, "code": "RRID-P03", "message": "memory: reading it needs more than this process may use"}
            if lowered else
            {"exit": 3, "code": "RRID-X05", "message": "needs more memory than a log may"})}}
    except BaseException as problem:  # the parent tells it as an internal error
        return {"internal": f"{type(problem).__name__}: {problem}"}


def _limit_memory(budget: int) -> bool:
    """Let the system refuse what goes beyond `budget`; True where the process was limited to less before."""
    import resource

    lowered = False
    if sys.platform == "linux":
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        hard = resource.getrlimit(resource.RLIMIT_AS)[1]
        wanted = pages * resource.getpagesize() + budget
        lowered = hard != resource.RLIM_INFINITY and hard < wanted
        resource.setrlimit(resource.RLIMIT_AS, (hard if lowered else wanted, hard))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    return lowered
