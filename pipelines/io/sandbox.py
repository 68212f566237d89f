"""Read files of unknown origin: small texts within bounds, all else in a child that may crash.

    answer = guarded(work, path)      `work` reads `path` in a child process of its own

HDF5 and Parquet are read by large C libraries; a damaged file has sent them into a crash or an
endless loop before. The child is a fork with limits of time and memory. It answers with JSON and
the bytes of arrays, which are held against the limits before anything is allocated for them.
"""

from __future__ import annotations

import contextlib
import faulthandler
import json
import math
import os
import re
import select
import signal
import stat
import sys
import time
import tomllib
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

from pipelines.errors import EnvironmentFault, InputRejected, RrridError, UsageError
from pipelines.io.config import SANDBOX, TEXT
from pipelines.io.output import environment_faults, fault_of

if TYPE_CHECKING:  # --help needs no NumPy
    import numpy as np
    import numpy.typing as npt

    Array = npt.NDArray[np.float64]

Place = TypeVar("Place", bytearray, memoryview)

_COUNT = 8  # numerics: [B] of the number that says how long a description is
_AGAIN = "copy the file again"
_STOPPING = (signal.SIGINT, signal.SIGTERM)
# a key of many parts, whose parsing takes time by the square of their number
_LONG_KEY = re.compile(rf"(?<![\w\"'-])(?:[\w\"'-]++[ \t]*+\.[ \t]*+){{{TEXT.parts},}}")


@dataclass(frozen=True)
class Answer:
    """The answer of a child: a JSON object and named arrays."""

    about: dict[str, Any]
    arrays: Mapping[str, Array]


class TomlError(ValueError):
    """The text is not TOML, or exceeds the bounds."""


def regular_file(
    path: Path, *, what: str = "a log, or a folder of logs", empty: bool = False
) -> os.stat_result:
    """Return the status of `path`; refuse all but a regular file that can be read and has bytes.

    Args:
        what: what belongs there, for the remedy.
        empty: let a file without bytes pass (F01).
    """
    try:
        status = path.stat()
    except FileNotFoundError:
        raise UsageError("C04", "no such file", path, "check the path") from None
    except ValueError:
        raise UsageError("C07", "not a path of this system", path, "check the path") from None
    except OSError as problem:
        raise fault_of(problem, path) from None
    if not stat.S_ISREG(status.st_mode):
        raise InputRejected("F12", "not a regular file", path, f"give {what}")
    if not os.access(path, os.R_OK):
        raise EnvironmentFault("F13", "permission denied", path, "change its permissions")
    if status.st_size == 0 and not empty:
        raise InputRejected("F01", "empty file", path, "copy it again, or record again")
    return status


def read_small_text(path: Path, limit: int = TEXT.size, *, what: str = "a TOML file") -> str:
    """Return the text in `path`, a regular file of at most `limit` bytes in UTF-8.

    Raises:
        UsageError: C04 no such file, C02 too long or not a text.
        InputRejected: F12, not a regular file. EnvironmentFault: F13, no permission.
    """
    regular_file(path, what=what, empty=True)
    # the path may have become a pipe meanwhile, and opening one would wait for ever
    flags = os.O_RDONLY | os.O_NONBLOCK
    with environment_faults(path), os.fdopen(os.open(path, flags), "rb") as file:
        data = file.read(limit + 1)
    if len(data) > limit:
        words = f"longer than the {limit} bytes that such a text may have"
        raise UsageError("C02", words, path, f"give {what}")
    try:
        return data.decode("utf-8").replace("\r\n", "\n")
    except UnicodeDecodeError as problem:
        words = f"not a text in UTF-8: byte {problem.start} is {data[problem.start]:#04x}"
        raise UsageError("C02", words, path, f"give {what}, saved as UTF-8") from None


