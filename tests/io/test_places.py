"""Names of files and folders: plain, short, told apart, and silent about where a user lives; and which folders stay as they are."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from pipelines.errors import UsageError
from pipelines.io.output import refuse_foreign, renamed, short_names, slug, tilde, told_apart
from pipelines.stage import footer_of


def test_places_are_told_apart_by_the_shortest_names() -> None:
    """One folder needs no name; two of one name get numbers; only whole paths are renamed."""
    names = short_names([Path("/x/A/logs/a.h5"), Path("/x/B/logs/a.h5"), Path("/x/A/logs/b.h5")])
    assert names == {"/x/A/logs": "logs", "/x/B/logs": "logs-2"}
    assert renamed(("/x/A/logs/a.h5, signal q", "in /x/B/logs: no", "/x/A/logs2/a.h5", "/mnt/x/A/logs/a.h5"), names) == (
        "logs/a.h5, signal q", "in logs-2: no", "/x/A/logs2/a.h5", "/mnt/x/A/logs/a.h5")
    assert renamed("/x/A/a.h5", short_names([Path("/x/A/a.h5")])) == "a.h5"


@pytest.mark.parametrize("text", ["../../etc/passwd", "/abs", "CON", "nul.h5", "", "ä" * 300, "a\nb", "..", "-rf", "con.parquet"])
def test_a_name_never_leaves_its_folder(text: str) -> None:
    """X11, C07: whatever an identifier says, its file name is plain, short, and its own."""
    name = slug(text)
    assert 1 <= len(name) <= 80
    assert set(name) <= set("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-")
    assert name[0] not in ".-"
    assert name.split(".")[0].upper() not in {"CON", "NUL"}
    assert slug(text) == name
    assert slug(text + "x") != name


def test_names_that_need_no_change_stay() -> None:
    """A plain name is its own slug, and different names never share one."""
    assert slug("excitation-1.a_B") == "excitation-1.a_B"
    assert slug("a b") != slug("a-b") != slug("a/b")


def test_the_home_folder_is_not_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """X14: results and reports write ~ where a path goes through the user's home."""
    monkeypatch.setenv("HOME", "/home/alice")
    assert tilde({"/home/alice/a": ["/home/alice/logs/x.h5", 3]}) == {"~/a": ["~/logs/x.h5", 3]}


def test_files_of_one_name_are_told_apart() -> None:
    """By as many folders as that takes, and only those of one name: by what a report says at its foot none is lost."""
    names = {"/x/monday/logs/1.h5": "monday/logs/1.h5", "/x/friday/logs/1.h5": "friday/logs/1.h5", "/x/friday/logs/2.h5": "2.h5",
             "/y/1.h5": "y/1.h5", "1.h5": "1.h5"}
    assert told_apart(names) == names
    assert told_apart(["/1.h5", "/a/1.h5"]) == {"/1.h5": "/1.h5", "/a/1.h5": "a/1.h5"}
    foot = footer_of("compare", {"/x/a/model.json": "0" * 64, "/x/b/model.json": "1" * 64})
    assert {key: value for key, value in foot.items() if key.startswith("input")} == {
        "input a/model.json": "0" * 16, "input b/model.json": "1" * 16}


def test_a_folder_without_our_provenance_is_never_replaced(tmp_path: Path) -> None:
    """C05: not even with --force; an empty folder is fine."""
    (tmp_path / "out").mkdir()
    refuse_foreign(tmp_path / "out")
    (tmp_path / "out/x").write_text("")
    with pytest.raises(UsageError, match="RRID-C05"):
        refuse_foreign(tmp_path / "out", force=True)
    (tmp_path / "link").symlink_to(tmp_path / "out")
    with pytest.raises(UsageError, match="RRID-C05"):
        refuse_foreign(tmp_path / "link")


@pytest.mark.parametrize(("inside", "out"), [(".", "."), ("figures", "..")])
def test_the_folder_one_is_in_is_not_replaced_under_one(inside: str, out: str, tmp_path: Path,
                                                        monkeypatch: pytest.MonkeyPatch) -> None:
    """C05: the shell would stay in one that is gone, and find nothing there."""
    (tmp_path / "out/figures").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "out" / inside)
    with pytest.raises(UsageError, match="RRID-C05 .*is the folder you are in"):
        refuse_foreign(Path(out))
    (tmp_path / "other").mkdir()
    refuse_foreign(tmp_path / "other")


def test_a_large_folder_of_somebody_else_is_not_walked_through(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """C05: three files that are not rrrid's are enough; `--out /usr` took seconds before it was refused."""
    for number in range(30):
        (tmp_path / f"out/folder-{number:02}").mkdir(parents=True)
        (tmp_path / f"out/folder-{number:02}/file").write_text("")
    seen: list[object] = []
    look = os.listdir
    monkeypatch.setattr("pipelines.io.output.os.listdir", lambda folder: seen.append(folder) or look(folder))
    with pytest.raises(UsageError, match=r"RRID-C05 .*did not write there: folder-00/file, folder-01/file, folder-02/file\."):
        refuse_foreign(tmp_path / "out")
    assert len(seen) < 10
