"""Recordings in the layouts people have: each draft is right, or asks; none is wrong in silence."""

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
LAYOUTS = [pytest.param(one, id=one.name, marks=() if one.name in USUAL else pytest.mark.slow) for one in load()]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_draft_is_right_or_asks(layout: Layout, tmp_path: Path) -> None:
    """What is filled in is true, and the log that the recipe makes, its blanks filled in, is the motion that was written."""
    verdict, why = judge(layout, tmp_path, seed=77)
    expected = ("right",) if layout.name in RIGHT else ("right", "asks")
    assert verdict in expected, why
