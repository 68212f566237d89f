"""Recordings in the layouts people have: each draft is right, asks, or is refused with a remedy."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.import_layouts import Layout, judge, load

# Right without an answer: names, units or conventions say all of it, or the robot's links prove it.
RIGHT = {
    "clock_times", "json_arrays", "matlab_struct", "panda_py", "percent_header_units", "savetxt_header", "trailing_comma",
    "transposed_named",
}  # fmt: skip


# Others are run by name: clock, nested arrays, a struct, units in a comment, time along the rows; and some that have to ask.
USUAL = {
    "clock_times", "json_arrays", "matlab_struct", "percent_header_units", "transposed_named",
    "netcdf_xarray", "pandas_array_cells", "reversed_numbers", "ur_rtde",
}  # fmt: skip
# Known not to be right: names in an 8-bit encoding, joints that links hardly tell apart; and answers that no blank asks for.
OTHER = {"polish_rig", "turkish_rig", "like_neighbours_exchanged", "forearm_from_the_horizontal", "small_motion_in_degrees",
         "excel_serial_days", "grafana_formatted", "two_blocks"}  # fmt: skip
LAYOUTS = [pytest.param(one, id=one.name, marks=() if one.name in USUAL else pytest.mark.slow)
           for one in load() if one.name not in OTHER]  # fmt: skip


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_draft_is_right_or_asks(layout: Layout, tmp_path: Path) -> None:
    """What is filled in is true, and the log that the recipe makes, its blanks filled in, is the motion that was written."""
    verdict, why = judge(layout, tmp_path, seed=77)
    expected = ("right",) if layout.name in RIGHT else ("right", "asks", "refused")
    assert verdict in expected, why
