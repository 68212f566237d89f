"""The notebook in docs: its cells run, and find in the beginning of the sample logs what was hidden there."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from pipelines.io.files import open_log
from tests.diagnose.sessions import written
from tests.healthy import begun

ROOT = Path(__file__).resolve().parents[1]


def test_the_notebook_runs_and_finds_the_hidden_cause(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    origin = ROOT / "sample_logs" / "rrr-changed"
    kept = (path for kind in ("excitation-*", "free-4") for path in origin.glob(f"{kind}.h5"))
    written(tmp_path / "sample_logs" / "rrr-changed", [begun(open_log(path).log, 10000) for path in kept])
    monkeypatch.chdir(tmp_path)
    cells: dict[str, Any] = {}
    for cell in json.loads((ROOT / "docs" / "rrr-changed.ipynb").read_text())["cells"]:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), cells)
    first = cells["found"].result.findings[0]
    assert (first.cause, first.joint) == ("cogging", 2)
    assert cells["found"].plot()._repr_png_().startswith(b"\x89PNG")
    assert (cells["folder"] / "model.json").is_file()