def parse_toml(text: str) -> dict[str, Any]:
    """Return the table that `text` holds.

    Raises:
        TomlError: it is not TOML, or longer, wider or deeper than the bounds.
    """
    if len(text) > TEXT.size:
        raise TomlError(f"more than {TEXT.size} characters")
    if _LONG_KEY.search(text):
        raise TomlError(f"more than {TEXT.parts} parts of a key")
    try:
        table = tomllib.loads(text)
    except (ValueError, RecursionError) as problem:
        raise TomlError(str(problem)) from None
    level: list[Any] = [table]
    for _ in range(TEXT.depth):
        inner = (v.values() if isinstance(v, dict) else v for v in level)
        level = [x for values in inner for x in values if isinstance(x, dict | list)]
    if level:
        raise TomlError(f"more than {TEXT.depth} tables and lists within each other")
    return table


def guarded(
    work: Callable[[], Answer],
    path: Path,
    *,
    seconds: float | None = None,
    memory: int | None = None,
) -> Answer:
    """Run `work` in a child process and return its answer.

    Args:
        work: reads `path`; the modules that it needs are imported before, so the child has them.
        seconds: the child is killed after so long; by default longer for larger files.
        memory: [B] that the child may use beyond what this process does; by default as `seconds`.

    Raises:
        RrridError: what `work` raised.
        InputRejected: F03 where the library crashed or hung on the file, or what it gave is
            nonsense; X05 where it describes the file in an endless text.
    """
    size = path.stat().st_size
    if seconds is None:
        seconds = SANDBOX.seconds + size / SANDBOX.bytes_a_second
    if memory is None:
        memory = min(SANDBOX.memory + SANDBOX.memory_a_byte * size, SANDBOX.most_memory)
    longest = SANDBOX.description + SANDBOX.description_a_byte * size
    longest = min(longest, SANDBOX.most_description)
    reader, writer = os.pipe()
    child = _fork(work, reader, writer, seconds, memory)
    os.close(writer)
    ended, reason = False, "what came of reading it makes no sense"
    try:
        return _received(reader, path, longest, memory, seconds)
    except EOFError:
        ended, reason = True, "the reading library ended its process"
    except TimeoutError:
        reason = f"reading did not end within {seconds:.0f} s"
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        pass  # a child that the file has taken over
    finally:
        os.close(reader)
        crashed = _reaped(child, kill=not ended)
    if ended and crashed:
        reason = f"the reading library crashed on it (signal {crashed})"
    raise InputRejected("F03", f"{reason}, the file is damaged", path, _AGAIN)


def _fork(work: Callable[[], Answer], reader: int, writer: int, seconds: float, memory: int) -> int:
    """Return the process number of a child that does `work`."""
    # a signal between the fork and the child's own handlers would run the parent's program in it
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOPPING)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of a fork beside threads
            child = os.fork()
        if child == 0:
            os.close(reader)
            _serve(work, writer, seconds, memory)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    return child


def _serve(work: Callable[[], Answer], writer: int, seconds: float, memory: int) -> NoReturn:
    """Do the work in the child, send what it found, and leave without any clean-up."""
    try:
        # a signal for the whole group is the parent's to answer, and it ends this child
        for number in _STOPPING:
            signal.signal(number, signal.SIG_IGN)
        faulthandler.disable()
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):  # HDF5 prints its error stack
            os.dup2(nowhere, stream)
        reply, arrays = _replied(work, seconds, memory)
        text = json.dumps(reply).encode()
        with open(writer, "wb") as answer:
            answer.write(len(text).to_bytes(_COUNT))
            answer.write(text)
            for values in arrays:
                answer.write(values.reshape(-1).data.cast("B"))
    finally:
        os._exit(0)


