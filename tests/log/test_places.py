"""Names of files and folders: plain, short, told apart, and silent about where a user lives."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipelines.log.places import renamed, short_names, slug, tilde, told_apart
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
