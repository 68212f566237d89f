"""Every row of the table of bad inputs has a test, and no test is of a row that is none.

The marker says which: @pytest.mark.row("F01"). What a row asks for stands in the test that bears it.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.rows.collected import BEGINS, rows_of

REPO = Path(__file__).resolve().parents[1]


def numbered(letter: str, last: int) -> tuple[str, ...]:
    return tuple(f"{letter}{number:02d}" for number in range(1, last + 1))


# container, structure and units, time, signal, configuration, process and batch, security
ROWS = (*numbered("F", 16), *numbered("S", 16), *numbered("T", 9), *numbered("D", 15), *numbered("C", 7), *numbered("P", 13),
        *numbered("X", 14))


@pytest.fixture(scope="module")
def tested(request: pytest.FixtureRequest) -> dict[str, list[str]]:
    """row -> the tests that bear it, slow ones left out."""
    marked = [path for path in sorted((REPO / "tests").rglob("test_*.py"))
              if path != Path(__file__) and "mark.row" in path.read_text(encoding="utf-8")]
    if {item.path for item in request.session.items} >= set(marked):  # the whole suite is here
        return rows_of(request.session)
    done = subprocess.run([sys.executable, "-m", "pytest", "--collect-only", "-qq", "-p", "tests.rows.collected",
                           "-p", "no:cacheprovider",
                           *marked], cwd=REPO, capture_output=True, text=True, check=False,
                          env={name: value for name, value in os.environ.items() if not name.startswith("PYTEST")})
    assert done.returncode == 0, done.stdout + done.stderr
    (line,) = (line for line in done.stdout.splitlines() if line.startswith(BEGINS))
    rows: dict[str, list[str]] = json.loads(line.removeprefix(BEGINS))
    return rows


def test_they_are_those_of_the_table(shared: Path) -> None:
    """The ninety of ../shared/bad-inputs.md, each once."""
    table = re.findall(r"^\|([A-Z]\d\d)\|", (shared / "bad-inputs.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(table) == sorted(ROWS)
    assert len(set(ROWS)) == 90


@pytest.mark.parametrize("row", ROWS)
def test_every_row_has_a_test(row: str, tested: dict[str, list[str]]) -> None:
    assert tested.get(row), f"no test bears @pytest.mark.row({row!r})"


def test_every_marker_is_of_a_row(tested: dict[str, list[str]]) -> None:
    """D16, a held joint that moves, is a finding of the doctor's own, beyond the table."""
    assert set(tested) <= {*ROWS, "D16"}
