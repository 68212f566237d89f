"""Every row of the table of bad inputs has a test, and no test is of a row that is none.

The marker says which: @pytest.mark.row("F01"). What a row asks for stands in the test that bears it.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parents[1]


def numbered(letter: str, last: int) -> tuple[str, ...]:
    return tuple(f"{letter}{number:02d}" for number in range(1, last + 1))


# container, structure and units, time, signal, configuration, process and batch, security
ROWS = (*numbered("F", 16), *numbered("S", 16), *numbered("T", 9), *numbered("D", 15), *numbered("C", 7), *numbered("P", 13),
        *numbered("X", 14))


def test_they_are_those_of_the_table(shared: Path) -> None:
    """The ninety of ../shared/bad-inputs.md, each once."""
    table = re.findall(r"^\|([A-Z]\d\d)\|", (shared / "bad-inputs.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(table) == sorted(ROWS)
    assert len(set(ROWS)) == 90


def test_every_row_has_a_test_and_every_marker_is_of_a_row(request: pytest.FixtureRequest) -> None:
    """None that is left out as slow, is skipped, or may fail. D16, a held joint that moves, is a finding beyond the table."""
    items, given = request.session.items, {Path(one.partition("::")[0]).resolve() for one in request.config.args}
    if not given & {REPO, REPO / "tests"} or request.config.option.keyword:
        pytest.skip("asks the whole suite")
    tested = {code for item in items if not any(item.iter_markers("skip")) and not any(item.iter_markers("xfail"))
              for mark in item.iter_markers("row") for code in mark.args}
    assert set(ROWS) <= tested <= {*ROWS, "D16"}
