"""Ctrl-C at any moment: exit 130, the old output or the new one, and never a word about damaged logs."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import time
from pathlib import Path

import pytest

from pipelines.errors import Interrupted, RrridError
from pipelines.io.files import write_log
from pipelines.io.output import hash_file
from tests.cli.commands import REPO, RRRID
from tests.io.logs import small_log

RUNS = 3
ENDED = "rrrid: RRID-P06 interrupted. Run the same command again; nothing was half written."


def _started(folder: Path) -> subprocess.Popen[str]:
    """`rrrid inspect` in a process group of its own, waited for until it has begun to read."""
    process = subprocess.Popen([*RRRID, "inspect", "logs", "--out", "out", "--no-report", "-v"], cwd=folder, text=True,
                               env=os.environ | {"PYTHONPATH": str(REPO)}, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                               start_new_session=True)
    assert process.stderr is not None
    assert process.stderr.readline().startswith("reading")
    return process


def _complete(out: Path) -> dict[str, str]:
    """Every file of `out` by its hash, each as provenance.json says."""
    there = {p.relative_to(out).as_posix(): hash_file(p) for p in out.rglob("*") if p.is_file() and p.name != "provenance.json"}
    assert there == json.loads((out / "provenance.json").read_text())["outputs"]
    return there


def _nobody_left(group: int) -> bool:
    """Whether a process group ends within a second: nobody in it runs. Who is dead may wait longer for init to take notice."""
    for _ in range(100):
        if not _running(group):
            return True
        time.sleep(0.01)
    return False


def _running(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    states = [_state(place, group) for place in Path("/proc").glob("[0-9]*/stat")]
    return not states or any(state not in ("", "Z", "X") for state in states)


def _state(place: Path, group: int) -> str:
    """R, S, Z … of a process of the group, proc(5); empty for any other."""
    try:
        state, _, found = place.read_text().rpartition(")")[2].split()[:3]
    except (OSError, ValueError):  # it is gone by now
        return ""
    return state if int(found) == group else ""


@pytest.mark.row("P06")
def test_ctrl_c_at_any_moment_ends_the_run(tmp_path: Path) -> None:
    """P06: SIGINT to the whole process group, as a terminal sends it, at random times from the first log read on.

    The signal meets the parent, and while a log is read the child that reads it as well.
    """
    for i in range(12):
        write_log(tmp_path / f"logs/{i}.h5", small_log(samples=4000, seed=i))
    began = time.monotonic()
    with _started(tmp_path) as process:
        began = time.monotonic()
        process.communicate()
    lasted, done = time.monotonic() - began, process.returncode
    before = _complete(tmp_path / "out")
    random_time = random.Random(20040509)
    interrupted = 0
    for _ in range(RUNS):
        with _started(tmp_path) as process:
            time.sleep(random_time.uniform(0.0, 0.8 * lasted))
            os.killpg(process.pid, signal.SIGINT)
            _, said = process.communicate(timeout=20)
        assert _complete(tmp_path / "out") == before
        assert not list(tmp_path.glob(".rrrid-tmp-*"))
        assert "RRID-F" not in said
        if process.returncode != done:  # else all was done before the signal came
            assert process.returncode == 130, said
            assert said.splitlines()[-1] == ENDED
            assert "Traceback" not in said
            interrupted += 1
        assert _nobody_left(process.pid)
    assert interrupted > RUNS // 2


def test_no_handler_of_errors_catches_an_interruption() -> None:
    """It is no RrridError, not even an Exception; it is told in the words of one."""
    assert not issubclass(Interrupted, Exception)
    told = Interrupted(signal.SIGTERM).as_error()
    assert (type(told), told.exit_code, told.code) == (RrridError, 143, "RRID-P06")
