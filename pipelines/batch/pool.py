"""Work on items in processes of this machine: one that crashes, hangs or eats its memory costs exactly its item."""

from __future__ import annotations

import os
import signal
import time
from collections import deque
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext
from typing import Any

from pipelines.batch.items import Item
from pipelines.batch.plan import Plan, plan_text
from pipelines.batch.record import Record
from pipelines.batch.server import warm_up
from pipelines.batch.work import attempt, begin, undone
from pipelines.errors import EnvironmentFault

__all__ = ["crashed", "local", "timed_out"]

_AHEAD = 2  # items handed out for each worker: the next one is there before the last one is done
_SECONDS = 0.1  # between two looks at whether to stop
_STARTS = 3  # of workers that end before they have done anything
_LATE = 2.0  # [s] for the answer of a process that is no longer there


def local(plan: Plan, key: str, items: Sequence[Item], jobs: int,
          stopped: Callable[[], bool]) -> Generator[tuple[Item, Record], None, None]:
    """Each item with its record, in the order in which they are done; ends early where `stopped` says so.

    Raises:
        EnvironmentFault: P04, no worker can be started.
    """
    from pebble import ProcessPool

    context = warm_up(plan.module)
    _refuse_no_locks(context)
    waiting, starts, text = deque(items), 0, plan_text(plan)
    while waiting and not stopped():
        told, tell = context.Pipe(duplex=False)
        pool: Any = ProcessPool(jobs, initializer=_begin, initargs=(text, key, tell), context=context)
        try:
            for item, record in _through(pool, _Watch(told), plan, key, waiting, jobs, stopped):
                starts = 0
                yield item, record
        except BrokenProcessPool:
            starts += 1
            if starts == _STARTS:
                raise EnvironmentFault("P04", "worker processes end before they begin", where="batch",
                                       remedy="raise --memory, or see the system's log") from None
        finally:
            pool.stop()
            pool.join()
            told.close()
            tell.close()


def _refuse_no_locks(context: ForkServerContext) -> None:
    """P04: the two locks of a pool lie in shared memory, which some containers do not let one write, or leave no room in."""
    try:
        _ = context.Lock(), context.Lock()
    except (OSError, ImportError) as problem:
        raise EnvironmentFault("P04", f"no worker can be started, for there is no shared memory: {problem}", where="batch",
                               remedy="make room in /dev/shm and let it be writable, or run the stage without batch") from None


def _begin(text: str, key: str, tell: Connection) -> None:
    """A worker ends at once when it is told to: what it was writing has not taken its place yet, and never will."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    _tell[:] = [tell]
    begin(text, key)


_tell: list[Connection] = []  # of a worker: the end of the pipe to its parent


def _attempt(item: Item) -> Record:
    """In a worker: say who is at the item, and do it."""
    _tell[0].send((os.getpid(), item.slug))
    return attempt(item)


class _Watch:
    """Which process is at which item: pebble waits for ever for the answer of one that ended with 0."""

    def __init__(self, told: Connection) -> None:
        self._told = told
        self._at: dict[str, int] = {}  # slug -> process
        self._gone: dict[Future[Record], float] = {}  # since when [s]

    def lost(self, running: Mapping[Future[Record], Item]) -> list[Future[Record]]:
        """Those of `running` whose process has gone, and whose answer has not come for a while."""
        while self._told.poll():
            process, place = self._told.recv()
            self._at[place] = process
        now = time.monotonic()
        gone = {future for future, item in running.items() if not future.done() and not _there(self._at.get(item.slug))}
        self._gone = {future: self._gone.get(future, now) for future in gone}
        return [future for future, since in self._gone.items() if now - since > _LATE]


def _there(process: int | None) -> bool:
    """Return whether the process still runs; one that has not said its number has not begun."""
    try:
        if process is not None:
            os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def _through(pool: Any, watch: _Watch, plan: Plan, key: str, waiting: deque[Item], jobs: int,
             stopped: Callable[[], bool]) -> Generator[tuple[Item, Record], None, None]:
    """Hand out `waiting` until it is empty. What was handed out when the pool broke goes back to it."""
    running: dict[Future[Record], Item] = {}
    try:
        while (waiting or running) and not stopped():
            while waiting and len(running) < _AHEAD * jobs:
                item = waiting.popleft()
                running[pool.schedule(_attempt, args=(item,), timeout=plan.options.timeout)] = item
            for future in wait(running, timeout=_SECONDS, return_when=FIRST_COMPLETED).done:
                if isinstance(future.exception(), BrokenProcessPool):
                    raise BrokenProcessPool
                if stopped():  # a signal for all of us: it was not the item that ended the worker
                    return
                item = running.pop(future)
                yield item, _outcome(future, item, plan, key)
            for future in watch.lost(running):
                item = running.pop(future)
                yield item, undone(item, crashed(0), plan, key)
    except (BrokenProcessPool, RuntimeError):  # pebble says the latter of a pool that broke before
        waiting.extendleft(reversed(running.values()))
        raise BrokenProcessPool from None


def _outcome(future: Future[Record], item: Item, plan: Plan, key: str) -> Record:
    from pebble import ProcessExpired

    problem = future.exception()
    if problem is None:
        return future.result()
    if isinstance(problem, ProcessExpired):
        return undone(item, crashed(problem.exitcode), plan, key)
    if isinstance(problem, TimeoutError):
        return undone(item, timed_out(plan.options.timeout), plan, key)
    return undone(item, problem, plan, key)


def crashed(exit_code: int) -> EnvironmentFault:
    """P04, for a worker that ended with `exit_code`, negative for a signal."""
    if exit_code >= 0:
        said, remedy = f"crashed: its process ended with {exit_code}", "run the stage on it alone"
    else:
        said, remedy = f"crashed signal {-exit_code} ({_signal_name(-exit_code)})", "run the stage on it alone"
        if exit_code == -signal.SIGKILL:
            remedy = "if the system killed it for want of memory, give fewer --jobs, or a limit with --memory"
    return EnvironmentFault("P04", said, remedy=remedy)


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return "?"


def timed_out(seconds: float | None) -> EnvironmentFault:
    """P05."""
    return EnvironmentFault("P05", f"timeout: not done within {seconds:g} s", remedy="raise --timeout, or look at the item alone")
