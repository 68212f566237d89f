"""Robots as users bring them: each file of ../shared/cases is read rightly, or refused with a remedy that works when followed."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from pipelines.errors import UsageError
from pipelines.io.robot_files import load_robot
from tests.cli.commands import rrrid


def test_infinite_limits_are_none(shared: Path, tmp_path: Path) -> None:
    """Case 38: -inf, inf and 1e16 mean no limit; what then lacks is named, and given there it is taken."""
    path = tmp_path / "arm.urdf"
    for infinite in ("inf", "1e16", "Infinity"):
        text = (shared / "cases" / "38-limits-inf" / "inf.urdf").read_text().replace("inf", infinite)
        path.write_text(text)
        first, second, _ = load_robot(path).joints
        assert (first.position, first.velocity, first.torque) == ((-math.inf, math.inf), math.inf, math.inf)
        assert (second.position, second.velocity, second.torque) == ((-2.5, 2.5), 5.0, 100.0)
    told = rrrid("design-excitation", path, cwd=tmp_path)
    assert told.returncode == 2
    assert "joint 1 'j1' has no limit of speed" in told.stderr
    assert "velocity in its <limit> in the URDF" in told.stderr
    path.write_text(text.replace('velocity="Infinity"', 'velocity="2"'))
    assert load_robot(path).joints[0].velocity == 2.0


def test_a_link_that_cannot_exist_is_named(shared: Path, tmp_path: Path) -> None:
    """Case 41: 0.5 beside 0.001 and 0.001 kg m² is no body's inertia; the others of the arm pass, and so do those of real arms."""
    checks = load_robot(shared / "cases" / "41-impossible-inertia" / "badtri.urdf").checks
    assert len(checks) == 1
    assert checks[0].code == "RRID-S17"
    assert checks[0].level == "warn"
    assert re.search(r"joint 'j\d'.*0\.5", checks[0].message)
    for healthy in ("cases/46-panda-tip-link-remedy/arm.urdf:panda_hand", "real/tx40/tx40.urdf"):
        assert not load_robot(shared / healthy).checks
    path = tmp_path / "robot.toml"
    path.write_text('name = "r"\ngravity = [0, 0, -9.81]\n[kinematics]\nconvention = "dh"\n[[joint]]\nname = "j"\n'
                    'type = "revolute"\na = 0.4\nalpha = 0.0\nd = 0.0\noffset = 0.0\n'
                    'link = { mass = 2.0, com = [-0.2, 0, 0], inertia = [0.001, 0.02, 0.02, 0, 0, 0] }\n')
    assert "'j'" in load_robot(path).checks[0].message  # about the origin: m c² alone is 0.08


@pytest.mark.parametrize(("text", "words"), [
    ('<mujoco model="arm"><worldbody/></mujoco>', "MJCF"),
    ('<?xml version="1.0"?>\n<sdf version="1.9"><model name="a"/></sdf>', "SDF")])
@pytest.mark.parametrize("name", ["arm.xml", "arm.sdf", "arm.urdf", "arm"])
def test_other_robot_files_are_recognised_by_content(name: str, text: str, words: str, tmp_path: Path) -> None:
    """Case 44: MJCF and SDF are named under any file name, and the remedy is a URDF."""
    (tmp_path / name).write_text(text)
    with pytest.raises(UsageError, match=f"RRID-S17.*{words}.*[Ee]xport a URDF"):
        load_robot(tmp_path / name)
