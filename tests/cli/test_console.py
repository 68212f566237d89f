"""Tables on a terminal: numbers under numbers, headings broken before their units."""

from __future__ import annotations

import io
import sys
import time

import pytest

from rrrid_cli.console import Progress
from rrrid_cli.options import Common


def test_the_reader_of_a_pipe_sees_a_line_now_and_then(capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing of what is over in seconds; of what takes long the step and its seconds; nothing at all with -q."""
    for quiet, lines in ((False, 3), (True, 0)):
        progress = Progress(Common(quiet=quiet), silence=0.05)
        with progress:
            progress("reading")
        assert capsys.readouterr().err == ""
        with progress:
            progress("searching")
            time.sleep(0.3)
        out, err = capsys.readouterr()
        assert out == ""
        assert len(err.splitlines()) >= lines
        assert set(err.splitlines()) <= {"searching, 0 s"}


def test_a_terminal_shows_the_step_and_is_left_clean(monkeypatch: pytest.MonkeyPatch) -> None:
    """One line that is written over, and gone at the end."""
    terminal = io.StringIO()
    monkeypatch.setattr(terminal, "isatty", lambda: True)
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    with (progress := Progress(Common())):
        progress("searching [bold]")
        time.sleep(0.7)
    shown = terminal.getvalue()
    assert "searching [bold] " in shown
    assert "0:00:00" in shown
    assert shown.endswith("\x1b[1A\x1b[2K")
