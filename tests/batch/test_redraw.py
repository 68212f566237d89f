"""The page of a batch comes back as it was, of its result and its ledger; items and results are not touched."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from pipelines.rerender import rerender
from pipelines.stage import Request
from tests.batch.conftest import Lay, obey


def everything(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture
def done(lay: Lay) -> Path:
    """A batch with a drift, something found, and something rejected."""
    figures = {f"{i}": f"value {1.0 + 0.1 * (i == 3)} std 0.01 rms 0.{i + 1}" for i in range(6)}
    root = lay(figures | {"odd": "found", "bad": "reject"})
    return obey(root, request=Request(())).folder


def test_a_lost_page_comes_back(done: Path, tmp_path: Path) -> None:
    """Every byte of page and figures, in its place and elsewhere; provenance.json lists them, and a batch can go on from it."""
    before = everything(done)
    (done / "report.html").unlink()
    shutil.rmtree(done / "figures")
    report = rerender(done)
    assert everything(done) == before
    assert "were rejected" in report.verdict or "was rejected" in report.verdict
    rerender(done, tmp_path / "there")
    drawn = {name: content for name, content in everything(tmp_path / "there").items() if name != "provenance.json"}
    assert drawn == {name: content for name, content in before.items()
                                              if name == "report.html" or name.startswith("figures/")}
    outcome = obey(done.parent / "root", request=Request(()), resume=True)
    assert json.loads((outcome.folder / "provenance.json").read_text())["kept"] == 7
    kept = [{name: content for name, content in files.items() if name != "provenance.json" and not name.startswith("ledger/")}
            for files in (everything(done), before)]
    assert kept[0] == kept[1]
