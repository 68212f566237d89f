"""Tables on a terminal: numbers under numbers, headings broken before their units."""

from __future__ import annotations

import io
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from pipelines.errors import Check
from pipelines.report.report import Report, Table
from pipelines.stage import Outcome
from rrrid_cli.console import Progress, print_checks, print_outcome, print_table
from rrrid_cli.options import Common

TABLE = Table(("joint", "held-out torque error now [N m]", "cause"),
              ((1, 0.08783, "cogging"), (2, 1.2, "–"), (3, None, "no cause")))


def outcome_of(report: Report) -> Outcome[Any]:
    return Outcome(None, {}, report, Path("out"), 0, ())


def test_numbers_stand_point_under_point(capsys: pytest.CaptureFixture[str]) -> None:
    print_outcome(outcome_of(Report("t", "It is so.", key_figures=TABLE)), Common())
    verdict, *lines = capsys.readouterr().out.splitlines()[:-1]
    assert verdict == "It is so."
    assert lines == ["  joint  held-out torque error now [N m]  cause",
                     "      1                          0.08783  cogging",
                     "      2                          1.20000  –",
                     "      3                                –  no cause"]


def test_figures_of_different_things_are_left_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    """A name and a figure: none is filled up for the sake of another."""
    table = Table(("what", "value"), (("condition number", 2.31), ("samples", 30000), ("torque error, relative [%]", 0.0871)))
    print_outcome(outcome_of(Report("t", "v", key_figures=table)), Common())
    assert [line.split("  ")[-1].strip() for line in capsys.readouterr().out.splitlines()[1:-1]] == ["2.31", "30 000", "0.0871"]


def test_what_to_check_follows_the_verdict(capsys: pytest.CaptureFixture[str]) -> None:
    report = Report("t", "Cogging at joint 2.", advice=("What to check: the magnets.",))
    print_outcome(outcome_of(report), Common())
    assert capsys.readouterr().out.splitlines()[:2] == ["Cogging at joint 2.", "What to check: the magnets."]
    print_outcome(outcome_of(report), Common(quiet=True))
    assert capsys.readouterr().out == ""


def test_units_are_written_as_in_the_report(capsys: pytest.CaptureFixture[str]) -> None:
    table = Table(("log", "acceleration [rad/s^2]", "k3 [1/s^2]"), (("a", 1.0, 2.0),))
    print_outcome(outcome_of(Report("t", "v", key_figures=table)), Common())
    said = capsys.readouterr().out
    assert "[rad/s²]" in said
    assert "[1/s²]" in said
    assert "^" not in said


def test_no_rows_no_table(capsys: pytest.CaptureFixture[str]) -> None:
    print_table(("a", "b"), [])
    assert capsys.readouterr().out == ""


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


def test_one_finding_of_several_logs_is_told_once(capsys: pytest.CaptureFixture[str]) -> None:
    """What differs in its numbers alone stands in one line, and the logs and joints in the next; what comes first goes first."""
    late = [Check.of("T06", "warn", f"torque lies {38.5 + k} ± 1.2 samples behind", where=f"{name}.h5, signal tau")
            for k, name in enumerate("ab")]
    wide = [Check.of("S07", "reject", f"q of joint {j} is in degrees", where=f"{name}.h5, signal q, joint {j}", remedy="do it")
            for name in "ab" for j in (1, 2)]
    lost = [Check.of("D09", "warn", f"p{j} cannot be told", where="a.h5") for j in (1, 2)]
    print_checks([Check.of("F05", "warn", "no integrity data", where="a.h5"), *late, *lost, *wide], False, None)
    assert capsys.readouterr().out.splitlines() == [
        "  x RRID-S07 a.h5, signal q, joint 1: q of joint 1 is in degrees (do it)",
        "      alike 4 times in all, in a.h5, b.h5; joints 1, 2",
        "  ! RRID-T06 a.h5, signal tau: torque lies 38.5 ± 1.2 samples behind",
        "      alike 2 times in all, in a.h5, b.h5",
        "  ! RRID-D09 a.h5: p1 cannot be told", "  ! RRID-D09 a.h5: p2 cannot be told",
        "  ! RRID-F05 a.h5: no integrity data"]


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


def test_verbose_progress_is_every_step(capsys: pytest.CaptureFixture[str]) -> None:
    with (progress := Progress(Common(verbose=True))):
        progress("reading")
        progress("search\x1b[31ming")
    assert capsys.readouterr().err == "reading\nsearch[31ming\n"


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


def test_no_column_of_a_table_is_cut(capsys: pytest.CaptureFixture[str]) -> None:
    """Long headings break between words; every cell is there whole, also in the last column."""
    head = ["log", "samples", "speed std [rad/s]", "acceleration std [rad/s²]", "whiteness of the innovations", "farthest from it [rad/s²]"]
    row = ["excitation-1-commissioning", "20000", "0.00123", "0.2207", "12.3", "0.2208"]
    print_table(head, [row])
    *_, last = capsys.readouterr().out.splitlines()
    assert last.split() == row
