"""The process that the workers of a batch are forked from: it imports once what they all need.

    context = warm_up("pipelines.inspect")      as soon as it is known that there will be workers of that stage
"""

from __future__ import annotations

import multiprocessing
import signal
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.context import ForkServerContext
from multiprocessing.forkserver import ensure_running
from multiprocessing.util import Finalize
from typing import Final

from pipelines.batch.process import one_thread
from pipelines.io.atomic import remove_folder, temporary_folder

__all__ = ["warm_up"]

# The last is else imported by each worker, with its first log.
_NEEDED: Final = ("pipelines.batch.newborn", "pipelines.batch.work", "h5py")


_DEEPEST: Final = 36  # characters; of 104 for a socket, 67 are "/.rrrid-tmp-…/pymp-…/listener-…"
_AFTER_ALL: Final = -200  # priority at exit; `multiprocessing` removes its own temporary folder at -100


def warm_up(module: str) -> ForkServerContext:
    """Start the process, if it is not there yet: it imports while this one still looks for work.

    Workers that are forked from it are quick to replace, and have no locks of our threads in them.

    Args:
        module: of the stage: "pipelines.inspect"; one that does not exist is passed over.
    """
    one_thread()
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([*_NEEDED, module, *_main()])
    with _deaf(), _own_temporary_folder():
        ensure_running()
    return context


@contextmanager
def _own_temporary_folder() -> Iterator[None]:
    """Let `multiprocessing` make its temporary folder inside one that the next batch sweeps away where this process is killed.

    Where the system's own lies so deep that the name of a socket in it would be too long, nothing is changed.
    """
    if len(tempfile.gettempdir()) > _DEEPEST:
        yield
        return
    folder = temporary_folder()
    Finalize(None, remove_folder, args=[folder], exitpriority=_AFTER_ALL)
    before, tempfile.tempdir = tempfile.tempdir, str(folder)
    try:
        yield
    finally:
        tempfile.tempdir = before


@contextmanager
def _deaf() -> Iterator[None]:
    """What is started meanwhile does not hear Ctrl-C, which is this process's to answer: it would end in a traceback out of
    whatever it was just importing."""
    if threading.current_thread() is not threading.main_thread():  # no other thread may have handlers
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _main() -> list[str]:
    """What every worker imports again: the program that runs, where it is a file."""
    # A module that was started by its name (python -m) would complain of having been imported before.
    return ["__main__"] if getattr(sys.modules["__main__"], "__spec__", None) is None else []
