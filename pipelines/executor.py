"""Run a stage on many items in processes that may die, of this machine or of a Dask cluster.

    for item, record in run_items(plan, waiting, stopped): ...

An item that crashes, hangs or exhausts its memory fails by itself. Its result is what its own
command writes, whichever process computes it.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field, replace
from importlib import import_module
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext, SpawnProcess
from pathlib import Path
from typing import Any

from pipelines.errors import (
    EnvironmentFault,
    InputRejected,
    NothingMatched,
    RrridError,
    UsageError,
    clean,
)
from pipelines.io.output import PROVENANCE, hash_file, renamed, slug, tilde
from pipelines.io.sessions import SeveralSessions
from pipelines.report.batch_report import DoneItem, Problem, Status
from pipelines.report.result_figures import fitted, residuals
from pipelines.stage import Outcome, Request, Stage, run_stage

_ALONE = "run the stage on it alone"
_LEFT = 256  # numerics: an exit code that no process has, instead of 0
_STOPPING = (signal.SIGINT, signal.SIGTERM)


@dataclass(frozen=True)
class Plan:
    """A batch: one stage with its settings, and how and where it runs on the folders of a root."""

    module: str  # of the stage: "pipelines.inspect"
    settings: Any  # the stage's own
    request: Request  # options of every item; its paths, output and session are the item's
    root: Path  # absolute; records name files relative to it
    out: Path  # absolute
    jobs: int = 1  # items at a time
    memory: int | None = None  # [B] that an item may use beyond what its process has at the start
    timeout: float | None = None  # [s] for one item
    backend: str = "local"  # or dask://HOST:PORT
    resume: bool = False
    shard: tuple[int, int] = (1, 1)  # I, N: every Nth item from the Ith on
    folder: str = field(default_factory=os.getcwd)  # where relative paths of the settings begin

    @property
    def stage(self) -> str:
        return load_stage(self.module).name


@dataclass(frozen=True)
class Item:
    """One folder of logs, or one session of it."""

    name: str  # its path relative to the root, "." for the root itself; with the session
    paths: tuple[Path, ...]  # what the stage is given
    logs: tuple[Path, ...]  # the logs among and below them
    session: str = ""  # the only one to take

    @property
    def slug(self) -> str:
        """The name as a file name; two names never share one."""
        return slug(self.name)


@dataclass(frozen=True)
class Record:
    """The outcome of one item, with what decides whether it still holds."""

    item: DoneItem
    slug: str  # of its folder
    figures: Mapping[str, tuple[float, float, str]] = field(
        default_factory=dict
    )  # value, std, unit
    residuals: Mapping[str, tuple[float, str]] = field(default_factory=dict)  # value, unit
    inputs: Mapping[str, str] = field(default_factory=dict)  # file -> SHA-256
    logs: tuple[str, ...] = ()
    provenance: str = ""  # SHA-256 of the item's provenance.json; empty without a result
    key: str = ""  # of the plan
    trace: str = ""  # of an internal error
    sessions: tuple[str, ...] = ()  # of several robots or days: each is an item of its own


@dataclass(frozen=True)
class Workers:
    """The processes of this machine, or of a cluster."""

    submit: Callable[[Item], Future[Record]]
    ahead: int  # items to keep in hand: the next one is there when a worker is done
    alive: Callable[[], bool]
    gone: Exception  # where they are not


def load_stage(module: str) -> Stage[Any, Any]:
    """Return the stage of a module."""
    stage: Stage[Any, Any] = import_module(module).STAGE
    return stage


def relative(path: Path, plan: Plan) -> str:
    """Return `path` as records name it."""
    return path.relative_to(plan.root).as_posix() if path.is_relative_to(plan.root) else str(path)


def attempt(plan: Plan, item: Item) -> Record:
    """Run the stage on one item; an error becomes its record."""
    out = plan.out / "items" / item.slug
    request = replace(plan.request, paths=item.paths, out=out, session=item.session, check=True)
    request = replace(request, force=True)  # all below `out` is the batch's own
    try:
        return _record(plan, item, run_stage(load_stage(plan.module), request, plan.settings))
    except SeveralSessions as problem:
        return replace(failed(plan, item, problem), sessions=problem.names)
    except Exception as problem:
        return failed(plan, item, problem)


def _record(plan: Plan, item: Item, outcome: Outcome[Any]) -> Record:
    kinds: dict[int, Status] = {0: "ok", 1: "found", InputRejected.exit_code: "rejected"}
    status = kinds.get(outcome.exit_code, "failed")
    rejected = [check for check in outcome.checks if check.level == "reject"]
    error = None
    if rejected and status in ("rejected", "failed"):
        error = Problem(**rejected[0].as_error().as_dict())
    inputs = outcome.inputs
    own = [opened.log.recorded for opened in inputs.logs if opened.log.role != "reference"]
    done = DoneItem(
        clean(item.name),
        status,
        error,
        clean(outcome.report.verdict, None),
        outcome.exit_code,
        inputs.robot_name,
        min(filter(None, own), default=None),
        f"items/{item.slug}",
    )
    turning = inputs.logs[0].log.robot.revolute if inputs.logs else ()
    return Record(
        done,
        item.slug,
        figures=fitted(outcome.json),
        residuals=residuals(outcome.json, turning),
        inputs={
            relative(path, plan): inputs.hashes.get(path) or hash_file(path)
            for path in inputs.sources
            if path.is_file()
        },
        logs=tuple(relative(log, plan) for log in item.logs),
        provenance=hash_file(outcome.folder / PROVENANCE),
    )


def failed(plan: Plan, item: Item, problem: BaseException) -> Record:
    """Return the record of an item without a result."""
    trace = ""
    if isinstance(problem, MemoryError):
        remedy = "raise --memory, or split its logs"
        problem = EnvironmentFault("P03", "memory: it needs more than an item may", remedy=remedy)
    if not isinstance(problem, RrridError):
        trace = "".join(traceback.format_exception(problem))
        words = f"internal error: {type(problem).__name__}: {problem}"
        problem = RrridError("Z70", words, remedy="please report it, with the file in crashes")
    status: Status = "rejected" if isinstance(problem, InputRejected | NothingMatched) else "failed"
    name = clean(item.name)
    error = Problem(problem.code, problem.where or name, problem.message, problem.remedy)
    error = tilde(renamed(error, {str(plan.root): ""}))
    done = DoneItem(name, status, error, "", problem.exit_code, "", None, None)
    return Record(done, item.slug, trace=trace)


def run_items(
    plan: Plan, waiting: deque[Item], stopped: Callable[[], bool], restarts: int = 3
) -> Iterator[tuple[Item, Record]]:
    """Yield each item of `waiting` with its record as it is done, until `stopped()`.

    Items that the caller appends meanwhile are run as well. A worker that dies without an item
    breaks pebble's pool: another takes its place, and what was in hand is queued again.

    Args:
        restarts: pools that may break one after another without an item done.

    Raises:
        UsageError: C02, no such backend.
        EnvironmentFault: P04, no worker can be started, or the scheduler is out of reach.
    """
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # of the workers: there are as many as processors
    pool = _local if plan.backend == "local" else _cluster
    broken = 0
    while waiting and not stopped():
        running: dict[Future[Record], Item] = {}
        try:
            with pool(plan) as workers:
                while (waiting or running) and not stopped():
                    while waiting and len(running) < workers.ahead:
                        future = workers.submit(waiting[0])
                        running[future] = waiting.popleft()
                    if not workers.alive():
                        raise workers.gone
                    for future in wait(running, timeout=0.1, return_when=FIRST_COMPLETED).done:
                        problem = workers.gone if future.cancelled() else future.exception()
                        if stopped():  # the signal went to the workers too: no item ended them
                            return
                        if problem is workers.gone or isinstance(problem, BrokenProcessPool):
                            raise problem
                        broken, item = 0, running.pop(future)
                        fault = None if problem is None else _fault(problem, plan)
                        yield item, failed(plan, item, fault) if fault else future.result()
        except BrokenProcessPool:
            waiting.extendleft(reversed(running.values()))
            broken += 1
            if broken == restarts:
                words = "worker processes end before they begin"
                remedy = "raise --memory, and --resume"
                raise EnvironmentFault("P04", words, "batch", remedy) from None


def _fault(problem: Any, plan: Plan) -> BaseException:
    """Return the fault behind an exception of pebble or Dask (P04, P05)."""
    kind = type(problem).__name__
    if isinstance(problem, TimeoutError) and plan.timeout is not None:
        words = f"timeout: not done within {plan.timeout:g} s"
        return EnvironmentFault("P05", words, remedy="raise --timeout, or look at the item alone")
    if kind == "ProcessExpired":
        return _crashed(problem.exitcode)
    if kind == "KilledWorker":
        return EnvironmentFault("P04", "crashed: every worker that had it died", remedy=_ALONE)
    found: BaseException = problem
    return found


def _crashed(exit_code: int) -> EnvironmentFault:
    """P04, of a process that ended with `exit_code`, negative for a signal."""
    words, remedy = f"crashed: its process ended with {exit_code % _LEFT}", _ALONE
    if exit_code < 0:
        words = f"crashed signal {-exit_code} ({signal.Signals(-exit_code).name})"
    if exit_code == -signal.SIGKILL:
        remedy = "if it was killed for want of memory, give fewer --jobs, or a limit with --memory"
    return EnvironmentFault("P04", words, remedy=remedy)


class _Worker(SpawnProcess):
    """A worker of pebble; one that ends with 0 would count as one that pebble has stopped."""

    @property
    def exitcode(self) -> int | None:
        code = super().exitcode
        return _LEFT if code == 0 else code


class _Context(SpawnContext):
    Process = _Worker  # type: ignore[assignment]


@contextlib.contextmanager
def _local(plan: Plan) -> Iterator[Workers]:
    """Let processes of this machine do the items."""
    from pebble import ProcessPool

    pool: Any = ProcessPool(plan.jobs, initializer=_begin, initargs=(plan,), context=_Context())

    def submit(item: Item) -> Future[Record]:
        before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOPPING)  # workers do not hear Ctrl-C
        try:
            future: Future[Record] = pool.schedule(attempt, (plan, item), timeout=plan.timeout)
            return future
        except (OSError, ImportError) as problem:
            words = f"no worker can be started, for there is no shared memory: {problem}"
            remedy = "make room in /dev/shm and let it be writable, or run the stage without batch"
            raise EnvironmentFault("P04", words, "batch", remedy) from None
        except RuntimeError as problem:
            raise BrokenProcessPool(problem) from None
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    try:
        yield Workers(submit, 2 * plan.jobs, lambda: bool(pool.active), BrokenProcessPool())
    finally:
        pool.stop()
        pool.join()


def _begin(plan: Plan) -> None:
    """Make this process a worker: it ends on SIGTERM, and with its parent."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGTERM])
    threading.Thread(target=_end_with_parent, args=(os.getppid(),), daemon=True).start()
    if os.path.isdir(plan.folder):  # else on another machine
        os.chdir(plan.folder)
    load_stage(plan.module)
    if plan.memory is not None and sys.platform == "linux":
        import resource

        pages = int(Path("/proc/self/statm").read_text().split()[0])
        limit = pages * resource.getpagesize() + plan.memory
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _end_with_parent(parent: int, seconds: float = 0.2) -> None:
    while os.getppid() == parent:
        time.sleep(seconds)
    os._exit(1)


