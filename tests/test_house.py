"""Rules of the house that ruff does not know: where numbers that decide may stand."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parents[1]
# Areas not yet moved to the layout of the design: the list only shrinks, and so does each number.
CONSTANTS: dict[str, int] = {}


@pytest.mark.parametrize("area", sorted(
    str(path.relative_to(REPO)) for path in (*(REPO / "pipelines").iterdir(), REPO / "rrrid_cli", REPO / "bench")
    if path.suffix == ".py" or (path / "__init__.py").exists()))
def test_numbers_that_decide_stand_in_a_config(area: str, shared: Path) -> None:
    """No module has a number of its own but in config.py and where it is marked `# numerics`."""
    tool = shared / "tools" / "measure_code.py"
    done = subprocess.run(
        [sys.executable, tool, area], cwd=REPO, capture_output=True, text=True, check=True
    )
    constants = int(done.stdout.splitlines()[-1].split()[6])
    assert constants == CONSTANTS.get(area, 0), "lower the number in the list"


def _third_party(*folders: str) -> set[str]:
    """Libraries that the modules of these folders import, anywhere in them."""
    paths = [path for folder in folders for path in (REPO / folder).rglob("*.py")]
    found = set()
    for node in (node for path in paths for node in ast.walk(ast.parse(path.read_text()))):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(str(node.module).partition(".")[0])
    return found - set(sys.stdlib_module_names) - {"pipelines", "rrrid_cli", "bench"}


def test_the_project_declares_what_it_imports() -> None:
    """The core's dependencies, Dask of an extra, and what loads exported models; the bench adds MuJoCo."""
    project = tomllib.loads((REPO / "pyproject.toml").read_text())["project"]
    declared = {re.split("[>=]", one)[0].lower().replace("-", "_") for one in project["dependencies"]}
    cluster = [re.split("[>=]", one)[0] for one in project["optional-dependencies"]["cluster"]]
    assert cluster == ["dask[distributed]", "psutil"]
    used = _third_party("pipelines", "rrrid_cli")
    assert used == declared | {"distributed", "psutil", "pydantic_core", "mujoco", "pinocchio"}
    assert _third_party("bench") - declared == {"mujoco"}
