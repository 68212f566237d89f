"""Which folders and logs are items, what they are called, and how shards share them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipelines.batch import find_items
from pipelines.errors import UsageError
from rrrid_cli.app import read_shard
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


def test_each_log_is_an_item_where_asked(tmp_path: Path) -> None:
    """--each-log."""
    _touch(tmp_path, "1.h5", "a/1.h5", "a/2.h5")
    assert [item.name for item in find_items(tmp_path, each_log=True)[0]] == ["1.h5", "a/1.h5", "a/2.h5"]
    assert [item.name for item in find_items(tmp_path)[0]] == [".", "a"]


def test_names_become_folders_that_stay_in_the_output(tmp_path: Path) -> None:
    """X11, C07: no name leads elsewhere, none is too long, and none is that of another."""
    _touch(tmp_path, "a/b/1.h5", "a-b/1.h5", "CON/1.h5", "ä ö/1.h5", f"{'x' * 200}/1.h5", "new\nline/1.h5", "nul/1.h5")
    slugs = [item.slug for item in find_items(tmp_path)[0]]
    assert len(set(slugs)) == len(slugs) == 7
    assert all(len(slug) <= 80 and slug.isascii() and "/" not in slug and not slug.startswith(".") for slug in slugs)


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


@pytest.mark.parametrize("of", [1, 3, 7])
def test_shards_together_are_all_items(lay: Lay, tmp_path: Path, of: int) -> None:
    """None twice, none left out, and no shard has more than one item more than another."""
    root = lay({f"{i:02d}": "fine" for i in range(5)})
    shards = [statuses(obey(root, out=tmp_path / f"{number}", shard=(number, of))) for number in range(1, of + 1)]
    assert sorted(name for one in shards for name in one) == [f"{i:02d}" for i in range(5)]
    assert max(map(len, shards)) - min(map(len, shards)) <= 1


@pytest.mark.parametrize("text", ["0/4", "5/4", "1", "a/b", "-1/3", "1/0", "1/4/2", "/", "1/99999999999999"])
def test_what_is_no_shard_is_refused(text: str) -> None:
    """C02."""
    with pytest.raises(UsageError) as refused:
        read_shard(text)
    assert refused.value.code == "RRID-C02"
    assert read_shard("2/4") == (2, 4)
    assert read_shard(None) == (1, 1)


def test_a_folder_that_cannot_be_listed_is_an_item_of_its_own(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It fails alone (F13), and the logs beside it are not given with it."""
    _touch(tmp_path, "a/1.h5", "a/shut/2.h5", "b/3.h5")
    listed = Path.iterdir

    def iterdir(folder: Path) -> Iterator[Path]:
        if folder.name == "shut":
            raise PermissionError(13, "Permission denied", str(folder))
        return listed(folder)

    monkeypatch.setattr(Path, "iterdir", iterdir)
    items, _ = find_items(tmp_path)
    given = {item.name: [path.relative_to(tmp_path).as_posix() for path in item.paths] for item in items}
    assert given == {"a": ["a/1.h5"], "a/shut": ["a/shut"], "b": ["b"]}
