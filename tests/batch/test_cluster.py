"""A batch on a Dask cluster: a real scheduler, two worker processes, one of them killed in the middle."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.batch.conftest import Lay, contents, obey, statuses
from tests.cli.commands import REPO

QUIET = {"DASK_LOGGING__DISTRIBUTED": "critical", "DASK_DISTRIBUTED__WORKER__MEMORY__TERMINATE": "false"}


class Cluster:
    """A scheduler and two workers of one thread each, without nannies: who is dead stays dead."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self.folder, self.stack = folder, stack
        where = folder / "scheduler.json"
        self.scheduler = self._process("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-show",
                                       "--scheduler-file", str(where))
        self.workers = [self._process("worker", "--no-nanny", "--nthreads", "1", "--no-dashboard", "--scheduler-file", str(where),
                                      "--local-directory", str(folder)) for _ in range(2)]
        deadline = time.monotonic() + 60.0
        while not where.exists() or not where.read_text().endswith("}"):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        self.address = json.loads(where.read_text())["address"].replace("tcp://", "dask://")

    def _process(self, *words: str) -> subprocess.Popen[bytes]:
        process = subprocess.Popen([sys.executable, "-m", "dask", *words], cwd=self.folder, stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL, env=os.environ | QUIET | {"PYTHONPATH": str(REPO)})
        self.stack.callback(process.wait)
        self.stack.callback(process.kill)
        return process


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with ExitStack() as stack:
        yield Cluster(tmp_path_factory.mktemp("cluster"), stack)


ITEMS = {f"{i:02d}": f"value {i} std 0.1" for i in range(1)}


@pytest.mark.row("P12", "P04")
def test_a_cluster_gives_the_same_bytes_and_bears_the_same_misfortunes(lay: Lay, tmp_path: Path, cluster: Cluster) -> None:
    """P12, P04: what each item is, is what it is in local processes; a crash costs its own item."""
    root = lay(ITEMS | {"rejected": "reject", "segfault": "crash"})
    away = obey(root, backend=cluster.address)
    here = obey(root, out=tmp_path / "here", jobs=2)
    assert away.exit_code == 4
    assert statuses(away) == statuses(here)
    assert {place: text for place, text in contents(away.folder).items() if not place.startswith("crashes")} == {
        place: text for place, text in contents(here.folder).items() if not place.startswith("crashes")}


@pytest.mark.slow
def test_no_item_is_lost_with_its_worker(lay: Lay, tmp_path: Path, cluster: Cluster) -> None:
    """One of two workers is killed while it is at an item: that one and those that waited for it are done by the other."""
    root = lay({f"{i}": f"value {i} std 0.1 started {tmp_path / 'started'} sleep 0.4" for i in range(6)})

    def kill() -> None:
        while not (tmp_path / "started").exists():
            time.sleep(0.01)
        time.sleep(0.1)
        os.kill(cluster.workers[0].pid, signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    away = obey(root, backend=cluster.address)
    killer.join()
    assert cluster.workers[0].wait() == -signal.SIGKILL
    assert statuses(away) == dict.fromkeys("012345", "ok")
    assert contents(away.folder) == contents(obey(root, out=tmp_path / "here", jobs=2).folder)
    assert not list(away.folder.rglob(".rrrid-tmp-*"))
