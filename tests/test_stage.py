"""The anatomy every stage shares: what is written, in what order, and what is never touched."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import time
import warnings
from dataclasses import dataclass
from pathlib import Path

import pytest

from pipelines import convert
from pipelines.errors import Check, InputRejected, UsageError
from pipelines.log.files import write_log
from pipelines.report.report import Report
from pipelines.stage import Inputs, Request, Stage, read_logs, refuse_foreign, run_stage, slug, tilde
from tests.log.logs import small_log


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    """A folder with one good log."""
    folder = tmp_path / "logs"
    folder.mkdir()
    write_log(folder / "a.h5", small_log())
    return folder


def _request(logs: Path, **more: object) -> Request:
    return Request((logs,), out=logs.parent / "out", **more)  # type: ignore[arg-type]


def _contents(folder: Path) -> dict[str, str]:
    return {p.relative_to(folder).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.rglob("*") if p.is_file()}


def test_provenance_names_every_input_and_output_by_hash(logs: Path) -> None:
    """Anyone can check what was made of what: every file of the folder, provenance.json apart, and every input."""
    outcome = run_stage(convert.STAGE, _request(logs), convert.Settings())
    about = json.loads((outcome.folder / "provenance.json").read_text())
    there = _contents(outcome.folder)
    there.pop("provenance.json")
    assert about["outputs"] == there
    assert about["inputs"] == {tilde(str(logs / "a.h5")): hashlib.sha256((logs / "a.h5").read_bytes()).hexdigest()}
    assert about["settings"] == {"to": ""}
    assert {"logs/a.parquet", "result.json", "report.html"} <= set(there)


def test_equal_inputs_give_equal_bytes(logs: Path) -> None:
    """Run twice, everything but provenance.json is the same to the byte: durations stand there alone."""
    first = _contents(run_stage(convert.STAGE, _request(logs), convert.Settings()).folder)
    second = _contents(run_stage(convert.STAGE, _request(logs), convert.Settings()).folder)
    assert first.pop("provenance.json") != second.pop("provenance.json")
    assert first == second


def test_own_output_is_replaced_and_foreign_files_are_refused(logs: Path) -> None:
    """C05: rrrid's earlier output goes, another's files never do, and nothing is written inside an input."""
    request = _request(logs)
    run_stage(convert.STAGE, request, convert.Settings("csv"))
    run_stage(convert.STAGE, request, convert.Settings("parquet"))
    assert not (logs.parent / "out/csv").exists()
    (logs.parent / "out/thesis.tex").write_text("years of work")
    with pytest.raises(UsageError, match=r"RRID-C05 .*thesis\.tex"):
        run_stage(convert.STAGE, request, convert.Settings())
    assert (logs.parent / "out/thesis.tex").read_text() == "years of work"
    for out in (logs, logs / "deep/er"):
        with pytest.raises(UsageError, match="RRID-C05 .*inside the input"):
            run_stage(convert.STAGE, Request((logs,), out=out), convert.Settings())


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


@dataclass(frozen=True)
class _Nothing:
    pass


def _stage(compute: object, **more: object) -> Stage[_Nothing, _Nothing]:
    return Stage("convert", "A stage to test with", _Nothing, compute, lambda result: Report("Test", "done"), read_logs,  # type: ignore[arg-type]
                 **more)


def test_an_input_that_changes_meanwhile_is_refused(logs: Path) -> None:
    """F14: the log is written over while the stage computes; nothing is left, not even a draft."""

    def meddle(inputs: Inputs, settings: _Nothing) -> _Nothing:
        write_log(logs / "a.h5", small_log(name="other"))
        return _Nothing()

    with pytest.raises(InputRejected, match=r"RRID-F14 .*a\.h5: was modified while it was processed"):
        run_stage(_stage(meddle), _request(logs), _Nothing())
    assert [p.name for p in logs.parent.iterdir()] == ["logs"]


def test_strict_turns_a_repair_into_an_error(logs: Path) -> None:
    """--strict: what would be mended with a word is refused, with the same code."""
    mended = Check.of("T02", "repair", "2 samples dropped", where="a")
    repaired = _stage(lambda inputs, settings: _Nothing(), checks=lambda result: (mended,))
    assert run_stage(repaired, _request(logs), _Nothing()).exit_code == 0
    with pytest.raises(InputRejected, match="RRID-T02 a: 2 samples dropped"):
        run_stage(repaired, _request(logs, strict=True), _Nothing())


def test_a_failed_stage_leaves_the_earlier_result(logs: Path) -> None:
    """Whatever goes wrong while writing, the old folder stands and no draft lies about."""
    run_stage(convert.STAGE, _request(logs), convert.Settings())
    before = _contents(logs.parent / "out")

    def fail(result: _Nothing, folder: Path, request: Request) -> None:
        (folder / "half").write_text("written")
        raise InputRejected("T08", "one sample")

    with pytest.raises(InputRejected):
        run_stage(_stage(lambda inputs, settings: _Nothing(), write=fail), _request(logs), _Nothing())
    assert _contents(logs.parent / "out") == before
    assert sorted(p.name for p in logs.parent.iterdir()) == ["logs", "out"]


def test_a_killed_stage_leaves_the_old_folder_or_the_new_one(logs: Path) -> None:
    """P01: SIGKILL at 40 points of a run that replaces its own output: a folder whose every file fits its provenance."""
    request, kinds = _request(logs, no_report=True), set()
    run_stage(convert.STAGE, request, convert.Settings("csv"))
    for kill in range(40):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            child = os.fork()
        if child == 0:
            while True:
                run_stage(convert.STAGE, request, convert.Settings("parquet"))
                run_stage(convert.STAGE, request, convert.Settings("csv"))
        time.sleep(0.01 * kill)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        there = _contents(logs.parent / "out")
        about = json.loads((logs.parent / "out/provenance.json").read_text())
        there.pop("provenance.json")
        assert about["outputs"] == there
        kinds.add(about["settings"]["to"])
    assert kinds == {"csv", "parquet"}
    run_stage(convert.STAGE, request, convert.Settings("csv"))
    assert sorted(p.name for p in logs.parent.iterdir()) == ["logs", "out"]


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
