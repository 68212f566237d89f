"""Run the command as a user does."""

from __future__ import annotations

import io
import signal
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from subprocess import CompletedProcess

import pytest

from rrrid_cli import main

RRRID = (sys.executable, "-m", "rrrid_cli.main")  # a process of its own, where a test is of streams, signals or what is loaded
REPO = Path(__file__).resolve().parents[2]


def rrrid(*words: object, cwd: Path, env: dict[str, str] | None = None) -> CompletedProcess[str]:
    """Run the command in `cwd`, without a terminal, in this process: a fresh one costs a second, and there are hundreds."""
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2))
    before, hook = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}, sys.unraisablehook
    try:
        with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
            patch.chdir(cwd)
            patch.setattr(sys, "argv", ["rrrid", *map(str, words)])
            patch.setattr(main, "economise", lambda: None)
            for name, value in (env or {}).items():
                patch.setenv(name, value)
            with pytest.raises(SystemExit) as ended:
                main.entry()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        sys.unraisablehook = hook
    said = [stream.buffer.getvalue().decode() for stream in (out, err)]  # type: ignore[attr-defined]
    assert "Traceback" not in said[1]
    return CompletedProcess(words, int(ended.value.code or 0), *said)
