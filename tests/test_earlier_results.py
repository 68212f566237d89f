"""rrrid's own earlier output of a command is replaced; that of another command is refused with a hint (C05)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from pipelines import convert, inspect
from pipelines.errors import UsageError
from pipelines.io.files import write_log
from pipelines.stage import Outcome, Request, run_stage
from tests.folders import contents
from tests.io.logs import small_log


@pytest.fixture
def days(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folders of one name, "logs", of one robot: of monday and of tuesday."""
    for day, name in {"monday": "a", "tuesday": "b"}.items():
        write_log(tmp_path / day / f"logs/{name}.h5", small_log(name=name))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _converted(day: str, **more: Any) -> Outcome[Any]:
    return run_stage(convert.STAGE, Request((Path(day) / "logs",), no_report=True, **more), convert.Settings())


def _inspected(day: str, **more: Any) -> Outcome[Any]:
    return run_stage(inspect.STAGE, Request((Path(day) / "logs",), no_report=True, **more), inspect.Settings())


@pytest.mark.row("C05")
def test_a_result_of_another_command_is_refused(days: Path) -> None:
    """Before anything is computed, and untouched; --force replaces it. The same command's is replaced without a word."""
    out = Path("out")
    _converted("monday", out=out)
    before = contents(out)
    with pytest.raises(UsageError, match=r"RRID-C05 out: holds the earlier result of convert.*--out.*--force"):
        _inspected("monday", out=out)
    assert contents(out) == before
    for day in ("tuesday", "monday"):
        assert not [check for check in _converted(day, out=out).checks if check.code == "RRID-C05"]
    assert contents(out).keys() == before.keys()
    _inspected("monday", out=out, force=True)
    assert not (out / "logs").exists()
    assert [path.name for path in days.glob("out*")] == ["out"]
