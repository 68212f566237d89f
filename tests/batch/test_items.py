"""Which folders and logs are items, what they are called, and how shards share them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from pipelines.batch import find_items
from pipelines.errors import EnvironmentFault
from pipelines.io.files import find_logs
from tests.batch.conftest import Lay, obey, statuses


def _touch(root: Path, *names: str) -> None:
    for name in names:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text("x")


def test_an_item_is_the_smallest_folder_that_holds_logs(tmp_path: Path) -> None:
    """A folder's own logs are one item; folders of logs below it are others, and no log is in two."""
    _touch(tmp_path, "a/1.h5", "a/2.parquet", "a/notes.txt", "b/old/1.h5", "b/3.h5", "c/.hidden/1.h5", "d/e/f/1.h5")
    items, checks = find_items(tmp_path)
    assert [item.name for item in items] == ["a", "b", "b/old", "d/e/f"]
    assert checks == ()
    assert items[0].paths == (tmp_path / "a",)
    assert items[1].paths == (tmp_path / "b/3.h5",)
    logs = [log for item in items for log in item.logs]
    assert len(logs) == len(set(logs)) == 5


@pytest.mark.row("X11")
def test_links_are_passed_over_and_own_output_too(tmp_path: Path) -> None:
    """X11: a loop and a circle of links are told and not followed; a linked log is one; what rrrid wrote is no input."""
    _touch(tmp_path, "root/a/1.h5", "root/done/provenance.json", "root/done/logs/1.h5", "elsewhere/1.h5")
    os.symlink(tmp_path / "root", tmp_path / "root/a/loop")
    os.symlink(tmp_path / "elsewhere/1.h5", tmp_path / "root/a/2.h5")
    os.symlink("3.h5", tmp_path / "root/a/3.h5")
    items, checks = find_items(tmp_path / "root")
    assert [(item.name, len(item.logs)) for item in items] == [("a", 2)]
    assert [check.code for check in checks] == ["RRID-X11", "RRID-X11"]


@pytest.mark.parametrize("of", [2])
def test_shards_together_are_all_items(lay: Lay, tmp_path: Path, of: int) -> None:
    """None twice, none left out, and no shard has more than one item more than another."""
    root = lay({f"{i:02d}": "fine" for i in range(3)})
    shards = [statuses(obey(root, out=tmp_path / f"{number}", shard=(number, of))) for number in range(1, of + 1)]
    assert sorted(name for one in shards for name in one) == [f"{i:02d}" for i in range(3)]
    assert max(map(len, shards)) - min(map(len, shards)) <= 1


@pytest.mark.row("F13", "P11")
def test_a_folder_that_may_not_be_listed_is_an_item_that_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """F13, P11: the others are items as ever; the superuser, who may all, is told that he may not."""
    _touch(tmp_path, "a/1.h5", "shut/1.h5")
    listed = os.listdir

    def refuse(path: str | Path = ".") -> list[str]:
        if str(path).endswith("shut"):
            raise PermissionError(13, "Permission denied", str(path))
        return listed(path)

    monkeypatch.setattr(os, "listdir", refuse)
    items, _ = find_items(tmp_path)
    assert {item.name: (item.paths, len(item.logs)) for item in items} == {
        "a": ((tmp_path / "a",), 1), "shut": ((tmp_path / "shut",), 0)}
    with pytest.raises(EnvironmentFault, match="F13"):
        find_logs(items[1].paths)
