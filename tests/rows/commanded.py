"""A command as a user gives it: its exit code, what it prints, the error or the checks it tells."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from tests.cli.commands import rrrid

__all__ = ["Command", "Done", "command"]


@dataclass(frozen=True)
class Done:
    """How a command ended."""

    exit: int
    out: str
    err: str
    object: dict[str, Any] = field(default_factory=dict)  # what --json printed

    @property
    def error(self) -> dict[str, str]:
        found: dict[str, str] = self.object.get("error", {})
        return found

    def told(self, code: str) -> list[dict[str, Any]]:
        """The checks of this row that a result holds, those in order left out."""
        return [c for c in self.object.get("checks", []) if c["code"] == f"RRID-{code}" and c["level"] != "ok"]

    def refused(self, code: str, exit_code: int, where: str = "", says: str = "") -> None:
        """One line on standard error, its code, exit code, place and remedy; no traceback."""
        assert (self.exit, self.error.get("code")) == (exit_code, f"RRID-{code}"), self.err
        assert self.err.startswith(f"rrrid: RRID-{code} ")
        assert self.err.count("\n") == 1
        assert where in self.error["where"], self.error
        assert self.error["where"]
        assert says in " ".join(self.error.values()), self.error
        assert self.error["remedy"], self.error


Command = Callable[..., Done]

# Rows that ask for no word: strange names work, hostile texts are inert, nothing is opened or told.
_SILENT = {"C07", "X06", "X08", "X09", "X10", "X11", "X13", "X14", "P13"}


@pytest.fixture
def command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Iterator[Command]:
    """`command("inspect", "a.h5")` in tmp_path, with --json. A test that bears a row has to have met its code in the end."""
    met = set[str]()

    def run(*words: object, as_json: bool = True) -> Done:
        done = rrrid(*words, *(["--json"] if as_json else []), cwd=tmp_path)
        met.update(re.findall(r"RRID-([A-Z]\d\d)", done.stdout + done.stderr))
        told = json.loads(done.stdout) if as_json and done.stdout else {}
        return Done(done.returncode, done.stdout, done.stderr, told)

    yield run
    borne = {row for mark in request.node.iter_markers("row") for row in mark.args}
    assert borne - met <= _SILENT, f"bears {sorted(borne)}, and met {sorted(met)}"
