"""Work on items in processes of this machine: one that crashes, hangs or eats its memory costs exactly its item."""

from __future__ import annotations

import multiprocessing
import signal
import sys
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from pipelines.batch.items import Item
from pipelines.batch.plan import Plan, plan_text
from pipelines.batch.process import one_thread
from pipelines.batch.record import Record
from pipelines.batch.work import attempt, begin, undone
from pipelines.errors import EnvironmentFault

__all__ = ["crashed", "local", "timed_out"]

_AHEAD = 2  # items handed out for each worker: the next one is there before the last one is done
_SECONDS = 0.1  # between two looks at whether to stop
_STARTS = 3  # of workers that end before they have done anything


def local(plan: Plan, key: str, items: Sequence[Item], jobs: int,
          stopped: Callable[[], bool]) -> Generator[tuple[Item, Record], None, None]:
    """Each item with its record, in the order in which they are done; ends early where `stopped` says so.

    Raises:
        EnvironmentFault: P04, no worker can be started.
    """
    from pebble import ProcessPool

    one_thread()
    # Forked from a clean server that has imported everything once: quick to replace, and no locks of our threads in it.
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["pipelines.batch.work", plan.module, *_main()])
    waiting, starts, text = deque(items), 0, plan_text(plan)
    while waiting and not stopped():
        pool: Any = ProcessPool(jobs, initializer=_begin, initargs=(text, key), context=context)
        try:
            for item, record in _through(pool, plan, key, waiting, jobs, stopped):
                starts = 0
                yield item, record
        except BrokenProcessPool:
            starts += 1
            if starts == _STARTS:
                raise EnvironmentFault("P04", "worker processes end before they begin", where="batch",
                                       remedy="raise --memory, or see what the system says of it") from None
        finally:
            pool.stop()
            pool.join()


def _main() -> list[str]:
    """What every worker imports again: the program that runs, where it is a file."""
    # A module that was started by its name (python -m) would complain of having been imported before.
    return ["__main__"] if getattr(sys.modules["__main__"], "__spec__", None) is None else []


def _begin(text: str, key: str) -> None:
    """A worker ends at once when it is told to: what it was writing has not taken its place yet, and never will."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    begin(text, key)


def _through(pool: Any, plan: Plan, key: str, waiting: deque[Item], jobs: int,
             stopped: Callable[[], bool]) -> Generator[tuple[Item, Record], None, None]:
    """Hand out `waiting` until it is empty. What was handed out when the pool broke goes back to it."""
    running: dict[Future[Record], Item] = {}
    try:
        while (waiting or running) and not stopped():
            while waiting and len(running) < _AHEAD * jobs:
                item = waiting.popleft()
                running[pool.schedule(attempt, args=(item,), timeout=plan.options.timeout)] = item
            for future in wait(running, timeout=_SECONDS, return_when=FIRST_COMPLETED).done:
                if isinstance(future.exception(), BrokenProcessPool):
                    raise BrokenProcessPool
                if stopped():  # a signal for all of us: it was not the item that ended the worker
                    return
                item = running.pop(future)
                yield item, _outcome(future, item, plan, key)
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
