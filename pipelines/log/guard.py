"""Open unknown files in a child process, so that a library that crashes or hangs on one costs one file.

HDF5 and Parquet are read by large C libraries; a damaged file has sent them into a crash or an endless loop before.
The child is a fork: it costs milliseconds, for the libraries are imported already. It hands the samples back through
memory that both share, and everything else as JSON: nothing that a hijacked child says is ever executed.
"""

from __future__ import annotations

import faulthandler
import json
import mmap
import os
import select
import signal
import sys
import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from pipelines.errors import EnvironmentFault, InputRejected, RrridError, UsageError
from pipelines.log.atomic import fault_of
from pipelines.log.experiment import Array

__all__ = ["Answer", "die_with_parent", "guarded", "shared_file"]

_SECONDS = 10.0  # a healthy file of 20 MB takes a tenth of it
_BYTES_A_SECOND = 5e6
_STOPPING = (signal.SIGINT, signal.SIGTERM)
_MEMORY = 1 << 30  # [B] beyond three times the file and what its samples need
_PR_SET_PDEATHSIG = 1  # prctl(2)


@dataclass(frozen=True)
class Answer:
    """What the child found: a JSON object and named arrays."""

    about: dict[str, Any]
    arrays: Mapping[str, Array]


def guarded(work: Callable[[], Answer], path: Path, *, seconds: float | None = None, memory: int | None = None) -> Answer:
    """Run `work` in a child process and return its answer.

    Args:
        work: reads `path`; import what it needs before, so that the child has it.
        seconds: the child is killed after so long; default 10 s and a second more for each 5 MB of the file.
        memory: how many bytes more than this process the child may use; default 1 GiB and 1200 times the file, at
            most 32 GiB: no more than what the budget of declared sizes lets pass.

    Raises:
        RrridError: what `work` raised.
        InputRejected: F03 where the library crashed or hung on the file.
    """
    size = path.stat().st_size
    limit = _SECONDS + size / _BYTES_A_SECOND if seconds is None else seconds
    budget = min(_MEMORY + 1200 * size, 32 << 30) if memory is None else memory
    store = shared_file()
    receive, send = os.pipe()
    # No signal between the fork and the child's own handlers: the child would run the rest of the parent's program.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOPPING)
    reader = os.getpid()
    try:
        with warnings.catch_warnings():
            # Python 3.12 warns of forks beside threads; ours runs one reader and leaves without touching any lock of theirs.
            warnings.simplefilter("ignore", DeprecationWarning)
            child = os.fork()
        if child == 0:
            os.close(receive)
            _serve(work, send, store, budget, reader)
        os.close(send)
        try:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            text, complete = _listen(receive, time.monotonic() + limit)
            if not complete:
                os.kill(child, signal.SIGKILL)
            _, status = os.waitpid(child, 0)
        except BaseException:
            _end(child)
            raise
        return _answer(text, complete, status, store, path, limit)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)  # where the fork itself failed
        os.close(receive)
        os.close(store)


def shared_file() -> int:
    """A file without a name that both processes can map."""
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


def _serve(work: Callable[[], Answer], send: int, store: int, budget: int, reader: int) -> NoReturn:
    """The child of `reader`: work, answer, leave without running anybody's clean-up."""
    code, lowered = 0, False
    try:
        die_with_parent()
        if os.getppid() != reader:  # it was killed before
            os._exit(0)
        # A signal for the whole group is the parent's to answer, and it ends this child: a child that died of it alone
        # would look like a file that crashes the library.
        for number in _STOPPING:
            signal.signal(number, signal.SIG_IGN)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _STOPPING)
        lowered = _limit_memory(budget)
        faulthandler.disable()  # a crash here is the parent's to tell
        try:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # HDF5 prints its error stack there
            answer = work()
            reply: dict[str, Any] = {"about": answer.about, "arrays": _store(answer.arrays, store)}
        except RrridError as problem:
            reply = {"error": {"exit": problem.exit_code, **problem.as_dict()}}
        except OSError as problem:  # of the machine: what a file does to its library, `work` has told
            fault = fault_of(problem, Path())
            reply = {"error": {"exit": fault.exit_code, **fault.as_dict(), "where": ""}}
        except MemoryError:
            reply = {"error": {"where": "", "remedy": "split the recording", **(
                {"exit": 6, "code": "RRID-P03", "message": "memory: reading it needs more than this process may use"}
                if lowered else
                {"exit": 3, "code": "RRID-X05", "message": "needs more memory than a log may"})}}
        text = json.dumps(reply).encode()
        while text:
            text = text[os.write(send, text):]
    except BaseException as problem:  # the parent tells it as an internal error; nothing may run past this line
        os.write(send, json.dumps({"internal": f"{type(problem).__name__}: {problem}"}).encode())
        code = 70
    finally:
        os._exit(code)


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


def _listen(receive: int, deadline: float) -> tuple[bytes, bool]:
    """Everything the child says until it closes its end; False where the time ran out first."""
    parts: list[bytes] = []
    while True:
        ready, _, _ = select.select([receive], [], [], max(0.0, deadline - time.monotonic()))
        if not ready:
            return b"".join(parts), False
        part = os.read(receive, 1 << 20)
        if not part:
            return b"".join(parts), True
        parts.append(part)


def _answer(text: bytes, complete: bool, status: int, store: int, path: Path, limit: float) -> Answer:
    if not complete:
        raise InputRejected("F03", f"reading did not end within {limit:.0f} s, the file is damaged", where=path,
                            remedy="copy the file again")
    if os.WIFSIGNALED(status):
        raise InputRejected("F03", f"the reading library crashed on it (signal {os.WTERMSIG(status)}), the file is damaged",
                            where=path,
                            remedy="copy the file again")
    reply = json.loads(text)
    if "error" in reply:
        kinds = {kind.exit_code: kind for kind in (UsageError, InputRejected, EnvironmentFault)}
        error = reply["error"]
        raise kinds.get(error["exit"], InputRejected)(error["code"].removeprefix("RRID-"), error["message"],
                                                      where=error["where"] or path, remedy=error["remedy"])
    if "internal" in reply:
        raise RuntimeError(f"reading {path}: {reply['internal']}")
    arrays = {name: _mapped(store, place) for name, place in reply["arrays"].items()}
    return Answer(reply["about"], arrays)


def _mapped(store: int, place: list[int]) -> Array:
    offset, *shape = place
    size = 8 * int(np.prod(shape))
    if size == 0:
        return np.empty(shape)
    whole = np.frombuffer(mmap.mmap(store, offset + size, prot=mmap.PROT_READ), dtype=np.float64, count=size // 8, offset=offset)
    return whole.reshape(shape)


def _end(child: int) -> None:
    try:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    except (ProcessLookupError, ChildProcessError):
        return