@contextlib.contextmanager
def _cluster(plan: Plan) -> Iterator[Workers]:
    """Let a Dask cluster do the items; those of a worker that dies are done by the others."""
    scheme, _, place = plan.backend.partition("://")
    if scheme != "dask" or not place:
        words = f"'{plan.backend}' is no cluster"
        raise UsageError("C02", words, where="--backend", remedy="write dask://HOST:PORT")
    try:
        import distributed
    except ImportError:
        words, remedy = "the extra 'cluster' is not installed", "pip install 'rrrid[cluster]'"
        raise UsageError("C02", words, where="--backend", remedy=remedy) from None
    try:
        connect: Any = distributed.Client
        client = connect(f"tcp://{place}", timeout=10.0, set_as_default=False)
    except (OSError, ValueError) as problem:
        words, remedy = f"the scheduler cannot be reached: {problem}", "start it: dask scheduler"
        raise EnvironmentFault("P04", words, where=plan.backend, remedy=remedy) from None
    executor = client.get_executor(pure=False)
    words, remedy = "the scheduler went away", "start it again, and go on with --resume"
    gone = EnvironmentFault("P04", words, "--backend", remedy)
    try:
        yield Workers(
            lambda item: executor.submit(in_child, plan, item),
            ahead=sys.maxsize,
            alive=lambda: bool(client.status == "running"),
            gone=gone,
        )
    finally:
        if client.status == "running":
            with contextlib.suppress(OSError, RuntimeError):
                executor.shutdown(wait=False)
                client.run(_end_children, str(plan.out), on_error="ignore")
        client.close()


