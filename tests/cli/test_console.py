"""Tables on a terminal: numbers under numbers, headings broken before their units."""

from __future__ import annotations

import io
import sys
import time

import pytest

from rrrid_cli.console import Progress, print_table
from rrrid_cli.options import Common


def test_a_table_fits_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    """The key figures of a diagnosis, 97 characters with headings of twelve letters: 80 at most, with every word and unit."""
    head = ("joint", "torque error now [N m]", "extended [N m]", "an arm in order leaves [N m]", "beside it", "now [% of rated]",
            "extended [% of rated]")
    rows = [("1", "0.0878", "0.0876", "0.0747", "1.2×, in order", "0.146", "0.146"),
            ("2", "0.2373", "0.0221", "0.0281", "8.4× → 0.79×, in order", "0.791", "0.074")]
    print_table(head, rows)
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    assert sorted(" ".join(lines[:-2]).split()) == sorted(" ".join(head).split())
    assert [line.split() for line in lines[-2:]] == [" ".join(row).split() for row in rows]
    wide = [("a" * 70, "b" * 70, "c")]
    print_table(("one", "two", "all of them [%]"), wide)  # no heading could make it fit: each is told as it reads best
    *above, told = capsys.readouterr().out.splitlines()
    assert told.split() == list(wide[0])
    assert sorted(" ".join(above).split()) == sorted(["one", "two", "all", "of", "them", "[%]"])


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
