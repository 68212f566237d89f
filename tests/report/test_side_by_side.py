"""Many figures are drawn wherever the home folder is."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest


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