def in_child(plan: Plan, item: Item) -> Record:
    """Run one item in a child of this Dask worker, which must not die of it.

    Dask's workers are daemons, and may not start processes by `multiprocessing`.
    """
    ours, theirs = multiprocessing.Pipe()
    program = "from pipelines.executor import serve; serve()"
    process = subprocess.Popen(
        [sys.executable, "-c", program, str(theirs.fileno()), str(plan.out)],
        pass_fds=[theirs.fileno()],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )
    theirs.close()
    try:
        ours.send((plan, item))
        ours.recv()  # it has imported what it needs, and its time begins
        if not ours.poll(plan.timeout):
            return failed(plan, item, _fault(TimeoutError(), plan))
        record: Record = ours.recv()
        return record
    except (EOFError, OSError):
        return failed(plan, item, _crashed(process.wait()))
    finally:
        process.kill()
        process.wait()
        ours.close()


def serve() -> None:
    """Do one item, in the child; sys.argv holds the handle of the pipe, and the output."""
    connection = Connection(int(sys.argv[1]))
    plan, item = connection.recv()
    _begin(plan)
    connection.send(None)
    connection.send(attempt(plan, item))


def _end_children(out: str) -> None:
    """End the children of this Dask worker that write into `out`."""
    import psutil

    for child in psutil.Process().children():
        with contextlib.suppress(psutil.NoSuchProcess):
            if child.cmdline()[-1:] == [out]:
                child.kill()
