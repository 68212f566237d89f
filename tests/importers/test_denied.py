"""What a header or a line of the file claims is denied where the robot's own links tell otherwise; sentences are passed on."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from benchmarks.recorded_arm import SIX, THREE, TWO, Arm, Run, simulate
from pipelines.import_log import draft_recipe
from pipelines.importers.notes import stated_of_some_joints
from tests.importers.good import Array, text, write

DENIED = 'q = { columns = "q{j}", unit = "FILL IN" }'
OPEN = 'q = { columns = "FILL IN", unit = "FILL IN" }'
DEG, NM = "q# [deg]", "tau# [Nm]"


def _draft(folder: Path, columns: Callable[[Run], dict[str, Array]], arm: Arm = THREE, head: str = "") -> str:
    moved = simulate(arm, seed=5)
    (folder / "arm.urdf").write_text(arm.urdf())
    return draft_recipe(write(folder, head + text({"t [s]": moved.t} | columns(moved)))).text


def _block(pattern: str, values: Array) -> dict[str, Array]:
    return {pattern.replace("#", str(j)): column for j, column in enumerate(values.T, start=1)}


@pytest.mark.parametrize(("name", "head"), [(DEG, ""), ("q#", "# joint angles in deg\n")])
def test_degrees_that_the_torque_proves_to_be_radians_are_a_blank(tmp_path: Path, name: str, head: str) -> None:
    """A header of an earlier version, without a velocity that would contradict it."""
    draft = _draft(tmp_path, lambda run: _block(name, run.q) | _block(NM, run.tau), head=head)
    assert DENIED in draft
    assert "says 'deg', but the torque follows from the motion by the robot's links if it is in rad" in draft


def test_degrees_that_are_degrees_stay(tmp_path: Path) -> None:
    draft = _draft(tmp_path, lambda run: _block(DEG, np.degrees(run.q)) | _block(NM, run.tau))
    assert 'unit = "deg" }\n    # sure, named so' in draft


@pytest.mark.parametrize(("gear", "unit"), [(1.0, "counts"), (80.0, "FILL IN")])
def test_counts_of_a_motor_are_not_taken_for_the_joints(tmp_path: Path, gear: float, unit: str) -> None:
    """So many counts make a turn as the file states: of the motor, where the joint would leave its limits by far."""
    head = "# encoder: 65536 counts/rev\n"
    draft = _draft(tmp_path, lambda run: _block("q# [counts]", np.round(run.q * gear * 65536 / 2 / np.pi)) | _block(NM, run.tau),
                   head=head)
    assert f'q = {{ columns = "q{{j}}", unit = "{unit}", counts_per_rev = 65536 }}' in draft


@pytest.mark.parametrize("side", ["joint", "drive"])
@pytest.mark.parametrize(("arm", "joint"), [(SIX, 3), (TWO, 2)])
def test_an_angle_that_is_counted_from_another_link_is_asked_about(tmp_path: Path, arm: Arm, joint: int, side: str) -> None:
    """A parallel rod, an angle against the ground: with torques of the joints, or of the drives."""
    def columns(run: Run) -> dict[str, Array]:
        q, tau = run.q.copy(), run.tau.copy()
        q[:, joint - 1] += q[:, joint - 2]
        tau[:, joint - 2] -= tau[:, joint - 1] * (side == "drive")
        return _block(DEG, np.degrees(q)) | _block(NM, tau)

    draft = _draft(tmp_path, columns, arm)
    assert OPEN in draft
    assert f"agree far better with joint {joint} counted from link {joint - 2}, not from link {joint - 1}" in draft


def test_a_unit_from_a_line_of_the_file_is_likely_and_no_more(tmp_path: Path) -> None:
    head = "# joint angles in deg, torques in Nm\n"
    draft = _draft(tmp_path, lambda run: _block("q#", np.degrees(run.q)) | _block("tau#", run.tau), head=head)
    assert draft.count("# check: likely, a line of the file says so") == 2


@pytest.mark.parametrize(("line", "told"), [
    ("# J3 is measured against the horizontal", True), ("# Gelenk 2: Vorzeichen umgekehrt montiert", True),
    ("# encoder of axis 4 replaced on 2023-04-01", True), ("# joint angles q1..q6 in deg", False), ("# moving joint: 3", False),
    ("J1,J2,J3,J4,J5,J6", False), ("joint_1.gear = 100", False)])
def test_a_sentence_about_one_joint_is_passed_on(line: str, told: bool) -> None:
    assert bool(stated_of_some_joints([line], 6)) == told
