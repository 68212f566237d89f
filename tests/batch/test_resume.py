"""What is done stays done: resume, corruption, shards laid together, and equal bytes on every way (P07, P09, P10, P12)."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import pytest

from pipelines import inspect
from pipelines.batch import read_ledger, record_line, run_batch
from pipelines.executor import Plan, Record
from pipelines.io.files import write_log
from pipelines.report.batch_report import DoneItem
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


@pytest.mark.row("P09")
def test_resume_with_other_settings_does_all_again(lay: Lay) -> None:
    """P09: a setting that decides on results makes them old; memory and time limits do not."""
    root = lay({"a": "value 1 std 0.1", "b": "fine"})
    obey(root)
    assert _kept(obey(root, timeout=100.0, memory=1 << 34, resume=True).folder) == 2
    outcome = obey(root, factor=2.0, resume=True)
    assert _kept(outcome.folder) == 0
    assert json.loads((outcome.folder / "items/a/result.json").read_text())["parameters"][0]["value"] == 2.0


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


def test_a_torn_ledger_is_no_ledger(lay: Lay) -> None:
    """A power cut leaves an empty or half a record: its item is done again."""
    root = lay({"a": "fine", "b": "fine"})
    out = obey(root).folder
    whole = contents(out)
    ledger = out / "ledger/1-of-1.jsonl"
    lines = [line for line in ledger.read_text().splitlines() if '"a"' not in line]
    ledger.write_text("\n".join([*lines, '{"name": "a", "slu']))
    obey(root, resume=True)
    assert (contents(out), _kept(out)) == (whole, 1)


def test_a_record_that_was_kept_says_what_it_said_at_once(tmp_path: Path) -> None:
    """P07: the same figures in the same order, and so the same drift."""
    said = ("reconstruct noise", "estimate-bps p10", "estimate-bps p2", "estimate-bps p1", "diagnose cogging joint 2 amplitude")
    figures = dict.fromkeys(said, (1.0, 0.1, "N m"))
    first, second = (Record(DoneItem(name, "ok", None, "", 0, "", name, None), name, figures, {f"{one} rms": (1.0, "N m") for one in said})
                     for name in "ab")
    (tmp_path / "ledger").mkdir()
    (tmp_path / "ledger/1-of-1.jsonl").write_text(record_line(first) + record_line(second))
    kept = read_ledger(tmp_path)
    assert kept == {"a": first, "b": second}
    assert list(kept["a"].figures) == list(said)


def test_items_that_are_gone_leave_nothing_behind(lay: Lay) -> None:
    """A folder that was renamed is not in the output under both names."""
    root = lay({"a": "fine", "b": "fine"})
    obey(root)
    (root / "b").rename(root / "c")
    out = obey(root, resume=True).folder
    assert set(_times(out)) == {"a", "c"}
    assert set(read_ledger(out)) == {"a", "c"}


@pytest.fixture(scope="module")
def single(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five folders of real logs, one of them damaged, and in `single/` what `rrrid inspect` makes of each alone."""
    folder = tmp_path_factory.mktemp("same")
    for i in range(5):
        write_log(folder / f"root/{i}/log.h5", small_log(samples=400, seed=i))
    damaged = folder / "root/3/log.h5"
    damaged.write_bytes(damaged.read_bytes()[:5000])
    for i in range(5):
        request = Request((folder / f"root/{i}",), folder / f"single/{i}", no_report=True)
        run_stage(inspect.STAGE, request, inspect.Settings())
    return folder


def _inspected(folder: Path, out: Path, **wanted: object) -> Path:
    plan = Plan("pipelines.inspect", inspect.Settings(), QUIET, folder / "root", out, **wanted)  # type: ignore[arg-type]
    return run_batch(plan).folder


@pytest.mark.row("P12")
def test_every_way_gives_the_bytes_of_the_single_command(single: Path, tmp_path: Path) -> None:
    """P12: one process, two, and four shards laid together: each item's files are those of its own command."""
    one = _inspected(single, tmp_path / "one")
    two = _inspected(single, tmp_path / "two", jobs=2)
    for number in range(1, 5):
        shutil.copytree(_inspected(single, tmp_path / f"shard{number}", shard=(number, 4)), tmp_path / "all", dirs_exist_ok=True)
    together = _inspected(single, tmp_path / "all", resume=True)
    assert _kept(together) == 5
    alone = {f"items/{place}": content for place, content in contents(single / "single").items()}
    assert {place.split("/")[1] for place in alone} == set("01234")
    assert contents(one) == contents(two) == contents(together)
    assert {place: content for place, content in contents(one).items() if place.startswith("items/")} == alone
