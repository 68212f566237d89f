"""Names of files and folders: plain, short, told apart, and silent about where a user lives; and which folders stay as they are."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipelines.errors import UsageError
from pipelines.io.output import refuse_foreign, slug, tilde


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


def test_the_home_folder_is_not_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """X14: results and reports write ~ where a path goes through the user's home."""
    monkeypatch.setenv("HOME", "/home/alice")
    assert tilde({"/home/alice/a": ["/home/alice/logs/x.h5", 3]}) == {"~/a": ["~/logs/x.h5", 3]}


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
