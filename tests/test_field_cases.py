"""Field cases about the import of an arm: sliding joints, and columns in another order than its joints."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from pipelines.io.files import open_log
from tests.cli.commands import rrrid

SLIDING = {'unit = "rad"': 'unit = ["rad", "rad", "m", "rad"]', 'unit = "N m"': 'unit = ["N m", "N m", "N", "N m"]'}


@pytest.mark.parametrize("units", [{}, SLIDING], ids=["one unit", "one a joint"])
def test_a_scara_arm_is_imported_in_metres_where_it_slides(units: dict[str, str], shared: Path, tmp_path: Path) -> None:
    """Case 30: its third joint slides, as recorded; one unit for all is told, with what to write."""
    shutil.copytree(shared / "cases/30-scara-cannot-be-imported", tmp_path, dirs_exist_ok=True)
    text = (tmp_path / "r.toml").read_text()
    for one, each in units.items():
        text = text.replace(one, each)
    (tmp_path / "r.toml").write_text(text)
    made = rrrid("import", "r.toml", "--out", "imp", "--no-report", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    assert ('unit = ["rad", "rad", "m", "rad"]' in made.stdout + made.stderr) is not bool(units)
    for name in ("run1", "run2"):
        (path,) = tmp_path.glob(f"imp/**/{name}.h5")
        table = np.loadtxt(tmp_path / f"{name}.csv", delimiter=",", skiprows=1)
        log = open_log(path).log
        assert log.robot.revolute == (True, True, False, True)
        assert np.allclose(log.q, table[:, 1:5], rtol=0.0, atol=1e-12)
        assert np.allclose(log.tau, table[:, 5:9], rtol=0.0, atol=1e-9)
