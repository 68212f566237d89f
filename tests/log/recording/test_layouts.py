"""Recordings in the layouts people have: each draft is right, or asks; none is wrong in silence."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.import_layouts import LAYOUTS, verdict

RIGHT = {
    "clock_times", "command_only", "doosan", "german_spreadsheet", "header_stamp", "json_arrays", "json_frames",
    "json_lines_by_name", "kinova", "kuka_fri", "libfranka", "matlab_struct", "names_in_front", "panda_py",
    "percent_header_units", "plotjuggler", "plotjuggler_brackets", "rostopic_echo_p", "savetxt_header", "tabs_units_row",
    "time_sec_nsec", "trailing_comma", "transposed_named",
}  # fmt: skip


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_layout_is_drafted_right_or_asked_about(name: str, tmp_path: Path) -> None:
    """The imported log equals the truth, once the blanks are filled as a person would fill them."""
    found = verdict(LAYOUTS[name](), tmp_path)
    assert found.outcome == ("right" if name in RIGHT else "asks"), found.why
