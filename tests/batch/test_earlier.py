"""No batch is lost to another one (C05): of another stage, or in the default folder of other data."""

from __future__ import annotations

import contextlib
import json
import shutil
from pathlib import Path

import pytest

from pipelines.batch.folder import BatchFolder
from pipelines.batch.lock import LOCK, locked
from pipelines.batch.plan import Options
from pipelines.batch.summary import Summary
from pipelines.errors import EnvironmentFault
from pipelines.stage import Outcome
from tests.batch.conftest import Lay, contents, obey

pytestmark = pytest.mark.row("C05")


def _said(outcome: Outcome[Summary]) -> list[str]:
    assert "C05" not in json.dumps(outcome.json)
    return [check.message for check in outcome.checks if check.code == "RRID-C05"]


def _of_another_stage(out: Path) -> None:
    """Let the batch in `out` be one of `inspect`."""
    about = json.loads((out / "batch.json").read_text())
    (out / "batch.json").write_text(json.dumps(about | {"stage": "inspect"}))


def test_a_batch_of_another_stage_is_kept(lay: Lay, tmp_path: Path) -> None:
    """As a whole, its ledger with it, and the lock left behind by nobody; the next batch does everything itself."""
    root = lay({"a": "value 1.0 std 0.1", "b": "fine"})
    out = obey(root).folder
    _of_another_stage(out)
    before = contents(out)
    again = obey(root, resume=True)
    (words,) = _said(again)
    assert words.startswith("the earlier batch of inspect is kept")
    assert words.endswith("out-inspect")
    assert contents(tmp_path / "out-inspect") == before
    assert {path.name for path in (tmp_path / "out-inspect/ledger").iterdir()} == {"a.json", "b.json"}
    assert not (tmp_path / "out-inspect" / LOCK).exists()
    assert [record.status for record in again.result.records] == ["ok", "ok"]
    assert _said(obey(root)) == []


def test_force_keeps_no_batch(lay: Lay, tmp_path: Path) -> None:
    root = lay({"a": "fine"})
    _of_another_stage(obey(root).folder)
    (words,) = _said(obey(root, Options(no_report=True, force=True)))
    assert words == "the earlier batch of inspect was replaced, as --force says"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "root"]


def test_the_default_folder_keeps_a_batch_of_other_data(lay: Lay, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two roots of one name. Where one log is the same, also one beyond those of a shard, it is the same batch."""
    monkeypatch.chdir(tmp_path)
    root = lay({"a": "value 1.0 std 0.1", "b": "fine"})
    place = tmp_path / "runs/several/root/batch"
    assert _said(obey(root, out=None)) == []
    before = contents(place)
    other = tmp_path / "other/root"
    shutil.copytree(root, other)
    (other / "a/log.h5").write_text("value 2.0 std 0.1")
    assert _said(obey(other, out=None, shard=(1, 2))) == []
    assert _said(obey(root, out=None)) == []
    (other / "b/log.h5").write_text("value 3.0 std 0.1")
    (words,) = _said(obey(other, out=None))
    assert "of other data, is kept" in words
    assert words.endswith(str(place.with_name("batch-2")))
    assert contents(place.with_name("batch-2")).keys() == before.keys()
    shutil.rmtree(place.with_name("batch-2"))
    assert _said(obey(root, out=place)) == []


def test_logs_made_anew_in_their_place_are_no_other_batch(lay: Lay, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Imported again, say: every byte differs."""
    monkeypatch.chdir(tmp_path)
    root = lay({"a": "value 1.0 std 0.1", "b": "fine"})
    place = obey(root, out=None).folder
    for name in ("a", "b"):
        (root / name / "log.h5").write_text("value 3.0 std 0.1")
    assert _said(obey(root, out=None)) == []
    assert [path.name for path in place.parent.iterdir()] == ["batch"]


def test_what_is_moved_is_told_though_the_batch_fails(lay: Lay, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of another stage; then nothing can be written there."""
    root = lay({"a": "value 1.0 std 0.1"})
    _of_another_stage(obey(root).folder)

    def full(*_: object) -> None:
        raise EnvironmentFault("P02", "no space left", where=tmp_path)

    monkeypatch.setattr(BatchFolder, "begin", full)
    heard: list[str] = []
    with pytest.raises(EnvironmentFault):
        obey(root, tell=heard.append)
    assert [words.endswith("out-inspect") for words in heard] == [True]


def test_a_lock_in_the_place_of_one_that_was_moved_is_left(tmp_path: Path) -> None:
    """The folder is moved while it is locked, and the next batch locks what stands there then: it keeps its lock."""
    folder = tmp_path / "out"
    folder.mkdir()
    with contextlib.ExitStack() as first:
        first.enter_context(locked(folder))
        folder.rename(tmp_path / "moved")
        folder.mkdir()
        with locked(folder):
            first.close()
            with pytest.raises(EnvironmentFault, match="P08"), locked(folder):
                pass


def test_with_force_nothing_of_another_stage_is_left_among_the_items(lay: Lay) -> None:
    """Those beyond the shard are of the batch before: gone, and not moved among those of this one."""
    root = lay({"a": "value 1.0 std 0.1", "b": "fine"})
    out = obey(root).folder
    _of_another_stage(out)
    obey(root, Options(no_report=True, force=True), shard=(1, 2))
    assert len([path for path in (out / "items").iterdir() if not path.name.startswith(".")]) == 1
