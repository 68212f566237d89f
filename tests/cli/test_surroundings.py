"""The command and the machine around it: signals, pipes, strange paths and names, rights, a crash of our own."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from dataclasses import replace
from pathlib import Path

import pytest

from pipelines import convert
from pipelines.io.files import write_log
from tests.cli.commands import REPO, RRRID, rrrid
from tests.io.logs import small_log


def test_an_internal_error_is_exit_70_with_a_crash_file(logs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What nobody foresaw ends in 70, one line, and a file to report; --debug shows the traceback."""
    monkeypatch.setattr(convert, "STAGE", replace(convert.STAGE, compute=lambda inputs, settings: 1 / 0))
    monkeypatch.setattr("tempfile.tempdir", str(logs))
    done = rrrid("convert", "logs", cwd=logs)
    assert done.returncode == 70
    assert done.stderr.count("\n") == 1
    (crash,) = logs.glob("rrrid-crash-*.txt")
    assert "ZeroDivisionError" in crash.read_text()
    assert crash.name in done.stderr
    assert not (logs / "runs").exists()


@pytest.mark.row("P06")
@pytest.mark.parametrize(("number", "exit_code"), [pytest.param(signal.SIGINT, 130, marks=pytest.mark.slow), (signal.SIGTERM, 143)])
def test_a_signal_ends_cleanly(tmp_path: Path, number: signal.Signals, exit_code: int) -> None:
    """P06: Ctrl-C and SIGTERM end within 5 s with their code, no half-written folder, no orphan."""
    for i in range(30):
        write_log(tmp_path / f"logs/{i}.h5", small_log(samples=5_000, seed=i))
    environment = os.environ | {"PYTHONPATH": str(REPO)}
    with subprocess.Popen([*RRRID, "convert", "logs", "--to", "csv", "-v"], cwd=tmp_path, env=environment, text=True,
                          stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, start_new_session=True) as process:
        assert process.stderr is not None
        while "writing csv/1" not in process.stderr.readline():
            assert process.poll() is None
        began = time.monotonic()
        process.send_signal(number)
        said = process.stderr.read()
    assert process.returncode == exit_code
    assert time.monotonic() - began < 5
    assert "Traceback" not in said
    assert [p.name for p in (tmp_path / "runs/rrr-tue/logs").iterdir()] == []
    with pytest.raises(ProcessLookupError):
        os.killpg(process.pid, 0)


def test_a_closed_pipe_is_no_error(logs: Path) -> None:
    """`rrrid … --json | head -1` does not complain that its reader has left."""
    line = f"{' '.join(RRRID)} convert logs --json | head -c 1"
    done = subprocess.run(["bash", "-c", f"set -o pipefail; {line}"], capture_output=True, text=True, cwd=logs, check=False,
                          env=os.environ | {"PYTHONPATH": str(REPO)})
    assert "Traceback" not in done.stderr
    assert "BrokenPipe" not in done.stderr


@pytest.mark.row("P13")
def test_no_home_no_terminal_no_display(logs: Path) -> None:
    """P13: HOME missing and read-only (/proc, where the superuser may not write either), no DISPLAY, a dumb terminal: the command
    works and says nothing else."""
    (logs / "home").mkdir(mode=0o555)
    for home in (logs / "home", Path("/proc"), Path("/nonexistent")):
        done = rrrid("convert", "logs", "--out", "out", cwd=logs, env={"HOME": str(home), "TERM": "dumb", "DISPLAY": ""})
        assert (done.returncode, done.stderr) == (0, "")
