"""The page of a batch comes back as it was, of its result and its ledger; items and results are not touched."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from pipelines.batch.plan import Options
from pipelines.batch.redraw import redraw_batch
from pipelines.errors import InputRejected, UsageError
from tests.batch.conftest import Lay, obey
from tests.cli.commands import rrrid


def everything(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture
def done(lay: Lay) -> Path:
    """A batch with a drift, something found, and something rejected."""
    figures = {f"{i}": f"value {1.0 + 0.1 * (i == 3)} std 0.01 rms 0.{i + 1}" for i in range(6)}
    root = lay(figures | {"odd": "found", "bad": "reject"})
    return obey(root, Options(no_report=False), no_report=False).folder


def test_a_lost_page_comes_back(done: Path, tmp_path: Path) -> None:
    """Every byte of page and figures, in its place and elsewhere; provenance.json lists them, and a batch can go on from it."""
    before = everything(done)
    (done / "report.html").unlink()
    shutil.rmtree(done / "figures")
    report = redraw_batch(done)
    assert everything(done) == before
    assert "were rejected" in report.verdict or "was rejected" in report.verdict
    redraw_batch(done, tmp_path / "there")
    assert everything(tmp_path / "there") == {name: content for name, content in before.items()
                                              if name == "report.html" or name.startswith("figures/")}
    outcome = obey(done.parent / "root", Options(no_report=False), no_report=False, resume=True)
    assert json.loads((outcome.folder / "provenance.json").read_text())["kept"] == 7
    assert {name: content for name, content in everything(done).items() if name not in ("provenance.json", "ledger/bad.json")} == {
        name: content for name, content in before.items() if name not in ("provenance.json", "ledger/bad.json")}


def test_what_is_no_batch_as_it_was_written_is_refused(done: Path, tmp_path: Path) -> None:
    """A result that was edited, a foreign file in the folder, an output that is not free."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/thesis.tex").write_text("x")
    with pytest.raises(UsageError, match="C05"):
        redraw_batch(done, tmp_path / "mine")
    (done / "notes.txt").write_text("x")
    with pytest.raises(UsageError, match=r"C05.*notes\.txt"):
        redraw_batch(done)
    (done / "notes.txt").unlink()
    result = done / "result.json"
    result.write_text(result.read_text().replace('"ok"', '"found"'))
    with pytest.raises(InputRejected, match="F05"):
        redraw_batch(done)


def test_on_the_command_line(done: Path, tmp_path: Path) -> None:
    """`rrrid report` draws a batch's page as it does any other."""
    before = everything(done)
    (done / "report.html").unlink()
    told = rrrid("report", "out", cwd=tmp_path)
    assert (told.returncode, told.stdout.splitlines()[-1]) == (0, "→ out/report.html")
    assert everything(done) == before
