"""Work on items on a Dask cluster whose workers see the same files: logs and output at the same paths.

Each worker keeps one child (`child.py`) for each of its threads. A worker that dies has its items done again by the others; an item
that has been with several dead workers is failed, never lost.
"""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Callable, Generator, Sequence
from typing import Any

from pipelines.batch.child import Child, item_of, words_of
from pipelines.batch.items import Item
from pipelines.batch.plan import Plan, plan_text
from pipelines.batch.record import Record, read_record
from pipelines.batch.work import undone
from pipelines.errors import EnvironmentFault, UsageError

__all__ = ["cluster"]

_SECONDS = 10.0  # to reach the scheduler
_LOOK = 0.2  # [s] between two looks at whether to stop
_mine = threading.local()


def cluster(address: str, plan: Plan, key: str, items: Sequence[Item],
            stopped: Callable[[], bool]) -> Generator[tuple[Item, Record], None, None]:
    """Each item with its record, in the order in which they are done; ends early where `stopped` says so.

    Args:
        address: dask://host:port, of the scheduler.

    Raises:
        UsageError: C02, no such address, or the extra `cluster` is not installed.
        EnvironmentFault: P04, the scheduler cannot be reached, or it went away.
    """
    with _client(address) as client:
        text = plan_text(plan)
        # Priority by order: what comes first is done first, and its error ends a batch that shall abort as early as it can.
        futures = {client.submit(_remote, text, key, words_of(item), pure=False, priority=-place): item
                   for place, item in enumerate(items)}
        try:
            yield from _gathered(client, futures, plan, key, stopped)
        finally:
            if client.status == "running":
                with contextlib.suppress(OSError, RuntimeError):
                    client.cancel(list(futures), force=True)
                    client.run(_release, key, on_error="ignore")


def _client(address: str) -> Any:
    scheme, _, place = address.partition("://")
    if scheme != "dask" or not place:
        raise UsageError("C02", f"'{address}' is no cluster", where="--backend", remedy="write dask://HOST:PORT")
    try:
        import distributed
    except ImportError:
        raise UsageError("C02", "the extra 'cluster' is not installed", where="--backend",
                         remedy="pip install 'rrrid[cluster]'") from None
    try:
        connect: Any = distributed.Client
        return connect(f"tcp://{place}", timeout=_SECONDS, set_as_default=False)
    except (OSError, ValueError) as problem:
        raise EnvironmentFault("P04", f"the scheduler cannot be reached: {problem}", where=address,
                               remedy="start it: dask scheduler") from None


def _gathered(client: Any, futures: dict[Any, Item], plan: Plan, key: str,
              stopped: Callable[[], bool]) -> Generator[tuple[Item, Record], None, None]:
    """Futures as they are done; a look at `stopped` and at the scheduler every now and then."""
    ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
    for future in futures:
        future.add_done_callback(ended.put)
    left = len(futures)
    while left and not stopped():
        future = None
        with contextlib.suppress(queue.Empty):
            future = ended.get(timeout=_LOOK)
        if client.status != "running" or (future is not None and future.status == "cancelled"):
            raise _gone()
        if future is not None:
            left -= 1
            yield futures[future], _outcome(future, futures[future], plan, key)


def _gone() -> EnvironmentFault:
    return EnvironmentFault("P04", "the scheduler went away", where="--backend", remedy="start it again, and go on with --resume")


def _outcome(future: Any, item: Item, plan: Plan, key: str) -> Record:
    try:
        problem = future.exception()
        answer = future.result() if problem is None else None
    except OSError:  # the result lay on the scheduler's side of a connection that is cut
        raise _gone() from None
    if answer is not None:
        return read_record(answer)
    if type(problem).__name__ == "KilledWorker":
        problem = EnvironmentFault("P04", "crashed: every worker that had it died", remedy="run the stage on it alone")
    return undone(item, problem, plan, key)


def _remote(text: str, key: str, words: dict[str, Any]) -> dict[str, Any]:
    """On a worker: let this thread's child do it."""
    import dataclasses

    child: Child | None = getattr(_mine, "child", None)
    if child is None or (child.text, child.key) != (text, key):
        if child is not None:
            child.end()
        child = _mine.child = Child(text, key)
        _children.append(child)
    return dataclasses.asdict(child.attempt(item_of(words), child.plan.options.timeout))


_children: list[Child] = []


def _release(key: str) -> None:
    """On a worker: nobody will ask the children of this plan again."""
    for child in [one for one in _children if one.key == key]:
        _children.remove(child)
        child.end()