def _replied(
    work: Callable[[], Answer], seconds: float, memory: int
) -> tuple[dict[str, Any], list[Array]]:
    """Return what `work` found, or why it found nothing, as JSON; and its arrays with bytes."""
    import numpy as np

    problem: RrridError
    lower = False
    try:
        lower = _limit(seconds, memory)
        answer = work()
        arrays = {k: np.ascontiguousarray(x, np.float64) for k, x in answer.arrays.items()}
        shapes = {name: values.shape for name, values in arrays.items()}
        reply = {"about": answer.about, "shapes": shapes}
        return reply, [values for values in arrays.values() if values.size]
    except RrridError as refused:
        problem = refused
    except OSError as fault:
        problem = fault_of(fault, Path())
        problem.where = ""
    except MemoryError:
        problem = InputRejected("X05", "needs more memory than it may", "", "split the recording")
        if lower:
            words, remedy = "memory: it needs more than an item may", "raise --memory"
            problem = EnvironmentFault("P03", words, remedy=f"{remedy}, or split the recording")
    except BaseException as fault:
        return {"internal": f"{type(fault).__name__}: {fault}"}, []
    return {"error": {"exit": problem.exit_code, **problem.as_dict()}}, []


def _limit(seconds: float, memory: int) -> bool:
    """Limit time and memory of this process; return whether its own limit of memory is lower."""
    import resource

    wanted = {resource.RLIMIT_CORE: 0, resource.RLIMIT_CPU: math.ceil(seconds) + 1}
    if sys.platform == "linux":
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        wanted[resource.RLIMIT_AS] = pages * resource.getpagesize() + memory
    lower = False
    for kind, value in wanted.items():
        hard = resource.getrlimit(kind)[1]
        lower |= kind == resource.RLIMIT_AS and 0 <= hard < value
        resource.setrlimit(kind, (value if hard < 0 else min(value, hard), hard))
    return lower


def _received(reader: int, path: Path, longest: int, memory: int, seconds: float) -> Answer:
    """Return what the child sends; raise what its work raised."""
    import numpy as np

    deadline = time.monotonic() + seconds
    length = int.from_bytes(_read(reader, bytearray(_COUNT), deadline))
    if length > longest:
        words = f"its description is longer than {longest / 1e6:.0f} MB"
        raise InputRejected("X05", words, path, "keep samples in signals, and texts short")
    reply = json.loads(_read(reader, bytearray(length), deadline))
    if "internal" in reply:
        raise RuntimeError(f"reading {path}: {reply['internal']}")
    if "error" in reply:
        kinds = {kind.exit_code: kind for kind in (UsageError, InputRejected, EnvironmentFault)}
        told = reply["error"]
        where, code = told["where"] or path, told["code"].removeprefix("RRID-")
        raise kinds.get(told["exit"], InputRejected)(code, told["message"], where, told["remedy"])
    shapes = reply["shapes"]
    sizes = [8 * math.prod(shape) for shape in shapes.values()]
    if sum(sizes) > memory or any(n < 0 for shape in shapes.values() for n in shape):
        raise ValueError("more samples than memory, or fewer than none")
    arrays = {}
    for name, size in zip(shapes, sizes, strict=True):
        values = np.empty(size // 8)
        if size:
            _read(reader, values.data.cast("B"), deadline)
        values.flags.writeable = False
        arrays[name] = values.reshape(shapes[name])
    return Answer(dict(reply["about"]), arrays)


def _read(reader: int, place: Place, deadline: float) -> Place:
    """Fill `place`; EOFError where the child ended before, TimeoutError at the deadline."""
    poll, left = select.poll(), memoryview(place)
    poll.register(reader)
    while left:
        if not poll.poll(1000.0 * max(0.0, deadline - time.monotonic())):
            raise TimeoutError
        count = os.readv(reader, [left])
        if not count:
            raise EOFError
        left = left[count:]
    return place


def _reaped(child: int, *, kill: bool) -> int:
    """Wait for the child, killed before where asked; return the signal it died of, or 0."""
    with contextlib.suppress(ProcessLookupError, ChildProcessError):
        if kill:
            os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
        return os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
    return 0  # a parent that ignores ends of children (SIGCHLD) does not learn how it ended
