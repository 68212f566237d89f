"""A forked child that answers one question after another, and may crash, hang or swell at any of them.

    child = Child(work)
    answer = child.ask(words, path, seconds, memory)     Lost where it crashed or did not end in time
    child.end()

The child is a fork: it costs milliseconds, for the libraries are imported already. It hands samples over through memory that
both share for the time of one question, and everything else as JSON: nothing that a hijacked child says is ever executed.
"""

from __future__ import annotations

import contextlib
import faulthandler
import gc
import json
import os
import select
import signal
import socket
import struct
import sys
import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NoReturn

import numpy as np

from pipelines.errors import EnvironmentFault, InputRejected, RrridError, UsageError
from pipelines.log.atomic import fault_of
from pipelines.log.experiment import Array

__all__ = ["Answer", "Child", "Lost", "die_with_parent"]

_STOPPING: Final = (signal.SIGINT, signal.SIGTERM)
_PR_SET_PDEATHSIG: Final = 1  # prctl(2)
_PAUSE, _PAUSES = 0.005, 400  # [s] until a process that has closed everything is gone
_LENGTH: Final = struct.Struct("<Q")  # before every text


@dataclass(frozen=True)
class Answer:
    """What the child found: a JSON object and named arrays."""

    about: dict[str, Any]
    arrays: Mapping[str, Array]


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

    def ask(self, words: Any, path: Path, seconds: float, memory: int, *, last: bool = False) -> Answer:
        """The answer to `words`, which can be written as JSON.

        Args:
            path: the file in question, for messages.
            seconds: the child is killed after so long.
            memory: [B] how much more than it has now the child may use.
            last: no other question follows; the child ends.

        Raises:
            Lost: it crashed or did not end in time.
            RrridError: what `work` raised.
        """
        self.asked += 1
        store = _shared_file()
        try:
            text = self._answered({"words": words, "memory": memory}, store, time.monotonic() + seconds)
            if last:
                self.end()
            return _answer(json.loads(text), store, path)
        except BaseException:
            self.end()
            raise
        finally:
            os.close(store)

    def _answered(self, request: dict[str, Any], store: int, deadline: float) -> bytes:
        text = json.dumps(request).encode()
        with contextlib.suppress(BrokenPipeError):  # it is dead: seen below
            socket.send_fds(self._ours, [_LENGTH.pack(len(text)), text], [store])
        reply = b""
        while len(reply) < _LENGTH.size or len(reply) < _LENGTH.size + _LENGTH.unpack_from(reply)[0]:
            if not select.select([self._ours], [], [], max(0.0, deadline - time.monotonic()))[0]:
                raise Lost(None)
            part = self._heard()
            if not part:
                raise Lost(self._died())
            reply += part
        return reply[_LENGTH.size:]

    def _heard(self) -> bytes:
        try:
            return self._ours.recv(1 << 20)
        except ConnectionResetError:  # it died with our question unread
            return b""

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


def _shared_file() -> int:
    """A file without a name that both processes can read and write."""
    if hasattr(os, "memfd_create"):
        return os.memfd_create("rrrid", os.MFD_CLOEXEC)
    import tempfile

    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())


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
            end.sendall(_LENGTH.pack(len(text)) + text)
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
    while len(text) < _LENGTH.size or len(text) < _LENGTH.size + _LENGTH.unpack_from(text)[0]:
        part, handles, _, _ = socket.recv_fds(end, 1 << 16, 1)
        if not part:
            return None
        text, store = text + part, handles[0] if handles else store
    found: dict[str, Any] = json.loads(text[_LENGTH.size:])
    return found, store


def _replied(work: Callable[[Any], Answer], words: Any, memory: int, store: int) -> dict[str, Any]:
    """What `work` found, or why it found nothing."""
    lowered = False
    try:
        lowered = _limit_memory(memory)
        answer = work(words)
        return {"about": answer.about, "arrays": _store(answer.arrays, store)}
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


def _store(arrays: Mapping[str, Array], store: int) -> dict[str, list[int]]:
    """Write the arrays one behind the other; name -> [offset, *shape]."""
    places, offset = {}, 0
    for name, values in arrays.items():
        flat = np.ascontiguousarray(values, dtype=np.float64)
        places[name] = [offset, *flat.shape]
        view = flat.reshape(-1).view(np.uint8).data
        while view:
            written = os.pwrite(store, view, offset)
            offset, view = offset + written, view[written:]
    return places


def _answer(reply: dict[str, Any], store: int, path: Path) -> Answer:
    if "error" in reply:
        kinds = {kind.exit_code: kind for kind in (UsageError, InputRejected, EnvironmentFault)}
        error = reply["error"]
        raise kinds.get(error["exit"], InputRejected)(error["code"].removeprefix("RRID-"), error["message"],
                                                      where=error["where"] or path, remedy=error["remedy"])
    if "internal" in reply:
        raise RuntimeError(f"reading {path}: {reply['internal']}")
    return Answer(reply["about"], {name: _copied(store, place) for name, place in reply["arrays"].items()})


def _copied(store: int, place: list[int]) -> Array:
    """The array at `place`, out of the child's reach. A map would hold a handle for as long as its log is needed."""
    offset, *shape = place
    values = np.empty(shape)
    view = values.reshape(-1).view(np.uint8).data
    while view:
        got = os.preadv(store, [view], offset)
        if not got:
            raise ValueError("fewer samples than were told")
        offset, view = offset + got, view[got:]
    values.flags.writeable = False
    return values
