"""Recordings in the layouts people have: each draft is right, or asks; none is wrong in silence."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import outside_layouts
from benchmarks.import_layouts import LAYOUTS, verdict
from benchmarks.outside_layouts import Layout, untrue, written
from pipelines.import_log import draft_recipe

RIGHT = {
    "clock_times", "json_arrays", "matlab_struct", "panda_py", "percent_header_units", "savetxt_header", "trailing_comma",
    "transposed_named",
}  # fmt: skip


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_layout_is_drafted_right_or_asked_about(name: str, tmp_path: Path) -> None:
    """The imported log equals the truth, once the blanks are filled as a person would fill them."""
    found = verdict(LAYOUTS[name](), tmp_path)
    assert found.outcome == ("right" if name in RIGHT else "asks"), found.why


@pytest.mark.parametrize("layout", [pytest.param(layout, id=layout.name, marks=pytest.mark.slow if k % 4 else ())
                                    for k, layout in enumerate(outside_layouts.load(outside_layouts.TESTED))])
def test_a_draft_of_a_foreign_format_claims_nothing_untrue(layout: Layout, tmp_path: Path) -> None:
    """Formats that others chose: every column, unit, clock and sign that is filled in is the true one."""
    run, answer = written(layout, tmp_path, seed=77)
    assert untrue(draft_recipe(tmp_path / answer.file).text, layout, answer, run) == []
