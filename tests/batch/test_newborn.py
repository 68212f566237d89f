"""A worker whose batch ends while it starts says nothing; one that cannot start for another reason does."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.commands import REPO

_STARTED = """
import _multiprocessing
import os
from pipelines.batch.server import warm_up
from tests.batch.test_newborn import Elsewhere, Unready

context = warm_up("pipelines.inspect")
shared = {shared}
{gone}
worker = context.Process(target=print, args=(shared,))
worker.start()
worker.join()
os._exit(worker.exitcode)
"""


class Unready:
    """Cannot be brought into another process."""

    def __reduce__(self) -> tuple[type[int], tuple[str]]:
        return int, ("no number",)


def lost(path: str) -> None:
    Path(path).read_text(encoding="utf-8")


class Elsewhere:
    """Needs a file that is not there."""

    def __reduce__(self) -> tuple[Callable[[str], None], tuple[str]]:
        return lost, ("/nowhere/at/all",)


@pytest.mark.parametrize(("shared", "gone", "told"), [
    ("context.Lock()", "_multiprocessing.sem_unlink(shared._semlock.name)", ""), ("Unready()", "", "ValueError"),
    ("Elsewhere()", "", "/nowhere/at/all")])
def test_only_what_is_gone_with_the_batch_is_not_told(shared: str, gone: str, told: str) -> None:
    words = [sys.executable, "-c", _STARTED.format(shared=shared, gone=gone)]
    done = subprocess.run(words, env=os.environ | {"PYTHONPATH": str(REPO)}, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert told in done.stderr
    assert bool(told) == ("Traceback" in done.stderr), done.stderr


_INTERRUPTED = """
import os, signal, time
signal.signal(signal.SIGINT, lambda *_: None)
from pipelines.batch.server import warm_up

warm_up("pipelines.run")
time.sleep(0.3)  # what it imports takes longer
os.killpg(0, signal.SIGINT)
context = warm_up("pipelines.run")
worker = context.Process(target=print, args=("here",))
worker.start()
worker.join()
os._exit(worker.exitcode)
"""


def test_what_workers_are_forked_from_does_not_hear_an_interruption_while_it_imports() -> None:
    """Ctrl-C goes to the whole group; it is this process's to answer, and workers go on as long as that wants them."""
    done = subprocess.run([sys.executable, "-c", _INTERRUPTED], env=os.environ | {"PYTHONPATH": str(REPO)}, capture_output=True,
                          text=True, check=False, start_new_session=True)
    assert (done.returncode, done.stdout) == (0, "here\n")
    assert not done.stderr
