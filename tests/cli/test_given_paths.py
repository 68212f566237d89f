"""Errors tell a path as the user gave it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from pipelines.io.files import write_log
from tests.cli.commands import rrrid
from tests.io.logs import small_log


@pytest.mark.parametrize(("words", "place"), [
    (("diagnose", "logs", "--identify", "no.h5"), "no.h5: "),
    (("report", "empty"), "empty: "),
    (("run", "no", "--dry-run"), "no: "), (("batch", "empty"), "empty: "), (("batch", "./empty"), "empty: "),
    (("batch", "."), ".: "),
    (("batch", "../w/logs", "--out", "../w/logs/out"), "../w/logs/out: lies inside the input ../w/logs."),
    (("inspect", "logs", "--out=file/in/it"), "file/in/it: lies below file, ")])
def test_a_path_is_told_as_it_was_given(words: tuple[str, ...], place: str, tmp_path: Path) -> None:
    """No working folder before a path that was given without one; one that was given absolute stays so."""
    home = tmp_path / "w"
    (home / "empty").mkdir(parents=True)
    (home / "file").touch()
    if words != ("batch", "."):
        write_log(home / "logs/a.h5", small_log())
    said = rrrid(*words, cwd=home).stderr
    assert re.fullmatch(rf"rrrid: RRID-\w\d\d {re.escape(place)}.*\n", said), said
    assert str(home) not in said
    assert f" {home}/empty: " in rrrid("report", home / "empty", cwd=home).stderr
