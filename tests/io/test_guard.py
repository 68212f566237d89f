"""A reading child: what a crash, a hang or an endless answer costs is one file, and that in time."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pipelines.errors import InputRejected
from pipelines.io.files import open_log, write_log
from pipelines.io.sandbox import Answer, guarded
from tests.cli.commands import REPO
from tests.io.logs import small_log


def _crash() -> Answer:
    os.kill(os.getpid(), signal.SIGSEGV)
    raise AssertionError


def _hang() -> Answer:
    time.sleep(60.0)
    raise AssertionError


def _leave() -> Answer:
    os._exit(3)


@pytest.mark.row("F03")
@pytest.mark.parametrize(("work", "said"), [(_crash, "signal 11"), (_hang, "did not end within 1 s"), (_leave, "ended its process")])
def test_a_file_that_harms_its_reader_is_refused(tmp_path: Path, work: Callable[[], Answer], said: str) -> None:
    """Crash and hang of the library on a file: F03 in time, and the next file is read."""
    (tmp_path / "a").write_bytes(b"x")
    began = time.monotonic()
    with pytest.raises(InputRejected, match=f"RRID-F03 .*{said}"):
        guarded(work, tmp_path / "a", seconds=1.0)
    assert time.monotonic() - began < 3.0
    assert guarded(lambda: Answer({"n": 1}, {}), tmp_path / "a").about == {"n": 1}


def test_samples_of_every_shape_come_as_they_are(tmp_path: Path) -> None:
    """None, one, empty ones among others, many dimensions: bounds refuse nothing that is there, and nobody can write to them."""
    (tmp_path / "a").write_bytes(b"x")
    rng = np.random.default_rng(1)
    for shapes in ((), ((0,),), ((5,), (0, 3), (4, 2, 3), (1,), (2000, 6))):
        sent = {str(i): rng.normal(size=shape) for i, shape in enumerate(shapes)}
        got = guarded(lambda sent=sent: Answer({"n": 1}, sent), tmp_path / "a").arrays  # type: ignore[misc]
        assert set(got) == set(sent)
        assert all(np.array_equal(got[name], sent[name]) and not got[name].flags.writeable for name in sent)


def test_logs_are_read_in_any_thread(tmp_path: Path) -> None:
    write_log(tmp_path / "a.h5", small_log())
    found: list[object] = []
    threads = [threading.Thread(target=lambda: found.append(open_log(tmp_path / "a.h5").log)) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [small_log()] * 3


def test_the_child_ends_where_its_program_was_killed(tmp_path: Path) -> None:
    """Its answer is for nobody, and no process stays."""
    (tmp_path / "a").write_bytes(b"x")
    program = ("import os, time\nfrom pathlib import Path\nfrom pipelines.io.sandbox import Answer, guarded\n"
               "def work():\n    Path('pid').write_text(str(os.getpid()))\n    os.kill(os.getppid(), 9)\n    time.sleep(0.2)\n"
               "    return Answer({'x': 'y' * 1000000}, {})\nguarded(work, Path('a'))\n")
    subprocess.run([sys.executable, "-c", program], cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(REPO)}, timeout=20, check=False)
    child = int((tmp_path / "pid").read_text())
    for _ in range(200):
        with contextlib.suppress(OSError):
            if Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()[0] != "Z":
                time.sleep(0.01)
                continue
        return
    pytest.fail("the child lives on")
