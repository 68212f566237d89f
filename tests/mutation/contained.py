"""Read damaged files in a child process, one after another: a crash, a hang or a flood of memory is an outcome, not the end.

    with Contained(work) as child:
        outcome = child.run(data)
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import resource
import select
import signal
import struct
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType

from pipelines.errors import RrridError

__all__ = ["Contained", "Outcome"]

_HUNG = 30.0  # [s] the bar is 10; what lies between is measured
_MEMORY = 4 << 30  # [B] protects the machine; the bar of 1 GB is asked of the measured peak


@dataclass(frozen=True)
class Outcome:
    """How one file was taken, as an exit code: 0 read, 2, 3, 5, 6 as the error says, 70 an error of ours, -N died of signal N."""

    exit: int
    code: str = ""
    words: str = ""
    seconds: float = 0.0
    memory: int = 0  # [B] largest resident size so far, of the child or of one of its own children
    again: int = 0  # times that it was timed again


class Contained:
    """A forked process that runs `work` on whatever bytes it is sent, and says how that ended."""

    def __init__(self, work: Callable[[bytes], None]) -> None:
        self._work = work
        self._child = 0

    def __enter__(self) -> Contained:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None) -> None:
        self._end()

    def run(self, data: bytes) -> Outcome:
        if not self._child:
            self._start()
        began = time.monotonic()
        self._send.write(struct.pack("<Q", len(data)) + data)
        self._send.flush()
        ready, _, _ = select.select([self._receive], [], [], _HUNG)
        reply = self._receive.readline() if ready else b""
        seconds = time.monotonic() - began
        if reply:
            exit_code, code, words, memory = json.loads(reply)
            return Outcome(exit_code, code, words, seconds, memory)
        return Outcome(-(self._end() or 1), "" if ready else "hung", "", seconds)

    def _start(self) -> None:
        there, send = os.pipe()
        receive, back = os.pipe()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # a fork beside threads: this child takes none of their locks
            self._child = os.fork()
        if self._child == 0:
            os.close(send)
            os.close(receive)
            _serve(self._work, there, back)
        os.close(there)
        os.close(back)
        self._send, self._receive = os.fdopen(send, "wb"), os.fdopen(receive, "rb", buffering=0)

    def _end(self) -> int:
        """Kill what still runs; the signal the child died of."""
        if not self._child:
            return 0
        self._send.close()
        self._receive.close()
        with contextlib.suppress(ProcessLookupError):
            os.kill(self._child, signal.SIGKILL)
        _, status = os.waitpid(self._child, 0)
        self._child = 0
        return os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0


def _serve(work: Callable[[bytes], None], receive: int, send: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, int(signal.SIGKILL), 0, 0, 0)  # PR_SET_PDEATHSIG: end with the parent
    warnings.simplefilter("ignore")  # as in the command; the tests make errors of them
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, resource.RLIM_INFINITY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    with os.fdopen(receive, "rb") as inward:
        while head := inward.read(8):
            data = inward.read(struct.unpack("<Q", head)[0])
            exit_code, code, words = _judged(work, data)
            peak = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
            os.write(send, json.dumps([exit_code, code, words[:300], peak * 1024]).encode() + b"\n")
    os._exit(0)


def _judged(work: Callable[[bytes], None], data: bytes) -> tuple[int, str, str]:
    """What the command would end with."""
    try:
        work(data)
    except RrridError as problem:
        complete = problem.code and problem.remedy  # a place that the computation does not know, run_stage adds
        return problem.exit_code, problem.code, str(problem) if complete else f"INCOMPLETE {problem}"
    except BaseException as problem:
        import traceback

        at = traceback.extract_tb(problem.__traceback__)[-1]
        return 70, type(problem).__name__, f"{problem} ({at.filename.rsplit('/', 1)[-1]}:{at.lineno})"
    return 0, "", ""
