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

from pipelines.batch import read_ledger
from pipelines.errors import EnvironmentFault
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


ITEMS = {f"{i:02d}": f"value {i} std 0.1" for i in range(8)}


@pytest.mark.row("P12", "P03", "P04", "P05")
def test_a_cluster_gives_the_same_bytes_and_bears_the_same_misfortunes(lay: Lay, tmp_path: Path, cluster: Cluster) -> None:
    """P12, P03-P05: what each item is, is what it is in local processes; crash, hang and memory cost their own items."""
    root = lay(ITEMS | {"big": "memory", "bug": "bug", "hung": "sleep 60", "rejected": "reject", "segfault": "crash"})
    limits = {"timeout": 3.0, "memory": 1 << 30}
    away = obey(root, backend=cluster.address, **limits)
    here = obey(root, out=tmp_path / "here", jobs=2, **limits)
    assert away.exit_code == 4
    assert statuses(away) == statuses(here)
    assert {place: text for place, text in contents(away.folder).items() if not place.startswith("crashes")} == {
        place: text for place, text in contents(here.folder).items() if not place.startswith("crashes")}


@pytest.mark.slow
@pytest.mark.row("P06", "P07")
@pytest.mark.parametrize(("number", "exit_code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_a_batch_and_leaves_the_cluster_free(lay: Lay, tmp_path: Path, cluster: Cluster, number: signal.Signals,
                                                           exit_code: int) -> None:
    """P06: a summary within 5 s while both workers are at long items, which are dropped; the next batch has the workers at once."""
    begun = [tmp_path / "begun-2", tmp_path / "begun-3"]
    root = lay({"0": "value 0 std 0.1", "1": "value 1 std 0.1", "2": f"started {begun[0]} sleep 60",
                "3": f"started {begun[1]} sleep 60", "4": "value 4 std 0.1"})
    program = ("import sys\nfrom pathlib import Path\nfrom tests.batch.conftest import obey\n"
               "sys.exit(obey(Path(sys.argv[1]), backend=sys.argv[2]).exit_code)\n")
    with subprocess.Popen([sys.executable, "-c", program, str(root), cluster.address], text=True, stderr=subprocess.PIPE,
                          env=os.environ | QUIET | {"PYTHONPATH": str(REPO)}, start_new_session=True) as process:
        deadline = time.monotonic() + 60.0
        while not (all(path.exists() for path in begun) and {"0", "1"} <= set(read_ledger(tmp_path / "out"))):
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.02)
        began = time.monotonic()
        os.killpg(process.pid, number)
        _, said = process.communicate(timeout=60)
        lasted = time.monotonic() - began
    assert process.returncode == exit_code, said
    assert lasted < 5.0
    assert "Traceback" not in said
    assert not list((tmp_path / "out").rglob(".rrrid-*"))
    items = json.loads((tmp_path / "out/result.json").read_text())["items"]
    codes = {item["name"]: (item["error"] or {}).get("code") for item in items}
    assert codes == {"0": None, "1": None, "2": "RRID-P06", "3": "RRID-P06", "4": "RRID-P06"}
    lay({"2": "fine", "3": "fine"})
    began = time.monotonic()
    resumed = obey(root, backend=cluster.address, resume=True)
    assert time.monotonic() - began < 20.0
    assert json.loads((resumed.folder / "provenance.json").read_text())["kept"] == 2
    assert contents(resumed.folder) == contents(obey(root, out=tmp_path / "whole").folder)


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


@pytest.mark.slow
def test_a_scheduler_that_is_gone_is_exit_6_and_can_be_gone_on_from(lay: Lay, tmp_path: Path, cluster: Cluster) -> None:
    """It goes away in the middle: what is done is kept, the rest is done by --resume, here or on another cluster."""
    root = lay({f"{i}": f"sleep {0.2 if i < 4 else 1.5} started {tmp_path / 'started'}{i}" for i in range(6)})

    def kill() -> None:
        while not (tmp_path / "started4").exists() or "0" not in read_ledger(tmp_path / "out"):
            time.sleep(0.01)
        cluster.scheduler.kill()

    killer = threading.Thread(target=kill)
    killer.start()
    with pytest.raises(EnvironmentFault) as gone:
        obey(root, backend=cluster.address)
    killer.join()
    assert (gone.value.code, gone.value.exit_code) == ("RRID-P04", 6)
    items = json.loads((tmp_path / "out/result.json").read_text())["items"]
    assert {item["status"] for item in items} == {"ok", "failed"}
    with pytest.raises(EnvironmentFault) as refused:
        obey(root, backend="dask://127.0.0.1:9")
    assert refused.value.exit_code == 6
    outcome = obey(root, resume=True, jobs=2)
    assert outcome.exit_code == 0
    done = [item for item in items if item["status"] == "ok"]
    assert json.loads((outcome.folder / "provenance.json").read_text())["kept"] == len(done)
