"""Figures drawn in two processes are those drawn in one."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pipelines.io import shared_work
from pipelines.report.render import Picture, drawn
from pipelines.report.report import Figure

FIGURES = {f"figure-{k}": Figure(f"figure-{k}", lambda drawing: None, "") for k in range(9)}


@pytest.fixture(autouse=True)
def two_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shared_work, "processors", lambda: 2)
    monkeypatch.setattr("multiprocessing.parent_process", lambda: None)


def by_process(figure: Figure, name: str) -> Picture:
    time.sleep(0.03)
    return f"{name} ä by {os.getpid()}", bytes(range(256)) * len(name)


def test_many_figures_come_from_two_processes() -> None:
    found = drawn(FIGURES, by_process)
    assert list(found) == list(FIGURES)
    assert len({svg.partition(" by ")[2] for svg, _ in found.values()}) == 2
    assert all(svg.startswith(name) and png == bytes(range(256)) * len(name) for name, (svg, png) in found.items())


def test_few_figures_are_drawn_here() -> None:
    few = dict(list(FIGURES.items())[:4])
    assert {svg.partition(" by ")[2] for svg, _ in drawn(few, by_process).values()} == {str(os.getpid())}


@pytest.mark.slow
@pytest.mark.parametrize("home", ["/dev/null", pytest.param("/proc/nothing", marks=pytest.mark.slow)])
def test_a_home_that_cannot_be_written_is_not_remarked_upon(home: str, tmp_path: Path) -> None:
    """matplotlib's settings are looked for in a folder of ours, which is gone afterwards."""
    code = ("from pipelines.report.report import Figure, Report, Section\nfrom pipelines.report.render import render_report\n"
            "draw = lambda drawing: drawing.subplots().plot([0, 1])\n"
            "many = tuple(Figure(f'f{k}', '', draw) for k in range(9))\n"
            "render_report(Report('t', 'v', sections=(Section('s', figures=many),)), {})")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("MPL", "XDG"))}
    done = subprocess.run([sys.executable, "-c", code], env=environment | {"HOME": home, "TMPDIR": str(tmp_path)}, text=True,
                          capture_output=True, check=False, timeout=120, cwd=Path(__file__).parents[2])
    assert (done.returncode, done.stderr) == (0, "")
    assert list(tmp_path.iterdir()) == []
