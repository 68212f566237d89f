"""What is done stays done: resume, corruption, shards laid together, and equal bytes on every way (P07, P09, P10, P12)."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import pytest

from pipelines import inspect
from pipelines.batch import run_batch
from pipelines.executor import Plan
from pipelines.io.files import write_log
from pipelines.stage import Request, run_stage
from tests.batch.conftest import QUIET, Lay, contents, obey
from tests.io.logs import small_log


def _times(out: Path) -> dict[str, int]:
    return {path.name: (path / "provenance.json").stat().st_mtime_ns for path in (out / "items").iterdir()}


def _kept(out: Path) -> int:
    return int(json.loads((out / "provenance.json").read_text())["kept"])


@pytest.mark.row("P07", "P09")
def test_resume_does_only_what_is_not_done(lay: Lay) -> None:
    """P07, P09: changed words, a new log, a failed item; each alone is done again, whatever the times of files say."""
    root = lay({"a": "fine", "b": "fine", "c": "reject", "d": "fine"})
    out = obey(root).folder
    before = _times(out)
    lay({"b": "other", "e": "fine"})
    os.utime(root / "a/log.h5", (0, 0))
    (root / "d/more.h5").write_text("more")
    obey(root, resume=True)
    after = _times(out)
    assert _kept(out) == 1
    assert [name for name in before if before[name] == after[name]] == ["a"]
    assert set(after) == {"a", "b", "d", "e"}
    whole = obey(root, out=root.parent / "whole").folder
    assert contents(out) == contents(whole)


@pytest.mark.row("P10")
def test_a_corrupted_result_is_done_again(lay: Lay) -> None:
    """P10: one flipped byte, a missing file, an added file: found by their hashes, told, and made whole."""
    root = lay({"a": "fine", "b": "fine", "c": "fine", "d": "fine"})
    out = obey(root).folder
    whole = contents(out)
    stored = out / "items/a/words.txt"
    stored.write_bytes(b"F" + stored.read_bytes()[1:])
    (out / "items/b/words.txt").unlink()
    outcome = obey(root, resume=True)
    assert contents(out) == whole
    assert [(check.code, check.level, check.where) for check in outcome.checks] == [
        ("RRID-P10", "warn", "a"), ("RRID-P10", "warn", "b")]
    assert _kept(out) == 2


@pytest.fixture(scope="module")
def single(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three folders of real logs, one of them damaged, and in `single/` what `rrrid inspect` makes of each alone."""
    folder = tmp_path_factory.mktemp("same")
    for i in range(3):
        write_log(folder / f"root/{i}/log.h5", small_log(samples=400, seed=i))
    damaged = folder / "root/1/log.h5"
    damaged.write_bytes(damaged.read_bytes()[:5000])
    for i in range(3):
        request = Request((folder / f"root/{i}",), folder / f"single/{i}", no_report=True)
        run_stage(inspect.STAGE, request, inspect.Settings())
    return folder


def _inspected(folder: Path, out: Path, **wanted: object) -> Path:
    plan = Plan("pipelines.inspect", inspect.Settings(), QUIET, folder / "root", out, **wanted)  # type: ignore[arg-type]
    return run_batch(plan).folder


@pytest.mark.row("P12")
def test_every_way_gives_the_bytes_of_the_single_command(single: Path, tmp_path: Path) -> None:
    """P12: one process, two, and two shards laid together: each item's files are those of its own command."""
    one = _inspected(single, tmp_path / "one")
    two = _inspected(single, tmp_path / "two", jobs=2)
    for number in (1, 2):
        shutil.copytree(_inspected(single, tmp_path / f"shard{number}", shard=(number, 2)), tmp_path / "all", dirs_exist_ok=True)
    together = _inspected(single, tmp_path / "all", resume=True)
    assert _kept(together) == 3
    alone = {f"items/{place}": content for place, content in contents(single / "single").items()}
    assert {place.split("/")[1] for place in alone} == set("012")
    assert contents(one) == contents(two) == contents(together)
    assert {place: content for place, content in contents(one).items() if place.startswith("items/")} == alone
